# SPDX-License-Identifier: GPL-3.0-or-later
"""Ambient occlusion of monkey_box against rays: the bound of one view, and what its lamps' maps add."""

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

from tests.render.open_pictures import by_rays, look, mean_error  # noqa: E402
from vlm_addon.blender.extraction.extract import extract_scene  # noqa: E402
from vlm_addon.render.device import Device  # noqa: E402

MONKEY_BOX = Path(__file__).resolve().parents[2] / "sample_blends" / "monkey_box.blend"
SIZE = (32, 32)
STRATA = 5
"""Of rays: 25 a pixel are off by some 0.02 where half is open."""
BOUND = 0.08
PICTURES = 8


@pytest.mark.parametrize("share", [0.05, 0.15])
def test_one_view_is_within_the_bound_and_the_lamps_views_are_nearer(share):
    bpy.ops.wm.open_mainfile(filepath=str(MONKEY_BOX))
    snapshot = extract_scene()
    low, high = snapshot.bounds()
    radius_m = share * float(np.linalg.norm(high - low))
    with Device() as device:
        first, alone, joined = (
            look(device, snapshot, radius_m, pictures, SIZE, with_maps)
            for pictures, with_maps in ((1, False), (PICTURES, False), (PICTURES, True))
        )
    truth = by_rays(alone, snapshot, STRATA)
    shown = np.any(alone.planes != 0.0, axis=2)
    assert truth[shown].std() > 0.08
    assert mean_error(first.open, truth, shown) <= BOUND
    assert mean_error(alone.open, truth, shown) <= BOUND
    assert mean_error(joined.open, truth, shown) < 0.95 * mean_error(alone.open, truth, shown)
