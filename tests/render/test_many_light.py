# SPDX-License-Identifier: GPL-3.0-or-later
"""Many lights in rooms with closed forms, behind walls, at any size, and in cases that end badly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import empty_room, inward_box
from tests.render.rooms import box_room, camera_at, quad, split
from tests.render.test_rsm_gather import LAMPS, MIDDLE
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.scene import SPOT, Light, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings

QUICK = {"lights": 128, "resolution": 64, "octree_resolution": 32}


def rendered(device: Device, scene: SceneSnapshot, width: int = 24, height: int = 18, **values: object) -> Frame:
    settings = RenderSettings(width, height, "many_light", {**QUICK, **values}, 1, 64, 4, buffers=True)
    return device.render(scene, None, settings)


def two_rooms(thickness: float) -> SceneSnapshot:
    """A lit room and a dark one with a wall between them, seen from within the dark one; walls of one sheet where the
    thickness is 0."""
    lamp = replace(MIDDLE, position=(-1.0, 0.0, 0.5))
    walls = ((0.7, 0.7, 0.7),)
    lit = inward_box((-2.0, -1.0, -1.0), (0.0, 1.0, 1.0), [0] * 6)
    dark = inward_box((thickness, -1.0, -1.0), (2.0 + thickness, 1.0, 1.0), [0] * 6)
    room = empty_room([lamp], walls)
    return replace(room, meshes=(*lit, *dark), camera=camera_at((1.8 + thickness, 0.8, 0.8), (thickness, -0.3, -0.9)))


@pytest.mark.parametrize("exact_reach", [0, 2, 1024])
@pytest.mark.parametrize("thickness", [0.2, 0.01])
def test_a_closed_room_beside_a_lit_one_stays_black(device: Device, thickness: float, exact_reach: int) -> None:
    scene = two_rooms(thickness)
    dark = rendered(device, scene, octree_resolution=64, exact_reach=exact_reach)
    inside = replace(scene, camera=camera_at((-0.2, 0.8, 0.8), (-2.0, -0.3, -0.9)))
    lit = rendered(device, inside, octree_resolution=64, exact_reach=exact_reach)
    mean = lit.images["irradiance"].mean()
    assert mean > 0.0
    assert dark.images["irradiance"].max() <= 1e-3 * mean


@pytest.mark.parametrize("interleave", [2, 3, 4])
def test_an_even_share_of_the_lights_brings_the_light_of_all(device: Device, interleave: int) -> None:
    """Without a filter, means over the picture differ only by what the parts of the lights miss."""
    room = empty_room([MIDDLE], ((0.5, 0.5, 0.5),))
    whole = rendered(device, room, lights=2048, interleave=1).images["irradiance"].mean()
    parts = rendered(device, room, lights=2048, interleave=interleave, filter="none")
    assert parts.images["irradiance"].mean() == pytest.approx(whole, rel=0.03)
    assert parts.counters["point_lights"] >= 2048
    assert parts.counters["point_lights"] % interleave**2 == 0


@pytest.mark.parametrize("size", [(1, 1), (3, 7), (17, 5)])
def test_any_size_of_the_picture_will_do(device: Device, size: tuple[int, int]) -> None:
    frame = rendered(device, empty_room([MIDDLE]), *size)
    assert frame.images["irradiance"].min() > 0.0


def test_more_tiles_than_lights_leave_one_light_for_each(device: Device) -> None:
    assert rendered(device, box_room(), lights=1, interleave=8).counters["point_lights"] == 64


def test_lights_that_bring_too_little_are_left_out_before_their_rays(device: Device) -> None:
    room = box_room()
    some, all_of_them = (rendered(device, room, interleave=1, least_share=share) for share in (0.01, 0.0))
    none = rendered(device, room, interleave=1, least_share=1.0)
    rays = [frame.counters["rays_per_pixel"] for frame in (none, some, all_of_them)]
    assert rays == sorted(rays)
    assert rays[1] < rays[2] < 128
    mean = all_of_them.images["irradiance"].mean()
    missing = all_of_them.images["irradiance"] - some.images["irradiance"]
    assert missing.min() >= -1e-5 * mean
    assert 0.0 < missing.mean() <= 0.01 * mean
    assert none.counters["skipped_share"] > some.counters["skipped_share"] > 0.0


def test_lights_behind_a_surface_ask_for_no_rays(device: Device) -> None:
    """A spot lights the floor only: no point of the floor faces another."""
    spot = Light("l", SPOT, (45.0,) * 3, (0.0, 0.0, 1.0), (1, 0, 0), (0, 1, 0), (0, 0, 1), spot_angle=0.7)
    above = camera_at((0.0, 0.0, 0.9), (0.0, 0.0, -1.25), lens=50.0)
    frame = rendered(device, replace(empty_room([spot]), camera=above))
    assert frame.counters["rays_per_pixel"] == 0.0
    assert frame.counters["skipped_share"] == 1.0
    assert not frame.images["irradiance"].any()


@pytest.mark.parametrize("bounces", [1, 2, 3])
def test_a_scene_without_light_or_without_surfaces_is_black(device: Device, bounces: int) -> None:
    for scene in (empty_room([]), replace(empty_room([MIDDLE]), meshes=())):
        assert not rendered(device, scene, bounces=bounces).images["irradiance"].any()


@pytest.mark.parametrize("bounces", [2, 3])
def test_bounces_of_a_closed_room_add_up_as_its_reflectance_says(device: Device, bounces: int) -> None:
    """Every wall reflects the half of what it receives: bounce k is the half of bounce k - 1, over all of the room."""
    room = empty_room([replace(MIDDLE, radius=0.0)], ((0.5, 0.5, 0.5),))
    grey = np.full((2, 3), 0.5, np.float32)
    room = replace(room, meshes=tuple(replace(mesh, reflectance=grey) for mesh in room.meshes))
    views = [camera_at(place, (0.0, 0.0, 0.0), lens=12.0) for place in ((-1.8, -1.0, 0.5), (1.8, 1.0, -0.5))]
    means = [
        np.mean(
            [
                rendered(device, replace(room, camera=view), lights=2048, bounces=count).images["irradiance"].mean()
                for view in views
            ]
        )
        for count in (1, bounces)
    ]
    assert means[1] / means[0] == pytest.approx(sum(0.5**k for k in range(bounces)), rel=0.05)


def test_frame_is_the_same_bit_for_bit_whatever_came_before(device: Device) -> None:
    room = box_room()
    first = rendered(device, room, bounces=2)
    rendered(device, empty_room([LAMPS["area"], LAMPS["spot"]]), 16, 16, lights=300, interleave=2)
    second = rendered(device, room, bounces=2)
    for name, image in first.images.items():
        assert (image == second.images[name]).all(), name
    assert first.images["indirect"].max() > 0.0


def test_another_seed_is_another_picture_of_the_same_light(device: Device) -> None:
    pictures = [rendered(device, box_room(), lights=1024, seed=seed).images["irradiance"] for seed in range(4)]
    assert (pictures[0] != pictures[1]).any()
    means = [picture.mean() for picture in pictures]
    assert np.ptp(means) < 0.05 * np.mean(means)


def kept_structures(device: Device) -> dict[str, int]:
    """How often what does not lie about the camera was built."""
    return {kind: count for kind, count in device.kept.built.items() if not kind.startswith("geometry")}


def test_octree_and_maps_are_kept_while_nothing_but_the_camera_moves(device: Device) -> None:
    room = box_room()
    rendered(device, room)
    built = kept_structures(device)
    moved = rendered(device, replace(room, camera=camera_at((1.0, -2.0, 1.2), (1.0, 1.0, 1.0))))
    assert moved.counters["reflective_maps_drawn"] == 0
    assert kept_structures(device) == built


def test_what_can_be_looked_at(device: Device) -> None:
    frame = rendered(device, box_room())
    own = {name.removeprefix("many_light_") for name in frame.images if name.startswith("many_light_")}
    wanted = {"split_position", "split_normal", "split_irradiance", "merged_irradiance", "visibility", "lights"}
    assert wanted <= own
    assert {"octree_level_1", "map_0_flux"} <= own
    visibility = frame.images["many_light_visibility"]
    assert visibility.min() >= 0.0
    assert visibility.max() <= 1.0 + 1e-5
    assert visibility.min() < 0.99
    assert frame.images["many_light_merged_irradiance"].shape == (18, 24, 3)


def test_lamps_that_cast_no_shadow_are_named(device: Device) -> None:
    (lamp,) = box_room().lights
    frame = rendered(device, replace(box_room(), lights=(replace(lamp, casts_shadow=False),)))
    assert any("lamp" in reason for reason in frame.reasons)


def finely_split(scene: SceneSnapshot, times: int) -> SceneSnapshot:
    """The same surfaces of 4^times as many triangles, in the middle of a floor of 400 m that nothing lights."""
    meshes = []
    for mesh in scene.meshes:
        corners = split(mesh.positions[mesh.triangles], times)
        count = len(corners)
        meshes.append(
            replace(
                mesh,
                positions=corners.reshape(-1, 3),
                triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
                corner_normals=np.tile(mesh.corner_normals[:1], (count, 1, 1)),
                corner_uvs=np.zeros((count, 3, 2), np.float32),
                corner_colors=np.zeros((0, 3, 3), np.float32),
                material_indices=np.full(count, mesh.material_indices[0], np.int32),
                tag_ids=np.zeros(count, np.int32),
                reflectance=np.zeros((count, 3), np.float32),
                emission=np.zeros((count, 3), np.float32),
            )
        )
    return replace(scene, meshes=(*meshes, quad((-200.0, -200.0, -50.0), (400.0, 0.0, 0.0), (0.0, 400.0, 0.0))))


def test_a_dense_room_in_a_wide_scene_keeps_its_light(device: Device) -> None:
    """98,304 triangles would share a few voxels of 6 m: rays that ask for all of them end before their time."""
    room = empty_room([MIDDLE])
    alone = rendered(device, room, lights=256)
    wide = rendered(device, finely_split(room, 6), lights=256)
    assert any("octree" in reason for reason in wide.reasons)
    assert not any("cut off" in reason for reason in wide.reasons)
    assert wide.images["irradiance"].mean() == pytest.approx(alone.images["irradiance"].mean(), rel=0.03)


def test_a_reflectance_that_is_no_number_is_named(device: Device) -> None:
    room = empty_room([MIDDLE])
    broken = replace(room.meshes[2], reflectance=np.full((2, 3), np.nan, np.float32))
    with pytest.raises(InvalidInput, match="wall 1 False"):
        rendered(device, replace(room, meshes=(*room.meshes[:2], broken)))


def test_meshes_without_triangles_are_an_empty_scene(device: Device) -> None:
    wall = empty_room([]).meshes[0]
    empty = replace(
        wall,
        triangles=wall.triangles[:0],
        **{
            name: getattr(wall, name)[:0]
            for name in ("corner_normals", "corner_uvs", "material_indices", "tag_ids", "reflectance", "emission")
        },
    )
    frame = rendered(device, replace(empty_room([MIDDLE]), meshes=(empty,)))
    assert not frame.images["irradiance"].any()
