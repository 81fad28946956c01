# SPDX-License-Identifier: GPL-3.0-or-later
"""What a device keeps over frames, so that a frame makes anew only what something has changed for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


class Kept:
    """The latest thing of each kind. built: how often each kind was made, by name, since the device was opened."""

    def __init__(self) -> None:
        self._latest: dict[str, tuple[str, Any]] = {}
        self.built: dict[str, int] = {}

    def get(self, kind: str, key: str, make: Callable[[], T]) -> T:
        """What `make` made last time for this kind if that had the same key, else what it makes now.

        key: a hash of all that the thing depends on (array_codec.content_hash).
        """
        found = self._latest.get(kind)
        if found is None or found[0] != key:
            # The old one is let go of before there is a new one.
            self._latest.pop(kind, None)
            found = key, make()
            self._latest[kind] = found
            self.built[kind] = self.built.get(kind, 0) + 1
        thing: T = found[1]
        return thing
