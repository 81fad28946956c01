# SPDX-License-Identifier: GPL-3.0-or-later
"""Creation and check tell how far they are all the time, and end at whatever report they are told to."""

import time

import numpy as np
import pytest

from vlm_addon.bake import BakeSettings, bake
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.scene import Mesh, SceneSnapshot

SIDE = 110
LIGHTS = 200
LONGEST_SILENCE = 0.25
"""Of all processor time; a long step without any report would take more than this of the whole on large scenes, too."""
RUNS = 2
CANCELLED_AT = (0.0, 0.2, 0.5, 0.7, 0.9, 0.99)


@pytest.fixture(scope="module")
def snapshot():
    """Hills of 23,762 triangles, open below, so that every step has something to do."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, SIDE), np.linspace(-1.0, 1.0, SIDE))
    z = 0.05 * np.sin(5.0 * x) * np.cos(4.0 * y) + 0.002 * np.sin(31.0 * x + 17.0 * y)
    corner = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)
    count = len(triangles)
    hills = Mesh(
        name="hills",
        positions=np.stack([x, y, z], axis=-1).reshape(-1, 3),
        triangles=triangles,
        corner_normals=np.zeros((count, 3, 3), np.float32),
        corner_uvs=np.zeros((count, 3, 2), np.float32),
        corner_colors=np.zeros((0, 3, 3), np.float32),
        material_indices=np.zeros(count, np.int32),
        tag_ids=np.zeros(count, np.int32),
        reflectance=np.full((count, 3), 0.8, np.float32),
        emission=np.zeros((count, 3), np.float32),
    )
    return SceneSnapshot("scene", (hills,), (), (), (), None, (0.0, 0.0, 0.0))


def longest_silence(snapshot):
    """The longest time between two reports as a share of the whole."""
    heard = [time.process_time()]

    def progress(fraction, label):
        heard.append(time.process_time())
        return True

    bake(snapshot, None, BakeSettings(target_triangles=LIGHTS), progress)
    heard.append(time.process_time())
    return float(np.diff(heard).max() / (heard[-1] - heard[0]))


def test_no_step_is_silent_for_a_large_part_of_the_whole(snapshot):
    assert min(longest_silence(snapshot) for _ in range(RUNS)) < LONGEST_SILENCE


def test_progress_goes_on_from_nothing_to_all(snapshot):
    fractions = []
    bake(snapshot, None, BakeSettings(target_triangles=LIGHTS), lambda fraction, _: fractions.append(fraction) or True)
    assert fractions == sorted(fractions)
    assert fractions[0] == 0.0
    assert fractions[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("share", CANCELLED_AT)
def test_it_ends_at_the_first_report_that_says_so(snapshot, share):
    after = []

    def progress(fraction, label):
        if fraction >= share:
            after.append(fraction)
        return not after

    with pytest.raises(Cancelled):
        bake(snapshot, None, BakeSettings(target_triangles=LIGHTS), progress)
    assert len(after) == 1
