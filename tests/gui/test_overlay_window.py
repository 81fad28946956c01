# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays in Blender's own window: drive_overlays.py switches them on, the tests look at the pixels.

Blender is found as for test_window.py; VLM_SCREENSHOTS names a folder that keeps the screenshots.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_window import ROOT, command, pixels

pytestmark = pytest.mark.full

MINUTES = 4
DRIVE = Path(__file__).with_name("drive_overlays.py")


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    """What drive_overlays.py wrote, with `folder` and `output` added."""
    chroot = os.environ.get("VLM_BLENDER_CHROOT")
    if not chroot and not (shutil.which("blender") and shutil.which("xvfb-run") and shutil.which("import")):
        pytest.skip("no Blender with a window: set VLM_BLENDER_CHROOT, or install blender, xvfb and imagemagick")
    folder = tmp_path_factory.mktemp("overlays")
    outside = Path(tempfile.mkdtemp(prefix="vlm-overlays-", dir=f"{chroot}/root")) if chroot else folder / "blender"
    outside.mkdir(exist_ok=True)
    inside = Path("/root") / outside.name if chroot else outside
    try:
        subprocess.run([sys.executable, ROOT / "tools" / "package.py", "--output", outside], check=True)
        (package,) = outside.glob("*-linux_x64.zip")
        shutil.copy(DRIVE, outside / "drive.py")
        done = subprocess.run(
            command(chroot, inside, package.name), capture_output=True, text=True, timeout=60 * MINUTES
        )
        if not (outside / "story.json").exists():
            pytest.fail(f"Blender ended early:\n{done.stdout}{done.stderr}")
        for path in (*outside.glob("*.png"), outside / "story.json"):
            shutil.copy(path, folder)
    finally:
        if chroot:
            shutil.rmtree(outside)
    keep = os.environ.get("VLM_SCREENSHOTS")
    if keep:
        shutil.copytree(folder, keep, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.json", "blender"))
    return {**json.loads((folder / "story.json").read_text()), "folder": folder, "output": done.stdout + done.stderr}


def middle(story, name):
    """Mean colour around the middle of the 3D view, where the ball is, (3,) in [0, 1]."""
    shown = pixels(story["folder"] / f"{name}.png")
    return shown[400:440, 580:640].mean(axis=(0, 1))


def test_the_story_came_to_its_end_without_a_message(story):
    assert "error" not in story, story["error"]
    assert story["finished"]
    assert "Traceback" not in story["output"], story["output"]
    assert story["created"] == story["grid"] == ["FINISHED"]


def test_handlers_are_there_while_something_is_shown(story):
    off, on, off_again = story["handlers"]
    assert on == off + 1
    assert off_again == off


def test_lights_show_their_colour_and_nothing_is_left_when_off(story):
    red, green, blue = middle(story, "color")
    assert red > 0.7
    assert max(green, blue) < 0.4
    assert middle(story, "off") == pytest.approx(middle(story, "off_again"), abs=0.02)
    assert np.ptp(middle(story, "off")) < 0.2, "without overlays the ball is gray"


def test_tags_show_colours_of_their_own(story):
    assert np.abs(middle(story, "tags") - middle(story, "color")).max() > 0.2


def test_lights_that_are_turned_away_show_their_dark_striped_back_in_edit_mode(story):
    assert middle(story, "turned_edit")[0] < middle(story, "color")[0] - 0.2


def test_a_slice_of_the_light_grid_stands_out_of_the_ball_in_blue(story):
    """Next to few lights errors are far under the tolerance; the slice is hidden where the ball is before it."""
    blue = {}
    for name in ("off", "grid"):
        red, green, found = np.moveaxis(pixels(story["folder"] / f"{name}.png")[270:600, 500:800], 2, 0)
        blue[name] = int((found > np.maximum(red, green) + 0.3).sum())
    assert blue["off"] == 0
    assert blue["grid"] > 2000
