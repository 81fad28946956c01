# SPDX-License-Identifier: GPL-3.0-or-later
"""The visible surface as simplification sees it: all meshes as one welded, oriented manifold with groups and shells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .errors import InvalidInput
from .mesh_topology import Bool, Int64, closed_shells, cut_to_manifold, weld
from .scene import Float64, Mesh

# Importance of a black surface against a white one: it needs no lights, but its shape must still collapse in order.
LEAST_IMPORTANCE = 1e-3


@dataclass(frozen=True)
class SourceSurface:
    """positions: (v, 3) float64, m. triangles: (t, 3) int64 into them. original: (t,) row of each triangle among all
    triangles of all meshes in order; those that weld to a line are left out. mesh, group, shell, tag: (t,) int64;
    triangles of one mesh, material and tag form a group; a shell is joined by its edges. closed: (shells,) bool.
    areas: (t,) m². normals: (t, 3) unit, 0 for a degenerate one. reflectance, emission: (t, 3). dynamic: (t,) bool.
    triangle_count: how many triangles the meshes have. degenerate_count: how many of them have no area.
    """

    positions: Float64
    triangles: Int64
    original: Int64
    mesh: Int64
    group: Int64
    shell: Int64
    tag: Int64
    closed: Bool
    areas: Float64
    normals: Float64
    reflectance: Float64
    emission: Float64
    dynamic: Bool
    triangle_count: int
    degenerate_count: int

    @property
    def corners(self) -> Float64:
        """(t, 3, 3) float64, m."""
        return self.positions[self.triangles]

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box of all triangles, m; 0 for none."""
        used = self.positions[np.unique(self.triangles)]
        return float(np.linalg.norm(used.max(axis=0) - used.min(axis=0))) if len(used) else 0.0

    def importance(self) -> Float64:
        """(t,) power that each triangle sends out under unit irradiance, m²; emitters count as white at their mean."""
        emitted = self.emission.mean(axis=1)
        shining = emitted > 0
        if shining.any():
            emitted = emitted / np.average(emitted[shining], weights=self.areas[shining] + np.finfo(float).tiny)
        share = self.reflectance.mean(axis=1) + np.minimum(emitted, 1.0)
        return self.areas * np.maximum(share, LEAST_IMPORTANCE)


def join_surface(meshes: Sequence[Mesh]) -> SourceSurface:
    """All triangles of `meshes` as one surface. Raises InvalidInput on values that are not finite or negative."""
    for mesh in meshes:
        _require_usable(mesh)
    filled = [mesh for mesh in meshes if len(mesh.triangles)]
    mesh_of = np.repeat(np.arange(len(filled)), [len(mesh.triangles) for mesh in filled])
    positions, triangles = _concatenate(filled)
    owner = np.repeat(np.arange(len(filled)), [len(mesh.positions) for mesh in filled])
    used, triangles = np.unique(triangles, return_inverse=True)
    positions, triangles = positions[used], triangles.reshape(-1, 3)
    welded = weld(positions, owner[used])[triangles]
    a, b, c = welded.T
    original = np.flatnonzero((a != b) & (b != c) & (c != a))
    cut, origin = cut_to_manifold(welded[original], len(positions))
    positions, mesh_of = positions[origin], mesh_of[original]
    normals = np.cross(positions[cut[:, 1]] - positions[cut[:, 0]], positions[cut[:, 2]] - positions[cut[:, 0]])
    doubled = np.linalg.norm(normals, axis=1)
    shell, closed = closed_shells(cut, len(positions))
    attributes = {name: _gather(filled, name)[original] for name in ("reflectance", "emission")}
    tag = _gather(filled, "tag_ids").astype(np.int64)[original]
    material = _gather(filled, "material_indices").astype(np.int64)[original]
    return SourceSurface(
        positions=positions,
        triangles=cut,
        original=original,
        mesh=mesh_of,
        group=_numbered(mesh_of, material, tag),
        shell=shell,
        tag=tag,
        closed=closed,
        areas=0.5 * doubled,
        normals=normals / np.where(doubled > 0, doubled, 1.0)[:, None],
        reflectance=attributes["reflectance"].reshape(-1, 3).astype(np.float64),
        emission=attributes["emission"].reshape(-1, 3).astype(np.float64),
        dynamic=np.array([mesh.dynamic for mesh in filled], bool)[mesh_of],
        triangle_count=len(triangles),
        degenerate_count=len(triangles) - int((doubled > 0).sum()),
    )


def _require_usable(mesh: Mesh) -> None:
    for name, given in (("vertex", mesh.positions), ("reflectance", mesh.reflectance), ("emission", mesh.emission)):
        values = given.astype(np.float64)
        finite = np.isfinite(values).all(axis=-1)
        if not finite.all():
            row = int(np.argmin(finite))
            problem = f"{name} {row} is not finite: {values[row].tolist()}"
            raise InvalidInput(f"mesh {mesh.name!r}", problem, "repair or delete it")
        if name != "vertex" and (values < 0).any():
            row = int(np.argwhere(values < 0)[0][0])
            problem = f"{name} of triangle {row} is negative: {values[row].tolist()}"
            raise InvalidInput(f"mesh {mesh.name!r}", problem, "use colours of at least 0")
    if len(mesh.triangles) and not 0 <= mesh.triangles.min() <= mesh.triangles.max() < len(mesh.positions):
        problem = f"a triangle names a vertex outside 0 to {len(mesh.positions) - 1}"
        raise InvalidInput(f"mesh {mesh.name!r}", problem, "rebuild the mesh")


def _concatenate(meshes: list[Mesh]) -> tuple[Float64, Int64]:
    if not meshes:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    starts = np.cumsum([0] + [len(mesh.positions) for mesh in meshes[:-1]])
    triangles = [mesh.triangles.astype(np.int64) + start for mesh, start in zip(meshes, starts, strict=True)]
    return np.concatenate([mesh.positions for mesh in meshes]).astype(np.float64), np.concatenate(triangles)


def _gather(meshes: list[Mesh], name: str) -> np.ndarray:
    return np.concatenate([getattr(mesh, name) for mesh in meshes]) if meshes else np.zeros(0)


def _numbered(*columns: Int64) -> Int64:
    """One number from 0 for each distinct row of the columns."""
    number = np.zeros(len(columns[0]), np.int64)
    for column in columns:
        unique, rank = np.unique(column, return_inverse=True)
        _, number = np.unique(number * max(len(unique), 1) + rank, return_inverse=True)
    return number.astype(np.int64)
