# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of the unit square, warped so that their density follows the flux of maps.

Clarberg et al. 2005; seed 004, 4.8. The oracle of lib/flux_warp.glsl. The importance of a texel is the flux it
reflects, summed over the channels. A point descends a pyramid of sums: in each square of four texels it is first sent
to one of the rows, then to one of the columns, in proportion to what these hold, and its coordinate is stretched over
the part of [0, 1) that leads there. So points that are spread evenly stay so, and no texel of zero importance is ever
reached. Several maps are a level above: the first coordinate chooses among them by their power and is stretched
likewise. The number of points in a map is then right on average for any number of points and maps, where shares in
whole numbers are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .errors import InvalidInput
from .mesh_topology import Int64
from .scene import Float64

_BELOW_1 = float(np.nextafter(1.0, 0.0))
_REMEDY = "give importances that are finite and from 0, not all of them 0"


@dataclass(frozen=True)
class WarpedPoints:
    """texels: (n, 2) int64, column and row. probabilities: (n,) float64, of each texel among all."""

    texels: Int64
    probabilities: Float64


@dataclass(frozen=True)
class ChosenParts:
    """parts: (n,) int64. stretched: (n,) float64 in [0, 1), where in its part each coordinate lies."""

    parts: Int64
    stretched: Float64


def choose_parts(weights: Float64, coordinates: Float64) -> ChosenParts:
    """Which of the parts of [0, 1), as large as their `weights` and in their order, holds each coordinate.

    weights: (n, k), of each coordinate's own k parts, or (k,) of all. coordinates: (n,) in [0, 1). Never a part of no
    weight. Raises InvalidInput for weights that are negative, not finite, or all zero.
    """
    shared = np.broadcast_to(weights, (len(coordinates), np.shape(weights)[-1]))
    ends = np.cumsum(shared, axis=1)
    if not (np.isfinite(shared).all() and (shared >= 0.0).all() and (ends[:, -1:] > 0.0).all()):
        raise InvalidInput("warped points", "weights that no point can follow", _REMEDY)
    at = coordinates * ends[:, -1]
    # The first part that ends beyond the place holds something; rounding may have put the place past the last one.
    last = np.where(shared > 0.0, np.arange(shared.shape[1]), 0).max(axis=1)
    parts = np.minimum((ends <= at[:, None]).sum(axis=1), last)
    rows = np.arange(len(parts))
    size = shared[rows, parts]
    return ChosenParts(parts, np.clip((at - (ends[rows, parts] - size)) / size, 0.0, _BELOW_1))


def importance_pyramid(importance: Float64, levels: int) -> list[Float64]:
    """`importance`, (h, w), and levels - 1 coarser levels, each half as wide and high and of sums of four."""
    pyramid = [np.asarray(importance, np.float64)]
    for _ in range(levels - 1):
        finer = pyramid[-1]
        pyramid.append(finer[0::2, 0::2] + finer[0::2, 1::2] + finer[1::2, 0::2] + finer[1::2, 1::2])
    return pyramid


def warp_points(pyramid: Sequence[Float64], points: Float64) -> WarpedPoints:
    """Texels of the finest level, pyramid[0], for (n, 2) points of the unit square.

    In the coarsest level, which may have any size, and in every square of four further down, the second coordinate
    chooses the row, then the first one the column. Raises InvalidInput where nothing has importance.
    """
    column, row = np.zeros(len(points), np.int64), np.zeros(len(points), np.int64)
    u, v = points[:, 0].astype(np.float64), points[:, 1].astype(np.float64)
    side = pyramid[-1].shape
    for level in reversed(pyramid):
        rows = row[:, None, None] * side[0] + np.arange(side[0])[:, None]
        columns = column[:, None, None] * side[1] + np.arange(side[1])
        cells = level[rows, columns]
        chosen_row = choose_parts(cells.sum(axis=2), v)
        chosen_column = choose_parts(cells[np.arange(len(u)), chosen_row.parts], u)
        row, v = row * side[0] + chosen_row.parts, chosen_row.stretched
        column, u = column * side[1] + chosen_column.parts, chosen_column.stretched
        side = (2, 2)
    return WarpedPoints(np.stack([column, row], axis=1), pyramid[0][row, column] / pyramid[-1].sum())
