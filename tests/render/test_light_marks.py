# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights as marks in a picture: where they are, as bright as their power, faint where something hides them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.render.rooms import facing_camera, quad
from vlm_addon.core.scene import DIFFUSE, Float32, Material, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.gpu_layout import VIRTUAL_POINT_LIGHT
from vlm_addon.render.light_marks import BRIGHTNESS_OF_MEAN, FAINTEST, HIDDEN, marked_lights, seen_points
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.passes.point_lights import uploaded
from vlm_addon.render.view import make_view

WIDTH, HEIGHT = 36, 18
VIEW = make_view(facing_camera(2.0), WIDTH, HEIGHT, np.zeros(3))
"""2 m above the floor, y up: 0.04 m a pixel on the floor."""
FLOOR = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))
TABLE = quad((0.1, -1, 0.5), (2, 0, 0), (0, 2, 0))
MIDDLES = (WIDTH // 2, HEIGHT // 2)


def records(places: Sequence[Sequence[float]], flux: Sequence[Sequence[float]]) -> np.ndarray:
    lights = VIRTUAL_POINT_LIGHT.zeros(len(places))
    if len(places):
        lights["position"], lights["flux"], lights["normal"] = places, flux, (0.0, 0.0, 1.0)
    return lights


def picture(device: Device, meshes: Sequence[Mesh], bounces: Sequence[np.ndarray]) -> Float32:
    """Of black surfaces."""
    scene = SceneSnapshot("s", tuple(meshes), (Material("m", DIFFUSE, (0.0, 0.0, 0.0)),))
    with device.current() as context:
        geometry = GpuGeometry(context, scene, np.zeros(3))
        gbuffer = GBufferPass(context, device.shaders, WIDTH, HEIGHT).render(geometry, VIEW, 0)
        return marked_lights(gbuffer, VIEW, [uploaded(context, lights) for lights in bounces])


def pixel(x: float, y: float) -> tuple[int, int]:
    """Row and column of a place on the floor."""
    return HEIGHT // 2 - 1 - int(np.floor(y / 0.04)), WIDTH // 2 + int(np.floor(x / 0.04))


def test_marks_have_the_hue_of_the_flux_and_brightness_of_its_power(device: Device) -> None:
    places = [(-0.5, 0.1, 0.0), (-0.3, 0.1, 0.0), (0.02, 0.1, 0.0)]
    flux = [(0.6, 0.3, 0.3), (0.0, 4.8, 0.0), (0.01, 0.01, 0.02)]
    found = picture(device, [FLOOR], [records(places, flux)])
    # Means of 0.4, 1.6 and 0.013 W; that of all is 0.671.
    np.testing.assert_allclose(
        found[pixel(-0.5, 0.1)], BRIGHTNESS_OF_MEAN * 0.4 / 0.671 * np.array([1.0, 0.5, 0.5]), rtol=1e-3
    )
    np.testing.assert_allclose(found[pixel(-0.3, 0.1)], [0.0, 1.0, 0.0], rtol=1e-5)
    np.testing.assert_allclose(found[pixel(0.02, 0.1)], FAINTEST * np.array([0.5, 0.5, 1.0]), rtol=1e-5)
    assert (found.max(axis=2) > 0.0).sum() == 3 * 9


def test_each_bounce_has_a_shape_of_its_own_and_black_lights_have_none(device: Device) -> None:
    bounces = [
        records([(-0.5, 0.1, 0.0), (-0.5, -0.2, 0.0)], [(1.0, 1.0, 1.0), (0.0, 0.0, 0.0)]),
        records([(-0.3, 0.1, 0.0)], [(1.0, 1.0, 1.0)]),
        records([(0.02, 0.1, 0.0)], [(1.0, 1.0, 1.0)]),
    ]
    found = picture(device, [FLOOR], bounces)[..., 0] > 0.0
    shapes = []
    for x in (-0.5, -0.3, 0.02):
        row, column = pixel(x, 0.1)
        shapes.append(found[row - 1 : row + 2, column - 1 : column + 2].astype(int).tolist())
    assert shapes == [[[1, 1, 1]] * 3, [[0, 1, 0], [1, 1, 1], [0, 1, 0]], [[1, 0, 1], [0, 1, 0], [1, 0, 1]]]
    assert found.sum() == 9 + 5 + 5


def test_hidden_lights_are_faint_and_never_over_those_that_are_seen(device: Device) -> None:
    """Of two in one pixel, one under the table and one on it, the seen one shows, whatever their order."""
    white, under, on = (1.0, 1.0, 1.0), (0.3, 0.1, 0.0), (0.225, 0.075, 0.5)
    alone = picture(device, [FLOOR, TABLE], [records([under], [white])])
    together = picture(device, [FLOOR, TABLE], [records([on, under], [white, white])])
    np.testing.assert_allclose(alone[pixel(0.3, 0.1)], HIDDEN * BRIGHTNESS_OF_MEAN, rtol=1e-5)
    np.testing.assert_allclose(together[pixel(0.3, 0.1)], BRIGHTNESS_OF_MEAN, rtol=1e-5)


def test_points_are_seen_on_surfaces_over_them_and_where_there_is_none(device: Device) -> None:
    points = np.array(
        [(-0.31, 0.11, 0.0), (0.3, 0.1, 0.0), (0.3, 0.1, 0.5), (-0.3, 0.1, 0.4), (-0.3, 0.1, -0.2), (9.0, 0.0, 0.0)]
    )
    with device.current() as context:
        scene = SceneSnapshot("s", (FLOOR, TABLE), (Material("m"),))
        geometry = GpuGeometry(context, scene, np.zeros(3))
        gbuffer = GBufferPass(context, device.shaders, WIDTH, HEIGHT).render(geometry, VIEW, 0)
        found = seen_points(gbuffer, VIEW, points)
        nothing = GpuGeometry(context, SceneSnapshot("s", (), ()), np.zeros(3))
        empty = GBufferPass(context, device.shaders, WIDTH, HEIGHT).render(nothing, VIEW, 0)
        in_space = seen_points(empty, VIEW, points)
    assert found.tolist() == [True, False, True, True, False, False]
    assert in_space.tolist() == [True] * 5 + [False]


def test_a_picture_without_lights_is_the_dimmed_base_colour(device: Device) -> None:
    assert picture(device, [FLOOR], [records([], [])]).max() == 0.0
    assert picture(device, [FLOOR], []).max() == 0.0
