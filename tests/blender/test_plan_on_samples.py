# SPDX-License-Identifier: GPL-3.0-or-later
"""What plans leave out of the sample scenes, and what later frames use again, does not show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

from benchmarks.effects import SCENES, scene_of, steps  # noqa: E402
from vlm_addon.render.device import Device  # noqa: E402
from vlm_addon.render.frame_types import RenderSettings  # noqa: E402

QUICK = ("empty_room", "cornell_box", "dancer")
TECHNIQUES = ("vlm", "rsm_gather", "direct")
SMALL = RenderSettings(40, 30, samples=2, shadow_samples=4, shadow_resolution=512)


@pytest.fixture(scope="module")
def device():
    with Device() as opened:
        yield opened


@pytest.mark.parametrize("roughness", [None, 0.3], ids=["as it is", "all glossy"])
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.full]) for name in SCENES]
)
def test_the_picture_is_that_of_everything_enabled(device, name, roughness):
    snapshot, light_mesh = scene_of(name, 200, roughness)
    for technique in TECHNIQUES:
        settings = replace(SMALL, technique=technique)
        for number in range(2):
            planned = device.render(snapshot, light_mesh, settings)
            everything = device.render(snapshot, light_mesh, replace(settings, economical=False))
            images = [frame.images["combined"][..., :3] for frame in (planned, everything)]
            assert np.isfinite(images[0]).all()
            assert steps(*images) <= 1.0, (technique, number)
