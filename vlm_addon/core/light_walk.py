# SPDX-License-Identifier: GPL-3.0-or-later
"""The quasi-random walk of virtual point lights: how many go on at each bounce (Keller 1997; seed 004, 2.1, 3.3).

Of n lights as many go on as are expected to survive when each is absorbed with a probability: the mean reflectance
times n. Those that do stand for all, so what they reflect stays right on average for any split.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .errors import InvalidInput
from .light_tree_bounds import triangle_areas
from .scene import Float64, Mesh
from .vpl_placement import share_out

WALK_BASES = ((2, 3), (5, 7), (11, 13))
"""Of Halton's sequence: of the places of lights in the maps, then of the directions in which each bounce goes on."""

SHIFT_FACTORS = (1, 1009, 1_000_003)
"""Primes by which the shifts of bounces differ."""


@dataclass(frozen=True)
class SurfaceMeans:
    """Of all triangles. area: m². reflectance: (3,) float64, mean over the area; 0 where there is none."""

    area: float
    reflectance: Float64


def surface_means(meshes: Sequence[Mesh]) -> SurfaceMeans:
    """Area and mean diffuse reflectance of meshes. Raises InvalidInput for a reflectance that is not finite."""
    area, reflected = 0.0, np.zeros(3)
    for mesh in meshes:
        if not np.isfinite(mesh.reflectance).all():
            raise InvalidInput(f"mesh {mesh.name!r}", "what a material of it reflects is not finite", "mend its color")
        areas = triangle_areas(mesh.positions[mesh.triangles])
        area += float(areas.sum())
        reflected += areas @ mesh.reflectance.astype(np.float64)
    return SurfaceMeans(area, reflected / area if area > 0.0 else np.zeros(3))


def bounce_counts(count: int, bounces: int, reflectance: float, block: int) -> tuple[int, ...]:
    """How many of `count` lights are for each of so many bounces; each number a multiple of `block`.

    Each bounce has `reflectance` (in [0, 1]; more counts as 1) times as many as the one before, but one block at least
    unless nothing is reflected, and never more than that. Together they are `count`, rounded up to as many blocks as
    that takes. Raises InvalidInput for a block, a number of bounces or a count below 1.
    """
    if min(block, bounces, count) < 1:
        problem = f"{count} lights for {bounces} bounces in blocks of {block}"
        raise InvalidInput("virtual point lights", problem, "give whole numbers from 1")
    weights = min(max(reflectance, 0.0), 1.0) ** np.arange(bounces, dtype=np.float64)
    blocks = max(-(-count // block), int((weights > 0.0).sum()))
    return tuple(block * number for number in share_out(blocks, weights))


def bounce_shift(shift: tuple[float, float], number: int) -> tuple[float, float]:
    """The shift of a bounce's own points, in [0, 1), of that of the first bounce (number 1).

    As even as `shift` over many of those, and independent of it to a thousandth: with one shift for all, where a light
    lies and where it sends its light would move together, and the mean over shifts would be off.
    """
    x, y = (coordinate * SHIFT_FACTORS[number - 1] % 1.0 for coordinate in shift)
    return x, y
