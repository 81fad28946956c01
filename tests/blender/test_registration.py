# SPDX-License-Identifier: GPL-3.0-or-later
"""Enabling and disabling leaves nothing behind, however often, and presets keep our settings alone."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SECONDS = 120


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    folder = tmp_path_factory.mktemp("registration")
    done = subprocess.run(
        [sys.executable, HERE / "registration_story.py", folder],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        cwd=folder,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")},
    )
    assert not done.returncode, done.stderr + (folder / "registration.log").read_text()[-3000:]
    return {"folder": str(folder), **json.loads((folder / "registration.json").read_text())}


def test_all_goes_and_all_comes_back_each_time(story):
    assert story["before"] == []
    assert story["out"] == [[], []]
    first, *others = story["in"]
    assert len(first) > 100
    assert others == [first, first]


def test_a_preset_is_a_file_in_the_users_folder_with_our_settings_alone(story):
    told = story["presets"]
    assert told["kept"][0] == "FINISHED"
    kept = Path(story["folder"]) / "user" / "scripts" / "presets" / "virtual_light_mesh"
    assert len(told["files"]) == 2
    assert {Path(path).parent for path in told["files"]} == {kept}
    assert [line for line in told["lines"] if not line.startswith("settings.")] == [
        "import bpy",
        "settings = bpy.context.scene.vlm",
    ]


def test_a_preset_brings_back_our_settings_and_leaves_the_others(story):
    assert story["presets"]["used"] == [7, 0.125, 64]


def test_own_presets_can_be_removed_and_ours_cannot(story):
    told = story["presets"]
    assert told["removed"][0] == "FINISHED"
    assert told["left"] == []
    assert told["shipped removed"][0] == "CANCELLED"
    assert "No preset was changed" in told["shipped removed"][1]
