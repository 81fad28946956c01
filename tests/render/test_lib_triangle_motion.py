# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/triangle_motion.glsl` against float64."""

from __future__ import annotations

import numpy as np

from tests.render.shader_functions import evaluate
from vlm_addon.render.device import Device

FILE = "lib/triangle_motion.glsl"
COUNT = 400
CORNERS, WAYS = "vec3[3](a, b, c)", "vec3[3](da, db, dc)"
MOVED = f"moved_by(p, {CORNERS}, {WAYS})"


def case(seed: int = 1) -> dict[str, np.ndarray]:
    """Triangles of 1 m some metres from the origin, points in them and ways of their corners."""
    random = np.random.default_rng(seed)
    middle = random.uniform(-9, 9, (COUNT, 3))
    values = {name: middle + random.normal(size=(COUNT, 3)) for name in "abc"}
    shares = random.dirichlet((1, 1, 1), COUNT)
    values["p"] = sum(shares[:, i, None] * values[name] for i, name in enumerate("abc"))
    values |= {f"d{name}": random.normal(size=(COUNT, 3)) for name in "abc"}
    values["shares"] = shares
    return {name: array.astype(np.float32) for name, array in values.items()}


def frame(side: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(n, 3, 3): along, across and normal as columns."""
    along = side / np.linalg.norm(side, axis=1, keepdims=True)
    normal = np.cross(side, other)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([along, np.cross(normal, along), normal], axis=2)


def test_points_move_between_the_corners(device: Device) -> None:
    inputs = case()
    shares = inputs.pop("shares").astype(float)
    wanted = sum(shares[:, i, None] * inputs[f"d{name}"] for i, name in enumerate("abc"))
    side, other = inputs["b"] - inputs["a"], inputs["c"] - inputs["a"]
    round_enough = np.linalg.norm(np.cross(side, other), axis=1) > 0.5
    assert round_enough.sum() > 300
    found = evaluate(device, FILE, MOVED, inputs, 3)
    np.testing.assert_allclose(found[round_enough], wanted[round_enough], atol=2e-5)


def test_corners_that_move_alike_move_all_to_the_bit(device: Device) -> None:
    inputs = case()
    inputs |= {"db": inputs["da"], "dc": inputs["da"]}
    np.testing.assert_array_equal(evaluate(device, FILE, MOVED, inputs, 3), inputs["da"])


def test_no_point_leaves_its_corners_ways(device: Device) -> None:
    """Points beside their triangle, slivers, lines and points: between the corners' ways, and a number."""
    inputs = case()
    random = np.random.default_rng(4)
    inputs["p"] = inputs["p"] + random.normal(size=(COUNT, 3)).astype(np.float32)
    inputs["c"][:100] = inputs["b"][:100]
    inputs["c"][100:200] = 0.5 * (inputs["a"] + inputs["b"])[100:200]
    inputs["b"][:50] = inputs["c"][:50] = inputs["a"][:50]
    found = evaluate(device, FILE, MOVED, inputs, 3)
    ways = np.stack([inputs["da"], inputs["db"], inputs["dc"]])
    assert (found >= ways.min(axis=0) - 1e-5).all()
    assert (found <= ways.max(axis=0) + 1e-5).all()
    np.testing.assert_allclose(found[:50], ways.mean(axis=0)[:50], atol=1e-6)


def test_frames_are_right_handed_and_empty_without_area(device: Device) -> None:
    inputs = case()
    inputs = {"u": inputs["b"] - inputs["a"], "v": inputs["c"] - inputs["a"]}
    inputs["v"][:9] = 2.0 * inputs["u"][:9]
    wanted = frame(inputs["u"].astype(float)[9:], inputs["v"].astype(float)[9:])
    for column in range(3):
        found = evaluate(device, FILE, f"triangle_frame(u, v)[{column}]", inputs, 3)
        assert not found[:9].any()
        np.testing.assert_allclose(found[9:], wanted[..., column], atol=3e-5)


def test_directions_turn_with_the_triangle(device: Device) -> None:
    inputs = case()
    a, b, c = (inputs[name].astype(float) for name in "abc")
    a2, b2, c2 = (inputs[name] + inputs[f"d{name}"].astype(float) for name in "abc")
    turn = frame(b2 - a2, c2 - a2) @ np.swapaxes(frame(b - a, c - a), 1, 2)
    direction = np.random.default_rng(2).normal(size=(COUNT, 3)).astype(np.float32)
    found = evaluate(device, FILE, f"turned_by({CORNERS}, {WAYS}) * n", {**inputs, "n": direction}, 3)
    areas = [np.linalg.norm(np.cross(v, w), axis=1) for v, w in ((b - a, c - a), (b2 - a2, c2 - a2))]
    round_enough = np.minimum(*areas) > 0.2
    assert round_enough.sum() > 300
    np.testing.assert_allclose(found[round_enough], np.einsum("nij,nj->ni", turn, direction)[round_enough], atol=1e-4)
    inputs |= {"db": inputs["da"], "dc": inputs["da"]}
    same = evaluate(device, FILE, f"turned_by({CORNERS}, {WAYS}) * n", {**inputs, "n": direction}, 3)
    np.testing.assert_array_equal(same, direction)
