# SPDX-License-Identifier: GPL-3.0-or-later
"""Work on arrays in a thread of its own, so that Blender's window stays alive while it runs."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Generic, TypeVar

from ..core.errors import Cancelled
from ..core.progress import Progress

T = TypeVar("T")


class BackgroundWork(Generic[T]):
    """One call of `work(progress)` in a thread. `work` may not touch bpy data.

    fraction and label say how far it is; they are written by the thread and read by the window.
    """

    def __init__(self, work: Callable[[Progress], T]) -> None:
        self.fraction = 0.0
        self.label = ""
        self._cancelled = False
        executor = ThreadPoolExecutor(1, thread_name_prefix="vlm work")
        self._future = executor.submit(work, self._progress)
        executor.shutdown(wait=False)

    def _progress(self, fraction: float, label: str) -> bool:
        self.fraction, self.label = fraction, label
        return not self._cancelled

    @property
    def is_running(self) -> bool:
        """Whether the work has yet to end."""
        return not self._future.done()

    def cancel(self) -> None:
        """Ask the work to stop at its next report of progress."""
        self._cancelled = True

    def result(self) -> T:
        """What `work` returned, waiting for it. Raises what it raised, and Cancelled if it was cancelled."""
        result = self._future.result()
        if self._cancelled:
            raise Cancelled(self.label or "work")
        return result
