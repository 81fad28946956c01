# SPDX-License-Identifier: GPL-3.0-or-later
"""What has become of the objects that light meshes were made from: gone, hidden, moved or changed; told by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..core.scene import Finding
from .baking.bake_state import made_from
from .light_meshes import light_meshes, source_names, sources

NAMED = 3
"""How many objects a sentence names; the others are counted."""
GONE, HIDDEN = "is gone", "shows no surface in renders"


def changed_sources(scene: Any, now: Mapping[str, str]) -> list[Finding]:
    """A finding for each light mesh whose sources are not as when it was made.

    now: hash of each surface that the scene shows, by name of object, as `surface_hashes` tells.
    """
    found = []
    for thing in light_meshes(scene):
        problems = missing_sources(thing, scene, now)
        before = made_from(thing)
        changed = [
            source.name
            for name, source in zip(source_names(thing), sources(thing, scene), strict=True)
            if source is not None and name in before and before[name] != now.get(source.name, before[name])
        ]
        problems += [f"{listed(changed)} moved or changed since it was made"] if changed else []
        if problems:
            remedy = "use Create Again, or delete it where it stands for nothing any more"
            found.append(Finding(f"light mesh {thing.name!r}", "; ".join(problems), remedy))
    return found


def missing_sources(thing: Any, scene: Any, shown: Iterable[str]) -> list[str]:
    """Which sources of a light mesh are gone, and which are none of the objects `shown`, in phrases."""
    pairs = list(zip(source_names(thing), sources(thing, scene), strict=True))
    names = set(shown)
    return phrases(
        [name for name, source in pairs if source is None],
        [source.name for _, source in pairs if source is not None and source.name not in names],
    )


def phrases(gone: Sequence[str], hidden: Sequence[str]) -> list[str]:
    """What is said of objects that are gone and of those that are hidden from renders; none where there are none."""
    return [f"{listed(names)} {what}" for names, what in ((gone, GONE), (hidden, HIDDEN)) if names]


def listed(names: Sequence[str]) -> str:
    """The first of some names, quoted, and how many more there are."""
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(repr(name) for name in names[:NAMED]) + more
