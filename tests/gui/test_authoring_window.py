# SPDX-License-Identifier: GPL-3.0-or-later
"""Every button of the sidebar pressed with the mouse in the window: drive_authoring.py presses, the tests read on.

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

from tests.gui.test_window import ROOT, command

pytestmark = pytest.mark.full

MINUTES = 10
DRIVE = Path(__file__).with_name("drive_authoring.py")


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    """What drive_authoring.py wrote, with `output` added."""
    chroot = os.environ.get("VLM_BLENDER_CHROOT")
    if not chroot and not (shutil.which("blender") and shutil.which("xvfb-run") and shutil.which("import")):
        pytest.skip("no Blender with a window: set VLM_BLENDER_CHROOT, or install blender, xvfb and imagemagick")
    folder = tmp_path_factory.mktemp("window")
    outside = Path(tempfile.mkdtemp(prefix="vlm-authoring-", dir=f"{chroot}/root")) if chroot else folder
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
        keep = os.environ.get("VLM_SCREENSHOTS")
        for path in outside.glob("*.png") if keep else ():
            shutil.copy(path, keep)
        return {**json.loads((outside / "story.json").read_text()), "output": output}
    finally:
        if chroot:
            shutil.rmtree(outside)


def presses(story):
    return {(name, where): told for name, all_told in story["pressed"].items() for where, told in all_told.items()}


def test_the_story_came_to_its_end(story):
    assert "error" not in story, story["error"]
    assert story["finished"]


def test_nothing_was_raised_on_the_way(story):
    assert "Traceback" not in story["output"], story["output"]


def test_every_button_worked_in_some_situation(story):
    shown = {name for names in story["buttons"].values() for name in names} - set(story["left out"])
    worked = {name for (name, _), told in presses(story).items() if f"VLM_OT_{name}" in told["done"]}
    assert shown == worked


def test_ctrl_z_takes_each_press_back(story):
    assert not [press for press, told in presses(story).items() if told["changed"] and not told["undone"]]


def test_no_button_needs_esc_to_end(story):
    assert not [press for press, told in presses(story).items() if told["Esc"]]


def test_the_sidebar_offers_what_the_selection_can_use(story):
    buttons = story["buttons"]
    assert "create_from_selection" in buttons["object selected"]
    assert {"fill_color", "check"} <= set(buttons["light mesh selected"])
    assert "fill_color" in buttons["light mesh edited"]
