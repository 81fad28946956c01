# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/active_hemisphere.glsl` rounds as numpy does: the same bits, so the same lists."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.active_hemisphere import make_half_balls, overlaps

PATH = "lib/active_hemisphere.glsl"
COUNT = 100_000
HALF_BALL = "HalfBall(centre, radius_squared, normal, inverse_normal)"


@pytest.fixture(scope="module")
def vectors():
    rng = np.random.default_rng(0)
    return (rng.normal(size=(2, COUNT, 3)) * 10.0 ** rng.uniform(-4, 4, (2, COUNT, 3))).astype(np.float32)


@pytest.fixture(scope="module")
def cases():
    """Half balls and boxes about them: askew and along the axes, of many sizes, faces and corners on each other."""
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(COUNT, 3)) * 10.0 ** rng.uniform(-6, 0, (COUNT, 3))
    normals[::5] = np.round(rng.uniform(-1.5, 1.5, (len(normals[::5]), 3)))
    normals[~normals.any(axis=1)] = (0.0, 0.0, 1.0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centres = rng.uniform(-0.5, 0.5, (COUNT, 3))
    low = rng.uniform(-0.5, 0.5, (COUNT, 3))
    on_grid = rng.random((COUNT, 1)) < 0.3
    centres, low = (np.where(on_grid, np.round(values * 16.0) / 16.0, values) for values in (centres, low))
    size = np.where(on_grid, 1.0 / 16.0, 10.0 ** rng.uniform(-3, 0, (COUNT, 3)))
    radii = np.where(on_grid[:, 0], np.round(rng.uniform(0.0, 0.6, COUNT) * 16) / 16, rng.uniform(-0.05, 0.6, COUNT))
    half_balls = make_half_balls(centres, normals, radii)
    return half_balls, low.T.astype(np.float32), (low + size).T.astype(np.float32)


def inputs_of(half_balls):
    return {
        "centre": half_balls.centres.T,
        "radius_squared": half_balls.radii_squared,
        "normal": half_balls.normals.T,
        "inverse_normal": half_balls.inverse_normals.T,
    }


def sum_of(v):
    return (v[:, 0] + v[:, 1]) + v[:, 2]


def test_component_sum(device, vectors):
    assert np.array_equal(evaluate(device, PATH, "component_sum(a)", {"a": vectors[0]}), sum_of(vectors[0]))


def test_squared_length(device, vectors):
    expected = sum_of(vectors[0] * vectors[0])
    assert np.array_equal(evaluate(device, PATH, "squared_length(a)", {"a": vectors[0]}), expected)


def test_height_over_plane(device, vectors):
    a, b = vectors
    found = evaluate(device, PATH, "height_over_plane(a, b)", {"a": a, "b": b})
    assert np.array_equal(found, sum_of(a * b))


def test_point_at(device):
    rng = np.random.default_rng(3)
    normal = np.abs(rng.normal(size=(COUNT, 3))).astype(np.float32)
    low = rng.normal(size=(COUNT, 3)).astype(np.float32)
    high = low + rng.exponential(size=(COUNT, 3)).astype(np.float32)
    starts, stops = np.maximum(low, 0) / normal, np.maximum(high, 0) / normal
    t = np.where(rng.random(COUNT) < 0.5, starts[:, 0], rng.exponential(size=COUNT)).astype(np.float32)
    inputs = {"t": t, "normal": normal, "low": low, "high": high, "starts": starts, "stops": stops}
    found = evaluate(device, PATH, "point_at(t, normal, low, high, starts, stops)", inputs, 3)
    time = t[:, None]
    expected = np.where(time >= stops, high, np.where(time < starts, low, np.clip(time * normal, low, high)))
    assert np.array_equal(found, expected)


def test_may_overlap_is_never_wrong_to_say_no(device, cases):
    half_balls, low, high = cases
    inputs = {**inputs_of(half_balls), "low": (low - half_balls.centres).T, "high": (high - half_balls.centres).T}
    found = evaluate(device, PATH, f"float(may_overlap({HALF_BALL}, low, high))", inputs) > 0.0
    near = np.maximum(inputs["low"], np.minimum(inputs["high"], 0.0))
    normal = half_balls.normals.T
    height = sum_of(np.maximum(normal * inputs["low"], normal * inputs["high"]))
    assert np.array_equal(found, (sum_of(near * near) <= half_balls.radii_squared) & (height >= 0.0))
    assert not (overlaps(half_balls, low, high) & ~found).any()
    assert 0.05 < found.mean() < 0.95


def test_half_ball_overlaps(device, cases):
    half_balls, low, high = cases
    inputs = {**inputs_of(half_balls), "low": low.T, "high": high.T}
    found = evaluate(device, PATH, f"float(half_ball_overlaps({HALF_BALL}, low, high))", inputs) > 0.0
    assert np.array_equal(found, overlaps(half_balls, low, high))


def test_plane_overlaps(device, cases):
    """Where the plane cuts the box and the near point is behind it, the disc decides."""
    half_balls, low, high = cases
    low, high = low - half_balls.centres, high - half_balls.centres
    near = np.maximum(low, np.minimum(high, np.float32(0.0)))
    height = np.maximum(half_balls.normals * low, half_balls.normals * high)
    behind = sum_of((half_balls.normals * near).T) < 0.0
    in_ball = sum_of((near * near).T) <= half_balls.radii_squared
    wholly = sum_of(np.square(np.maximum(-low, high)).T) <= half_balls.radii_squared
    rows = np.flatnonzero(behind & (sum_of(height.T) >= 0.0) & in_ball & ~wholly)
    assert len(rows) > 1000
    inputs = {**inputs_of(half_balls.take(rows)), "low": low[:, rows].T, "high": high[:, rows].T}
    found = evaluate(device, PATH, f"float(plane_overlaps({HALF_BALL}, low, high))", inputs) > 0.0
    assert np.array_equal(found, overlaps(half_balls, *cases[1:])[rows])
    assert 0.05 < found.mean() < 0.95
