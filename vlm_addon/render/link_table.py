# SPDX-License-Identifier: GPL-3.0-or-later
"""Links between lights and surfaces as a texture in which one place says whether a pair of tag ids is linked.

A hash table: a shader that searched sorted pairs would add a loop for each light and pixel, and software renderers end
all loops of an invocation after 65,535 rounds together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..core.errors import DeviceError
from ..core.scene import UNTAGGED, Int32

if TYPE_CHECKING:
    import moderngl

Uint32 = npt.NDArray[np.uint32]

LIGHT_LINKS = "LIGHT_LINKS"
"""Defined for the shaders of light meshes that have links."""
LINK_UNIT = 13
"""Texture unit beside those of the G-buffer, of the tables and of baked visibility."""
_BUCKET_PAIRS = 4
_TEXEL_PAIRS = 2
_BUCKETS_ACROSS = 512
_LARGEST_BITS = 24
# Odd, so that each tag id counts with all of its bits; otherwise any will do.
_HASH = {"LINK_HASH_LIGHT": 0x5BD1E995, "LINK_HASH_SURFACE": 0x2C1B3C6D, "LINK_HASH_MIX": 0x297A2D39}
_HASH_SHIFT = 15
TAG_DEFINES: dict[str, int | float | bool | str] = {
    **_HASH,
    "LINK_HASH_SHIFT": _HASH_SHIFT,
    "LIGHT_LINK_UNIT": LINK_UNIT,
    "UNTAGGED": UNTAGGED,
}
"""What passes/light_tags.glsl needs."""


class LinkTable:
    """The links of a light mesh on the device."""

    def __init__(self, context: moderngl.Context, links: Int32) -> None:
        """links: (k, 2) int32, k > 0. Raises DeviceError where they cannot be spread."""
        texels = link_texels(links)
        height, width, channels = texels.shape
        self._texture = context.texture((width, height), channels, texels.tobytes(), dtype="i4")

    def bind(self) -> None:
        """Binds the table to LINK_UNIT."""
        self._texture.use(LINK_UNIT)


def link_texels(links: Int32) -> Int32:
    """(h, w, 4) int32: two texels for each bucket, two pairs (light tag, receiver tag) in each, UNTAGGED where free.

    There are as many buckets as the least power of two with which none overflows. Raises DeviceError where none does.
    """
    hashed = _hashes(links)
    for bits in range(_LARGEST_BITS + 1):
        bucket = (hashed & np.uint32((1 << bits) - 1)).astype(np.intp)
        counts = np.bincount(bucket, minlength=1 << bits)
        if counts.max() <= _BUCKET_PAIRS:
            return _filled(links, bucket, counts)
    raise DeviceError(f"{len(links):,} links of tag ids cannot be told apart; use other tag ids")


def _hashes(links: Int32) -> Uint32:
    """(k,), as `link_hash` in passes/light_tags.glsl."""
    light, surface = links.astype(np.uint32).T
    mixed = light * np.uint32(_HASH["LINK_HASH_LIGHT"]) + surface * np.uint32(_HASH["LINK_HASH_SURFACE"])
    mixed = (mixed ^ (mixed >> np.uint32(_HASH_SHIFT))) * np.uint32(_HASH["LINK_HASH_MIX"])
    return np.asarray(mixed ^ (mixed >> np.uint32(_HASH_SHIFT)), np.uint32)


def _filled(links: Int32, bucket: npt.NDArray[np.intp], counts: npt.NDArray[np.intp]) -> Int32:
    order = np.argsort(bucket, kind="stable")
    place = np.arange(len(links)) - np.repeat(np.cumsum(counts) - counts, counts)
    table = np.full((len(counts), _BUCKET_PAIRS, 2), UNTAGGED, np.int32)
    table[bucket[order], place] = links[order]
    across = min(len(counts), _BUCKETS_ACROSS)
    return table.reshape(len(counts) // across, across * _BUCKET_PAIRS // _TEXEL_PAIRS, 2 * _TEXEL_PAIRS)
