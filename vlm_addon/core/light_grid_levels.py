# SPDX-License-Identifier: GPL-3.0-or-later
"""How full a light grid's structures are, level by level, as JSON-able values."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .light_tree import LightTree
from .range_grid import RangeGrid


def grid_levels(grid: RangeGrid) -> list[dict[str, Any]]:
    """Its cells, with what did not fit, and its blocks of cells."""
    occupancy = grid.occupancy
    cut = {
        "overflowing": len(occupancy.overflowing_cells),
        "dropped_entries": occupancy.dropped_entries,
        "dropped_lights": len(occupancy.dropped_lights),
    }
    cells = _level("cells", grid.lists.cell_counts())
    return [cells | cut, _level("blocks", grid.lists.block_counts)]


def tree_levels(tree: LightTree) -> list[dict[str, Any]]:
    """Its levels, finest first."""
    inside = np.diff(tree.light_offsets) + np.diff(tree.child_offsets)
    return [_level(f"level {level}", inside[tree.level == level]) for level in np.unique(tree.level)]


def _level(name: str, counts: npt.NDArray[Any]) -> dict[str, Any]:
    entries, places = int(counts.sum(dtype=np.int64)), len(counts)
    return {
        "name": name,
        "places": places,
        "entries": entries,
        "mean": entries / places,
        "fullest": int(counts.max(initial=0)),
    }
