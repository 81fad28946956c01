# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that are changed for a while and always put back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any


@contextmanager
def restored(owner: Any, **values: Any) -> Iterator[None]:
    """Sets each named property of a Blender struct and restores all of them at the end, in reverse order.

    Names that this version of Blender does not know are passed over.
    """
    changed: list[tuple[str, Any]] = []
    try:
        for name, value in values.items():
            if hasattr(owner, name):
                changed.append((name, getattr(owner, name)))
                setattr(owner, name, value)
        yield
    finally:
        for name, value in reversed(changed):
            setattr(owner, name, value)


def present(owner: Any, names: Sequence[str]) -> dict[str, Any]:
    """The values of those properties of a Blender struct that this version of Blender knows."""
    return {name: getattr(owner, name) for name in names if hasattr(owner, name)}
