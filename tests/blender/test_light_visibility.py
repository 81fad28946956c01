# SPDX-License-Identifier: GPL-3.0-or-later
"""Visibility of virtual lights in sample scenes: against Cycles, and of a closed room within a lit hall."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

from benchmarks.support import ALONE  # noqa: E402
from tests.render.closed_rooms import inward_box  # noqa: E402
from tests.render.rooms import camera_at  # noqa: E402
from vlm_addon.bake import BakeSettings, bake  # noqa: E402
from vlm_addon.blender.cycles_reference import render_reference  # noqa: E402
from vlm_addon.blender.extraction.extract import extract_scene  # noqa: E402
from vlm_addon.core.light_mesh import join  # noqa: E402
from vlm_addon.core.metrics import relative_rmse  # noqa: E402
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh, subdivide_light_mesh  # noqa: E402
from vlm_addon.render.device import Device  # noqa: E402
from vlm_addon.render.frame_types import RenderSettings  # noqa: E402

FOLDER = Path(__file__).resolve().parents[2] / "sample_blends"
LIGHTS, SPLIT_SHARE = 2000, 0.25


@pytest.fixture(scope="module")
def device():
    with Device() as opened:
        yield opened


def opened(name):
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / f"{name}.blend"))
    return extract_scene()


def errors(device, name, side, reference_samples, samples, kind="octree"):
    """Indirect relative RMSE without and with visibility of a kind, and the noise of the reference.

    Of as many LIGHTS as `bake --triangles --split` makes of the scene.
    """
    snapshot = opened(name)
    light_mesh = bake(snapshot, None, BakeSettings(LIGHTS, split_share=SPLIT_SHARE)).light_mesh
    assert len(light_mesh) == LIGHTS
    reference = render_reference(side, side, 1, reference_samples)
    found = []
    for visibility in ("none", kind):
        settings = RenderSettings(
            side, side, "vlm", {"visibility": visibility}, samples, shadow_samples=8, effects=ALONE
        )
        image = device.render(snapshot, light_mesh, settings).images["indirect"]
        found.append(relative_rmse(image, reference.images["indirect"]))
    return *found, reference.noise["indirect"]


def test_a_small_picture_of_cornell_box_is_twice_as_near_to_cycles(device):
    # What noise the reference has is in both errors, and more of the smaller one.
    without, with_visibility, _ = errors(device, "cornell_box", 24, 1536, 4)
    assert with_visibility <= 0.5 * without


@pytest.mark.full
@pytest.mark.parametrize(
    ("kind", "name"), [("octree", "cornell_box"), ("octree", "monkey_box"), ("baked", "cornell_box")]
)
def test_visibility_halves_the_error_against_cycles(device, kind, name):
    without, with_visibility, noise = errors(device, name, 64, 4096, 8, kind)
    assert noise < 0.2 * (0.5 * without)
    assert with_visibility <= 0.5 * without


def white(walls):
    return [replace(wall, reflectance=np.full((2, 3), 0.7, np.float32)) for wall in walls]


@pytest.mark.full
@pytest.mark.parametrize(
    ("kind", "chosen", "lights", "wall_lights"),
    [("octree", {}, LIGHTS, 200), ("baked", {"visibility_cells": 8}, 400, 100)],
)
def test_a_closed_room_in_the_atrium_stays_black(device, kind, chosen, lights, wall_lights):
    """Of walls of 10 cm, thinner than a voxel, each side of which has lights of its own."""
    atrium = opened("atrium")
    inner = white(inward_box([-1.5, -1.5, 0.1], [1.5, 1.5, 3.0], [0] * 6))
    outer = white(inward_box([-1.6, -1.6, 0.0], [1.6, 1.6, 3.1], [0] * 6, outward=True))
    parts = [create_light_mesh(meshes, SimplifySettings(lights)).light_mesh for meshes in (atrium.meshes, inner, outer)]
    light_mesh = join([parts[0], *(subdivide_light_mesh(part, wall_lights) for part in parts[1:])])
    hall = replace(atrium, meshes=(*atrium.meshes, *inner, *outer))
    room = replace(hall, camera=camera_at((-1.3, -1.3, 2.0), (1.0, 1.0, 0.8), lens=18.0))

    def picture(scene, visibility):
        settings = RenderSettings(
            48, 32, "vlm", {**chosen, "visibility": visibility}, 2, shadow_samples=1, effects=ALONE
        )
        return device.render(scene, light_mesh, settings).images["indirect"]

    lit, dark = picture(hall, kind), picture(room, kind)
    assert picture(room, "none").mean() > 0.05 * lit.mean()
    assert dark.max() <= 1e-3 * lit.mean()
