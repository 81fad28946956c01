# SPDX-License-Identifier: GPL-3.0-or-later
"""How much each light shines on its own region, and how much of that there may be.

A light must not shine on the surface that it stands for (seed 002, section 3.4), but one that cuts the relief of its
region hardly does: what lies behind its plane is dark, and what lies in front faces away from it. To move it costs
accuracy of the bounce elsewhere, so it is moved only as far as its own light calls for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .corner_arrays import middles
from .form_factor import paired_form_factor
from .light_mesh import SourceSamples
from .mesh_topology import Int64, Rows, normals_and_areas, rows_of, sum_by
from .parallel import side_by_side, slices
from .progress import Report
from .sampling import sample_regions
from .scene import Float64

# Mean share of a light's radiosity that its own region may receive.
ALLOWED = 3e-2
# Own light of all surfaces over all their light from lights, of which at most 1 % may be own light: the rest is for
# what points of a region measure amiss, and for the light that walls between keep out.
ALLOWED_OF_TOTAL = 3e-3
# Mean own light of all surfaces, of lights of radiosity 1, that matters to no picture.
NEGLIGIBLE = 3e-5
# Points at which all light is summed.
TOTAL_POINTS = 256
# Points whose form factors are found together.
POINTS_PER_BATCH = 1 << 16


@dataclass(frozen=True)
class Allowance:
    """How much own light there may be. each: mean share of its radiosity that the region of a light may receive.
    together: mean over the surface, of lights of radiosity 1. negligible: mean over the surface that the least of
    those which exceed `each` may leave together."""

    each: float
    together: float
    negligible: float = 0.0

    def scaled(self, share: float) -> Allowance:
        """A share of what each and all may have."""
        return Allowance(share * self.each, share * self.together, self.negligible)

    def exceeded(self, own: Float64, areas: Float64) -> Int64:
        """The lights with too much own light, most of it first. own: (n,) as of own_shares. areas: (n,) m² of their
        regions."""
        whole = float(areas.sum())
        received = own * areas / (whole if whole > 0.0 else 1.0)
        order = np.argsort(-received, kind="stable")
        # Of each with those that follow.
        left = np.cumsum(received[order][::-1])[::-1]
        over = ((own[order] > self.each) & (left > self.negligible)) | (left > self.together)
        return order[over & (received[order] > 0.0)]


def allowance_of(
    corners: Float64, regions: Rows, source_corners: Float64, source_areas: Float64 | None = None
) -> Allowance:
    """What own light the lights may have, by all the light that they give to the surface.

    corners: (n, 3, 3), m. regions: rows of source_corners (t, 3, 3) for each light. source_areas: (t,) m², where they
    are known. All lights have the radiosity 1, nothing stands between, and each is as a disc of its area that sends
    from its middle.
    """
    filled = np.flatnonzero(regions.lengths > 0)
    if not len(filled):
        return Allowance(ALLOWED, NEGLIGIBLE)
    areas = region_areas(regions, source_corners, source_areas)
    # Even steps through the area of the regions.
    ends = np.cumsum(areas[filled])
    steps = (np.arange(TOTAL_POINTS) + 0.5) / TOTAL_POINTS * ends[-1]
    light = filled[np.minimum(np.searchsorted(ends, steps), len(filled) - 1)]
    part = rows_of(regions, light)
    # By themselves: to sample takes as long as there are source triangles.
    alone = Rows(np.arange(len(part.values)), part.starts)
    samples = sample_regions(source_corners.take(part.values, axis=0), alone, np.ones(len(light), np.int64))
    normals, light_areas = normals_and_areas(corners)
    strength = np.where(light_areas > 0, areas, 0.0)
    middle = middles(corners)
    total = 0.0
    for point, normal, own in zip(samples.positions, samples.normals.astype(np.float64), light, strict=True):
        way = middle - point
        square = np.maximum((way * way).sum(axis=1), np.finfo(float).tiny)
        sent = np.maximum(way @ normal, 0.0) * np.maximum(-(way * normals).sum(axis=1), 0.0) / square
        sent *= strength / (np.pi * square + strength)
        sent[own] = 0.0
        total += float(sent.sum()) / TOTAL_POINTS
    return Allowance(ALLOWED, max(ALLOWED_OF_TOTAL * min(total, 1.0), NEGLIGIBLE))


def own_shares(corners: Float64, regions: Rows, source_corners: Float64, points: int) -> Float64:
    """(n,) mean irradiance of each region from its own light over the radiosity of the region, at `points` points."""
    return RegionLight(regions, source_corners, points).shares(corners)


class RegionLight:
    """What regions receive from their own lights, measured again and again while the lights move: points stay, and
    lights that have not moved are not asked again. areas: (n,) m² of the regions."""

    def __init__(
        self, regions: Rows, source_corners: Float64, points: int, source_areas: Float64 | None = None
    ) -> None:
        """`points` points on each of the regions, rows of source_corners (t, 3, 3), m. source_areas: (t,) m², where
        they are known."""
        self.areas = region_areas(regions, source_corners, source_areas)
        self._samples: SourceSamples = sample_regions(source_corners, regions, np.full(len(self.areas), points))
        self._light = np.repeat(np.arange(len(self.areas)), np.diff(self._samples.offsets))
        self._corners = np.full((len(self.areas), 3, 3), np.nan)
        self._shares = np.zeros(len(self.areas))

    def shares(self, corners: Float64, report: Report = lambda share: None) -> Float64:
        """(n,) mean irradiance of each region from its own light over the radiosity of the region.

        corners: (n, 3, 3) of the lights, m. report: called with the share of the work that is done, may raise.
        """
        moved = (corners != self._corners).any(axis=(1, 2))
        rows = np.flatnonzero(moved[self._light])
        places, normals = self._samples.positions[rows], self._samples.normals[rows].astype(np.float64)
        factors = seen_factors(places, normals, corners, self._light[rows], report)
        sums = sum_by(self._light[rows], factors * self._samples.weights[rows], len(corners))
        light_areas = np.maximum(normals_and_areas(corners)[1], np.finfo(float).tiny)
        self._shares = np.where(moved, sums * self.areas / light_areas, self._shares)
        self._corners = corners.copy()
        return self._shares.copy()


def seen_factors(
    points: Float64, normals: Float64, corners: Float64, light: Int64, report: Report = lambda share: None
) -> Float64:
    """(p,) form factors of each point and the light beside it, rows of corners (n, 3, 3): by two planes mostly 0.

    report: called with the share of the work that is done, may raise.
    """
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    def factors(batch: slice) -> Float64:
        return _seen_factors(points[batch], normals[batch], corners, light[batch], facing)

    parts = list(side_by_side(factors, slices(len(points), POINTS_PER_BATCH), report))
    return np.concatenate(parts) if parts else np.zeros(0)


def _seen_factors(points: Float64, normals: Float64, corners: Float64, light: Int64, facing: Float64) -> Float64:
    in_front = np.einsum("ij,ij->i", facing.take(light, axis=0), points - corners[:, 0].take(light, axis=0)) > 0
    rows = np.flatnonzero(in_front)
    polygons = corners.take(light[rows], axis=0)
    highest_corner = np.full(len(rows), -np.inf)
    for corner in range(3):
        height = np.einsum("ij,ij->i", polygons[:, corner] - points[rows], normals[rows])
        np.maximum(highest_corner, height, out=highest_corner)
    seen = highest_corner > 0
    rows = rows[seen]
    factors = np.zeros(len(points))
    factors[rows] = paired_form_factor(points[rows], normals[rows], polygons[seen])
    return factors


def region_areas(regions: Rows, source_corners: Float64, source_areas: Float64 | None = None) -> Float64:
    """(n,) m²: area of the rows of source_corners (t, 3, 3) of each light. source_areas: (t,) m², where known."""
    areas = normals_and_areas(source_corners)[1] if source_areas is None else source_areas
    owner = np.repeat(np.arange(len(regions.lengths)), regions.lengths)
    return sum_by(owner, areas.take(regions.values), len(regions.lengths))
