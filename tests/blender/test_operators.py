# SPDX-License-Identifier: GPL-3.0-or-later
"""Every operator found in operators/ does what an artist and a script may expect of it (operator_story.py)."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from survival_parameters import NOT_ALONE, operator_names  # noqa: E402

MINUTES = 5
NAMES = [name for name in operator_names() if name not in NOT_ALONE]


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    folder = tmp_path_factory.mktemp("operators")
    done = subprocess.run(
        [sys.executable, HERE / "operator_story.py", folder, *NAMES],
        capture_output=True,
        text=True,
        timeout=60 * MINUTES,
        cwd=folder,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")},
    )
    assert not done.returncode, done.stderr + (folder / "operators.log").read_text()[-3000:]
    return json.loads((folder / "operators.json").read_text())


@pytest.fixture(params=NAMES)
def told(request, story):
    """What the story says of one operator."""
    found = story[request.param]
    assert "exception" not in found, found["exception"]
    return found


def test_it_is_registered_with_a_label_and_what_it_does(told):
    assert told["known"]["label"]
    assert told["known"]["description"]
    assert not told["known"]["unexplained"]


def test_a_script_can_call_it(told):
    assert told["success"] is not None, told["refusals"]


def test_it_says_what_it_did(told):
    said = told["success"]["said"] if told["success"] else "Info: "
    assert any(word in said for word in ("Info: ", "Warning: "))


@pytest.fixture
def step(told):
    """The first success of an operator that is an undo step, and therefore has changed something."""
    if not told["known"]["undo"]:
        assert not told["success"]["changed"]
        pytest.skip("it changes nothing, so that there is nothing to undo")
    assert told["success"]["changed"]
    return told["success"]


def test_undo_takes_all_of_it_back_in_one_step(step):
    assert not step["undone"]


def test_redo_brings_all_of_it_back(step):
    assert not step["redone"]


def test_done_again_after_undo_it_gives_the_same_bytes(step):
    assert step["again"] == ["FINISHED", []]


def test_nothing_is_raised_wherever_it_is_called(told):
    said = {situation: sentence for situation, (result, sentence, _) in told["refusals"].items() if result == "raised"}
    assert not said
    assert told["empty"][0] != "raised", told["empty"]
    invoked = told["success"]["invoked"] if told["success"] else ["", ""]
    assert invoked[0] != "raised", invoked
    assert "Traceback" not in invoked[1]


def test_refusals_have_a_reason_and_change_nothing(told):
    for situation, (_, sentence, changed) in {**told["refusals"], "empty file": (*told["empty"], [])}.items():
        assert "context is incorrect" not in sentence, situation
        assert sentence.strip(), situation
        assert not changed, situation
