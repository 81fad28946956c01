# SPDX-License-Identifier: GPL-3.0-or-later
"""Links between lights and surfaces as a property of a light mesh object."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.errors import InvalidInput
from ...core.light_links import make_links
from ...core.scene import Int32
from ..names import LINKS_PROPERTY


def read_links(thing: Any) -> Int32:
    """(k, 2) int32: the links of a light mesh object. Raises InvalidInput where its property holds none."""
    stored = thing.get(LINKS_PROPERTY)
    if stored is None:
        return make_links([])
    values = np.asarray(stored.to_list() if hasattr(stored, "to_list") else stored)
    if values.ndim != 1 or len(values) % 2 or (len(values) and values.dtype.kind not in "iu"):
        subject = f"light mesh {thing.name!r}"
        problem = f"its property {LINKS_PROPERTY} holds no pairs of tag ids"
        raise InvalidInput(subject, problem, "remove it (Object > Custom Properties) and link again")
    return make_links(values.reshape(-1, 2))


def write_links(thing: Any, links: Int32) -> None:
    """Store links as `make_links` gives them; without any there is no property."""
    if len(links):
        thing[LINKS_PROPERTY] = links.ravel().tolist()
    elif LINKS_PROPERTY in thing:
        del thing[LINKS_PROPERTY]
