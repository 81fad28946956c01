# SPDX-License-Identifier: GPL-3.0-or-later
"""What techniques that draw reflective shadow maps have in common: how the maps are, and what is shown of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from ..core.scene import Float32
from ..core.settings import OWN, setting
from .passes.accumulate import read_image
from .passes.rsm import LampReflections, ReflectiveShadowMap

MOST_IMAGES = 10
"""Maps of a frame that are shown: the world alone may have hundreds."""


@dataclass(frozen=True)
class MapSettings:
    """How the maps of lamps are drawn."""

    resolution: int = setting(
        256,
        "texels",
        8,
        2048,
        "Along each face of a map all around a lamp, to the nearest power of two; a map of one view has twice as many "
        "along each side, one of an area lamp half, one of a wide part of the world a quarter",
        source="001, 4; 003, 6.2.2",
    )
    area_maps: int = setting(
        4,
        "count",
        1,
        64,
        "Points of an area lamp that have a map each; one in its middle is off near the lamp",
        source=OWN,
    )


def shown_maps(maps: LampReflections) -> Iterator[ReflectiveShadowMap]:
    """Those that pictures are made of."""
    return islice(maps.maps(), MOST_IMAGES)


def map_images(maps: LampReflections) -> dict[str, Float32]:
    """Of the first maps, by number and part, in their own sizes: position in world space in m, normal, flux in W, and
    depth along the view in m; 0 where a map shows nothing; row 0 at the top."""
    images: dict[str, Float32] = {}
    for index, found in enumerate(shown_maps(maps)):
        position, normal, flux = (read_image(texture) for texture in (found.position, found.normal, found.flux))
        shown = normal[..., 3:] > 0.0
        parts = {
            "position": np.where(shown, found.space.world_points(position[..., :3]), 0.0),
            "normal": normal[..., :3],
            "flux": flux[..., :3] * found.space.unit**2,
            "depth": np.where(shown, position[..., 3:] * found.space.unit, 0.0),
        }
        images |= {f"map_{index}_{part}": np.ascontiguousarray(image, np.float32) for part, image in parts.items()}
    return images
