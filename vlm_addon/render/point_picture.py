# SPDX-License-Identifier: GPL-3.0-or-later
"""Points in space drawn over a picture, for people to look at."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..core.scene import Float32, Float64
from .view import View

DIMMED = 0.3
"""Of the base colour behind points."""

Bools = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.int64]

ONE_PIXEL: Bools = np.ones((1, 1), bool)
SQUARE: Bools = np.ones((3, 3), bool)


@dataclass(frozen=True)
class PointPlaces:
    """Where points are in a picture. shown: (n,) bool, of all points, which lie in it. rows, columns: (s,) int64 of
    those, row 0 at the top."""

    shown: Bools
    rows: Ints
    columns: Ints


def point_places(view: View, points: Float64, width: int, height: int) -> PointPlaces:
    """points: (n, 3), m from the local origin."""
    clip = points @ view.clip_from_local[:, :3].T + view.clip_from_local[:, 3]
    before = clip[:, 3] > 0.0
    place = np.full((len(points), 2), -1.0)
    place[before] = (0.5 + 0.5 * clip[before, :2] / clip[before, 3:]) * (width, height)
    shown = ((place >= 0.0) & (place < (width, height))).all(axis=1)
    columns, rows = np.floor(place[shown]).astype(np.int64).T
    return PointPlaces(shown, height - 1 - rows, columns)


def with_points(picture: Float32, view: View, points: Float64, colors: Float32, mark: Bools = ONE_PIXEL) -> Float32:
    """A copy of `picture` ((h, w, 3), row 0 at the top) with a mark for each point, whatever stands before it.

    points: (n, 3), m from the local origin. colors: (n, 3); where points share a pixel the last one shows. mark:
    (k, k), k odd, the pixels around a point's own that are coloured.
    """
    drawn = picture.copy()
    height, width = picture.shape[:2]
    places = point_places(view, points, width, height)
    offsets = np.argwhere(mark) - mark.shape[0] // 2
    rows, columns = (np.add.outer(at, by) for at, by in zip((places.rows, places.columns), offsets.T, strict=True))
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    drawn[rows[inside], columns[inside]] = np.broadcast_to(colors[places.shown][:, None], (*rows.shape, 3))[inside]
    return drawn


def palette(groups: npt.NDArray[np.integer]) -> Float32:
    """(n, 3) colours, one for each number among `groups` ((n,), from 0), evenly spread over all hues."""
    count = int(groups.max(initial=0)) + 1
    return np.array([colorsys.hsv_to_rgb(index / count, 0.8, 1.0) for index in range(count)], np.float32)[groups]
