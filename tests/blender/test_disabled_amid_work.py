# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work in the window ends with the extension. Blender's window is played by an object that keeps what it hears."""

from contextlib import ExitStack
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

from vlm_addon.blender import long_operator


class Waiting(long_operator.LongOperator):
    """Work that ends when it is cancelled."""

    def __init__(self):
        self.reports = []

    def report(self, level, text):
        self.reports.append(text)

    def prepare(self, context):
        def work(progress):
            while progress(0.5, "waiting"):
                pass

        return work


@pytest.fixture
def context(monkeypatch):
    """A window that is told everything and shows nothing."""
    found = MagicMock()
    monkeypatch.setattr(long_operator, "bpy", SimpleNamespace(app=SimpleNamespace(background=False), context=found))
    return found


def test_disabling_the_extension_ends_the_work_with_its_timer_and_its_text(context):
    operator = Waiting()
    with ExitStack() as undo:
        long_operator.register(undo)
        assert operator.invoke(context, None) == {"RUNNING_MODAL"}
        assert operator.modal(context, SimpleNamespace(type="TIMER", value="NOTHING")) == {"PASS_THROUGH"}
        context.window_manager.event_timer_remove.assert_not_called()
    context.window_manager.event_timer_remove.assert_called_once_with(operator._timer)
    context.workspace.status_text_set.assert_called_with(None)
    with pytest.raises(long_operator.Cancelled):
        operator._work.result()


def test_work_that_was_cancelled_before_is_not_ended_again(context):
    operator = Waiting()
    with ExitStack() as undo:
        long_operator.register(undo)
        operator.invoke(context, None)
        operator.cancel(context)
    context.window_manager.event_timer_remove.assert_called_once_with(operator._timer)
