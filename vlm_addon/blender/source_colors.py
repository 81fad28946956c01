# SPDX-License-Identifier: GPL-3.0-or-later
"""What the visible surface reflects and emits, averaged over the region that a light stands for.

The region of a light is what lies in front of it, as phase one measures it (source_points.py): rays from stratified
points of the light, each standing for its share of the light's area. Textures are averaged over that share. Nothing
of the visible scene is changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.errors import InvalidInput
from ..core.mesh_topology import Bool, Int64
from ..core.progress import Progress, silent, step
from ..core.sampling import GOLDEN_RATIO, sample_counts, sample_regions
from ..core.scene import Float32, Float64, SceneSnapshot
from .extraction.source_points import VisibleSurface
from .extraction.triangle_averages import TextureAverager, triangle_averages
from .light_geometry import LightFaces

SAMPLES_PER_LIGHT = 16
LIGHTS_PER_STEP = 256
POINTS_PER_DISC = 128
NEAREST_REACH_SIZES = np.array([1.0, 8.0])
"""How far around a light that no ray leads away from its surface is looked for, in sizes of the light: slivers are
deeper behind their surface than they are large."""
NO_SURFACE = "no visible object in it has a surface"


@dataclass(frozen=True)
class SurfaceColors:
    """One row per light, linear Rec.709: diffuse reflectance, radiant exitance in W/m², and whether any surface was
    found. reflectance, emission: (n, 3) float64, 0 where none was. found: (n,) bool."""

    reflectance: Float64
    emission: Float64
    found: Bool


class SourceColors:
    """All visible triangles of a snapshot with what decides their colour. Raises InvalidInput where there are none."""

    def __init__(self, snapshot: SceneSnapshot) -> None:
        meshes = [mesh for mesh in snapshot.meshes if len(mesh.triangles)]
        if not meshes:
            raise InvalidInput(f"scene {snapshot.name!r}", NO_SURFACE, "add a mesh or show one")
        self._surface = VisibleSurface(meshes)
        self._corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in meshes])
        self._uvs = np.concatenate([mesh.corner_uvs for mesh in meshes])
        colors = [
            mesh.corner_colors if len(mesh.corner_colors) else np.ones_like(mesh.corner_normals) for mesh in meshes
        ]
        self._colors = np.concatenate(colors)
        self._material_indices = np.concatenate([mesh.material_indices for mesh in meshes])
        self._reflectance = np.concatenate([mesh.reflectance for mesh in meshes])
        self._emission = np.concatenate([mesh.emission for mesh in meshes])
        self._materials = snapshot.materials
        self._averager = TextureAverager(snapshot.textures)

    def of_lights(self, lights: LightFaces, progress: Progress = silent) -> SurfaceColors:
        """The mean of what lies in front of each light. Raises Cancelled."""
        counts = sample_counts(lights.areas, SAMPLES_PER_LIGHT)
        parts = []
        for first in range(0, lights.count, LIGHTS_PER_STEP):
            step(progress, first / lights.count, "looking at the materials")
            chosen = np.zeros(lights.count, bool)
            chosen[first : first + LIGHTS_PER_STEP] = True
            parts.append(self._of_some(lights.subset(chosen), counts[chosen]))
        names = ("reflectance", "emission", "found")
        empty = SurfaceColors(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool))
        return SurfaceColors(*(np.concatenate([getattr(part, name) for part in (empty, *parts)]) for name in names))

    def _of_some(self, lights: LightFaces, counts: Int64) -> SurfaceColors:
        samples = sample_regions(lights.corners, lights.triangles_of, counts)
        owner = np.repeat(np.arange(lights.count), np.diff(samples.offsets))
        sizes = np.sqrt(lights.areas)
        normals = samples.normals.astype(np.float64)
        distances, triangles = self._surface.triangles_in_front(samples.positions, normals, sizes[owner])
        points = samples.positions + distances[:, None] * normals
        without = np.flatnonzero((np.bincount(owner[triangles >= 0], minlength=lights.count) == 0) & (counts > 0))
        middles = lights.middles
        for light in without.tolist():
            row = samples.offsets[light]
            if row == samples.offsets[light + 1]:
                continue
            for reach in NEAREST_REACH_SIZES * sizes[light]:
                nearest = self._surface.nearest_alike(middles[light], normals[row], reach)
                if nearest is not None:
                    points[row], triangles[row] = nearest
                    break
        shares = lights.areas / np.maximum(counts, 1)
        return self._means(points, triangles, owner, shares, lights.count)

    def _means(self, points: Float64, triangles: Int64, owner: Int64, shares: Float64, count: int) -> SurfaceColors:
        """Mean over the points of each owner that lie on a triangle (not -1). shares: (count,) m² of each point."""
        hit = triangles >= 0
        owner = owner[hit]
        values = self._at(points[hit], triangles[hit], shares[owner])
        number = np.bincount(owner, minlength=count)
        sums = [np.stack([np.bincount(owner, channel, count) for channel in rows.T], axis=1) for rows in values]
        reflectance, emission = (rows / np.maximum(number, 1)[:, None] for rows in sums)
        return SurfaceColors(reflectance, emission, number > 0)

    def _at(self, points: Float64, triangles: Int64, shares: Float64) -> tuple[Float32, Float32]:
        """Reflectance and emission, (s, 3) each, of the part of its triangle of `shares` m² around each point."""
        areas = _areas(self._corners[triangles])
        scale = np.minimum(np.sqrt(shares / areas), 1.0)[:, None, None]
        # A triangle of the same shape around the point, cut off where it would reach beyond the one it is part of.
        weights = _barycentrics(points, self._corners[triangles])[:, None, :] + scale * (np.eye(3) - 1.0 / 3.0)
        weights = np.clip(weights, 0.0, None)
        weights /= weights.sum(axis=2, keepdims=True)

        def around(values: Float32) -> Float32:
            return np.asarray(weights @ values[triangles].astype(np.float64), np.float32)

        indices = self._material_indices[triangles]
        return triangle_averages(self._materials, self._averager, indices, around(self._uvs), around(self._colors))

    def of_all(self) -> SurfaceColors:
        """One row: the mean of all triangles by area."""
        weights = _areas(self._corners)
        reflectance, emission = (
            np.average(rows, axis=0, weights=weights)[None] for rows in (self._reflectance, self._emission)
        )
        return SurfaceColors(reflectance, emission, np.ones(1, bool))

    def distance(self, point: Sequence[float]) -> float:
        """How far, m, the nearest of all surfaces is from a point."""
        at, _ = self._surface.nearest_point(np.array(point, np.float64))
        return float(np.linalg.norm(at - point))

    def around(self, point: Sequence[float], radius: float) -> SurfaceColors:
        """One row: the mean over what a light of that radius (m) at the surface nearest to `point` would stand for."""
        at, triangle = self._surface.nearest_point(np.array(point, np.float64))
        a, b, c = self._corners[triangle]
        normal = np.cross(b - a, c - a)
        normal /= max(float(np.linalg.norm(normal)), np.finfo(np.float64).tiny)
        points = at + _disc(POINTS_PER_DISC, radius) @ _frame(normal)
        size = np.sqrt(np.pi) * radius
        normals = np.tile(normal, (len(points), 1))
        distances, triangles = self._surface.triangles_in_front(points, normals, np.full(len(points), size))
        # The point itself always counts: beside it, the disc may reach beyond all that there is.
        points = np.concatenate([[at], points + distances[:, None] * normals])
        triangles = np.concatenate([[triangle], triangles])
        shares = np.array([np.pi * radius**2 / len(points)])
        return self._means(points, triangles, np.zeros(len(points), np.int64), shares, 1)


def _areas(corners: Float64) -> Float64:
    """(t,) m², above 0 even for triangles that have none."""
    a, b, c = np.moveaxis(corners, 1, 0)
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1) + np.finfo(np.float64).tiny)


def _barycentrics(points: Float64, corners: Float64) -> Float64:
    """(s, 3) barycentric coordinates, within [0, 1], of points in the planes of triangles (s, 3, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("ij,ij->i", normal, normal), np.finfo(np.float64).tiny)
    opposite = [np.cross(c - b, points - b), np.cross(a - c, points - c), np.cross(b - a, points - a)]
    weights = np.stack([np.einsum("ij,ij->i", each, normal) for each in opposite], axis=1) / squared[:, None]
    weights = np.clip(weights, 0.0, None)
    total = weights.sum(axis=1, keepdims=True)
    return np.where(total > 0.0, weights / np.where(total > 0.0, total, 1.0), 1.0 / 3.0)


def _disc(count: int, radius: float) -> Float64:
    """(count, 2) points spread evenly over a disc: a sunflower's spiral."""
    number = np.arange(count) + 0.5
    angle = 2.0 * np.pi * GOLDEN_RATIO * number
    return radius * np.sqrt(number / count)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _frame(normal: Float64) -> Float64:
    """(2, 3): two unit vectors at right angles to each other and to `normal`."""
    axis = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])
