# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of the world's lights light which pictures of a frame.

The world needs many lights for its soft shadows, and the pictures of a frame are averaged. A light that brings little
is therefore left out of most pictures and counts as much more in the others; one that brings much is in every picture,
so that the edges of things that it lights are smooth.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..core.scene import Float64, Light
from ..core.world_light import LUMINANCE

ENOUGH_LIGHTS = 16
"""A light that brings at least one over this of the world's light is in every picture."""
DIRECT_FACTOR = 4
"""More lights than elsewhere at most: where shadows fall is seen, while what bounces is a mean over a surface."""


def direct_world_lights(world_lights: int, pictures: int) -> int:
    """How many lights stand for the world in the direct light of a frame, where `world_lights` do elsewhere."""
    return min(max(ENOUGH_LIGHTS * pictures, world_lights), DIRECT_FACTOR * world_lights)


def picture_shares(lights: Sequence[Light], pictures: int) -> Float64:
    """(pictures, n) weight of each light in each picture; the mean over the pictures is 1 for each.

    1 for lamps. Those from the world that come at the same interval take turns in the order of the list, where
    neighbours are near each other on the sphere, so each picture has some from everywhere.
    """
    shares = np.ones((pictures, len(lights)))
    world = [index for index, light in enumerate(lights) if light.from_world]
    brought = np.array([lights[index].power for index in world], np.float64).reshape(-1, 3) @ LUMINANCE
    # Not tied to where the pictures look in a pixel.
    turns = np.random.default_rng(pictures).permutation(pictures)
    most = math.floor(math.log2(pictures))
    places: Counter[int] = Counter()
    for index, part in zip(world, brought, strict=True):
        rarity = max(brought.sum() / (ENOUGH_LIGHTS * max(part, 1e-300)), 1.0)
        interval = 2 ** min(math.floor(math.log2(rarity)), most)
        is_used = turns % interval == places[interval] % interval
        places[interval] += 1
        shares[:, index] = is_used * (pictures / is_used.sum())
    return shares
