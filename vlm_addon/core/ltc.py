# SPDX-License-Identifier: GPL-3.0-or-later
"""The GGX lobe as a linearly transformed cosine (Heitz, Dupuy, Hill and Neubelt 2016); oracle of `lib/ltc.glsl`.

A linear map takes the directions of a lobe to those of a cosine-weighted hemisphere, so that what a lobe receives from
a polygon is the form factor of the mapped polygon. Here the map has four numbers: how far the lobe's axis leans from
the mirror direction, two widths, and a tilt by which one side falls off faster. They are kept as shares of alpha, which
makes them smooth down to mirrors. What of a fitted lobe lies below the surface is cut off and made up for, so the fit
is one of the upper hemisphere alone.

The surface's frame: z along the normal, the eye at (sin, 0, cos). `benchmarks/fit_ltc.py` makes the table.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .errors import VlmError
from .scene import Float32, Float64

TABLE_FILE = Path(__file__).resolve().parents[2] / "gpu_shaders" / "tables" / "ltc_ggx.npy"
TABLE_SIZE = 32
LEAST_COSINE = 0.005
"""Of the eye: the table's last column, which stands for all lower ones."""


@lru_cache(maxsize=1)
def ltc_table() -> Float32:
    """(32, 32, 4) float32 indexed [roughness, view]: lean in radians, both widths over alpha, tilt.

    Coordinates run over [0, 1] with the first and last entry on the ends: roughness, and `view_coordinate`. Raises
    VlmError where the file is missing or another one.
    """
    try:
        table = np.load(TABLE_FILE, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise VlmError(f"{TABLE_FILE.name}: {error}; install the extension again") from error
    if table.shape != (TABLE_SIZE, TABLE_SIZE, 4) or table.dtype != np.float32 or not np.isfinite(table).all():
        raise VlmError(f"{TABLE_FILE.name} is not the table of lobes; install the extension again")
    return np.ascontiguousarray(table)


def view_coordinate(cos_view: npt.ArrayLike) -> Float64:
    """Where the table holds a view: 0 along the normal, 1 at LEAST_COSINE and below; about even in angle."""
    cosine = np.clip(np.asarray(cos_view, np.float64), LEAST_COSINE, 1.0)
    return np.asarray(np.sqrt((1.0 - cosine) / (1.0 - LEAST_COSINE)))


def view_cosine(coordinate: npt.ArrayLike) -> Float64:
    """Inverse of `view_coordinate`."""
    coordinate = np.asarray(coordinate, np.float64)
    return np.asarray(1.0 - coordinate * coordinate * (1.0 - LEAST_COSINE))


def lookup_ltc(roughness: npt.ArrayLike, cos_view: npt.ArrayLike) -> Float64:
    """The table interpolated linearly: (..., 4) for inputs broadcast to (...)."""
    rows, columns = np.broadcast_arrays(np.clip(roughness, 0.0, 1.0), view_coordinate(cos_view))
    table = ltc_table().astype(np.float64)
    scaled = [coordinate * (TABLE_SIZE - 1) for coordinate in (rows, columns)]
    lower = [np.minimum(np.floor(s).astype(int), TABLE_SIZE - 2) for s in scaled]
    row, column = ((s - i)[..., None] for s, i in zip(scaled, lower, strict=True))
    i, j = lower
    low = table[i, j] * (1.0 - column) + table[i, j + 1] * column
    high = table[i + 1, j] * (1.0 - column) + table[i + 1, j + 1] * column
    return np.asarray(low * (1.0 - row) + high * row)


def lobe_map(parameters: npt.ArrayLike, alpha: npt.ArrayLike, cos_view: npt.ArrayLike) -> Float64:
    """(..., 3, 3) float64: directions of the surface's frame to the lobe's, in which it is a cosine about z.

    parameters: (..., 4) as in `ltc_table`. alpha: roughness squared, above 0.
    """
    lean, width_x, width_y, tilt = np.moveaxis(np.asarray(parameters, np.float64), -1, 0)
    cos_view, alpha = np.asarray(cos_view, np.float64), np.asarray(alpha, np.float64)
    angle = np.arccos(np.clip(cos_view, 0.0, 1.0)) + lean
    sine, cosine = np.sin(angle), np.cos(angle)
    zero = np.zeros_like(sine)
    x_axis, z_axis = np.stack([cosine, zero, sine], -1), np.stack([-sine, zero, cosine], -1)
    y_axis = np.stack([zero, zero + 1.0, zero], -1)
    rows = (
        x_axis / (width_x * alpha)[..., None],
        y_axis / (width_y * alpha)[..., None],
        z_axis - tilt[..., None] * x_axis,
    )
    return np.stack(rows, axis=-2)


def upper_share(to_lobe: npt.ArrayLike) -> Float64:
    """(...) share of the lobe that lies above the surface."""
    to_lobe = np.asarray(to_lobe, np.float64)
    # Planes go with the inverse transpose.
    normal = np.linalg.inv(to_lobe)[..., 2, :]
    return np.asarray(0.5 + 0.5 * normal[..., 2] / np.linalg.norm(normal, axis=-1))


def lobe_density(to_lobe: npt.ArrayLike, directions: npt.ArrayLike) -> Float64:
    """(...) share of the part of the lobe above the surface per steradian, 1/sr; 0 below.

    directions: (..., 3) unit, in the surface's frame. Heitz et al. 2016, eq. 1, over `upper_share`.
    """
    to_lobe, directions = np.asarray(to_lobe, np.float64), np.asarray(directions, np.float64)
    mapped = (to_lobe @ directions[..., None])[..., 0]
    squared = (mapped * mapped).sum(-1)
    cosine = np.where(directions[..., 2] > 0.0, np.maximum(mapped[..., 2], 0.0), 0.0)
    density = np.linalg.det(to_lobe) * cosine / (np.pi * squared * squared)
    return np.asarray(density / upper_share(to_lobe))
