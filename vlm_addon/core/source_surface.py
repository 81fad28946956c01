# SPDX-License-Identifier: GPL-3.0-or-later
"""The visible surface as simplification sees it: all meshes as one welded, oriented manifold with groups and shells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .errors import InvalidInput
from .mesh_topology import (
    Bool,
    HalfEdges,
    Int64,
    closed_shells,
    fans_apart,
    half_edges,
    joined_shells,
    normals_and_areas,
    used_only,
    weld,
)
from .progress import Report
from .scene import Float64, Mesh

# Importance of a black surface against a white one: it needs no lights, but its shape must still collapse in order.
LEAST_IMPORTANCE = 1e-3
# The cost of a collapse grows with the weight times the sides of a triangle to the fourth power on flat surfaces and
# the sixth on curved ones, so twice the lights take four to eight times the weight.
DETAIL_POWER = 2.5


@dataclass(frozen=True)
class SourceSurface:
    """positions: (v, 3) float64, m. triangles: (t, 3) int64 into them. original: (t,) row of each triangle among all
    triangles of all meshes in order; those that weld to a line are left out. mesh, group, shell, tag: (t,) int64;
    triangles of one mesh, material and tag form a group; a shell is joined by its edges. closed: (shells,) bool.
    areas: (t,) m². normals: (t, 3) unit, 0 for a degenerate one. reflectance, emission: (t, 3). dynamic: (t,) bool.
    detail: (t,) of Mesh, above 0: triangles painted to have no lights are left out as well. triangle_count: how many
    triangles the meshes have. degenerate_count: how many of those that may have lights have no area. unlit_area: m² of
    those that may not.
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
    detail: Float64
    triangle_count: int
    degenerate_count: int
    unlit_area: float

    @cached_property
    def corners(self) -> Float64:
        """(t, 3, 3) float64, m."""
        return self.positions.take(self.triangles, axis=0)

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the bounding box of all triangles, m; 0 for none."""
        used = self.positions[used_only(self.triangles, len(self.positions))[0]]
        return float(np.linalg.norm(used.max(axis=0) - used.min(axis=0))) if len(used) else 0.0

    def importance(self) -> Float64:
        """(t,) power that each triangle sends out under unit irradiance, m²; emitters count as white at their mean."""
        emitted = self.emission.mean(axis=1)
        shining = emitted > 0
        if shining.any():
            emitted = emitted / np.average(emitted[shining], weights=self.areas[shining] + np.finfo(float).tiny)
        share = self.reflectance.mean(axis=1) + np.minimum(emitted, 1.0)
        return self.areas * np.maximum(share, LEAST_IMPORTANCE)

    def weight(self) -> Float64:
        """(t,) m²: importance as far as shape and number of the lights are concerned, more where more is painted."""
        return self.importance() * self.detail**DETAIL_POWER


def join_surface(meshes: Sequence[Mesh], report: Report = lambda share: None) -> SourceSurface:
    """All triangles of `meshes` as one surface. Raises InvalidInput on values that are not finite or negative.

    report: called with the share of the work that is done, may raise.
    """
    for mesh in meshes:
        _require_usable(mesh)
    filled = [mesh for mesh in meshes if len(mesh.triangles)]
    mesh_of = np.repeat(np.arange(len(filled)), [len(mesh.triangles) for mesh in filled])
    positions, triangles = _concatenate(filled)
    owner = np.repeat(np.arange(len(filled)), [len(mesh.positions) for mesh in filled])
    used, triangles = used_only(triangles, len(positions))
    positions = positions[used]
    report(0.1)
    welded = weld(positions, owner[used])[triangles]
    a, b, c = welded.T
    detail = np.concatenate([_detail(mesh) for mesh in filled]) if filled else np.zeros(0)
    unlit = triangles[detail <= 0]
    original = np.flatnonzero((a != b) & (b != c) & (c != a) & (detail > 0))
    report(0.3)
    edges = half_edges(welded[original], len(positions))
    report(0.45)
    cut, origin = fans_apart(welded[original], edges)
    report(0.65)
    unlit_area = float(normals_and_areas(positions[unlit])[1].sum())
    positions, mesh_of = positions[origin], mesh_of[original]
    normals, areas = normals_and_areas(positions.take(cut, axis=0))
    report(0.75)
    # Where only twins meet at edges, cutting fans apart parts no edge.
    shell, closed = joined_shells(edges) if _only_twins(edges) else closed_shells(cut, len(positions))
    report(0.9)
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
        areas=areas,
        normals=normals,
        reflectance=attributes["reflectance"].reshape(-1, 3).astype(np.float64),
        emission=attributes["emission"].reshape(-1, 3).astype(np.float64),
        dynamic=np.array([mesh.dynamic for mesh in filled], bool)[mesh_of],
        detail=detail[original],
        triangle_count=len(triangles),
        degenerate_count=len(triangles) - len(unlit) - int((areas > 0).sum()),
        unlit_area=unlit_area,
    )


def _only_twins(edges: HalfEdges) -> bool:
    """Whether each half-edge has a twin or its edge to itself."""
    return bool(((edges.twin >= 0) | (edges.face_count[edges.edge] == 1)).all())


def _detail(mesh: Mesh) -> Float64:
    return mesh.detail.astype(np.float64) if len(mesh.detail) else np.ones(len(mesh.triangles))


def part_of(surface: SourceSurface, chosen: Bool) -> SourceSurface:
    """The surface with the triangles of `chosen`, (t,) bool, and all vertices; counts of triangles are of the whole."""
    names = ("triangles", "original", "mesh", "group", "tag", "areas", "normals", "reflectance", "emission")
    rows = {name: getattr(surface, name)[chosen] for name in (*names, "dynamic", "detail")}
    shell, closed = closed_shells(rows["triangles"], len(surface.positions))
    return replace(surface, shell=shell, closed=closed, **rows)


def _require_usable(mesh: Mesh) -> None:
    if len(mesh.detail) not in (0, len(mesh.triangles)):
        problem = f"detail for {len(mesh.detail)} of {len(mesh.triangles)} triangles"
        raise InvalidInput(f"mesh {mesh.name!r}", problem, "give it for all or none")
    checked = ("reflectance", mesh.reflectance), ("emission", mesh.emission), ("detail", mesh.detail[:, None])
    for name, given in (("vertex", mesh.positions), *checked):
        values = given.astype(np.float64)
        finite = np.isfinite(values).all(axis=-1)
        if not finite.all():
            row = int(np.argmin(finite))
            problem = f"{name} {row} is not finite: {values[row].tolist()}"
            raise InvalidInput(f"mesh {mesh.name!r}", problem, "repair or delete it")
        if name != "vertex" and (values < 0).any():
            row = int(np.argwhere(values < 0)[0][0])
            problem = f"{name} of triangle {row} is negative: {values[row].tolist()}"
            raise InvalidInput(f"mesh {mesh.name!r}", problem, "use values of at least 0")
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
