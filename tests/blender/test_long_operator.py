# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators with long work do in the window, step by step: here without one, on a context that only remembers."""

import time

import pytest

from vlm_addon.blender.background_work import BackgroundWork
from vlm_addon.blender.long_operator import LongOperator
from vlm_addon.core.errors import VlmError


class Window:
    """As much of a context as LongOperator.modal asks of Blender. left: what is yet to be taken away."""

    def __init__(self):
        self.left = {"timer", "progress", "status"}
        self.window_manager = self.workspace = self

    def event_timer_remove(self, timer):
        self.left.remove(timer)

    def progress_end(self):
        self.left.remove("progress")

    def progress_update(self, value):
        pass

    def status_text_set(self, text):
        if text is None:
            self.left.remove("status")


class Event:
    type, value = "TIMER", "NOTHING"


class Operator(LongOperator):
    """Work that is `steps`, one after the other: each is called in the thread, and what it returns in the window."""

    def __init__(self, *steps):
        self._steps, self._timer, self._has_written, self.said = list(steps), "timer", False, []
        self.report = lambda level, text: self.said.append((*level, text))

    def finish(self, context, result):
        if result is writing:
            self.keep_what_is_written()
        result()
        return (lambda _: self._steps.pop(0)()) if self._steps else None

    def run(self, context):
        """What modal returns at last."""
        first = self._steps.pop(0)
        self._work = BackgroundWork(lambda _: first())
        while True:
            while self._work.is_running:
                time.sleep(0.001)
            result = self.modal(context, Event)
            if not result & {"RUNNING_MODAL", "PASS_THROUGH"}:
                return result


def nothing():
    return nothing


def writing():
    return writing


def raising(error):
    def call():
        raise error

    return call


def test_work_that_ends_takes_its_bar_and_texts_away():
    window = Window()
    assert Operator(nothing, nothing).run(window) == {"FINISHED"}
    assert not window.left


@pytest.mark.parametrize("step", [raising(MemoryError()), lambda: raising(ValueError("broken"))])
def test_an_error_that_nobody_foresaw_leaves_nothing_behind_in_the_window(step):
    window = Window()
    with pytest.raises((MemoryError, ValueError)):
        Operator(step).run(window)
    assert not window.left


@pytest.mark.parametrize(
    ("step", "result", "level"), [(writing, {"FINISHED"}, "WARNING"), (nothing, {"CANCELLED"}, "ERROR")]
)
def test_a_later_refusal_leaves_an_undo_step_for_what_was_written_alone(step, result, level):
    window = Window()
    refused = Operator(step, raising(VlmError("scene: it is gone")))
    assert refused.run(window) == result
    assert refused.said == [(level, "scene: it is gone")]
    assert not window.left
