# SPDX-License-Identifier: GPL-3.0-or-later
"""Openness next to a wall, in closed form."""

import numpy as np


def open_beside_wall(share):
    """Where a large wall stands at `share` (one or many) of the radius, upright on the surface.

    The wall takes all directions that reach it within the radius. Over the unit disc under the half ball of directions,
    in which equal areas weigh the same, they are the segment beyond a chord at `share` from the middle.
    """
    share = np.minimum(share, 1.0)
    return 1.0 - (np.arccos(share) - share * np.sqrt(1.0 - share**2)) / np.pi
