# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflective shadow maps over frames: drawn again where something changed in them, and right whatever came before."""

from __future__ import annotations

import gc
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from tests.render.closed_rooms import empty_room, inward_box
from tests.render.rooms import camera_at, quad
from vlm_addon.core.reach import in_reach
from vlm_addon.core.scene import AREA, DIFFUSE, POINT, SPOT, SUN, Light, Material, Mesh, SceneSnapshot, Texture
from vlm_addon.render import lamp_shadows
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.kept_shadow_maps import KeptShadowMaps
from vlm_addon.render.lamp_scenes import LampScenes

DOWN = {"spot_angle": 0.8, "spot_blend": 0.2}
LEFT = Light("left", SPOT, (30.0, 30.0, 30.0), (-3.0, 0.0, 2.0), **DOWN)
RIGHT = Light("right", SPOT, (20.0, 30.0, 40.0), (3.0, 0.0, 2.0), **DOWN)


def block(x: float, material: int = 1) -> tuple[Mesh, ...]:
    """A cube of 0.4 m on the floor at x."""
    return tuple(inward_box((x - 0.2, -0.2, 0.0), (x + 0.2, 0.2, 0.4), [material] * 6, outward=True))


def hall(block_at: float = 0.0, lights: tuple[Light, ...] = (LEFT, RIGHT)) -> SceneSnapshot:
    """A floor of three tiles under two spots that light one each, and a block."""
    floors = [quad((x - 1.5, -1.5, 0.0), (3.0, 0.0, 0.0), (0.0, 3.0, 0.0)) for x in (-3.0, 0.0, 3.0)]
    materials = (Material("floor", DIFFUSE, (0.5, 0.5, 0.5)), Material("block", DIFFUSE, (0.8, 0.2, 0.2)))
    camera = camera_at((0.0, -7.0, 4.0), (0.0, 0.0, 0.0))
    return SceneSnapshot("hall", (*floors, *block(block_at)), materials, lights=lights, camera=camera)


def rendered(device: Device, snapshot: SceneSnapshot, samples: int = 1, **settings: object) -> Frame:
    values = {"resolution": 32, "samples": 20, "low_resolution": 1, **settings}
    return device.render(snapshot, None, RenderSettings(24, 16, "rsm_gather", values, samples, 64, 4))


def drawn(frame: Frame) -> int:
    return int(frame.counters["reflective_maps_drawn"])


def same(first: Frame, second: Frame) -> bool:
    return all((image == second.images[name]).all() for name, image in first.images.items())


@pytest.fixture
def used() -> Device:
    """A device whose maps are of other scenes."""
    with Device() as opened:
        rendered(opened, empty_room([Light("l", POINT, (9.0, 9.0, 9.0), (0.5, 0.0, 0.0))]))
        yield opened


def fresh(snapshot: SceneSnapshot) -> Frame:
    with Device() as opened:
        return rendered(opened, snapshot)


def test_what_has_not_changed_is_not_drawn_again(used: Device) -> None:
    first = rendered(used, hall())
    second = rendered(used, hall())
    assert (drawn(first), drawn(second)) == (2, 0)
    assert first.counters["reflective_maps"] == second.counters["reflective_maps"] == 2
    assert same(first, second)
    assert first.images["indirect"].max() > 0.0


@pytest.mark.parametrize(
    ("before", "after", "expected"), [(0.0, 0.3, 0), (-3.0, -2.8, 1), (0.0, 3.0, 1), (-3.0, 3.0, 2)]
)
def test_an_object_that_moves_redraws_the_maps_it_was_or_is_in(
    used: Device, before: float, after: float, expected: int
) -> None:
    rendered(used, hall(before))
    moved = rendered(used, hall(after))
    assert drawn(moved) == expected
    assert same(moved, fresh(hall(after)))


def test_camera_moves_draw_none_and_give_the_picture_of_a_fresh_device(used: Device) -> None:
    """What a map holds does not depend on where the camera was when it was drawn."""
    rendered(used, hall())
    for place in ((3.0, -2.0, 1.0), (-40.0, 5.0, 30.0)):
        moved = replace(hall(), camera=camera_at(place, (0.0, 0.0, 0.0)))
        found = rendered(used, moved)
        assert drawn(found) == 0
        assert same(found, fresh(moved))


def test_an_object_far_away_that_widens_the_scene_draws_none(used: Device) -> None:
    rendered(used, hall())
    wider = replace(hall(), meshes=(*hall().meshes, *block(50.0)))
    found = rendered(used, wider)
    assert drawn(found) == 0
    assert same(found, fresh(wider))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"power": (1.0, 1.0, 1.0)}, 1),
        ({"position": (-3.0, 0.0, 2.1)}, 1),
        ({"spot_angle": 0.7}, 1),
        ({"name": "other"}, 0),
    ],
    ids=["power", "place", "cone", "name"],
)
def test_a_lamp_that_changes_redraws_its_own_map(used: Device, change: dict[str, object], expected: int) -> None:
    rendered(used, hall())
    changed = hall(lights=(replace(LEFT, **change), RIGHT))
    found = rendered(used, changed)
    assert drawn(found) == expected
    assert same(found, fresh(changed))


def test_a_material_or_texture_that_changes_redraws_the_maps_that_show_it(used: Device) -> None:
    painted = replace(hall(-3.0), textures=(Texture("t", np.full((2, 2, 4), 0.5, np.float32)),))
    painted = replace(painted, materials=(painted.materials[0], replace(painted.materials[1], base_color_texture=0)))
    assert drawn(rendered(used, painted)) == 2
    darker = replace(painted, textures=(Texture("t", np.full((2, 2, 4), 0.1, np.float32)),))
    found = rendered(used, darker)
    assert drawn(found) == 1
    assert same(found, fresh(darker))
    floor = replace(darker.materials[0], base_color=(0.1, 0.1, 0.1))
    assert drawn(rendered(used, replace(darker, materials=(floor, darker.materials[1])))) == 2


def test_material_slots_that_are_renumbered_draw_none(used: Device) -> None:
    rendered(used, hall(-3.0))
    plain = hall(-3.0)
    meshes = tuple(replace(mesh, material_indices=mesh.material_indices + 1) for mesh in plain.meshes)
    unused = Material("unused", DIFFUSE, (0.9, 0.1, 0.9))
    assert drawn(rendered(used, replace(plain, meshes=meshes, materials=(unused, *plain.materials)))) == 0


def test_another_resolution_or_number_of_maps_draws_again(used: Device) -> None:
    lamp = Light("area", AREA, (9.0, 9.0, 9.0), (0.0, 0.0, 2.0))
    assert drawn(rendered(used, hall(lights=(lamp,)), area_maps=2)) == 2
    assert drawn(rendered(used, hall(lights=(lamp,)), area_maps=2, resolution=64)) == 2
    assert drawn(rendered(used, hall(lights=(lamp,)), area_maps=3, resolution=64)) == 3
    assert drawn(rendered(used, hall(lights=(lamp,)), area_maps=3, resolution=64)) == 0
    assert drawn(rendered(used, hall(), area_maps=3)) == 2
    assert drawn(rendered(used, hall(), area_maps=4)) == 0


def test_lamps_switched_off_and_on_leave_nothing_behind(used: Device) -> None:
    both = rendered(used, hall())
    left = rendered(used, hall(lights=(LEFT, replace(RIGHT, power=(0.0, 0.0, 0.0)))))
    assert drawn(left) == 0
    assert same(left, fresh(hall(lights=(LEFT, replace(RIGHT, power=(0.0, 0.0, 0.0))))))
    none = rendered(used, hall(lights=()))
    assert not none.images["indirect"].any()
    again = rendered(used, hall())
    assert drawn(again) == 2
    assert same(again, both)


def test_a_lamp_that_sees_nothing_then_turns_and_one_that_goes_into_a_block(used: Device) -> None:
    away = replace(RIGHT, x_axis=(1.0, 0.0, 0.0), y_axis=(0.0, -1.0, 0.0), z_axis=(0.0, 0.0, -1.0))
    nothing = rendered(used, hall(lights=(away,)))
    assert not nothing.images["indirect"].any()
    assert "shines past every surface" in nothing.plan["direct_light"].reason
    assert "reflective_maps" not in nothing.counters
    wanted = RenderSettings(32, 24, "rsm_gather", samples=1, effects={"indirect_light": "on"})
    assert used.render(hall(lights=(away,)), None, wanted).counters["reflective_maps"] == 1
    turned = rendered(used, hall(lights=(RIGHT,)))
    assert turned.images["indirect"].any()
    assert same(turned, fresh(hall(lights=(RIGHT,))))
    inside = hall(3.0, lights=(replace(RIGHT, position=(3.0, 0.0, 0.2)),))
    assert not rendered(used, inside).images["indirect"].any()


def test_ten_lamps_at_once_are_the_sum_of_each(used: Device) -> None:
    lamps = [
        replace(LEFT, position=(-3.0 + 0.6 * i, 0.1 * i, 2.0), power=(3.0 * i + 1.0, 10.0, 5.0)) for i in range(10)
    ]
    alone = [rendered(used, hall(lights=(lamp,))).images["indirect"] for lamp in lamps]
    together = rendered(used, hall(lights=tuple(lamps)))
    assert together.counters["reflective_maps"] == 10
    np.testing.assert_allclose(together.images["indirect"], np.sum(alone, axis=0), rtol=1e-4, atol=1e-7)


def test_order_of_the_lamps_moves_no_map(used: Device) -> None:
    rendered(used, hall())
    assert drawn(rendered(used, hall(lights=(RIGHT, LEFT)))) == 0
    assert drawn(rendered(used, hall(lights=(RIGHT,)))) == 0


def test_memory_does_not_grow_while_lamps_come_and_go(used: Device) -> None:
    """200 frames of none to three lamps that are never the same: four textures stay for each map there is."""
    random = np.random.default_rng(3)
    kinds = (POINT, SPOT, SUN, AREA)
    rendered(used, hall(lights=()), resolution=8)
    without_maps = textures_alive(used)
    for index in range(200):
        places = random.uniform((-4, -1, 1), (4, 1, 3), (random.integers(0, 4), 3)).tolist()
        lamps = tuple(Light("l", kinds[random.integers(4)], (5.0,) * 3, tuple(place)) for place in places)
        frame = rendered(used, hall(lights=lamps), resolution=8)
        if index % 20 == 19:
            kept = 4 * frame.counters.get("reflective_maps", 0) + shadow_maps_kept(used)
            assert textures_alive(used) == without_maps + kept


def shadow_maps_kept(device: Device) -> int:
    return len(device.kept.hold(lamp_shadows.KIND, KeptShadowMaps))


def textures_alive(device: Device) -> int:
    """Of this device: those that are reachable, and those that wait to be released."""
    gc.collect()
    found = (item for item in gc.get_objects() if isinstance(item, moderngl.Texture))
    return sum(texture.ctx is device.context for texture in found) + len(device.context.objects)


def test_reach_of_a_spot_is_its_cone_and_no_more_than_the_pyramid_around_it() -> None:
    """Boxes of 1 cm: what lies in the cone counts, what lies outside of the pyramid around it does not."""
    random = np.random.default_rng(1)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    light = Light("l", SPOT, (1.0,) * 3, (1.0, -2.0, 3.0), *(tuple(axis) for axis in axes), 1.3, spot_scale=(0.5, 1.0))
    light = replace(light, radius=0.0, spot_angle=1.3)
    places = random.uniform(-5.0, 5.0, (4000, 3))
    half = np.array([np.where(bits, 0.005, -0.005) for bits in np.ndindex(2, 2, 2)])
    found = in_reach(light, (np.array(light.position) + places @ axes)[:, None] + half)
    slopes = places[:, :2] / -places[:, 2:] / (0.5, 1.0)
    ahead = places[:, 2] < 0.0
    inside = ahead & (np.hypot(*slopes.T) < np.tan(0.65))
    clear = np.abs(places[:, 2]) > 0.1
    beyond = ~ahead | (np.abs(slopes) > 1.1 * np.tan(0.65) + 0.05 / np.abs(places[:, 2:])).any(axis=1)
    assert found[inside].all()
    assert inside.sum() > 100
    assert not found[beyond & clear].any()


def test_reach_of_other_lamps() -> None:
    box = np.array([np.where(bits, 0.1, -0.1) for bits in np.ndindex(2, 2, 2)])
    boxes = np.stack([box, box]) + np.array([0.0, 0.0, 1.0]) * np.array([1.0, -1.0])[:, None, None]
    place = (0.0, 0.0, 0.0)
    assert in_reach(Light("l", AREA, (1.0,) * 3, place), boxes).tolist() == [False, True]
    assert in_reach(Light("l", SPOT, (1.0,) * 3, place, spot_angle=np.pi), boxes).tolist() == [False, True]
    for kind in (POINT, SUN):
        assert in_reach(Light("l", kind, (1.0,) * 3, place), boxes).all()
    assert in_reach(Light("l", SPOT, (1.0,) * 3, place), np.zeros((0, 8, 3))).tolist() == []


def test_keys_know_order_and_shape_of_what_a_lamp_can_light() -> None:
    scenes = LampScenes(hall())
    assert scenes.of(LEFT).key != scenes.of(RIGHT).key
    assert scenes.of(LEFT).lamp_key != scenes.of(replace(LEFT, spot_blend=0.9)).lamp_key
    assert scenes.of(LEFT).key == scenes.of(replace(LEFT, spot_blend=0.9)).key
    local, space = scenes.local(scenes.of(LEFT))
    assert local.triangle_count == 2
    low, high = local.bounds()
    np.testing.assert_allclose(space.world_points(low.astype(np.float32)), [-4.5, -1.5, 0.0], atol=1e-5)
    np.testing.assert_allclose(space.world_points(high.astype(np.float32)), [-1.5, 1.5, 0.0], atol=1e-5)
