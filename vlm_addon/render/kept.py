# SPDX-License-Identifier: GPL-3.0-or-later
"""What a device keeps over frames, so that a frame makes anew only what something has changed for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar, runtime_checkable

from .digests import Digests

T = TypeVar("T")


@dataclass
class Reuse:
    """How many things of a kind a frame made anew, and how many it took as they were."""

    built: int = 0
    reused: int = 0


@runtime_checkable
class FrameKeeper(Protocol):
    """Something that keeps what the frames ask it for."""

    def end_frame(self) -> None:
        """Lets go of what the frame that has come to its end did not need."""


@dataclass
class _Several:
    """Things of one kind by key, and the keys that were asked for in this frame."""

    things: dict[str, Any] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)


class Kept:
    """What is kept, by kind and by a hash of all that it depends on (array_codec.content_hash or `digests`).

    built: how often each kind was made, by name, since the device was opened. digests: of arrays, each found once a
    frame. frame_index: frames that were begun.
    """

    def __init__(self) -> None:
        self._latest: dict[str, tuple[str, Any]] = {}
        self._several: dict[str, _Several] = {}
        self._held: dict[str, Any] = {}
        self._parts: dict[str, Kept] = {}
        self._events: dict[str, Reuse] = {}
        self.built: dict[str, int] = {}
        self.digests = Digests()
        self.frame_index = 0

    @contextmanager
    def frame(self, is_whole: bool = True) -> Iterator[None]:
        """One frame: `events` begin anew with it. What `several` was not asked for in a frame that came to its end is
        let go of then, unless the frame is not whole and so does not ask for all that the next one needs."""
        self._begin()
        with self.digests.remembered():
            yield
        if is_whole:
            self._end()

    def get(self, kind: str, key: str, make: Callable[[], T]) -> T:
        """What `make` made last time for this kind if that had the same key, else what it makes now: the latest of each
        kind is kept."""
        found = self._latest.get(kind)
        is_new = found is None or found[0] != key
        if found is None or is_new:
            # The old one is let go of before there is a new one.
            self._latest.pop(kind, None)
            found = key, make()
            self._latest[kind] = found
        self.count(kind, is_new)
        thing: T = found[1]
        return thing

    def several(self, kind: str, key: str, make: Callable[[], T]) -> T:
        """As `get`, for kinds of which a frame needs several: all that it asks for are kept."""
        kept = self._several.setdefault(kind, _Several())
        kept.asked.add(key)
        is_new = key not in kept.things
        if is_new:
            kept.things[key] = make()
        self.count(kind, is_new)
        thing: T = kept.things[key]
        return thing

    def hold(self, name: str, make: Callable[[], T]) -> T:
        """What `make` made the first time: something that looks after what it keeps itself, and counts it here. Where
        it is a FrameKeeper it is told of the ends of frames."""
        if name not in self._held:
            self._held[name] = make()
        thing: T = self._held[name]
        return thing

    def part(self, name: str) -> Kept:
        """Things of the same kinds for another use, as by a second technique: neither takes the other's place."""
        if name not in self._parts:
            self._parts[name] = Kept()
            self._parts[name].digests = self.digests
            self._parts[name].frame_index = self.frame_index
        return self._parts[name]

    def count(self, kind: str, is_new: bool) -> None:
        """Notes that this frame made, or took as it was, one thing of a kind."""
        reuse = self._events.setdefault(kind, Reuse())
        reuse.built += is_new
        reuse.reused += not is_new
        if is_new:
            self.built[kind] = self.built.get(kind, 0) + 1

    def events(self) -> Mapping[str, Reuse]:
        """What this frame made anew and what it took as it was so far, by kind; of a part with its name before it."""
        found = dict(self._events)
        for name, part in self._parts.items():
            found |= {f"{name} {kind}": reuse for kind, reuse in part.events().items()}
        return found

    def _begin(self) -> None:
        self.frame_index += 1
        self._events = {}
        for kept in self._several.values():
            kept.asked = set()
        for part in self._parts.values():
            part._begin()

    def _end(self) -> None:
        for kept in self._several.values():
            kept.things = {key: kept.things[key] for key in kept.things if key in kept.asked}
        for held in self._held.values():
            if isinstance(held, FrameKeeper):
                held.end_frame()
        for part in self._parts.values():
            part._end()
