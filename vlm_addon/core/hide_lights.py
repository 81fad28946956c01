# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights put behind the surface that they stand for, as far as they shine on it (seed 002, section 3.4).

A light lies in its surface; only the insets that rounding asks for set it back. One that shines on its region by more
than is allowed (own_shares.py) is pushed behind all of it (placement.py), and where that does not help it withdraws
(withdrawal.py). Or all are pushed, whatever they shine on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .hand_over import hand_over
from .mesh_topology import Bool, Int64, Rows, rows_by_key
from .own_shares import NEGLIGIBLE, Allowance, allowance_of, own_shares, region_areas
from .placement import BodyTrees, Placement, RegionFacts, place_behind
from .progress import Report, between
from .reduce_surface import ReducedSurface
from .regions import Regions
from .scene import Float64
from .source_surface import SourceSurface
from .withdrawal import WHOLE, withdraw

# Points of each region at which its own light is measured.
POINTS = 32
# Pushing some lights moves their neighbours, which may then need it, too.
PUSHES = 3
# Share of the time that pushing takes.
PUSH_TIME = 0.75


@dataclass(frozen=True)
class HiddenLights:
    """positions: (v, 3) float64, m. triangles: (n, 3) int64. light: (t,) int64, the light of each source triangle.
    limited: (n,) bool, lights that the thickness of the body kept in front of their region. depth: (n,) m, how far the
    limited ones stand in front."""

    positions: Float64
    triangles: Int64
    light: Int64
    limited: Bool
    depth: Float64


def hide_lights(
    surface: SourceSurface,
    lights: ReducedSurface,
    regions: Regions,
    whole_regions: bool,
    report: Report = lambda share: None,
) -> HiddenLights:
    """The lights behind their regions: all of each region (whole_regions), or as far as own light calls for.

    What of dropped shells a light has adopted does not move it. report: called with the share of the work that is
    done, may raise.
    """
    trees = BodyTrees(lights.positions[lights.triangles], surface.corners)
    pushed = between(report, 0.0, PUSH_TIME)
    if whole_regions:
        own, allowance, light = _rows(regions.light, regions.adopted, lights), WHOLE, regions.light
        placed = place_behind(lights.positions, lights.triangles, own, surface.corners, pushed, trees=trees)
    else:
        filled = rows_by_key(regions.light, len(lights.triangles))
        allowance = allowance_of(lights.positions[lights.triangles], filled, surface.corners)
        corners = lights.positions[lights.triangles]
        light = _handed_over(surface, lights, corners, regions.light, allowance, allowance.each)
        own = _rows(light, regions.adopted, lights)
        placed = _pushed(surface, lights, own, allowance, trees, pushed)
        allowance = replace(allowance, negligible=NEGLIGIBLE)
    last = withdraw(
        placed.positions,
        lights.triangles,
        own,
        surface.corners,
        between(report, PUSH_TIME, 1.0),
        allowance,
        trees.source,
    )
    if not whole_regions:
        light = _handed_over(surface, lights, last.positions[last.triangles], light, allowance, 0.0)
    return HiddenLights(last.positions, last.triangles, light, placed.limited, placed.depth)


def _rows(light: Int64, adopted: Bool, lights: ReducedSurface) -> Rows:
    """The source triangles of each light, without those of shells that have none."""
    rows = np.flatnonzero(~adopted)
    return rows_by_key(light[rows], len(lights.triangles), rows)


def _handed_over(
    surface: SourceSurface,
    lights: ReducedSurface,
    corners: Float64,
    light: Int64,
    allowance: Allowance,
    least: float,
) -> Int64:
    group = surface.group
    return hand_over(light, corners, surface.corners, group, group[lights.source_triangle], allowance, least)


def _pushed(
    surface: SourceSurface,
    lights: ReducedSurface,
    regions: Rows,
    allowance: Allowance,
    trees: BodyTrees,
    report: Report,
) -> Placement:
    """Those lights behind all of their regions that shine on them too much, with what moving them calls for."""
    areas = region_areas(regions, surface.corners)
    pushing = np.zeros(len(lights.triangles), bool)
    report(0.0)
    facts = RegionFacts.of(lights.positions, lights.triangles, regions, surface.corners)
    for push in range(1 + PUSHES):
        placed = place_behind(
            lights.positions,
            lights.triangles,
            regions,
            surface.corners,
            between(report, push / (1 + PUSHES), (push + 1) / (1 + PUSHES)),
            pushing,
            trees,
            facts,
        )
        own = own_shares(placed.positions[lights.triangles], regions, surface.corners, POINTS)
        over = allowance.exceeded(own, areas)
        if pushing[over].all():
            break
        pushing[over] = True
    return placed
