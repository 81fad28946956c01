# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow maps that a device keeps over frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .passes.shadow_map import ShadowMap

CACHE_BYTES = 1 << 29
"""Of maps that are kept; those beyond are drawn again each time."""
BYTES_PER_TEXEL = 4

Size = tuple[int, int]


class KeptShadowMaps:
    """Maps by a hash of what they depend on: those that the latest frame asked for, as far as there is room."""

    def __init__(self) -> None:
        self._maps: dict[str, ShadowMap] = {}
        self._asked: set[str] = set()
        self._nbytes = 0

    def get(self, key: str) -> ShadowMap | None:
        """The map of that key, if it is kept."""
        self._asked.add(key)
        return self._maps.get(key)

    def has_room(self, size: Size) -> bool:
        """Whether another map of so many texels may be kept."""
        return self._nbytes + map_bytes(size) <= CACHE_BYTES

    def add(self, key: str, found: ShadowMap) -> None:
        """Keeps a map."""
        self._maps[key] = found
        self._nbytes += map_bytes(found.texture.size)

    def end_frame(self) -> None:
        """Lets go of the maps that were not asked for in the frame."""
        for key in [key for key in self._maps if key not in self._asked]:
            self._nbytes -= map_bytes(self._maps.pop(key).texture.size)
        self._asked = set()

    def __len__(self) -> int:
        return len(self._maps)


def map_bytes(size: Size) -> int:
    """Of one map of so many texels, on the device."""
    return size[0] * size[1] * BYTES_PER_TEXEL
