# SPDX-License-Identifier: GPL-3.0-or-later
"""Which lights stand for which triangles of the visible surface, found by place and direction.

Two ways of looking are joined: each triangle belongs to the light nearest to it (core/nearest_lights.py), which is
right where triangles are smaller than lights; and each light stands for the triangles in front of it
(source_points.py), which is right where they are larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.mesh_topology import Bool, Int64, unit_normals
from ...core.nearest_lights import light_of_triangles
from ...core.progress import Progress, Report, as_report, part, step
from ...core.sampling import sample_counts, sample_regions
from ...core.scene import Float64, Mesh
from ...core.triangle_distance import flat_triangles
from ..extraction.source_points import SIMILAR_COSINE, VisibleSurface
from ..light_geometry import LightFaces

SAMPLES_PER_LIGHT = 16
LIGHTS_PER_STEP = 512
NO_LIGHT = -1


@dataclass(frozen=True)
class SourceLights:
    """The lights of one light mesh, and which meshes of the snapshot, by index, they may stand for."""

    faces: LightFaces
    meshes: frozenset[int]


@dataclass(frozen=True)
class RegionPairs:
    """lights, triangles: (p,) int64, each pair once: faces of the light meshes and triangles of the meshes, both
    numbered through. nearest: (t,) int64 the light triangle nearest to each triangle, NO_LIGHT where it is too far."""

    lights: Int64
    triangles: Int64
    nearest: Int64


def region_pairs(lights: Sequence[SourceLights], meshes: Sequence[Mesh], progress: Progress) -> RegionPairs:
    """All pairs of a light and a triangle of its region. Raises Cancelled."""
    corners = np.concatenate([np.zeros((0, 3, 3)), *(mesh.positions[mesh.triangles] for mesh in meshes)])
    mesh_of = np.repeat(np.arange(len(meshes)), [len(mesh.triangles) for mesh in meshes])
    faces = [each.faces for each in lights]
    light_corners = np.concatenate([np.zeros((0, 3, 3)), *(each.corners for each in faces)])
    first_face = np.cumsum([0, *(each.count for each in faces)])
    face_of = np.concatenate(
        [np.zeros(0, np.int64), *(start + each.faces for start, each in zip(first_face, faces, strict=False))]
    ).astype(np.int64)
    of_mesh = np.repeat(np.arange(len(lights)), [len(each.corners) for each in faces])
    nearest = np.full(len(corners), NO_LIGHT, np.int64)
    if len(corners) and len(light_corners):
        for index, chosen in _meshes_by_lights(lights, len(meshes)):
            done = as_report(part(progress, 0.5 * index / len(meshes), 0.5), "pairing lights and faces")
            done(0.0)
            triangles, known = chosen[mesh_of], np.flatnonzero(_stands_for(lights, index)[of_mesh])
            nearest[triangles] = _near_enough(light_corners, known, corners[triangles], done)
    found = np.flatnonzero(nearest >= 0)
    pairs = [np.stack([face_of[nearest[found]], found], axis=1)]
    if len(corners):
        surface = VisibleSurface([mesh for mesh in meshes if len(mesh.triangles)])
        for number, each in enumerate(lights):
            front = _in_front(each.faces, surface, progress)
            allowed = np.isin(mesh_of[front[:, 1]], list(each.meshes))
            pairs.append(front[allowed] + [first_face[number], 0])
    unique = np.unique(np.concatenate(pairs), axis=0)
    return RegionPairs(unique[:, 0], unique[:, 1], nearest)


def _meshes_by_lights(lights: Sequence[SourceLights], count: int) -> list[tuple[int, Bool]]:
    """Meshes that the same light meshes stand for: the index of one, and (count,) bool which they are."""
    groups: dict[tuple[bool, ...], list[int]] = {}
    for index in range(count):
        groups.setdefault(tuple(index in each.meshes for each in lights), []).append(index)
    return [(group[0], np.isin(np.arange(count), group)) for key, group in groups.items() if any(key)]


def _stands_for(lights: Sequence[SourceLights], mesh: int) -> Bool:
    return np.array([mesh in each.meshes for each in lights], bool)


def _near_enough(light_corners: Float64, known: Int64, corners: Float64, report: Report) -> Int64:
    """(t,) the nearest of the light triangles `known`, NO_LIGHT where it is farther away than its longest edge or faces
    another way: the walls around a light on the floor are not what it stands for."""
    nearest = light_of_triangles(light_corners[known], corners, report)
    rows = np.flatnonzero(nearest >= 0)
    own = light_corners[known[nearest[rows]]]
    edges = np.linalg.norm(own - np.roll(own, 1, axis=1), axis=2).max(axis=1)
    middles = corners[rows].mean(axis=1)
    squared = flat_triangles(own).squared_distances(middles, np.arange(len(rows)))
    result = np.full(len(corners), NO_LIGHT, np.int64)
    alike = np.einsum("ij,ij->i", unit_normals(own), unit_normals(corners[rows])) >= SIMILAR_COSINE
    near = (squared <= edges**2) & alike
    result[rows[near]] = known[nearest[rows[near]]]
    return result


def _in_front(lights: LightFaces, surface: VisibleSurface, progress: Progress) -> Int64:
    """(p, 2) pairs of a face of `lights` and a triangle in front of it."""
    counts = sample_counts(lights.areas, SAMPLES_PER_LIGHT)
    sizes, numbers = np.sqrt(lights.areas), np.arange(lights.count)
    pairs = [np.zeros((0, 2), np.int64)]
    for first in range(0, lights.count, LIGHTS_PER_STEP):
        step(progress, 0.5 + 0.5 * first / lights.count, "looking at what is in front of each light")
        chosen = (numbers >= first) & (numbers < first + LIGHTS_PER_STEP)
        some = lights.subset(chosen)
        samples = sample_regions(some.corners, some.triangles_of, counts[chosen])
        owner = numbers[chosen][np.repeat(np.arange(some.count), np.diff(samples.offsets))]
        ways = samples.normals.astype(np.float64)
        _, triangles = surface.triangles_in_front(samples.positions, ways, sizes[owner])
        met = triangles >= 0
        pairs.append(np.unique(np.stack([owner[met], triangles[met]], axis=1), axis=0))
    return np.concatenate(pairs)
