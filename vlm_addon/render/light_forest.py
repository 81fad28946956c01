# SPDX-License-Identifier: GPL-3.0-or-later
"""Light trees on the GPU: several beside each other, so that static and dynamic lights keep their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..core.light_clusters import LightClusters
from ..core.light_grid import LitTree
from ..core.light_tree import ROOT
from .gpu_layout import LIGHT_CLUSTER, LIGHT_NODE
from .local_space import LocalSpace

if TYPE_CHECKING:
    import moderngl

Uint32 = npt.NDArray[np.uint32]

_OPEN_EVERYWHERE = 1e30
"""Window of the parent that a root has not."""
_DARK = 1e-20
"""Share of the brightest cluster's power below which a cluster is not looked at."""


@dataclass(frozen=True)
class LightForest:
    """Records of all trees, one after the other, in local space.

    nodes, clusters: (c,) of LIGHT_NODE and LIGHT_CLUSTER. roots: rows of `nodes`. light_ids: (m,) rows of the light
    mesh. light_windows: (n, 4) float32, centroid and window of the cluster that each light is in.
    """

    nodes: np.ndarray
    clusters: np.ndarray
    roots: Uint32
    light_ids: Uint32
    light_windows: npt.NDArray[np.float32]


def make_forest(trees: Sequence[LitTree], space: LocalSpace, light_count: int) -> LightForest:
    """light_count: of the light mesh that the trees are of."""
    count = sum(len(lit.tree) for lit in trees)
    nodes, clusters = LIGHT_NODE.zeros(count), LIGHT_CLUSTER.zeros(count)
    roots, light_ids = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    windows = np.zeros((light_count, 4), np.float32)
    first_node = first_light = 0
    for lit in trees:
        own = nodes[first_node : first_node + len(lit.tree)]
        own[:] = _node_records(lit, space, first_node, first_light)
        clusters[first_node : first_node + len(own)] = _cluster_records(lit, space)
        inside = np.flatnonzero(lit.tree.light_parent != ROOT)
        windows[inside] = np.column_stack([own["centre"], own["window"]])[lit.tree.light_parent[inside]]
        roots.append(lit.tree.roots + first_node)
        light_ids.append(lit.tree.light_order.astype(np.int64))
        first_node, first_light = first_node + len(own), first_light + len(inside)
    return LightForest(
        nodes=nodes,
        clusters=clusters,
        roots=np.concatenate(roots).astype(np.uint32),
        light_ids=np.concatenate(light_ids).astype(np.uint32),
        light_windows=windows,
    )


def _node_records(lit: LitTree, space: LocalSpace, first_node: int, first_light: int) -> np.ndarray:
    """Of one tree, whose clusters and lights begin at `first_node` and `first_light`."""
    tree, shapes, scale = lit.tree, lit.tree.shapes, 1.0 / space.unit
    nodes = LIGHT_NODE.zeros(len(tree))
    nodes["centre"] = space.local_points(tree.centroid)
    nodes["window"] = scale * lit.clusters.window
    nodes["axis"] = shapes.axis
    nodes["plane"] = scale * shapes.plane
    nodes["middle"] = space.local_points(0.5 * (shapes.low + shapes.high))
    nodes["half_extent"] = 0.5 * scale * (shapes.high - shapes.low)
    nodes["cone_cos"], nodes["cone_sin"] = shapes.cone.T
    # Nothing of a dark subtree is ever looked at.
    lit_up = ~_dark(lit.clusters)
    for name, offsets, first in (
        ("child", tree.child_offsets, first_node),
        ("light", tree.light_offsets, first_light),
    ):
        nodes[f"first_{name}"] = first + offsets[:-1]
        nodes[f"end_{name}"] = first + np.where(lit_up, offsets[1:], offsets[:-1])
    return nodes


def _dark(clusters: LightClusters) -> npt.NDArray[np.bool_]:
    """(c,) clusters that send out nothing, or nothing that would ever show."""
    return np.asarray(clusters.power <= _DARK * clusters.power.max(initial=0.0))


def _cluster_records(lit: LitTree, space: LocalSpace) -> np.ndarray:
    tree, clusters, scale = lit.tree, lit.clusters, 1.0 / space.unit
    power = np.where(_dark(clusters), 0.0, clusters.power)
    shared = np.where(power > 0.0, 1.0 / np.where(power > 0.0, power, 1.0), 0.0)[:, None]
    spread = clusters.normal_spread * shared[:, :, None] ** 2
    parent = tree.parent
    records = LIGHT_CLUSTER.zeros(len(tree))
    records["mean"] = space.local_points(clusters.mean)
    records["tag_id"] = tree.tag_ids
    records["first_axis"], records["second_axis"] = np.moveaxis(np.sqrt(2.0) * scale * clusters.axes, 1, 0)
    records["parent_window"] = np.where(parent == ROOT, _OPEN_EVERYWHERE, scale * clusters.window[parent])
    records["parent_centre"] = space.local_points(tree.centroid[parent])
    records["least_squared"] = np.where(power > 0.0, scale**2 * clusters.least_squared, 1.0)
    records["normal"] = shared * clusters.flux
    records["variances"] = spread[:, [0, 1, 2], [0, 1, 2]]
    records["covariances"] = spread[:, [0, 1, 0], [1, 2, 2]]
    records["power"] = scale**2 * power[:, None] * clusters.colour
    return records


class GpuLightForest:
    """A light forest in buffers of the device."""

    def __init__(self, context: moderngl.Context, forest: LightForest) -> None:
        def upload(values: np.ndarray) -> moderngl.Buffer:
            return context.buffer(values.tobytes() or bytes(256))

        self.nodes = upload(forest.nodes)
        self.clusters = upload(forest.clusters)
        self.light_ids = upload(forest.light_ids)
        self.light_windows = upload(forest.light_windows)
        self.roots = forest.roots
        self.node_count = len(forest.nodes)
        self.light_count = len(forest.light_ids)
