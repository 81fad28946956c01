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


def filtered(
    surface: Surface, values: np.ndarray, n: int, reach: Float64, least_cosine: float, rings: int = 2
) -> Float64:
    """(h, w, c) means of the classes' means. reach: (h, w), m, from each pixel's plane. rings: 1 without a second look
    for classes that have nothing within n / 2."""
    shown = surface[2].any(axis=2)
    usable = np.isfinite(values).all(axis=2) & shown
    safe = np.where(usable[..., None], values, 0.0).astype(float)
    total, classes = np.zeros(safe.shape), np.zeros(shown.shape)
    for members in _classes(n):
        mean, missing = np.zeros(safe.shape), np.ones(shown.shape, bool)
        for ring in range(rings):
            sums, count = np.zeros(safe.shape), np.zeros(shown.shape)
            for dx, dy in members[ring]:
                one = _is_one_surface(surface, dx, dy, reach, least_cosine) & shifted(usable, dx, dy, False)
                sums += np.where(one[..., None], shifted(safe, dx, dy, 0.0), 0.0)
                count += one
            found = missing & (count > 0)
            mean[found] = sums[found] / count[found][:, None]
            missing &= ~found
        total += mean
        classes += ~missing
    return np.where((shown & (classes > 0))[..., None], total / np.maximum(classes, 1)[..., None], 0.0)


def _classes(n: int) -> Iterator[tuple[list[tuple[int, int]], list[tuple[int, int]]]]:
    """For each class its offsets from the pixel, of those up to n / 2 and of those up to n."""
    square = [(dx, dy) for dy in range(-n, n + 1) for dx in range(-n, n + 1)]
    for residue in {(dx % n, dy % n) for dx, dy in square}:
        of_class = [o for o in square if (o[0] % n, o[1] % n) == residue]
        near = [o for o in of_class if 2 * max(map(abs, o)) <= n]
        yield near, [o for o in of_class if o not in near]


def _is_one_surface(surface: Surface, dx: int, dy: int, reach: Float64, least_cosine: float) -> np.ndarray:
    if (dx, dy) == (0, 0):
        return surface[2].any(axis=2)
    position, shading, geometric = surface
    other_position, other_shading, other_geometric = (shifted(image, dx, dy, 0.0) for image in surface)
    way = (other_position - position)[..., :3]
    return (
        other_geometric.any(axis=2)
        & ((shading * other_shading).sum(axis=2) >= least_cosine)
        & (abs((way * geometric).sum(axis=2)) <= reach)
        & (abs((way * other_geometric).sum(axis=2)) <= shifted(reach, dx, dy, 0.0))
    )
