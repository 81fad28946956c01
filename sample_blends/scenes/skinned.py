# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones, and tubes whose vertices follow them: the geometry of skinned characters. No bpy. Metres, z up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .shapes import Points, Shape, flipped, join, lathe

Vector = tuple[float, float, float]
SMALL_STEP = 1e-4
"""Share of a tube's length over which its direction is taken."""


@dataclass(frozen=True)
class Bone:
    """A bone at rest; `parent` is the name of another that stands before it in the skeleton, or empty."""

    name: str
    parent: str
    head: Vector
    tail: Vector


Skeleton = tuple[Bone, ...]


@dataclass(frozen=True)
class Part:
    """A piece of a character.

    weights: (v, bones) float64, rows sum to 1; columns in the skeleton's order. material: key of its material. tag:
    tag id shared by the piece and by the virtual lights that stand for it.
    """

    name: str
    surface: Shape
    weights: Points
    material: str
    tag: int


@dataclass(frozen=True)
class Link:
    """A bone of a chain, and from where along a tube (share of its length) it takes over from the bone before it.

    blend: half the width of the change. A chain's first bone needs neither.
    """

    bone: str
    start: float = 0.0
    blend: float = 0.1


@dataclass(frozen=True)
class Tube:
    """A limb, trunk or finger with round ends.

    path: (k, 3) points of its axis. profile: rows of (share of the length, half width, half depth), interpolated
    smoothly; the width lies along `side` as far as it is across the path. cap: length of each round end, as a share.
    """

    name: str
    path: Sequence[Vector]
    profile: Sequence[tuple[float, float, float]]
    links: tuple[Link, ...]
    material: str
    tag: int
    side: Vector = (1.0, 0.0, 0.0)
    cap: float = 0.08


def smoothstep(values: Points) -> Points:
    """0 below 0, 1 above 1, smooth between."""
    t = np.clip(values, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def chain_weights(position: Points, links: Sequence[Link], skeleton: Skeleton) -> Points:
    """(n, bones) weights at positions (n,) along a chain: each link hands over to the next within its blend."""
    columns = {bone.name: index for index, bone in enumerate(skeleton)}
    weights = np.zeros((len(position), len(skeleton)))
    weights[:, columns[links[0].bone]] = 1.0
    for link in links[1:]:
        taken = smoothstep((position - link.start) / (2.0 * link.blend) + 0.5)
        weights *= 1.0 - taken[:, None]
        weights[:, columns[link.bone]] += taken
    return weights


def spline(knots: Points, values: Points, at: Points) -> Points:
    """Values (k, c) over ascending knots (k,) interpolated by cubic Hermite pieces with finite-difference slopes."""
    slopes = np.gradient(values, knots, axis=0)
    piece = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    width = knots[piece + 1] - knots[piece]
    t = ((at - knots[piece]) / width)[:, None]
    low, high = values[piece], values[piece + 1]
    m0, m1 = slopes[piece] * width[:, None], slopes[piece + 1] * width[:, None]
    h01 = t * t * (3 - 2 * t)
    return (1 - h01) * low + h01 * high + t * (1 - t) ** 2 * m0 - t * t * (1 - t) * m1


def stations(rings: int, cap: float) -> Points:
    """Where a tube has its rings, as shares of its length: the two poles, then round ends, then an even trunk."""
    rounds = cap * (1.0 - np.cos(np.radians([30.0, 60.0]))) if rings > 6 else np.array([])
    trunk = np.linspace(cap, 1.0 - cap, rings - 2 * len(rounds))
    return np.concatenate([[0.0], rounds, trunk, (1.0 - rounds)[::-1], [1.0]])


def tube_part(tube: Tube, skeleton: Skeleton, segments: int, rings: int, inset: float = 0.0) -> Part:
    """The tube with that many corners around and rings along it, its surface moved inwards by inset (m)."""
    path = np.array(tube.path)
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    knots = np.concatenate([[0.0], np.cumsum(lengths) / lengths.sum()])
    at = stations(rings, tube.cap)
    centres = spline(knots, path, at)
    after, before = np.clip(at + SMALL_STEP, 0, 1), np.clip(at - SMALL_STEP, 0, 1)
    along = spline(knots, path, after) - spline(knots, path, before)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.array(tube.side) - along * (along @ np.array(tube.side))[:, None]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    deep = np.cross(along, across)
    table = np.array(tube.profile)
    radii = spline(table[:, 0], table[:, 1:], at)
    into_cap = np.minimum(np.minimum(at, 1.0 - at) / tube.cap, 1.0)
    radii = np.maximum(radii - inset, 0.3 * radii) * np.sqrt(1.0 - (1.0 - into_cap) ** 2)[:, None]
    # The lathe gives the topology; its heights are the indices of the rings.
    ones = [(0.0 if index in (0, len(at) - 1) else 1.0, float(index)) for index in range(len(at))]
    unit = lathe(ones, segments)
    ring = np.rint(unit.vertices[:, 2]).astype(int)
    vertices = (
        centres[ring]
        + across[ring] * (radii[ring, 0] * unit.vertices[:, 0])[:, None]
        + deep[ring] * (radii[ring, 1] * unit.vertices[:, 1])[:, None]
    )
    weights = chain_weights(at, tube.links, skeleton)[ring]
    return Part(tube.name, replace(unit, vertices=vertices), weights, tube.material, tube.tag)


def other_side(name: str) -> str:
    """`arm.R` for `arm.L` and the reverse; names without a side stay."""
    return name[:-1] + {"L": "R", "R": "L"}[name[-1]] if name[-2:] in (".L", ".R") else name


def mirrored(part: Part, skeleton: Skeleton, tag: int) -> Part:
    """The part on the other side of x = 0: bones ending in `.L` become `.R`."""
    columns = {bone.name: index for index, bone in enumerate(skeleton)}
    order = [columns[other_side(bone.name)] for bone in skeleton]
    surface = flipped(replace(part.surface, vertices=part.surface.vertices * (-1.0, 1.0, 1.0)))
    return replace(part, name=other_side(part.name), surface=surface, weights=part.weights[:, order], tag=tag)


def joined(parts: Sequence[Part], material_slots: Sequence[str]) -> tuple[Shape, Points, list[int]]:
    """Surface, weights and tag of every face of several parts; materials as slots of the list."""
    shapes = [
        replace(part.surface, materials=(material_slots.index(part.material),) * len(part.surface.faces))
        for part in parts
    ]
    tags = [part.tag for part in parts for _ in part.surface.faces]
    return join(shapes), np.concatenate([part.weights for part in parts]), tags
