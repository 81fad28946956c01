# SPDX-License-Identifier: GPL-3.0-or-later
"""Where phase one measures for lights whose source surface is not known: rays from each light onto what is visible.

A light lies behind the surface that it stands for and faces the same way. From points of the light a ray goes along
its normal to the first surface that faces the same way; back faces on the way are passed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ...core.light_mesh import SourceSamples, VirtualLightMesh
from ...core.mesh_topology import Bool, Rows, unit_normals
from ...core.sampling import sample_counts, sample_regions
from ...core.scene import Float64, Mesh

REACH_SIZES = 1.0
"""How far in front of a light its surface may lie, in sizes (square root of the area) of the light."""

START_SIZES = 1e-3
"""How far behind a light its rays start, so that a light in the very plane of its surface meets it."""

SIMILAR_COSINE = 0.5
"""Cosine between light and surface from which they are taken to face the same way."""

MOST_PASSED = 16
"""Surfaces that face otherwise that one ray passes before it gives up."""


def unsampled(lights: int) -> SourceSamples:
    """No samples for each of `lights` lights."""
    offsets = np.zeros(lights + 1, np.int32)
    return SourceSamples(np.zeros((0, 3)), np.zeros((0, 3), np.float32), np.zeros(0, np.float32), offsets)


def find_source_points(
    light_mesh: VirtualLightMesh, meshes: Sequence[Mesh], samples_per_light: int
) -> tuple[SourceSamples, int]:
    """Samples on the visible surface for each light, and how many lights found none and are sampled themselves.

    Stratified points as for simplified light meshes (core/sampling.py). Points of a light that reach beyond the edge
    of the surface are left out; the others share their weight. A light that no ray leads away from takes the nearest
    point of a surface that faces as it does.
    """
    own = _points_on_lights(light_mesh, samples_per_light)
    filled = [mesh for mesh in meshes if len(mesh.triangles)]
    if not filled or not len(light_mesh):
        return own, len(light_mesh)
    surface = VisibleSurface(filled)
    lights = np.repeat(np.arange(len(light_mesh)), np.diff(own.offsets))
    sizes = np.sqrt(light_mesh.areas)
    positions, normals, hit = surface.in_front(own.positions, own.normals.astype(np.float64), sizes[lights])
    without = np.flatnonzero(np.bincount(lights[hit], minlength=len(light_mesh)) == 0)
    alone = []
    for light in without.tolist():
        rows = slice(own.offsets[light], own.offsets[light + 1])
        found = surface.nearest(
            light_mesh.corners[light].mean(axis=0), own.normals[rows][0], REACH_SIZES * sizes[light]
        )
        if found is None:
            alone.append(light)
            positions[rows], normals[rows], hit[rows] = own.positions[rows], own.normals[rows], True
        else:
            first = own.offsets[light]
            positions[first], normals[first], hit[first] = *found, True
    counts = np.bincount(lights[hit], minlength=len(light_mesh))
    samples = SourceSamples(
        positions=positions[hit],
        normals=normals[hit].astype(np.float32),
        weights=(1.0 / counts[lights[hit]]).astype(np.float32),
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
    )
    return samples, len(alone)


def _points_on_lights(light_mesh: VirtualLightMesh, samples_per_light: int) -> SourceSamples:
    """Stratified points on the lights themselves, with the lights' normals."""
    each = Rows(np.arange(len(light_mesh)), np.arange(len(light_mesh) + 1))
    return sample_regions(light_mesh.corners, each, sample_counts(light_mesh.areas, samples_per_light))


class VisibleSurface:
    """All visible triangles, to shoot rays at. The tree is in float32, so it lies around the middle of the scene."""

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        starts = np.cumsum([0] + [len(mesh.positions) for mesh in meshes[:-1]])
        positions = np.concatenate([mesh.positions for mesh in meshes])
        triangles = np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=True)])
        self._middle = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
        self._normals = unit_normals(positions[triangles])
        local = (positions - self._middle).tolist()
        self._tree = BVHTree.FromPolygons(local, triangles.tolist(), all_triangles=True)

    def in_front(self, points: Float64, directions: Float64, sizes: Float64) -> tuple[Float64, Float64, Bool]:
        """First surface that faces as the light does along each direction, else just behind the point.

        points, directions (unit): (s, 3). sizes: (s,) m. Returns positions, normals and whether one was found.
        """
        distances, triangles = self.triangles_in_front(points, directions, sizes)
        return points + distances[:, None] * directions, self._normals[triangles], triangles >= 0

    def triangles_in_front(
        self, points: Float64, directions: Float64, sizes: Float64
    ) -> tuple[Float64, npt.NDArray[np.int64]]:
        """Signed distance (s,) m and triangle (s,) among those of all meshes in order, -1 where `in_front` has none."""
        distances, triangles = np.zeros(len(points)), np.full(len(points), -1)
        for sign in (1.0, -1.0):
            rows = np.flatnonzero(triangles < 0)
            distances[rows], triangles[rows] = self._first_alike(points[rows], directions[rows], sizes[rows], sign)
        return distances, triangles

    def _first_alike(
        self, points: Float64, directions: Float64, sizes: Float64, sign: float
    ) -> tuple[Float64, npt.NDArray[np.int64]]:
        """Signed distance and triangle (-1 for none) of the first surface along sign x direction that faces alike."""
        local, ways = points - self._middle, sign * directions
        travelled, triangles = -START_SIZES * sizes, np.full(len(points), -1)
        active = np.arange(len(points))
        for _ in range(MOST_PASSED):
            origins = local[active] + travelled[active, None] * ways[active]
            reach = REACH_SIZES * sizes[active] - travelled[active]
            met, distance = self._cast(origins, ways[active], reach)
            travelled[active] += distance
            cosine = np.einsum("ij,ij->i", self._normals[met], directions[active])
            found = (met >= 0) & (cosine >= SIMILAR_COSINE)
            triangles[active[found]] = met[found]
            active = active[(met >= 0) & ~found]
            travelled[active] += START_SIZES * sizes[active]
        return sign * travelled, triangles

    def _cast(self, origins: Float64, directions: Float64, reach: Float64) -> tuple[npt.NDArray[np.int64], Float64]:
        """Triangle (-1 for none) and distance of the first hit of each ray."""
        ray_cast = self._tree.ray_cast
        rays = zip(origins.tolist(), directions.tolist(), reach.tolist(), strict=True)
        hits = [ray_cast(*ray)[2:] for ray in rays]
        met = np.array([-1 if triangle is None else triangle for triangle, _ in hits], np.int64)
        return met, np.array([distance or 0.0 for _, distance in hits], np.float64)

    def nearest(self, point: Float64, normal: Float64, reach: float) -> tuple[Float64, Float64] | None:
        """The nearest point within `reach` of a surface that faces like `normal`, and its normal."""
        found = self.nearest_alike(point, normal, reach)
        return None if found is None else (found[0], self._normals[found[1]])

    def nearest_alike(self, point: Float64, normal: Float64, reach: float) -> tuple[Float64, int] | None:
        """The nearest point within `reach` of a surface that faces like `normal`, and its triangle."""
        near = self._tree.find_nearest_range(Vector(point - self._middle), reach)
        similar = [hit for hit in near if self._normals[hit[2]] @ normal >= SIMILAR_COSINE]
        if not similar:
            return None
        position, _, triangle, _ = min(similar, key=lambda hit: hit[3])
        return np.array(position, np.float64) + self._middle, triangle

    def nearest_point(self, point: Float64) -> tuple[Float64, int]:
        """The nearest point of all surfaces, and its triangle."""
        position, _, triangle, _ = self._tree.find_nearest(Vector(point - self._middle))
        return np.array(position, np.float64) + self._middle, triangle
