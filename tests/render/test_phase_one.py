# SPDX-License-Identifier: GPL-3.0-or-later
"""Radiosity of virtual lights against the lamps' own closed forms, with occluders of known shadow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vlm_addon.core.lamps import lamp_irradiance, lamp_samples
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh, empty_light_mesh
from vlm_addon.core.scene import AREA, POINT, SPOT, SUN, Light, Material, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.lamp_shadows import LampShadows
from vlm_addon.render.lit_lights import radiosity_of
from vlm_addon.render.passes.phase_one import PhaseOnePass

POWER = (10.0, 20.0, 30.0)
COLOUR = np.array([0.5, 0.25, 2.0], np.float32)
EMISSION = np.array([1.0, 0.0, 3.0], np.float32)
STRENGTH = 1.5


def quad(corners: list[list[float]]) -> Mesh:
    """Two triangles, counter-clockwise."""
    positions = np.array(corners, float)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    normal = np.cross(positions[1] - positions[0], positions[2] - positions[0])
    return Mesh(
        name="quad",
        positions=positions,
        triangles=triangles,
        corner_normals=np.tile(normal / np.linalg.norm(normal), (2, 3, 1)).astype(np.float32),
        corner_uvs=np.zeros((2, 3, 2), np.float32),
        corner_colors=np.zeros((0, 3, 3), np.float32),
        material_indices=np.zeros(2, np.int32),
        tag_ids=np.zeros(2, np.int32),
        reflectance=np.full((2, 3), 0.5, np.float32),
        emission=np.zeros((2, 3), np.float32),
    )


FLOOR = quad([[-4, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]])
SHADE = quad([[0, -4, 1], [4, -4, 1], [4, 4, 1], [0, 4, 1]])
"""Covers x > 0 at height 1."""


def light_mesh(points: np.ndarray, offsets: list[int]) -> VirtualLightMesh:
    """Lights below the floor that measure at `points`, all weights of a light equal."""
    count = len(offsets) - 1
    sizes = np.diff(offsets)
    corners = np.array([[0, 0, -0.1], [1, 0, -0.1], [0, 1, -0.1]], float)
    samples = SourceSamples(
        positions=points,
        normals=np.tile([0.0, 0.0, 1.0], (len(points), 1)).astype(np.float32),
        weights=np.repeat(1.0 / sizes, sizes).astype(np.float32),
        offsets=np.array(offsets, np.int32),
    )
    return VirtualLightMesh(
        vertices=np.tile(corners, (count, 1)),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(count, 3),
        colour=np.tile(COLOUR, (count, 1)),
        emission=np.tile(EMISSION, (count, 1)),
        strength=np.full(count, STRENGTH, np.float32),
        tag_ids=np.zeros(count, np.int32),
        dynamic=np.zeros(count, bool),
        samples=samples,
    )


def radiosity(
    device: Device,
    meshes: list[Mesh],
    lights: list[Light],
    mesh: VirtualLightMesh,
    resolution: int = 512,
    shadow_samples: int = 16,
) -> np.ndarray:
    snapshot = SceneSnapshot("scene", meshes=tuple(meshes), materials=(Material("m"),), lights=tuple(lights))
    with device.current() as context:
        geometry = GpuGeometry(context, snapshot)
        shadows = LampShadows(context, device.shaders, geometry, lights, resolution)
        phase_one, lamps = PhaseOnePass(context, device.shaders), range(len(lights))
        return radiosity_of(mesh, phase_one.render(mesh, geometry.origin, shadows, lamps, shadow_samples))


def expected_radiosity(irradiance: np.ndarray) -> np.ndarray:
    return STRENGTH * (EMISSION + COLOUR * irradiance)


def random_points(count: int, low: float = -3.0, high: float = 3.0) -> np.ndarray:
    random = np.random.default_rng(4)
    return np.concatenate([random.uniform(low, high, (count, 2)), np.zeros((count, 1))], axis=1)


LAMPS = {
    "point": Light("l", POINT, POWER, (0.5, 0.25, 2.0)),
    "soft point": Light("l", POINT, POWER, (0.5, 0.25, 2.0), radius=0.3),
    "spot": Light("l", SPOT, POWER, (0.5, 0.25, 2.0), spot_angle=1.5, spot_blend=0.5),
    "wide spot": Light("l", SPOT, POWER, (0.5, 0.25, 2.0), spot_angle=3.0, spot_blend=1.0),
    "sun": Light("l", SUN, POWER, (0.0, 0.0, 0.0), z_axis=(0.6, 0.0, 0.8), x_axis=(0.8, 0.0, -0.6)),
    "soft sun": Light("l", SUN, POWER, (0.0, 0.0, 0.0), z_axis=(0.6, 0.0, 0.8), x_axis=(0.8, 0.0, -0.6), angle=0.3),
    "rectangle": Light("l", AREA, POWER, (0.5, 0.25, 2.0), size_x=1.0, size_y=0.5),
    "ellipse": Light("l", AREA, POWER, (0.5, 0.25, 2.0), size_x=1.0, size_y=0.5, shape="ELLIPSE"),
}


@pytest.mark.parametrize("name", list(LAMPS))
def test_unshadowed_floor_receives_the_lamp_in_full(device: Device, name: str) -> None:
    points = random_points(40)
    normals = np.tile([0.0, 0.0, 1.0], (40, 1))
    found = radiosity(device, [FLOOR], [LAMPS[name]], light_mesh(points, list(range(41))))
    expected = expected_radiosity(lamp_irradiance(LAMPS[name], points, normals))
    np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.mark.parametrize("name", ["point", "sun", "rectangle", "wide spot"])
def test_emission_alone_remains_in_full_shadow(device: Device, name: str) -> None:
    lid = quad([[-40, -40, 1], [40, -40, 1], [40, 40, 1], [-40, 40, 1]])
    points = random_points(20)
    found = radiosity(device, [FLOOR, lid], [LAMPS[name]], light_mesh(points, list(range(21))))
    np.testing.assert_allclose(found, np.tile(STRENGTH * EMISSION, (20, 1)), rtol=1e-6)


def test_lamp_that_casts_no_shadow_shines_through(device: Device) -> None:
    lid = quad([[-40, -40, 1], [40, -40, 1], [40, 40, 1], [-40, 40, 1]])
    lamp = replace(LAMPS["point"], casts_shadow=False)
    points = random_points(20)
    found = radiosity(device, [FLOOR, lid], [lamp], light_mesh(points, list(range(21))))
    normals = np.tile([0.0, 0.0, 1.0], (20, 1))
    np.testing.assert_allclose(found, expected_radiosity(lamp_irradiance(lamp, points, normals)), rtol=1e-4)


def test_half_shadowed_light_is_half_lit(device: Device) -> None:
    """A vertical sun over the shade: samples on both sides of x = 0."""
    sun = Light("l", SUN, POWER, (0.0, 0.0, 0.0))
    x = np.array([-1.5, -1.0, -0.5, -0.1, 0.1, 0.5, 1.0, 1.5])
    points = np.stack([x, np.zeros(8), np.zeros(8)], axis=1)
    found = radiosity(device, [FLOOR, SHADE], [sun], light_mesh(points, [0, 8]))
    np.testing.assert_allclose(found[0], expected_radiosity(0.5 * np.array(POWER)), rtol=1e-4)


@pytest.mark.parametrize("name", ["point", "spot", "sun"])
def test_edge_of_a_hard_shadow_is_where_the_ray_says(device: Device, name: str) -> None:
    lamp = LAMPS[name]
    points = random_points(300)
    drift = 0.6 / 0.8 if lamp.kind == SUN else (lamp.position[0] - points[:, 0]) / 2.0
    crossing = points[:, 0] + drift
    # The map's texels are some centimetres wide here.
    clear = np.abs(crossing) > 0.05
    points, crossing = points[clear], crossing[clear]
    found = radiosity(device, [FLOOR, SHADE], [lamp], light_mesh(points, list(range(len(points) + 1))))
    irradiance = lamp_irradiance(lamp, points, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
    expected = expected_radiosity(np.where(crossing[:, None] > 0.0, 0.0, irradiance))
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_penumbra_of_a_soft_point_lamp(device: Device) -> None:
    """Past an edge at x = 0, height 1: the share of the lamp whose rays pass it."""
    lamp = Light("l", POINT, POWER, (0.0, 0.0, 2.0), radius=0.5)
    points = np.stack([np.linspace(-0.7, 0.7, 15), np.zeros(15), np.zeros(15)], axis=1)
    found = radiosity(device, [FLOOR, SHADE], [lamp], light_mesh(points, list(range(16))), shadow_samples=256)
    # Brute force: points of the lamp's ball, each blocked where its ray passes x > 0 at height 1.
    positions = np.array([sample.position for sample in lamp_samples(lamp, 4000)])
    height = positions[None, :, 2]
    crossing = points[:, None, 0] + (positions[None, :, 0] - points[:, None, 0]) / height
    visible = (crossing <= 0.0).mean(axis=1)
    irradiance = lamp_irradiance(lamp, points, np.tile([0.0, 0.0, 1.0], (15, 1)))
    expected = expected_radiosity(visible[:, None] * irradiance)
    np.testing.assert_allclose(found, expected, atol=0.03 * expected.max())


def test_lamps_add_up(device: Device) -> None:
    points = random_points(10)
    mesh = light_mesh(points, list(range(11)))
    one, two = LAMPS["point"], LAMPS["sun"]
    both = radiosity(device, [FLOOR, SHADE], [one, two], mesh)
    apart = radiosity(device, [FLOOR, SHADE], [one], mesh) + radiosity(device, [FLOOR, SHADE], [two], mesh)
    np.testing.assert_allclose(both, apart - STRENGTH * EMISSION, rtol=1e-5)


@pytest.mark.parametrize("offset", [1e4, 1e6])
def test_scene_far_from_the_world_origin(device: Device, offset: float) -> None:
    points = random_points(30)
    lamp = LAMPS["point"]
    near = radiosity(device, [FLOOR, SHADE], [lamp], light_mesh(points, list(range(31))))
    moved = np.array([offset, -offset, offset])
    meshes = [replace(mesh, positions=mesh.positions + moved) for mesh in (FLOOR, SHADE)]
    far_lamp = replace(lamp, position=tuple(np.array(lamp.position) + moved))
    far = radiosity(device, meshes, [far_lamp], light_mesh(points + moved, list(range(31))))
    np.testing.assert_allclose(far, near, rtol=1e-4)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_scale_of_the_scene_changes_nothing(device: Device, scale: float) -> None:
    points = random_points(60)
    lamp = LAMPS["point"]
    normal_size = radiosity(device, [FLOOR, SHADE], [lamp], light_mesh(points, list(range(61))))
    meshes = [replace(mesh, positions=mesh.positions * scale) for mesh in (FLOOR, SHADE)]
    scaled_lamp = replace(
        lamp,
        position=tuple(np.array(lamp.position) * scale),
        power=tuple(np.array(lamp.power) * scale * scale),
    )
    scaled = radiosity(device, meshes, [scaled_lamp], light_mesh(points * scale, list(range(61))))
    np.testing.assert_allclose(scaled, normal_size, rtol=1e-4)


def test_no_lights_at_all(device: Device) -> None:
    assert radiosity(device, [FLOOR], [LAMPS["point"]], empty_light_mesh()).shape == (0, 3)


def test_no_lamps_leave_the_emission(device: Device) -> None:
    found = radiosity(device, [FLOOR], [], light_mesh(random_points(3), [0, 1, 2, 3]))
    np.testing.assert_allclose(found, np.tile(STRENGTH * EMISSION, (3, 1)), rtol=1e-6)


def test_very_bright_light_stays_finite(device: Device) -> None:
    lamp = replace(LAMPS["point"], power=(1e6, 1e6, 1e6), position=(0.0, 0.0, 1e-4))
    found = radiosity(device, [FLOOR], [lamp], light_mesh(np.zeros((1, 3)), [0, 1]))
    assert np.isfinite(found).all()


@pytest.mark.parametrize("name", list(LAMPS))
def test_a_million_watts_and_colours_of_a_million(device: Device, name: str) -> None:
    points = random_points(40)
    mesh = light_mesh(points, list(range(41)))
    dim = radiosity(device, [FLOOR, SHADE], [LAMPS[name]], replace(mesh, emission=0.0 * mesh.emission))
    bright_lamp = replace(LAMPS[name], power=tuple(1e6 * value for value in POWER))
    bright_mesh = replace(mesh, colour=1e6 * mesh.colour, emission=0.0 * mesh.emission)
    bright = radiosity(device, [FLOOR, SHADE], [bright_lamp], bright_mesh)
    assert np.isfinite(bright).all()
    np.testing.assert_allclose(bright, 1e12 * dim, rtol=1e-5)
