# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/ltc.glsl` against core/ltc.py, the form factor of core and brute force, in float64."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core import brdf, ltc
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.core.scene import Float64
from vlm_addon.render.device import Device
from vlm_addon.render.ltc_texture import LtcTexture
from vlm_addon.render.passes.light_mesh_reflection import LTC_DEFINES

TABLE_UNIT = 3
FILES = ("lib/ltc.glsl",)
DEFINES: Mapping[str, Any] = LTC_DEFINES
PREAMBLE = f"layout(binding = {TABLE_UNIT}) uniform sampler2D ltc_table;"
LOBE = "make_ltc_lobe(lookup_ltc(ltc_table, alpha, dot(n, v)), alpha, 1.0, n, v)"
# A dielectric beside a white metal, without gains.
REFLECTOR = "Reflector(vec3(0.0), vec3(0.9, 0.5, 0.1), vec3(0.4), 0.6, 1.5, alpha)"
COUNT = 400
LEAST_LOBE = 2e-4


def unit(vectors: Float64) -> Float64:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def case(seed: int, lowest: float = 0.05) -> dict[str, np.ndarray]:
    """Surfaces seen from 3 degrees over the horizon on, of all roughness from 0.1 on, and directions above them."""
    random = np.random.default_rng(seed)
    normal = unit(random.normal(size=(COUNT, 3)))
    height = random.uniform(lowest, 1.0, (COUNT, 1))
    across = unit(np.cross(normal, random.normal(size=(COUNT, 3))))
    light = unit(normal + 0.95 * unit(random.normal(size=(COUNT, 3))))
    values = {
        "n": normal,
        "v": height * normal + np.sqrt(1.0 - height * height) * across,
        "l": light,
        "alpha": random.uniform(0.1, 1.0, COUNT) ** 2,
    }
    return {name: np.asarray(value, np.float32) for name, value in values.items()}


def call(
    device: Device, expression: str, inputs: dict[str, np.ndarray], components: int = 1, functions: str = ""
) -> np.ndarray:
    with device.current() as context:
        LtcTexture(context).bind(TABLE_UNIT)
        return evaluate(device, FILES, expression, inputs, components, PREAMBLE + functions, DEFINES)


def frames(inputs: dict[str, np.ndarray]) -> tuple[Float64, Float64, Float64]:
    """Rows of the surfaces' frames (n, 3, 3), maps to their lobes (n, 3, 3), and cosines of the eye, in float64."""
    normal, eye = unit(inputs["n"].astype(float)), unit(inputs["v"].astype(float))
    cosine = (normal * eye).sum(-1)
    side = unit(eye - cosine[:, None] * normal)
    frame = np.stack([side, np.cross(normal, side), normal], axis=1)
    alpha = inputs["alpha"].astype(float)
    to_lobe = ltc.lobe_map(ltc.lookup_ltc(np.sqrt(alpha), cosine), alpha, cosine)
    return frame, np.asarray(to_lobe @ frame), cosine


def test_the_table_is_looked_up_as_core_does(device: Device) -> None:
    inputs = case(1, 0.006)
    _, _, cosine = frames(inputs)
    expected = ltc.lookup_ltc(np.sqrt(inputs["alpha"].astype(float)), cosine)
    # The texture unit interpolates with 8 fractional bits.
    found = call(device, "lookup_ltc(ltc_table, alpha, dot(n, v))", inputs, 4)
    np.testing.assert_allclose(found, expected, atol=4e-3)


def test_directions_and_planes_are_mapped_as_core_does(device: Device) -> None:
    inputs = case(2)
    _, to_lobe, _ = frames(inputs)
    directions = inputs["l"].astype(float)
    mapped = np.einsum("nij,nj->ni", to_lobe, directions)
    size = np.linalg.norm(mapped, axis=1, keepdims=True)
    np.testing.assert_allclose(call(device, f"to_lobe({LOBE}, l)", inputs, 3) / size, mapped / size, atol=5e-3)
    cofactors = np.linalg.det(to_lobe)[:, None, None] * np.linalg.inv(to_lobe).transpose(0, 2, 1)
    area = np.einsum("nij,nj->ni", cofactors, directions)
    size = np.linalg.norm(area, axis=1, keepdims=True)
    np.testing.assert_allclose(call(device, f"area_to_lobe({LOBE}, l)", inputs, 3) / size, area / size, atol=8e-3)


def test_directions_come_back(device: Device) -> None:
    inputs = case(3)
    found = call(device, f"from_lobe({LOBE}, 7.0 * to_lobe({LOBE}, l))", inputs, 3)
    np.testing.assert_allclose(found, unit(inputs["l"].astype(float)), atol=2e-5)


def test_the_fitted_lobe_is_cores(device: Device) -> None:
    inputs = case(4)
    _, to_lobe, _ = frames(inputs)
    frame, _, _ = frames(inputs)
    local = np.einsum("nij,nj->ni", frame, unit(inputs["l"].astype(float)))
    expected = ltc.lobe_density(to_lobe @ np.linalg.inv(frame), local)
    found = call(device, f"fitted_lobe({LOBE}, l)", inputs)
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=1e-3)


def test_eyes_along_the_normal_see_a_round_lobe(device: Device) -> None:
    inputs = case(5)
    inputs["v"] = inputs["n"]
    found = call(device, f"vec3({LOBE}.inverse_widths * alpha, dot({LOBE}.z_axis, n))", inputs, 3)
    np.testing.assert_allclose(found[:, 0], found[:, 1], rtol=1e-5)
    np.testing.assert_allclose(found[:, 2], 1.0, atol=1e-6)


def test_an_edge_gives_its_share_in_every_direction(device: Device) -> None:
    random = np.random.default_rng(6)
    a, b, n = (random.normal(size=(COUNT, 3)).astype(np.float32) for _ in range(3))
    inputs = {"a": a, "b": b, "m": unit(n).astype(np.float32)}
    whole = call(device, "dot(edge_vector(a, b, length(a), length(b), dot(a, b)), m)", inputs)
    np.testing.assert_allclose(whole, call(device, "edge_irradiance(a, b, m)", inputs), rtol=1e-4, atol=1e-5)


def triangles(inputs: dict[str, np.ndarray], seed: int, size: float, is_above: bool) -> dict[str, np.ndarray]:
    """`inputs` with corners a, b, c of triangles about the directions l that face the point, and area vectors."""
    random = np.random.default_rng(seed)
    corners = inputs["l"].astype(float)[:, None] + random.normal(0.0, size, (COUNT, 3, 3))
    if is_above:
        heights = np.einsum("nkj,nj->nk", corners, inputs["n"].astype(float))
        corners += np.maximum(0.02 - heights.min(axis=1), 0.0)[:, None, None] * inputs["n"][:, None]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    away = (area * corners[:, 0]).sum(-1) > 0.0
    corners[away] = corners[away][:, [0, 2, 1]]
    corners = corners.astype(np.float32)
    wide = corners.astype(float)
    area = 0.5 * np.cross(wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0]).astype(np.float32)
    return inputs | {name: corners[:, k] for k, name in enumerate("abc")} | {"area": area.astype(np.float32)}


def mapped_share(inputs: dict[str, np.ndarray]) -> Float64:
    """Form factors of the mapped triangles, clipped at the lobe's horizon alone."""
    _, to_lobe, _ = frames(inputs)
    corners = np.stack([inputs[name].astype(float) for name in "abc"], axis=1)
    mapped = np.einsum("nij,nkj->nki", to_lobe, corners)
    return shares_of_cosine(mapped)


def shares_of_cosine(polygons: Float64) -> Float64:
    """(n,) what polygons (n, k, 3) fill of the hemisphere about z."""
    zeros = np.zeros((len(polygons), 3))
    return np.asarray(paired_form_factor(zeros, np.tile([0.0, 0.0, 1.0], (len(polygons), 1)), polygons))


@pytest.mark.parametrize("size", [1.0, 0.1, 0.005])
def test_a_triangle_above_the_surface_fills_what_the_mapped_one_does(device: Device, size: float) -> None:
    inputs = triangles(case(7), 8, size, is_above=True)
    found = call(device, f"triangle_lobe_share({LOBE}, a, b, c, area, -dot(area, a)).share", inputs)
    expected = mapped_share(inputs)
    # The table's 8 fractional bits move the lobe by some thousandths of its width.
    np.testing.assert_allclose(found, expected, rtol=0.03, atol=4e-3 * expected.max())


def test_what_is_below_the_surface_does_not_count(device: Device) -> None:
    """A light cut by the horizon fills as much as its part above does, in pieces."""
    inputs = triangles(case(9), 10, 0.6, is_above=False)
    found = call(device, f"clipped_lobe_share({LOBE}, n, a, b, c, area).share", inputs)
    normal = inputs["n"].astype(float)
    corners = np.stack([inputs[name].astype(float) for name in "abc"], axis=1)
    heights = np.einsum("nkj,nj->nk", corners, normal)
    assert (heights.min(axis=1) < 0.0).mean() > 0.3
    _, to_lobe, _ = frames(inputs)
    for i in np.flatnonzero(heights.max(axis=1) > 0.0)[:120]:
        outline = []
        for k in range(3):
            here, there = corners[i, k], corners[i, (k + 1) % 3]
            high, next_high = heights[i, k], heights[i, (k + 1) % 3]
            outline += [here] if high > 0.0 else []
            outline += [here + (there - here) * high / (high - next_high)] if high * next_high < 0.0 else []
        polygon = (to_lobe[i] @ np.array(outline).T).T
        assert found[i] == pytest.approx(shares_of_cosine(polygon[None])[0], rel=0.03, abs=4e-3)


def test_the_middle_of_a_small_triangle_is_where_it_is(device: Device) -> None:
    inputs = triangles(case(11), 12, 1e-3, is_above=True)
    share = f"triangle_lobe_share({LOBE}, a, b, c, area, -dot(area, a))"
    toward = call(device, f"from_lobe({LOBE}, {share}.toward)", inputs, 3)
    length = call(device, f"length({share}.toward)", inputs)
    seen = length > 0.0
    assert seen.mean() > 0.6
    centre = unit(np.mean([inputs[name].astype(float) for name in "abc"], axis=0))
    np.testing.assert_allclose(toward[seen], centre[seen], atol=5e-3)
    # As long as twice the solid angle in the lobe's space.
    _, to_lobe, _ = frames(inputs)
    mapped = np.einsum("nij,nj->ni", to_lobe, np.mean([inputs[name].astype(float) for name in "abc"], axis=0))
    plane = -np.linalg.det(to_lobe) * (inputs["area"].astype(float) * inputs["a"]).sum(-1)
    expected = 2.0 * plane / np.linalg.norm(mapped, axis=1) ** 3
    above = seen & (mapped[:, 2] > 0.1 * np.linalg.norm(mapped, axis=1))
    np.testing.assert_allclose(length[above], expected[above], rtol=0.05)


def fresnel(cosine: Float64) -> Float64:
    """REFLECTOR's."""
    metal = np.array([0.9, 0.5, 0.1])
    schlick = metal + (1.0 - metal) * (1.0 - cosine[:, None]) ** 5
    return np.asarray(0.4 * schlick + 0.6 * brdf.fresnel_dielectric(cosine, 1.5)[:, None])


def exact_lobe(inputs: dict[str, np.ndarray], direction: Float64) -> tuple[Float64, Float64]:
    """GGX times the cosine of the light, and Fresnel, in float64."""
    normal, eye = unit(inputs["n"].astype(float)), unit(inputs["v"].astype(float))
    half = unit(direction + eye)
    cosines = [np.maximum((normal * d).sum(-1), 1e-9) for d in (half, direction, eye)]
    lobe = brdf.ggx_brdf(*cosines, np.sqrt(inputs["alpha"].astype(float))) * cosines[1]
    return np.asarray(lobe), fresnel((half * eye).sum(-1))


def test_the_true_lobe_against_the_oracle(device: Device) -> None:
    inputs = case(13)
    preamble = (
        "vec4 both(Reflector reflector, vec3 n, vec3 v, vec3 l) {\n"
        "    vec3 fresnel; float lobe = true_lobe(reflector, n, v, l, fresnel); return vec4(fresnel, lobe);\n}"
    )
    found = call(device, f"both({REFLECTOR}, n, v, l)", inputs, 4, preamble)
    lobe, reflected = exact_lobe(inputs, unit(inputs["l"].astype(float)))
    np.testing.assert_allclose(found[:, 3], lobe, rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(found[:, :3], reflected, rtol=1e-3)


def test_points_of_a_small_light_give_its_solid_angle_times_the_lobe(device: Device) -> None:
    inputs = triangles(case(14), 15, 2e-4, is_above=True)
    direction = unit(np.mean([inputs[name].astype(float) for name in "abc"], axis=0))
    lobe, reflected = exact_lobe(inputs, direction)
    distance = np.linalg.norm(np.mean([inputs[name].astype(float) for name in "abc"], axis=0), axis=1)
    solid_angle = np.maximum(-(inputs["area"] * direction).sum(-1), 0.0) / distance**2
    expected = (lobe * solid_angle)[:, None] * reflected
    whole = call(device, f"points_reflection({REFLECTOR}, n, v, a, b, c, area)", inputs, 3)
    one = call(device, f"point_reflection({REFLECTOR}, n, v, (a + b + c) / 3.0, area)", inputs, 3)
    for found in (whole, one):
        np.testing.assert_allclose(found, expected, rtol=0.02, atol=1e-4 * expected.max())


def test_a_small_light_in_the_fit_is_the_lobe_too(device: Device) -> None:
    """Fit and lobe give the same where both hold, so that nothing shows where one fades into the other."""
    inputs = triangles(case(16, 0.4), 17, 2e-3, is_above=True)
    share = f"triangle_lobe_share({LOBE}, a, b, c, area, -dot(area, a))"
    found = call(device, f"lobe_reflection({LOBE}, {REFLECTOR}, n, v, {share})", inputs, 3)
    expected = call(device, f"points_reflection({REFLECTOR}, n, v, a, b, c, area)", inputs, 3)
    assert np.abs(found - expected).mean() < 0.02 * expected.mean()


def test_points_stand_for_lights_that_are_small(device: Device) -> None:
    found = call(device, "point_share(size)", {"size": np.array([0.0, 0.09, 0.3, 0.7, 1e30], np.float32)})
    assert (found[:2] == 1.0).all()
    assert 0.2 < found[2] < 0.8
    assert (found[3:] == 0.0).all()


def test_no_light_is_stretched_more_than_the_bound(device: Device) -> None:
    inputs = case(25) | {"radius": np.full(COUNT, 0.1, np.float32)}
    ratio = call(device, f"size_in_lobe({LOBE}, l, radius) / (radius * radius)", inputs)
    bound = call(device, f"most_stretch({LOBE})", inputs)
    assert (ratio <= 1.001 * bound).all()
    # Met where the light is in the least direction of the map.
    _, to_lobe, _ = frames(inputs)
    inputs["l"] = np.linalg.svd(to_lobe)[2][:, 2].astype(np.float32)
    ratio = call(device, f"size_in_lobe({LOBE}, l, radius) / (radius * radius)", inputs)
    assert np.median(ratio / bound) > 0.95


def test_sizes_are_those_in_the_lobes_space(device: Device) -> None:
    """Never less than the distance of any two ends of the mapped light from one another, over their distance."""
    inputs = triangles(case(21), 22, 0.02, is_above=True)
    corners = np.stack([inputs[name].astype(float) for name in "abc"], axis=1)
    centre = corners.mean(axis=1, keepdims=True)
    radius = np.linalg.norm(corners - centre, axis=2).max(axis=1)
    inputs["radius"] = radius.astype(np.float32)
    _, to_lobe, _ = frames(inputs)
    to_lobe[:, 2] = 0.0
    arms = np.linalg.norm(np.einsum("nij,nkj->nki", to_lobe, corners - centre), axis=2).max(axis=1)
    found = call(device, f"size_in_lobe({LOBE}, (a + b + c) / 3.0, radius)", inputs)
    _, to_lobe, _ = frames(inputs)
    distance = np.linalg.norm(np.einsum("nij,nkj->nki", to_lobe, centre)[:, 0], axis=1)
    assert (np.sqrt(found) >= 0.98 * arms / distance).all()
    assert (np.sqrt(found) <= 1.02 * (radius / to_lobe_widths(inputs)) / distance).all()


def to_lobe_widths(inputs: dict[str, np.ndarray]) -> Float64:
    """(n,) the narrower width of each lobe."""
    _, _, cosine = frames(inputs)
    alpha = inputs["alpha"].astype(float)
    return np.asarray(ltc.lookup_ltc(np.sqrt(alpha), cosine)[:, 1:3].min(axis=1) * alpha)


def test_nothing_of_a_lobe_is_beyond_its_reach(device: Device) -> None:
    inputs = case(23)
    inputs["alpha"] = np.geomspace(1e-4, 1.0, COUNT).astype(np.float32)
    reach = call(device, "lobe_reach(alpha, dot(n, v))", inputs).astype(float)
    assert (reach[:40] < 0.3).all()
    assert reach[-1] == pytest.approx(np.pi)
    random = np.random.default_rng(24)
    normal, eye = unit(inputs["n"].astype(float)), unit(inputs["v"].astype(float))
    mirror = 2.0 * (normal * eye).sum(-1, keepdims=True) * normal - eye
    for _ in range(50):
        # Just outside of the cone, all around it.
        across = unit(np.cross(mirror, random.normal(size=(COUNT, 3))))
        angle = (reach * random.uniform(1.0, 1.5, COUNT))[:, None]
        direction = np.cos(angle) * mirror + np.sin(angle) * across
        lobe, _ = exact_lobe(inputs, direction)
        outside = (reach < 2.0) & ((direction * normal).sum(-1) > 0.0)
        assert (np.pi * lobe[outside] < 1.01 * LEAST_LOBE).all()


def test_lights_of_no_size_and_mirrors_stay_finite(device: Device) -> None:
    inputs = triangles(case(19), 20, 0.3, is_above=False)
    inputs["alpha"][:] = np.resize([1e-4, 1e-3, 0.3, 1.0], COUNT)
    inputs["b"][::4], inputs["area"][::4] = inputs["a"][::4], 0.0
    inputs["a"][1::4] = 0.0
    clipped = f"lobe_reflection({LOBE}, {REFLECTOR}, n, v, clipped_lobe_share({LOBE}, n, a, b, c, area))"
    for expression in (clipped, f"points_reflection({REFLECTOR}, n, v, a, b, c, area)"):
        found = call(device, expression, inputs, 3)
        assert np.isfinite(found).all()
        assert (found >= 0.0).all()
