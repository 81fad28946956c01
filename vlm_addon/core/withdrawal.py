# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that shine on their own region, wherever their vertices go, withdraw into the body by themselves.

To stand behind a region is not enough where it is hollow: its sides look across at the plane of the light. What no
point of the region may see must lie behind the tangent planes of all of them, which is deep inside of the body, where
there is little room. Such a light leaves its neighbours, shrinks and moves inwards, if need be to below the middle of
its region, as little as possible; its strength makes up for its area. It stays inside: along its normal a ray must meet
the back of the surface first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .mesh_topology import Bool, Int64, Rows, rows_of, sum_by, unit_normals
from .own_shares import NEGLIGIBLE, Allowance, own_shares, region_areas
from .placement import insets
from .scene import Float64
from .triangle_tree import TriangleTree, build_tree

# Points of each region at which its own light is measured, first of all lights, then of those that may withdraw.
ROUGH_POINTS, FINE_POINTS = 32, 32
# Mean share of a light's radiosity that its own region may receive.
ALLOWED = 2e-3
WHOLE = Allowance(ALLOWED, np.inf, NEGLIGIBLE)
# Sizes to which lights shrink, and depths to which they move behind the deepest point of their region, in their sizes.
SHRINKS = (1.0, 0.7, 0.45, 0.25)
DEPTHS = (0.0, 0.1, 0.25, 0.5, 1.0, 1.6)
# A light of this share of its region's area or less shrinks no further: few bright points light their surroundings ill.
LEAST_AREA_SHARE = 1.0 / 48.0
# Length of the mean normal of a region below which it faces nowhere.
LEAST_FACING = 0.05
# So many of the best places are looked at whether they are inside; then the light stays where it is.
ATTEMPTS = 24
LIGHTS_PER_BATCH = 64


@dataclass(frozen=True)
class Withdrawal:
    """positions: (v, 3) float64, m. triangles: (n, 3) int64. moved: (n,) bool, lights that left their neighbours. own:
    (n,) share of its radiosity that the region of each light receives from it."""

    positions: Float64
    triangles: Int64
    moved: Bool
    own: Float64


def withdraw(
    positions: Float64,
    triangles: Int64,
    regions: Rows,
    source_corners: Float64,
    report: Callable[[float], None] = lambda share: None,
    allowance: Allowance = WHOLE,
    tree: TriangleTree | None = None,
    own: Float64 | None = None,
) -> Withdrawal:
    """The lights, those with own light moved to where they give less, as far as there is such a place.

    positions: (v, 3), m. triangles: (n, 3). regions: source triangles of each light, rows of source_corners (t, 3, 3),
    m. A light that moves gets vertices of its own after the others; vertices without any light are left out. report:
    called with the share of the work that is done, may raise. allowance: how much own light is none. tree: of
    source_corners, own: (n,) of the lights as of own_shares, where they are known.
    """
    corners = positions[triangles]
    own = own_shares(corners, regions, source_corners, ROUGH_POINTS) if own is None else own.copy()
    offenders = allowance.exceeded(own, region_areas(regions, source_corners))
    moved = np.zeros(len(corners), bool)
    if not len(offenders):
        return Withdrawal(positions, triangles, moved, own)
    tree = tree or build_tree(source_corners)
    aim = min(allowance.each, allowance.together)
    inset = insets(corners)
    for first in range(0, len(offenders), LIGHTS_PER_BATCH):
        report(first / len(offenders))
        rows = offenders[first : first + LIGHTS_PER_BATCH]
        part = rows_of(regions, rows)
        # By themselves: all that follows takes as long as there are source triangles.
        alone = Rows(np.arange(len(part.values)), part.starts)
        placed, left = _best_places(corners[rows], inset[rows], alone, source_corners[part.values], tree, aim)
        changed = left < own[rows]
        corners[rows[changed]], own[rows[changed]], moved[rows[changed]] = placed[changed], left[changed], True
    apart = triangles.copy()
    apart[moved] = len(positions) + np.arange(3 * int(moved.sum())).reshape(-1, 3)
    used, apart = np.unique(apart, return_inverse=True)
    every = np.concatenate([positions, corners[moved].reshape(-1, 3)])
    return Withdrawal(every[used], apart.reshape(-1, 3), moved, own)


def _best_places(
    corners: Float64, inset: Float64, regions: Rows, source_corners: Float64, tree: TriangleTree, aim: float
) -> tuple[Float64, Float64]:
    """(corners, own share) of the nearest place of each light with own light up to `aim`, else of that with the least.

    Places that are not inside of the body are not taken.
    """
    places, effort = _places(corners, inset, regions, source_corners)
    count, each = places.shape[:2]
    flat = places.reshape(-1, 3, 3)
    repeated = rows_of(regions, np.repeat(np.arange(count), each))
    own = own_shares(flat, repeated, source_corners, FINE_POINTS).reshape(count, each)
    # Of places with little own light the one with the least effort.
    score = np.where(own <= aim, effort * aim, own + aim * (1.0 + effort))
    span = _spans(corners, regions, source_corners)
    # A light that is not inside as it stands may shrink there, too.
    shallow = np.arange(each) < len(SHRINKS) * (1 + len(DEPTHS))
    shallow &= np.arange(each) % (1 + len(DEPTHS)) == 0
    free = np.flatnonzero(~_inside(corners, span, tree))
    best, left = np.zeros(count, np.int64), np.full(count, np.inf)
    order, open_rows = np.argsort(score, axis=1, kind="stable"), np.arange(count)
    for attempt in range(min(ATTEMPTS, each)):
        choice = order[open_rows, attempt]
        allowed = shallow[choice] & np.isin(open_rows, free)
        asked = np.flatnonzero(~allowed)
        allowed[asked] = _inside(places[open_rows[asked], choice[asked]], span[open_rows[asked]], tree)
        taken = open_rows[allowed]
        best[taken], left[taken] = choice[allowed], own[taken, choice[allowed]]
        open_rows = open_rows[~allowed]
        if not len(open_rows):
            break
    return places[np.arange(count), best], left


def _places(corners: Float64, inset: Float64, regions: Rows, source_corners: Float64) -> tuple[Float64, Float64]:
    """((n, places, 3, 3) corners, (places,) effort below 1, rising with shrinking, depth and a change of middle).

    The light as it stands first; the places of a size and a middle follow each other by depth.
    """
    regions_area = region_areas(regions, source_corners)
    least = np.sqrt(LEAST_AREA_SHARE * regions_area / np.maximum(_areas(corners), np.finfo(float).tiny))
    shrinks = np.maximum(np.array(SHRINKS), np.minimum(1.0, least)[:, None])
    places, steps = [], []
    for change, start in enumerate((corners, _centred(corners, regions, source_corners))):
        depths = _depths(start, inset, regions, source_corners)
        normal, middle = unit_normals(start), start.mean(axis=1, keepdims=True)
        shrunk = middle[:, None] + shrinks[:, :, None, None] * (start - middle)[:, None]
        places.append(shrunk[:, :, None] - (depths[:, :, None] * normal[:, None])[:, None, :, None, :])
        steps.append(2 * change + np.arange(len(SHRINKS))[:, None] + np.arange(depths.shape[1])[None])
    effort = np.stack(steps).ravel()
    return np.stack(places, axis=1).reshape(len(corners), -1, 3, 3), effort / (effort.max() + 1.0)


def _centred(corners: Float64, regions: Rows, source_corners: Float64) -> Float64:
    """The lights below the middle of their regions, facing as these do on average, as large as they are."""
    owner = np.repeat(np.arange(len(corners)), regions.lengths)
    area = _areas(source_corners)[regions.values]
    total = np.maximum(sum_by(owner, area, len(corners)), np.finfo(float).tiny)[:, None]

    def mean(values: Float64) -> Float64:
        return np.stack([sum_by(owner, values[:, axis] * area, len(corners)) for axis in range(3)], axis=1) / total

    centre = mean(source_corners[regions.values].mean(axis=1))
    facing = mean(unit_normals(source_corners[regions.values]))
    length = np.linalg.norm(facing, axis=1, keepdims=True)
    facing = np.where(length > LEAST_FACING, facing / np.maximum(length, LEAST_FACING), unit_normals(corners))
    across = corners[:, 1] - corners[:, 0]
    across = across - np.einsum("ij,ij->i", across, facing)[:, None] * facing
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny)
    # An equilateral triangle of the same area.
    radius = np.sqrt(_areas(corners) * 4.0 / (3.0 * np.sqrt(3.0)))[:, None]
    up = np.cross(facing, across)
    turns = [(np.cos(angle), np.sin(angle)) for angle in (0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0)]
    return np.stack([centre + radius * (cosine * across + sine * up) for cosine, sine in turns], axis=1)


def _depths(corners: Float64, inset: Float64, regions: Rows, source_corners: Float64) -> Float64:
    """(n, 1 + DEPTHS) m: how far back to move each light: not at all, or to behind its whole region and beyond."""
    owner = np.repeat(np.arange(len(corners)), regions.lengths)
    offset = source_corners[regions.values] - corners[owner, :1]
    height = np.einsum("ikj,ij->ik", offset, unit_normals(corners)[owner]).min(axis=1)
    deepest = np.zeros(len(corners))
    np.minimum.at(deepest, owner, height)
    size = np.sqrt(_areas(corners))
    return np.stack([np.zeros(len(corners)), *[inset - deepest + share * size for share in DEPTHS]], axis=1)


def _spans(corners: Float64, regions: Rows, source_corners: Float64) -> Float64:
    """(n,) m: farthest way from each light to a corner of its region, at least its own extent."""
    owner = np.repeat(np.arange(len(corners)), regions.lengths)
    way = np.linalg.norm(source_corners[regions.values] - corners.mean(axis=1)[owner, None], axis=2).max(axis=1)
    farthest = 2.0 * np.sqrt(_areas(corners))
    np.maximum.at(farthest, owner, way)
    return farthest


def _inside(corners: Float64, span: Float64, tree: TriangleTree) -> Bool:
    """(n,) whether all corners and the middle of each light look along its normal at the back of a surface."""
    way = span[:, None] * unit_normals(corners)
    inside = np.ones(len(corners), bool)
    for points in (corners.mean(axis=1), *np.moveaxis(corners, 1, 0)):
        rows = np.flatnonzero(inside)
        met = tree.first_met(points[rows], points[rows] + way[rows])
        facing = np.einsum("ij,ij->i", unit_normals(tree.corners[met]), way[rows]) > 0
        inside[rows] = (met >= 0) & facing
    return inside


def _areas(corners: Float64) -> Float64:
    areas: Float64 = 0.5 * np.linalg.norm(_vectors(corners), axis=1)
    return areas


def _vectors(corners: Float64) -> Float64:
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
