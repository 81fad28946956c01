# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual lights of the hard cases, drawn by hand: as small, thin, mirrored and touching as the surfaces themselves.

Flat lights lie exactly in the plane of what they stand for and meet their neighbours edge to edge; those of curved
bodies are coarse versions of them. Thin bodies share a tag with their lights.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from . import blend
from .blend import LightPatch, Rgb
from .shapes import Shape, area_m2, box, flipped, join, octahedron, patch, scaled, shape

CLOTH_TAG, HALF_PIPE_TAG, BOWL_TAG = 1, 2, 3
# Of half the innermost square of the floor, m; each ring is twice as large as the one inside.
FLOOR_INNERMOST = 1.0
# Of a ball's light over the ball, so that its corners stay inside.
BALL_SCALE = 0.95


def without_bottom(source: Shape) -> Shape:
    """A box without the face that stands on the floor."""
    return shape(source.vertices, source.faces[1:])


def nested_squares(innermost: float, outermost: float) -> Shape:
    """A horizontal square as a square of half the size `innermost` and rings of twelve, each twice the one inside."""
    parts = [patch((-innermost, -innermost, 0), (2 * innermost, 0, 0), (0, 2 * innermost, 0))]
    half = innermost
    while half < outermost:
        parts += [
            patch((i * half, j * half, 0), (half, 0, 0), (0, half, 0))
            for i in range(-2, 2)
            for j in range(-2, 2)
            if not (i in (-1, 0) and j in (-1, 0))
        ]
        half *= 2
    return join(parts)


def whole(lights: Shape, surface: Shape, color: Rgb, tag: int = 0) -> LightPatch:
    """Lights that send out as much as all of the surface does, however coarse they are."""
    return LightPatch(lights, color, tag, area_m2(surface) / area_m2(lights))


def ball_lights(centre: Sequence[float], radius: float) -> Shape:
    """Eight lights inside a ball."""
    inner = scaled(octahedron(radius), BALL_SCALE)
    return shape(inner.vertices + centre, inner.faces)


def both_sides(sheet: Shape) -> Shape:
    """A sheet of lights and the same facing the other way, in one plane."""
    return join([sheet, flipped(sheet)])


def corner_lights(arms: Sequence[tuple[Sequence[float], Sequence[float]]]) -> Shape:
    """Every face but the bottoms of boxes given by their lower and upper corners."""
    return join([without_bottom(box(lower, upper)) for lower, upper in arms])


def add_lights(scene: Any, name: str, location: Sequence[float], patches: Sequence[LightPatch]) -> Any:
    """A light mesh object with its origin at `location`."""
    added = blend.add_light_mesh(scene, f"{name} lights", patches)
    added.location = location
    return added
