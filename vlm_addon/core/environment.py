# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions, solid angles and sums of equirectangular maps, in Blender's mapping.

A texel at (u, v) in [0, 1]² looks along (cos e cos a, cos e sin a, sin e), elevation e = pi (v - 1/2), azimuth
a = 2 pi (1/2 - u): the middle column towards +x, columns left of it towards +y, the top row up (Cycles' environment
texture, confirmed by renders in tests/blender/test_world.py).
"""

from __future__ import annotations

import numpy as np

from .errors import InvalidInput
from .scene import Environment, Float32, Float64

ROWS_AT_ONCE = 256
"""Rows of a large map that are in memory in float64 together."""


def map_directions(height: int, width: int) -> Float64:
    """(height, width, 3) float64 unit vectors through the texels' centres, in the map's frame."""
    elevation = np.pi * ((np.arange(height) + 0.5) / height - 0.5)
    azimuth = 2.0 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)
    flat = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    directions = np.empty((height, width, 3))
    directions[..., :2] = np.cos(elevation)[:, None, None] * flat
    directions[..., 2] = np.sin(elevation)[:, None]
    return directions


def map_solid_angles(height: int, width: int) -> Float64:
    """(height,) float64 sr of a texel in each row."""
    edges = np.sin(np.pi * (np.arange(height + 1) / height - 0.5))
    return np.diff(edges) * (2.0 * np.pi / width)


def map_places(directions: Float64) -> Float64:
    """(..., 2) float64 u, v of directions (..., 3) in the map's frame; they need not be unit."""
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    azimuth = np.arctan2(y, x)
    elevation = np.arctan2(z, np.hypot(x, y))
    return np.stack([0.5 - azimuth / (2.0 * np.pi), 0.5 + elevation / np.pi], axis=-1)


def radiance_at(radiance: Float32, places: Float64) -> Float64:
    """(..., 3) float64 of a map (h, w, 3) at u, v (..., 2), between texels' centres by their distance.

    Goes on around the map's sides; above and below it ends with its first and last row.
    """
    height, width = radiance.shape[:2]
    x, y = places[..., 0] * width - 0.5, np.clip(places[..., 1] * height - 0.5, 0.0, height - 1.0)
    left, low = np.floor(x).astype(int), np.minimum(np.floor(y).astype(int), max(height - 2, 0))
    share_x, share_y = (x - left)[..., None], (y - low)[..., None]
    high = np.minimum(low + 1, height - 1)
    rows = []
    for row in (low, high):
        rows.append((1.0 - share_x) * radiance[row, left % width] + share_x * radiance[row, (left + 1) % width])
    found: Float64 = (1.0 - share_y) * rows[0] + share_y * rows[1]
    return found


def radiance_towards(environment: Environment, directions: Float64) -> Float64:
    """(..., 3) float64 W/(m² sr) that come from `directions` (..., 3) in world space."""
    return radiance_at(environment.radiance, map_places(directions @ environment.map_from_world.T))


def require_usable_environment(environment: Environment) -> None:
    """Raises InvalidInput for a map of another shape, or radiance that is not finite or below 0."""
    subject, radiance = f"environment {environment.name!r}", environment.radiance
    if radiance.ndim != 3 or radiance.shape[2] != 3 or not radiance.size:
        raise InvalidInput(subject, f"its map has shape {radiance.shape}", "give (height, width, 3)")
    rotation = np.asarray(environment.map_from_world, np.float64)
    if rotation.shape != (3, 3) or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6):
        raise InvalidInput(subject, "its map is not turned by a rotation", "give an orthonormal matrix")
    if not np.isfinite(radiance).all():
        raise InvalidInput(subject, "its radiance is not finite everywhere", "repair or clamp the picture")
    if (radiance < 0.0).any():
        raise InvalidInput(subject, "its radiance is below 0 somewhere", "clamp the picture at 0")


def resized_map(values: np.ndarray, height: int, width: int) -> Float64:
    """(height, width, c) float64 means over solid angle of a map (h, w, c): the sum of value times solid angle stays.

    Texels are taken as evenly bright; one that lies on a border is shared by area.
    """
    if values.shape[:2] == (height, width):
        return np.asarray(values, np.float64)
    old_edges = np.sin(np.pi * (np.arange(values.shape[0] + 1) / values.shape[0] - 0.5))
    new_edges = np.sin(np.pi * (np.arange(height + 1) / height - 0.5))
    blocks = (values[first : first + ROWS_AT_ONCE] for first in range(0, values.shape[0], ROWS_AT_ONCE))
    columns = np.arange(values.shape[1] + 1, dtype=np.float64)
    narrow = [
        _sums_between(block.swapaxes(0, 1), columns, np.linspace(0.0, columns[-1], width + 1)) for block in blocks
    ]
    by_row = np.concatenate(narrow, axis=1).swapaxes(0, 1) * (width / values.shape[1])
    means: Float64 = _sums_between(by_row, old_edges, new_edges) / np.diff(new_edges)[:, None, None]
    return means


def _sums_between(densities: np.ndarray, edges: Float64, new_edges: Float64) -> Float64:
    """Integrals between `new_edges` over the first axis of what is constant between each two of `edges`."""
    cuts = np.union1d(edges, new_edges)
    index = np.clip(np.searchsorted(edges, cuts[:-1], side="right") - 1, 0, len(densities) - 1)
    lengths = np.diff(cuts).reshape(-1, *[1] * (densities.ndim - 1))
    # No differences of sums: what is dim stays exact beside what is bright.
    sums: Float64 = np.add.reduceat(densities[index] * lengths, np.searchsorted(cuts, new_edges[:-1]), axis=0)
    return sums
