# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/shadow.glsl` over maps made by hand, whose shadows are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.render.shader_functions import evaluate
from vlm_addon.core.scene import Float64
from vlm_addon.render.device import Device
from vlm_addon.render.gpu_layout import CONSTANTS, LAMP

SIDE = 16
UNIT = int(CONSTANTS["SHADOW_MAP_UNIT"])
NOTHING = {"SHADOW_PARALLEL": -1e30, "SHADOW_CONE": 0.0, "SHADOW_CUBE": 0.0}
UP = np.array([0.0, 0.0, 1.0])
# Perspective maps look down from this height, m.
LAMP_HEIGHT = 2.0
NEAR = 1e-3


def lamp(kind: str, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """A sun straight above or a lamp at LAMP_HEIGHT over `origin`; its map spans 2 m, or 45° to each side."""
    record = LAMP.zeros(1)
    record["shadow_scale"] = 1.0
    is_sun = kind == "SHADOW_PARALLEL"
    record["kind"] = CONSTANTS["LAMP_SUN" if is_sun else "LAMP_POINT"]
    record["shadow_kind"] = CONSTANTS[kind]
    record["x_axis"], record["y_axis"], record["z_axis"] = np.eye(3)
    above = np.array(origin) + LAMP_HEIGHT * UP
    record["sample_position"] = UP if is_sun else above
    record["shadow_origin"] = origin if is_sun else above
    record["shadow_extent"], record["shadow_near"] = 1.0, NEAR
    return record


def with_lamp(record: np.ndarray, count: int) -> tuple[dict[str, np.ndarray], str]:
    """The fields of a Lamp as inputs of `count` rows, and the expression that joins them."""
    words = record.view(np.float32)
    inputs = {}
    for glsl_type, name in LAMP.fields:
        size = {"float": 1, "int": 1, "vec2": 2, "vec3": 3, "vec4": 4}[glsl_type]
        start = LAMP.dtype.fields[name][1] // 4
        values = np.tile(words[start : start + size], (count, 1))
        inputs[name] = values.view(np.int32) if glsl_type == "int" else values
    return inputs, f"Lamp({', '.join(name for _, name in LAMP.fields)})"


def share(
    device: Device, record: np.ndarray, texels: np.ndarray, points: Float64, normals: Float64 = UP, tilt: float = 0.05
) -> np.ndarray:
    """lit_share at each point. texels: (h, w) of the map, row 0 at the bottom."""
    inputs, text = with_lamp(record, len(points))
    inputs |= {"p": points, "n": np.broadcast_to(normals, points.shape), "tilt": np.full(len(points), tilt)}
    preamble = f"layout(binding = {UNIT}) uniform sampler2D map;"
    with device.current() as context:
        texture = context.texture(texels.shape[::-1], 1, np.ascontiguousarray(texels, np.float32).tobytes(), dtype="f4")
        texture.filter = (context.NEAREST, context.NEAREST)
        texture.repeat_x = texture.repeat_y = False
        texture.use(UNIT)
        return evaluate(device, "lib/shadow.glsl", f"lit_share(map, {text}, p, n, tilt)", inputs, 1, preamble)


def shape(kind: str) -> tuple[int, int]:
    columns, rows = (3, 2) if kind == "SHADOW_CUBE" else (1, 1)
    return SIDE * rows, SIDE * columns


def filled(kind: str, height: float) -> np.ndarray:
    """A map that shows a horizontal plane everywhere."""
    nearness = height if kind == "SHADOW_PARALLEL" else NEAR / (LAMP_HEIGHT - height)
    return np.full(shape(kind), nearness)


def points_on(height: float, count: int = 300, reach: float = 0.8) -> Float64:
    random = np.random.default_rng(3)
    return np.concatenate([random.uniform(-reach, reach, (count, 2)), np.full((count, 1), height)], axis=1)


@pytest.mark.parametrize("kind", list(NOTHING))
def test_empty_map_shadows_nothing(device: Device, kind: str) -> None:
    found = share(device, lamp(kind), np.full(shape(kind), NOTHING[kind]), points_on(0.0))
    np.testing.assert_array_equal(found, 1.0)


@pytest.mark.parametrize("kind", list(NOTHING))
def test_surface_that_faces_away_is_dark(device: Device, kind: str) -> None:
    found = share(device, lamp(kind), np.full(shape(kind), NOTHING[kind]), points_on(0.0), -UP)
    np.testing.assert_array_equal(found, 0.0)


@pytest.mark.parametrize("kind", list(NOTHING))
def test_surface_in_the_map_does_not_shadow_itself(device: Device, kind: str) -> None:
    np.testing.assert_array_equal(share(device, lamp(kind), filled(kind, 0.0), points_on(0.0)), 1.0)


@pytest.mark.parametrize("kind", list(NOTHING))
def test_everything_below_an_occluder_is_dark(device: Device, kind: str) -> None:
    np.testing.assert_array_equal(share(device, lamp(kind), filled(kind, 0.5), points_on(0.0)), 0.0)


@pytest.mark.parametrize("kind", list(NOTHING))
def test_what_lies_deeper_does_not_matter(device: Device, kind: str) -> None:
    np.testing.assert_array_equal(share(device, lamp(kind), filled(kind, -0.5), points_on(0.0)), 1.0)


@pytest.mark.parametrize("kind", list(NOTHING))
def test_lamp_without_map(device: Device, kind: str) -> None:
    record = lamp(kind)
    record["shadow_kind"] = CONSTANTS["SHADOW_NONE"]
    np.testing.assert_array_equal(share(device, record, filled(kind, 0.5), points_on(0.0), -UP), 1.0)


@pytest.mark.parametrize("slope", [0.0, 1.0, 10.0])
def test_sloping_plane_under_a_sun_does_not_shadow_itself(device: Device, slope: float) -> None:
    """The map holds the plane's heights at the texels' centres, as if it had been drawn."""
    centres = (np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0
    points = points_on(0.0)
    points[:, 2] = slope * points[:, 0]
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    found = share(device, lamp("SHADOW_PARALLEL"), np.tile(slope * centres, (SIDE, 1)), points, normal, tilt=0.0)
    np.testing.assert_array_equal(found, 1.0)


def test_sloping_plane_under_a_lamp_does_not_shadow_itself(device: Device) -> None:
    slope = 0.7
    tangents = (np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0
    # On the ray down to (t, -1): z = slope x with x = t depth, z = LAMP_HEIGHT - depth.
    depth = LAMP_HEIGHT / (1.0 + slope * tangents)
    points = points_on(0.0)
    points[:, 2] = slope * points[:, 0]
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    found = share(device, lamp("SHADOW_CONE"), np.tile(NEAR / depth, (SIDE, 1)), points, normal, tilt=0.0)
    np.testing.assert_array_equal(found, 1.0)


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (300.0, -200.0, 100.0)])
def test_edge_of_an_occluder_is_filtered_over_one_texel(device: Device, origin: tuple[float, float, float]) -> None:
    """Texels of x < 0 hold an occluder: between the centres beside the edge the share grows linearly from 0 to 1."""
    texels = filled("SHADOW_PARALLEL", 0.0)
    texels[:, : SIDE // 2] = 0.5
    x = np.linspace(-0.5, 0.5, 201)
    points = np.stack([x, np.full(201, 0.03), np.zeros(201)], axis=1) + origin
    found = share(device, lamp("SHADOW_PARALLEL", origin), texels, points)
    texel = 2.0 / SIDE
    np.testing.assert_allclose(found, np.clip(0.5 + x / texel, 0.0, 1.0), atol=1e-3)


@pytest.mark.parametrize("kind", ["SHADOW_PARALLEL", "SHADOW_CONE"])
@pytest.mark.parametrize("gap", [0.2, 1.0, 5.0])
def test_contact_shadow_of_a_low_occluder(device: Device, kind: str, gap: float) -> None:
    """gap: height over the receiver in texels. Seen beside the receiver it casts its shadow down to contact."""
    texel = 2.0 / SIDE * (1.0 if kind == "SHADOW_PARALLEL" else LAMP_HEIGHT)
    texels = filled(kind, 0.0)
    texels[:, : SIDE // 2] = filled(kind, gap * texel)[0, 0]
    points = np.array([[-2.0 * texel, 0.01, 0.0], [2.0 * texel, 0.01, 0.0]])
    np.testing.assert_array_equal(share(device, lamp(kind), texels, points), [0.0, 1.0])


@pytest.mark.parametrize("kind", list(NOTHING))
def test_rounding_allowance_frees_what_is_within_it(device: Device, kind: str) -> None:
    record = lamp(kind)
    texels = filled(kind, 1e-2)
    np.testing.assert_array_equal(share(device, record, texels, points_on(0.0), tilt=0.0), 0.0)
    record["shadow_rounding"] = 2e-2
    np.testing.assert_array_equal(share(device, record, texels, points_on(0.0), tilt=0.0), 1.0)


@pytest.mark.parametrize("kind", list(NOTHING))
def test_points_at_and_behind_the_lamp_stay_finite(device: Device, kind: str) -> None:
    points = np.array(
        [[0, 0, LAMP_HEIGHT], [1e-20, 0, LAMP_HEIGHT], [0, 0, 3], [1, 1, LAMP_HEIGHT], [0, 0, 1e6], [1e6, 0, 0]]
    )
    for normal in (UP, -UP, np.array([1.0, 0.0, 0.0])):
        found = share(device, lamp(kind), filled(kind, 0.0), points.astype(float), normal)
        assert np.isfinite(found).all()
        assert ((found >= 0.0) & (found <= 1.0)).all()


@settings(max_examples=60, deadline=None)
@given(
    kind=st.sampled_from(list(NOTHING)),
    extent=st.floats(-6.0, 6.0).map(lambda e: 10.0**e),
    seed=st.integers(0, 2**16),
)
def test_share_of_any_map_is_a_share(device: Device, kind: str, extent: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    record = lamp(kind)
    scale = extent if kind == "SHADOW_PARALLEL" else 1.0
    record["shadow_extent"], record["shadow_rounding"] = scale, random.choice([0.0, 1e-3 * extent])
    texels = random.normal(size=shape(kind)) * extent if kind == "SHADOW_PARALLEL" else random.random(shape(kind))
    texels[random.random(texels.shape) < 0.3] = NOTHING[kind]
    points = extent * random.normal(size=(200, 3)) * random.choice([1e-3, 1.0, 1e3])
    normals = random.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = share(device, record, texels, points, normals)
    assert np.isfinite(found).all()
    assert ((found >= 0.0) & (found <= 1.0)).all()


def in_face(device: Device, kind: str, offsets: Float64, normals: Float64) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, normal and tile of shadow_point at `offsets` from a lamp at the origin."""
    record = lamp(kind)
    record["shadow_origin"] = 0.0
    inputs, text = with_lamp(record, len(offsets))
    inputs |= {"p": offsets, "n": normals}
    call = f"shadow_point({text}, p, n)"
    return (
        evaluate(device, "lib/shadow.glsl", f"{call}.position", inputs, 3),
        evaluate(device, "lib/shadow.glsl", f"{call}.normal", inputs, 3),
        evaluate(device, "lib/shadow.glsl", f"{call}.tile", inputs, 2),
    )


TIES = [[0, 0, 0], [1, 1, 1], [-1, -1, -1], [1, -1, 0], [0, 1, -1], [-1, 0, 1], [0, 0, 1], [0, -1, 0], [-1e-30, 0, 0]]


def test_faces_of_a_cube(device: Device) -> None:
    """The face along the largest coordinate, x before y before z where they tie; axes follow cyclically."""
    random = np.random.default_rng(4)
    offsets = np.concatenate([random.normal(size=(300, 3)), TIES]).astype(np.float32).astype(float)
    normals = random.normal(size=offsets.shape).astype(np.float32).astype(float)
    position, normal, tile = in_face(device, "SHADOW_CUBE", offsets, normals)
    axis = np.abs(offsets).argmax(axis=1)
    order = np.stack([(axis + 1) % 3, (axis + 2) % 3, axis], axis=1)
    expected = np.take_along_axis(offsets, order, axis=1)
    expected_normal = np.take_along_axis(normals, order, axis=1)
    negative = expected[:, 2] < 0.0
    expected[negative, 2] *= -1.0
    expected_normal[negative, 2] *= -1.0
    face = 2 * axis + negative
    np.testing.assert_array_equal(position, expected)
    np.testing.assert_array_equal(normal, expected_normal)
    np.testing.assert_array_equal(tile, np.stack([face % 3, face // 3], axis=1))
    assert (np.abs(position[:, :2]) <= position[:, 2:]).all()


def test_cone_looks_down_and_a_sun_up(device: Device) -> None:
    random = np.random.default_rng(5)
    offsets, normals = (random.normal(size=(2, 50, 3))).astype(np.float32).astype(float)
    position, normal, _ = in_face(device, "SHADOW_CONE", offsets, normals)
    np.testing.assert_array_equal(position, offsets * [1.0, 1.0, -1.0])
    np.testing.assert_array_equal(normal, normals * [1.0, 1.0, -1.0])
    position, normal, _ = in_face(device, "SHADOW_PARALLEL", offsets, normals)
    np.testing.assert_array_equal(position, offsets)
    np.testing.assert_array_equal(normal, normals)


def test_place_is_that_of_the_point_which_lies_there(device: Device) -> None:
    random = np.random.default_rng(5)
    offsets = random.integers(-4096, 4096, (100, 3)) / 1024.0
    for kind in ("SHADOW_CUBE", "SHADOW_CONE", "SHADOW_PARALLEL"):
        record = lamp(kind, (1.5, -2.0, 0.25))
        inputs, text = with_lamp(record, len(offsets))
        inputs |= {"offset": offsets, "p": offsets + record["shadow_origin"], "n": np.broadcast_to(UP, offsets.shape)}
        for call in ("shadow_place({}, offset, n)", "shadow_point({}, p, n)"):
            found = evaluate(device, "lib/shadow.glsl", f"{call.format(text)}.position", inputs, 3)
            if "place" in call:
                expected = found
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("kind", ["SHADOW_CUBE", "SHADOW_CONE", "SHADOW_PARALLEL"])
def test_a_map_in_other_units_from_an_origin_in_two_parts_shadows_the_same(device: Device, kind: str) -> None:
    """Units of a power of two and places on a grid: to the bit."""
    random = np.random.default_rng(6)
    points = random.integers(-1024, 1024, (400, 3)) / 1024.0
    record, units = lamp(kind), 4.0
    record["shadow_rounding"] = 1e-3
    is_parallel = kind == "SHADOW_PARALLEL"
    texels = random.uniform(-1.0, 1.0, shape(kind)) if is_parallel else NEAR * random.uniform(0.3, 1.0, shape(kind))
    other = record.copy()
    other["shadow_scale"] = units
    other["shadow_origin"] -= 0.25
    other["shadow_origin_rest"] = 0.25
    other["shadow_rounding"] *= units
    lengths = ("shadow_extent", "shadow_centre") if is_parallel else ("shadow_near",)
    for name in lengths:
        other[name] *= units
    found = share(device, record, texels, points)
    assert 0.05 < found.mean() < 0.95
    np.testing.assert_array_equal(share(device, other, units * texels if is_parallel else texels, points), found)
