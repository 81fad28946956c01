# SPDX-License-Identifier: GPL-3.0-or-later
"""Points in space drawn into a picture, for people to look at."""

from __future__ import annotations

import colorsys

import numpy as np
import numpy.typing as npt

from ..core.scene import Float32, Float64
from .view import View


def drawn_points(view: View, points: Float64, groups: npt.NDArray[np.integer], size: tuple[int, int]) -> Float32:
    """(h, w, 3) linear, row 0 at the top: a pixel for each of (n, 3) `points`, whatever stands before it; else black.

    points: m from the local origin. groups: (n,) from 0; each has a colour of its own, as bright as all others.
    """
    width, height = size
    picture = np.zeros((height, width, 3), np.float32)
    clip = points @ view.clip_from_local[:, :3].T + view.clip_from_local[:, 3]
    before = clip[:, 3] > 0.0
    place = np.full((len(points), 2), -1.0)
    place[before] = (0.5 + 0.5 * clip[before, :2] / clip[before, 3:]) * size
    shown = ((place >= 0.0) & (place < size)).all(axis=1)
    columns, rows = np.floor(place[shown]).astype(int).T
    picture[height - 1 - rows, columns] = _colors(groups)[shown]
    return picture


def _colors(groups: npt.NDArray[np.integer]) -> Float32:
    count = int(groups.max(initial=0)) + 1
    palette = np.array([colorsys.hsv_to_rgb(index / count, 0.8, 1.0) for index in range(count)], np.float32)
    return palette[groups]
