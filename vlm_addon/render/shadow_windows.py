# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a scene that get shadow maps of their own under a sun, so that a millimetre shows before a kilometre.

Direct light uses spheres nested around the eye: a surface point at a distance is looked up in the smallest of them that
holds it, and near a sphere's end it fades into the next (cascades, Engel 2006; around the eye as clipmaps, Losasso and
Hoppe 2004). Phase one, which has no eye, uses spheres around the source samples of lights that are small for the map of
the whole scene. Where the map of the whole scene is fine enough there is no other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..core.scene import Float64, Int32
from .view import View

Int64 = npt.NDArray[np.int64]
Bounds = tuple[Float64, Float64]
"""Lower and upper corner of a box, (3,) float64 each."""

WHOLE_SCENE = 0
"""Index of the window that holds everything."""
STEP = 4.0
"""Each window's radius over the next smaller one's."""
MOST_NESTED = 10
"""Windows around the eye: beyond, float32 does not hold the vertices' places in them."""
MOST_OF_SAMPLES = 12
"""Windows of phase one."""
FADE = 0.8
"""Share of a sphere's radius from which on it fades into the next larger."""
# A window's centre lies on a grid of this part of its radius: small moves of the eye leave its map as it is.
_GRID = 0.125
_REACH = 1.0 - 0.5 * math.sqrt(3.0) * _GRID
# Texels that a light's source samples may lie apart at least.
_SPACING_TEXELS = 0.5
# Places that are tried for a window of each size.
_SEEDS = 4


@dataclass(frozen=True)
class ShadowWindow:
    """A sphere whose surfaces a shadow map must show. centre: m from the local origin; radius: m."""

    centre: tuple[float, float, float]
    radius: float


@dataclass(frozen=True)
class ViewWindow:
    """A window around the eye; None for the whole scene. It counts for surface points between two distances from the
    eye, m: it fades out between FADE of the outer one and that one, and in towards the inner one likewise."""

    window: ShadowWindow | None
    outer: float
    inner: float


ALL_DISTANCES = ViewWindow(None, math.inf, 0.0)


def view_windows(view: View, low: Float64, high: Float64, nearest: float, farthest: float) -> tuple[ViewWindow, ...]:
    """The windows that surface points between two distances from the eye need, the largest first.

    low, high: (3,) bounds of the scene, m from the local origin. An orthographic eye sees everything equally large and
    gets a single window.
    """
    radius = 0.5 * float(np.linalg.norm(high - low))
    if not 0.0 < radius < math.inf or not farthest >= nearest:
        return (ALL_DISTANCES,)
    middle = 0.5 * (low + high)
    if view.is_orthographic:
        return (_orthographic_window(view, middle, radius, nearest, farthest),)
    forward, cosine = _cone(view)
    # The sphere around a cone of length 1 from its apex: its radius, and the distance of its centre.
    narrow = cosine > math.sqrt(0.5)
    sphere = 0.5 / cosine if narrow else math.sqrt(1.0 - cosine * cosine)
    along = sphere if narrow else cosine
    windows = []
    outer = math.inf
    for level in range(MOST_NESTED + 1):
        size = radius * STEP**-level
        inner = size / STEP * _REACH / sphere if level < MOST_NESTED else 0.0
        # Left out where no point would be looked up in it.
        if outer > nearest and FADE * inner < farthest:
            window = None
            if level > 0:
                centre = _on_grid(view.position + along * outer * forward, middle, _GRID * size)
                window = ShadowWindow(centre, size)
            windows.append(ViewWindow(window, outer, inner if inner > nearest else 0.0))
        outer = inner
    return tuple(windows)


def same_window(window: ShadowWindow, bounds: Bounds, other: Bounds) -> ShadowWindow:
    """One of `view_windows` in another space, where the scene's `bounds` are `other`: the same to the bit for all eyes
    that get it."""
    radii = [0.5 * float(np.linalg.norm(high - low)) for low, high in (bounds, other)]
    middles = [0.5 * (low + high) for low, high in (bounds, other)]
    # A window's share of the scene is a power of two, its centre lies on a grid through the middle.
    radius = radii[1] * 2.0 ** round(math.log2(window.radius / radii[0]))
    cell = np.round((np.array(window.centre) - middles[0]) / (_GRID * window.radius))
    x, y, z = (middles[1] + _GRID * radius * cell).tolist()
    return ShadowWindow((x, y, z), radius)


def _orthographic_window(view: View, middle: Float64, scene: float, nearest: float, farthest: float) -> ViewWindow:
    corners = _corners(view) - view.position
    depths = corners @ view.backward
    across = corners - depths[:, None] * view.backward
    centre = across.mean(axis=0)
    half_width = float(np.linalg.norm(across - centre, axis=1).max())
    # Distances from the eye bound depths along the view.
    reach = float(np.linalg.norm(across, axis=1).max())
    least = math.sqrt(max(nearest * nearest - reach * reach, 0.0))
    needed = math.hypot(half_width, 0.5 * (farthest - least)) / _REACH
    size = scene * 2.0 ** math.ceil(math.log2(needed / scene))
    if size >= scene:
        return ALL_DISTANCES
    centre = view.position + centre - 0.5 * (least + farthest) * view.backward
    return ViewWindow(ShadowWindow(_on_grid(centre, middle, _GRID * size), size), math.inf, 0.0)


def _corners(view: View) -> Float64:
    """(4, 3) points that show in the picture's corners, m from the local origin."""
    corners = np.array([[x, y, 0.0, 1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    points = np.linalg.solve(view.clip_from_local, corners.T).T
    return points[:, :3] / points[:, 3:]


def _cone(view: View) -> tuple[Float64, float]:
    """Axis, unit, and cosine of half the angle of the cone around a perspective view."""
    rays = _corners(view) - view.position
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    axis = rays.sum(axis=0)
    axis = axis / np.linalg.norm(axis)
    return axis, float((rays @ axis).min())


def _on_grid(point: Float64, anchor: Float64, grain: float) -> tuple[float, float, float]:
    x, y, z = (anchor + grain * np.round((point - anchor) / grain)).tolist()
    return x, y, z


def sample_windows(
    points: Float64, spacings: Float64, low: Float64, high: Float64, resolution: int
) -> tuple[tuple[ShadowWindow | None, ...], Int32]:
    """Windows for source samples, and for each of them (n,) the index of its window; the first is the whole scene.

    points: (n, 3), m from the local origin. spacings: (n,) m between a light's samples; 0 for one that needs nothing.
    low, high: (3,) bounds of the scene likewise. resolution: texels along a sun's map.
    """
    radius = 0.5 * float(np.linalg.norm(high - low))
    windows: list[ShadowWindow | None] = [None]
    indices = np.full(len(points), WHOLE_SCENE, np.int32)
    if not 0.0 < radius < math.inf:
        return tuple(windows), indices
    wanted = np.where(spacings > 0.0, spacings / _SPACING_TEXELS, np.inf)
    found = 2.0 * radius / (resolution * wanted)
    levels = np.clip(np.ceil(np.log(np.maximum(found, 1.0)) / math.log(STEP)), 0, MOST_NESTED).astype(int)
    given = np.zeros(len(points), int)
    while (given < levels).any() and len(windows) <= MOST_OF_SAMPLES:
        level, window = _most_useful(points, levels, given, radius)
        held = _held(points, window) & (given < np.minimum(levels, level))
        given[held], indices[held] = np.minimum(levels, level)[held], len(windows)
        windows.append(window)
    return tuple(windows), indices


def _most_useful(points: Float64, levels: Int64, given: Int64, radius: float) -> tuple[int, ShadowWindow]:
    """The level and window by which the points gain most levels, among some at each level."""
    found: list[tuple[int, int, ShadowWindow]] = []
    for level in range(1, int(levels.max()) + 1):
        lacking = np.flatnonzero(given < np.minimum(levels, level))
        gains = np.minimum(levels, level)[lacking] - given[lacking]
        for seed in lacking[np.linspace(0, len(lacking) - 1, _SEEDS).astype(int)] if len(lacking) else ():
            window = _window_around(points[lacking], points[seed], radius * STEP**-level)
            found.append((int(gains[_held(points[lacking], window)].sum()), level, window))
    _, level, window = max(found, key=lambda candidate: candidate[:2])
    return level, window


def _window_around(points: Float64, first: Float64, size: float) -> ShadowWindow:
    """A window of radius `size` that holds the point `first`, moved to the middle of the points near it."""
    near = points[((points - first) ** 2).sum(-1) <= size * size]
    middle = 0.5 * (near.min(axis=0) + near.max(axis=0))
    if ((first - middle) ** 2).sum() > size * size:
        middle = first
    x, y, z = middle.tolist()
    return ShadowWindow((x, y, z), size)


def _held(points: Float64, window: ShadowWindow) -> npt.NDArray[np.bool_]:
    return ((points - np.array(window.centre)) ** 2).sum(-1) <= window.radius * window.radius
