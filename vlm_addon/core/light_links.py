# SPDX-License-Identifier: GPL-3.0-or-later
"""Which surfaces a virtual light leaves out: those of its own tag id (seed 002, 3.4), and those that links name.

A link is a pair of tag ids: lights of the first send no indirect light to surfaces of the second. It goes one way.
Direct light, shadows, the light that reaches the lights themselves (phase one) and what other lights send stay as
they are.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .scene import UNTAGGED, Int32

Bools = npt.NDArray[np.bool_]
Int64 = npt.NDArray[np.int64]

MOST_LINKS = 1 << 16
"""Pairs that a light mesh may have: more come from ids light by light, where one id for all of them says the same."""
_SUBJECT = "links of the light mesh"


def no_links() -> Int32:
    """(0, 2) int32."""
    return np.zeros((0, 2), np.int32)


def make_links(pairs: npt.ArrayLike) -> Int32:
    """(k, 2) int32 of (light tag, receiver tag): each pair of `pairs` once, in rising order.

    A pair of an id with itself is left out: lights leave out their own id anyway. Raises InvalidInput for anything but
    pairs of whole numbers of 32 bits, for UNTAGGED in a pair, and for more than MOST_LINKS.
    """
    found = np.asarray(pairs)
    if found.size == 0:
        return no_links()
    if found.ndim != 2 or found.shape[1] != 2 or found.dtype.kind not in "iu":
        problem = f"an array of shape {found.shape} and type {found.dtype}"
        raise InvalidInput(_SUBJECT, problem, "give pairs of tag ids: of lights, of receivers")
    if (found == UNTAGGED).any():
        raise InvalidInput(_SUBJECT, f"a pair names the tag {UNTAGGED}, which means none", "give both a tag id first")
    wide = found.astype(np.int64)
    if (wide != wide.astype(np.int32)).any():
        raise InvalidInput(_SUBJECT, "a tag id does not fit in 32 bits", "use smaller tag ids")
    unique = np.unique(wide[wide[:, 0] != wide[:, 1]], axis=0).astype(np.int32)
    if len(unique) > MOST_LINKS:
        problem = f"{len(unique):,} pairs, at most {MOST_LINKS:,} are possible"
        raise InvalidInput(_SUBJECT, problem, "give all lights, or all of a receiver, one tag id")
    return unique.reshape(-1, 2)


def require_links(links: Any) -> None:
    """Raises InvalidInput unless `links` are as `make_links` gives them."""
    made = make_links(links)
    if made.shape != links.shape or links.dtype != np.int32 or (made != links).any():
        raise InvalidInput(_SUBJECT, "they are not sorted pairs, each once", "make them with make_links")


def is_link(pairs: Int32, links: Int32) -> Bools:
    """(k,) whether each of `pairs`, (k, 2), is one of `links`."""
    return np.isin(_keys(pairs[:, 0], pairs[:, 1]), _keys(links[:, 0], links[:, 1]))


def leaves_out(links: Int32, light_tags: npt.ArrayLike, surface_tags: npt.ArrayLike) -> Bools:
    """Whether lights of a tag send nothing to surfaces of a tag, of two int32 arrays that are broadcast."""
    of_lights, of_surfaces = np.asarray(light_tags), np.asarray(surface_tags)
    own = (of_surfaces != UNTAGGED) & (of_lights == of_surfaces)
    if len(links) == 0:
        return np.asarray(own)
    keys = _keys(links[:, 0], links[:, 1])
    wanted = _keys(of_lights, of_surfaces)
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.asarray(own | (keys[place] == wanted))


def _keys(first: npt.NDArray[Any], second: npt.NDArray[Any]) -> Int64:
    """One number for each pair, in the order of pairs."""
    return np.asarray((first.astype(np.int64) << 32) + second.astype(np.int64))
