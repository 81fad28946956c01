# SPDX-License-Identifier: GPL-3.0-or-later
"""Surface that its own light shines on is handed over to another light that does not.

A light of few that stands for a whole hollow shines on the far side of it, wherever it is moved. Some light beside
faces that side from behind: it may as well stand for it, and then the first gives the hollow what such sides give each
other in truth.
"""

from __future__ import annotations

import numpy as np

from .corner_arrays import middles
from .mesh_topology import Int64, Rows, normals_and_areas, rows_by_key, sum_by
from .own_shares import Allowance, seen_factors
from .scene import Float64

# Lights nearby among which a triangle chooses.
NEARBY = 12
# Of what each light may have, what is left to a light that hands over.
AIM = 0.5
# The light of a hollow whose sides are handed over is stronger on what is left: again, so many times.
TURNS = 3
PAIRS_PER_BATCH = 1 << 20


def hand_over(
    light: Int64,
    corners: Float64,
    source_corners: Float64,
    group: Int64,
    light_group: Int64,
    allowance: Allowance,
    least: float = 0.0,
) -> Int64:
    """(t,) the light of each source triangle, of `light` (t,) or, where that shines on it too much, of another.

    corners: (n, 3, 3) lights, m. source_corners: (t, 3, 3), m. group (t,), light_group (n,): only lights of its group
    take a triangle, if its own is. least: share of a light's radiosity that a triangle receives from it before it may
    go. Every light keeps a triangle.
    """
    light = light.copy()
    normals, areas = normals_and_areas(source_corners)
    held = np.flatnonzero((light >= 0) & (areas > 0))
    light_areas = np.maximum(normals_and_areas(corners)[1], np.finfo(float).tiny)
    places = middles(source_corners)
    aim = AIM * min(allowance.each, allowance.together)
    for _ in range(TURNS):
        of_held = light[held]
        factors = seen_factors(places[held], normals[held], corners, of_held)
        region = sum_by(of_held, areas[held], len(corners))
        strength = region / light_areas
        sums = sum_by(of_held, factors * areas[held], len(corners)) / np.maximum(region, np.finfo(float).tiny)
        over = np.zeros(len(corners), bool)
        over[allowance.exceeded(sums * strength, region)] = True
        shone = factors * strength[of_held]
        many = over[of_held] & (shone > least)
        given = _worst(held[many], of_held[many], (shone * areas[held])[many], aim * region)
        given = given[~_last_of_each(given, light, areas)]
        if not len(given):
            break
        chosen = _others(given, light, places, normals, corners, strength, group, light_group)
        if (chosen == light[given]).all():
            break
        light[given] = chosen
    return light


def _worst(rows: Int64, light: Int64, received: Float64, allowed: Float64) -> Int64:
    """Those of the rows, of the light beside each, that receive most, until of each light the rest is `allowed`."""
    order = np.lexsort([received, light])
    sums = np.cumsum(received[order])
    first = np.searchsorted(light[order], light[order])
    before = np.concatenate([[0.0], sums])[first]
    worst: Int64 = np.sort(rows[order[sums - before > allowed[light[order]]]])
    return worst


def _last_of_each(given: Int64, light: Int64, areas: Float64) -> np.ndarray:
    """(g,) bool: of lights that would give all, the largest triangle."""
    regions = rows_by_key(light[given], int(light.max(initial=0)) + 1, given)
    whole = np.bincount(light[light >= 0], minlength=len(regions.lengths))
    rows = np.flatnonzero((regions.lengths > 0) & (regions.lengths == whole))
    largest = [regions.values[a:b][areas[regions.values[a:b]].argmax()] for a, b in _spans(regions, rows)]
    last: np.ndarray = np.isin(given, np.array(largest, np.int64))
    return last


def _spans(regions: Rows, rows: Int64) -> list[tuple[int, int]]:
    return list(zip(regions.starts[rows].tolist(), regions.starts[rows + 1].tolist(), strict=True))


def _others(
    given: Int64,
    light: Int64,
    places: Float64,
    normals: Float64,
    corners: Float64,
    strength: Float64,
    group: Int64,
    light_group: Int64,
) -> Int64:
    """(g,) the light nearby that shines least on each triangle, its own where none shines less."""
    facing, light_areas = normals_and_areas(corners)
    middle = middles(corners)
    nearby = min(NEARBY, len(corners))
    chosen = light[given].copy()
    step = max(1, PAIRS_PER_BATCH // len(corners))
    for first in range(0, len(given), step):
        rows = given[first : first + step]
        way = middle[None] - places[rows][:, None]
        far = (way * way).sum(axis=2) + light_areas * (1.0 - normals[rows] @ facing.T)
        apart = (group[rows][:, None] != light_group) & (group[rows] == light_group[light[rows]])[:, None]
        far[apart] = np.inf
        near = np.argpartition(far, nearby - 1, axis=1)[:, :nearby]
        near = np.concatenate([light[rows][:, None], near], axis=1)
        far = np.take_along_axis(far, near, 1)
        flat = np.repeat(rows, near.shape[1])
        shone = seen_factors(places[flat], normals[flat], corners, near.ravel()) * strength[near.ravel()]
        # The nearest of those that shine on it hardly more than the least.
        shone = np.where(np.isfinite(far), shone.reshape(far.shape), np.inf)
        alike = np.einsum("ij,ikj->ik", normals[rows], facing[near]) > 0
        good = (shone <= 0.1 * shone[:, :1]) & alike
        score = np.where(good & np.isfinite(far), far, np.inf)
        best = score.argmin(axis=1)
        found = np.isfinite(score[np.arange(len(rows)), best])
        chosen[first : first + step] = np.where(found, near[np.arange(len(rows)), best], light[rows])
    return chosen
