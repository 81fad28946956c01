# SPDX-License-Identifier: GPL-3.0-or-later
"""Where no light can stand behind its surface: thin curved bodies and sheets that are seen from both sides.

Thin is meant against the light, not in metres (seed 002, figures 3.6 and 3.7): a slab of any thickness hides a flat
light, while a body whose surface bulges inwards of its light's plane by more than half of its thickness hides none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .corner_arrays import highest, lowest, middles
from .light_mesh import VirtualLightMesh
from .mesh_topology import Bool, Int64, closed_shells, unit_normals, weld
from .nearest_lights import light_of_triangles
from .placement import STEEPEST_COSINE, THICKNESS_SHARE, insets
from .progress import Report, between
from .sampling import square_to_triangle
from .scene import Float64, Int32, Mesh
from .triangle_tree import TriangleTree, build_tree

Lights = npt.NDArray[np.integer[Any]]

# Rays from the back of each light's region that look for what sees it from behind.
BACK_RAYS = 16
# So many of them first; only where one meets a front, the others.
FIRST_RAYS = 4
# Share of these that must meet the front of something, more than meet backs or what lies close behind.
SEEN_SHARE = 0.25
# What is nearer to the back of a region than this share of its extent hides it.
GAP_SHARE = 0.25
# A ray starts this share of the scene's half diagonal behind its surface.
START_SHARE = 1e-6
# Share of the time that it takes to find the nearest lights.
NEAREST_TIME = 0.5


@dataclass(frozen=True)
class ThinSurface:
    """For each mesh, (its triangles,) bool. thin: the body bulges inwards of the plane of its light by more than its
    thickness allows. two_sided: open sheets whose back other surfaces face."""

    thin: tuple[Bool, ...]
    two_sided: tuple[Bool, ...]


def thin_triangles(
    meshes: Sequence[Mesh],
    light_mesh: VirtualLightMesh,
    light_of_triangle: npt.ArrayLike | None = None,
    report: Report = lambda share: None,
) -> ThinSurface:
    """The triangles of `meshes` that need tags, whether or not they have any.

    light_of_triangle: (all triangles,) int, -1 for none; the nearest light by default. report: called with the share
    of the work that is done, may raise.
    """
    counts = [len(mesh.triangles) for mesh in meshes]
    if not sum(counts) or not len(light_mesh):
        none = tuple(np.zeros(count, bool) for count in counts)
        return ThinSurface(none, none)
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in meshes])
    if light_of_triangle is None:
        lights: Int32 = light_of_triangles(light_mesh.corners, corners, between(report, 0.0, NEAREST_TIME))
    else:
        lights = np.asarray(light_of_triangle, np.int32)
    tree = build_tree(corners)
    at = np.cumsum(counts)[:-1]
    half = 0.5 * (1.0 + NEAREST_TIME)
    thin = thin_against(light_mesh.corners, lights, corners, tree, between(report, NEAREST_TIME, half))
    seen = two_sided(lights, corners, open_triangles(meshes), tree, between(report, half, 1.0))
    return ThinSurface(tuple(np.split(thin, at)), tuple(np.split(seen, at)))


def thin_against(
    light_corners: Float64, lights: Lights, corners: Float64, tree: TriangleTree, report: Report = lambda share: None
) -> Bool:
    """(t,) whether each source triangle (t, 3, 3) belongs to a region that bulges inwards by more than its body allows.

    The bulge of a region is the height that its corners span over the plane of its light. lights: (t,), -1 for none.
    tree: of the source triangles. report: called with the share of the rays that are done, may raise.
    """
    rows = np.flatnonzero(lights >= 0)
    light = lights[rows]
    light_normals, normals = unit_normals(light_corners), unit_normals(corners)
    cosine = np.einsum("ij,ij->i", normals[rows], light_normals[light])
    rows, light = rows[cosine > STEEPEST_COSINE], light[cosine > STEEPEST_COSINE]
    height = np.einsum("ikj,ij->ik", corners[rows] - light_corners[light, :1], light_normals[light])
    low, high = np.full(len(light_corners), np.inf), np.full(len(light_corners), -np.inf)
    np.minimum.at(low, light, height.min(axis=1))
    np.maximum.at(high, light, height.max(axis=1))
    bulge = np.where(high > low, high - low, 0.0)
    looked_at = bulge[light] > 2.0 * insets(light_corners)[light]
    rows, light = rows[looked_at], light[looked_at]
    middle = middles(corners[rows])
    reach = normals[rows] * (bulge[light] / THICKNESS_SHARE)[:, None]
    thin = np.zeros(len(corners), bool)
    thin[rows] = np.isfinite(tree.first_hits(middle, middle - reach, True, report))
    return thin


def open_triangles(meshes: Sequence[Mesh]) -> Bool:
    """(t,) over all triangles of `meshes`: whether each belongs to a shell with a border."""
    parts = []
    for mesh in meshes:
        if not len(mesh.triangles):
            continue
        same = weld(mesh.positions.astype(np.float64), np.zeros(len(mesh.positions), np.int64))
        triangles = same[mesh.triangles]
        solid = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
        is_open = np.ones(len(triangles), bool)
        shell, closed = closed_shells(triangles[solid], len(mesh.positions))
        is_open[solid] = ~closed[shell]
        parts.append(is_open)
    return np.concatenate(parts) if parts else np.zeros(0, bool)


def two_sided(
    lights: Lights, corners: Float64, is_open: Bool, tree: TriangleTree, report: Report = lambda share: None
) -> Bool:
    """(t,) triangles of sheets whose back some surface faces: by BACK_RAYS rays from the back of each region.

    Only triangles of `is_open` count. What lies inside of an open body meets backs of its own and is not seen. report:
    called with the share of the rays that are done, may raise.
    """
    rows = np.flatnonzero(is_open & (lights >= 0))
    seen = np.zeros(len(corners), bool)
    if not len(rows):
        return seen
    _, region = np.unique(lights[rows], return_inverse=True)
    count = int(region.max()) + 1
    points, directions = _back_rays(corners[rows], region, count)
    gap = GAP_SHARE * _extents(corners[rows], region, count)
    faced, hidden = np.zeros(count, np.int64), np.zeros(count, np.int64)
    looked_at = np.arange(count)
    for rays in (np.arange(FIRST_RAYS), np.arange(FIRST_RAYS, BACK_RAYS)):
        which = (looked_at[:, None] * BACK_RAYS + rays).ravel()
        done = between(report, rays[0] / BACK_RAYS, (rays[-1] + 1) / BACK_RAYS)
        gaps = np.repeat(gap[looked_at], len(rays))
        fronts, others = _met_sides(points[which], directions[which], gaps, tree, done)
        faced[looked_at] += fronts.reshape(-1, len(rays)).sum(axis=1)
        hidden[looked_at] += others.reshape(-1, len(rays)).sum(axis=1)
        # What is faced at all often enough shows in the first rays.
        looked_at = np.flatnonzero(faced > 0)
    seen[rows] = ((faced >= SEEN_SHARE * BACK_RAYS) & (faced > hidden))[region]
    return seen


def _extents(corners: Float64, region: Int64, count: int) -> Float64:
    """(count,) m: diagonal of the box of each region's triangles."""
    low, high = np.full((3, count), np.inf), np.full((3, count), -np.inf)
    for axis, (least, most) in enumerate(zip(lowest(corners).T, highest(corners).T, strict=True)):
        np.minimum.at(low[axis], region, least)
        np.maximum.at(high[axis], region, most)
    extents: Float64 = np.linalg.norm(high - low, axis=0)
    return extents


def _met_sides(
    points: Float64, directions: Float64, gap: Float64, tree: TriangleTree, report: Report
) -> tuple[Bool, Bool]:
    """((r,) whether each ray from just off `points` first meets a front farther off than the gap, or else anything)."""
    diagonal = tree.diagonal
    start = points + START_SHARE * diagonal * directions
    met, fraction = tree.first_met_at(start, points + diagonal * directions, report=report)
    facing = np.einsum("ij,ij->i", unit_normals(tree.corners[met]), directions) < 0
    front: Bool = (met >= 0) & facing & (fraction * diagonal > gap)
    return front, (met >= 0) & ~front


def _back_rays(corners: Float64, region: Int64, count: int) -> tuple[Float64, Float64]:
    """(points, unit directions): BACK_RAYS from the back of each of `count` regions, even over area and cosine."""
    random = np.random.default_rng(0)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    order = np.argsort(region, kind="stable")
    sums = np.cumsum(area[order])
    ends = np.searchsorted(region[order], np.arange(count), side="right")
    begin = np.concatenate([[0.0], sums[ends[:-1] - 1]])
    owner = np.repeat(np.arange(count), BACK_RAYS)
    # The first rays are spread over the whole region, too.
    place = np.arange(BACK_RAYS).reshape(FIRST_RAYS, -1).T.ravel()
    along = (np.tile(place, count) + random.random(len(owner))) / BACK_RAYS
    at = begin[owner] + along * (sums[ends - 1] - begin)[owner]
    slot = np.clip(np.searchsorted(sums, at), np.concatenate([[0], ends[:-1]])[owner], ends[owner] - 1)
    triangle = order[slot]
    inside = square_to_triangle(random.random(len(owner)), random.random(len(owner)))
    points = np.einsum("ik,ikj->ij", inside, corners[triangle])
    unit = normal[triangle] / np.where(area[triangle] > 0, area[triangle], 1.0)[:, None]
    ball = random.normal(size=(len(owner), 3))
    # Normal plus a uniform direction is spread by the cosine.
    directions = -unit + 0.999 * ball / np.linalg.norm(ball, axis=1, keepdims=True)
    return points, directions / np.linalg.norm(directions, axis=1, keepdims=True)
