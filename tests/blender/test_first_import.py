# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs begin by importing the demo's modules, before anything has imported bpy."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_demo_can_be_imported_before_bpy():
    done = subprocess.run([sys.executable, "-c", "import benchmarks.demo"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
