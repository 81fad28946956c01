# SPDX-License-Identifier: GPL-3.0-or-later
"""The light tree: a partition of unity in the point's place, within its tolerance of the full sum."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import room, unit
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.form_factor import paired_form_factor, polygon_form_factor
from vlm_addon.core.light_clusters import cluster_irradiance, light_clusters
from vlm_addon.core.light_cut import cut_irradiance, light_cut
from vlm_addon.core.light_mesh import VirtualLightMesh, empty_light_mesh
from vlm_addon.core.light_tree import ROOT, LightTree, build_light_tree
from vlm_addon.core.light_tree_bounds import facing_height, horizon_height
from vlm_addon.core.light_tree_error import tree_errors
from vlm_addon.core.scene import Float64


def column(x: float, y: float, radius: float, sides: int, rows: int) -> Float64:
    """(2 sides rows, 3, 3) an upright column from z = 0 to 1 that shines outwards."""
    angles = 2.0 * np.pi * np.arange(sides + 1) / sides
    rim = np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=-1)
    quads = [
        [[*rim[i], low], [*rim[i + 1], low], [*rim[i + 1], low + 1 / rows], [*rim[i], low + 1 / rows]]
        for i in range(sides)
        for low in np.arange(rows) / rows
    ]
    return np.array(quads)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)


def hall(cuts: int) -> VirtualLightMesh:
    """A closed cube of metre side with two columns, cut into lights of like size."""
    columns = [column(x, 0.6, 0.08, 2 * cuts // 3, cuts) for x in (0.3, 0.7)]
    return lights_from_triangles(np.concatenate([room(cuts), *columns]))


def smooth_radiosity(lights: VirtualLightMesh) -> Float64:
    wave = 1.0 + 0.5 * np.sin(lights.corners.mean(axis=1) @ [3.0, 2.0, 4.0])
    return wave[:, None] * [0.5, 0.4, 0.3]


def patch_radiosity(lights: VirtualLightMesh) -> Float64:
    """One small patch of a column and the wall behind it is lit."""
    distance = np.linalg.norm(lights.corners.mean(axis=1) - [0.3, 0.7, 0.5], axis=1)
    return np.maximum(1.0 - distance / 0.2, 0.0)[:, None] * [1.0, 0.5, 0.2]


def surface_points(lights: VirtualLightMesh, count: int) -> tuple[Float64, Float64]:
    random = np.random.default_rng(3)
    chosen = random.choice(len(lights), count, p=lights.areas / lights.areas.sum())
    weights = random.dirichlet([1, 1, 1], count)
    normals = unit(lights.area_vectors[chosen])
    return np.einsum("nk,nkc->nc", weights, lights.corners[chosen]) + 1e-6 * normals, normals


@pytest.fixture(scope="module")
def lights() -> VirtualLightMesh:
    return hall(12)


@pytest.fixture(scope="module")
def tree(lights: VirtualLightMesh) -> LightTree:
    return build_light_tree(lights)


def chain(tree: LightTree, light: int) -> list[int]:
    cluster, found = int(tree.light_parent[light]), []
    while cluster != ROOT:
        found.append(cluster)
        cluster = int(tree.parent[cluster])
    return found


def test_every_light_is_in_a_cluster_that_holds_it(lights: VirtualLightMesh, tree: LightTree) -> None:
    for light in range(0, len(lights), 97):
        line = chain(tree, light)
        assert line
        assert (np.diff(tree.level[line]) >= 1).all()
        for cluster in line:
            reach = np.linalg.norm(lights.corners[light] - tree.centroid[cluster], axis=1).max()
            assert reach <= tree.radius[cluster] * (1 + 1e-12)


def test_sums_reach_the_roots(lights: VirtualLightMesh, tree: LightTree) -> None:
    total = tree.sums(lights.areas[None, tree.light_order])[0]
    assert total[tree.roots].sum() == pytest.approx(lights.areas.sum(), rel=1e-12)


def test_weights_along_every_line_to_the_root_add_up_to_one(lights: VirtualLightMesh, tree: LightTree) -> None:
    clusters = light_clusters(tree, lights, smooth_radiosity(lights), 0.05)
    points, _ = surface_points(lights, 20)
    cut = light_cut(tree, clusters.window, points)
    assert len(cut.clusters)
    of_lights = np.zeros((len(points), len(lights)))
    of_lights[cut.light_points, cut.lights] = cut.light_weights
    of_clusters = np.zeros((len(points), len(tree)))
    of_clusters[cut.cluster_points, cut.clusters] = cut.cluster_weights
    assert of_clusters.min() >= -1e-15
    for light in range(len(lights)):
        total = of_lights[:, light] + of_clusters[:, chain(tree, light)].sum(axis=1)
        np.testing.assert_allclose(total, 1.0, atol=1e-12)


def test_bounds_hold_for_every_light(lights: VirtualLightMesh, tree: LightTree) -> None:
    """No light is higher over a point's horizon, and no point higher over a light, than the cluster's bounds say."""
    random = np.random.default_rng(5)
    points, normals = random.uniform(-0.5, 1.5, (40, 3)), unit(random.normal(size=(40, 3)))
    facing = unit(lights.area_vectors)
    for light in range(0, len(lights), 97):
        over_light = ((points - lights.corners[light, 0]) * facing[light]).sum(axis=1)
        over_ground = np.einsum("nkc,nc->nk", lights.corners[light] - points[:, None], normals).max(axis=1)
        for cluster in chain(tree, light):
            shapes = tree.shapes.take(np.full(40, cluster))
            assert (over_light <= facing_height(shapes, points) + 1e-12).all()
            assert (over_ground <= horizon_height(shapes, points, normals) + 1e-12).all()


def test_bounds_are_nested(tree: LightTree) -> None:
    """What gives a point nothing holds only what gives it nothing."""
    random = np.random.default_rng(6)
    inner = np.flatnonzero(tree.parent != ROOT)
    for _ in range(20):
        points = np.tile(random.uniform(-0.5, 1.5, 3), (len(tree), 1))
        normals = np.tile(unit(random.normal(size=3)), (len(tree), 1))
        for heights in (facing_height(tree.shapes, points), horizon_height(tree.shapes, points, normals)):
            assert (heights[inner] <= heights[tree.parent[inner]] + 1e-12).all()


@pytest.mark.parametrize("radiosity_of", [smooth_radiosity, patch_radiosity])
def test_what_is_left_out_gives_nothing(lights: VirtualLightMesh, tree: LightTree, radiosity_of: object) -> None:
    """Every pair that has a weight, whichever way it faces, adds up to the same to the last bits."""
    radiosity = radiosity_of(lights)  # type: ignore[operator]
    clusters = light_clusters(tree, lights, radiosity, 0.05)
    points, normals = surface_points(lights, 60)
    normals[::3] = unit(np.random.default_rng(1).normal(size=(20, 3)))
    found = cut_irradiance(tree, clusters, lights, radiosity, points, normals, np.zeros(60, np.int32))
    cut = light_cut(tree, clusters.window, points)
    every = np.zeros((60, 3))
    factors = paired_form_factor(points[cut.light_points], normals[cut.light_points], lights.corners[cut.lights])
    np.add.at(every, cut.light_points, (cut.light_weights * factors)[:, None] * radiosity[cut.lights])
    at, of = cut.cluster_points, cut.clusters
    irradiance = cut.cluster_weights * cluster_irradiance(tree, clusters, of, points[at], normals[at])
    np.add.at(every, at, irradiance[:, None] * clusters.colour[of])
    np.testing.assert_allclose(found.irradiance, every, atol=1e-15 * len(lights), rtol=0.0)
    assert (found.evaluated <= found.visited).all()
    assert found.visited.sum() < 0.7 * len(cut.lights) + len(cut.clusters)


def test_chosen_lights_and_the_others_are_the_whole(lights: VirtualLightMesh) -> None:
    chosen = np.arange(len(lights)) % 3 == 0
    radiosity = smooth_radiosity(lights)
    points, normals = surface_points(lights, 40)
    found = np.zeros((40, 3))
    for part in (chosen, ~chosen):
        tree = build_light_tree(lights, part)
        np.testing.assert_array_equal(tree.light_parent != ROOT, part)
        clusters = light_clusters(tree, lights, radiosity, 0.02)
        found += cut_irradiance(tree, clusters, lights, radiosity, points, normals, np.zeros(40, np.int32)).irradiance
    full = polygon_form_factor(points, normals, lights.corners) @ radiosity
    assert np.abs(found - full).max() < 0.06 * full.max()


def test_children_are_listed_in_order(lights: VirtualLightMesh, tree: LightTree) -> None:
    for cluster in range(0, len(tree), 53):
        children = np.arange(tree.child_offsets[cluster], tree.child_offsets[cluster + 1])
        members = tree.light_order[tree.light_offsets[cluster] : tree.light_offsets[cluster + 1]]
        np.testing.assert_array_equal(children, np.flatnonzero(tree.parent == cluster))
        np.testing.assert_array_equal(np.sort(members), np.flatnonzero(tree.light_parent == cluster))
    assert len(tree.light_order) == len(lights)


def test_memory_is_a_part_of_what_is_allowed(lights: VirtualLightMesh, tree: LightTree) -> None:
    """30 MB for 100,000 lights."""
    clusters = light_clusters(tree, lights, smooth_radiosity(lights), 0.02)
    assert tree.nbytes + clusters.nbytes < 300 * len(lights)


def test_relighting_changes_steadily(lights: VirtualLightMesh, tree: LightTree) -> None:
    radiosity = smooth_radiosity(lights)
    nudged = radiosity * (1.0 + 1e-7 * np.sin(np.arange(len(lights))))[:, None]
    before, after = (light_clusters(tree, lights, values, 0.02) for values in (radiosity, nudged))
    for name in ("power", "mean", "axes", "flux", "window", "colour"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), rtol=1e-5, atol=1e-6, err_msg=name)


@pytest.mark.parametrize("lamp", [False, True])
@pytest.mark.parametrize("tolerance", [0.01, 0.02, 0.1])
def test_a_plain_box_stays_within_the_tolerance(tolerance: float, lamp: bool) -> None:
    """Like walls err alike, so that errors do not cancel."""
    box = lights_from_triangles(0.5 + 1.02 * (room(20) - 0.5))
    centroids = box.corners.mean(axis=1)
    radiosity = np.repeat(1.0 + 0.5 * np.sin(7.0 * centroids.sum(axis=1, keepdims=True)), 3, axis=1)
    if lamp:
        radiosity[np.linalg.norm(centroids - (0.0, 0.6, 0.4), axis=1) > 0.25] = 0.0
    points, normals = surface_points(lights_from_triangles(room(1)), 200)
    tree = build_light_tree(box)
    structure = tree, light_clusters(tree, box, radiosity, tolerance)
    errors = tree_errors([structure], box, radiosity, points, normals, np.zeros(200, np.int32))
    assert errors.within(tolerance)


@pytest.mark.parametrize("radiosity_of", [smooth_radiosity, patch_radiosity])
@pytest.mark.parametrize("tolerance", [0.01, 0.3])
def test_windows_are_nested(lights: VirtualLightMesh, tree: LightTree, tolerance: float, radiosity_of: object) -> None:
    """So that a parent's weight is nowhere less than a cluster's, whatever the point."""
    window = light_clusters(tree, lights, radiosity_of(lights), tolerance).window  # type: ignore[operator]
    inner = np.flatnonzero(tree.parent != ROOT)
    outer = tree.parent[inner]
    apart = np.linalg.norm(tree.centroid[inner] - tree.centroid[outer], axis=1)
    assert (window > 0.0).all()
    assert (window[outer] >= window[inner] + apart).all()


@pytest.fixture(scope="module")
def factors(lights: VirtualLightMesh) -> tuple[Float64, Float64, Float64]:
    """Points and normals, and the form factors of all lights there."""
    points, normals = surface_points(lights, 120)
    return points, normals, polygon_form_factor(points, normals, lights.corners)


@pytest.mark.parametrize("radiosity_of", [smooth_radiosity, patch_radiosity])
@pytest.mark.parametrize("tolerance", [0.01, 0.02, 0.05, 0.1])
def test_error_stays_within_the_tolerance(
    lights: VirtualLightMesh,
    tree: LightTree,
    tolerance: float,
    radiosity_of: object,
    factors: tuple[Float64, Float64, Float64],
) -> None:
    radiosity = radiosity_of(lights)  # type: ignore[operator]
    points, normals, shares = factors
    full = shares @ radiosity
    clusters = light_clusters(tree, lights, radiosity, tolerance)
    tags = np.zeros(len(points), np.int32)
    found = cut_irradiance(tree, clusters, lights, radiosity, points, normals, tags).irradiance
    reference = np.maximum(full.sum(axis=1), 0.1 * full.sum(axis=1).mean())
    error = np.abs(found - full).sum(axis=1) / reference
    assert np.quantile(error, 0.95) <= tolerance
    assert np.quantile(error, 0.999) <= 3.0 * tolerance


def test_a_coarser_tolerance_evaluates_less(lights: VirtualLightMesh, tree: LightTree) -> None:
    radiosity = smooth_radiosity(lights)
    points, normals = surface_points(lights, 40)
    tags = np.zeros(len(points), np.int32)
    evaluated = []
    for tolerance in (0.001, 0.01, 0.1):
        clusters = light_clusters(tree, lights, radiosity, tolerance)
        cut = cut_irradiance(tree, clusters, lights, radiosity, points, normals, tags)
        evaluated.append(cut.evaluated.mean())
    assert len(lights) > evaluated[0] > evaluated[1] > evaluated[2]
    assert evaluated[2] < 0.1 * len(lights)


def test_a_line_over_the_wall_has_no_step(lights: VirtualLightMesh, tree: LightTree) -> None:
    """Steps between neighbours shrink with their distance everywhere, so there is no jump anywhere."""
    radiosity = smooth_radiosity(lights)
    clusters = light_clusters(tree, lights, radiosity, 0.1)

    def largest_step(count: int) -> float:
        points = np.column_stack([np.linspace(0.2, 0.5, count), np.full(count, 0.31), np.full(count, 1e-4)])
        normals = np.tile((0.0, 0.0, 1.0), (count, 1))
        tags = np.zeros(count, np.int32)
        values = cut_irradiance(tree, clusters, lights, radiosity, points, normals, tags).irradiance
        return float(np.abs(np.diff(values.sum(axis=1))).max())

    assert largest_step(801) < 0.6 * largest_step(401)


def test_lights_of_the_own_tag_give_exactly_nothing(lights: VirtualLightMesh) -> None:
    tagged = lights_from_triangles(lights.corners, tag_ids=np.where(np.arange(len(lights)) < len(lights) // 2, 7, 0))
    tree = build_light_tree(tagged)
    radiosity = np.where(tagged.tag_ids[:, None] == 7, 1.0, 0.0) * np.ones(3)
    clusters = light_clusters(tree, tagged, radiosity, 0.1)
    points, normals = surface_points(tagged, 50)
    own = cut_irradiance(tree, clusters, tagged, radiosity, points, normals, np.full(50, 7, np.int32)).irradiance
    others = cut_irradiance(tree, clusters, tagged, radiosity, points, normals, np.full(50, 5, np.int32)).irradiance
    assert not own.any()
    assert others.any()


def test_a_flat_cluster_far_away_is_its_lights(tree: LightTree, lights: VirtualLightMesh) -> None:
    """A wall's clusters have one normal, so they differ from their lights by second order in their size only."""
    wall = lights_from_triangles(lights.corners[:100])
    own = build_light_tree(wall)
    radiosity = np.ones((len(wall), 3))
    clusters = light_clusters(own, wall, radiosity, 0.02)
    direction = unit(np.array([0.3, 0.4, 0.8]))
    points = 30.0 * direction[None]
    full = float(polygon_form_factor(points, -direction[None], wall.corners).sum()) * 3.0
    roots = np.flatnonzero(own.parent == ROOT)
    towards = np.repeat(points, len(roots), axis=0), np.repeat(-direction[None], len(roots), axis=0)
    assert cluster_irradiance(own, clusters, roots, *towards).sum() == pytest.approx(full, rel=2e-3)


def test_no_lights_and_no_power_give_nothing() -> None:
    tree = build_light_tree(empty_light_mesh())
    assert len(tree) == 0
    dark = hall(4)
    dark_tree = build_light_tree(dark)
    clusters = light_clusters(dark_tree, dark, np.zeros((len(dark), 3)), 0.02)
    points, normals = surface_points(dark, 10)
    tags = np.zeros(10, np.int32)
    cut = cut_irradiance(dark_tree, clusters, dark, np.zeros((len(dark), 3)), points, normals, tags)
    assert not cut.irradiance.any()
    assert not cut.evaluated.any()


def odd_lights() -> dict[str, Float64]:
    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return {
        "one": triangle[None],
        "the same twice": np.stack([triangle, triangle]),
        "a thousand in one place": np.tile(triangle, (1000, 1, 1)),
        "without area": np.zeros((5, 3, 3)),
        "dust beside a wall": np.concatenate([triangle[None], 1e-9 * np.tile(triangle, (50, 1, 1))]),
        "far apart": np.stack([triangle, triangle + 1e9, triangle - 1e9]),
        "back to back": np.stack([triangle, triangle[::-1]]),
    }


@pytest.mark.parametrize("name", odd_lights())
def test_odd_light_meshes_are_met(name: str) -> None:
    lights = lights_from_triangles(odd_lights()[name])
    tree, radiosity = build_light_tree(lights), np.ones((len(lights), 3))
    clusters = light_clusters(tree, lights, radiosity, 0.02)
    points = np.array([[0.2, 0.2, 1e-3], [0.2, 0.2, -2.0], [0.3, 0.3, 5.0], [0.0, 0.0, 0.0]])
    normals = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
    found = cut_irradiance(tree, clusters, lights, radiosity, points, normals, np.zeros(4, np.int32)).irradiance
    full = polygon_form_factor(points, normals, lights.corners) @ radiosity
    np.testing.assert_allclose(found, full, rtol=0.02, atol=0.02 * full.mean())


@pytest.mark.parametrize("scale", [2.0**-10, 2.0**10])
def test_scale_changes_nothing(scale: float) -> None:
    small = hall(6)
    large = lights_from_triangles(scale * small.corners)
    points, normals = surface_points(small, 30)
    tags = np.zeros(30, np.int32)
    results = []
    for lights_of, at in ((small, points), (large, scale * points)):
        tree = build_light_tree(lights_of)
        radiosity = smooth_radiosity(small)
        clusters = light_clusters(tree, lights_of, radiosity, 0.05)
        results.append(cut_irradiance(tree, clusters, lights_of, radiosity, at, normals, tags).irradiance)
    np.testing.assert_allclose(results[1], results[0], rtol=1e-6)
