# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as text for people: "3, 5-8"."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput

Int64 = npt.NDArray[np.int64]

_SPAN = re.compile(r"(\d{1,9})(?:\s*-\s*(\d{1,9}))?")


def parse_spans(text: str, thing: str, least: int) -> tuple[tuple[int, int], ...]:
    """The (first, last) spans that `text` names, such as "3, 5-8". Raises InvalidInput for anything else, and for
    numbers below `least`; the message calls each a `thing`."""
    spans = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        found = _SPAN.fullmatch(part)
        first, last = (int(found[1]), int(found[2] or found[1])) if found else (least - 1, least - 1)
        if not least <= first <= last:
            remedy = f"give numbers from {least} and spans, such as 3, 5-8"
            raise InvalidInput(f"{thing}s", f"{part!r} is no {thing}", remedy)
        spans.append((first, last))
    return tuple(spans)


def numbers_in(spans: Iterable[tuple[int, int]]) -> Int64:
    """(n,) int64: all numbers of the spans, each once, ascending."""
    parts = [np.arange(first, last + 1, dtype=np.int64) for first, last in spans]
    return np.unique(np.concatenate(parts)) if parts else np.zeros(0, np.int64)


def spans_text(numbers: npt.ArrayLike) -> str:
    """The shortest text from which `parse_spans` makes the same numbers, for non-negative whole ones."""
    rows = np.unique(np.asarray(numbers, np.int64))
    ends = np.flatnonzero(np.diff(rows) > 1)
    firsts, lasts = rows[np.append(0, ends + 1)[: len(rows)]], rows[np.append(ends, len(rows) - 1)[: len(rows)]]
    pairs = zip(firsts.tolist(), lasts.tolist(), strict=True)
    return ", ".join(str(first) if first == last else f"{first}-{last}" for first, last in pairs)
