# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/light_cluster.glsl` against the float64 forms in `vlm_addon/core`."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import single, unit
from tests.render.rooms import lights_from_triangles
from tests.render.shader_functions import evaluate
from vlm_addon.core.light_clusters import LightClusters, cluster_irradiance, light_clusters
from vlm_addon.core.light_grid import LitTree
from vlm_addon.core.light_tree import LightTree, build_light_tree
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
PointGroup group_of(vec3 centre, vec3 extent, vec3 axis, vec3 bounds) {
    return PointGroup(centre, extent, axis, bounds.x, bounds.y, bounds.z);
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
    most = 1.0 / (np.pi * case.clusters.least_squared[case.rows])
    np.testing.assert_allclose(found / most, exact / most, rtol=1e-3, atol=2e-6)
