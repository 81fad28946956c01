# SPDX-License-Identifier: GPL-3.0-or-later
"""The geometry-aware filter in numpy, by its definition: classes of pixels, and who counts for whom."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vlm_addon.core.scene import Float64

Surface = tuple[Float64, Float64, Float64]
"""(h, w, 4) positions and depths, (h, w, 3) shading and (h, w, 3) geometric normals, 0 where nothing shows."""


def shifted(image: np.ndarray, dx: int, dy: int, fill: float) -> np.ndarray:
    """The image's value dx pixels to the right and dy down of each pixel; `fill` beyond it."""
    height, width = image.shape[:2]
    result = np.full_like(image, fill)
    to_y, to_x = (slice(max(-d, 0), max(side - max(d, 0), 0)) for d, side in ((dy, height), (dx, width)))
    from_y, from_x = (slice(max(d, 0), max(side - max(-d, 0), 0)) for d, side in ((dy, height), (dx, width)))
    result[to_y, to_x] = image[from_y, from_x]
    return result


class Neighbours:
    """Who counts for whom, and their values. reach: (h, w), m, from each pixel's plane."""

    def __init__(self, surface: Surface, values: np.ndarray, reach: Float64, least_cosine: float) -> None:
        self._surface, self._reach, self._least_cosine = surface, reach, least_cosine
        self.shown = surface[2].any(axis=2)
        self._usable = np.isfinite(values).all(axis=2)
        self._values = np.where(self._usable[..., None], values, 0.0).astype(float)

    def at(self, dx: int, dy: int) -> tuple[np.ndarray, Float64]:
        """(h, w, 1) whether the pixel there counts, (h, w, c) its value or 0."""
        one = self._is_one_surface(dx, dy) & shifted(self._usable, dx, dy, False) & self.shown
        return one[..., None], np.where(one[..., None], shifted(self._values, dx, dy, 0.0), 0.0)

    def _is_one_surface(self, dx: int, dy: int) -> np.ndarray:
        if (dx, dy) == (0, 0):
            return self.shown
        position, shading, geometric = self._surface
        other_position, other_shading, other_geometric = (shifted(image, dx, dy, 0.0) for image in self._surface)
        way = (other_position - position)[..., :3]
        return (
            other_geometric.any(axis=2)
            & ((shading * other_shading).sum(axis=2) >= self._least_cosine)
            & (abs((way * geometric).sum(axis=2)) <= self._reach)
            & (abs((way * other_geometric).sum(axis=2)) <= shifted(self._reach, dx, dy, 0.0))
        )


def filtered(surface: Surface, values: np.ndarray, n: int, reach: Float64, least_cosine: float) -> Float64:
    """(h, w, c) means of the classes' means, moved to the pixel's place. reach: (h, w), m, from each pixel's plane."""
    neighbours = Neighbours(surface, values, reach, least_cosine)
    height, width, channels = values.shape
    total, lowest, classes = (np.zeros((height, width, count)) for count in (channels, channels, 1))
    offsets = np.zeros((height, width, 2))
    for near, far in _classes(n):
        counted = np.zeros((height, width, 1), bool)
        for ring in (near, far):
            found = [(*neighbours.at(dx, dy), (dx, dy)) for dx, dy in ring]
            count = sum(one.astype(float) for one, _, _ in found) if found else np.zeros((height, width, 1))
            new = (count > 0) & ~counted
            divisor = np.where(new, np.maximum(count, 1), np.inf)
            for one, value, offset in found:
                total += value / divisor
                offsets += one * offset / divisor
                lowest = np.minimum(lowest, np.where(one & new, value, 0.0))
            counted |= new
        classes += counted
    mean = total / np.maximum(classes, 1)
    for axis in range(2):
        mean -= _slope(neighbours, n, axis) * offsets[..., axis : axis + 1] / np.maximum(classes, 1)
    return np.maximum(mean, lowest)


def _slope(neighbours: Neighbours, n: int, axis: int) -> Float64:
    """(h, w, c) growth for each pixel to the right or down, of pairs n apart, less of it the less certain it is."""
    pairs = [
        (neighbours.at(*_turned(along, across, axis)), neighbours.at(*_turned(along + n, across, axis)))
        for along in range(-n, 1)
        for across in range(-(n // 2), n // 2 + 1)
    ]
    both = [(one & other, last - first) for (one, first), (other, last) in pairs]
    count = sum(pair.astype(float) for pair, _ in both)
    growths = np.stack([np.where(pair, difference / n, np.nan) for pair, difference in both])
    mean = np.nansum(growths, axis=0) / np.maximum(count, 1)
    spread = np.nansum((growths - mean)[..., :3] ** 2, axis=(0, 3))[..., None]
    size = (mean[..., :3] ** 2).sum(axis=2, keepdims=True)
    uncertainty = spread / np.maximum(count * (count - 1), 1)
    share = np.maximum(1.0 - uncertainty / np.where(size > 0.0, size, np.inf), 0.0)
    return np.where(count > 1, mean * share, 0.0)


def _turned(along: int, across: int, axis: int) -> tuple[int, int]:
    return (along, across) if axis == 0 else (across, along)


def _classes(n: int) -> Iterator[tuple[list[tuple[int, int]], list[tuple[int, int]]]]:
    """For each class its offsets from the pixel, of those up to n / 2 and of those up to n."""
    square = [(dx, dy) for dy in range(-n, n + 1) for dx in range(-n, n + 1)]
    for residue in {(dx % n, dy % n) for dx, dy in square}:
        of_class = [o for o in square if (o[0] % n, o[1] % n) == residue]
        near = [o for o in of_class if 2 * max(map(abs, o)) <= n]
        yield near, [o for o in of_class if o not in near]
