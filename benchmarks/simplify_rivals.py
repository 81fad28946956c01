# SPDX-License-Identifier: GPL-3.0-or-later
"""Other ways to make few triangles of a scene: its meshes joined to one, borders and materials forgotten."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from vlm_addon.core.mesh_topology import Int64
from vlm_addon.core.scene import Float64, Mesh
from vlm_addon.core.source_surface import SourceSurface

Soup = tuple[Float64, Int64]
"""(v, 3) float64 positions, m, and (n, 3) int64 triangles into them."""

DECIMATE_TRIES = 6
LEAST_AREA = 1e-18


def joined(meshes: Sequence[Mesh]) -> Soup:
    """All triangles of the meshes, as Blender's Join does it: nothing is welded."""
    starts = np.cumsum([0] + [len(mesh.positions) for mesh in meshes[:-1]])
    triangles = [mesh.triangles.astype(np.int64) + start for mesh, start in zip(meshes, starts, strict=True)]
    return np.concatenate([mesh.positions for mesh in meshes]), np.concatenate(triangles)


def by_fast_simplification(soup: Soup, target: int) -> Soup:
    """fast_simplification with its defaults."""
    import fast_simplification

    points, triangles = fast_simplification.simplify(soup[0], soup[1].astype(np.int32), target_count=target)
    return _solid(np.asarray(points, np.float64), np.asarray(triangles, np.int64))


def by_decimate(soup: Soup, target: int) -> Soup:
    """Blender's Decimate modifier, collapse, at the greatest ratio that leaves at most `target`, if any does."""
    mesh = bpy.data.meshes.new("joined")
    mesh.from_pydata(soup[0].tolist(), [], soup[1].tolist())
    thing = bpy.data.objects.new("joined", mesh)
    bpy.context.scene.collection.objects.link(thing)
    modifier = thing.modifiers.new("decimate", "DECIMATE")
    modifier.use_collapse_triangulate = True
    ratio = target / len(soup[1])
    try:
        for _ in range(DECIMATE_TRIES):
            modifier.ratio = ratio
            found = _evaluated(thing)
            if len(found[1]) <= target:
                break
            ratio *= 0.98 * target / len(found[1])
    finally:
        bpy.data.objects.remove(thing)
        bpy.data.meshes.remove(mesh)
    return _solid(*found)


def _evaluated(thing: bpy.types.Object) -> Soup:
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    mesh.calc_loop_triangles()
    points = np.empty(3 * len(mesh.vertices), np.float32)
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.vertices.foreach_get("co", points)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    evaluated.to_mesh_clear()
    return points.reshape(-1, 3).astype(np.float64), triangles.reshape(-1, 3).astype(np.int64)


def _solid(points: Float64, triangles: Int64) -> Soup:
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return points, triangles[0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1) > LEAST_AREA]


RIVALS: dict[str, Callable[[Soup, int], Soup]] = {
    "fast_simplification": by_fast_simplification,
    "Decimate": by_decimate,
}


def nearest_lights(surface: SourceSurface, soup: Soup) -> Int64:
    """(t,) the light nearest to the middle of each source triangle, of those that face its way along the axis that it
    faces most; of all where none does."""
    points, triangles = soup
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middles = surface.corners.mean(axis=1)
    axis = np.abs(surface.normals).argmax(axis=1)
    sign = np.sign(np.take_along_axis(surface.normals, axis[:, None], 1)[:, 0])
    found = np.zeros(len(middles), np.int64)
    for way in range(3):
        for side in (-1.0, 1.0):
            rows = np.flatnonzero((axis == way) & (sign == side))
            facing = np.flatnonzero(normals[:, way] * side > 0)
            if not len(facing):
                facing = np.arange(len(triangles))
            if len(rows):
                tree = BVHTree.FromPolygons(points.tolist(), triangles[facing].tolist(), all_triangles=True)
                nearest = [tree.find_nearest(point)[2] for point in middles[rows].tolist()]
                found[rows] = facing[np.array(nearest, np.int64)]
    return found
