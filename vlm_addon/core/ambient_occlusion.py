# SPDX-License-Identifier: GPL-3.0-or-later
"""How open points of a surface are to what is around them, by casting rays: the oracle of the passes that estimate it.

Openness is the share of the directions over a point, cosine-weighted, in which nothing is met within a radius (Zhukov
et al. 1998, with a step at the radius; seed 003, 4.2.3).
"""

from __future__ import annotations

import math

import numpy as np

from .errors import InvalidInput
from .scene import Float64
from .triangle_tree import TriangleTree

LIFT = 1e-5
"""Of the radius: by so much rays start above the triangle that their point lies on."""
RAYS_AT_ONCE = 4096


def openness(
    tree: TriangleTree,
    points: Float64,
    normals: Float64,
    geometric_normals: Float64,
    radius_m: float,
    strata: int,
    seed: int = 0,
) -> Float64:
    """(p,) in [0, 1], from strata² rays a point, one in each part of the directions.

    tree: all that may be in the way. points: (p, 3) m, on triangles of it. normals: (p, 3) unit, about which the cosine
    is. geometric_normals: (p, 3) unit, of the triangles, on the same side: under those nothing is open. Raises
    InvalidInput for a radius that is not above 0.
    """
    if not radius_m > 0.0:
        raise InvalidInput("ambient occlusion", f"radius {radius_m} m is out of range", "give a length above 0")
    random = np.random.default_rng(seed)
    origins = points + LIFT * radius_m * geometric_normals
    open_rays = np.zeros(len(points))
    for stratum in range(strata**2):
        place = np.array([stratum % strata, stratum // strata]) + random.random((len(points), 2))
        directions = cosine_directions(normals, place / strata)
        is_over = np.einsum("ij,ij->i", directions, geometric_normals) > 0.0
        open_rays += is_over & ~_meets(tree, origins, origins + radius_m * directions)
    return open_rays / strata**2


def cosine_directions(normals: Float64, places: Float64) -> Float64:
    """(p, 3) unit directions over (p, 3) unit normals, dense as the cosine where (p, 2) places are even in [0, 1)²."""
    height = 2.0 * places[:, 1] - 1.0
    around = np.sqrt(np.maximum(1.0 - height**2, 0.0))
    turn = 2.0 * math.pi * places[:, 0]
    through = normals + np.stack([around * np.cos(turn), around * np.sin(turn), height], axis=1)
    lengths = np.linalg.norm(through, axis=1, keepdims=True)
    return np.where(lengths > 1e-9, through / np.maximum(lengths, 1e-9), normals)


def _meets(tree: TriangleTree, origins: Float64, ends: Float64) -> np.ndarray:
    runs = range(0, len(origins), RAYS_AT_ONCE)
    hits = [tree.first_hits(origins[i : i + RAYS_AT_ONCE], ends[i : i + RAYS_AT_ONCE]) for i in runs]
    return np.isfinite(np.concatenate(hits)) if hits else np.zeros(0, bool)
