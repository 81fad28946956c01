# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames whose lights come from structures that are kept: what is built when, and that nothing pops, leaks or seams."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import box_room, camera_at, lights_from_triangles, quad, split
from vlm_addon.core.light_grid import FEW_LIGHTS, GridSettings, LightGrid
from vlm_addon.core.light_mesh import VirtualLightMesh, join
from vlm_addon.core.scene import DIFFUSE, POINT, Float32, Float64, Light, Material, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.passes.tile_bounds import TILE_SIDE

TREES = ("static_tree", "dynamic_tree", "window_factor", "scale", "static_clusters", "dynamic_clusters")
PAGE = 4096


def wall_lights(snapshot: SceneSnapshot, times: int = 4) -> VirtualLightMesh:
    """The walls of the box room cut into lights, a little behind the walls; they move nowhere."""
    walls = [mesh for mesh in snapshot.meshes if mesh.name in ("floor", "ceiling", "back", "left", "right")]
    corners = split(np.concatenate([mesh.positions[mesh.triangles] for mesh in walls]), times)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lights = lights_from_triangles(corners - 1e-3 * normals[:, None], emission=0.0, colour=0.6)
    samples = replace(lights.samples, positions=lights.samples.positions + 2e-3 * normals)
    return replace(lights, samples=samples)


def turning_lights(turn: float) -> VirtualLightMesh:
    """A glowing quad of 128 lights in the middle of the room, turned about the vertical by `turn` rad."""
    along = np.array([np.cos(turn), np.sin(turn), 0.0])
    square = quad(np.array([1.0, 1.0, 0.5]) - 0.25 * along, 0.5 * along, (0.0, 0.0, 0.5))
    lights = lights_from_triangles(split(square.positions[square.triangles], 3), emission=(2.0, 1.0, 0.5))
    return replace(lights, dynamic=np.ones(len(lights), bool))


def settings(**values: object) -> RenderSettings:
    return RenderSettings(
        40, 30, technique_settings=values, samples=1, shadow_resolution=64, shadow_samples=1, buffers=True
    )


def built(frame: Frame) -> dict[str, float]:
    """The counters of what was built, by kind."""
    return {name[: -len("_built")]: n for name, n in frame.counters.items() if name.endswith("_built")}


def indirect(frame: Frame) -> Float32:
    """(h, w) irradiance, sum over the channels."""
    return frame.images["irradiance"][..., :3].sum(axis=2)


def scene_with_lamp_at(x: float) -> SceneSnapshot:
    lamp = Light("lamp", POINT, (40.0, 40.0, 40.0), (x, 1.0, 1.5))
    return replace(box_room(), lights=(lamp,))


@pytest.fixture
def own_device() -> Device:
    """A device that has kept nothing yet."""
    with Device() as opened:
        yield opened


def test_a_second_frame_builds_nothing(own_device: Device) -> None:
    room = box_room()
    lights = join([wall_lights(room), turning_lights(0.0)])
    first = own_device.render(room, lights, settings())
    assert built(first) == dict.fromkeys(TREES, 1)
    second = own_device.render(room, lights, settings())
    assert built(second) == dict.fromkeys(TREES, 0)
    assert (first.images["combined"] == second.images["combined"]).all()


def test_a_moved_camera_builds_no_tree(own_device: Device) -> None:
    room = box_room()
    lights = wall_lights(room)
    own_device.render(room, lights, settings())
    moved = replace(room, camera=camera_at((0.3, -2.0, 1.7), (1.2, 1.0, 0.8), lens=30.0))
    found = own_device.render(moved, lights, settings())
    assert built(found)["static_tree"] == 0
    exact = own_device.render(moved, lights, settings(lights="all"))
    assert indirect(found) == pytest.approx(indirect(exact), rel=0.06, abs=0.01 * indirect(exact).mean())


def test_a_moved_lamp_changes_only_what_clusters_send_out(own_device: Device) -> None:
    lights = wall_lights(box_room())
    own_device.render(scene_with_lamp_at(0.5), lights, settings())
    found = built(own_device.render(scene_with_lamp_at(0.6), lights, settings()))
    assert found == dict.fromkeys(TREES, 0) | {"window_factor": 1, "scale": 1, "static_clusters": 1}


def test_a_turned_mesh_builds_only_the_tree_of_what_moves(own_device: Device) -> None:
    room = box_room()
    own_device.render(room, join([wall_lights(room), turning_lights(0.0)]), settings())
    found = built(own_device.render(room, join([wall_lights(room), turning_lights(0.1)]), settings()))
    assert found == dict.fromkeys(TREES, 0) | {"dynamic_tree": 1, "window_factor": 1, "scale": 1, "dynamic_clusters": 1}


def test_a_grid_of_static_lights_is_kept_when_a_mesh_moves(own_device: Device) -> None:
    room = box_room()

    def frame(height: float) -> Frame:
        moving = quad((0.5, 0.5, height), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="moving")
        scene = replace(room, meshes=(*room.meshes, replace(moving, dynamic=True)))
        lights = turning_lights(height)
        return own_device.render(scene, join([wall_lights(room), lights]), settings(lights="range", grid=6))

    assert built(frame(0.3)) == {"static_grid": 1, "dynamic_grid": 1}
    # Beyond the grid of what stands still.
    assert built(frame(2.5)) == {"static_grid": 0, "dynamic_grid": 1}
    assert built(frame(2.5)) == {"static_grid": 0, "dynamic_grid": 0}


def test_other_tags_build_a_tree_but_no_grid(own_device: Device) -> None:
    room, lights = box_room(), wall_lights(box_room())
    tagged = replace(lights, tag_ids=np.arange(len(lights), dtype=np.int32) % 2)
    for mode, anew in (("range", 0), ("tolerance", 1)):
        kind = {"range": "static_grid", "tolerance": "static_tree"}[mode]
        assert built(own_device.render(room, lights, settings(lights=mode, grid=4)))[kind] == 1
        assert built(own_device.render(room, tagged, settings(lights=mode, grid=4)))[kind] == anew


def test_other_settings_build_another_grid(own_device: Device) -> None:
    room = box_room()
    lights = wall_lights(room, 2)
    for values in ({"grid": 5}, {"grid": 6}, {"grid": 6, "range": 2.0}, {"grid": 6, "range": 2.0, "max_lights": 3}):
        assert built(own_device.render(room, lights, settings(lights="range", **values)))["static_grid"] == 1


def test_a_frame_says_which_cells_overflow(device: Device) -> None:
    room = box_room()
    lights = join([wall_lights(room, 2), turning_lights(0.0)])
    frame = device.render(room, lights, settings(lights="range", grid=5, max_lights=3))
    grid = LightGrid.bake(lights, room.bounds(), GridSettings(mode="range", grid=5, max_lights=3))
    full = [part.occupancy for _, part in grid.structures]
    assert frame.counters["overflowing_cells"] == sum(len(part.overflowing_cells) for part in full) > 0
    assert frame.counters["dropped_entries"] == sum(part.dropped_entries for part in full) > 0
    assert frame.reasons == (f"light is missing: {grid.overflow}",)
    roomy = device.render(room, lights, settings(lights="range", grid=5))
    assert roomy.counters["overflowing_cells"] == roomy.counters["dropped_entries"] == 0
    assert roomy.reasons == ()


def test_few_lights_are_summed_and_the_frame_says_why(device: Device) -> None:
    room = box_room()
    few, many = wall_lights(room, 1), wall_lights(room)
    assert len(few) <= FEW_LIGHTS < len(many)
    frame = device.render(room, few, settings())
    assert frame.counters["evaluated_per_pixel"] == len(few)
    assert any(str(len(few)) in reason for reason in frame.reasons)
    exact = device.render(room, few, settings(lights="all"))
    assert (frame.images["combined"] == exact.images["combined"]).all()
    assert not exact.reasons
    assert not device.render(room, many, settings()).reasons


def lamp_frames(count: int) -> list[tuple[SceneSnapshot, VirtualLightMesh]]:
    lights = wall_lights(box_room())
    return [(scene_with_lamp_at(0.5 + 0.6 * i / count), lights) for i in range(count)]


def turning_frames(count: int) -> list[tuple[SceneSnapshot, VirtualLightMesh]]:
    room = box_room()
    still = wall_lights(room)
    return [(room, join([still, turning_lights(0.5 * np.pi * i / count)])) for i in range(count)]


def check_motion(device: Device, frames: list[tuple[SceneSnapshot, VirtualLightMesh]], tolerance: float) -> None:
    """Over frames: pictures change as the full sum's do, nothing static is built, memory does not grow."""
    before = None
    memory: list[int] = []
    for scene, lights in frames:
        frame = device.render(scene, lights, settings(tolerance=tolerance))
        exact = indirect(device.render(scene, lights, settings(lights="all")))
        error = (indirect(frame) - exact) / np.maximum(exact, 0.1 * exact.mean())
        if before is not None:
            assert built(frame)["static_tree"] == 0
            # What the error changes by from frame to frame is what pops.
            assert np.abs(error - before).max() <= tolerance
        before = error
        memory.append(resident_bytes())
    half = len(memory) // 2
    assert max(memory[half:]) <= max(memory[:half]) + 2_000_000


def resident_bytes() -> int:
    """Of this process; 0 where the system does not say."""
    try:
        with open("/proc/self/statm") as file:
            return PAGE * int(file.read().split()[1])
    except OSError:
        return 0


@pytest.mark.parametrize("frames", [lamp_frames, turning_frames], ids=["lamp", "turning mesh"])
def test_nothing_pops_while_something_moves(own_device: Device, frames: Callable) -> None:
    check_motion(own_device, frames(30), 0.02)


@pytest.mark.full
@pytest.mark.parametrize("frames", [lamp_frames, turning_frames], ids=["lamp", "turning mesh"])
def test_nothing_pops_over_a_thousand_frames(own_device: Device, frames: Callable) -> None:
    check_motion(own_device, frames(1000), 0.02)


@pytest.mark.parametrize("tolerance", [0.01, 0.02, 0.05, 0.1])
def test_a_picture_of_a_lit_room_keeps_the_tolerance(device: Device, tolerance: float) -> None:
    """A lamp, walls of several colours, and a glowing quad across the room; errors over pixels."""
    room = box_room()
    lights = join([wall_lights(room), turning_lights(0.4)])
    size = {"width": 96, "height": 72}
    found = indirect(device.render(room, lights, replace(settings(tolerance=tolerance), **size)))
    exact = indirect(device.render(room, lights, replace(settings(lights="all"), **size)))
    lit = exact > 0.0
    errors = np.abs(found - exact)[lit] / np.maximum(exact[lit], 0.1 * exact[lit].mean())
    assert np.quantile(errors, 0.95) <= tolerance
    assert np.quantile(errors, 0.999) <= 3.0 * tolerance


def test_lights_on_one_wall_alone_keep_the_tolerance(device: Device) -> None:
    """A light mesh that an artist draws for one red wall: its radiosity is far above the room's irradiance."""
    room = box_room()
    wall = [mesh for mesh in room.meshes if mesh.name == "left"]
    lights = wall_lights(replace(room, meshes=tuple(wall)), 5)
    size = {"width": 96, "height": 72}
    found = indirect(device.render(room, lights, replace(settings(), **size)))
    exact = indirect(device.render(room, lights, replace(settings(lights="all"), **size)))
    errors = np.abs(found - exact)[exact > 0.0] / np.maximum(exact, 0.1 * exact[exact > 0.0].mean())[exact > 0.0]
    assert np.quantile(errors, 0.95) <= 0.02
    assert np.quantile(errors, 0.999) <= 0.06


@pytest.mark.parametrize("lights", ["tolerance", "range"])
@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_neither_size_nor_place_of_the_world_shows(device: Device, factor: float, lights: str) -> None:
    """A room of 2 mm and one of 2 km, a thousand rooms away from the origin, lit as brightly."""
    offset = np.array([1000.0, -2000.0, 500.0])

    def moved(points: Float64) -> Float64:
        return factor * (points + offset)

    room = box_room()
    still = wall_lights(room)
    camera = room.camera
    assert camera is not None
    matrix = camera.matrix_world.copy()
    matrix[:3, 3] = moved(matrix[:3, 3])
    lamp = replace(
        room.lights[0],
        power=tuple(np.multiply(factor**2, room.lights[0].power)),
        position=tuple(moved(np.array(room.lights[0].position))),
    )
    far = replace(
        room,
        meshes=tuple(replace(mesh, positions=moved(mesh.positions)) for mesh in room.meshes),
        lights=(lamp,),
        camera=replace(camera, matrix_world=matrix, clip_start=factor * 0.1, clip_end=factor * 1000.0),
    )
    samples = replace(still.samples, positions=moved(still.samples.positions))
    far_lights = replace(still, vertices=moved(still.vertices), samples=samples)
    here = indirect(device.render(room, still, settings(lights="all" if lights == "tolerance" else lights, grid=5)))
    there = indirect(device.render(far, far_lights, settings(lights=lights, grid=5)))
    off = np.abs(there - here) / np.maximum(here, 0.1 * here.mean())
    # Lights and pixels may fall to the other side of a cell's face.
    assert np.quantile(off, 0.95) <= (1e-3 if lights == "range" else 0.02)


def floor_from_above() -> SceneSnapshot:
    """A strip of floor seen from above, one row of pixels of a flat surface."""
    strip = quad((0.0, 0.9, 0.0), (2.0, 0.0, 0.0), (0.0, 0.2, 0.0), name="floor")
    camera = camera_at((1.0, 1.0, 10.0), (1.0, 1.0, 0.0), kind="ORTHOGRAPHIC", ortho_scale=1.9)
    return SceneSnapshot("strip", (strip,), (Material("white", DIFFUSE, (0.8, 0.8, 0.8)),), camera=camera)


@pytest.mark.parametrize(("values", "seams"), [({}, False), ({"tolerance": 0.1}, False), ({"lights": "range"}, True)])
def test_no_seam_along_a_flat_floor(device: Device, values: dict[str, object], seams: bool) -> None:
    """Twice the pixels halve the greatest step between neighbours where light is continuous, and not at a jump.

    Nor is a step greater where one tile of pixels meets the next. Range mode shows its cells, so the test can fail.
    """
    scene, lights = floor_from_above(), wall_lights(box_room())
    glowing = replace(lights, emission=np.ones((len(lights), 3), np.float32))

    def steps(width: int) -> Float64:
        chosen = replace(settings(grid=8, **values), width=width, height=2)
        row = indirect(device.render(scene, glowing, chosen))[0].astype(float)
        assert row.max() > 0.0
        return np.abs(np.diff(row))

    fine, coarse = steps(3200), steps(1600)
    finer = coarse.max() / fine.max()
    if seams:
        assert finer < 1.2
        return
    assert finer > 1.6
    at_tiles = np.arange(len(fine)) % TILE_SIDE == TILE_SIDE - 1
    assert fine[at_tiles].max() <= 1.1 * fine[~at_tiles].max()
