# SPDX-License-Identifier: GPL-3.0-or-later
"""Stacked hemispheres of virtual point lights around a lamp, as pure geometry (seed 000, 3.3 and 4.1).

Rays leave the lamp at equal steps of angle, along meridians and around them; each carries one light for each shell.
The shells lie at distances whose gap to the farthest allowed one halves from shell to shell, and attenuation doubles.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .scene import Float64

QUARTER_TURN_DEGREES = 90.0
INNERMOST_ATTENUATION = 0.05
"""Share of its light that a light of the innermost shell loses (seed 000, eq. 4.2)."""
LEAST_COSINE = -0.5
"""Cosine to a light's normal below which it is dark: 240 degrees shine (seed 000, 3.3 and 4.2)."""


def ring_count(angle_degrees: float) -> int:
    """Rings of rays between the axis and the rim for steps of `angle_degrees`, to the nearest whole number.

    Raises InvalidInput unless the angle is above 0 and at most 90 degrees.
    """
    if not 0.0 < angle_degrees <= QUARTER_TURN_DEGREES:
        raise InvalidInput("angle between rays", f"{angle_degrees} degrees", "give more than 0 and at most 90")
    return max(1, round(QUARTER_TURN_DEGREES / angle_degrees))


def ray_count(angle_degrees: float) -> int:
    """Rays of a hemisphere: each ring has four times as many as there are rings, and one ray runs along the axis."""
    rings = ring_count(angle_degrees)
    return 4 * rings * rings + 1


def light_count(angle_degrees: float, shells: int) -> int:
    """Lights of all shells (seed 000, eq. 5.1)."""
    return shells * ray_count(angle_degrees)


def hemisphere_rays(angle_degrees: float) -> Float64:
    """(ray_count, 3) float64 unit directions around +z: the axis, then ring by ring outwards to the rim at z = 0.

    Along a ring they start at +x and turn towards +y. Seed 000, 4.1, whose rotation is meant with the old components.
    """
    rings = ring_count(angle_degrees)
    quarter = 0.5 * math.pi
    polar = np.repeat(quarter * np.arange(1, rings + 1) / rings, 4 * rings)
    azimuth = np.tile(quarter * np.arange(4 * rings) / rings, rings)
    ring = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    return np.concatenate([[[0.0, 0.0, 1.0]], ring])


def shell_distances(shells: int, max_distance: float) -> Float64:
    """(shells,) m from the lamp, the innermost first (seed 000, eq. 4.1)."""
    return max_distance * (1.0 - 0.5 ** np.arange(1, shells + 1))


def shell_attenuations(shells: int) -> Float64:
    """(shells,) share of its light that a light of each shell loses, the innermost first (seed 000, eq. 4.2).

    At most 1: from the sixth shell on the equation gives more, and light would be taken away.
    """
    return np.minimum(INNERMOST_ATTENUATION * 2.0 ** np.arange(shells), 1.0)


def emission_share(cosines: npt.ArrayLike) -> Float64:
    """What of its light a light sends in directions of these cosines to its normal, 0 to 1 (seed 000, 4.2)."""
    return np.clip((np.asarray(cosines, np.float64) - LEAST_COSINE) / (1.0 - LEAST_COSINE), 0.0, 1.0)


def integrated_shadow_count(maps: int, steps: int) -> int:
    """Shadows of all pairs of `maps` maps with `steps` steps in between (seed 000, eq. 4.6 and 4.8)."""
    return math.comb(maps, 2) * (steps + 2)


def shadow_map_bytes(width: int, height: int, scale: float, maps: int) -> int:
    """Bytes of `maps` shadow maps of one float a texel, `scale` times the screen's sides (seed 000, eq. 5.4 to 5.6)."""
    return 4 * maps * round(scale * width) * round(scale * height)
