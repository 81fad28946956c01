# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators with long work share: a progress bar and Esc in the window, plain execution in scripts."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, Generic, TypeVar

import bpy

from ..core.errors import Cancelled, VlmError
from ..core.progress import Progress
from .background_work import BackgroundWork

SECONDS_BETWEEN_LOOKS = 0.2
PROGRESS_STEPS = 100

T = TypeVar("T")

_RUNNING: list[Any] = []
"""Operators that go on in the window: Blender forgets them without a word where the extension is disabled."""


def register(undo: ExitStack) -> None:
    """Where the extension is disabled amid long work, the work ends, with its timer and its texts."""
    undo.callback(_end_all)


def _end_all() -> None:
    for operator in list(_RUNNING):
        operator.cancel(bpy.context)


class LongOperator(Generic[T]):
    """Mixin of bpy.types.Operator in three steps.

    `prepare(context)` reads Blender's data and returns the work, a function of a progress receiver that touches no
    bpy data; `finish(context, result)` writes the result and reports counts. In the window the work runs in a thread
    and Esc cancels it; `execute` does all three at once, so scripts, repeat and adjust-last work.
    """

    report: Callable[[set[str], str], None]
    _work: BackgroundWork[T]
    _timer: Any
    _has_written: bool

    def prepare(self, context: bpy.types.Context) -> Callable[[Progress], T]:
        """The work, with all that it needs. Raises VlmError."""
        raise NotImplementedError

    def finish(self, context: bpy.types.Context, result: T) -> Callable[[Progress], T] | None:
        """Write `result` into Blender's data and report what was done; returns more work, or None when all is done.

        What was written stays where later work is cancelled. Raises VlmError.
        """
        raise NotImplementedError

    def keep_what_is_written(self) -> None:
        """Say that a step before the last has written something: what fails from now on leaves an undo step."""
        self._has_written = True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """All steps at once."""
        window_manager = context.window_manager
        window_manager.progress_begin(0, PROGRESS_STEPS)

        def progress(fraction: float, label: str) -> bool:
            window_manager.progress_update(round(fraction * PROGRESS_STEPS))
            return True

        self._has_written = False
        try:
            work: Callable[[Progress], T] | None = self.prepare(context)
            while work is not None:
                work = self.finish(context, work(progress))
        except VlmError as error:
            return self._failed(error)
        finally:
            window_manager.progress_end()
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start the work in a thread and look after it from a timer."""
        if bpy.app.background:
            return self.execute(context)
        self._has_written = False
        try:
            self._work = BackgroundWork(self.prepare(context))
        except VlmError as error:
            return self._failed(error)
        window_manager = context.window_manager
        window_manager.progress_begin(0, PROGRESS_STEPS)
        self._timer = window_manager.event_timer_add(SECONDS_BETWEEN_LOOKS, window=context.window)
        window_manager.modal_handler_add(self)
        _RUNNING.append(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Show progress, cancel on Esc, finish when the work has ended; all other events stay Blender's.

        Whatever ends the operator, an error that nobody foresaw as well, takes its timer, bar and texts away.
        """
        with ExitStack() as undo:
            undo.callback(self._clean_up, context)
            result = self._handled(context, event)
            if result & {"RUNNING_MODAL", "PASS_THROUGH"}:
                undo.pop_all()
        return result

    def _handled(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and event.value == "PRESS":
            self._work.cancel()
            return {"RUNNING_MODAL"}
        if self._work.is_running:
            self._show_progress(context)
            return {"PASS_THROUGH"}
        try:
            more = self.finish(context, self._work.result())
        except VlmError as error:
            return self._failed(error)
        if more is None:
            return {"FINISHED"}
        self._work = BackgroundWork(more)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator: another file is loaded or the window closes."""
        self._work.cancel()
        self._clean_up(context)

    def _show_progress(self, context: bpy.types.Context) -> None:
        context.window_manager.progress_update(round(self._work.fraction * PROGRESS_STEPS))
        label = self._work.label.capitalize()
        context.workspace.status_text_set(f"{label} {self._work.fraction:.0%} (Esc cancels)")

    def _clean_up(self, context: bpy.types.Context) -> None:
        if self in _RUNNING:
            _RUNNING.remove(self)
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        if context.workspace is not None:
            context.workspace.status_text_set(None)

    def _failed(self, error: VlmError) -> set[str]:
        # what earlier steps wrote stays and needs its undo step; an error would raise in scripts
        level = "WARNING" if isinstance(error, Cancelled) or self._has_written else "ERROR"
        self.report({level}, str(error))
        return {"FINISHED"} if self._has_written else {"CANCELLED"}
