# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a value along a line steps where the line crosses the faces of a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vlm_addon.core.scene import Float64

SEAM_RATIO = 1.1
"""A step at a face that is so many times the largest step elsewhere is a seam."""


@dataclass(frozen=True)
class Steps:
    """Largest absolute differences of neighbouring samples: across faces, and within cells."""

    at_faces: float
    elsewhere: float

    @property
    def seam(self) -> bool:
        """Whether the faces show."""
        return self.at_faces > SEAM_RATIO * self.elsewhere


def steps_along(values: Float64, cells: np.ndarray) -> Steps:
    """values: (s,) at samples along a line. cells: (s, k) whole coordinates of the cell of each sample, or (s,) ids."""
    steps = np.abs(np.diff(values))
    crosses = (np.diff(np.reshape(cells, (len(values), -1)), axis=0) != 0).any(axis=1)
    if not crosses.any() or crosses.all():
        raise ValueError("the line has to cross faces, and to run within cells too")
    return Steps(float(steps[crosses].max()), float(steps[~crosses].max()))
