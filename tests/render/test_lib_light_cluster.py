# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/light_cluster.glsl` against the float64 forms in `vlm_addon/core`."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import single, unit
from tests.render import point_groups
from tests.render.point_groups import GROUP, group_inputs
from tests.render.rooms import lights_from_triangles
from tests.render.shader_functions import evaluate
from vlm_addon.core.light_clusters import FADE, LightClusters, cluster_irradiance, light_clusters
from vlm_addon.core.light_grid import LitTree
from vlm_addon.core.light_tree import ROOT, LightTree, build_light_tree
from vlm_addon.core.light_tree_bounds import facing_height, horizon_height
from vlm_addon.render.device import Device
from vlm_addon.render.light_forest import make_forest
from vlm_addon.render.local_space import LocalSpace

PATH = "lib/light_cluster.glsl"
ROWS = 4000
Array = np.ndarray

PREAMBLE = """
LightNode node_of(vec3 c, float w, vec3 a, float plane, vec3 m, vec3 h, vec2 cone) {
    return LightNode(c, w, a, plane, m, cone.x, h, cone.y, 0u, 0u, 0u, 0u);
}
LightCluster cluster_of(vec3 m, vec3 x, vec3 y, float least, vec3 n, vec3 v, vec3 cv, vec3 pc, float pw) {
    return LightCluster(m, 0, x, pw, y, least, n, v, cv, vec3(0.0), pc);
}
"""
NODE = "node_of(c, w, a, plane, middle, half_extent, cone)"
CLUSTER = "cluster_of(mean, x_axis, y_axis, least, mean_normal, variances, covariances, parent_centre, parent_window)"


class Clusters:
    """Clusters of 400 random lights, and rows of them with everything that the shader's structs hold."""

    def __init__(self, scale: float = 1.0, seed: int = 3) -> None:
        self.random = np.random.default_rng(seed)
        centres = self.random.uniform(-1.0, 1.0, (400, 1, 3))
        # Half of them in one plane, as on a wall.
        centres[:200, :, 2] = -1.0
        corners = centres + 0.05 * self.random.normal(size=(400, 3, 3))
        corners[:200, :, 2] = -1.0
        self.corners = scale * corners
        self.lights = lights_from_triangles(self.corners)
        self.radiosity = self.random.uniform(0.0, 3.0, (400, 3))
        self.tree: LightTree = build_light_tree(self.lights)
        self.clusters: LightClusters = light_clusters(self.tree, self.lights, self.radiosity, 0.02)
        self.rows = self.random.integers(0, len(self.tree), ROWS)
        forest = make_forest([LitTree(self.tree, self.clusters)], LocalSpace(np.zeros(3), 1.0), 400)
        self.nodes, self.records = forest.nodes[self.rows], forest.clusters[self.rows]

    def points(self, nearest: float = 0.0, farthest: float = 6.0) -> Array:
        """(ROWS, 3), so many radii from the centroids."""
        away = unit(self.random.normal(size=(ROWS, 3))) * self.random.uniform(nearest, farthest, (ROWS, 1))
        return single(self.tree.centroid[self.rows] + self.tree.radius[self.rows, None] * away)

    def normals(self) -> Array:
        return single(unit(self.random.normal(size=(ROWS, 3))))

    def inputs(self) -> dict[str, Array]:
        node, cluster = self.nodes, self.records
        return {
            "c": node["centre"],
            "w": node["window"],
            "a": node["axis"],
            "plane": node["plane"],
            "middle": node["middle"],
            "half_extent": node["half_extent"],
            "cone": np.column_stack([node["cone_cos"], node["cone_sin"]]),
            "mean": cluster["mean"],
            "x_axis": cluster["first_axis"],
            "y_axis": cluster["second_axis"],
            "least": cluster["least_squared"],
            "mean_normal": cluster["normal"],
            "variances": cluster["variances"],
            "covariances": cluster["covariances"],
            "parent_centre": cluster["parent_centre"],
            "parent_window": cluster["parent_window"],
        }

    def call(self, device: Device, expression: str, points: Array, normals: Array, components: int = 1) -> Array:
        values = {"p": points, "n": normals, **self.inputs()}
        return evaluate(device, PATH, expression, values, components, preamble=PREAMBLE)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e3])
def test_cluster_factor_is_what_the_processor_computes(device: Device, scale: float) -> None:
    case = Clusters(scale)
    points, normals = case.points(), case.normals()
    found = case.call(device, f"cluster_factor({NODE}, {CLUSTER}, p, n)", points, normals)
    exact = cluster_irradiance(case.tree, case.clusters, case.rows, points, normals) / case.clusters.power[case.rows]
    assert (exact > 0.0).mean() > 0.2
    squared = ((points - case.tree.centroid[case.rows]) ** 2).sum(axis=1) + case.tree.radius[case.rows] ** 2
    # As a share of what the cluster would give if it faced the point squarely.
    np.testing.assert_allclose(np.pi * squared * found, np.pi * squared * exact, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("nearness", [0.0, 1e-20, 1e-7, 1e-3])
def test_a_point_that_touches_a_cluster_gets_no_more_than_its_lights_give(device: Device, nearness: float) -> None:
    """At one of the four points itself, and a little away from it."""
    case = Clusters()
    touched = case.records["mean"] + case.records["first_axis"]
    points = single(touched + nearness * unit(case.random.normal(size=(ROWS, 3))))
    found = case.call(device, f"cluster_factor({NODE}, {CLUSTER}, p, n)", points, case.normals())
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()
    radiosity = 1.0 / (np.pi * case.records["least_squared"])
    assert (found <= 1.001 * radiosity).all()


def test_most_in_front_and_greatest_height_are_the_processors(device: Device) -> None:
    case = Clusters()
    points, normals = case.points(), case.normals()
    shapes = case.tree.shapes.take(case.rows)
    front = case.call(device, f"most_in_front({NODE}, p)", points, normals)
    assert front == pytest.approx(facing_height(shapes, points), abs=1e-5)
    height = case.call(device, f"greatest_height({NODE}, p, n)", points, normals)
    assert height == pytest.approx(horizon_height(shapes, points, normals), abs=1e-5)


def test_window_weight_falls_from_one_to_zero_over_the_fade(device: Device) -> None:
    distances = np.linspace(0.0, 3.0, 1001, dtype=np.float32)
    points = np.column_stack([distances, np.zeros((1001, 2), np.float32)])
    found = evaluate(device, PATH, "window_weight(p, vec3(0.0), 2.0)", {"p": points})
    assert (found[distances <= 2.0] == 1.0).all()
    assert (found[distances >= 2.0 * (1.0 + FADE)] == 0.0).all()
    assert (np.diff(found) <= 0.0).all()
    assert found[np.abs(distances - 2.0 * (1.0 + 0.5 * FADE)).argmin()] == pytest.approx(0.5, abs=0.01)


def test_weights_of_lights_and_clusters_add_up_to_one(device: Device) -> None:
    """A light's own cluster's window and the weights of all clusters up to the root."""
    case = Clusters()
    points = single(case.random.uniform(-1.5, 1.5, (60, 3)))
    every = np.arange(len(case.tree))
    forest = make_forest([LitTree(case.tree, case.clusters)], LocalSpace(np.zeros(3), 1.0), 400)
    inputs = {
        "p": np.repeat(points, len(every), axis=0),
        **{
            name: np.tile(values, (len(points), 1) if np.ndim(values) > 1 else len(points))
            for name, values in {
                "c": forest.nodes["centre"],
                "w": forest.nodes["window"],
                "pc": forest.clusters["parent_centre"],
                "pw": forest.clusters["parent_window"],
            }.items()
        },
    }
    zero = "vec3(0.0)"
    node = f"node_of(c, w, {zero}, 0.0, {zero}, {zero}, vec2(0.0))"
    cluster = f"cluster_of({zero}, {zero}, {zero}, 0.0, {zero}, {zero}, {zero}, pc, pw)"
    weights = evaluate(device, PATH, f"cluster_weight({node}, {cluster}, p)", inputs, preamble=PREAMBLE)
    weights = weights.reshape(len(points), len(every))
    assert (weights >= 0.0).all()
    lights = forest.light_windows
    own = evaluate(
        device,
        PATH,
        "window_weight(p, c, w)",
        {"p": np.repeat(points, 400, axis=0), "c": np.tile(lights[:, :3], (60, 1)), "w": np.tile(lights[:, 3], 60)},
    ).reshape(60, 400)
    total = own.astype(float)
    for light in range(400):
        cluster_row = case.tree.light_parent[light]
        while cluster_row != ROOT:
            total[:, light] += weights[:, cluster_row]
            cluster_row = case.tree.parent[cluster_row]
    assert total == pytest.approx(1.0, abs=2e-5)
    assert ((own > 0.0) & (own < 1.0)).any()


def test_softened_rounds_off_zero_and_leaves_the_rest(device: Device) -> None:
    values = np.linspace(-3.0, 3.0, 601, dtype=np.float32)
    found = evaluate(device, PATH, "softened(v, 2.0)", {"v": values})
    assert (found[values <= -2.0] == 0.0).all()
    assert found[values >= 2.0] == pytest.approx(values[values >= 2.0])
    assert found[300] == pytest.approx(0.5)
    slopes = np.diff(found) / np.diff(values)
    assert slopes == pytest.approx(np.clip((values[1:] + values[:-1] + 4.0) / 8.0, 0.0, 1.0), abs=1e-3)
    assert evaluate(device, PATH, "softened(v, 0.0)", {"v": values}) == pytest.approx(np.maximum(values, 0.0))


@pytest.mark.parametrize("spread", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("extent", [0.0, 0.1, 1.0])
def test_what_gives_nothing_gives_nothing_to_any_point_of_the_group(
    device: Device, extent: float, spread: float
) -> None:
    case, count = Clusters(seed=7), 30
    centres = case.points()[:, None]
    points = single(centres + extent * case.random.uniform(-1.0, 1.0, (ROWS, count, 3)))
    normals = single(unit(case.normals()[:, None] + spread * case.random.normal(size=(ROWS, count, 3))))
    inputs = {**group_inputs(points, normals), **case.inputs()}
    preamble = PREAMBLE + point_groups.PREAMBLE
    call = f"float(cluster_gives_nothing({GROUP}, {NODE}))"
    nothing = evaluate(device, PATH, call, inputs, preamble=preamble).astype(bool)
    rows = np.repeat(case.rows, count)
    exact = cluster_irradiance(case.tree, case.clusters, rows, points.reshape(-1, 3), normals.reshape(-1, 3))
    exact = exact.reshape(ROWS, count) / case.clusters.power[case.rows, None]
    assert exact[nothing].max(initial=0.0) <= 1e-5
    # It is found where it is so, for points that are close together.
    if extent == 0.0 and spread == 0.0:
        shapes = case.tree.shapes.take(case.rows)
        hidden = facing_height(shapes, points[:, 0]) <= 0.0
        hidden |= horizon_height(shapes, points[:, 0], normals[:, 0]) <= 0.0
        assert (nothing == hidden).mean() > 0.999
        assert 0.1 < nothing.mean() < 0.9

    distances = np.linalg.norm(points - case.tree.centroid[case.rows, None], axis=2)
    call = f"vec3(distance_range({GROUP}, c), 0.0)"
    found = evaluate(device, PATH, call, inputs, 3, preamble=preamble)
    assert (found[:, 0] <= distances.min(axis=1) + 1e-5).all()
    assert (found[:, 1] >= distances.max(axis=1) - 1e-5).all()
