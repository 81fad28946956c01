# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/octree_triangles.glsl` against every triangle, one by one, in float64."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.octree_rays import ask_exact, build_exact
from tests.voxel_scenes import box, crossings, soup, surface_points, torus
from vlm_addon.core.brick_triangles import ALL_EXACT, LIFT_SHARE, lattice_step

DEPTH = 6
SIZE = float(1 << DEPTH)
LIFT = LIFT_SHARE * SIZE


def on_lattice(triangles, depth=DEPTH):
    return np.rint(triangles / lattice_step(depth)) * lattice_step(depth)


def room():
    """A room with a block on its floor and a thin wall, all facing where one stands."""
    inside = box((0.5, 0.5, 0.5), (63.5, 60.0, 55.0))[:, ::-1]
    return np.concatenate(
        [inside, box((20.0, 20.0, 0.5), (30.0, 32.0, 20.0)), box((40.0, 10.0, 0.5), (40.1, 50.0, 30.0))]
    )


SHAPES = {
    "torus": lambda: torus(DEPTH),
    "soup": lambda: soup(120, DEPTH, np.random.default_rng(0)),
    "room": room,
}


@pytest.fixture(params=SHAPES)
def shape(request, device):
    """Triangles on the lattice, in voxel coordinates, and bound."""
    triangles = on_lattice(SHAPES[request.param]())
    bound = build_exact(device, [triangles], DEPTH)
    yield triangles
    del bound


def facing_pairs(triangles, count, rng):
    """Surface points in float32 that face each other, as `p`, `n`, `q`, `m`."""
    (p, n), (q, m) = surface_points(triangles, count, rng), surface_points(triangles, count, rng)
    faces = (((q - p) * n).sum(axis=1) > 1e-3) & (((q - p) * m).sum(axis=1) < -1e-3)
    values = (values[faces].astype(np.float32) for values in (p, n, q, m))
    return dict(zip("pnqm", values, strict=True))


def exactly_seen(pairs, triangles):
    starts = pairs["p"].astype(float) + LIFT * pairs["n"]
    return np.isinf(crossings(starts, pairs["q"].astype(float) + LIFT * pairs["m"], triangles)[0])


def test_octree_points_see_everywhere_exact(device, shape):
    pairs = facing_pairs(shape, 20_000, np.random.default_rng(1))
    found = ask_exact(device, f"float(octree_points_see(p, n, q, m, {ALL_EXACT}))", pairs) > 0.5
    expected = exactly_seen(pairs, shape)
    assert (found != expected).mean() <= 1e-3
    assert 0 < expected.sum() < len(expected)


def test_octree_first_hit_is_the_nearest_of_all_triangles(device, shape):
    rng = np.random.default_rng(2)
    places, normals = surface_points(shape, 3000, rng)
    directions = rng.normal(size=places.shape)
    directions *= np.sign((directions * normals).sum(axis=1))[:, None] / np.linalg.norm(directions, axis=1)[:, None]
    inputs = {name: values.astype(np.float32) for name, values in (("p", places), ("n", normals), ("d", directions))}
    hit = ask_exact(device, "vec4(octree_first_hit(p, n, d).place, float(octree_first_hit(p, n, d).found))", inputs, 4)
    starts = inputs["p"].astype(float) + LIFT * inputs["n"]
    fractions, _ = crossings(starts, starts + 2.0 * SIZE * inputs["d"], shape)
    found = hit[:, 3] > 0.5
    assert (found != np.isfinite(fractions)).mean() <= 1e-3
    both = found & np.isfinite(fractions)
    expected = starts[both] + 2.0 * SIZE * fractions[both, None] * inputs["d"][both]
    assert (np.linalg.norm(hit[both, :3] - expected, axis=1) > 1e-2).mean() <= 1e-3
    assert both.any()
