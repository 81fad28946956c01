# SPDX-License-Identifier: GPL-3.0-or-later
"""Means over pictures: what is reprojected belongs to the same place, and everything else is dropped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import box_room, camera_at, quad
from vlm_addon.core.scene import ORTHOGRAPHIC, Camera, Float32, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import LocalSpace, make_local_space
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.passes.temporal import TemporalPass
from vlm_addon.render.view import make_view

WIDTH, HEIGHT = 40, 30
PLACE = (1.0, -3.0, 1.0)
MIDDLE = (1.0, 1.0, 1.0)

STEEPEST = 0.5
"""1/m: slope of `smooth`."""

Field = Callable[[Float32], Float32]


def smooth(points: Float32) -> Float32:
    """(..., 3) of world points: from 0.5 to 1.5 over metres."""
    return 1.0 + STEEPEST * np.sin(points)


class Sequence:
    """Pictures one after the other, each with what is found at every pixel as a function of its place."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.kept = Kept()

    def picture(
        self,
        scene: SceneSnapshot,
        found: Field = smooth,
        lights_key: str = "lights",
        scene_key: str = "scene",
        limit: float = 0.0,
        first_age: float = 1.0,
        most_age: float = 100.0,
        camera: Camera | None = None,
        **finish: object,
    ) -> tuple[Float32, Float32, Float32]:
        """(h, w, 3) the mean, (h, w, 3) places in m and (h, w) age before this picture, row 0 at the top."""
        scene = replace(scene, camera=camera or scene.camera)
        space = make_local_space(scene)
        with self.device.current() as context:
            shaders = self.device.shaders
            geometry = GpuGeometry(context, space.scene(scene), np.zeros(3))
            view = make_view(space.scene(scene).camera, WIDTH, HEIGHT, geometry.origin)
            gbuffer = GBufferPass(context, shaders, WIDTH, HEIGHT).render(geometry, view, 0)
            temporal = TemporalPass(context, shaders, self.kept, "test", WIDTH, HEIGHT)
            age = temporal.begin(gbuffer, view, space, lights_key, scene_key, limit)
            places = space.world_points(read_image(gbuffer.position)[..., :3])
            values = np.ones((HEIGHT, WIDTH, 4), np.float32)
            values[..., :3] = found(places)
            upload = context.texture((WIDTH, HEIGHT), 4, values[::-1].tobytes(), dtype="f4")
            mean = temporal.finish(gbuffer, upload, first_age, most_age, **finish)
            self.shown = (read_image(gbuffer.geometric_normal)[..., :3] != 0.0).any(axis=2)
            self.age = temporal.images()["history_age"][..., 0]
            self.step = temporal.step
            return read_image(mean)[..., :3], places, read_image(age)[..., 0]


@pytest.fixture
def sequence(device: Device) -> Iterator[Sequence]:
    return Sequence(device)


def nothing(points: Float32) -> Float32:
    return np.zeros_like(points)


def moved_camera(place: tuple[float, float, float], **values: object) -> Camera:
    return camera_at(place, MIDDLE, **{"lens": 35.0, **values})


def test_first_picture_is_what_was_found(sequence: Sequence) -> None:
    mean, places, age = sequence.picture(box_room())
    assert not age.any()
    np.testing.assert_array_equal(mean[sequence.shown], smooth(places).astype(np.float32)[sequence.shown])
    assert not mean[~sequence.shown].any()
    assert sequence.step == 1


def test_pictures_of_a_camera_that_rests_are_averaged_evenly_and_never_blurred(sequence: Sequence) -> None:
    """Noise of each pixel's own: of n pictures it is the mean, to rounding."""
    random = np.random.default_rng(1)
    noise = random.random((12, HEIGHT, WIDTH, 3))
    for index in range(12):
        mean, _, age = sequence.picture(box_room(), lambda points, index=index: noise[index])
        assert (age[sequence.shown] == index).all()
        np.testing.assert_allclose(mean[sequence.shown], noise[: index + 1].mean(axis=0)[sequence.shown], atol=3e-6)
    assert not age[~sequence.shown].any()


def test_age_stops_and_later_pictures_still_count(sequence: Sequence) -> None:
    for _ in range(6):
        sequence.picture(box_room(), most_age=4.0)
    assert (sequence.age[sequence.shown] == 4.0).all()
    mean, _, _ = sequence.picture(box_room(), nothing, most_age=4.0)
    first, _, _ = Sequence(sequence.device).picture(box_room())
    np.testing.assert_allclose(mean, 0.8 * first, rtol=1e-5)


def test_what_counts_more_at_first_weighs_more(sequence: Sequence) -> None:
    first, _, _ = sequence.picture(box_room(), first_age=20.0)
    mean, _, _ = sequence.picture(box_room(), nothing, first_age=20.0)
    np.testing.assert_allclose(mean, first * (20.0 / 21.0), rtol=1e-5)
    assert (sequence.age[sequence.shown] == 21.0).all()


@pytest.mark.parametrize("kind", ["PERSPECTIVE", ORTHOGRAPHIC])
@pytest.mark.parametrize("place", [(1.1, -3.0, 1.0), (1.0, -2.6, 1.2), (0.2, -3.5, 1.5), (1.0, -12.0, 1.0)])
def test_moved_cameras_find_the_history_of_the_same_places(
    sequence: Sequence, place: tuple[float, float, float], kind: str
) -> None:
    """The second picture finds nothing, so that all it shows is half of what the first one found at the same places.
    The local space moves with the camera."""
    values = {"kind": kind, "ortho_scale": 3.0}
    _, before, _ = sequence.picture(box_room(), camera=moved_camera(PLACE, **values))
    steps = np.concatenate([np.linalg.norm(np.diff(before, axis=axis), axis=2).ravel() for axis in (0, 1)])
    mean, places, age = sequence.picture(box_room(), nothing, camera=moved_camera(place, **values))
    remembered = age > 0.0
    assert remembered.sum() > 0.5 * sequence.shown.sum()
    error = np.abs(2.0 * mean - smooth(places))[remembered]
    # Never farther than one pixel off, where the field's slope is at most STEEPEST; 99 of 100 pixels of a surface are
    # nearer to each other than the farthest on the side walls.
    assert error.max() < STEEPEST * np.percentile(steps, 99)
    assert error.mean() < 0.004
    assert not mean[~remembered].any()


def test_what_comes_into_view_has_no_history(sequence: Sequence) -> None:
    """A screen hides half of the room at first."""
    screen = quad((0.0, -0.5, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 2.0))
    room = box_room()
    sequence.picture(replace(room, meshes=(*room.meshes, screen)), lambda points: np.full_like(points, 100.0))
    mean, places, age = sequence.picture(room)
    x = (places[..., 0] - PLACE[0]) / (places[..., 1] - PLACE[1])
    # Where the screen was, as seen through the camera.
    hidden = sequence.shown & (x < 0.0) & (x > -1.0 / 2.5) & (places[..., 1] > -0.4)
    clear = hidden & (np.abs(x) > 0.02) & (np.abs(x) < 0.38) & (places[..., 2] > 0.1)
    assert clear.sum() > 100
    assert not age[clear].any()
    np.testing.assert_allclose(mean[clear], smooth(places)[clear], rtol=1e-6)
    assert (age[(x > 0.02) & sequence.shown] == 1.0).all()


@pytest.mark.parametrize("distance", [0.2, 1.0])
def test_a_surface_that_moves_off_its_plane_drops_its_history(sequence: Sequence, distance: float) -> None:
    def wall(y: float) -> SceneSnapshot:
        meshes = (quad((-4.0, y, -4.0), (9.0, 0.0, 0.0), (0.0, 0.0, 9.0)), *box_room((50.0, 0.0, 0.0)).meshes)
        return replace(box_room(), meshes=meshes)

    sequence.picture(wall(1.0))
    _, _, age = sequence.picture(wall(1.0 + distance))
    assert not age.any()


def test_a_surface_that_slides_in_its_plane_keeps_the_history_of_its_places(sequence: Sequence) -> None:
    """Irradiance belongs to the place, not to the object that is there."""

    def wall(x: float) -> SceneSnapshot:
        meshes = (quad((x - 9.0, 1.0, -9.0), (20.0, 0.0, 0.0), (0.0, 0.0, 20.0)), *box_room((50.0, 0.0, 0.0)).meshes)
        return replace(box_room(), meshes=meshes)

    sequence.picture(wall(0.0))
    mean, places, age = sequence.picture(wall(0.7), nothing)
    assert (age == 1.0).all()
    np.testing.assert_allclose(2.0 * mean, smooth(places), rtol=1e-3)


def test_another_normal_at_the_same_place_has_no_history(sequence: Sequence) -> None:
    room = box_room()
    tilted = np.array([0.0, -0.8, 0.6], np.float32)
    back = replace(room.meshes[2], corner_normals=np.tile(tilted, (2, 3, 1)))
    sequence.picture(room)
    _, places, age = sequence.picture(replace(room, meshes=(*room.meshes[:2], back, *room.meshes[3:])))
    on_back = np.abs(places[..., 1] - 2.0) < 1e-4
    assert on_back.sum() > 100
    assert not age[on_back].any()
    assert (age[sequence.shown & ~on_back] == 1.0).mean() > 0.95


def test_other_lights_drop_everything_at_once(sequence: Sequence) -> None:
    for _ in range(5):
        sequence.picture(box_room(), lambda points: np.full_like(points, 7.0))
    mean, _, age = sequence.picture(box_room(), nothing, lights_key="off")
    assert not age.any()
    assert not mean.any()
    assert sequence.step == 1


def test_a_scene_that_changes_limits_the_history_or_drops_it(sequence: Sequence) -> None:
    for _ in range(9):
        sequence.picture(box_room())
    _, _, age = sequence.picture(box_room(), scene_key="moved", limit=3.0)
    assert (age[sequence.shown] == 3.0).all()
    _, _, age = sequence.picture(box_room(), scene_key="moved", limit=3.0)
    assert (age[sequence.shown] == 4.0).all()
    _, _, age = sequence.picture(box_room(), scene_key="moved again")
    assert not age.any()
    assert sequence.step == 1


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38])
def test_a_value_that_is_none_stays_in_its_pixel_and_is_forgotten(sequence: Sequence, value: float) -> None:
    broken = np.zeros((HEIGHT, WIDTH), bool)
    broken[12, 17] = True

    def found(points: Float32) -> Float32:
        return np.where(broken[..., None], value, smooth(points))

    sequence.picture(box_room())
    mean, _, _ = sequence.picture(box_room(), found)
    assert np.isfinite(mean[~broken]).all()
    mean, places, _ = sequence.picture(box_room(), camera=moved_camera((1.02, -3.0, 1.0)))
    assert np.isfinite(mean).all()
    np.testing.assert_allclose(mean[sequence.shown], smooth(places)[sequence.shown], atol=0.1)


def test_pictures_are_cut_and_the_history_is_not(sequence: Sequence) -> None:
    limit = (0.5, 2.0, 2.0)
    mean, places, _ = sequence.picture(box_room(), brightest=limit)
    np.testing.assert_allclose(
        mean, np.where(sequence.shown[..., None], np.minimum(smooth(places), limit), 0.0), rtol=1e-6
    )
    again, _, _ = sequence.picture(box_room())
    np.testing.assert_allclose(again[sequence.shown], smooth(places)[sequence.shown], rtol=1e-5)


def test_another_size_has_a_history_of_its_own(device: Device) -> None:
    kept = Kept()
    with device.current() as context:
        first = TemporalPass(context, device.shaders, kept, "test", 8, 8)
        again = TemporalPass(context, device.shaders, kept, "test", 8, 8)
        larger = TemporalPass(context, device.shaders, kept, "test", 16, 8)
        other = TemporalPass(context, device.shaders, kept, "other", 16, 8)
    assert first._history is again._history
    assert larger._history is not first._history
    assert other._history is not larger._history


def test_spaces_lead_into_each_other() -> None:
    one, other = LocalSpace(np.array([1.0, 2.0, 3.0]), 0.5), LocalSpace(np.array([-4.0, 0.5, 9.0]), 20.0)
    point = np.array([0.3, -7.0, 2.0])
    scale, offset = one.to(other)
    np.testing.assert_allclose(scale * one.local_points(point) + offset, other.local_points(point), rtol=1e-12)
