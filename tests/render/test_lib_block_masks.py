# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/block_masks.glsl`: the cells of a block that a half ball reaches, as the processor finds them one by one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.active_hemisphere import make_half_balls, overlaps

PATH = "lib/block_masks.glsl"
COUNT = 3000
HALF_BALL = "HalfBall(centre, radius_squared, normal, inverse_normal)"
BITS = np.arange(64)


@pytest.fixture(scope="module")
def rows():
    rng = np.random.default_rng(0)
    return {name: (rng.normal(size=(COUNT, 4))).astype(np.float32) for name in ("a", "b")}


def word(masks, second):
    return (masks >> (32 * second) & 0xFFFFFFFF).astype(float)


def test_least_and_greatest(device, rows):
    a = {"a": rows["a"]}
    assert np.array_equal(evaluate(device, PATH, "least(a)", a), rows["a"].min(axis=1))
    assert np.array_equal(evaluate(device, PATH, "greatest(a)", a), rows["a"].max(axis=1))


def test_row_sums(device, rows):
    a, b = rows["a"], rows["b"]
    found = evaluate(device, PATH, "row_sums(a, b.x, b.y)", rows, 4)
    assert np.array_equal(found, (a + b[:, :1]) + b[:, 1:2])


def test_row_bits(device, rows):
    found = evaluate(device, PATH, "float(row_bits(greaterThan(a, vec4(0.0))))", {"a": rows["a"]})
    assert np.array_equal(found, (rows["a"] > 0.0) @ [1, 2, 4, 8])


def test_axis_terms(device, rows):
    low = rows["a"]
    high = low + np.abs(rows["b"])
    normal = low[:, :1]
    near = np.clip(0.0, low, high)
    expected = {
        "near": near * near,
        "far": np.square(np.maximum(-low, high)),
        "height": np.maximum(normal * low, normal * high),
        "near_height": normal * near,
    }
    for name, values in expected.items():
        found = evaluate(device, PATH, f"axis_terms(low.x, low, high).{name}", {"low": low, "high": high}, 4)
        assert np.array_equal(found, values)


def test_cells_in_block(device):
    counts = np.array([(x, y, z) for x in range(1, 5) for y in range(1, 5) for z in range(1, 5)])
    inside = (counts[:, :1] > BITS % 4) & (counts[:, 1:2] > BITS // 4 % 4) & (counts[:, 2:] > BITS // 16)
    expected = (inside.astype(np.uint64) << BITS.astype(np.uint64)).sum(axis=1)
    for second, name in enumerate("xy"):
        for half in (0, 16):
            call = f"float(cells_in_block(uvec3(counts)).{name} >> {half}u & 0xFFFFu)"
            found = evaluate(device, PATH, call, {"counts": counts.astype(np.float32)})
            assert np.array_equal(found, word(expected, second).astype(int) >> half & 0xFFFF)


def test_block_mask(device):
    """Half balls about blocks of 64 cells and of fewer, against one overlap test for each cell."""
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(COUNT, 3))
    normals[::5] = np.round(rng.uniform(-1.5, 1.5, (len(normals[::5]), 3)))
    normals[~normals.any(axis=1)] = (0.0, 0.0, 1.0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    half_balls = make_half_balls(rng.uniform(-0.5, 0.5, (COUNT, 3)), normals, rng.uniform(0.0, 1.0, COUNT))
    faces = np.cumsum(rng.uniform(0.02, 0.2, (5, 3, COUNT)), axis=0).astype(np.float32) - np.float32(0.4)
    counts = rng.integers(1, 5, (COUNT, 3))
    counts[::2] = 4
    places = np.minimum(np.arange(4)[:, None, None], counts.T - 1)
    low, high = np.take_along_axis(faces, places, 0), np.take_along_axis(faces, places + 1, 0)
    expected = np.zeros(COUNT, np.uint64)
    for bit in BITS:
        cell = np.array([bit % 4, bit // 4 % 4, bit // 16])
        inside = (cell < counts).all(axis=1)
        box = (np.stack([ends[cell[axis], axis] for axis in range(3)]) for ends in (low, high))
        expected |= (inside & overlaps(half_balls, *box)).astype(np.uint64) << np.uint64(bit)
    inputs = {
        "centre": half_balls.centres.T,
        "radius_squared": half_balls.radii_squared,
        "normal": half_balls.normals.T,
        "inverse_normal": half_balls.inverse_normals.T,
        "counts": counts.astype(np.float32),
    }
    for axis, name in enumerate("xyz"):
        inputs |= {f"low_{name}": low[:, axis].T, f"high_{name}": high[:, axis].T}
    boxes = "vec4[3](low_x, low_y, low_z), vec4[3](high_x, high_y, high_z)"
    for second, name in enumerate("xy"):
        for half in (0, 16):
            call = f"float(block_mask({HALF_BALL}, {boxes}, uvec3(counts)).{name} >> {half}u & 0xFFFFu)"
            found = evaluate(device, PATH, call, inputs)
            assert np.array_equal(found, word(expected, second).astype(int) >> half & 0xFFFF)
    counted = np.array([int(mask).bit_count() for mask in expected])
    assert (counted == 0).any()
    assert (counted == 64).any()
    assert ((counted > 0) & (counted < 64)).mean() > 0.2
