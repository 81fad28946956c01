# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of lamps without shadows, in Blender's units: sample points for soft shadows and the shaders' oracle.

The units, each confirmed by renders of Cycles 5.0 (benchmarks/light_units.py):

- POINT: the power leaves evenly in all directions, so the radiant intensity is power / (4 pi). A lamp of radius r
  with Blender's "soft falloff" is a disk that turns to each receiver: irradiance on a facing surface is
  intensity / (d² + r²). Without it the lamp is a ball of constant radiance: intensity / d².
- SPOT: a point lamp whose intensity does not depend on the cone, times smoothstep((z - c) / ((1 - c) blend)) with c
  the cosine of half the cone and z the cosine against the axis, after the direction's x and y were divided by
  `spot_scale`.
- SUN: power is the irradiance on a facing surface; its angle spreads the same light over a cone of directions. One
  from the world brings its power from its axis alone: many of them together are the sum that stands for an integral.
- AREA: a Lambertian emitter on its -z side: radiosity = power / area, radiance = power / (pi area).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .form_factor import polygon_form_factor
from .scene import AREA, ELLIPSE, SPOT, SUN, Float64, Light

NARROW_CONE = 0.03
"""Sine of half a cone of directions below which float32 takes its base for a flat disk: 6e-5 of the sine at most."""
LEAST_BLEND = 1e-4
"""Of 1 - cosine of half a spot's cone: its edge is never sharper."""

LEAST_SPOT_SCALE = 1e-6
"""A spot's cone is never squashed further."""

# The same for float64: there the exact form has lost as much, 1e-7 of the sine.
_FLAT_CONE = 1e-3
_ELLIPSE_CELLS = 64
# Half the angle of a sun at most, radians: wider ones shine from half of all directions.
_WIDEST_SUN = math.radians(89.0)
_CELL_CORNERS = 8
# Steps of the bisection that inverts the radius of a lamp's ball: one for each bit of a float64.
_BISECTIONS = 53
_ORDERS_TRIED = 256
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_PLASTIC = 1.32471795724474602596
"""Real root of x³ = x + 1."""


@dataclass(frozen=True)
class LampSample:
    """One of several points that stand for a lamp: where it casts its shadows from.

    position: (3,) float64, m in world space; for a SUN the unit vector towards it. cell: (k, 2) float64, the part of
    an AREA lamp that the point stands for, m along x_axis and y_axis, counter-clockwise seen from its shining side;
    (0, 2) for other lamps. share: the cell's part of the lamp.
    """

    position: Float64
    cell: Float64
    share: float


def is_soft(light: Light) -> bool:
    """Whether different points of the lamp cast different shadows."""
    if light.kind == SUN:
        return light.angle > 0.0 and not light.from_world
    return light.kind == AREA or light.radius > 0.0


def area_of(light: Light) -> float:
    """Area of an AREA lamp, m²."""
    rectangle = light.size_x * light.size_y
    return rectangle * math.pi / 4.0 if light.shape == ELLIPSE else rectangle


def lamp_samples(light: Light, count: int, together: int = 1) -> tuple[LampSample, ...]:
    """`count` points that share the lamp evenly, or a single one for a lamp that casts hard shadows.

    together: how many consecutive ones are used in the same picture of a frame.
    """
    samples = _samples_in_rows(light, count)
    return samples if len(samples) == 1 else tuple(samples[i] for i in _order(count, together))


def lamp_hull(light: Light) -> Float64:
    """(k, 3) points that have every point of the lamp between them, m in world space; for a SUN directions towards it
    likewise, not unit."""
    axes = np.array([light.x_axis, light.y_axis, light.z_axis])
    signs = np.array(list(np.ndindex(2, 2, 2))) * 2.0 - 1.0
    if light.kind == SUN:
        half = math.tan(min(0.5 * light.angle, _WIDEST_SUN)) if is_soft(light) else 0.0
        return np.asarray((signs[::2] * (half, half, 0.0) + (0.0, 0.0, 1.0)) @ axes)
    half_size = (0.5 * light.size_x, 0.5 * light.size_y, 0.0) if light.kind == AREA else (light.radius,) * 3
    return np.asarray(np.array(light.position) + (signs * half_size) @ axes)


def _samples_in_rows(light: Light, count: int) -> tuple[LampSample, ...]:
    position = np.array(light.position)
    axes = np.array([light.x_axis, light.y_axis, light.z_axis])
    none = np.zeros((0, 2))
    if light.kind == AREA:
        return tuple(
            LampSample(position + point @ axes[:2], cell, 1.0 / count) for point, cell in _area_cells(light, count)
        )
    if not is_soft(light):
        return (LampSample(axes[2] if light.kind == SUN else position, none, 1.0),)
    if light.kind == SUN:
        directions = _cone_directions(0.5 * light.angle, count) @ axes
        return tuple(LampSample(direction, none, 1.0 / count) for direction in directions)
    return tuple(LampSample(position + offset, none, 1.0 / count) for offset in light.radius * _ball_points(count))


@lru_cache(maxsize=64)
def _order(count: int, together: int) -> tuple[int, ...]:
    """An order of `count` strata in which their places hang least on the picture that they are used in.

    The pictures of a frame look at different places in a pixel, by their index and its base 2 radical inverse; were
    the lamp's points tied to them, light that varies over the pixel would be weighted by where it comes from.
    """
    index = np.arange(count) // together
    if index[-1] < 2:
        return tuple(range(count))
    bits = np.arange(int(index[-1]).bit_length())
    inverse = ((index[:, None] >> bits) & 1) @ 0.5 ** (bits + 1)
    x, y, width, height = _strata(count)
    places = np.stack([x + 0.5 * width, y + 0.5 * height + 1e-9 * np.arange(count)])
    random = np.random.default_rng(count)

    def tie(order: np.ndarray) -> float:
        return float(np.abs(np.corrcoef(np.stack([*places[:, order], index, inverse]))[:2, 2:]).max())

    orders = [random.permutation(count) for _ in range(_ORDERS_TRIED)]
    return tuple(int(i) for i in min(orders, key=tie))


def _strata(count: int) -> tuple[Float64, Float64, Float64, Float64]:
    """Unit square in `count` equal boxes: (count,) lower x, lower y, width, height. Rows are of near square boxes."""
    rows = max(1, round(math.sqrt(count)))
    per_row = np.diff(np.linspace(0, count, rows + 1).round().astype(int))
    heights = per_row / count
    lower_y = np.concatenate([[0.0], np.cumsum(heights)[:-1]])
    lower_x = np.concatenate([np.arange(n) / n for n in per_row])
    return lower_x, np.repeat(lower_y, per_row), np.repeat(1.0 / per_row, per_row), np.repeat(heights, per_row)


def _stratified_square(count: int) -> Float64:
    """(count, 2) points in the unit square, one in each stratum."""
    x, y, width, height = _strata(count)
    # Within its box each point is elsewhere (Roberts' R2 sequence), so that edges along the lamp's axes do not band.
    within = (0.5 + np.arange(count)[:, None] / _PLASTIC ** np.array([1.0, 2.0])) % 1.0
    return np.stack([x + width * within[:, 0], y + height * within[:, 1]], axis=-1)


def _area_cells(light: Light, count: int) -> list[tuple[Float64, Float64]]:
    """(point, cell) of each sample, in m on the lamp's plane."""
    points = _stratified_square(count)
    half = np.array([0.5 * light.size_x, 0.5 * light.size_y])
    cells = []
    for (x, y), lower_x, lower_y, width, height in zip(points, *_strata(count), strict=True):
        corners = [(0.0, 0.0), (0.0, height), (width, height), (width, 0.0)]
        box = np.array([lower_x, lower_y]) + np.array(corners)
        point = np.array([x, y])
        if light.shape != ELLIPSE:
            cells.append(((2.0 * point - 1.0) * half, (2.0 * box - 1.0) * half))
            continue
        middle = 0.5 * (box + np.roll(box, -1, axis=0))
        outline = np.stack([box, middle], axis=1).reshape(_CELL_CORNERS, 2)
        on_disk = square_to_disk(2.0 * outline - 1.0)
        # Chords cut off area; growing the cell about its middle gives it back.
        middle_of_cell = on_disk.mean(axis=0)
        grow = math.sqrt((math.pi / count) / _polygon_area(on_disk))
        on_disk = middle_of_cell + grow * (on_disk - middle_of_cell)
        cells.append((square_to_disk((2.0 * point - 1.0)[None])[0] * half, on_disk * half))
    return cells


def _polygon_area(outline: Float64) -> float:
    x, y = outline.T
    return 0.5 * abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()))


def square_to_disk(points: Float64) -> Float64:
    """Area-preserving map (up to the factor pi / 4) of [-1, 1]² to the unit disk (Shirley and Chiu 1997)."""
    x, y = points[..., 0], points[..., 1]
    wide = np.abs(x) > np.abs(y)
    radius = np.where(wide, x, y)
    divisor = np.where(radius == 0.0, 1.0, radius)
    angle = np.where(wide, (np.pi / 4) * y / divisor, np.pi / 2 - (np.pi / 4) * x / divisor)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def _cone_directions(half_angle: float, count: int) -> Float64:
    """(count, 3) unit vectors evenly spread over the solid angle of a cone about +z."""
    disk = square_to_disk(2.0 * _stratified_square(count) - 1.0)
    one_minus_cosine = (disk**2).sum(-1) * (1.0 - math.cos(half_angle))
    sine_over_radius = np.sqrt((1.0 - math.cos(half_angle)) * (2.0 - one_minus_cosine))
    return np.concatenate([disk * sine_over_radius[:, None], (1.0 - one_minus_cosine)[:, None]], axis=1)


def _ball_points(count: int) -> Float64:
    """(count, 3) points in the unit ball whose projection onto any plane covers the unit disk evenly.

    Their density falls as 1 / sqrt(1 - r²), whose Abel transform is constant; with r = sin t its distribution
    function is (2 t - sin 2 t) / pi.
    """
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    azimuth = 2.0 * np.pi * _GOLDEN * index
    ring = np.sqrt(1.0 - z * z)
    directions = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=-1)
    share = (np.argsort(np.argsort((index / _PLASTIC) % 1.0)) + 0.5) / count
    low, high = np.zeros(count), np.full(count, np.pi / 2)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        below = (2.0 * middle - np.sin(2.0 * middle)) / np.pi < share
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return directions * np.sin(low)[:, None]


def spot_attenuation(light: Light, directions: Float64) -> Float64:
    """(n,) factor on a SPOT's intensity along unit `directions` (n, 3) that leave the lamp."""
    local = directions @ np.array([light.x_axis, light.y_axis, light.z_axis]).T
    local = local / np.array([*np.maximum(light.spot_scale, LEAST_SPOT_SCALE), 1.0])
    cosine = -local[:, 2] / np.maximum(np.linalg.norm(local, axis=1), 1e-300)
    cos_half = math.cos(0.5 * light.spot_angle)
    t = np.clip((cosine - cos_half) / max((1.0 - cos_half) * light.spot_blend, LEAST_BLEND), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def horizon_cosine(cosine: Float64, sine: Float64) -> Float64:
    """Mean of max(0, n·l) over an evenly bright cone of directions, seen flat: weights are their cosines to its axis.

    cosine: between n and the cone's axis. sine: of half the cone's angle, 0 to 1. Equals `cosine` while the whole
    cone is above the horizon (Snyder 1996).
    """
    cosine, sine = np.broadcast_arrays(np.asarray(cosine, np.float64), np.asarray(sine, np.float64))
    s = np.clip(sine, 1e-9, 1.0)
    c = np.clip(cosine, -s, s)
    normal_sine = np.sqrt(np.maximum(1.0 - c * c, 1e-300))
    x = np.sqrt(np.maximum(1.0 / (s * s) - 1.0, 0.0))
    y = np.clip(-x * c / normal_sine, -1.0, 1.0)
    chord = normal_sine * np.sqrt(np.maximum(1.0 - y * y, 0.0))
    exact = ((c * np.arccos(y) - x * chord) * s * s + np.arctan2(chord, x)) / (np.pi * s * s)
    # For narrow cones the terms above cancel; the cone's base is then a flat disk.
    t = c / s
    flat = s * (t * np.arccos(-t) + np.sqrt(np.maximum(1.0 - t * t, 0.0)) * (2.0 + t * t) / 3.0) / np.pi
    partly = np.maximum(np.where(s < _FLAT_CONE, flat, exact), 0.0)
    return np.where(cosine >= sine, cosine, np.where(cosine <= -sine, 0.0, partly))


def lamp_irradiance(light: Light, points: Float64, normals: Float64) -> Float64:
    """(n, 3) float64 irradiance in W/m² from all of `light` without occluders; 0 for the part below the horizon.

    points, normals: (n, 3), m in world space and unit. The cone of a SPOT is measured from its centre. An AREA lamp
    without area sends nothing, as in Cycles.
    """
    power = np.array(light.power, np.float64)
    if light.kind == AREA:
        if not area_of(light) > 0.0:
            return np.zeros((len(points), 3))
        factors = polygon_form_factor(points, normals, area_polygons(light)).sum(axis=1)
        return factors[:, None] * power / area_of(light)
    if light.kind == SUN:
        sine = 0.0 if light.from_world else math.sin(0.5 * light.angle)
        return horizon_cosine(normals @ np.array(light.z_axis), np.full(len(points), sine))[:, None] * power
    offsets = np.array(light.position) - points
    squared = np.maximum((offsets**2).sum(-1), 1e-300)
    directions = offsets / np.sqrt(squared)[:, None]
    radius_squared = light.radius * light.radius
    reach = squared + radius_squared if light.soft_falloff else np.maximum(squared, radius_squared)
    facing = horizon_cosine((directions * normals).sum(-1), light.radius / np.sqrt(reach)) / reach
    if light.kind == SPOT:
        facing = facing * spot_attenuation(light, -directions)
    return facing[:, None] * power / (4.0 * math.pi)


def area_polygons(light: Light) -> Float64:
    """(q, k, 3) polygons that make up an AREA lamp, counter-clockwise seen from its shining side; m, world space."""
    cells = lamp_samples(light, _ELLIPSE_CELLS if light.shape == ELLIPSE else 1)
    outlines = np.stack([sample.cell for sample in cells])
    return np.array(light.position) + outlines @ np.array([light.x_axis, light.y_axis])
