# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/triangle_box.glsl`: no cube that a triangle meets is left out, and none is added that it misses by more than
twice the growth."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from tests.voxel_scenes import soup
from vlm_addon.core.triangle_box import triangles_meet_cubes
from vlm_addon.render.passes.voxelize import growth_of, triangle_records

PATH = "lib/triangle_box.glsl"
COUNT = 20_000
TRIANGLE = "VoxelTriangle(v0, v1, v2, normal)"


def cases(depth, rng):
    """Triangles of every size in 2^depth voxels, and cubes of 1, 2, 4 … voxels along their planes and edges."""
    places = soup(COUNT, depth, rng)
    share = rng.dirichlet((0.4, 0.4, 0.4), COUNT)
    sides = 2.0 ** rng.integers(0, depth - 1, COUNT)
    points = np.einsum("nc,nci->ni", share, places) + rng.normal(size=(COUNT, 3)) * sides[:, None]
    first = np.clip(np.floor(points / sides[:, None]), 0, (1 << depth) / sides[:, None] - 1)
    return places, (first + 0.5) * sides[:, None], 0.5 * sides


def columns(places, depth):
    records = triangle_records(places, depth)
    return {"v0": records[:, 0, :3], "v1": records[:, 1, :3], "v2": records[:, 2, :3], "normal": records[:, :, 3]}


def met(places, centres, halves):
    """As core, for cubes of several sizes."""
    found = np.zeros(len(places), bool)
    for half in np.unique(halves):
        rows = halves == half
        found[rows] = triangles_meet_cubes(places[rows], centres[rows], half)
    return found


@pytest.mark.parametrize("depth", [3, 6, 8, 10])
def test_triangle_meets_cube(device, depth):
    places, centres, halves = cases(depth, np.random.default_rng(depth))
    growth = growth_of(depth)
    inputs = {**columns(places, depth), "centre": centres, "reach": halves + growth}
    found = evaluate(device, PATH, f"float(triangle_meets_cube({TRIANGLE}, centre, reach))", inputs) > 0.5
    assert not (met(places, centres, halves) & ~found).any()
    assert not (found & ~met(places, centres, halves + 2.0 * growth)).any()
    assert 0.1 < found.mean() < 0.9
    # The bound, in voxels.
    assert 2.0 * growth < 1e-3


@pytest.mark.parametrize("depth", [4, 8])
def test_cells_that_meet(device, depth):
    """Eight cells at once are those that meet one by one."""
    places, centres, halves = cases(depth, np.random.default_rng(depth))
    growth = growth_of(depth)
    side = halves  # of cells in a block as large as the cube
    inputs = {**columns(places, depth), "first": (centres - halves[:, None]) / side[:, None], "side": side}
    call = f"float(cells_that_meet({TRIANGLE}, uvec3(first), side, {growth!r}))"
    found = evaluate(device, PATH, call, inputs).astype(int)
    for octant in range(8):
        offset = np.array([octant & 1, octant >> 1 & 1, octant >> 2]) - 0.5
        alone = {**columns(places, depth), "centre": centres + offset * side[:, None], "reach": 0.5 * side + growth}
        expected = evaluate(device, PATH, f"float(triangle_meets_cube({TRIANGLE}, centre, reach))", alone)
        assert np.array_equal(found >> octant & 1, expected.astype(int))


def test_plane_meets(device):
    """Small integers, which float32 adds up without rounding: what touches meets."""
    rng = np.random.default_rng(0)
    normals, points = (rng.integers(-6, 7, (4000, 3)).astype(float) for _ in range(2))
    found = evaluate(device, PATH, "float(plane_meets(normal, point, 2.0))", {"normal": normals, "point": points})
    expected = np.abs(np.einsum("ij,ij->i", normals, points)) <= 2.0 * np.abs(normals).sum(axis=1)
    assert np.array_equal(found > 0.5, expected)
    assert 0.2 < expected.mean() < 0.8


def test_shadows_and_edges_meet(device):
    """Against all corners of the triangle and of the square or cube along each axis."""
    rng = np.random.default_rng(1)
    a, b, c = (rng.integers(-6, 7, (4000, 3)).astype(float) for _ in range(3))

    def overlaps(u, v):
        edge = (b - a)[:, [u, v]]
        axis = np.stack([-edge[:, 1], edge[:, 0]], axis=1)
        heights = [np.einsum("ij,ij->i", axis, corner[:, [u, v]]) for corner in (a, b, c)]
        square = [axis @ np.array([x, y]) for x in (-2.0, 2.0) for y in (-2.0, 2.0)]
        return (np.min(heights, axis=0) <= np.max(square, axis=0)) & (np.max(heights, axis=0) >= np.min(square, axis=0))

    inputs = {"a": a, "b": b, "c": c}
    flat = evaluate(device, PATH, "float(shadows_meet(a.xy, b.xy, c.xy, 2.0))", inputs)
    assert np.array_equal(flat > 0.5, overlaps(0, 1))
    assert 0.2 < flat.mean() < 0.95
    found = evaluate(device, PATH, "float(edge_meets(a, b, c, 2.0))", inputs)
    assert np.array_equal(found > 0.5, overlaps(0, 1) & overlaps(1, 2) & overlaps(2, 0))
    assert 0.1 < found.mean() < 0.9
