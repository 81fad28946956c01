# SPDX-License-Identifier: GPL-3.0-or-later
"""Links between lights and surfaces as properties of a light mesh object: all of them, and those that pairing made."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.light_links import is_link, make_links
from ...core.scene import Int32
from ..names import LINKS_PROPERTY, PAIRED_LINKS_PROPERTY
from ..stored_values import remove_value, set_value, whole_numbers, wrong_value


def read_links(thing: Any) -> Int32:
    """(k, 2) int32: the links of a light mesh object. Raises InvalidInput where its property holds none."""
    return _read(thing, LINKS_PROPERTY)


def read_paired_links(thing: Any) -> Int32:
    """(p, 2) int32: those of its links that pairing has made. Raises InvalidInput where a property holds no links."""
    return common_links(_read(thing, PAIRED_LINKS_PROPERTY), read_links(thing))


def common_links(one: Int32, other: Int32) -> Int32:
    """The links of `one` that are among those of `other`."""
    return make_links(one[is_link(one, other)])


def _read(thing: Any, name: str) -> Int32:
    values = whole_numbers(thing, name)
    if len(values) % 2:
        raise wrong_value(thing, name, "pairs of tag ids")
    return make_links(values.reshape(-1, 2))


def mark_paired(thing: Any, paired: Int32) -> None:
    """Take the links `paired`, as far as the light mesh has them, for made by pairing."""
    write_links(thing, read_links(thing), make_links(np.concatenate([read_paired_links(thing), paired])))


def write_links(thing: Any, links: Int32, paired: Int32 | None = None) -> None:
    """Store links as `make_links` gives them, and which of them pairing has made: by default those that it had of
    them; without any there is no property."""
    made = common_links(_read(thing, PAIRED_LINKS_PROPERTY) if paired is None else paired, links)
    for name, stored in ((LINKS_PROPERTY, links), (PAIRED_LINKS_PROPERTY, made)):
        if not len(stored):
            remove_value(thing, name)
        elif not np.array_equal(_read(thing, name), stored):
            set_value(thing, name, stored.ravel().tolist())
