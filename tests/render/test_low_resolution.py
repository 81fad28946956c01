# SPDX-License-Identifier: GPL-3.0-or-later
"""The low-resolution gather with gathers in numpy that know what they were asked: the frame's own pixels, once each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import inward_box
from tests.render.rooms import box_room, camera_at, facing_camera, quad
from vlm_addon.core.scene import ORTHOGRAPHIC, Float32, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBuffer, GBufferPass
from vlm_addon.render.passes.low_resolution import (
    Gather,
    LowResolutionGather,
    LowResolutionSettings,
    PickedPixels,
    SizedPasses,
)
from vlm_addon.render.view import View, make_view

Function = Callable[[Float32, Float32], Float32]
"""(h, w, 4) of positions and normals, (h, w, 4) each."""
NEVER = LowResolutionSettings(2, 3.0, 1e6, 2.0)
"""Thresholds that nothing reaches."""


def room_with_block() -> SceneSnapshot:
    """Walls, and a block that stands free of them."""
    room = box_room()
    block = inward_box((0.6, 0.6, 0.2), (1.1, 1.0, 0.9), [0] * 6, outward=True)
    return replace(room, meshes=(*room.meshes, *block))


def wall() -> SceneSnapshot:
    """A plane that fills the picture of the camera that faces it."""
    room = box_room()
    return replace(room, meshes=(quad((-5, -5, 0), (10, 0, 0), (0, 10, 0)),), camera=facing_camera())


def smooth(position: Float32, normal: Float32) -> Float32:
    """Linear in the position, another one for each of four channels."""
    return position[..., :3] @ np.array([[1, 2, 3, 4], [0, 1, 0, -1], [2, 0, 1, 5]], np.float32) + 1.0


def jumping(position: Float32, normal: Float32) -> Float32:
    """Another constant for each direction of the normal."""
    return smooth(np.round(normal), normal)


class Story:
    """A gather that computes `function` and keeps which pixels it was asked for, in order of the calls."""

    def __init__(self, device: Device, function: Function) -> None:
        self._device, self._function = device, function
        self.asked: list[np.ndarray] = []

    def __call__(self, picked: PickedPixels) -> object:
        position, normal = (read_image(picked.gbuffer.position), read_image(picked.gbuffer.geometric_normal))
        shown = normal[..., :3].any(axis=2)
        width, height = picked.pixel.size
        pixel = np.frombuffer(picked.pixel.read(), np.int32).reshape(height, width, 2)[::-1]
        self.asked.append(pixel[shown])
        values = np.where(shown[..., None], self._function(position, normal), 0.0).astype(np.float32)
        return self._device.context.texture((width, height), 4, values[::-1].tobytes(), dtype="f4")


class Run:
    """A picture of a scene, gathered at low resolution. full: what the function gives for each pixel."""

    def __init__(
        self,
        device: Device,
        scene: SceneSnapshot,
        function: Function,
        settings: LowResolutionSettings,
        size: tuple[int, int] = (37, 26),
    ) -> None:
        with device.current() as context:
            gbuffer, view = picture(device, scene, size)
            low = LowResolutionGather(context, device.shaders, *size, settings, keep_low=True)
            story = Story(device, function)
            found = low.render(gbuffer, view, as_gather(story))
            self.asked, self.counters, self.images = story.asked, low.counters(), low.images()
            self.image = read_image(found)
            normal = read_image(gbuffer.geometric_normal)
            self.shown = normal[..., :3].any(axis=2)
            self.full = np.where(self.shown[..., None], function(read_image(gbuffer.position), normal), 0.0)


def as_gather(story: Story) -> Gather:
    return story  # type: ignore[return-value]


def picture(device: Device, scene: SceneSnapshot, size: tuple[int, int]) -> tuple[GBuffer, View]:
    assert scene.camera is not None
    geometry = GpuGeometry(device.context, scene, np.zeros(3))
    view = make_view(scene.camera, *size, geometry.origin)
    return GBufferPass(device.context, device.shaders, *size).render(geometry, view, 0), view


@pytest.mark.parametrize("size", [(37, 26), (38, 25), (1, 1), (2, 5), (64, 48)])
@pytest.mark.parametrize("factor", [2, 3, 4])
def test_what_is_linear_over_the_picture_is_found_exactly_whatever_the_size(
    device: Device, factor: int, size: tuple[int, int]
) -> None:
    run = Run(device, wall(), smooth, replace(NEVER, low_resolution=factor), size)
    np.testing.assert_allclose(run.image, run.full, atol=2e-5)
    assert run.counters["low_resolution_share"] == 1.0
    assert len(run.asked) == 1
    assert not run.images["discontinuity"].any()


def test_pixels_beside_a_jump_are_gathered_and_each_once(device: Device) -> None:
    run = Run(device, room_with_block(), jumping, LowResolutionSettings(2, 0.2, 0.5, 2.0))
    np.testing.assert_allclose(run.image, run.full, atol=1e-6)
    low, redone = run.asked
    on_steps = np.argwhere(run.shown[::-1][::2, ::2])[:, ::-1] * 2
    assert set(map(tuple, on_steps)) <= set(map(tuple, low))
    assert len(low) <= 19 * 14
    marked = np.argwhere(run.images["discontinuity"][::-1, :, 0])[:, ::-1]
    assert sorted(map(tuple, redone)) == sorted(map(tuple, marked))
    share = 1.0 - len(redone) / run.shown.sum()
    assert run.counters["low_resolution_share"] == pytest.approx(share)
    assert 0.5 < share < 0.95


def test_neighbours_far_behind_do_not_count_though_they_face_the_same_way(device: Device) -> None:
    """A quad before a parallel wall: only the position tells."""
    scene = wall()
    scene = replace(scene, meshes=(*scene.meshes, quad((-0.2, -0.2, 0.5), (0.4, 0, 0), (0, 0.4, 0))))

    def is_near(position: Float32) -> Float32:
        return np.repeat(position[..., 2:3] > 0.25, 4, axis=2)

    exact = Run(device, scene, lambda p, n: is_near(p), LowResolutionSettings(2, 3.0, 0.1, 2.0))
    assert (exact.image == exact.full).all()
    assert 0.5 < exact.counters["low_resolution_share"] < 1.0
    blurred = Run(device, scene, lambda p, n: is_near(p), NEVER)
    assert not (blurred.image == blurred.full).all()
    assert blurred.counters["low_resolution_share"] == 1.0


@pytest.mark.parametrize(
    "settings",
    [LowResolutionSettings(1), LowResolutionSettings(2, 0.0), LowResolutionSettings(2, 0.2, 0.0)],
    ids=["factor 1", "normals", "positions"],
)
def test_all_pixels_are_gathered_where_asked_to(device: Device, settings: LowResolutionSettings) -> None:
    run = Run(device, room_with_block(), smooth, settings)
    assert (run.image == run.full.astype(np.float32)).all()
    assert run.counters["low_resolution_share"] == 0.0
    assert len(run.asked) == 1
    assert sorted(map(tuple, run.asked[0])) == sorted(map(tuple, np.argwhere(run.shown[::-1])[:, ::-1]))


def test_no_pixel_is_gathered_where_nothing_reaches_the_thresholds(device: Device) -> None:
    """Also at silhouettes and on what is smaller than the low resolution's steps."""
    scene = replace(wall(), meshes=tuple(quad((x, y, 0), (0.02, 0, 0), (0, 0.9, 0)) for x, y in splinters()))
    run = Run(device, scene, jumping, NEVER, (64, 48))
    assert 0.01 < run.shown.mean() < 0.5
    assert run.counters["low_resolution_share"] == 1.0
    np.testing.assert_allclose(run.image, run.full, atol=1e-6)


def splinters() -> Iterator[tuple[float, float]]:
    for step in range(9):
        yield -0.6 + 0.13 * step, -0.45


def test_share_falls_with_the_thresholds(device: Device) -> None:
    shares = [
        Run(device, room_with_block(), smooth, LowResolutionSettings(2, 0.2, reach, 2.0)).counters[
            "low_resolution_share"
        ]
        for reach in (1.0, 0.2, 0.08, 0.06, 0.01)
    ]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > shares[-1] + 0.5


def test_orthographic_camera_has_the_same_threshold_at_every_depth(device: Device) -> None:
    camera = replace(facing_camera(), kind=ORTHOGRAPHIC, ortho_scale=2.0)
    far = replace(camera_at((0, 0, 100), (0, 0, 0)), kind=ORTHOGRAPHIC, ortho_scale=2.0)
    step = 2.0 / 40
    for eye in (camera, far):
        scene = replace(wall(), camera=eye)
        for reach, share in ((1.5 * step / 2.0, 1.0), (0.9 * step / 2.0, 0.25)):
            run = Run(device, scene, smooth, LowResolutionSettings(2, 0.2, reach, 2.0), (40, 40))
            assert run.counters["low_resolution_share"] == pytest.approx(share, abs=0.05)


def test_a_step_in_the_result_alone_is_found(device: Device) -> None:
    """On a wall that is even: what is gathered jumps from 1 to 1.5 at x = 0.1."""

    def step(position: Float32, normal: Float32) -> Float32:
        return np.repeat(1.0 + 0.5 * (position[..., :1] > 0.1), 4, axis=2)

    exact = Run(device, wall(), step, LowResolutionSettings(2, 0.2, 0.1, 0.3))
    assert (exact.image == exact.full).all()
    assert 0.9 < exact.counters["low_resolution_share"] < 1.0
    blurred = Run(device, wall(), step, LowResolutionSettings(2, 0.2, 0.1, 0.4))
    assert not (blurred.image == blurred.full).all()
    assert blurred.counters["low_resolution_share"] == 1.0


def test_results_without_light_are_alike(device: Device) -> None:
    run = Run(device, wall(), lambda p, n: np.zeros_like(p), LowResolutionSettings(2, 0.2, 0.1, 0.0))
    assert run.counters["low_resolution_share"] == 1.0


def test_a_picture_without_surfaces(device: Device) -> None:
    scene = replace(wall(), camera=camera_at((0, 0, 2), (0, 0, 4)))
    run = Run(device, scene, smooth, LowResolutionSettings())
    assert not run.image.any()
    assert run.counters["low_resolution_share"] == 0.0


def test_the_next_picture_holds_nothing_of_the_one_before(device: Device) -> None:
    size = (37, 26)
    with device.current() as context:
        low = LowResolutionGather(context, device.shaders, *size, LowResolutionSettings(2, 0.2, 0.05))
        images = []
        for scene in (wall(), room_with_block(), box_room(), wall(), room_with_block()):
            gbuffer, view = picture(device, scene, size)
            images.append(read_image(low.render(gbuffer, view, as_gather(Story(device, jumping)))))
        for index, scene in ((3, wall()), (4, room_with_block())):
            assert (images[index] == images[index - 3]).all(), scene.name
        assert low.shown > low.redone > 0


def test_low_resolution_view_shows_each_value_where_it_stands(device: Device) -> None:
    run = Run(device, wall(), smooth, NEVER)
    view = run.images["low_resolution"]
    assert view.shape == (26, 37, 3)
    corner = view[::-1][::2, ::2]
    np.testing.assert_allclose(corner, run.full[::-1][::2, ::2, :3], atol=1e-5)


def test_there_is_one_pass_for_each_size(device: Device) -> None:
    passes = SizedPasses(lambda width, height: [width, height])
    with device.current():
        large, _ = picture(device, wall(), (8, 4))
        small, _ = picture(device, wall(), (4, 4))
        assert passes.of(large) is passes.of(large)
        assert passes.of(small) == [4, 4]
        assert passes.of(large) == [8, 4]
