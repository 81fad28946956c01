# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress of long work as a plain callable: terminal bar, modal operator and test list are adapters of it."""

from __future__ import annotations

from collections.abc import Callable

from .errors import Cancelled

Progress = Callable[[float, str], bool]
"""Called with a fraction in [0, 1] and a label; returns False to cancel."""

Report = Callable[[float], None]
"""Called by parts of long work with the share that is done, in [0, 1]; may raise, which ends the work."""


def silent(fraction: float, label: str) -> bool:
    """Progress that shows nothing and never cancels."""
    return True


def step(progress: Progress, fraction: float, label: str) -> None:
    """Report `fraction` of the work done. Raises Cancelled if the receiver asks to stop."""
    if not progress(fraction, label):
        raise Cancelled(label)


def between(report: Report, first: float, last: float) -> Report:
    """A report of a part of the work that goes on from the share `first` to `last` of the whole."""

    def of_whole(share: float) -> None:
        report(first + (last - first) * share)

    return of_whole


def part(progress: Progress, first: float, last: float, label: str | None = None) -> Progress:
    """Progress of a part of the work from `first` to `last` of the whole, under one label where it is given."""
    return lambda fraction, own: progress(first + (last - first) * fraction, own if label is None else label)


def as_report(progress: Progress, label: str) -> Report:
    """`progress` as a report under one label, which raises Cancelled."""
    return lambda share: step(progress, share, label)
