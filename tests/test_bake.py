# SPDX-License-Identifier: GPL-3.0-or-later
"""What a bake makes of surfaces, without Blender."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import empty_room
from vlm_addon.bake import BakeSettings, bake
from vlm_addon.core.scene import SceneSnapshot


def white_room() -> SceneSnapshot:
    """Six walls of two triangles each."""
    room = empty_room([])
    white = np.full((2, 3), 0.7, np.float32)
    return replace(room, meshes=tuple(replace(mesh, reflectance=white) for mesh in room.meshes))


@pytest.mark.parametrize("split_share", [0.0, 0.25, 0.9])
def test_a_share_of_the_lights_halves_the_largest(split_share: float) -> None:
    whole = bake(white_room(), None, BakeSettings(400))
    split = bake(white_room(), None, BakeSettings(400, split_share=split_share))
    assert len(whole.light_mesh) == 12
    assert len(split.light_mesh) == (400 if split_share else 12)
    np.testing.assert_allclose(split.light_mesh.reflected_power, whole.light_mesh.reflected_power, rtol=1e-9)
    assert split.light_mesh.areas.sum() == pytest.approx(whole.light_mesh.areas.sum())
    if split_share:
        assert split.light_mesh.areas.max() <= 4.0 * np.median(split.light_mesh.areas)
    assert split.report()["lights"] == len(split.light_mesh)


@pytest.mark.parametrize(("lights", "split_share", "expected"), [(2000, 0.25, 1500), (1, 0.9, 1), (1000, 0.0, 1000)])
def test_lights_for_shape_are_the_others(lights: int, split_share: float, expected: int) -> None:
    assert BakeSettings(lights, split_share=split_share).shape_lights == expected


def test_kept_lights_come_first_and_are_not_halved() -> None:
    room = white_room()
    made = bake(room, None, BakeSettings(400)).light_mesh
    kept = made.subset(np.arange(len(made)) < 3)
    again = bake(room, None, BakeSettings(400, split_share=0.5), keep=kept).light_mesh
    assert len(again) == 400
    np.testing.assert_array_equal(again.corners[:3], kept.corners)
    np.testing.assert_allclose(again.areas.sum(), made.areas.sum(), rtol=1e-6)
