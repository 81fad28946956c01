# SPDX-License-Identifier: GPL-3.0-or-later
"""The rotating pattern of rsm_gather: the static picture at a part of its samples, and nothing of what is no more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import empty_room, inward_box
from tests.render.rooms import camera_at
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.scene import AREA, POINT, SPOT, Float32, Light, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings

WATTS = (45.0, 45.0, 45.0)
LAMP = Light("lamp", POINT, WATTS, (0.4, -0.3, 0.5))
SPOT_LAMP = Light("spot", SPOT, WATTS, (1.2, 0.4, 1.0), spot_angle=1.3, spot_blend=0.4)
ROOM = empty_room([LAMP, SPOT_LAMP])
FULL = {"low_resolution": 1}
ROTATING = {"pattern": "rotating", **FULL}
AS_PUBLISHED = {**ROTATING, "restart": "part"}


@pytest.fixture
def fresh() -> Iterator[Device]:
    """A device without any history."""
    with Device() as opened:
        yield opened


def rendered(device: Device, scene: SceneSnapshot, pictures: int = 1, **settings: object) -> Frame:
    values = {"resolution": 64, **settings}
    return device.render(scene, None, RenderSettings(40, 30, "rsm_gather", values, pictures, 64, 4, buffers=True))


def indirect(device: Device, scene: SceneSnapshot, **settings: object) -> Float32:
    return rendered(device, scene, **settings).images["indirect"]


def on_a_fresh_device(scene: SceneSnapshot, **settings: object) -> Float32:
    with Device() as opened:
        return indirect(opened, scene, **settings)


def with_block(at: Sequence[float]) -> SceneSnapshot:
    low = np.array(at) - 0.25
    block = inward_box(low.tolist(), (low + 0.5).tolist(), [0, 1] * 3, outward=True)
    return replace(ROOM, meshes=(*ROOM.meshes, *block))


def test_first_picture_is_the_static_one(fresh: Device) -> None:
    rotating = indirect(fresh, ROOM, **ROTATING)
    np.testing.assert_allclose(rotating, indirect(fresh, ROOM, **FULL), rtol=1e-6)


def test_parts_of_twenty_pictures_make_up_the_static_picture(fresh: Device) -> None:
    """20 parts of 10 are the 200 samples; the mean of each pixel differs by rounding alone, and one part is far off."""
    static = indirect(fresh, ROOM, **FULL)
    pictures = [indirect(fresh, ROOM, **AS_PUBLISHED) for _ in range(20)]
    assert relative_rmse(pictures[0], static) > 0.1
    np.testing.assert_allclose(pictures[-1], static, rtol=1e-4, atol=1e-5 * static.max())


def test_pictures_between_turns_stay_near_the_static_one(fresh: Device) -> None:
    """With restart `whole` all samples come first, so that a part moves the mean by a 21st of its own error at most."""
    static = indirect(fresh, ROOM, **FULL)
    errors = [relative_rmse(indirect(fresh, ROOM, **ROTATING), static) for _ in range(41)]
    assert max(errors) < 0.03
    assert errors[20] < 1e-4
    assert errors[40] < 1e-4


def test_a_part_costs_a_part_of_the_samples(fresh: Device) -> None:
    """Only places of the part are looked up once there is a history."""
    first, second = (rendered(fresh, ROOM, **ROTATING) for _ in range(2))
    counts = [int(frame.images["rsm_gather_map_0_places"].sum()) for frame in (first, second)]
    assert counts[0] > 150
    assert 5 <= counts[1] <= 10
    assert (first.images["rsm_gather_history_age"] == 20.0).all()
    assert (second.images["rsm_gather_history_age"] == 21.0).all()


@pytest.mark.parametrize("restart", ["whole", "part"])
@pytest.mark.parametrize(
    "lights",
    [
        [LAMP],
        [LAMP, replace(SPOT_LAMP, power=(0.0, 0.0, 0.0))],
        [LAMP, replace(SPOT_LAMP, power=(5.0, 1.0, 1.0))],
        [replace(LAMP, position=(0.0, 0.0, 0.0)), SPOT_LAMP],
        [],
    ],
    ids=["one is gone", "one is off", "one is dimmed", "one has moved", "all are off"],
)
def test_no_ghost_of_lights_that_change(fresh: Device, lights: list[Light], restart: str) -> None:
    """The next picture is the first one of a fresh device, bit for bit."""
    settings = {**ROTATING, "restart": restart}
    for _ in range(7):
        indirect(fresh, ROOM, **settings)
    changed = replace(ROOM, lights=tuple(lights))
    assert (indirect(fresh, changed, **settings) == on_a_fresh_device(changed, **settings)).all()


def test_a_moving_object_leaves_no_trail(fresh: Device) -> None:
    """With restart `whole` each picture of the sequence is that of a fresh device."""
    for step in range(4):
        scene = with_block((0.4 * step - 0.6, 0.5, -0.6))
        assert (indirect(fresh, scene, **ROTATING) == on_a_fresh_device(scene, **ROTATING)).all()


def test_the_trail_of_the_published_restart_fades(fresh: Device) -> None:
    """A block leaves at once. What was remembered of it counts for four pictures, so a third is left after ten and a
    tenth after 40, beside the noise of as many parts."""
    for _ in range(20):
        before = indirect(fresh, with_block((0.0, 0.5, -0.6)), **AS_PUBLISHED)
    static = indirect(fresh, ROOM, **FULL)
    trail = (before - static).ravel()
    shares = []
    for _ in range(60):
        found = (indirect(fresh, ROOM, **AS_PUBLISHED) - static).ravel()
        shares.append(float(found @ trail / (trail @ trail)))
    assert shares[0] < 0.9
    assert abs(shares[9]) < 0.34
    assert abs(shares[39]) < 0.1
    assert relative_rmse(found.reshape(static.shape) + static, static) < 0.01


def test_camera_moves_keep_the_picture_nearly_as_right_as_the_static_one(fresh: Device) -> None:
    """Along a path of the camera, and after a cut to elsewhere; against 4,000 samples."""
    path = [camera_at((-1.8 + 0.08 * step, -1.0, 0.55), (0.55, 0.45, -0.18), lens=17.0) for step in range(8)]
    cut = camera_at((1.7, 1.2, 0.2), (-0.5, -0.5, -0.3), lens=17.0)
    found = [indirect(fresh, replace(ROOM, camera=camera), **ROTATING) for camera in (*path, cut)]
    for camera, picture in list(zip((*path, cut), found, strict=True))[-3:]:
        scene = replace(ROOM, camera=camera)
        truth = indirect(fresh, scene, samples=4000, **FULL)
        static = indirect(fresh, scene, **FULL)
        assert relative_rmse(picture, truth) < 1.3 * relative_rmse(static, truth)


def test_a_sequence_is_the_same_on_every_device(fresh: Device) -> None:
    scenes = [
        ROOM,
        ROOM,
        with_block((0.0, 0.5, -0.6)),
        replace(ROOM, camera=camera_at((0, -1, 0), (0, 1, 0), lens=17.0)),
    ]
    first = [indirect(fresh, scene, **AS_PUBLISHED) for scene in scenes]
    with Device() as other:
        second = [indirect(other, scene, **AS_PUBLISHED) for scene in scenes]
    assert all((a == b).all() for a, b in zip(first, second, strict=True))


def test_static_pictures_know_no_history(fresh: Device) -> None:
    expected = indirect(fresh, ROOM)
    for _ in range(3):
        rendered(fresh, with_block((0.0, 0.5, -0.6)), **ROTATING)
    assert (indirect(fresh, ROOM) == expected).all()


def test_other_settings_start_anew(fresh: Device) -> None:
    for _ in range(3):
        indirect(fresh, ROOM, **ROTATING)
    found = indirect(fresh, ROOM, **ROTATING, radius=0.3)
    assert (found == on_a_fresh_device(ROOM, **ROTATING, radius=0.3)).all()


def test_low_resolution_takes_all_samples_wherever_a_pixel_has_no_history(fresh: Device) -> None:
    """A block that appears beside the reach of the only lamp leaves the maps, and so the history of what stays."""
    lamp = Light("l", AREA, WATTS, (0.0, 0.0, -0.5), size_x=0.3, size_y=0.3)
    room = replace(ROOM, lights=(lamp,))
    block = inward_box((-0.4, -0.6, -0.4), (0.6, 0.4, 0.5), [0, 1] * 3, outward=True)
    scene = replace(room, meshes=(*room.meshes, *block))
    for _ in range(3):
        indirect(fresh, room, pattern="rotating")
    frame = rendered(fresh, scene, pattern="rotating")
    assert frame.counters["reflective_maps_drawn"] == 0
    found, expected = frame.images["indirect"], indirect(fresh, scene)
    new = frame.images["rsm_gather_history_age"][..., 0] == 20.0
    assert 50 < new.sum() < 0.7 * new.size
    np.testing.assert_allclose(found[new], expected[new], rtol=1e-5)


@pytest.mark.parametrize("settings", [ROTATING, AS_PUBLISHED, {"pattern": "rotating"}])
def test_nothing_is_brighter_than_the_brightest_surface(fresh: Device, settings: dict[str, object]) -> None:
    """A lamp 2 cm before a wall, whose spot every corner of the room is brighter than without the bound."""
    room = empty_room([Light("l", POINT, WATTS, (0.0, 0.0, 1.23))])
    for _ in range(3):
        frame = rendered(fresh, room, **settings)
        # What the lamp brings to the ceiling below it, all of it reflected.
        assert (frame.images["irradiance"] <= 0.7 * 45.0 / (4.0 * np.pi * 0.02**2)).all()
        assert np.isfinite(frame.images["irradiance"]).all()


def test_pictures_of_one_frame_rotate_on(fresh: Device) -> None:
    """All samples in the first and a part in each other one: no worse than a static picture of as many places."""
    truth = rendered(fresh, ROOM, 16, **FULL).images["indirect"]
    one = rendered(fresh, ROOM, **FULL).images["indirect"]
    frame = rendered(fresh, ROOM, 16, **ROTATING)
    assert relative_rmse(frame.images["indirect"], truth) < relative_rmse(one, truth)
