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
from .parallel import side_by_side, slices
from .progress import Report, between
from .scene import Float64

# Lights around the one that gives, and of these the lights nearby among which a triangle chooses.
AROUND, NEARBY = 48, 12
# Of what its own light gives, what another may shine on a triangle that it takes.
FAINT = 0.1
# Of what each light may have, what is left to a light that hands over.
AIM = 0.5
# The light of a hollow whose sides are handed over is stronger on what is left: again, so many times.
TURNS = 3
# Of what a light may have, own light measured at few points from which on it looks at all of its region.
DOUBT = 0.5
PAIRS_PER_BATCH = 1 << 20
GIVEN_PER_BATCH = 1 << 12


def hand_over(
    light: Int64,
    corners: Float64,
    source_corners: Float64,
    group: Int64,
    light_group: Int64,
    allowance: Allowance,
    least: float = 0.0,
    own: Float64 | None = None,
    report: Report = lambda share: None,
) -> Int64:
    """(t,) the light of each source triangle, of `light` (t,) or, where that shines on it too much, of another.

    corners: (n, 3, 3) lights, m. source_corners: (t, 3, 3), m. group (t,), light_group (n,): only lights of its group
    take a triangle, if its own is. least: share of a light's radiosity that a triangle receives from it before it may
    go. Every light keeps a triangle. own: (n,) as of own_shares: lights that are far from too much by it are taken at
    their word. report: called with the share of the work that is done, may raise.
    """
    light = light.copy()
    normals, areas = normals_and_areas(source_corners)
    held = (light >= 0) & (areas > 0)
    light_areas = np.maximum(normals_and_areas(corners)[1], np.finfo(float).tiny)
    places = middles(source_corners)
    aim = AIM * min(allowance.each, allowance.together)
    asked = np.ones(len(corners), bool)
    word = np.zeros(len(corners)) if own is None else own
    if own is not None:
        region = sum_by(light[held], areas[held], len(corners))
        asked[:] = False
        asked[allowance.scaled(DOUBT).exceeded(own, region)] = True
    # Of each triangle and its light, once it has been asked for.
    factors = np.full(len(light), np.nan)
    for turn in range(TURNS):
        told = between(report, turn / TURNS, (turn + 1) / TURNS)
        told(0.0)
        rows = np.flatnonzero(held & asked[light])
        fresh = rows[np.isnan(factors[rows])]
        factors[fresh] = seen_factors(places[fresh], normals[fresh], corners, light[fresh], between(told, 0.0, 0.7))
        region = sum_by(light[held], areas[held], len(corners))
        strength = region / light_areas
        owner = light[rows]
        received = sum_by(owner, factors[rows] * areas[rows], len(corners)) / np.maximum(region, np.finfo(float).tiny)
        over = np.zeros(len(corners), bool)
        over[allowance.exceeded(np.where(asked, received * strength, word), region)] = True
        shone = factors[rows] * strength[owner]
        many = over[owner] & (shone > least)
        given = _worst(rows[many], owner[many], (shone * areas[rows])[many], aim * region)
        given = given[~_last_of_each(given, light, areas)]
        if not len(given):
            break
        chosen = _others(given, light, places, normals, corners, strength, group, light_group, between(told, 0.7, 1.0))
        given, chosen = given[chosen != light[given]], chosen[chosen != light[given]]
        if not len(given):
            break
        light[given], factors[given] = chosen, np.nan
        asked[chosen] = True
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
    report: Report,
) -> Int64:
    """(g,) the light nearby that shines least on each triangle, its own where none shines less."""
    facing, light_areas = normals_and_areas(corners)
    middle = middles(corners)
    around, giver = _around(light[given], middle)
    nearby = min(NEARBY, around.shape[1])

    def chosen(batch: slice) -> Int64:
        rows, asked = given[batch], around[giver[batch]]
        way = middle[asked] - places[rows][:, None]
        turned = 1.0 - np.einsum("ij,ikj->ik", normals[rows], facing[asked])
        far = np.einsum("ikj,ikj->ik", way, way) + light_areas[asked] * turned
        apart = (group[rows] == light_group[light[rows]])[:, None] & (group[rows][:, None] != light_group[asked])
        far[apart] = np.inf
        near = np.argpartition(far, nearby - 1, axis=1)[:, :nearby]
        far, near = np.take_along_axis(far, near, 1), np.take_along_axis(asked, near, 1)
        # Its own light first, which is none of the others.
        far = np.concatenate([np.full((len(rows), 1), np.inf), far], axis=1)
        near = np.concatenate([light[rows][:, None], near], axis=1)
        flat = np.repeat(rows, near.shape[1])
        shone = seen_factors(places[flat], normals[flat], corners, near.ravel()) * strength[near.ravel()]
        shone = shone.reshape(far.shape)
        # The nearest of those that shine on it hardly more than the least.
        alike = np.einsum("ij,ikj->ik", normals[rows], facing[near]) > 0
        score = np.where((shone <= FAINT * shone[:, :1]) & alike, far, np.inf)
        best = score.argmin(axis=1)
        each = np.arange(len(rows))
        return np.where(np.isfinite(score[each, best]), near[each, best], light[rows])

    return np.concatenate(list(side_by_side(chosen, slices(len(given), GIVEN_PER_BATCH), report)))


def _around(givers: Int64, middle: Float64) -> tuple[Int64, Int64]:
    """((k, AROUND) lights around each of the k lights that give, (g,) the row of each given triangle's light)."""
    lights, row = np.unique(givers, return_inverse=True)
    count = min(AROUND, len(middle))
    found = []
    for batch in slices(len(lights), max(1, PAIRS_PER_BATCH // len(middle))):
        way = middle[None] - middle[lights[batch]][:, None]
        far = np.einsum("ikj,ikj->ik", way, way)
        found.append(np.argpartition(far, count - 1, axis=1)[:, :count])
    return np.concatenate(found), row
