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
from .mesh_topology import Int64, Rows, normals_and_areas, rows_of, sum_by
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


@dataclass(frozen=True)
class Allowance:
    """How much own light there may be. each: mean share of its radiosity that the region of a light may receive.
    together: mean over the surface, of lights of radiosity 1. negligible: mean over the surface that the least of
    those which exceed `each` may leave together."""

    each: float
    together: float
    negligible: float = 0.0

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


def allowance_of(corners: Float64, regions: Rows, source_corners: Float64) -> Allowance:
    """What own light the lights may have, by all the light that they give to the surface.

    corners: (n, 3, 3), m. regions: rows of source_corners (t, 3, 3) for each light. All lights have the radiosity 1,
    nothing stands between, and each is as a disc of its area that sends from its middle.
    """
    filled = np.flatnonzero(regions.lengths > 0)
    if not len(filled):
        return Allowance(ALLOWED, NEGLIGIBLE)
    areas = region_areas(regions, source_corners)
    # Even steps through the area of the regions.
    ends = np.cumsum(areas[filled])
    steps = (np.arange(TOTAL_POINTS) + 0.5) / TOTAL_POINTS * ends[-1]
    light = filled[np.minimum(np.searchsorted(ends, steps), len(filled) - 1)]
    samples = sample_regions(source_corners, rows_of(regions, light), np.ones(len(light), np.int64))
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
    samples = sample_regions(source_corners, regions, np.full(len(corners), points))
    light = np.repeat(np.arange(len(corners)), np.diff(samples.offsets))
    factors = seen_factors(samples.positions, samples.normals.astype(np.float64), corners, light)
    shares = sum_by(light, factors * samples.weights, len(corners))
    areas = normals_and_areas(corners)[1]
    return shares * region_areas(regions, source_corners) / np.maximum(areas, np.finfo(float).tiny)


def seen_factors(points: Float64, normals: Float64, corners: Float64, light: Int64) -> Float64:
    """(p,) form factors of each point and the light beside it, rows of corners (n, 3, 3): by two planes mostly 0."""
    vector = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    in_front = np.einsum("ij,ij->i", vector[light], points - corners[light, 0]) > 0
    rows = np.flatnonzero(in_front)
    heights = np.einsum("ikj,ij->ik", corners[light[rows]] - points[rows, None], normals[rows])
    rows = rows[heights.max(axis=1, initial=-1.0) > 0]
    factors = np.zeros(len(points))
    factors[rows] = paired_form_factor(points[rows], normals[rows], corners[light[rows]])
    return factors


def region_areas(regions: Rows, source_corners: Float64) -> Float64:
    """(n,) m²: area of the rows of source_corners (t, 3, 3) of each light."""
    owner = np.repeat(np.arange(len(regions.lengths)), regions.lengths)
    return sum_by(owner, normals_and_areas(source_corners)[1][regions.values], len(regions.lengths))
