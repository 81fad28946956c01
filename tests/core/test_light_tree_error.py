# SPDX-License-Identifier: GPL-3.0-or-later
"""The full sum by itself, errors of trees against it, and the estimate for display."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import room, unit
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.light_clusters import light_clusters
from vlm_addon.core.light_cut import cut_irradiance
from vlm_addon.core.light_mesh import VirtualLightMesh, empty_light_mesh
from vlm_addon.core.light_tree import build_light_tree
from vlm_addon.core.light_tree_error import (
    PointErrors,
    expected_error,
    full_irradiance,
    tree_errors,
)
from vlm_addon.core.scene import Float64


def bumpy_box(cuts: int) -> VirtualLightMesh:
    """A box of metre size whose walls are bent, its halves tagged 1 and 2."""
    corners = 0.5 + 1.05 * (room(cuts) - 0.5)
    bent = corners + 0.02 * np.sin(9.0 * corners[..., [1, 2, 0]])
    return lights_from_triangles(bent, tag_ids=1 + (corners.mean(axis=1)[:, 0] > 0.5))


def radiosity_of(lights: VirtualLightMesh) -> Float64:
    return (1.0 + 0.5 * np.sin(lights.corners.mean(axis=1) @ [3.0, 2.0, 4.0]))[:, None] * [0.5, 0.4, 0.3]


def inside(count: int, seed: int = 0) -> tuple[Float64, Float64]:
    """Points on the walls of the box, facing in."""
    random = np.random.default_rng(seed)
    points, normals = random.uniform(0.0, 1.0, (count, 3)), np.zeros((count, 3))
    axis, side = random.integers(0, 3, count), random.integers(0, 2, count)
    points[np.arange(count), axis] = side
    normals[np.arange(count), axis] = 1 - 2 * side
    return points, normals


def test_full_irradiance_is_the_sum_over_all_lights_of_other_tags() -> None:
    lights = bumpy_box(5)
    radiosity = radiosity_of(lights)
    radiosity[::7] = 0.0
    points, normals = inside(60)
    normals[::2] = unit(np.random.default_rng(1).normal(size=(30, 3)))
    tags = np.arange(60, dtype=np.int32) % 3
    factors = polygon_form_factor(points, normals, lights.corners)
    factors[(tags[:, None] == lights.tag_ids) & (tags[:, None] != 0)] = 0.0
    expected = factors @ radiosity
    found = full_irradiance(lights, radiosity, points, normals, tags)
    np.testing.assert_allclose(found, expected, atol=3e-4 * expected.max(), rtol=0.0)


def test_tree_errors_are_those_of_the_cuts_together() -> None:
    lights = bumpy_box(6)
    radiosity = radiosity_of(lights)
    points, normals = inside(50)
    tags = np.zeros(50, np.int32)
    part = np.arange(len(lights)) % 2 == 0
    trees = [build_light_tree(lights, chosen) for chosen in (part, ~part)]
    structures = [(tree, light_clusters(tree, lights, radiosity, 0.05)) for tree in trees]
    cuts = [cut_irradiance(*each, lights, radiosity, points, normals, tags) for each in structures]
    full = full_irradiance(lights, radiosity, points, normals, tags).sum(axis=1)
    expected = np.abs(cuts[0].irradiance + cuts[1].irradiance).sum(axis=1)
    found = tree_errors(structures, lights, radiosity, points, normals, tags)
    np.testing.assert_allclose(found.errors, np.abs(expected - full) / np.maximum(full, 0.1 * full.mean()))
    assert found.evaluated == pytest.approx(sum(cut.evaluated.mean() for cut in cuts))
    assert found.visited == pytest.approx(sum(cut.visited.mean() for cut in cuts))


def test_within_looks_at_both_percentiles() -> None:
    few, many = np.full(10_000, 0.01), np.full(10_000, 0.01)
    few[:5], many[:20] = 1.0, 1.0
    assert PointErrors(few, 0.0, 0.0).within(0.01)
    assert not PointErrors(many, 0.0, 0.0).within(0.01)
    assert not PointErrors(few, 0.0, 0.0).within(0.009)


def test_no_points_and_no_lights_err_by_nothing() -> None:
    lights = empty_light_mesh()
    nothing = np.zeros((0, 3))
    errors = tree_errors([], lights, nothing, nothing, nothing, np.zeros(0, np.int32))
    assert errors.within(0.0)
    points, normals = inside(3)
    assert not full_irradiance(lights, nothing, points, normals, np.zeros(3, np.int32)).any()


@pytest.mark.parametrize("tolerance", [0.01, 0.05])
def test_the_estimate_is_seldom_exceeded_and_of_the_errors_size(tolerance: float) -> None:
    """At most one point in twenty errs by more; and one in twenty by more than a tenth of the largest estimates."""
    lights = bumpy_box(14)
    radiosity = radiosity_of(lights)
    points, normals = inside(300)
    tree = build_light_tree(lights)
    clusters = light_clusters(tree, lights, radiosity, tolerance)
    tags = np.zeros(len(points), np.int32)
    cut = cut_irradiance(tree, clusters, lights, radiosity, points, normals, tags)
    full = full_irradiance(lights, radiosity, points, normals, tags)
    errors = np.abs((cut.irradiance - full).sum(axis=1))
    expected = expected_error(tree, clusters, points)
    assert (errors > expected).mean() <= 0.05
    assert np.quantile(errors, 0.95) > 0.1 * np.quantile(expected, 0.95)


def test_the_estimate_is_nothing_where_every_light_counts_by_itself() -> None:
    lights = bumpy_box(3)
    tree = build_light_tree(lights)
    clusters = light_clusters(tree, lights, radiosity_of(lights), 1e-9)
    assert not expected_error(tree, clusters, inside(20)[0]).any()


def test_the_estimate_grows_with_the_tolerance() -> None:
    lights = bumpy_box(10)
    tree, radiosity, points = build_light_tree(lights), radiosity_of(lights), inside(100)[0]
    means = [
        expected_error(tree, light_clusters(tree, lights, radiosity, t), points).mean() for t in (0.001, 0.01, 0.1)
    ]
    assert means[0] < means[1] < means[2]
