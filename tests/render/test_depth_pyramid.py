# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth pyramids against the depths of a finer picture and of their own finer levels."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.render.rooms import box_room, camera_at, quad
from vlm_addon.core.scene import DIFFUSE, ORTHOGRAPHIC, PERSPECTIVE, Camera, Float32, Material, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.depth_pyramid import DEPTH_EMPTY, DepthPyramid
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.view import make_view

SIZE = (27, 18)
FINER = 8


def slope(kind: str) -> SceneSnapshot:
    """One plane that fills the picture, steep in both directions."""
    plane = quad((-30.0, -4.0, -20.5), (60.0, 0.0, 40.0), (0.0, 40.0, 30.0))
    camera = camera_at((0.0, -6.0, 3.0), (0.5, 0.0, 2.5), kind=kind, ortho_scale=3.0)
    return SceneSnapshot("slope", (plane,), (Material("m", DIFFUSE),), camera=camera)


def depths(device: Device, snapshot: SceneSnapshot, size: tuple[int, int]) -> Float32:
    """(h, w) of the G-buffer, row 0 at the top."""
    with device.current() as context:
        geometry, view = _prepared(context, snapshot, size)
        return read_image(GBufferPass(context, device.shaders, *size).render(geometry, view, 0).position)[..., 3]


def levels(device: Device, snapshot: SceneSnapshot) -> list[Float32]:
    """Every level of the pyramid, row 0 at the bottom."""
    with device.current() as context:
        geometry, view = _prepared(context, snapshot, SIZE)
        gbuffer = GBufferPass(context, device.shaders, *SIZE).render(geometry, view, 0)
        pyramid = DepthPyramid(context, device.shaders, *SIZE)
        texture = pyramid.render(gbuffer, view)
        found = []
        for level in range(pyramid.coarsest + 1):
            width, height = (max(side >> level, 1) for side in texture.size)
            found.append(np.frombuffer(texture.read(level=level), np.float32).reshape(height, width))
    return found


def _prepared(context: object, snapshot: SceneSnapshot, size: tuple[int, int]) -> tuple[GpuGeometry, object]:
    camera = snapshot.camera
    assert isinstance(camera, Camera)
    geometry = GpuGeometry(context, snapshot)  # type: ignore[arg-type]
    return geometry, make_view(camera, *size, geometry.origin)


@pytest.mark.parametrize("kind", [PERSPECTIVE, ORTHOGRAPHIC])
def test_the_finest_level_is_the_nearest_that_a_plane_comes_within_a_pixel(device: Device, kind: str) -> None:
    snapshot = slope(kind)
    finest = levels(device, snapshot)[0][: SIZE[1], : SIZE[0]][::-1]
    fine = depths(device, snapshot, (FINER * SIZE[0], FINER * SIZE[1]))
    nearest = fine.reshape(SIZE[1], FINER, SIZE[0], FINER).min(axis=(1, 3))
    middle = depths(device, snapshot, SIZE)
    assert (middle > 0.0).all()
    assert (finest <= nearest).all()
    # Fine pixels' middles are inside of the pixel by half of their size.
    np.testing.assert_allclose(middle - finest, (middle - nearest) * FINER / (FINER - 1.0), rtol=0.03, atol=1e-4)


def test_each_level_holds_the_nearest_of_four_and_the_last_of_all(device: Device) -> None:
    found = levels(device, box_room())
    assert found[0].shape == (32, 32)
    for finer, coarser in pairwise(found):
        height, width = coarser.shape
        expected = finer.reshape(height, -1, width, finer.shape[1] // width).min(axis=(1, 3))
        assert (coarser == expected).all()
    assert found[-1].shape == (1, 1)
    assert (found[0][SIZE[1] :] == np.float32(DEPTH_EMPTY)).all()
    assert (found[0][:, SIZE[0] :] == np.float32(DEPTH_EMPTY)).all()


def test_what_shows_nothing_is_empty(device: Device) -> None:
    away = camera_at((0.0, 0.0, 1.0), (0.0, 0.0, 5.0))
    snapshot = SceneSnapshot("away", (quad((0, 0, 0), (1, 0, 0), (0, 1, 0)),), (Material("m"),), camera=away)
    assert all((level == np.float32(DEPTH_EMPTY)).all() for level in levels(device, snapshot))
