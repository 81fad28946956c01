# SPDX-License-Identifier: GPL-3.0-or-later
"""Where virtual point lights go: Halton points on the sphere around a lamp (seed 001, 3.1); how many a lamp gets."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .halton import BASES, radical_inverse
from .mesh_topology import Bool
from .scene import Float64

Accepts = Callable[[Float64], Bool]
"""Which of (n, 3) unit directions count, (n,) bool."""

_TRIES_AT_ONCE = 1024
_MOST_TRIES = 1 << 18
"""For one call; only a lamp that shines into next to nothing of its own cone needs more."""


def sphere_directions(halton: Float64) -> Float64:
    """(n, 3) unit float64, evenly spread over the sphere, of (n, 2) points of the unit square (seed 001, 3.1).

    The second coordinate runs from -z to +z: lamps shine along their -z.
    """
    turn = 2.0 * np.pi * halton[:, 0]
    height = 2.0 * halton[:, 1] - 1.0
    radius = np.sqrt(np.maximum(1.0 - height**2, 0.0))
    return np.stack([np.sin(turn) * radius, np.cos(turn) * radius, height], axis=1)


class ConePoints:
    """Halton points on the sphere of directions that fall into a cone around -z, in their order.

    Only every 3^k-th point of the sequence can be in a narrow cone: its digits to base 3 put the others farther up. The
    points are those that trying all of them would give.
    """

    def __init__(self, cos_half: float, accepts: Accepts, first: int = 1) -> None:
        """cos_half: of the half angle of a cone around all that `accepts` takes. first: from where on in the sequence
        of those that can be in it."""
        share = max(0.5 * (1.0 - cos_half), 1e-12)
        self._stride = int(BASES[1] ** math.floor(math.log(1.0 / min(share, 1.0), BASES[1]) + 1e-9))
        self._accepts = accepts
        self._next = first
        self._tried = 0
        self._accepted = 0
        self._waiting = np.zeros((0, 3))

    def take(self, count: int) -> Float64:
        """The next (count, 3) directions, unit float64; fewer where next to none are accepted."""
        found, has, tries = [self._waiting], len(self._waiting), 0
        while has < count and tries < _MOST_TRIES:
            indices = np.arange(self._next + tries, self._next + tries + _TRIES_AT_ONCE) * self._stride
            directions = sphere_directions(np.stack([radical_inverse(indices, base) for base in BASES], axis=1))
            taken = directions[self._accepts(directions)]
            found.append(taken)
            has += len(taken)
            tries += _TRIES_AT_ONCE
            self._accepted += len(taken)
        self._next += tries
        self._tried += tries
        points = np.concatenate(found)
        self._waiting = points[count:]
        return points[:count]

    @property
    def solid_angle(self) -> float:
        """Of all that is accepted, sr, from the share of the points tried so far."""
        return 4.0 * np.pi * self._accepted / max(self._tried * self._stride, 1)


def share_out(count: int, weights: Float64) -> list[int]:
    """`count` in whole numbers in proportion to `weights`, (n,) from 0: largest remainders, the first of equals.

    Whatever has weight gets one, as long as there are enough, the heaviest first.
    """
    total = float(weights.sum())
    if total <= 0.0:
        return [0] * len(weights)
    # One each is set aside for those that proportion alone would leave without.
    wanted = weights / total * count
    poor = (weights > 0.0) & (wanted < 1.0)
    if poor.sum() and count >= (weights > 0.0).sum():
        rest = share_out(count - int(poor.sum()), np.where(poor, 0.0, weights))
        return [1 if is_poor else given for is_poor, given in zip(poor, rest, strict=True)]
    given = np.floor(wanted).astype(int)
    order = np.argsort(given - wanted, kind="stable")
    given[order[: count - int(given.sum())]] += 1
    return [int(number) for number in given]
