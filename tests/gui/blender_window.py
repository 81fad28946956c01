# SPDX-License-Identifier: GPL-3.0-or-later
"""Plays a story in Blender's own window, with the extension as it is packaged, and hands back what it told.

Blender comes from VLM_BLENDER_CHROOT (a folder to chroot into, as root) or is `blender` on PATH; both need xvfb-run
and ImageMagick's `import`. VLM_SCREENSHOTS names a folder that keeps the screenshots to be looked at.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SCREEN = (1600, 900)
STEPS = (
    *(HERE / name for name in ("window_steps.py", "sidebar_steps.py", "situations.py")),
    ROOT / "tests" / "blender" / "survival_state.py",
)
"""What drivers import."""


def played(name, folder, minutes, files=(), screen=SCREEN):
    """What drive_`name`.py wrote, a dict, with `folder`, that holds its pictures, and all `output` added.

    `files` are copied beside the driver before. screen: pixels. Skips where there is no Blender with a window.
    """
    chroot = os.environ.get("VLM_BLENDER_CHROOT")
    if not chroot and not all(map(shutil.which, ("blender", "xvfb-run", "import"))):
        pytest.skip("no Blender with a window: set VLM_BLENDER_CHROOT, or install blender, xvfb and imagemagick")
    outside = Path(tempfile.mkdtemp(prefix=f"vlm-{name}-", dir=f"{chroot}/root" if chroot else folder))
    inside = Path("/root") / outside.name if chroot else outside
    try:
        subprocess.run([sys.executable, ROOT / "tools" / "package.py", "--output", outside], check=True)
        (package,) = outside.glob("*-linux_x64.zip")
        for path in (*STEPS, HERE / f"drive_{name}.py", *files):
            shutil.copy(path, outside)
        output = run_to_its_end(command(chroot, inside, name, package.name, screen), 60 * minutes)
        if not (outside / "story.json").exists():
            pytest.fail(f"Blender ended early:\n{output}")
        keep(name, outside, folder, output)
        return {**json.loads((outside / "story.json").read_text()), "folder": folder, "output": output}
    finally:
        if chroot:
            shutil.rmtree(outside)


def command(chroot, folder, name, package, screen):
    """The command line that plays drive_`name`.py in Blender on a screen of its own."""
    width, height = screen
    return [
        *(["chroot", chroot] if chroot else []),
        *["env", "LIBGL_ALWAYS_SOFTWARE=1", f"BLENDER_USER_RESOURCES={folder}/user", f"HOME={folder}"],
        *["xvfb-run", "-a", "-s", f"-screen 0 {width}x{height}x24"],
        *["blender", "--gpu-backend", "opengl", "--window-geometry", "0", "0", str(width), str(height)],
        *["--factory-startup", "--enable-event-simulate", "--python-expr"],
        *[f"import sys; sys.path.insert(0, {str(folder)!r}); import drive_{name}"],
        *["--", f"{folder}/{package}", str(folder)],
    ]


def run_to_its_end(line, seconds):
    """What a command printed. One that takes longer is ended with all that it started: Blender and its screen."""
    with subprocess.Popen(
        line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as process:
        try:
            return process.communicate(timeout=seconds)[0]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGTERM)
            return f"{process.communicate()[0]}\nended after {seconds} s"


def keep(name, source, folder, output):
    """Copy pictures and arrays into `folder`, and all, with the story's name, to where VLM_SCREENSHOTS says."""
    kept = os.environ.get("VLM_SCREENSHOTS")
    for path in (*source.glob("*.png"), *source.glob("*.npy")):
        shutil.copy(path, folder)
        if kept:
            shutil.copy(path, Path(kept) / f"{name}_{path.name}")
    if kept:
        shutil.copy(source / "story.json", Path(kept) / f"{name}.json")
        (Path(kept) / f"{name}.log").write_text(output)


def pixels(path):
    """A picture of RGB in [0, 1], (height, width, 3) float64."""
    return np.asarray(Image.open(path).convert("RGB"), np.float64) / 255


def assert_ended_well(story):
    """The story came to its end, and nothing was raised on the way, in handlers and callbacks neither."""
    assert "error" not in story, story["error"]
    assert story["finished"]
    assert "Traceback" not in story["output"], story["output"]
