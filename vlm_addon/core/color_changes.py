# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists do to the colours of lights, as functions on arrays (seed 002, 3.5: hue and strength of the bounce).

Colours are (n, 3) float64, linear, in any space of three primaries, non-negative and of any size. A colour change is a
function of the colours and of the middles of the lights, (n, 3) m in world space.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .errors import InvalidInput
from .scene import Float64

ColorChange = Callable[[Float64, Float64], Float64]

SIXTH = 1.0 / 6.0
LEAST_EXTENT = 1e-4
"""Of how far lights lie apart: along a direction in which they extend for less, only placement parts them."""
LARGEST = float(np.finfo(np.float32).max)
"""The largest value that a face attribute holds."""


def require_colors(colors: Float64, subject: str) -> None:
    """Raises InvalidInput where a colour is negative, not finite or too large to be stored."""
    wrong = ~((colors >= 0.0) & (colors <= LARGEST)).all(axis=-1)
    if wrong.any():
        row = int(np.argmax(wrong))
        found = tuple(float(value) for value in colors[row])
        remedy = f"use values from 0 to {LARGEST:.2g}; Fill gives lights a color whatever they had"
        raise InvalidInput(subject, f"light {row} would be {found}", remedy)


def fill(color: Sequence[float]) -> ColorChange:
    """All lights of one colour."""
    return lambda colors, middles: np.tile(np.asarray(color, np.float64), (len(colors), 1))


def multiply(factor: Sequence[float]) -> ColorChange:
    """Each channel times its factor."""
    return lambda colors, middles: colors * np.asarray(factor, np.float64)


def shift_hue(turn: float, saturation: float) -> ColorChange:
    """Hue turned by `turn` radians round the circle of hues, saturation times `saturation` (at most 1 comes out).

    The mean of the three channels stays, so a light sends out as much as before. Grey and black stay.
    """

    def change(colors: Float64, middles: Float64) -> Float64:
        hues, saturations = hue_and_saturation(colors)
        turned = from_hue(hues + turn / (2.0 * np.pi), np.clip(saturations * saturation, 0.0, 1.0))
        return turned * (colors.mean(axis=1) / turned.mean(axis=1))[:, None]

    return change


def hue_and_saturation(colors: Float64) -> tuple[Float64, Float64]:
    """(n,) hue in [0, 1): 0 red, 1/3 green, 2/3 blue; (n,) saturation: 1 - smallest / largest channel, 0 for black."""
    largest, smallest = colors.max(axis=1), colors.min(axis=1)
    span = largest - smallest
    divisor = np.where(span > 0.0, span, 1.0)
    red, green, blue = colors.T
    leading = colors.argmax(axis=1)
    sector = np.choose(leading, [(green - blue) / divisor, 2.0 + (blue - red) / divisor, 4.0 + (red - green) / divisor])
    saturations = np.divide(span, largest, out=np.zeros_like(span), where=largest > 0.0)
    return (sector * SIXTH) % 1.0, saturations


def from_hue(hues: Float64, saturations: Float64) -> Float64:
    """(n, 3) colours of the given hues (any number of turns) and saturations whose largest channel is 1."""
    offsets = np.array([5.0, 3.0, 1.0])
    places = (offsets + 6.0 * hues[:, None]) % 6.0
    return 1.0 - saturations[:, None] * np.clip(np.minimum(places, 4.0 - places), 0.0, 1.0)


def gradient(
    start: Sequence[float], end: Sequence[float], first: Sequence[float], last: Sequence[float]
) -> ColorChange:
    """From the colour `first` at the point `start` to `last` at `end`, linear between and constant beyond them.

    start, end: m, world space. Raises InvalidInput where they are the same point.
    """
    origin, way = np.asarray(start, np.float64), np.asarray(end, np.float64) - np.asarray(start, np.float64)
    length_squared = float(way @ way)
    if not 0.0 < length_squared < np.inf:
        raise InvalidInput("gradient", f"it runs from {tuple(start)} to {tuple(end)}", "give two different points")
    one, other = np.asarray(first, np.float64), np.asarray(last, np.float64)

    def change(colors: Float64, middles: Float64) -> Float64:
        share = np.clip((middles - origin) @ way / length_squared, 0.0, 1.0)[:, None]
        return one + share * (other - one)

    return change


def extent_along(middles: Float64, direction: Sequence[float]) -> tuple[Float64, Float64]:
    """Two points, (3,) m each, between which all `middles` lie along `direction`.

    Raises InvalidInput where the direction is none or all lie at the same place along it.
    """
    way = np.asarray(direction, np.float64)
    length = float(np.linalg.norm(way))
    if not 0.0 < length < np.inf:
        raise InvalidInput("gradient", f"its direction is {tuple(direction)}", "give one that is not zero")
    way = way / length
    places = middles @ way
    spans = np.ptp(middles, axis=0)
    if not np.ptp(places) > LEAST_EXTENT * np.linalg.norm(spans):
        remedy = "choose another one"
        if spans.max() > 0.0:
            remedy += f", such as {'XYZ'[int(spans.argmax())]}, along which they extend for {spans.max():.3g} m"
        raise InvalidInput("gradient", "all lights lie at the same place along its direction", remedy)
    return places.min() * way, places.max() * way


def over(color: ColorChange) -> ColorChange:
    """The colours that there are, times those of `color`."""
    return lambda colors, middles: colors * color(colors, middles)
