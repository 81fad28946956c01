# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual lights are pushed behind the surface that they stand for (seed 002, section 3.4, figures 3.5 and 3.7).

Each light asks for its plane to be moved back until no point of its region lies behind it. Vertices first take the
short way (least_push.py), which leaves a little; a vertex belongs to several lights, so it then goes to the nearest
point that lies behind all of its moved planes. Moving shared vertices keeps closed shells closed. No vertex goes
further than a share of the thickness of the body there: both sides of a thin shell can move without passing each
other. What then still stands in front needs tags (section 3.4).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .corner_arrays import middles
from .least_push import least_push
from .mesh_topology import Bool, Int64, Rows, normals_and_areas, only_rows, sum_by, unit_normals, vertex_faces
from .parallel import side_by_side, slices
from .region_heights import heights, least_squares
from .scene import Float64
from .triangle_distance import flat_triangles
from .triangle_tree import TriangleTree, build_tree

FirstHits = Callable[[Float64, Float64, bool], Float64]

ROUNDS = 3
# Share of the time that the short way takes.
PUSH_TIME = 0.4
SWEEPS = 16
# A plane counts as cleared when less than this share of the wanted depth is missing.
SOLVED_SHARE = 1e-3
# Of the thickness, for one side; below one half, so that two sides that move towards each other do not meet.
THICKNESS_SHARE = 0.4
# Of the size (square root of the area) of the smallest light around a vertex.
LARGEST_STEP = 0.5
# A float32 coordinate relative to the middle of the lights is off by up to 2^-25 of the half diagonal, and a height
# n.(v - p) sums three products of two such coordinates: about 8 such errors. 32 of them leave a margin of four, so
# a wall is exactly dark to itself in the shaders, yet moves by only a millionth of the scene.
INSET_SHARE = 2.0**-20
# The inset of a light small against the scene, as a share of the light's size.
LARGEST_INSET = 1e-3
# A vertex goes up to sqrt(3) insets where three walls meet at right angles.
INSETS_UNSEEN = 2.0
# Source triangles that face further away than this from their light do not push it: it would never clear them.
STEEPEST_COSINE = 0.2
LEAST_TURN_COSINE = 0.2
LEAST_AREA_SHARE = 0.05
# Pairs of a vertex and a source triangle that are looked at together.
PAIRS_PER_BATCH = 1 << 15


@dataclass(frozen=True)
class Placement:
    """positions: (v, 3) float64, m. limited: (n,) bool, lights that the thickness kept from moving far enough.
    depth: (n,) m, how far each light that was pushed still stands in front of its region."""

    positions: Float64
    limited: Bool
    depth: Float64


@dataclass(frozen=True)
class BodyTrees:
    """Trees over the lights and over the surface, each built when it is first asked for."""

    light_corners: Float64
    source_corners: Float64

    @cached_property
    def lights(self) -> TriangleTree:
        """Over the lights as they were before any push."""
        return build_tree(self.light_corners)

    @cached_property
    def source(self) -> TriangleTree:
        """Over the visible surface."""
        return build_tree(self.source_corners)


@dataclass(frozen=True)
class RegionFacts:
    """What regions are to lights before any push. facing: their triangles that face as their light does. towards:
    (n, 3) where these face. surface_points: (v, 3) m, the point of them that is about the nearest to each vertex."""

    facing: Rows
    towards: Float64
    surface_points: Float64

    @staticmethod
    def of(positions: Float64, triangles: Int64, regions: Rows, source_corners: Float64) -> RegionFacts:
        """Of what `place_behind` is given."""
        facing = _facing_regions(positions[triangles], regions, source_corners)
        around = vertex_faces(triangles, len(positions))
        points = _surface_points(positions, facing, source_corners, around)
        return RegionFacts(facing, _mean_normals(facing, source_corners), points)


def place_behind(
    positions: Float64,
    triangles: Int64,
    regions: Rows,
    source_corners: Float64,
    report: Callable[[float], None] = lambda share: None,
    pushing: Bool | None = None,
    trees: BodyTrees | None = None,
    facts: RegionFacts | None = None,
) -> Placement:
    """`positions` moved so that the plane of each light lies behind its region as far as the body is thick enough.

    positions: (v, 3). triangles: (n, 3). regions: source triangles of each light. source_corners: (t, 3, 3), m. No
    triangle turns over or loses more than 1 - LEAST_AREA_SHARE of its area. report: called with the share of the work
    that is done, may raise. pushing: (n,) lights that are to stand behind their regions, by default all; the
    others only by their insets. trees: of positions[triangles] and source_corners, facts: of regions, if known.
    """
    if not len(triangles):
        return Placement(positions, np.zeros(0, bool), np.zeros(0))
    facts = facts or RegionFacts.of(positions, triangles, regions, source_corners)
    facing, towards, surface_points = facts.facing, facts.towards, facts.surface_points
    inset = insets(positions[triangles])
    around = vertex_faces(triangles, len(positions))
    trees = trees or BodyTrees(positions[triangles], source_corners)
    pushing = np.ones(len(triangles), bool) if pushing is None else pushing
    pressing = only_rows(facing, pushing)
    longest = LARGEST_STEP * _smallest_around(np.sqrt(normals_and_areas(positions[triangles])[1]), around)
    # What moves by the insets alone is not looked at: no body that shows is that thin.
    least = INSETS_UNSEEN * _largest_around(inset, around)
    moved = least_push(positions, triangles, pressing, source_corners, inset, lambda share: report(PUSH_TIME * share))
    resting = np.where(pushing, -np.inf, inset)
    moved = moved + _behind_planes(unit_normals((positions + moved)[triangles]), resting, around)
    looked_at = np.zeros_like(positions)
    stopped = np.zeros(len(positions), bool)
    for round_ in range(1 + ROUNDS):
        report(PUSH_TIME + (1.0 - PUSH_TIME) * round_ / (1 + ROUNDS))
        if round_:
            corners = (positions + moved)[triangles]
            wanted = intrusions(corners, pressing, source_corners) + inset
            moved = moved + _behind_planes(unit_normals(corners), wanted, around)
        moved = _shortened(moved, longest)
        length = np.linalg.norm(moved, axis=1)
        fresh = np.linalg.norm(moved - looked_at, axis=1) > np.maximum(least, 0.01 * length)
        if not round_:
            # Simplification may have brought a vertex beyond the back.
            fresh |= (length > 0) & (np.linalg.norm(surface_points - positions, axis=1) > least)
        if fresh.any():
            moved, hit = _inside_body(positions, moved, np.flatnonzero(fresh), surface_points, trees)
            # Later rounds may turn the way of a stopped vertex past the edge of what stopped it, but not lengthen it.
            longest[hit] = np.minimum(longest, np.linalg.norm(moved, axis=1))[hit]
            stopped |= hit
        looked_at[fresh] = moved[fresh]
        moved = _without_flips(positions, moved, triangles, towards)
    depth = intrusions((positions + moved)[triangles], pressing, source_corners)
    limited = stopped[triangles].any(axis=1) & (depth > inset) & pushing
    return Placement(positions + moved, limited, np.maximum(depth, 0.0))


def insets(corners: Float64) -> Float64:
    """(n,) m: how far each light is set behind a surface that it lies in exactly."""
    points = corners.reshape(-1, 3)
    half_diagonal = 0.5 * float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
    return np.minimum(INSET_SHARE * half_diagonal, LARGEST_INSET * np.sqrt(normals_and_areas(corners)[1]))


def intrusions(corners: Float64, regions: Rows, source_corners: Float64) -> Float64:
    """(n,) m: how far each light's plane stands in front of the deepest corner of its region.

    Negative where the plane lies behind the whole region; -inf for a light without one.
    """
    normals, _ = normals_and_areas(corners)
    height = _heights(corners, normals, regions, source_corners).min(axis=0)
    deepest = np.full(len(corners), np.inf)
    filled = regions.lengths > 0
    deepest[filled] = np.minimum.reduceat(height, regions.starts[:-1][filled])
    return -deepest


def _heights(corners: Float64, normals: Float64, regions: Rows, source_corners: Float64) -> Float64:
    """(3, m) m: of the corners of each triangle of the regions over the plane of its light."""
    places = source_corners.take(regions.values, axis=0).transpose(1, 2, 0)
    return np.stack([heights(place, regions.lengths, corners[:, 0], normals) for place in places])


def share_in_front(corners: Float64, regions: Rows, source_corners: Float64) -> float:
    """Share of the source surface, by area, that lies behind the plane of its own light by more than rounding.

    Judged at the corners and the middle of every source triangle.
    """
    normals, _ = normals_and_areas(corners)
    height = _heights(corners, normals, regions, source_corners)
    weight = normals_and_areas(source_corners)[1][regions.values]
    allowed = np.repeat(-0.5 * insets(corners), regions.lengths)
    behind = sum((each < allowed).astype(float) for each in (*height, height.mean(axis=0))) / 4.0
    return float(behind @ weight / max(weight.sum(), np.finfo(float).tiny)) if len(weight) else 0.0


def _facing_regions(corners: Float64, regions: Rows, source_corners: Float64) -> Rows:
    owner = np.repeat(np.arange(len(corners)), regions.lengths)
    normals = unit_normals(source_corners).take(regions.values, axis=0)
    cosine = np.einsum("ij,ij->i", normals, unit_normals(corners)[owner])
    keep = cosine > STEEPEST_COSINE
    starts = np.concatenate([[0], np.cumsum(np.bincount(owner[keep], minlength=len(corners)))])
    return Rows(regions.values[keep], starts)


def _mean_normals(regions: Rows, source_corners: Float64) -> Float64:
    """(n, 3) unit: area-weighted mean normal of each region, 0 for an empty one."""
    vectors = np.cross(source_corners[:, 1] - source_corners[:, 0], source_corners[:, 2] - source_corners[:, 0])
    vectors = vectors.take(regions.values, axis=0)
    owner = np.repeat(np.arange(len(regions.starts) - 1), regions.lengths)
    sums = np.stack([sum_by(owner, vectors[:, axis], len(regions.lengths)) for axis in range(3)], axis=1)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    mean: Float64 = sums / np.where(length > 0, length, 1.0)
    return mean


def _smallest_around(values: Float64, around: Rows) -> Float64:
    return -_largest_around(-values, around)


def _largest_around(values: Float64, around: Rows) -> Float64:
    """(v,): the largest of the values of the lights around each vertex, 0 without any."""
    largest = np.zeros(len(around.starts) - 1)
    filled = around.lengths > 0
    largest[filled] = np.maximum.reduceat(values[around.values], around.starts[:-1][filled])
    return largest


def _behind_planes(normals: Float64, wanted: Float64, around: Rows) -> Float64:
    """(v, 3): the short way of each vertex to behind the planes of its lights, each moved back by `wanted`.

    Projection onto each half-space in turn, SWEEPS times: exact at once where the normals agree or are at right
    angles, and close to the nearest such point elsewhere.
    """
    step = np.zeros((len(around.starts) - 1, 3))
    active = np.arange(len(step))
    for _ in range(SWEEPS):
        busy = np.zeros(len(active), bool)
        valence = around.lengths[active]
        for slot in range(int(valence.max(initial=0))):
            row = np.flatnonzero(valence > slot)
            vertex = active[row]
            light = around.values[around.starts[vertex] + slot]
            excess = np.einsum("ij,ij->i", normals[light], step[vertex]) + wanted[light]
            step[vertex] -= np.maximum(excess, 0.0)[:, None] * normals[light]
            busy[row] |= excess > SOLVED_SHARE * np.abs(wanted[light])
        active = active[busy]
    return step


def _shortened(moved: Float64, longest: Float64) -> Float64:
    length = np.linalg.norm(moved, axis=1)
    return moved * np.minimum(1.0, longest / np.where(length > 0, length, 1.0))[:, None]


def _surface_points(positions: Float64, regions: Rows, source_corners: Float64, around: Rows) -> Float64:
    """(v, 3) m: about the nearest point to each vertex of the regions of the lights around it; itself without any.

    That of the source triangle of which a corner or the middle is nearest.
    """
    vertex, light = around.expand(np.arange(len(positions)))
    of_pair, triangle = regions.expand(light)
    vertex = vertex[of_pair]
    points = positions.copy()
    if not len(vertex):
        return points
    place = np.stack([*np.moveaxis(source_corners, 1, 0), middles(source_corners)]).transpose(0, 2, 1).copy()
    square = np.concatenate(
        list(
            side_by_side(
                lambda rows: least_squares(place, triangle[rows], positions.T, vertex[rows]),
                slices(len(vertex), PAIRS_PER_BATCH),
            )
        )
    )
    starts = np.flatnonzero(np.diff(vertex, prepend=-1))
    least = np.repeat(np.minimum.reduceat(square, starts), np.diff(np.append(starts, len(vertex))))
    row = np.flatnonzero(square == least)
    first = row[np.searchsorted(row, starts)]
    chosen = triangle[first]
    flat = flat_triangles(source_corners[chosen])
    points[vertex[first]] = flat.nearest_points(positions[vertex[first]], np.arange(len(chosen)))
    return points


def _inside_body(
    positions: Float64, moved: Float64, active: Int64, surface_points: Float64, trees: BodyTrees
) -> tuple[Float64, Bool]:
    """Moves cut by the lights' other side, which may come towards them, and by the body's, and which were cut."""
    moved, hit = _within_thickness(positions, moved, active, positions, trees.lights.first_hits)
    moved, out = _within_thickness(positions, moved, active, surface_points, trees.source.first_hits)
    return moved, hit | out


def _within_thickness(
    positions: Float64, moved: Float64, active: Int64, surface_points: Float64, first_hits: FirstHits
) -> tuple[Float64, Bool]:
    """Moves of the active vertices cut to THICKNESS_SHARE of the way from the surface above them to where they would
    leave the body, and which were cut."""
    depth = positions[active] + moved[active] - surface_points[active]
    inwards = np.einsum("ij,ij->i", depth, moved[active]) > 0
    active, depth = active[inwards], depth[inwards]
    reach = depth / THICKNESS_SHARE
    # A short way inside, so that the triangles around the point itself are not met.
    start = surface_points[active] + 0.01 * reach
    fraction = first_hits(start, surface_points[active] + reach, True)
    cut = fraction < 1.0
    moved = moved.copy()
    kept = depth[cut] * (0.01 + 0.99 * fraction[cut])[:, None]
    moved[active[cut]] = surface_points[active[cut]] + kept - positions[active[cut]]
    stopped = np.zeros(len(positions), bool)
    stopped[active[cut]] = True
    return moved, stopped


def _without_flips(positions: Float64, moved: Float64, triangles: Int64, towards: Float64) -> Float64:
    """Moves of the vertices of every triangle that would turn over or nearly vanish, halved until none does.

    towards: (n, 3) where the region of each light faces; no light may turn further away from it than at the start.
    """
    before, area_before = normals_and_areas(positions[triangles])
    facing_before = np.einsum("ij,ij->i", before, towards)
    moved = moved.copy()
    halvings = 0
    while True:
        after, area_after = normals_and_areas((positions + moved)[triangles])
        turned = np.einsum("ij,ij->i", before, after) < LEAST_TURN_COSINE
        turned |= np.einsum("ij,ij->i", after, towards) < np.minimum(LEAST_TURN_COSINE, facing_before)
        bad = (turned | (area_after < LEAST_AREA_SHARE * area_before)) & (area_before > 0)
        bad &= (moved[triangles] != 0).any(axis=(1, 2))
        if not bad.any():
            return moved
        moved[np.unique(triangles[bad])] *= 0.5 if halvings < 6 else 0.0
        halvings += 1
