# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflections in reflective shadow maps against rays traced in float64 and light by core/lamps.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.render.closed_rooms import inward_box
from tests.render.mirror_rays import broken, broken_gbuffer, first_hits, upload
from tests.render.rooms import camera_at, quad
from vlm_addon.core.lamps import lamp_irradiance
from vlm_addon.core.scene import (
    AREA,
    DIFFUSE,
    ORTHOGRAPHIC,
    POINT,
    SPOT,
    SUN,
    Camera,
    Float32,
    Float64,
    Light,
    Material,
    Mesh,
    SceneSnapshot,
)
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.local_space import make_local_space
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.passes.map_reflection import MapReflectionPass, MapReflectionSettings
from vlm_addon.render.passes.rsm import LampReflections
from vlm_addon.render.view import make_view

SIZE = (64, 48)
MIRROR = 0
COLORS = ((0.7, 0.2, 0.2), (0.2, 0.6, 0.3), (0.5, 0.5, 0.4), (0.3, 0.4, 0.7), (0.8, 0.8, 0.8))
"""Of the walls at -x, +x, -y, +y and of the ceiling; the floor is the mirror."""
MATERIALS = (
    Material("mirror", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.0),
    *(Material(f"wall {i}", DIFFUSE, color) for i, color in enumerate(COLORS)),
)
LOW, HIGH = np.array([-2.0, -2.0, 0.0]), np.array([2.0, 2.0, 3.0])
WATTS = (40.0, 30.0, 20.0)
DOWN = {"x_axis": (1.0, 0.0, 0.0), "y_axis": (0.0, 0.6, 0.8), "z_axis": (0.0, -0.8, 0.6)}
"""A lamp that shines down and away from the camera."""
LAMPS = {
    "point": Light("l", POINT, WATTS, (0.3, 0.1, 2.0)),
    "point beside the room": Light("l", POINT, WATTS, (0.0, -9.0, 1.0)),
    "spot": Light("l", SPOT, WATTS, (0.0, -1.5, 2.5), spot_angle=2.2, spot_blend=0.0, **DOWN),  # type: ignore[arg-type]
    "sun": Light("l", SUN, (2.0, 1.5, 1.0), (0.0, 0.0, 0.0), **DOWN),  # type: ignore[arg-type]
}
BEHIND = camera_at((0.0, -1.9, 2.0), (0.0, 1.0, 0.0), lens=16.0)
"""Looks at the floor: the picture shows next to nothing of what it reflects."""


def room(
    lights: Sequence[Light], *meshes: Mesh, camera: Camera = BEHIND, open_sides: Sequence[int] = ()
) -> SceneSnapshot:
    walls = inward_box(LOW, HIGH, [1, 2, 3, 4, MIRROR, 5])
    kept = [wall for side, wall in enumerate(walls) if side not in open_sides]
    return SceneSnapshot("room", (*kept, *meshes), MATERIALS, lights=tuple(lights), camera=camera)


@dataclass(frozen=True)
class Found:
    """image: of the pass, row 0 at the top. mirror: mask of pixels. origins, directions: (n, 3) of their mirror rays in
    world space."""

    image: Float32
    mirror: np.ndarray
    origins: Float64
    directions: Float64


def reflected(
    device: Device, snapshot: SceneSnapshot, known: Float32 | None = None, area_maps: int = 4, **settings: float
) -> Found:
    assert snapshot.camera is not None
    space = make_local_space(snapshot)
    local = space.scene(snapshot)
    assert local.camera is not None
    with device.current() as context:
        maps = LampReflections(context, device.shaders, device.kept, snapshot, 128, area_maps)
        geometry = GpuGeometry(context, local, np.zeros(3))
        view = make_view(local.camera, *SIZE, geometry.origin)
        gbuffer = GBufferPass(context, device.shaders, *SIZE).render(geometry, view, 0)
        reflection = MapReflectionPass(context, device.shaders, *SIZE)
        chosen = MapReflectionSettings(**settings)  # type: ignore[arg-type]
        texture = None if known is None else upload(context, known)
        image = read_image(reflection.render(gbuffer, view, maps.maps(), space, chosen, 0, texture))  # type: ignore[arg-type]
        position, normal, ids = (read_image(t) for t in (gbuffer.position, gbuffer.shading_normal, gbuffer.ids))
    mirror = np.any(normal[..., :3] != 0.0, axis=2) & (ids[..., 0] == MIRROR)
    origins, normals = space.world_points(position[..., :3])[mirror], normal[..., :3][mirror].astype(float)
    matrix = snapshot.camera.matrix_world
    to_eye = matrix[:3, 3] - origins if not view.is_orthographic else np.tile(matrix[:3, 2], (len(origins), 1))
    to_eye /= np.linalg.norm(to_eye, axis=1, keepdims=True)
    directions = 2.0 * np.einsum("ij,ij->i", normals, to_eye)[:, None] * normals - to_eye
    return Found(image, mirror, origins, directions)


def expected(snapshot: SceneSnapshot, found: Found) -> tuple[Float64, Float64]:
    """(n, 3) radiance from the walls of `room` that mirror rays meet under its lamps, with hard shadows; and (n, 3) the
    places that they meet."""
    distance = first_hits(snapshot, found.origins, found.directions, 1e-4)
    met = found.origins + np.where(np.isfinite(distance), distance, 0.0)[:, None] * found.directions
    side, normals = _walls(met)
    radiance = np.zeros((len(met), 3))
    for light in snapshot.lights:
        lit = _lit(snapshot, light, met, normals)
        received = lamp_irradiance(light, met, normals) * lit[:, None]
        color = np.array([*COLORS[:4], (0.0, 0.0, 0.0), COLORS[4]])[side]
        radiance += color / np.pi * received
    return np.where(np.isfinite(distance)[:, None], radiance, 0.0), met


def _walls(points: Float64) -> tuple[np.ndarray, Float64]:
    """Index of the nearest wall, -x +x -y +y -z +z, and its inward normal."""
    gaps = np.stack([points - LOW, HIGH - points], axis=2).reshape(len(points), 6)
    side = np.abs(gaps).argmin(axis=1)
    normals = np.zeros((len(points), 3))
    normals[np.arange(len(points)), side // 2] = 1.0 - 2.0 * (side % 2)
    return side, normals


def _lit(snapshot: SceneSnapshot, light: Light, points: Float64, normals: Float64) -> np.ndarray:
    sun = light.kind == SUN
    to_lamp = np.tile(light.z_axis, (len(points), 1)) if sun else np.array(light.position) - points
    length = np.linalg.norm(to_lamp, axis=1)
    reach = np.full(len(points), np.inf) if sun else length
    blocked = first_hits(snapshot, points, to_lamp / length[:, None], 1e-4) < reach - 1e-4
    return ~blocked


@pytest.mark.parametrize("camera", ["perspective", "orthographic"])
@pytest.mark.parametrize("name", LAMPS)
def test_what_lamps_light_is_reflected_though_the_picture_does_not_show_it(
    device: Device, name: str, camera: str
) -> None:
    eye = BEHIND if camera == "perspective" else replace(BEHIND, kind=ORTHOGRAPHIC, ortho_scale=3.0)
    open_sides = {"point beside the room": [2], "sun": [2, 5]}.get(name, [])
    snapshot = room([LAMPS[name]], camera=eye, open_sides=open_sides)
    found = reflected(device, snapshot)
    radiance, _ = expected(snapshot, found)
    lit = radiance.max(axis=1) > 0.02 * radiance.max()
    assert lit.sum() > 200
    image = found.image[found.mirror]
    assert (image[lit, 3] > 0.99).mean() > 0.97
    error = np.abs(image[lit, :3] - radiance[lit]).max(axis=1) / radiance[lit].max(axis=1)
    assert np.median(error) < 0.03
    assert (error < 0.15).mean() > 0.95


def test_points_of_an_area_lamp_add_up_to_the_lamp(device: Device) -> None:
    lamp = Light("l", AREA, WATTS, (0.0, 0.0, 2.9), size_x=1.0, size_y=1.0)
    snapshot = room([lamp])
    found = reflected(device, snapshot, area_maps=16)
    radiance, met = expected(replace(snapshot, lights=(lamp,)), found)
    plain = (np.abs(met[:, 2] - 3.0) > 0.1) & (radiance.max(axis=1) > 0.05 * radiance.max())
    image = found.image[found.mirror]
    error = np.abs(image[plain, :3] - radiance[plain]).max(axis=1) / radiance[plain].max(axis=1)
    assert np.median(error) < 0.03
    assert (error < 0.15).mean() > 0.9


def test_lamps_add_up_where_both_light_a_place_and_their_order_does_not_matter(device: Device) -> None:
    lamps = [LAMPS["point"], replace(LAMPS["spot"], name="other")]
    alone = [reflected(device, room([lamp])).image for lamp in lamps]
    both, turned = (reflected(device, room(order)).image for order in (lamps, lamps[::-1]))
    sure = (alone[0][..., 3] > 0.99) & (alone[1][..., 3] > 0.99)
    assert sure.sum() > 300
    total = alone[0][..., :3] + alone[1][..., :3]
    close = np.isclose(both[sure][:, :3], total[sure], rtol=1e-4).all(axis=1)
    assert close.mean() > 0.98
    assert np.isclose(both, turned, rtol=1e-4, atol=1e-6).all(axis=2).mean() > 0.98


def test_the_nearest_of_two_maps_hits_counts(device: Device) -> None:
    """A board that one lamp lights stands before the wall that the other lights."""
    board = quad((-1.5, 1.0, 0.3), (3.0, 0.0, 0.0), (0.0, 0.0, 2.2), material=1, name="board")
    front = Light("front", SPOT, WATTS, (0.0, -1.5, 2.5), spot_angle=2.2, spot_blend=0.0, **DOWN)  # type: ignore[arg-type]
    back = Light("back", POINT, WATTS, (0.0, 1.5, 1.5))
    found = [reflected(device, room(lamps, board)) for lamps in ([front], [back], [front, back])]
    distance = first_hits(room([], board), found[0].origins, found[0].directions, 1e-4)
    met = found[0].origins + distance[:, None] * found[0].directions
    on_board = (np.abs(met[:, 1] - 1.0) < 1e-3) & (np.abs(met[:, 0]) < 1.4) & (met[:, 2] > 0.4) & (met[:, 2] < 2.4)
    assert on_board.sum() > 100
    images = [part.image[part.mirror][on_board] for part in found]
    assert (images[0][:, 3] > 0.99).mean() > 0.95
    np.testing.assert_allclose(images[2][:, :3], images[0][:, :3], rtol=0.02, atol=1e-5)


def test_what_is_known_already_is_left_out(device: Device) -> None:
    snapshot = room([LAMPS["point"]])
    known = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    known[..., 3] = np.linspace(0.0, 1.0, SIZE[0])
    whole, rest = reflected(device, snapshot).image, reflected(device, snapshot, known).image
    np.testing.assert_allclose(rest, whole * (1.0 - known[..., 3:]), rtol=1e-4, atol=1e-6)


def test_nothing_without_lamps_or_mirrors_or_beyond_the_reach(device: Device) -> None:
    assert not reflected(device, room([])).image.any()
    assert not reflected(device, room([replace(LAMPS["point"], power=(0.0, 0.0, 0.0))])).image.any()
    matt = room([LAMPS["point"]])
    matt = replace(matt, materials=(replace(MATERIALS[0], model=DIFFUSE), *MATERIALS[1:]))
    assert not reflected(device, matt).image.any()
    assert not reflected(device, room([LAMPS["point"]]), reach=1e-3).image.any()


def test_more_halvings_and_steps_find_the_same_places_better(device: Device) -> None:
    snapshot = room([LAMPS["spot"]])
    errors = []
    for steps, halvings in ((8, 0), (8, 6), (256, 6)):
        found = reflected(device, snapshot, steps=steps, halvings=halvings)
        radiance, _ = expected(snapshot, found)
        errors.append(np.abs(found.image[found.mirror][:, :3] - radiance).mean() / radiance.mean())
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] <= 1.05 * errors[1]
    assert errors[2] < 0.05


def test_the_same_input_gives_the_same_bits(device: Device) -> None:
    rough = room([LAMPS["point"], LAMPS["sun"]], open_sides=[5])
    rough = replace(rough, materials=(replace(MATERIALS[0], roughness=0.4), *MATERIALS[1:]))
    first, again = (reflected(device, rough).image for _ in range(2))
    assert (first == again).all()
    assert np.isfinite(first).all()
    assert (first >= 0.0).all()
    assert (first[..., 3] <= 1.0).all()
    assert first.any()


def test_whatever_the_buffers_hold_the_result_is_sound(device: Device) -> None:
    """Of the picture and of what is known; a map of each kind."""
    snapshot = room([LAMPS["point"], LAMPS["spot"], LAMPS["sun"]], open_sides=[5])
    found = reflected(device, snapshot)
    assert snapshot.camera is not None
    space = make_local_space(snapshot)
    position = np.zeros((SIZE[1], SIZE[0], 3))
    position[found.mirror] = space.local_points(found.origins)
    normal = np.tile([0.0, 0.0, 1.0], (SIZE[1], SIZE[0], 1))
    random = np.random.default_rng(3)
    with device.current() as context:
        maps = LampReflections(context, device.shaders, device.kept, snapshot, 64, 1)
        gbuffer = broken_gbuffer(context, position, normal, random)
        local = space.scene(snapshot)
        view = make_view(local.camera, *SIZE, np.zeros(3))  # type: ignore[arg-type]
        known = upload(context, broken(np.full((SIZE[1], SIZE[0], 4), 0.3), random))
        reflection = MapReflectionPass(context, device.shaders, *SIZE)
        settings = MapReflectionSettings()
        image = read_image(reflection.render(gbuffer, view, maps.maps(), space, settings, 0, known))  # type: ignore[arg-type]
    assert np.isfinite(image).all()
    assert (image >= 0.0).all()
    assert (image[..., 3] <= 1.0).all()
    assert image.any()
