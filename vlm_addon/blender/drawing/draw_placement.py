# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawn faces are set behind the surface under them (seed 002, section 3.4, figures 3.5 and 3.7).

Pieces of each triangle are dropped onto the surface; the triangle's plane then goes back until no piece lies behind
it, but not farther than a share of the thickness of the body there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.errors import InvalidInput
from ...core.mesh_topology import Rows
from ...core.placement import LARGEST_INSET, THICKNESS_SHARE, intrusions
from ...core.scene import Float64
from .draw_surfaces import SurfaceHit, hits_along, surface_under
from .drawn_faces import Faces, triangles_of

SIDES = ((4, 4), (8, 3))
"""Up to so many triangles are cut into so many pieces a side, more of them into COARSE_SIDE."""
COARSE_SIDE = 2

REACH_SHARE = 0.7
"""How far over or under a face its surface is looked for, as a share of the face's size (square root of its area)."""

MARGIN = 1.1
"""Between the places that are looked at a curved surface goes a little deeper."""

INWARD = 1e-3
"""Share by which pieces are drawn in towards the middle of their triangle, off the edges where surfaces meet."""

ROUNDS = 4
SWEEPS = 16


@dataclass(frozen=True)
class Pieces:
    """Small triangles that the faces consist of, and the surface under them.

    corners: (p, 3, 3) float64 world. faces, triangles: (p,) the face and the triangle of each. areas: (p,) m². hits:
    surface under the middle of each, None where there is none. ground: (p, 4, 3), the corners and the middle dropped
    onto the surface, NaN where they miss it.
    """

    corners: Float64
    faces: np.ndarray
    triangles: np.ndarray
    areas: Float64
    hits: tuple[SurfaceHit | None, ...]
    ground: Float64


@dataclass(frozen=True)
class Placed:
    """points: (v, 3) float64. in_front: (f,) bool, faces that are still in front of their surface."""

    points: Float64
    in_front: np.ndarray


def pieces_of(faces: Faces, scene: Any, depsgraph: Any, sign: float = 1.0) -> Pieces:
    """The pieces of faces with the surface under them; sign: -1 for surfaces that face the other way.

    Raises InvalidInput where no face has a triangle with an area.
    """
    triangles, owners = triangles_of(faces)
    if not len(triangles):
        raise InvalidInput("polygon", "no part of it has an area", "draw it larger")
    side = next((side for most, side in SIDES if len(triangles) <= most), COARSE_SIDE)
    nodes, cells = _grid(side)
    corners, ground, hits, areas = [], [], [], []
    for triangle in triangles:
        placed = faces.points[triangle]
        vector = np.cross(placed[1] - placed[0], placed[2] - placed[0])
        double_area = float(np.linalg.norm(vector))
        normal = vector / double_area
        reach = REACH_SHARE * np.sqrt(0.5 * double_area) + float(np.ptp(placed @ normal))
        points = nodes @ placed
        middles = points[cells].mean(axis=1)
        dropped = [
            surface_under(scene, depsgraph, point, normal, reach, sign) for point in np.concatenate([points, middles])
        ]
        places = np.array([np.full(3, np.nan) if hit is None else hit.location for hit in dropped])
        corners.append(points[cells])
        ground.append(np.concatenate([places[cells], places[len(points) :, None]], axis=1))
        hits += dropped[len(points) :]
        areas += [0.5 * double_area / len(cells)] * len(cells)
    count = len(cells)
    return Pieces(
        corners=np.concatenate(corners),
        faces=np.repeat(owners, count),
        triangles=np.repeat(np.arange(len(triangles)), count),
        areas=np.array(areas),
        hits=tuple(hits),
        ground=np.concatenate(ground),
    )


def behind_surface(
    faces: Faces, pieces: Pieces, fixed: np.ndarray, scene: Any, depsgraph: Any, extra: float = 0.0
) -> Placed:
    """The points of `faces` moved so that every plane lies behind the surface under it.

    fixed: points that stay where they are. extra: m, farther than needed. Where the body is too thin, faces go as far
    as half of it allows and are told to be in front.
    """
    triangles, owners = triangles_of(faces)
    regions, ground = _regions(pieces, len(triangles))
    normals, areas = _planes(faces.points[triangles])
    inset = LARGEST_INSET * np.sqrt(areas) + extra
    allowed = _room_behind(pieces, normals, inset, scene, depsgraph)
    free = ~np.asarray(fixed, bool)
    moved = faces.points
    for _ in range(ROUNDS):
        normals, _ = _planes(moved[triangles])
        wanted = _deepest(moved[triangles], regions, ground) + inset
        gone = np.einsum("ij,ij->i", normals, (faces.points - moved)[triangles].mean(axis=1))
        moved = moved + _behind(normals, np.minimum(wanted, allowed - gone), triangles, free)
    left = _deepest(moved[triangles], regions, ground)
    in_front = np.zeros(len(faces.corners), bool)
    in_front[owners[left > 0.0]] = True
    return Placed(moved, in_front)


def _deepest(corners: Float64, regions: Rows, ground: Float64) -> Float64:
    """(t,) m: how far each plane stands in front of its ground; 0 without any, for such lights stay where they are."""
    depth = intrusions(corners, regions, ground)
    return np.where(np.isfinite(depth), np.where(depth > 0.0, MARGIN * depth, depth), -np.inf)


def _regions(pieces: Pieces, triangles: int) -> tuple[Rows, Float64]:
    """The pieces of each triangle that lie over a surface, and their corners on it."""
    whole = np.isfinite(pieces.ground).all(axis=(1, 2))
    counts = np.bincount(pieces.triangles[whole], minlength=triangles)
    return Rows(np.arange(int(whole.sum())), np.concatenate([[0], np.cumsum(counts)])), pieces.ground[whole]


def _planes(corners: Float64) -> tuple[Float64, Float64]:
    """(t, 3) unit normals and (t,) areas of triangles."""
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(vectors, axis=1)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)[:, None], 0.5 * lengths


def _room_behind(pieces: Pieces, normals: Float64, inset: Float64, scene: Any, depsgraph: Any) -> Float64:
    """(t,) m: THICKNESS_SHARE of the least thickness of the body under each triangle, at the middles of its pieces."""
    sizes = np.sqrt(np.bincount(pieces.triangles, pieces.areas, len(normals)))
    room = np.full(len(normals), np.inf)
    for hit, triangle in zip(pieces.hits, pieces.triangles.tolist(), strict=True):
        if hit is None:
            continue
        start = hit.location - 0.1 * inset[triangle] * normals[triangle]
        for other in hits_along(scene, depsgraph, start, -normals[triangle], float(sizes[triangle])):
            if other.normal @ hit.normal < 0.0:
                room[triangle] = min(room[triangle], THICKNESS_SHARE * (other.distance + 0.1 * inset[triangle]))
                break
    return room


def _behind(normals: Float64, wanted: Float64, triangles: np.ndarray, free: np.ndarray) -> Float64:
    """(v, 3): a short way of each free point to behind the planes of its triangles, each moved back by `wanted`."""
    step = np.zeros((len(free), 3))
    for _ in range(SWEEPS):
        before = step.copy()
        for normal, depth, triangle in zip(normals, wanted, triangles, strict=True):
            rows = triangle[free[triangle]]
            excess = np.maximum(step[rows] @ normal + depth, 0.0)
            step[rows] -= excess[:, None] * normal
        if np.array_equal(step, before):
            break
    return step


def _grid(side: int) -> tuple[Float64, np.ndarray]:
    """Weights (n, 3) of the nodes that cut a triangle into side² pieces, a little inward, and the pieces' nodes."""
    index: dict[tuple[int, int], int] = {}
    nodes: list[tuple[float, float, float]] = []
    cells: list[tuple[int, int, int]] = []
    for i in range(side + 1):
        for j in range(side + 1 - i):
            index[i, j] = len(nodes)
            nodes.append(((side - i - j) / side, i / side, j / side))
    for i in range(side):
        for j in range(side - i):
            cells.append((index[i, j], index[i + 1, j], index[i, j + 1]))
            if i + j < side - 1:
                cells.append((index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]))
    return (1.0 - INWARD) * np.array(nodes) + INWARD / 3.0, np.array(cells)
