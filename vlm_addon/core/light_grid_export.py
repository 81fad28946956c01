# SPDX-License-Identifier: GPL-3.0-or-later
"""The lists of a light grid's cells as the thesis lays them out (seed 002, 4.1), in a file that other programs read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .light_grid import LightGrid
from .range_grid import RangeGrid
from .whole_file import atomic_output

SUFFIX = ".npz"


def save_fixed_size_lists(grid: LightGrid, path: Path | str) -> None:
    """Writes `fixed_size_arrays` as numpy's .npz. Raises InvalidInput as that, and where nothing can be written."""
    arrays = fixed_size_arrays(grid)
    with atomic_output(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, **arrays)


def fixed_size_arrays(grid: LightGrid) -> dict[str, npt.NDArray[Any]]:
    """Arrays by name, for each KIND of lights there is (static, dynamic).

    KIND_lists: (cells, k) uint32, rows of the light mesh; cells count along x first, then y, then z. KIND_faces:
    (3, n + 1) float64, m, where cells begin and end along each axis. empty: () uint32, what empty slots hold: one past
    the last light, so that whoever uploads the lights appends one that emits nothing. Raises InvalidInput in tolerance
    mode, which has no cells, and for lists that are too large.
    """
    arrays: dict[str, npt.NDArray[Any]] = {"empty": np.array(grid.light_count, np.uint32)}
    for kind, part in grid.structures:
        if not isinstance(part, RangeGrid):
            remedy = "bake it with a range, or write it as .vlmgrid"
            raise InvalidInput("lists of one size", "the light grid has a tolerance and no cells", remedy)
        arrays[f"{kind}_lists"] = part.fixed_size_lists()
        arrays[f"{kind}_faces"] = part.frame.middle[:, None] + part.frame.unit * part.frame.edges.astype(np.float64)
    return arrays
