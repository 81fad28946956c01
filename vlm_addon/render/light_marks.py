# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual point lights over the picture, coloured by their power, for people to look at (seed 004, fig. 4.9)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..core.scene import Float32, Float64
from .passes.accumulate import read_image
from .passes.gbuffer import GBuffer
from .passes.point_lights import PointLights
from .point_picture import SQUARE, Bools, point_places, with_points
from .view import View

BOUNCE_MARKS: tuple[Bools, ...] = (
    SQUARE,
    np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool),
    np.array([[1, 0, 1], [0, 1, 0], [1, 0, 1]], bool),
)
"""A square, an upright cross, a cross of diagonals."""
DIMMED = 0.08
"""Of the base colour behind the marks: white walls stay darker than marks of the mean power."""
BRIGHTNESS_OF_MEAN = 0.5
FAINTEST = 0.1
"""Of a mark whose light has next to no power."""
HIDDEN = 0.25
"""Of a mark's brightness where something stands before its light."""


def marked_lights(gbuffer: GBuffer, view: View, bounces: Sequence[PointLights]) -> Float32:
    """(h, w, 3) float32, row 0 at the top: the base colour, dimmed, and a mark for each light that is in the picture.

    A mark has the hue of its light's flux, half of full brightness for the mean power of the first bounce's lights, and
    a shape for its bounce; where its light is hidden it is faint. Lights without power have none. bounces: the lights
    of each, at most as many as BOUNCE_MARKS, in the G-buffer's space. Waits for the device.
    """
    picture: Float32 = DIMMED * read_image(gbuffer.base_color)[..., :3]
    records = [bounce.records() for bounce in bounces]
    mean = float(records[0]["flux"].mean(dtype=np.float64)) if records and len(records[0]) else 0.0
    drawn = []
    for lights, mark in zip(records, BOUNCE_MARKS, strict=False):
        lit = lights[lights["flux"].max(axis=1, initial=0.0) > 0.0]
        points = lit["position"].astype(np.float64)
        drawn.append((points, _colours(lit["flux"], mean), seen_points(gbuffer, view, points), mark))
    for is_seen in (False, True):
        for points, colours, seen, mark in drawn:
            chosen = seen == is_seen
            share = 1.0 if is_seen else HIDDEN
            picture = with_points(picture, view, points[chosen], share * colours[chosen], mark)
    return picture


def _colours(flux: Float32, mean: float) -> Float32:
    """(n, 3): hue of the flux, as bright as its mean beside `mean`."""
    relative = flux.mean(axis=1, keepdims=True) / max(mean, 1e-30)
    brightness = np.clip(BRIGHTNESS_OF_MEAN * relative, FAINTEST, 1.0)
    return np.asarray(flux / flux.max(axis=1, keepdims=True, initial=1e-30) * brightness, np.float32)


def seen_points(gbuffer: GBuffer, view: View, points: Float64) -> Bools:
    """(n,) which surface points, (n, 3) m from the local origin, are in the picture and nothing stands before them.

    A point counts as seen where it lies in the plane of what its pixel shows within the size of the pixel, or before
    it. Waits for the device.
    """
    surface, normals = (read_image(image).astype(np.float64) for image in (gbuffer.position, gbuffer.geometric_normal))
    height, width = surface.shape[:2]
    places = point_places(view, points, width, height)
    seen = places.shown.copy()
    shown = points[places.shown]
    found, normal = surface[places.rows, places.columns], normals[places.rows, places.columns, :3]
    depth = (view.position - shown) @ view.backward
    at_0, per_depth = (across / width for across in view.picture_width(width))
    over = ((shown - found[:, :3]) * normal).sum(axis=1)
    is_empty = ~normal.any(axis=1)
    seen[places.shown] = is_empty | (depth <= found[:, 3]) | (np.abs(over) <= at_0 + per_depth * found[:, 3])
    return seen
