# SPDX-License-Identifier: GPL-3.0-or-later
"""Points in space drawn over a picture, for people to look at."""

from __future__ import annotations

import colorsys

import numpy as np
import numpy.typing as npt

from ..core.scene import Float32, Float64
from .view import View


def with_points(picture: Float32, view: View, points: Float64, colors: Float32) -> Float32:
    """A copy of `picture` ((h, w, 3), row 0 at the top) with a pixel for each point, whatever stands before it.

    points: (n, 3), m from the local origin. colors: (n, 3); where points share a pixel the last one shows.
    """
    drawn = picture.copy()
    height, width = picture.shape[:2]
    clip = points @ view.clip_from_local[:, :3].T + view.clip_from_local[:, 3]
    before = clip[:, 3] > 0.0
    place = np.full((len(points), 2), -1.0)
    place[before] = (0.5 + 0.5 * clip[before, :2] / clip[before, 3:]) * (width, height)
    shown = ((place >= 0.0) & (place < (width, height))).all(axis=1)
    columns, rows = np.floor(place[shown]).astype(int).T
    drawn[height - 1 - rows, columns] = colors[shown]
    return drawn


def palette(groups: npt.NDArray[np.integer]) -> Float32:
    """(n, 3) colours, one for each number among `groups` ((n,), from 0), evenly spread over all hues."""
    count = int(groups.max(initial=0)) + 1
    return np.array([colorsys.hsv_to_rgb(index / count, 0.8, 1.0) for index in range(count)], np.float32)[groups]
