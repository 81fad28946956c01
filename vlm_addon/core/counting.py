# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of things in the words of a report."""

from __future__ import annotations

IRREGULAR = {"mesh": "meshes", "vertex": "vertices"}
"""Plurals of last words that do not just take an s."""


def counted(count: int, noun: str) -> str:
    """As "1 light", "2,000 lights"; `noun` may have several words, of which the last is counted."""
    if count == 1:
        return f"1 {noun}"
    before, space, last = noun.rpartition(" ")
    return f"{count:,} {before}{space}{IRREGULAR.get(last, last + 's')}"


def counted_verb(count: int, noun: str, one: str, more: str) -> str:
    """The same with a verb: "1 light stands", "2 lights stand"."""
    return f"{counted(count, noun)} {one if count == 1 else more}"
