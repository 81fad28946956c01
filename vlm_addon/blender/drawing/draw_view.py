# SPDX-License-Identifier: GPL-3.0-or-later
"""What a region of the 3D view sees: pixels to rays and back, in perspective, orthographic and camera views.

In float64 from Blender's projection, whose own helpers unproject in float32 next to the eye.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.scene import Float64

FARTHEST = 1e6
"""m, how far a ray goes where float32 has lost the distance at which the view ends."""


@dataclass(frozen=True)
class View:
    """projection, view: (4, 4) float64 of the region. size: (width, height) pixels."""

    projection: Float64
    view: Float64
    size: tuple[int, int]

    @property
    def is_perspective(self) -> bool:
        return bool(self.projection[3, 3] == 0.0)

    def ray(self, pixel: Float64) -> tuple[Float64, Float64, float]:
        """Origin (where the view begins), unit direction and length (m) of what shows at a pixel of the region."""
        p = self.projection
        x, y = 2.0 * np.asarray(pixel, np.float64) / self.size - 1.0
        if self.is_perspective:
            way = np.array([(x + p[0, 2]) / p[0, 0], (y + p[1, 2]) / p[1, 1], -1.0])
            near = p[2, 3] / (p[2, 2] - 1.0)
            far = _far(p[2, 3], p[2, 2] + 1.0, near)
            start, length = near * way, (far - near) * float(np.linalg.norm(way))
        else:
            near, far = (-1.0 - p[2, 3]) / p[2, 2], (1.0 - p[2, 3]) / p[2, 2]
            start = np.array([(x - p[0, 3]) / p[0, 0], (y - p[1, 3]) / p[1, 1], near])
            way, length = np.array([0.0, 0.0, -1.0]), near - far
        turn, eye = np.linalg.inv(self.view[:3, :3]), self.view[:3, 3]
        direction = turn @ way
        return turn @ (start - eye), direction / np.linalg.norm(direction), length

    def pixels(self, points: Float64) -> Float64:
        """(n, 2) where (n, 3) points show, NaN for what is behind the eye."""
        local = np.asarray(points, np.float64) @ self.view[:3, :3].T + self.view[:3, 3]
        clip = local @ self.projection[:, :3].T + self.projection[:, 3]
        w = np.where(clip[:, 3:] > 0.0, clip[:, 3:], np.nan)
        return np.asarray(0.5 * (clip[:, :2] / w + 1.0) * self.size, np.float64)

    def metres_per_pixel(self, point: Float64) -> float:
        """How large a pixel is at a point in front of the eye, m."""
        local = self.view[:3, :3] @ point + self.view[:3, 3]
        w = abs(float(self.projection[3, :3] @ local + self.projection[3, 3]))
        return 2.0 * w / (abs(float(self.projection[1, 1])) * self.size[1])


def _far(numerator: float, denominator: float, near: float) -> float:
    far = numerator / denominator if denominator else FARTHEST
    return far if near < far < FARTHEST else FARTHEST


def view_under(area: Any, x: int, y: int) -> tuple[View, Float64] | None:
    """The view of the region of a 3D view that is under the mouse, and the pixel in it; None beside them.

    x, y: in the window. With a quad view each of the four regions is one.
    """
    for region in area.regions:
        if region.type == "WINDOW" and 0 <= x - region.x < region.width and 0 <= y - region.y < region.height:
            data = region.data or area.spaces.active.region_3d
            view = View(
                np.array(data.window_matrix, np.float64),
                np.array(data.view_matrix, np.float64),
                (region.width, region.height),
            )
            return view, np.array([x - region.x, y - region.y], np.float64)
    return None
