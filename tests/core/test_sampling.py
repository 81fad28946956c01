# SPDX-License-Identifier: GPL-3.0-or-later
"""Source samples: even, on the surface, enough, and the same every time."""

from __future__ import annotations

import numpy as np
import pytest

from tests.core.surface_shapes import grid, icosphere
from vlm_addon.core.mesh_topology import Rows, rows_by_key
from vlm_addon.core.sampling import (
    MAXIMUM_SAMPLES,
    MINIMUM_SAMPLES,
    sample_counts,
    sample_regions,
    square_to_triangle,
)


def test_counts_grow_with_area_between_their_limits() -> None:
    counts = sample_counts(np.array([0.0, 1e-6, 0.5, 1.0, 1.0, 2.0, 1e9]), 16)
    np.testing.assert_array_equal(counts, [MINIMUM_SAMPLES, MINIMUM_SAMPLES, 8, 16, 16, 32, MAXIMUM_SAMPLES])


@pytest.mark.parametrize("wanted", [1, 3, 500])
def test_counts_follow_the_setting_beyond_the_limits(wanted: int) -> None:
    np.testing.assert_array_equal(sample_counts(np.ones(3), wanted), [wanted] * 3)


def test_square_to_triangle_keeps_area_and_stays_inside() -> None:
    cells = (np.arange(400) + 0.5) / 400
    x, y = (part.ravel() for part in np.meshgrid(cells, cells))
    weights = square_to_triangle(x, y)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    # Each half-size triangle at a corner holds a quarter of the area.
    np.testing.assert_allclose((weights > 0.5).mean(axis=0), 0.25, atol=2e-3)


def test_weights_sum_to_one_and_points_lie_on_their_triangles() -> None:
    positions, triangles = icosphere(2)
    light = np.arange(len(triangles)) % 7
    samples = sample_regions(positions[triangles], rows_by_key(light, 7), np.arange(4, 11))
    np.testing.assert_array_equal(np.diff(samples.offsets), np.arange(4, 11))
    np.testing.assert_allclose(np.add.reduceat(samples.weights, samples.offsets[:-1]), 1.0, rtol=1e-6)
    normals = np.cross(*[(positions[triangles[:, k]] - positions[triangles[:, 0]]) for k in (1, 2)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    heights = np.einsum("tj,sj->st", normals, samples.positions) - np.einsum(
        "tj,tj->t", normals, positions[triangles[:, 0]]
    )
    owner = np.repeat(np.arange(7), np.diff(samples.offsets))
    alike = samples.normals @ normals.T > 1 - 1e-6
    assert (alike & (np.abs(heights) < 1e-9) & (light[None] == owner[:, None])).any(axis=1).all()


def test_mean_over_the_samples_is_the_mean_over_the_surface() -> None:
    positions, triangles = grid(8, 8)
    samples = sample_regions(positions[triangles], rows_by_key(np.zeros(len(triangles), np.int64), 1), np.array([256]))
    function = np.sin(3 * samples.positions[:, 0]) * np.cos(2 * samples.positions[:, 1])
    exact = (1 - np.cos(3)) / 3 * np.sin(2) / 2
    # Random points would be off by 0.013.
    assert function @ samples.weights == pytest.approx(exact, abs=2e-3)


def test_half_shadowed_triangle_is_half_lit() -> None:
    corners = np.array([[[0, 0, 0], [2, 0, 0], [0, 2, 0]]], float)
    for count in (16, 64):
        samples = sample_regions(corners, Rows(np.array([0]), np.array([0, 1])), np.array([count]))
        # The line x + y = sqrt(2) halves the area.
        lit = samples.positions[:, :2].sum(axis=1) < np.sqrt(2)
        assert float(samples.weights[lit].sum()) == pytest.approx(0.5, abs=1.5 / np.sqrt(count) / 2)


def test_parts_of_a_region_get_samples_by_area() -> None:
    corners = np.array([[[0, 0, 0], [3, 0, 0], [0, 1, 0]], [[5, 0, 0], [6, 0, 0], [5, 1, 0]]], float)
    samples = sample_regions(corners, rows_by_key(np.zeros(2, np.int64), 1), np.array([16]))
    assert (samples.positions[:, 0] < 4).sum() == 12


def test_light_without_a_region_has_no_samples_and_one_without_area_still_has() -> None:
    corners = np.array([[[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0, 0], [1, 0, 0], [0, 1, 0]]], float)
    samples = sample_regions(corners, rows_by_key(np.array([0, 2]), 3), np.array([4, 4, 4]))
    np.testing.assert_array_equal(np.diff(samples.offsets), [4, 0, 4])
    assert np.isfinite(samples.positions).all()
    assert np.isfinite(samples.normals).all()
