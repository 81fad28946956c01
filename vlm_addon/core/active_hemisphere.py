# SPDX-License-Identifier: GPL-3.0-or-later
"""Does a light's active hemisphere reach a box? (seed 002, 4.2): an exact test in one fixed order of roundings.

A light's active hemisphere is half a ball, closed: no farther from its centre than its radius and not behind the
plane of the light. `gpu_shaders/lib/active_hemisphere.glsl` does the same additions, multiplications and comparisons
in the same order, so both give the same lists. Nothing here divides or takes a root, which devices round differently,
and the numbers are kept away from the smallest of float32, which devices may flush to zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .scene import Float64

Floats = npt.NDArray[Any]
Bools = npt.NDArray[np.bool_]

# Lengths are in a frame whose boxes lie within a cube of side 1 around the origin. Coordinates are multiples of
# `COORDINATE_STEP`, a few roundings of float32 there; components of normals under `LEAST_NORMAL` and radii under
# `LEAST_RADIUS` are 0. Lengths up to `LARGEST` square without overflow.
COORDINATE_STEP = 2.0**-28
LEAST_NORMAL = 2.0**-20
LEAST_RADIUS = 2.0**-30
LARGEST = 2.0**30
# Stands for 1 / 0: a plane along an axis is never left along it.
INVERSE_OF_ZERO = 2.0**40
# More than any length, position or parameter along a normal.
_BEYOND = 2.0**100
# Of the squared radius of a half ball without any point.
NOTHING = -1.0


@dataclass(frozen=True)
class HalfBalls:
    """Half balls by component: centres, normals, inverse_normals (3, n); radii_squared (n,), NOTHING for no point.

    All of one floating type, in the grid's frame. normals: unit, towards the lit side. inverse_normals: 1 / normals.
    """

    centres: Floats
    normals: Floats
    inverse_normals: Floats
    radii_squared: Floats

    def __len__(self) -> int:
        return len(self.radii_squared)

    def take(self, rows: npt.NDArray[Any] | slice) -> HalfBalls:
        """Those of `rows`, in that order."""
        rows = np.arange(len(self))[rows] if isinstance(rows, slice) else rows
        return HalfBalls(
            centres=np.take(self.centres, rows, axis=1),
            normals=np.take(self.normals, rows, axis=1),
            inverse_normals=np.take(self.inverse_normals, rows, axis=1),
            radii_squared=self.radii_squared[rows],
        )


def make_half_balls(centres: Float64, normals: Float64, radii: Float64, dtype: npt.DTypeLike = np.float32) -> HalfBalls:
    """Half balls of (n, 3) centres and unit normals and (n,) radii, rounded so that every device agrees on them.

    A negative radius makes one without any point.
    """
    normals = np.where(np.abs(normals) < LEAST_NORMAL, 0.0, normals).T.astype(dtype)
    inverses = np.full(normals.shape, INVERSE_OF_ZERO, dtype)
    np.divide(normals.dtype.type(1.0), normals, out=inverses, where=normals != 0.0)
    squared = np.where(radii < LEAST_RADIUS, 0.0, radii) ** 2
    return HalfBalls(
        centres=np.ascontiguousarray(on_steps(centres).T.astype(dtype)),
        normals=np.ascontiguousarray(normals),
        inverse_normals=inverses,
        radii_squared=np.where(radii < 0.0, NOTHING, squared).astype(dtype),
    )


def on_steps(coordinates: Float64) -> Float64:
    """`coordinates` as multiples of COORDINATE_STEP."""
    return np.asarray(np.round(coordinates / COORDINATE_STEP) * COORDINATE_STEP)


def overlaps(half_balls: HalfBalls, low: Floats, high: Floats) -> Bools:
    """(n,) whether half ball i and the closed box from low[:, i] to high[:, i] have a point in common.

    low, high: (3, n) or (3, 1), of the type of the half balls, low <= high. The point of the box that is nearest to
    the centre decides if it is on the lit side; otherwise the nearest point of the box in the light's plane does.
    """
    normals, radii_squared = half_balls.normals, half_balls.radii_squared
    low, high = low - half_balls.centres, high - half_balls.centres
    near = np.maximum(low, np.minimum(high, 0.0))
    height = _sum(np.maximum(normals * low, normals * high))
    reached = (_sum(near * near) <= radii_squared) & (height >= 0.0)
    result = reached & (_sum(normals * near) >= 0.0)
    far = np.maximum(-low, high)
    result |= reached & (_sum(far * far) <= radii_squared)
    doubtful = np.flatnonzero(reached & ~result)
    low, high = np.take(low, doubtful, axis=1), np.take(high, doubtful, axis=1)
    result[doubtful] = plane_overlaps(half_balls.take(doubtful), low, high)
    return result


def _sum(components: Floats) -> Floats:
    return np.asarray((components[0] + components[1]) + components[2])


def plane_overlaps(half_balls: HalfBalls, low: Floats, high: Floats) -> Bools:
    """(n,) whether the light's disc and a box overlap that `overlaps` finds neither clearly reached nor missed.

    The plane cuts the box, whose point nearest to the centre is behind it. low, high: relative to the centre. The
    nearest point of the box in the plane is clamp(t n) for the t > 0 at which n clamp(t n) is 0 (the condition of
    Karush, Kuhn and Tucker). That sum rises with t and is linear between the values of t at which a coordinate starts
    to move or stops. Products with booleans stand for choices, which numpy makes slowly.
    """
    signs = np.copysign(half_balls.normals.dtype.type(1.0), half_balls.normals)
    low, high = np.minimum(low * signs, high * signs), np.maximum(low * signs, high * signs)
    normals, inverses = np.abs(half_balls.normals), np.abs(half_balls.inverse_normals)
    starts, stops = np.maximum(low, 0.0) * inverses, np.maximum(high, 0.0) * inverses
    beyond = normals.dtype.type(_BEYOND)

    last_below, first_above = np.zeros_like(low[0]), np.full_like(low[0], _BEYOND)
    for t in (*starts, *stops):
        along = t * normals + beyond * (t >= stops) - beyond * (t < starts)
        below = _sum(normals * np.maximum(low, np.minimum(high, along))) < 0.0
        last_below = np.maximum(last_below, t * below)
        first_above = np.minimum(first_above, np.maximum(t, beyond * below))

    stopped = last_below >= stops
    waiting = (first_above <= starts) & ~stopped
    fixed = high * stopped + low * waiting
    moving_squared = _sum(normals * normals * ~(stopped | waiting))
    # With t = -offset / moving_squared: distance² = |fixed|² + offset² / moving_squared.
    offset = _sum(normals * fixed)
    room = half_balls.radii_squared - _sum(fixed * fixed)
    within = (room > 0.0) & (offset * offset <= room * moving_squared)
    return np.asarray(within | ((room >= 0.0) & (offset == 0.0)))
