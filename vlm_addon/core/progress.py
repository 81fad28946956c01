# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress of long work as a plain callable: terminal bar, modal operator and test list are adapters of it."""

from __future__ import annotations

from collections.abc import Callable

from .errors import Cancelled

Progress = Callable[[float, str], bool]
"""Called with a fraction in [0, 1] and a label; returns False to cancel."""


def silent(fraction: float, label: str) -> bool:
    """Progress that shows nothing and never cancels."""
    return True


def step(progress: Progress, fraction: float, label: str) -> None:
    """Report `fraction` of the work done. Raises Cancelled if the receiver asks to stop."""
    if not progress(fraction, label):
        raise Cancelled(label)
