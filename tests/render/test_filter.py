# SPDX-License-Identifier: GPL-3.0-or-later
"""The geometry-aware filter against its definition in numpy, and what it must keep and what it must take out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.render.filter_oracle import filtered
from tests.render.rooms import box_room, camera_at, facing_camera, quad
from tests.render.test_low_resolution import picture, room_with_block, wall
from vlm_addon.core.scene import ORTHOGRAPHIC, Float32, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.filter import LARGEST, NONE, FilterSettings, GeometryFilterPass

SIZE = (45, 34)
EVERYTHING = FilterSettings(filter_distance=1e6, filter_cosine=-1.0)
"""All that shows counts."""
BAD = (np.nan, np.inf, -np.inf, 2.0 * LARGEST)


class Run:
    """Values, (h, w, 4) row 0 at the top, filtered over what a scene's camera sees."""

    def __init__(
        self,
        device: Device,
        scene: SceneSnapshot,
        values: np.ndarray,
        n: int = 4,
        chosen: FilterSettings | None = None,
    ) -> None:
        height, width = values.shape[:2]
        chosen = chosen or FilterSettings()
        with device.current() as context:
            gbuffer, view = picture(device, scene, (width, height))
            images = (gbuffer.position, gbuffer.shading_normal, gbuffer.geometric_normal)
            position, shading, geometric = (read_image(image).astype(float) for image in images)
            self.surface = position, shading[..., :3], geometric[..., :3]
            self.shown = self.surface[2].any(axis=2)
            at_0, per_depth = view.picture_width(width)
            self.reach = chosen.filter_distance * (at_0 + per_depth * position[..., 3])
            bottom_up = np.ascontiguousarray(values[::-1], np.float32)
            texture = context.texture((width, height), 4, bottom_up.tobytes(), dtype="f4")
            filter_pass = GeometryFilterPass(context, device.shaders, width, height, n)
            self.image = read_image(filter_pass.render(gbuffer, texture, view, chosen))
            self.counters = filter_pass.counters()


def random_values(size: tuple[int, int], seed: int = 0) -> Float32:
    return np.random.default_rng(seed).random((size[1], size[0], 4), np.float32)


def classes(size: tuple[int, int], n: int) -> Float32:
    """(h, w, 4) random values that depend on the pixel's class alone."""
    y, x = np.mgrid[: size[1], : size[0]]
    return random_values((n, n), n)[y % n, x % n]


def constant(size: tuple[int, int], value: float = 1.0) -> Float32:
    return np.full((size[1], size[0], 4), value, np.float32)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8])
@pytest.mark.parametrize(
    "chosen",
    [FilterSettings(), FilterSettings(filter_distance=0.013, filter_cosine=-1.0)],
    ids=["as it comes", "planes alone"],
)
def test_filter_is_its_definition(device: Device, chosen: FilterSettings, n: int) -> None:
    values = random_values(SIZE)
    values[7, 9:12] = np.nan
    run = Run(device, room_with_block(), values, n, chosen)
    assert run.shown.mean() > 0.5
    expected = filtered(run.surface, values, n, run.reach, chosen.filter_cosine)
    np.testing.assert_allclose(run.image, expected, atol=1e-5)


@settings(max_examples=30, deadline=None)
@given(n=st.integers(1, 8), width=st.integers(1, 60), height=st.integers(1, 50))
def test_pattern_of_the_classes_is_gone_to_the_last_bit(device: Device, n: int, width: int, height: int) -> None:
    """Except where a picture has no pixel of a class within n, which is where it is narrower than that."""
    size = max(width, n), max(height, n)
    run = Run(device, wall(), classes(size, n), n)
    assert (run.image == run.image[0, 0]).all()
    np.testing.assert_allclose(run.image[0, 0], random_values((n, n), n).mean(axis=(0, 1)), rtol=1e-6)


@settings(max_examples=20, deadline=None)
@given(n=st.integers(2, 8), width=st.integers(16, 40), height=st.integers(16, 40), data=st.data())
def test_what_is_linear_is_kept_up_to_the_border_and_the_pattern_taken_out(
    device: Device, n: int, width: int, height: int, data: st.DataObject
) -> None:
    """At the border all neighbours lie on one side: their mean is not that of the pixel."""
    right, down = (data.draw(st.floats(-0.05, 0.05)) for _ in range(2))
    y, x = np.mgrid[:height, :width]
    linear = 5.0 + (right * x + down * y)[..., None]
    run = Run(device, wall(), linear + classes((width, height), n), n)
    expected = linear + random_values((n, n), n).mean(axis=(0, 1))
    np.testing.assert_allclose(run.image, expected, rtol=2e-6)


def test_noise_at_the_border_is_not_taken_for_a_slope(device: Device) -> None:
    """Values of which no two pairs agree: what is moved by adds little to the noise of the mean."""
    values = random_values((60, 60))
    image = Run(device, wall(), values).image[..., :3]
    edges = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert edges.std() < 1.5 * values.std() / 4.0


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_a_slanted_plane_is_even_at_every_depth(device: Device, kind: str) -> None:
    """Up to some 80 degrees, where neighbours lie far apart along the plane, but on it."""
    camera = camera_at((0.0, -3.0, 0.5), (0.0, 0.0, 0.0))
    if kind == "orthographic":
        camera = replace(camera, kind=ORTHOGRAPHIC, ortho_scale=2.0)
    scene = replace(wall(), camera=camera)
    run = Run(device, scene, classes(SIZE, 4))
    assert (run.shown.mean()) > 0.4
    assert np.ptp(run.image[run.shown], axis=0).max() == 0.0


@pytest.mark.parametrize("n", [1, 2, 4, 7])
@pytest.mark.parametrize("value", [0.0, 1e-30, 0.7, 3e15])
def test_what_is_constant_stays_so(device: Device, n: int, value: float) -> None:
    run = Run(device, room_with_block(), constant(SIZE, value), n)
    np.testing.assert_allclose(run.image[run.shown], value, rtol=1e-6)
    assert not run.image[~run.shown].any()


@pytest.mark.parametrize("n", [1, 2, 4, 8])
@pytest.mark.parametrize("bad", BAD)
def test_one_unusable_texel_never_spreads(device: Device, n: int, bad: float) -> None:
    values = constant(SIZE)
    values[20, 20, 2] = bad
    run = Run(device, wall(), values, n)
    np.testing.assert_allclose(run.image, 1.0, rtol=1e-6)
    assert run.counters == {"unusable_pixels": 1.0}


def test_a_pixel_without_usable_neighbours_is_black(device: Device) -> None:
    values = np.full((SIZE[1], SIZE[0], 4), np.nan, np.float32)
    run = Run(device, box_room(), values)
    assert not run.image.any()
    assert run.counters["unusable_pixels"] == run.shown.sum()


def test_what_shows_no_surface_is_not_counted_and_counts_for_nobody(device: Device) -> None:
    scene = replace(wall(), meshes=(quad((-0.3, -0.3, 0), (0.6, 0, 0), (0, 0.6, 0)),))
    shown = Run(device, scene, constant(SIZE)).shown
    assert 0.1 < shown.mean() < 0.9
    for around in (np.float32(np.nan), np.float32(5.0)):
        run = Run(device, scene, np.where(shown[..., None], constant(SIZE), around), 4, EVERYTHING)
        assert run.counters["unusable_pixels"] == 0.0
        assert (run.image[shown] == 1.0).all()
        assert not run.image[~shown].any()


def stepped(run: Run, is_one_side: np.ndarray) -> Float32:
    return np.where(is_one_side[..., None] & run.shown[..., None], np.float32(1.0), np.float32(0.01)).repeat(4, axis=2)


@pytest.mark.parametrize("n", [2, 4, 8])
def test_a_depth_edge_keeps_its_contrast(device: Device, n: int) -> None:
    """A quad a little before a parallel wall: the normals agree, only the plane's distance tells."""
    near = quad((-0.2, -0.2, 0.02), (0.4, 0, 0), (0, 0.4, 0))
    scene = replace(wall(), meshes=(*wall().meshes, near))
    before = Run(device, scene, constant(SIZE))
    is_near = before.surface[0][..., 2] > 0.01
    assert 0.05 < is_near.mean() < 0.5
    values = stepped(before, is_near)
    run = Run(device, scene, values, n)
    np.testing.assert_allclose(run.image, values, rtol=1e-6)
    blurred = Run(device, scene, values, n, EVERYTHING)
    assert not np.allclose(blurred.image, values, rtol=0.1)


@pytest.mark.parametrize("n", [2, 4, 8])
def test_a_crease_keeps_its_contrast(device: Device, n: int) -> None:
    """Walls of a room that meet: near the crease each is near the other's plane, only the normals tell."""
    chosen = FilterSettings(filter_distance=1e6)
    before = Run(device, box_room(), constant(SIZE))
    is_floor = before.surface[2][..., 2] > 0.5
    assert 0.05 < is_floor.mean() < 0.5
    values = stepped(before, is_floor)
    run = Run(device, box_room(), values, n, chosen)
    np.testing.assert_allclose(run.image[run.shown], values[run.shown], rtol=1e-6)


def test_who_counts_for_whom_is_symmetric(device: Device) -> None:
    """What one bright pixel gives to another, that one gives back: up to the classes that each lacks, so with n = 1 and
    none usable but the two."""
    pixels = [(15, 20), (15, 21)]
    given_to = []
    for here, there in (pixels, pixels[::-1]):
        values = np.full((SIZE[1], SIZE[0], 4), np.nan, np.float32)
        values[here] = 1.0
        given_to.append(Run(device, room_with_block(), values, 1).image[there][0])
    assert given_to == [1.0, 1.0]


def test_nothing_negative_is_made_and_what_is_negative_is_kept(device: Device) -> None:
    """Values that grow with the square of the distance from the border: moved there along a slope, their mean falls
    below them all."""
    values = constant(SIZE) * np.arange(SIZE[0], dtype=np.float32)[None, :, None] ** 2
    image = Run(device, wall(), values).image
    assert (image >= 0.0).all()
    assert (image[:, 0] == 0.0).all()
    assert Run(device, wall(), -values).image.min() < -1000.0


def test_the_filter_can_be_off(device: Device) -> None:
    values = random_values(SIZE)
    run = Run(device, box_room(), values, 4, FilterSettings(NONE))
    assert (run.image == values).all()


def test_large_values_do_not_overflow(device: Device) -> None:
    run = Run(device, wall(), constant(SIZE, 0.9 * LARGEST), 8)
    np.testing.assert_allclose(run.image, 0.9 * LARGEST, rtol=1e-6)


def test_threshold_is_the_same_share_of_the_picture_at_every_depth(device: Device) -> None:
    """Two parallel strips in each other's neighbourhood: 1 % of the picture's width apart, near and far, small and
    large."""
    for distance in (1.0, 30.0):
        camera = facing_camera(distance)
        width = camera.sensor_width / camera.lens * distance
        step = quad((0.0, -width, 0.01 * width), (2.0 * width, 0, 0), (0, 2.0 * width, 0))
        back = quad((-2.0 * width, -2.0 * width, 0.0), (4.0 * width, 0, 0), (0, 4.0 * width, 0))
        scene = replace(wall(), meshes=(back, step), camera=camera)
        values = stepped(Run(device, scene, constant(SIZE)), np.arange(SIZE[0])[None] < SIZE[0] // 2)
        for share, is_kept in ((0.009, True), (0.011, False)):
            run = Run(device, scene, values, 4, FilterSettings(filter_distance=share))
            assert (abs(run.image - values).max() < 1e-6) == is_kept, (distance, share)
