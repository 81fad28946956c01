# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work that an artist disturbs in Blender's window does no harm: drive_bake.py disturbs, the tests read on.

Blender is found as for test_window.py.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_window import ROOT, command

pytestmark = pytest.mark.full

MINUTES = 6
LIGHTS = 100
DRIVE = Path(__file__).with_name("drive_bake.py")
GOES_ON = ("delete_source", "edit_source", "undo", "save", "begin_again")
"""What does not stop the work."""
ENDS = ("delete_scene", "escape", "load")
"""What leaves it without a result."""


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    """What drive_bake.py wrote, with `output` added."""
    chroot = os.environ.get("VLM_BLENDER_CHROOT")
    if not chroot and not (shutil.which("blender") and shutil.which("xvfb-run") and shutil.which("import")):
        pytest.skip("no Blender with a window: set VLM_BLENDER_CHROOT, or install blender, xvfb and imagemagick")
    folder = tmp_path_factory.mktemp("window")
    outside = Path(tempfile.mkdtemp(prefix="vlm-bake-", dir=f"{chroot}/root")) if chroot else folder
    inside = Path("/root") / outside.name if chroot else folder
    try:
        subprocess.run([sys.executable, ROOT / "tools" / "package.py", "--output", outside], check=True)
        (package,) = outside.glob("*-linux_x64.zip")
        shutil.copy(DRIVE, outside / "drive.py")
        done = subprocess.run(
            command(chroot, inside, package.name), capture_output=True, text=True, timeout=60 * MINUTES
        )
        output = done.stdout + done.stderr
        if not (outside / "story.json").exists():
            pytest.fail(f"Blender ended early:\n{output}")
        return {**json.loads((outside / "story.json").read_text()), "output": output}
    finally:
        if chroot:
            shutil.rmtree(outside)


def test_the_story_came_to_its_end(story):
    assert "error" not in story, story["error"]
    assert story["finished"]


def test_nothing_was_raised_on_the_way(story):
    assert "Traceback" not in story["output"], story["output"]


@pytest.mark.parametrize("name", [*GOES_ON, *ENDS, "disable"])
def test_the_work_ran_when_it_was_disturbed_and_nothing_is_left_over(story, name):
    told = story[name]
    assert told["began"] == ["RUNNING_MODAL"]
    assert told["ran"]
    assert told["orphans"] == []


@pytest.mark.parametrize("name", GOES_ON)
def test_what_does_not_stop_the_work_gives_the_lights(story, name):
    (count,) = story[name]["lights"].values()
    assert 0 < count <= LIGHTS


@pytest.mark.parametrize("name", ENDS)
def test_what_stops_the_work_leaves_no_lights(story, name):
    assert story[name]["lights"] == {}


def test_a_loaded_file_is_as_it_was_saved(story):
    assert story["load"]["said"] == ["FINISHED"]
    assert story["load"]["objects"] == 3


def test_the_extension_works_after_all_that(story):
    assert story["after all"]["began"] == ["RUNNING_MODAL"]
    assert story["after all"]["lights"]


def test_the_interface_is_german_where_blender_is(story):
    assert story["german"] == ["Lichtgitter backen", "Anzahl der Lichter"]
