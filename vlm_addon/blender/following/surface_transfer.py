# SPDX-License-Identifier: GPL-3.0-or-later
"""What the nearest point of a visible surface knows: its object, its vertex weights, how shape keys move it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...core.scene import Float64, Int32
from ..extraction.mesh_arrays import cofactors, read

NEGLIGIBLE_WEIGHT = 1e-4
SEARCH_GROWTH = 3.0
"""Surfaces up to so many times as far as the nearest one are asked whether they face the same way."""


@dataclass(frozen=True)
class Surface:
    """Triangles of evaluated objects, world space.

    positions: (v, 3). triangles, corners: (t, 3), into positions and into the vertices of the owner's evaluated mesh.
    owners: (t,), rows of the objects that were asked for. normals: (t, 3), unit.
    """

    positions: Float64
    triangles: Int32
    corners: Int32
    owners: Int32
    normals: Float64


@dataclass(frozen=True)
class Nearest:
    """The surface's point nearest to each of n points: its triangle (n,), the weights of the triangle's corners (n, 3)
    and the distance (n,) m."""

    triangles: npt.NDArray[np.int64]
    weights: Float64
    distances: Float64


def evaluated_surface(things: Sequence[Any], depsgraph: Any) -> Surface:
    """The surfaces of `things` (original objects), with what they instance, as `depsgraph` has evaluated them.

    Objects that it does not show have none.
    """
    rows = {thing.name_full: row for row, thing in enumerate(things)}
    parts: list[tuple[Float64, Int32, int]] = []
    for instance in depsgraph.object_instances:
        owner = instance.parent if instance.is_instance else instance.object
        row = rows.get(owner.original.name_full) if owner is not None else None
        if row is None or instance.object.type != "MESH" or not instance.show_self:
            continue
        mesh = instance.object.data
        mesh.calc_loop_triangles()
        matrix = np.array(instance.matrix_world, np.float64)
        triangles = read(mesh.loop_triangles, "vertices", np.int32, 3).reshape(-1, 3)
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            triangles = triangles[:, [0, 2, 1]]
        parts.append((to_world(read(mesh.vertices, "co", np.float32, 3).reshape(-1, 3), matrix), triangles, row))
    starts = np.cumsum([0] + [len(positions) for positions, _, _ in parts])
    positions = np.concatenate([np.zeros((0, 3)), *(part[0] for part in parts)])
    corners = np.concatenate([np.zeros((0, 3), np.int32), *(part[1] for part in parts)])
    counts = [len(part[1]) for part in parts]
    triangles = corners + np.repeat(starts[:-1], counts).astype(np.int32)[:, None]
    owners = np.repeat(np.array([part[2] for part in parts], np.int32), counts)
    return Surface(positions, triangles, corners, owners, _unit(_area_vectors(positions[triangles])))


def nearest(surface: Surface, points: Float64, normals: Float64) -> Nearest:
    """The nearest point of a surface that faces as `normals` do, (n, 3), or the nearest of all where none near does."""
    middle = 0.5 * (surface.positions.min(axis=0) + surface.positions.max(axis=0))
    tree = BVHTree.FromPolygons((surface.positions - middle).tolist(), surface.triangles.tolist(), all_triangles=True)
    triangles = np.empty(len(points), np.int64)
    places = np.empty((len(points), 3))
    for row, (point, normal) in enumerate(zip(points - middle, normals, strict=True)):
        place, _, triangle, distance = tree.find_nearest(Vector(point))
        if surface.normals[triangle] @ normal <= 0.0:
            around = tree.find_nearest_range(Vector(point), SEARCH_GROWTH * distance)
            alike = [hit for hit in around if surface.normals[hit[2]] @ normal > 0.0]
            if alike:
                place, _, triangle, distance = min(alike, key=lambda hit: hit[3])
        triangles[row], places[row] = triangle, np.array(place) + middle
    weights = _corner_weights(surface.positions[surface.triangles[triangles]], places)
    return Nearest(triangles, weights, np.linalg.norm(places - points, axis=1))


def vertex_weights(mesh: Any, corners: Int32, weights: Float64) -> dict[int, dict[int, float]]:
    """For each vertex group of an evaluated `mesh`: rows of `corners` and the weight interpolated there.

    corners: (n, 3) vertices of the mesh; weights: (n, 3), summing to 1.
    """
    used = {
        vertex: [(entry.group, entry.weight) for entry in mesh.vertices[vertex].groups]
        for vertex in np.unique(corners).tolist()
    }
    groups: dict[int, dict[int, float]] = {}
    for row, (vertices, shares) in enumerate(zip(corners.tolist(), weights.tolist(), strict=True)):
        for vertex, share in zip(vertices, shares, strict=True):
            for group, weight in used[vertex]:
                rows = groups.setdefault(group, {})
                rows[row] = rows.get(row, 0.0) + share * weight
    return {
        group: {row: weight for row, weight in rows.items() if weight > NEGLIGIBLE_WEIGHT}
        for group, rows in groups.items()
    }


def interpolated(values: Float64, corners: Int32, weights: Float64) -> Float64:
    """(n, 3): values per vertex (v, 3) at points given by corners (n, 3) and their weights (n, 3)."""
    return np.asarray(np.einsum("nk,nkc->nc", weights, values[corners]))


def vertex_normals(positions: Float64, triangles: Int32) -> Float64:
    """(v, 3) unit normals, weighted by area; zero where a vertex has no triangle."""
    vectors = _area_vectors(positions[triangles])
    sums = np.zeros_like(positions)
    for corner in range(3):
        np.add.at(sums, triangles[:, corner], vectors)
    return _unit(sums)


def to_world(points: npt.NDArray[Any], matrix: Float64) -> Float64:
    """(n, 3) float64: points in the space that `matrix`, (4, 4), leads to."""
    return np.asarray(points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3])


def normals_to_world(normals: Float64, matrix: Float64) -> Float64:
    """(n, 3) unit normals of surfaces whose counter-clockwise side stays in front, also where `matrix` mirrors."""
    sign = -1.0 if np.linalg.det(matrix[:3, :3]) < 0.0 else 1.0
    return _unit(sign * normals @ cofactors(matrix).T)


def _area_vectors(corners: Float64) -> Float64:
    return np.asarray(0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _unit(vectors: Float64) -> Float64:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)


def _corner_weights(corners: Float64, places: Float64) -> Float64:
    """Barycentric coordinates (n, 3) of places (n, 3) in the planes of triangles (n, 3, 3), within [0, 1]."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    square = np.einsum("ij,ij->i", normal, normal)
    size = np.where(square > 0.0, square, 1.0)
    second = np.einsum("ij,ij->i", np.cross(c - places, a - places), normal) / size
    third = np.einsum("ij,ij->i", np.cross(a - places, b - places), normal) / size
    weights = np.clip(np.stack([1.0 - second - third, second, third], axis=1), 0.0, 1.0)
    return weights / weights.sum(axis=1, keepdims=True)
