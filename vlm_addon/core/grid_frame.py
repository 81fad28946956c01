# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a grid of cells lies, and which cell holds a point."""

from __future__ import annotations

import reprlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .active_hemisphere import on_steps
from .errors import InvalidInput
from .scene import Float32, Float64

Bounds = tuple[npt.ArrayLike, npt.ArrayLike]
OUTSIDE = -1

# A flat scene still gets cells of some thickness: this share of its largest extent.
_LEAST_EXTENT = 1e-2


@dataclass(frozen=True)
class GridFrame:
    """Where a grid lies. middle: (3,) float64, m. unit: m, a power of two. edges: (3, n + 1) float32, faces of cells.

    A point p of the world is (p - middle) / unit in the frame, where the grid is within -1/2 to 1/2.
    """

    middle: Float64
    unit: float
    edges: Float32

    @property
    def cells_per_axis(self) -> int:
        """n of the n x n x n cells."""
        return self.edges.shape[1] - 1

    def local(self, points: Float64) -> Float64:
        """(p, 3) points of the world in the frame."""
        return np.asarray((points - self.middle) / self.unit)

    def cells(self, points: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """(p,) int64 index of the cell that holds each of (p, 3) points, OUTSIDE for those outside all cells.

        A point on a face between cells is in the upper one. Raises InvalidInput for points that are not finite.
        """
        local = self.local(finite_points(points)).astype(np.float32)
        inside = ((local >= self.edges[:, 0]) & (local <= self.edges[:, -1])).all(axis=1)
        per_axis = self.cells_per_axis
        i, j, k = (
            np.minimum(np.searchsorted(edges, local[:, axis], "right") - 1, per_axis - 1)
            for axis, edges in enumerate(self.edges)
        )
        return np.where(inside, (k * per_axis + j) * per_axis + i, OUTSIDE)

    def cell_box(self, cell: int) -> tuple[Float32, Float32]:
        """Lower and upper corner of a cell in the frame, (3,) each."""
        per_axis, axes = self.cells_per_axis, np.arange(3)
        place = np.array([cell % per_axis, cell // per_axis % per_axis, cell // per_axis**2])
        return self.edges[axes, place], self.edges[axes, place + 1]


def make_frame(bounds: Bounds, cells_per_axis: int) -> GridFrame:
    """The frame of a grid over `bounds`, lower and upper corner in m; a flat box gets some thickness.

    Raises InvalidInput for bounds that are not finite or empty.
    """
    low, high = finite_bounds(bounds)
    largest = float((high - low).max())
    extents = np.maximum(high - low, _LEAST_EXTENT * largest) if largest > 0.0 else np.ones(3)
    unit = 2.0 ** float(np.ceil(np.log2(extents.max())))
    steps = np.linspace(-0.5, 0.5, cells_per_axis + 1)
    edges = on_steps(steps * (extents / unit)[:, None]).astype(np.float32)
    return GridFrame(0.5 * low + 0.5 * high, unit, edges)


def finite_bounds(bounds: Bounds) -> Float64:
    """(2, 3) lower and upper corner. Raises InvalidInput where they are not finite or empty."""
    remedy = "give the lower and upper corner of the scene, (x, y, z) each"
    corners = as_numbers(bounds, "light grid bounds", remedy)
    if corners.shape != (2, 3):
        raise InvalidInput("light grid bounds", f"shape {corners.shape} is not (2, 3)", remedy)
    low, high = corners
    if not np.isfinite(low + high).all() or (low > high).any():
        raise InvalidInput("light grid bounds", f"{low} to {high}", remedy)
    return corners


def finite_points(points: npt.ArrayLike) -> Float64:
    """(p, 3) float64. Raises InvalidInput for another shape or what is not finite."""
    array = as_numbers(points, "light grid points", "give (p, 3) numbers, m")
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidInput("light grid points", f"shape {array.shape} is not (p, 3)", "give one row of three per point")
    finite = np.isfinite(array).all(axis=1)
    if not finite.all():
        row = int(np.argmin(finite))
        raise InvalidInput(f"light grid points row {row}", f"{array[row]} is not finite", "remove NaN and infinity")
    return array


def as_numbers(values: object, subject: str, remedy: str) -> Float64:
    """`values` as a float64 array. Raises InvalidInput that names `subject` where they are no such thing."""
    try:
        return np.asarray(values, np.float64)
    except (TypeError, ValueError):
        text = reprlib.repr(values)
        raise InvalidInput(subject, f"{text} is not an array of numbers", remedy) from None
