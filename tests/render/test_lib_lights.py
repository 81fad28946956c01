# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/lights.glsl` against the float64 oracle in core/lamps.py."""

from __future__ import annotations

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.render.shader_functions import evaluate
from vlm_addon.core import lamps
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.scene import AREA, ELLIPSE, POINT, SPOT, SUN, Light
from vlm_addon.render.device import Device
from vlm_addon.render.gpu_layout import LAMP
from vlm_addon.render.lamp_records import lamp_record

COUNT = 500
# What the shader brings at most, W/m².
MOST_IRRADIANCE = 9.99e29
TILTED = {
    "x_axis": (0.8, 0.0, 0.6),
    "y_axis": (0.0, 1.0, 0.0),
    "z_axis": (-0.6, 0.0, 0.8),
}
BASE = Light("lamp", POINT, (10.0, 20.0, 30.0), (0.5, -0.25, 2.0), **TILTED)
LAMPS = {
    "point": BASE,
    "soft point": replace(BASE, radius=0.7),
    "ball": replace(BASE, radius=0.7, soft_falloff=False),
    "spot": replace(BASE, kind=SPOT, spot_angle=1.4, spot_blend=0.3),
    "spot without blend": replace(BASE, kind=SPOT, spot_angle=1.4, spot_blend=0.0),
    "squashed spot": replace(BASE, kind=SPOT, spot_angle=1.4, spot_blend=1.0, spot_scale=(2.0, 0.5)),
    "sun": replace(BASE, kind=SUN),
    "soft sun": replace(BASE, kind=SUN, angle=0.8),
    "rectangle": replace(BASE, kind=AREA, size_x=2.0, size_y=0.5),
    "tiny rectangle": replace(BASE, kind=AREA, size_x=0.001, size_y=0.002),
    "ellipse": replace(BASE, kind=AREA, size_x=2.0, size_y=0.5, shape=ELLIPSE),
}


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def lamp_literal(light: Light, sample: lamps.LampSample) -> str:
    """GLSL that makes the Lamp of a sample."""
    record = lamp_record(light, sample, np.zeros(3))[0]

    def text(name: str, glsl_type: str) -> str:
        values = np.atleast_1d(record[name])
        if glsl_type == "int":
            return str(int(values[0]))
        numbers = ", ".join(f"{float(value):.9e}" for value in values)
        return numbers if glsl_type == "float" else f"{glsl_type}({numbers})"

    return "Lamp(" + ", ".join(text(name, glsl_type) for glsl_type, name in LAMP.fields) + ")"


def shader(device: Device, light: Light, points: np.ndarray, normals: np.ndarray, samples: int) -> np.ndarray:
    total = np.zeros((len(points), 3))
    for sample in lamps.lamp_samples(light, samples):
        total += sample.share * record_irradiance(device, light, sample, points, normals)
    return total


def random_receivers() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(2)
    return random.uniform(-3.0, 3.0, (COUNT, 3)), unit(random.normal(size=(COUNT, 3)))


@pytest.mark.parametrize("name", list(LAMPS))
def test_irradiance_against_the_oracle(device: Device, name: str) -> None:
    points, normals = random_receivers()
    light = LAMPS[name]
    found = shader(device, light, points, normals, 9 if light.kind == AREA else 1)
    expected = lamps.lamp_irradiance(light, points, normals)
    # 64 cells of the oracle's ellipse and 9 of the shader's differ in outline.
    relative, absolute = (0.02, 1e-2) if name == "ellipse" else (2e-4, 2e-6)
    np.testing.assert_allclose(found, expected, rtol=relative, atol=absolute * expected.max())


@pytest.mark.parametrize("count", [1, 3, 16])
def test_samples_of_a_rectangle_sum_to_the_whole(device: Device, count: int) -> None:
    points, normals = random_receivers()
    found = shader(device, LAMPS["rectangle"], points, normals, count)
    expected = lamps.lamp_irradiance(LAMPS["rectangle"], points, normals)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=2e-6 * expected.max())


@pytest.mark.parametrize("sine", [0.0, 0.01, 0.029, 0.031, 0.3, 0.999])
def test_horizon_cosine(device: Device, sine: float) -> None:
    cosines = np.linspace(-1.0, 1.0, 2001)
    inputs = {"c": cosines, "s": np.full(2001, sine)}
    found = evaluate(device, "lib/lights.glsl", "horizon_cosine(c, s)", inputs)
    expected = lamps.horizon_cosine(cosines.astype(np.float32), np.full(2001, sine, np.float32))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-4 * max(sine, 0.01))


@pytest.mark.parametrize("x", [-1.0, 1.0])
def test_arctangent_over_the_half_circle(device: Device, x: float) -> None:
    y = np.concatenate([np.linspace(0.0, 2.0, 1001), [1e-20, 1e20]])
    inputs = {"y": y, "x": np.full(len(y), x)}
    found = evaluate(device, "lib/lights.glsl", "half_circle_arctangent(y, x)", inputs)
    np.testing.assert_allclose(found, np.arctan2(y, x), rtol=0.0, atol=6e-7)


def flat(light: Light) -> Light:
    """The lamp turned to look along -z of the world, where "on its plane" is exact in float32."""
    return replace(light, x_axis=(1.0, 0.0, 0.0), y_axis=(0.0, 1.0, 0.0), z_axis=(0.0, 0.0, 1.0))


EXTENTS = {"tiny": 1e-6, "ordinary": 1.0, "huge": 1e6}


def sized(light: Light, extent: float) -> Light:
    """The lamp with all of its own lengths times `extent`."""
    return replace(light, radius=light.radius * extent, size_x=light.size_x * extent, size_y=light.size_y * extent)


def receivers_at(light: Light, extent: float) -> tuple[np.ndarray, np.ndarray]:
    """Points on, in, before, behind, beside and far from a lamp; normals along, against and across its axis."""
    offsets = [
        (0, 0, 0),
        (0.1, 0.1, 0),
        (0.9, 0, 0),
        (9, 4, 0),
        (0, 0, -1),
        (0.3, 0.2, -1e-3),
        (0, 0, 1),
        (0.2, 0, 1e-3),
    ]
    around = extent * np.concatenate([np.array(offsets), 1e-6 * np.array(offsets), 1e3 * np.array(offsets)])
    points = np.array(light.position) + np.repeat(around, 6, axis=0)
    normals = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (len(around), 1))
    return points, normals


@pytest.mark.parametrize("extent", list(EXTENTS))
@pytest.mark.parametrize("power", [0.0, 1.0, 1e6])
@pytest.mark.parametrize("name", list(LAMPS))
def test_touching_facing_away_within_and_on_the_plane(device: Device, name: str, power: float, extent: str) -> None:
    """Finite, not negative, 0 where it is 0, and near the oracle: lamps of any extent and power."""
    light = sized(
        flat(replace(LAMPS[name], power=(power, 2.0 * power, 0.0), position=(0.0, 0.0, 0.0))), EXTENTS[extent]
    )
    points, normals = receivers_at(light, EXTENTS[extent])
    points, normals = (values.astype(np.float32).astype(float) for values in (points, normals))
    found = shader(device, light, points, normals, 4 if light.kind == AREA else 1)
    expected = lamps.lamp_irradiance(light, points, normals)
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()
    assert not found[:, 2].any()
    np.testing.assert_array_equal(found[(expected == 0.0).all(axis=1)], 0.0)
    assert power == 0.0 or light.kind == SPOT or found.any()
    # A cone cut by the horizon is good to 1e-4 of its sine, or 4e-4 where it fills the hemisphere, as within a lamp;
    # the cells of the oracle's ellipse have another outline.
    relative, absolute = (0.05, 0.06) if name == "ellipse" else (2e-4, 4e-4)
    is_point = light.kind in (POINT, SPOT)
    full = _facing(light, points)[:, None] * np.array(light.power) if is_point else expected.max(axis=0)
    close = np.abs(found - expected) <= relative * expected + absolute * full
    assert (close | (found >= MOST_IRRADIANCE)).all()


def _facing(light: Light, points: np.ndarray) -> np.ndarray:
    """Irradiance per watt of a POINT lamp of the same size on a surface that faces it."""
    squared = np.maximum(((points - light.position) ** 2).sum(-1), 1e-30)
    radius_squared = light.radius**2
    reach = squared + radius_squared if light.soft_falloff else np.maximum(squared, radius_squared)
    return 1.0 / (4.0 * math.pi * reach)


@pytest.mark.parametrize("extent", list(EXTENTS))
@pytest.mark.parametrize("name", list(LAMPS))
def test_ray_from_a_point_that_touches_the_lamp(device: Device, name: str, extent: str) -> None:
    """Finite, not negative, unit or without direction, no light from behind and at most the hemisphere of an area."""
    light = sized(flat(replace(LAMPS[name], power=(1e6, 1e6, 1e6), position=(0.0, 0.0, 0.0))), EXTENTS[extent])
    points, _ = receivers_at(light, EXTENTS[extent])
    irradiance, angle = ray(device, light, points)
    assert np.isfinite(irradiance).all()
    assert np.isfinite(angle).all()
    assert (irradiance >= 0.0).all()
    assert (angle >= 0.0).all()
    literal = lamp_literal(light, lamps.lamp_samples(light, 4)[0])
    lengths = np.linalg.norm(
        evaluate(device, "lib/lights.glsl", f"lamp_ray({literal}, p).direction", {"p": points}, components=3), axis=1
    )
    assert ((np.abs(lengths - 1.0) < 1e-5) | (lengths < 1e-5)).all()
    if light.kind == AREA:
        assert not irradiance[points[:, 2] >= 0.0].any()
        assert (angle <= 4.0 * math.pi).all()
    if light.kind == SUN:
        np.testing.assert_allclose(irradiance, 1e6)


def test_arctangent_of_nothing_is_nothing(device: Device) -> None:
    inputs = {"y": np.zeros(3), "x": np.array([0.0, 1.0, -1.0])}
    found = evaluate(device, "lib/lights.glsl", "half_circle_arctangent(y, x)", inputs)
    np.testing.assert_allclose(found, [0.0, 0.0, math.pi], atol=1e-6)


DEGENERATE = {
    "area without size": replace(BASE, kind=AREA, size_x=0.0, size_y=0.0),
    "area without width": replace(BASE, kind=AREA, size_x=0.0, size_y=1.0),
    "ellipse without size": replace(BASE, kind=AREA, size_x=0.0, size_y=0.0, shape=ELLIPSE),
    "spot without angle": replace(BASE, kind=SPOT, spot_angle=0.0),
    "no power": replace(BASE, power=(0.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", list(DEGENERATE))
def test_lamps_that_send_nothing_are_exactly_black(device: Device, name: str) -> None:
    points, normals = random_receivers()
    light = DEGENERATE[name]
    assert not shader(device, light, points, normals, 4).any()
    assert not lamps.lamp_irradiance(light, points, normals).any()
    assert not ray(device, light, points)[0].any()


def test_spot_squashed_to_nothing_stays_finite(device: Device) -> None:
    points, normals = random_receivers()
    light = replace(LAMPS["spot"], spot_scale=(0.0, 1.0))
    found = shader(device, light, points, normals, 1)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, lamps.lamp_irradiance(light, points, normals), rtol=1e-3, atol=1e-4)


@settings(max_examples=100, deadline=None)
@given(
    kind=st.sampled_from([POINT, SPOT, SUN, AREA]),
    extent=st.floats(-6.0, 6.0).map(lambda e: 10.0**e),
    distance=st.floats(-6.0, 6.0).map(lambda e: 10.0**e),
    power=st.floats(0.0, 6.0).map(lambda e: 10.0**e),
    angle=st.floats(0.0, math.pi),
    seed=st.integers(0, 2**16),
)
def test_any_lamp_at_any_distance(
    device: Device, kind: str, extent: float, distance: float, power: float, angle: float, seed: int
) -> None:
    """One program for all: the lamp is an input. Finite and not negative everywhere, and near the oracle."""
    random = np.random.default_rng(seed)
    light = Light(
        "l", kind, (power, 0.5 * power, 0.0), (0.0, 0.0, 0.0), radius=extent, angle=angle, spot_angle=angle,
        spot_blend=0.5, size_x=extent, size_y=2.0 * extent, soft_falloff=bool(seed % 2),
    )  # fmt: skip
    points = (distance * random.normal(size=(64, 3))).astype(np.float32).astype(float)
    normals = unit(random.normal(size=(64, 3))).astype(np.float32).astype(float)
    found = record_irradiance(device, light, lamps.lamp_samples(light, 1)[0], points, normals)
    expected = lamps.lamp_irradiance(light, points, normals)
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()
    assert not found[:, 2].any()
    facing = _facing(light, points)[:, None] * np.array(light.power)
    if kind == SPOT:
        # Where a steep cone ends rounding of the cosine counts.
        assert (found <= 1.001 * facing).all()
        return
    full = np.array(light.power) if kind == SUN else facing
    if kind == AREA:
        # A cosine each, of rounding.
        squared = (points**2).sum(-1, keepdims=True)
        full = 10.0 * np.array(light.power) / (math.pi * np.maximum(squared, lamps.area_of(light)))
    np.testing.assert_array_less(np.abs(found - expected), 3e-4 * expected + 4e-4 * full + 1e-30)


def record_irradiance(
    device: Device, light: Light, sample: lamps.LampSample, points: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """lamp_irradiance with the Lamp of a sample given as data."""
    words = lamp_record(light, sample, np.zeros(3)).view(np.float32)
    inputs = {"p": points, "n": normals}
    arguments = []
    for glsl_type, name in LAMP.fields:
        size = {"float": 1, "int": 1, "vec2": 2, "vec3": 3, "vec4": 4}[glsl_type]
        start = LAMP.dtype.fields[name][1] // 4
        values = np.tile(words[start : start + size], (len(points), 1))
        inputs[name] = values.view(np.int32) if glsl_type == "int" else values
        arguments.append(name)
    call = f"lamp_irradiance(Lamp({', '.join(arguments)}), p, n)"
    return evaluate(device, "lib/lights.glsl", call, inputs, components=3)


@pytest.mark.parametrize("sine", [1e-6, 1e-4, 1e-3, 0.01, 0.029, 0.031, 0.3, 0.999999])
def test_cone_over_the_horizon_against_its_closed_form(device: Device, sine: float) -> None:
    """Snyder 1996 with 40 digits: the oracle within 1e-7 of the sine, the shader within 1e-4."""
    with mpmath.workdps(40):
        s = mpmath.mpf(float(np.float32(sine)))
        cosines = (np.linspace(-0.999, 0.999, 101) * sine).astype(np.float32)
        x = mpmath.sqrt(1 / s**2 - 1)
        exact = []
        for c in map(mpmath.mpf, cosines.astype(float).tolist()):
            normal_sine = mpmath.sqrt(1 - c * c)
            y = -x * c / normal_sine
            chord = normal_sine * mpmath.sqrt(1 - y * y)
            angle = mpmath.acos(y)
            exact.append(float(((c * angle - x * chord) * s * s + mpmath.atan2(chord, x)) / (mpmath.pi * s * s)))
        sines = np.full(len(cosines), float(s))
    found = evaluate(device, "lib/lights.glsl", "horizon_cosine(c, s)", {"c": cosines, "s": sines})
    np.testing.assert_allclose(lamps.horizon_cosine(cosines, sines), exact, rtol=0.0, atol=2e-7 * sine)
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-4 * sine)


@pytest.mark.parametrize("sine", [1e-6, 0.01, 0.029, 0.031, 0.3, 0.93, 0.999999, 1.0])
def test_cone_almost_below_the_horizon_is_not_negative(device: Device, sine: float) -> None:
    below = -sine * (1.0 - np.geomspace(1e-7, 1e-2, 400))
    sines = np.full(400, sine)
    assert (evaluate(device, "lib/lights.glsl", "horizon_cosine(c, s)", {"c": below, "s": sines}) >= 0.0).all()
    assert (lamps.horizon_cosine(below, sines) >= 0.0).all()


@pytest.mark.parametrize("name", ["spot", "spot without blend", "squashed spot"])
def test_spot_attenuation(device: Device, name: str) -> None:
    light = LAMPS[name]
    directions = unit(np.random.default_rng(5).normal(size=(COUNT, 3)) - 2.0 * np.array(light.z_axis))
    expected = lamps.spot_attenuation(light, directions.astype(np.float32).astype(float))
    literal = lamp_literal(light, lamps.lamp_samples(light, 1)[0])
    for length in (1e-6, 1.0, 1e6):
        found = evaluate(device, "lib/lights.glsl", f"spot_attenuation({literal}, d)", {"d": length * directions})
        # The edge of a cone without blend is 1e-4 wide in the cosine.
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=5e-3 if name == "spot without blend" else 1e-5)
    nowhere = evaluate(device, "lib/lights.glsl", f"spot_attenuation({literal}, d)", {"d": np.zeros((1, 3))})
    assert 0.0 <= nowhere[0] <= 1.0


def test_corner_of_a_lamp(device: Device) -> None:
    light = LAMPS["rectangle"]
    corners = np.random.default_rng(6).normal(size=(50, 2))
    literal = lamp_literal(light, lamps.lamp_samples(light, 1)[0])
    found = evaluate(device, "lib/lights.glsl", f"lamp_corner({literal}, c)", {"c": corners}, components=3)
    expected = np.array(light.position) + corners @ np.array([light.x_axis, light.y_axis])
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("name", ["rectangle", "tiny rectangle", "ellipse"])
def test_cell_form_factor(device: Device, name: str) -> None:
    """Each cell of a lamp against the polygon oracle, far, near and in contact."""
    light = LAMPS[name]
    points, normals = random_receivers()
    below = np.array(light.position) - np.outer(10.0 ** np.linspace(-6.0, 6.0, COUNT), light.z_axis)
    points, normals = np.concatenate([points, below]), np.concatenate([normals, normals])
    points, normals = (values.astype(np.float32).astype(float) for values in (points, normals))
    axes = np.array([light.x_axis, light.y_axis])
    for sample in lamps.lamp_samples(light, 5):
        call = f"cell_form_factor({lamp_literal(light, sample)}, p, n)"
        found = evaluate(device, "lib/lights.glsl", call, {"p": points, "n": normals})
        expected = polygon_form_factor(points, normals, (np.array(light.position) + sample.cell @ axes)[None])[:, 0]
        assert (found >= 0.0).all()
        assert (found <= 1.0).all()
        # Close to the tilted lamp its plane is known to float32's rounding of the positions.
        near = np.linalg.norm(points - light.position, axis=1) < 0.01
        np.testing.assert_allclose(found[~near], expected[~near], rtol=3e-4, atol=5e-6)
        np.testing.assert_allclose(found[near], expected[near], atol=2e-2)


@pytest.mark.parametrize("extent", [0.0, 15.0, 1000.0])
def test_surface_that_an_area_lamp_lies_in_stays_dark(device: Device, extent: float) -> None:
    """A lamp flush with a ceiling in any direction: no rounding lifts it over the ceiling's horizon."""
    random = np.random.default_rng(int(extent))
    for _ in range(4):
        axes = np.linalg.qr(random.normal(size=(3, 3)))[0].astype(np.float32).astype(float)
        axes[2] *= np.sign(np.linalg.det(axes))
        place = tuple(random.uniform(-extent, extent, 3).astype(np.float32).tolist())
        x, y, z = (tuple(axis.tolist()) for axis in axes)
        light = replace(LAMPS["rectangle"], position=place, x_axis=x, y_axis=y, z_axis=z)
        points = np.array(place) + random.uniform(-1.5, 1.5, (COUNT, 2)) @ axes[:2]
        inputs = {"p": points, "n": np.tile(-axes[2], (COUNT, 1))}
        for sample in lamps.lamp_samples(light, 2):
            call = f"cell_form_factor({lamp_literal(light, sample)}, p, n)"
            assert evaluate(device, "lib/lights.glsl", call, inputs).max() < 1e-6


def test_clipped_edge(device: Device) -> None:
    """Part of one edge over the horizon, in units of 2 pi times the form factor, and where it enters and leaves."""
    random = np.random.default_rng(7)
    a, b = random.normal(size=(COUNT, 3)), random.normal(size=(COUNT, 3))
    preamble = """
    vec4 clipped(vec3 a, vec3 b, bool wants_exit) {
        float sum = 0.0;
        vec3 exit_point = vec3(0.0), entry_point = vec3(0.0);
        add_clipped_edge(a, b, vec3(0.0, 0.0, 1.0), sum, exit_point, entry_point);
        return vec4(wants_exit ? exit_point : entry_point, sum);
    }"""
    call = {"a": a, "b": b}
    leaving = evaluate(device, "lib/lights.glsl", "clipped(a, b, true)", call, 4, preamble)
    entering = evaluate(device, "lib/lights.glsl", "clipped(a, b, false)", call, 4, preamble)
    at_horizon = a + (b - a) * (a[:, 2] / (a[:, 2] - b[:, 2]))[:, None]
    leaves, enters = (a[:, 2] > 0.0) & (b[:, 2] <= 0.0), (a[:, 2] <= 0.0) & (b[:, 2] > 0.0)
    np.testing.assert_allclose(leaving[:, :3], np.where(leaves[:, None], at_horizon, 0.0), rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(entering[:, :3], np.where(enters[:, None], at_horizon, 0.0), rtol=1e-4, atol=1e-5)
    start, end = np.where(enters[:, None], at_horizon, a), np.where(leaves[:, None], at_horizon, b)
    normal = np.cross(end, start)
    length = np.linalg.norm(normal, axis=1)
    angle = np.arctan2(length, (start * end).sum(-1))
    expected = np.where((a[:, 2] > 0.0) | (b[:, 2] > 0.0), angle * normal[:, 2] / length, 0.0)
    np.testing.assert_allclose(leaving[:, 3], expected, rtol=1e-4, atol=1e-5)


def ray(device: Device, light: Light, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over 4 samples of the irradiance on a surface facing each sample, and of its solid angle."""
    irradiance, angle = np.zeros((len(points), 3)), np.zeros(len(points))
    samples = lamps.lamp_samples(light, 4)
    for sample in samples:
        call = f"lamp_ray({lamp_literal(light, sample)}, p)"
        call = f"vec4({call}.irradiance, {call}.solid_angle)"
        values = evaluate(device, "lib/lights.glsl", call, {"p": points}, components=4)
        irradiance += sample.share * values[:, :3]
        angle += values[:, 3]
    return irradiance, angle


@pytest.mark.parametrize("name", ["point", "ball", "soft point", "sun", "rectangle", "ellipse"])
def test_ray_brings_the_irradiance_of_a_facing_surface(device: Device, name: str) -> None:
    """Far from the lamp, where all of its points lie in one direction."""
    light = LAMPS[name]
    direction = np.array([0.6, 0.3, -0.8]) / np.linalg.norm([0.6, 0.3, -0.8])
    points = np.array(light.position) + 40.0 * direction[None]
    to_lamp = np.array([light.z_axis]) if light.kind == SUN else -direction[None]
    irradiance, _ = ray(device, light, points)
    np.testing.assert_allclose(irradiance, lamps.lamp_irradiance(light, points, to_lamp), rtol=2e-3)


def test_solid_angles_of_the_samples_make_up_the_lamp(device: Device) -> None:
    light = LAMPS["rectangle"]
    points = np.array(light.position) - 40.0 * np.array([light.z_axis])
    _, angle = ray(device, light, points)
    assert angle[0] == pytest.approx(1.0 / 40.0**2, rel=1e-3)
    _, angle = ray(device, LAMPS["ball"], points)
    assert angle[0] == pytest.approx(math.pi * 0.49 / 40.0**2, rel=1e-3)
