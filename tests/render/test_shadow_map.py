# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow maps where they are known to fail: acne, leaks through thin walls, shadows that come off their casters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vlm_addon.core.lamps import lamp_irradiance
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh
from vlm_addon.core.scene import AREA, POINT, SPOT, SUN, Float64, Light, Material, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.kept import Kept
from vlm_addon.render.lamp_shadows import LampShadows, StillLamps
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes.phase_one import PhaseOnePass
from vlm_addon.render.passes.shadow_map import ShadowMapPass
from vlm_addon.render.shadow_casters import ShadowCasters
from vlm_addon.render.shadow_views import shadow_kind

RESOLUTION = 512
SCALES = [1e-3, 1.0, 1e3]
LAMPS = {
    "point": Light("l", POINT, (10.0, 10.0, 10.0), (0.3, 0.2, 2.0)),
    "spot": Light("l", SPOT, (10.0, 10.0, 10.0), (0.3, 0.2, 2.0), spot_angle=1.9, spot_blend=0.1),
    "wide spot": Light("l", SPOT, (10.0, 10.0, 10.0), (0.3, 0.2, 2.0), spot_angle=3.0, spot_blend=0.1),
    "sun": Light("l", SUN, (10.0, 10.0, 10.0), (0.0, 0.0, 0.0), (0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8)),
    "area": Light("l", AREA, (10.0, 10.0, 10.0), (0.3, 0.2, 2.0), size_x=0.2, size_y=0.2),
}


def mesh(quads: list[list[list[float]]], scale: float = 1.0, material: int = 0) -> Mesh:
    """Quads of four corners each, counter-clockwise."""
    corners = scale * np.array(quads, float)
    count = len(corners)
    triangles = (np.array([[0, 1, 2], [0, 2, 3]])[None] + 4 * np.arange(count)[:, None, None]).reshape(-1, 3)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(
        name="quads",
        positions=corners.reshape(-1, 3),
        triangles=triangles.astype(np.int32),
        corner_normals=np.repeat(normals, 6, axis=0).reshape(-1, 3, 3).astype(np.float32),
        corner_uvs=np.zeros((2 * count, 3, 2), np.float32),
        corner_colors=np.zeros((0, 3, 3), np.float32),
        material_indices=np.full(2 * count, material, np.int32),
        tag_ids=np.zeros(2 * count, np.int32),
        reflectance=np.full((2 * count, 3), 0.5, np.float32),
        emission=np.zeros((2 * count, 3), np.float32),
    )


def box(low: list[float], high: list[float]) -> list[list[list[float]]]:
    """The six faces of a box, facing outwards."""
    (a, b, c), (d, e, f) = low, high
    return [
        [[a, b, c], [a, e, c], [d, e, c], [d, b, c]],
        [[a, b, f], [d, b, f], [d, e, f], [a, e, f]],
        [[a, b, c], [d, b, c], [d, b, f], [a, b, f]],
        [[a, e, c], [a, e, f], [d, e, f], [d, e, c]],
        [[a, b, c], [a, b, f], [a, e, f], [a, e, c]],
        [[d, b, c], [d, e, c], [d, e, f], [d, b, f]],
    ]


FLOOR = [[[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]]]


def scaled(light: Light, scale: float) -> Light:
    """The lamp in a scene of another size, as bright there."""
    factor = 1.0 if light.kind == SUN else scale * scale
    return replace(
        light,
        position=tuple(scale * value for value in light.position),
        power=tuple(factor * value for value in light.power),
        size_x=light.size_x * scale,
        size_y=light.size_y * scale,
    )


def probes(points: Float64, normals: Float64) -> VirtualLightMesh:
    """Virtual lights that reflect everything and measure at one point each."""
    count = len(points)
    samples = SourceSamples(
        positions=points,
        normals=np.asarray(normals, np.float32),
        weights=np.ones(count, np.float32),
        offsets=np.arange(count + 1, dtype=np.int32),
    )
    return VirtualLightMesh(
        vertices=np.zeros((3, 3)),
        triangles=np.tile(np.arange(3, dtype=np.int32), (count, 1)),
        colour=np.ones((count, 3), np.float32),
        emission=np.zeros((count, 3), np.float32),
        strength=np.ones(count, np.float32),
        tag_ids=np.zeros(count, np.int32),
        dynamic=np.zeros(count, bool),
        samples=samples,
    )


def lit(
    device: Device,
    meshes: list[Mesh],
    light: Light,
    points: Float64,
    normals: Float64,
    alpha: float = 1.0,
    eye: LocalSpace | None = None,
) -> Float64:
    """Share of the unshadowed light that arrives at each point. eye: space of the points, where the map is kept in one
    of its own."""
    materials = (Material("opaque"), Material("veil", alpha=alpha))
    snapshot = SceneSnapshot("scene", meshes=tuple(meshes), materials=materials, lights=(light,))
    with device.current() as context:
        geometry = GpuGeometry(context, snapshot)
        shadows, asked, origin = None, points, geometry.origin
        if eye is not None:
            kept, asked, origin = Kept(), eye.local_points(points), np.zeros(3)
            local = eye.scene(snapshot)
            geometry = GpuGeometry(context, local, origin)
            still = StillLamps(ShadowCasters(context, kept, snapshot), kept, snapshot.lights, eye)
            shadows = LampShadows(context, device.shaders, geometry, local.lights, RESOLUTION, still)
        shadows = shadows or LampShadows(context, device.shaders, geometry, snapshot.lights, RESOLUTION)
        phase_one = PhaseOnePass(context, device.shaders)
        found = phase_one.render(probes(asked, normals), origin, shadows, [0], 16)[:, 0]
    full = lamp_irradiance(light, points, normals)[:, 0]
    assert (full > 0.0).all()
    return found / full


def up(count: int) -> Float64:
    return np.tile([0.0, 0.0, 1.0], (count, 1))


def floor_points(count: int, reach: float) -> Float64:
    random = np.random.default_rng(8)
    return np.concatenate([random.uniform(-reach, reach, (count, 2)), np.zeros((count, 1))], axis=1)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("name", list(LAMPS))
def test_plane_does_not_shadow_itself(device: Device, name: str, scale: float) -> None:
    reach = 1.2 if name == "spot" else 2.8
    points = scale * floor_points(2000, reach)
    share = lit(device, [mesh(FLOOR, scale)], scaled(LAMPS[name], scale), points, up(2000))
    np.testing.assert_allclose(share, 1.0, rtol=1e-3)


@pytest.mark.parametrize("height", [1.0, 0.1, 0.01])
def test_plane_under_grazing_light_does_not_shadow_itself(device: Device, height: float) -> None:
    light = replace(LAMPS["point"], position=(0.0, 0.0, height))
    points = floor_points(2000, 2.8)
    np.testing.assert_allclose(lit(device, [mesh(FLOOR)], light, points, up(2000)), 1.0, rtol=1e-3)


@pytest.mark.parametrize("scale", SCALES)
def test_sphere_does_not_shadow_its_lit_side(device: Device, scale: float) -> None:
    """Smooth normals on facets: away from the terminator nothing is in shadow."""
    rings, columns = 48, 96
    theta, phi = np.linspace(0.01, np.pi - 0.01, rings + 1), np.linspace(0.0, 2.0 * np.pi, columns + 1)
    grid = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(np.cos(theta), np.ones_like(phi)),
        ],
        axis=-1,
    )
    quads = [
        [grid[i, j], grid[i + 1, j], grid[i + 1, j + 1], grid[i, j + 1]] for i in range(rings) for j in range(columns)
    ]
    sphere = mesh(np.array(quads).tolist(), scale)
    corners = sphere.positions[sphere.triangles]
    centroids = corners.mean(axis=1)
    normals = centroids / np.linalg.norm(centroids, axis=1, keepdims=True)
    light = scaled(replace(LAMPS["point"], position=(0.0, 0.0, 3.0)), scale)
    to_lamp = np.array(light.position) - centroids
    clear = (normals * to_lamp).sum(-1) / np.linalg.norm(to_lamp, axis=1) > 0.1
    share = lit(device, [sphere], light, centroids[clear], normals[clear])
    np.testing.assert_allclose(share, 1.0, rtol=1e-3)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("name", ["point", "sun", "wide spot"])
def test_closed_box_of_thin_walls_is_dark_inside(device: Device, name: str, scale: float) -> None:
    """Sides and floor of no thickness; points up to the very edges, apart from one texel of the map."""
    walls = box([-1.0, -1.0, 0.0], [1.0, 1.0, 1.0])
    texel = 2.0 * 3.0 / RESOLUTION
    reach = 1.0 - 2.0 * texel
    points = np.concatenate(
        [floor_points(3000, reach), [[s * reach, t * reach, 0.0] for s in (-1, 1) for t in (-1, 1)]]
    )
    share = lit(device, [mesh(FLOOR + walls, scale)], scaled(LAMPS[name], scale), scale * points, up(len(points)))
    assert share.max() == 0.0


@pytest.mark.parametrize("scale", SCALES)
def test_shadow_begins_at_the_foot_of_a_thin_wall(device: Device, scale: float) -> None:
    """Low sun from +x on a wall at x = 0: dark from two texels behind it, lit from two texels before it."""
    wall = [[[0.0, -2.0, 0.0], [0.0, 2.0, 0.0], [0.0, 2.0, 1.0], [0.0, -2.0, 1.0]]]
    light = LAMPS["sun"]
    texel = 2.0 * 5.0 / (2 * RESOLUTION)
    behind = np.linspace(-0.7, -2.0 * texel, 200)
    before = np.linspace(2.0 * texel, 1.0, 200)
    points = np.concatenate([[[x, 0.1, 0.0] for x in np.concatenate([behind, before])]])
    share = lit(device, [mesh(FLOOR + wall, scale)], light, scale * points, up(400))
    np.testing.assert_allclose(share[:200], 0.0, atol=1e-6)
    np.testing.assert_allclose(share[200:], 1.0, rtol=1e-3)


def test_edges_of_a_thin_walled_room_let_no_sun_in(device: Device) -> None:
    """A room open to -y; the back wall lies in the shade of ceiling and side wall, up to where they meet."""
    walls = [quad[::-1] for i, quad in enumerate(box([-2.0, 0.0, 0.0], [2.0, 4.0, 3.0])) if i != 2]
    z_axis = np.array([0.5, -1.0, 0.6]) / np.linalg.norm([0.5, -1.0, 0.6])
    x_axis = np.cross([0.0, 0.0, 1.0], z_axis) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], z_axis))
    y_axis = np.cross(z_axis, x_axis)
    light = replace(LAMPS["sun"], x_axis=tuple(x_axis), y_axis=tuple(y_axis), z_axis=tuple(z_axis))
    random = np.random.default_rng(12)
    texel = 2.0 * 2.9 / (2 * RESOLUTION)
    inset, along = random.uniform(0.0, 3.0 * texel, 5000), random.random(5000)
    full = np.full(5000, 4.0)
    under_ceiling = np.stack([3.6 * along - 1.8, full, 3.0 - inset], axis=1)
    beside_wall = np.stack([2.0 - inset, full, 2.5 * along + 0.3], axis=1)
    for points in (under_ceiling, beside_wall):
        share = lit(device, [mesh(walls)], light, points, np.tile([0.0, -1.0, 0.0], (5000, 1)))
        assert share[inset > 1.5 * texel].max() == 0.0
        assert share.mean() < 0.02


@pytest.mark.parametrize("name", ["point", "sun"])
def test_inner_corner_of_a_room_stays_lit(device: Device, name: str) -> None:
    """Floor points close to a wall that the lamp also lights: not darkened beyond a texel from the wall."""
    wall = [[[-1.0, 3.0, 0.0], [-1.0, -3.0, 0.0], [-1.0, -3.0, 2.0], [-1.0, 3.0, 2.0]]]
    texel = 2.0 * 3.0 / RESOLUTION
    points = np.array([[x, 0.0, 0.0] for x in np.linspace(-1.0 + 1.5 * texel, -0.5, 100)])
    share = lit(device, [mesh(FLOOR + wall)], LAMPS[name], points, up(100))
    np.testing.assert_allclose(share, 1.0, rtol=1e-3)


@pytest.mark.parametrize("name", ["point", "area", "sun"])
def test_veil_of_half_alpha_lets_half_of_the_light_through(device: Device, name: str) -> None:
    veil = mesh([[[-3, -3, 1], [3, -3, 1], [3, 3, 1], [-3, 3, 1]]], material=1)
    points = floor_points(400, 0.3)
    share = lit(device, [mesh(FLOOR), veil], LAMPS[name], points, up(400), alpha=0.5)
    assert share.mean() == pytest.approx(0.5, abs=0.02)


def test_sides_of_a_cube_map_meet_without_a_seam(device: Device) -> None:
    """Walls all around the lamp, points on the diagonals where the faces of its map meet."""
    walls = [quad[::-1] for quad in box([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0])]
    light = replace(LAMPS["point"], position=(0.0, 0.0, 0.0))
    along = np.linspace(-0.95, 0.95, 400)
    points = np.stack([along, along, np.full(400, -1.0)], axis=1)
    np.testing.assert_allclose(lit(device, [mesh(walls)], light, points, up(400)), 1.0, rtol=1e-3)


def test_resolution_beyond_the_device_is_cut_to_it(device: Device) -> None:
    with device.current() as context:
        shadows = ShadowMapPass(context, device.shaders, 10**6)
        for light in LAMPS.values():
            assert max(shadows.size(light)) <= context.info["GL_MAX_TEXTURE_SIZE"]


def test_kinds_of_maps() -> None:
    kinds = {name: shadow_kind(light) for name, light in LAMPS.items()}
    assert kinds == {
        "point": "SHADOW_CUBE",
        "spot": "SHADOW_CONE",
        "wide spot": "SHADOW_CUBE",
        "sun": "SHADOW_PARALLEL",
        "area": "SHADOW_CUBE",
    }
