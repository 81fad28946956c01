# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension in Blender's own window: drive.py plays a new user, the tests read what it saw.

Blender comes from VLM_BLENDER_CHROOT (a folder to chroot into, as root) or is `blender` on PATH; both need xvfb-run
and ImageMagick's `import`. VLM_SCREENSHOTS names a folder that keeps the screenshots to be looked at.
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

pytestmark = pytest.mark.full

ROOT = Path(__file__).resolve().parents[2]
SCREEN = "1600x900"
MINUTES = 5


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    """What drive.py wrote, with `folder` and `output` added."""
    chroot = os.environ.get("VLM_BLENDER_CHROOT")
    if not chroot and not (shutil.which("blender") and shutil.which("xvfb-run") and shutil.which("import")):
        pytest.skip("no Blender with a window: set VLM_BLENDER_CHROOT, or install blender, xvfb and imagemagick")
    folder = tmp_path_factory.mktemp("window")
    subprocess.run([sys.executable, ROOT / "tools" / "package.py", "--output", folder], check=True)
    (package,) = folder.glob("*-linux_x64.zip")
    outside = Path(tempfile.mkdtemp(prefix="vlm-window-", dir=f"{chroot}/root")) if chroot else folder
    inside = Path("/root") / outside.name if chroot else folder
    for path in (package, Path(__file__).with_name("drive.py")):
        if path.parent != outside:
            shutil.copy(path, outside)
    try:
        done = subprocess.run(
            command(chroot, inside, package.name), capture_output=True, text=True, timeout=60 * MINUTES
        )
        if not (outside / "story.json").exists():
            pytest.fail(f"Blender ended early:\n{done.stdout}{done.stderr}")
        told = json.loads((outside / "story.json").read_text())
        for path in outside.glob("*.png"):
            shutil.copy(path, folder) if path.parent != folder else None
    finally:
        if chroot:
            shutil.rmtree(outside)
    keep = os.environ.get("VLM_SCREENSHOTS")
    if keep:
        shutil.copytree(folder, keep, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.zip", "*.json", "*.py"))
    return {**told, "folder": folder, "output": done.stdout + done.stderr}


def command(chroot, folder, package):
    """The command line that runs drive.py in Blender on a screen of its own."""
    size = SCREEN.split("x")
    return [
        *(["chroot", chroot] if chroot else []),
        *["env", "LIBGL_ALWAYS_SOFTWARE=1", f"BLENDER_USER_RESOURCES={folder}/user", f"HOME={folder}"],
        *["xvfb-run", "-a", "-s", f"-screen 0 {SCREEN}x24"],
        *["blender", "--gpu-backend", "opengl", "--window-geometry", "0", "0", *size, "--factory-startup"],
        *["--enable-event-simulate", "--python", f"{folder}/drive.py", "--", f"{folder}/{package}", str(folder)],
    ]


def pixels(path):
    from PIL import Image

    return np.asarray(Image.open(path).convert("RGB"), np.float64) / 255


def test_the_story_came_to_its_end(story):
    assert "error" not in story, story["error"]
    assert story["finished"]


def test_nothing_was_raised_on_the_way(story):
    assert "Traceback" not in story["output"], story["output"]


def test_the_zip_installs_and_enables(story):
    assert story["enabled"]


def test_one_button_lights_the_default_file(story):
    assert story["first button"] == ["RUNNING_MODAL"]
    assert pixels(story["folder"] / "first_picture.png").max() > 0.2


def test_creating_runs_beside_the_window_and_makes_lights(story):
    assert story["create"] == ["RUNNING_MODAL"]
    assert all(0 < count <= 200 for count in story["lights"].values())


def test_undo_takes_the_light_mesh_away_and_redo_brings_it_back(story):
    assert {"4_undone", "5_redone"} <= set(story["seen"])


def test_esc_stops_long_work_and_nothing_is_made(story):
    assert story["ran at Esc"]
    assert story["after Esc"] == []


def test_light_scene_shows_a_picture_lit_by_our_engine(story):
    assert story["engine"] == "VLM_ENGINE"
    picture = pixels(story["folder"] / "render_result.png")
    assert picture.mean() > 0.05
    assert (picture.max(axis=2) > 0.02).mean() > 0.95, "most of the room should have some light"


def test_the_red_wall_colours_what_is_beside_it(story):
    picture = pixels(story["folder"] / "render_result.png")
    assert (picture[..., 0] - picture[..., 1]).max() > 0.1


def test_a_light_mesh_is_absent_from_an_eevee_render(story):
    with_light_mesh, without = (pixels(story["folder"] / f"eevee_{name}.png") for name in ("with", "without"))
    assert without.mean() > 0.05
    assert np.array_equal(with_light_mesh, without)
