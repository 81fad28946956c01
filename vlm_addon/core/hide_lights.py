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
from .own_shares import NEGLIGIBLE, Allowance, RegionLight, allowance_of
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
# Shares of the time after which lights have been looked at (twice), have handed over, are pushed and have withdrawn.
LOOK_TIME, HAND_TIME, PUSH_TIME, LAST_TIME = 0.05, 0.25, 0.75, 0.9


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
    if whole_regions:
        return _whole(surface, lights, regions, trees, report)
    corners = lights.positions[lights.triangles]
    filled = rows_by_key(regions.light, len(lights.triangles))
    allowance = allowance_of(corners, filled, surface.corners, surface.areas)
    report(LOOK_TIME)
    measure = RegionLight(filled, surface.corners, POINTS, surface.areas)
    own = measure.shares(corners, between(report, LOOK_TIME, 2 * LOOK_TIME))
    giving = _Giving(surface, lights, allowance, own)
    light = giving.handed_over(corners, regions.light, allowance.each, between(report, 2 * LOOK_TIME, HAND_TIME))
    owned = _rows(light, regions.adopted, lights)
    placed, own = _pushed(surface, lights, owned, allowance, trees, between(report, HAND_TIME, PUSH_TIME))
    lenient = replace(allowance, negligible=NEGLIGIBLE)
    last = withdraw(
        placed.positions,
        lights.triangles,
        owned,
        surface.corners,
        between(report, PUSH_TIME, LAST_TIME),
        lenient,
        trees.source,
        own,
    )
    # No light is taken at its word now: few points of a region miss what a fold of it receives.
    giving = _Giving(surface, lights, lenient, None)
    placed_corners = last.positions[last.triangles]
    light = giving.handed_over(placed_corners, light, 0.0, between(report, LAST_TIME, 1.0))
    return HiddenLights(last.positions, last.triangles, light, placed.limited, placed.depth)


def _whole(
    surface: SourceSurface, lights: ReducedSurface, regions: Regions, trees: BodyTrees, report: Report
) -> HiddenLights:
    """All lights behind all of their regions, and those withdrawn that shine on these nevertheless."""
    owned, pushed = _rows(regions.light, regions.adopted, lights), between(report, 0.0, PUSH_TIME)
    placed = place_behind(lights.positions, lights.triangles, owned, surface.corners, pushed, trees=trees)
    left = between(report, PUSH_TIME, 1.0)
    last = withdraw(placed.positions, lights.triangles, owned, surface.corners, left, WHOLE, trees.source)
    return HiddenLights(last.positions, last.triangles, regions.light, placed.limited, placed.depth)


def _rows(light: Int64, adopted: Bool, lights: ReducedSurface) -> Rows:
    """The source triangles of each light, without those of shells that have none."""
    rows = np.flatnonzero(~adopted)
    return rows_by_key(light[rows], len(lights.triangles), rows)


@dataclass(frozen=True)
class _Giving:
    """Lights that hand over what they shine on too much. own: (n,) of each, as of own_shares, where it may be relied
    on."""

    surface: SourceSurface
    lights: ReducedSurface
    allowance: Allowance
    own: Float64 | None

    def handed_over(self, corners: Float64, light: Int64, least: float, report: Report) -> Int64:
        """(t,) the light of each source triangle, of `light` or of another. corners: (n, 3, 3) of the lights, m."""
        group = self.surface.group
        groups = group, group[self.lights.source_triangle]
        return hand_over(light, corners, self.surface.corners, *groups, self.allowance, least, self.own, report)


def _pushed(
    surface: SourceSurface,
    lights: ReducedSurface,
    regions: Rows,
    allowance: Allowance,
    trees: BodyTrees,
    report: Report,
) -> tuple[Placement, Float64]:
    """(those lights behind all of their regions that shine on them too much, with what moving them calls for, what
    then is their own light)."""
    measure = RegionLight(regions, surface.corners, POINTS, surface.areas)
    report(0.0)
    pushing = np.zeros(len(lights.triangles), bool)
    pushing[allowance.exceeded(measure.shares(lights.positions[lights.triangles]), measure.areas)] = True
    report(0.05)
    facts = RegionFacts.of(lights.positions, lights.triangles, regions, surface.corners)
    for push in range(PUSHES):
        told = between(report, 0.1 + 0.9 * push / PUSHES, 0.1 + 0.9 * (push + 1) / PUSHES)
        placed = place_behind(
            lights.positions,
            lights.triangles,
            regions,
            surface.corners,
            between(told, 0.0, 0.8),
            pushing,
            trees,
            facts,
        )
        own = measure.shares(placed.positions[lights.triangles], between(told, 0.8, 1.0))
        over = allowance.exceeded(own, measure.areas)
        if pushing[over].all():
            break
        pushing[over] = True
    return placed, own
