# SPDX-License-Identifier: GPL-3.0-or-later
"""Distances to triangles against a dense set of their points, degenerate ones among them."""

from __future__ import annotations

import numpy as np

from vlm_addon.core.triangle_distance import flat_triangles

STEPS = 60


def dense(triangle: np.ndarray) -> np.ndarray:
    u, v = (each.ravel() for each in np.meshgrid(np.linspace(0, 1, STEPS), np.linspace(0, 1, STEPS)))
    weights = np.stack([u, v, 1 - u - v], axis=1)[u + v <= 1 + 1e-12]
    return weights @ triangle


def test_distance_and_nearest_point_are_those_of_a_dense_set() -> None:
    rng = np.random.default_rng(1)
    corners = rng.uniform(-1, 1, (12, 3, 3))
    corners[9, 2] = corners[9, 1]
    corners[10] = corners[10, 0]
    corners[11, 2] = 0.3 * corners[11, 0] + 0.7 * corners[11, 1]
    points = rng.uniform(-2, 2, (40, 3))
    flat = flat_triangles(corners)
    for row, triangle in enumerate(corners):
        which = np.full(len(points), row)
        among = dense(triangle)
        expected = np.linalg.norm(points[:, None] - among, axis=2).min(axis=1)
        spacing = 2.0 * np.linalg.norm(triangle - triangle.mean(axis=0), axis=1).max() / STEPS + 1e-9
        found = np.sqrt(flat.squared_distances(points, which))
        assert (np.abs(found - expected) <= spacing).all()
        nearest = flat.nearest_points(points, which)
        np.testing.assert_allclose(np.linalg.norm(nearest - points, axis=1), found, atol=1e-9)
        assert (np.linalg.norm(nearest[:, None] - among, axis=2).min(axis=1) <= spacing).all()
