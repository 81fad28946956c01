# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever a scene holds and an operator is given: no traceback, nothing half written, and a sentence.

What is done is in extreme_story.py.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from extreme_scenes import SCENES  # noqa: E402

CREATORS = ("create_from_selection", "create_from_scene")
SECONDS = 240
# Lights that selection and scene give; what is not named here is refused by both.
MADE = {
    "budget_1": (1, 1),
    "budget_2": (2, 2),
    "budget_10000000": (18, 18),
    "nothing_selected": (None, 18),
    "hidden_in_viewport": (None, 18),
    "mirrored": (12, 12),
    "huge": (12, 12),
    "tiny": (12, 12),
    "far": (12, 12),
    "text": (20, 20),
    "metaball": (20, 20),
    "nurbs": (20, 20),
    "soup": (12, 12),
    "thick_curve": (20, 20),
    "geometry_node_instances": (60, 60),
    "shape_keys": (12, 12),
    "mesh_of_two_objects": (12, 12),
    "linked_object": (8, 8),
    "another_view_layer": (8, 8),
    "excluded_light_meshes": (8, 8),
    "light_mesh_selected": (None, 18),
}


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    folder = tmp_path_factory.mktemp("extremes")
    done = subprocess.run(
        [sys.executable, HERE / "extreme_story.py", folder],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        cwd=folder,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")},
    )
    assert not done.returncode, done.stderr + (folder / "extremes.log").read_text()[-3000:]
    return json.loads((folder / "extremes.json").read_text())


CASES = [(name, creator) for name in SCENES for creator in CREATORS]


@pytest.mark.parametrize(("name", "creator"), CASES, ids=map("-".join, CASES))
def test_creation_makes_sensible_lights_or_says_why_not(story, name, creator):
    found = story["created"][name][creator]
    count = MADE.get(name, (None, None))[CREATORS.index(creator)]
    assert found["result"] == ("refused" if count is None else "FINISHED"), found
    assert found["finite"]
    if count is None:
        assert found["unchanged"]
        assert any(mark in found["said"] for mark in (": ", "; ")), found
    else:
        assert found["lights"] == count, found


def test_extreme_values_leave_no_traceback_nothing_half_written_and_no_broken_numbers(story):
    assert {name: found for name, found in story["faults"].items() if found} == {}
    assert len(story["faults"]) > 20
