# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflective shadow maps that a device keeps over frames."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .passes.rsm import MapTextures, ReflectiveShadowMap

BYTES_PER_TEXEL = 70
"""Four images of 16 bytes, a third more for the mip levels of one."""


class KeptMaps:
    """Maps that a device keeps over frames, by what they depend on."""

    def __init__(self) -> None:
        self._maps: dict[str, ReflectiveShadowMap] = {}
        self._spare: dict[tuple[int, int], list[MapTextures]] = {}
        self._is_asked = False

    def keep_only(self, keys: Collection[str]) -> None:
        """Lets go of all other maps; their textures are drawn into again until `drop_spare`."""
        self._is_asked = True
        for key in [key for key in self._maps if key not in keys]:
            textures = self._maps.pop(key).textures
            self._spare.setdefault(textures.flux.size, []).append(textures)

    def end_frame(self) -> None:
        """Lets go of everything where the frame needed no maps at all."""
        if not self._is_asked:
            self._maps.clear()
            self._spare.clear()
        self._is_asked = False

    def drop_spare(self) -> None:
        """Lets go of the textures of maps that are no longer kept."""
        self._spare.clear()

    def spare(self, size: tuple[int, int]) -> MapTextures | None:
        """Textures of that size whose map is no longer kept, if there are any."""
        found = self._spare.get(size)
        return found.pop() if found else None

    def get(self, key: str) -> ReflectiveShadowMap | None:
        """The map of that key, if it is kept."""
        return self._maps.get(key)

    def add(self, key: str, found: ReflectiveShadowMap) -> None:
        """Keeps a map."""
        self._maps[key] = found

    @property
    def nbytes(self) -> int:
        """Of all maps, on the device."""
        return sum(map_bytes(found.flux.size) for found in self._maps.values())


def map_bytes(size: tuple[int, int]) -> int:
    """Of one map of so many texels, on the device."""
    return size[0] * size[1] * BYTES_PER_TEXEL
