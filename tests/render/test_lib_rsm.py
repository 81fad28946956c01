# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/rsm.glsl`: pieces of maps, places in them, and discs on the sphere, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core import brdf
from vlm_addon.core.scene import DIFFUSE, PRINCIPLED, Float64
from vlm_addon.render.albedo_texture import AlbedoTexture
from vlm_addon.render.device import Device
from vlm_addon.render.gpu_layout import CONSTANTS
from vlm_addon.render.shadow_views import CUBE_FACES, CUBE_TILES

FILE = "lib/rsm.glsl"
AXES = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
LAMP = """
Lamp made(int kind, vec3 x, vec3 y, vec3 z, vec3 origin, vec2 extent, vec2 centre) {
    Lamp lamp;
    lamp.shadow_kind = kind;
    lamp.x_axis = x;
    lamp.y_axis = y;
    lamp.z_axis = z;
    lamp.shadow_origin = origin;
    lamp.shadow_extent = extent;
    lamp.shadow_centre = centre;
    return lamp;
}
"""
MADE = "made(kind, x, y, z, origin, extent, centre)"
ORIGIN, EXTENT, CENTRE = np.array([1.0, -2.0, 3.0]), np.array([0.5, 1.5]), np.array([0.2, -0.1])


def lamp_inputs(kind: str, count: int) -> dict[str, np.ndarray]:
    values = {"x": AXES[0], "y": AXES[1], "z": AXES[2], "origin": ORIGIN, "extent": EXTENT, "centre": CENTRE}
    rows = {name: np.tile(value, (count, 1)) for name, value in values.items()}
    return rows | {"kind": np.full(count, CONSTANTS[kind], np.int32)}


def unit(vectors: Float64) -> Float64:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def test_pieces_of_a_cubes_face_sum_to_a_sixth_of_the_sphere(device: Device) -> None:
    side = 64
    step = 2.0 / side
    places = (np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2) + 0.5) * step - 1.0
    sizes = np.full_like(places, step)
    found = evaluate(device, FILE, "piece_solid_angle(place, size)", {"place": places, "size": sizes})
    assert found.astype(float).sum() == pytest.approx(4.0 * np.pi / 6.0, rel=1e-3)
    cosine = 1.0 / np.sqrt(1.0 + (places**2).sum(axis=1))
    np.testing.assert_allclose(found, step**2 * cosine**3, rtol=1e-5)


@pytest.mark.parametrize("model", [DIFFUSE, PRINCIPLED])
def test_diffuse_reflectance_is_that_of_core(device: Device, model: str) -> None:
    random = np.random.default_rng(5)
    count = 300
    inputs = {
        "color": random.random((count, 3)),
        "metallic": random.random(count),
        "ior": random.uniform(1.0, 2.5, count),
        "level": random.random(count),
        "roughness": random.random(count),
    }
    inputs = {name: values.astype(np.float32) for name, values in inputs.items()}
    surface = (
        "Surface(vec3(0.0), 1.0, vec3(0.0), vec3(0.0), color, vec3(0.0), roughness, metallic, level, ior, 0, 0, 0, "
        f"MODEL_{model})"
    )
    preamble = "layout(binding = ALBEDO_TABLE_UNIT) uniform sampler3D albedo_table;"
    with device.current() as context:
        AlbedoTexture(context).bind()
        found = evaluate(device, FILE, f"diffuse_reflectance({surface}, albedo_table)", inputs, 3, preamble)
    # The table is read with 8 bits between its entries.
    np.testing.assert_allclose(found, brdf.diffuse_reflectance(*inputs.values(), model), atol=2e-3)


def test_place_in_a_parallel_map(device: Device) -> None:
    random = np.random.default_rng(2)
    uv = random.uniform(-0.4, 1.4, (200, 2))
    plane = (2.0 * uv - 1.0) * EXTENT + CENTRE
    points = ORIGIN + np.concatenate([plane, random.normal(size=(200, 1))], axis=1) @ AXES
    inputs = lamp_inputs("SHADOW_PARALLEL", 200) | {"p": points}
    found = evaluate(device, FILE, f"map_place({MADE}, p)", inputs, 2, LAMP)
    np.testing.assert_allclose(found, np.clip(uv, 0.0, 1.0), atol=3e-6)


def test_place_in_a_cones_map_and_beside_and_behind_it(device: Device) -> None:
    random = np.random.default_rng(3)
    uv = random.uniform(-0.4, 1.4, (200, 2))
    plane = (2.0 * uv - 1.0) * EXTENT + CENTRE
    depth = random.uniform(0.1, 5.0, (200, 1))
    points = ORIGIN + np.concatenate([plane * depth, -depth], axis=1) @ AXES
    inputs = lamp_inputs("SHADOW_CONE", 200) | {"p": points}
    found = evaluate(device, FILE, f"map_place({MADE}, p)", inputs, 2, LAMP)
    np.testing.assert_allclose(found, np.clip(uv, 0.0, 1.0), atol=2e-5)
    behind = ORIGIN + np.array([[1.0, -0.5, 2.0], [-3.0, 2.0, 1e-9], [0.0, 0.0, 1.0]]) @ AXES
    found = evaluate(device, FILE, f"map_place({MADE}, p)", lamp_inputs("SHADOW_CONE", 3) | {"p": behind}, 2, LAMP)
    assert found[:2].tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert np.isfinite(found).all()


def test_covering_radius_reaches_the_farthest_corner_and_no_further(device: Device) -> None:
    places = np.concatenate([np.random.default_rng(4).random((200, 2)), [[0.0, 0.0], [0.5, 0.5], [1.0, 0.0]]])
    places = places.astype(np.float32)
    found = evaluate(device, FILE, "covering_radius(place)", {"place": places})
    corners = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
    farthest = np.linalg.norm(places[:, None] - corners, axis=2).max(axis=1)
    np.testing.assert_allclose(found, farthest, rtol=1e-6)


@pytest.mark.parametrize("axis", [*np.eye(3), *-np.eye(3), unit(np.array([0.3, -0.8, -0.5]))], ids=str)
def test_disc_on_the_sphere_is_equal_in_area_and_turns_about_its_axis(device: Device, axis: Float64) -> None:
    """Lambert's projection: the part of the sphere within angle t fills sin²(t / 2) of the disc."""
    index = np.arange(20_000) + 0.5
    radius, angle = np.sqrt(index / len(index)), np.pi * (3.0 - np.sqrt(5.0)) * index
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    inputs = {"axis": np.tile(axis, (len(disc), 1)), "disc": disc}
    found = evaluate(device, FILE, "sphere_direction(frame_of(axis), disc)", inputs, 3).astype(float)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=3e-6)
    np.testing.assert_allclose(found @ axis, 1.0 - 2.0 * radius**2, atol=3e-6)
    np.testing.assert_allclose(found.mean(axis=0), 0.0, atol=2e-3)
    np.testing.assert_allclose(found.T @ found / len(found), np.eye(3) / 3.0, atol=2e-3)


def test_texel_of_a_cube_is_the_one_whose_middle_is_nearest_in_its_face(device: Device) -> None:
    side = 16
    directions = unit(np.random.default_rng(7).normal(size=(3000, 3)))
    expression = f"vec2(cube_texel(direction, {side}))"
    found = evaluate(device, FILE, expression, {"direction": directions}, 2).astype(int)
    local = directions
    axis = np.abs(local).argmax(axis=1)
    rows = np.arange(len(local))
    forward = np.abs(local[rows, axis])
    face = np.array([CUBE_FACES.index((a, 1.0 if local[i, a] > 0.0 else -1.0)) for i, a in enumerate(axis)])
    uv = np.stack([local[rows, (axis + 1) % 3], local[rows, (axis + 2) % 3]], axis=1) / forward[:, None] * 0.5 + 0.5
    tile = np.stack([face % CUBE_TILES[0], face // CUBE_TILES[0]], axis=1)
    clear = (np.abs(uv * side - np.round(uv * side)) > 1e-3).all(axis=1) & (
        np.sort(np.abs(local), axis=1)[:, 1] < forward - 1e-5
    )
    np.testing.assert_array_equal(found[clear], (tile * side + np.floor(uv * side).astype(int))[clear])
    assert clear.sum() > 2900
    within = found - tile * side
    assert ((within >= 0) & (within < side))[clear].all()


def test_the_back_is_told_from_the_front_beside_any_model(device: Device) -> None:
    for model in (0, 1):
        for bit, back in ((0, 0.0), (256, 1.0)):
            ids = {"w": np.array([model | bit], np.int32)}
            assert evaluate(device, FILE, "seen_from_back(ivec4(0, 0, 0, w)) ? 1.0 : 0.0", ids).tolist() == [back]
            unpacked = "unpack_surface(vec4(0), vec4(0), vec4(0), vec4(0), vec4(0), ivec4(0, 0, 0, w)).model"
            assert evaluate(device, FILE, f"float({unpacked})", ids).tolist() == [model]
