# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress and tables for people at a terminal; machine-readable results go to files instead."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import TextIO

BAR_WIDTH = 24
SECONDS_BETWEEN_LINES = 5.0


class TerminalProgress:
    """Progress receiver that redraws one line on a terminal and prints a line now and then into a log."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._is_terminal = self._stream.isatty()
        self._last_line = time.monotonic()

    def __call__(self, fraction: float, label: str) -> bool:
        """Show the fraction done and what is being done; never cancels (Ctrl-C does)."""
        if self._is_terminal:
            filled = round(BAR_WIDTH * min(max(fraction, 0.0), 1.0))
            end = "\n" if fraction >= 1.0 else ""
            self._stream.write(f"\r\033[K[{'#' * filled}{'.' * (BAR_WIDTH - filled)}] {fraction:4.0%} {label}{end}")
            self._stream.flush()
        elif time.monotonic() - self._last_line > SECONDS_BETWEEN_LINES:
            self._stream.write(f"{fraction:4.0%} {label}\n")
            self._stream.flush()
            self._last_line = time.monotonic()
        return True


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Rows under a header, the first column to the left and the others to the right, as lines of text."""
    widths = [max(len(row[i]) for row in [header, *rows]) for i in range(len(header))]

    def line(cells: Sequence[str]) -> str:
        padded = [
            cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(cells, widths, strict=True))
        ]
        return "  ".join(padded).rstrip()

    return "\n".join([line(header), line(["-" * width for width in widths]), *map(line, rows)])
