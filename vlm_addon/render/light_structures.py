# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures over the virtual lights, kept over frames: static and dynamic lights apart, the latest of each.

They are made in world space from geometry alone, so neither a lamp nor the camera makes one anew.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from ..core.array_codec import content_hash
from ..core.light_clusters import light_clusters
from ..core.light_mesh import VirtualLightMesh
from ..core.light_tree import build_light_tree
from ..core.scene import Float32
from .light_forest import LitTree

T = TypeVar("T")

STATIC, DYNAMIC = "static", "dynamic"


class LightStructures:
    """A device's structures. built: how often each kind was made, by name, since the device was opened."""

    def __init__(self) -> None:
        self._kept: dict[str, tuple[str, Any]] = {}
        self.built: dict[str, int] = {}

    def trees(self, light_mesh: VirtualLightMesh, radiosity: Float32, tolerance: float) -> list[LitTree]:
        """Trees of the static and of the dynamic lights, without those of no lights, and what they send out.

        light_mesh: in world space. radiosity: (n, 3) W/m².
        """
        result = []
        lit_by = content_hash([radiosity, tolerance])
        for kind, chosen in chosen_lights(light_mesh).items():
            if not chosen.any():
                continue
            shape = shape_hash(light_mesh, chosen)

            def build(chosen: npt.NDArray[np.bool_] = chosen) -> Any:
                return build_light_tree(light_mesh, chosen)

            tree = self.kept(f"{kind}_tree", shape, build)

            def relight(tree: Any = tree) -> LitTree:
                return LitTree(tree, light_clusters(tree, light_mesh, radiosity.astype(np.float64), tolerance))

            # The scale of all light comes into it, so lights that are not in the tree do, too.
            state = f"{shape} {content_hash(light_mesh.areas)} {lit_by}"
            result.append(self.kept(f"{kind}_clusters", state, relight))
        return result

    def kept(self, kind: str, key: str, make: Callable[[], T]) -> T:
        """What `make` made last time for this kind if that had the same key, else what it makes now."""
        found = self._kept.get(kind)
        if found is None or found[0] != key:
            # The old one is let go of before there is a new one.
            self._kept.pop(kind, None)
            found = key, make()
            self._kept[kind] = found
            self.built[kind] = self.built.get(kind, 0) + 1
        return found[1]


def chosen_lights(light_mesh: VirtualLightMesh) -> dict[str, npt.NDArray[np.bool_]]:
    """(n,) bool by kind of light."""
    return {STATIC: ~light_mesh.dynamic, DYNAMIC: light_mesh.dynamic}


def shape_hash(light_mesh: VirtualLightMesh, chosen: npt.NDArray[np.bool_]) -> str:
    """Hash of all that a structure over the `chosen` lights depends on."""
    return content_hash([chosen, light_mesh.corners[chosen], light_mesh.tag_ids[chosen]])
