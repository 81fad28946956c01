# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/flux_warp.glsl` against the oracle in core: random maps, black ones, and the ends of the unit square."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from tests.render.shader_functions import evaluate
from vlm_addon.core.flux_warp import choose_parts, importance_pyramid, warp_points
from vlm_addon.core.scene import Float64
from vlm_addon.render.device import Device

FILE = "lib/flux_warp.glsl"
LEVELS = 5
SIDE = 1 << (LEVELS - 1)
BELOW_1 = np.float32(1.0 - 2.0**-24)
PREAMBLE = """
layout(binding = 0) uniform sampler2D flux;
vec4 part_and_place(vec2 weights, float coordinate) {
    int part = choose_part(weights, coordinate);
    return vec4(part, coordinate, 0.0, 0.0);
}
vec4 face_and_place(ivec2 faces, int level, vec2 point) {
    ivec2 face = choose_face(flux, faces, level, point);
    return vec4(face, point);
}
"""
FACES = [(1, 1), (3, 2)]
"""Columns and rows."""


def on_device(device: Device, importance: Float64) -> tuple[moderngl.Texture, list[Float64]]:
    """A texture of flux, red twice what green is, with levels of sums, on unit 0; and those levels."""
    pyramid = importance_pyramid(importance, LEVELS)
    height, width = importance.shape
    texture = device.context.texture((width, height), 4, dtype="f4")
    texture.build_mipmaps(0, LEVELS - 1)
    texture.filter = moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST
    for level, values in enumerate(pyramid):
        image = np.zeros((*values.shape, 4), np.float32)
        image[..., 0], image[..., 1], image[..., 3] = values * (2.0 / 3.0), values / 3.0, 9.0
        texture.write(image.tobytes(), level=level)
    texture.use(0)
    return texture, pyramid


def random_map(faces: tuple[int, int], black: float) -> Float64:
    random = np.random.default_rng(5)
    shape = faces[1] * SIDE, faces[0] * SIDE
    return np.where(random.random(shape) < black, 0.0, 10.0 ** random.uniform(-3.0, 0.0, shape))


def edge_points() -> Float64:
    """All over the unit square, and at its ends."""
    edges = np.array([0.0, 1e-30, 0.5, BELOW_1])
    return np.concatenate(
        [np.random.default_rng(6).random((3000, 2)), np.stack(np.meshgrid(edges, edges), axis=-1).reshape(-1, 2)]
    ).astype(np.float32)


@pytest.mark.parametrize("black", [0.0, 0.9])
@pytest.mark.parametrize("faces", FACES)
def test_points_go_to_the_texels_of_the_oracle_and_never_to_black(
    device: Device, faces: tuple[int, int], black: float
) -> None:
    importance, points = random_map(faces, black), edge_points()
    with device.current():
        texture, pyramid = on_device(device, importance)
        call = f"vec2(warped_texel(flux, ivec2{faces}, {LEVELS}, point))"
        found = evaluate(device, FILE, call, {"point": points}, 2, PREAMBLE).astype(int)
        read = evaluate(device, FILE, "flux_importance(flux, ivec2(at), 0)", {"at": found}, 1, PREAMBLE)
        del texture
    np.testing.assert_allclose(read, importance[found[:, 1], found[:, 0]], rtol=1e-6)
    assert (read > 0.0).all()
    expected = warp_points(pyramid, points.astype(float)).texels
    assert (found == expected).all(axis=1).mean() > 0.998


@pytest.mark.parametrize("black", [(), (0, 4), (2, 5), (0, 1, 2, 3, 4), (1, 2, 3, 4, 5)])
def test_faces_are_chosen_as_the_oracle_does(device: Device, black: tuple[int, ...]) -> None:
    faces, points = FACES[1], edge_points()
    importance = random_map(faces, 0.0)
    for face in black:
        row, column = divmod(face, 3)
        importance[row * SIDE : (row + 1) * SIDE, column * SIDE : (column + 1) * SIDE] = 0.0
    with device.current():
        texture, pyramid = on_device(device, importance)
        call = f"face_and_place(ivec2{faces}, {LEVELS - 1}, point)"
        found = evaluate(device, FILE, call, {"point": points}, 4, PREAMBLE)
        del texture
    rows = choose_parts(pyramid[-1].sum(axis=1), points[:, 1].astype(float))
    columns = choose_parts(pyramid[-1][rows.parts], points[:, 0].astype(float))
    same = (found[:, 0] == columns.parts) & (found[:, 1] == rows.parts)
    assert same.mean() > 0.998
    expected = np.stack([columns.stretched, rows.stretched], axis=1)
    np.testing.assert_allclose(found[same, 2:], expected[same], atol=1e-5)
    assert (pyramid[-1][found[:, 1].astype(int), found[:, 0].astype(int)] > 0.0).all()


def test_a_black_map_ends_somewhere(device: Device) -> None:
    with device.current():
        texture, _ = on_device(device, np.zeros((2 * SIDE, 3 * SIDE)))
        call = f"vec2(warped_texel(flux, ivec2(3, 2), {LEVELS}, point))"
        found = evaluate(device, FILE, call, {"point": edge_points()}, 2, PREAMBLE)
        del texture
    assert ((found >= 0.0) & (found < [3 * SIDE, 2 * SIDE])).all()


WEIGHTS = st.one_of(st.just(0.0), st.floats(2.0**-60, 2.0**60, width=32))
COORDINATES = st.one_of(st.sampled_from([0.0, 0.5, float(BELOW_1)]), st.floats(0.0, float(BELOW_1), width=32))


@hypothesis_settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    arrays.arrays(np.float32, (200, 2), elements=WEIGHTS, fill=st.nothing()),
    arrays.arrays(np.float32, 200, elements=COORDINATES, fill=st.nothing()),
)
def test_parts_are_those_of_the_oracle(device: Device, weights: np.ndarray, coordinates: np.ndarray) -> None:
    usable = weights.any(axis=1)
    weights[~usable] = 1.0
    inputs = {"weights": weights, "coordinate": coordinates}
    found = evaluate(device, FILE, "part_and_place(weights, coordinate)", inputs, 4, PREAMBLE)
    part, place = found[:, 0].astype(int), found[:, 1]
    assert ((place >= 0.0) & (place < 1.0)).all()
    assert (weights[np.arange(len(part)), part] > 0.0).all()
    exact = weights.astype(float)
    back = (part * exact[:, 0] + place * exact[np.arange(len(part)), part]) / exact.sum(axis=1)
    np.testing.assert_allclose(back, coordinates, atol=3e-7)
