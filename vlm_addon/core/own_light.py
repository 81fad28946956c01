# SPDX-License-Identifier: GPL-3.0-or-later
"""Own light: what a surface point receives from the light whose mapped region holds it, by the float64 oracle.

A light stands for its region and must not shine on it (seed 002, section 3.4). Lights send out what they would under an
irradiance of 1 W/m² everywhere, so that the figures are of the geometry alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .form_factor import paired_form_factor, polygon_form_factor
from .light_links import leaves_out
from .light_mesh import VirtualLightMesh
from .mesh_topology import Int64
from .sampling import square_to_triangle
from .scene import Float64, Int32, Mesh

POINTS = 10_000
# Points at which all lights are summed; their mean is that of all POINTS to some per cent.
TOTAL_POINTS = 500
PAIRS_PER_BATCH = 1 << 18


@dataclass(frozen=True)
class RegionPoints:
    """Points uniform over the area of some triangles. positions: (p, 3) float64, m. normals: (p, 3) float64 unit.
    lights: (p,) the light whose region holds each, -1 for none. tag_ids: (p,). meshes: (p,) row of the mesh."""

    positions: Float64
    normals: Float64
    lights: Int64
    tag_ids: Int32
    meshes: Int64


@dataclass(frozen=True)
class OwnLight:
    """Mean irradiance in W/m². own: from the light of each point. total: from all lights. on_itself: from lights of
    the point's own mesh but its own light; on_itself_untagged: the same as if there were no tags."""

    own: float
    total: float
    on_itself: float
    on_itself_untagged: float

    @property
    def share(self) -> float:
        """Own light over all light of the lights, 0 where they send none."""
        return self.own / self.total if self.total > 0 else 0.0

    @property
    def share_of_arriving(self) -> float:
        """Own light over all that arrives: 1 W/m² of direct light and what the lights send."""
        return self.own / (1.0 + self.total)

    @property
    def kept_on_itself(self) -> float:
        """What tags leave of the light of meshes on their other parts; 1 where there is none."""
        return self.on_itself / self.on_itself_untagged if self.on_itself_untagged > 0 else 1.0


def region_points(
    meshes: Sequence[Mesh],
    light_of_triangle: Sequence[Int32],
    count: int = POINTS,
    chosen: Sequence[int] | None = None,
    seed: int = 0,
) -> RegionPoints:
    """`count` random points of the visible surface (of the meshes `chosen` alone), each with its light."""
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in meshes])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    mesh_of = np.repeat(np.arange(len(meshes)), [len(mesh.triangles) for mesh in meshes])
    weight = doubled if chosen is None else doubled * np.isin(mesh_of, chosen)
    random = np.random.default_rng(seed)
    row = random.choice(len(corners), count, p=weight / weight.sum())
    inside = square_to_triangle(random.random(count), random.random(count))
    return RegionPoints(
        positions=np.einsum("pk,pkj->pj", inside, corners[row]),
        normals=normals[row] / doubled[row, None],
        lights=np.concatenate(light_of_triangle).astype(np.int64)[row],
        tag_ids=np.concatenate([mesh.tag_ids for mesh in meshes])[row],
        meshes=mesh_of[row],
    )


def own_light(
    light_mesh: VirtualLightMesh, mesh_of_light: Int64, points: RegionPoints, total_points: int = TOTAL_POINTS
) -> OwnLight:
    """Own light at all points, and all light at the first `total_points` of them. mesh_of_light: (n,) the mesh that
    each light stands for."""
    radiosity = light_mesh.nominal_radiosity.mean(axis=1)
    held = np.flatnonzero(points.lights >= 0)
    light = points.lights[held]
    factors = paired_form_factor(points.positions[held], points.normals[held], light_mesh.corners[light])
    lost = leaves_out(light_mesh.links, light_mesh.tag_ids[light], points.tag_ids[held])
    own = factors * radiosity[light]
    sums = np.zeros(3)
    total_points = min(total_points, len(points.positions))
    step = max(1, PAIRS_PER_BATCH // max(len(light_mesh), 1))
    for first in range(0, total_points, step):
        rows = slice(first, min(first + step, total_points))
        sent = polygon_form_factor(points.positions[rows], points.normals[rows], light_mesh.corners) * radiosity
        kept = ~leaves_out(light_mesh.links, light_mesh.tag_ids[None], points.tag_ids[rows][:, None])
        same = mesh_of_light[None] == points.meshes[rows][:, None]
        same &= np.arange(len(light_mesh))[None] != points.lights[rows][:, None]
        sums += [(sent * kept).sum(), (sent * kept * same).sum(), (sent * same).sum()]
    total, on_itself, untagged = (sums / max(total_points, 1)).tolist()
    count = max(len(points.positions), 1)
    return OwnLight(float(own[~lost].sum()) / count, total, on_itself, untagged)
