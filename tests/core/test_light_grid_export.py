# SPDX-License-Identifier: GPL-3.0-or-later
"""The thesis's lists in a file: what another program reads is what the grid answers."""

from dataclasses import replace

import numpy as np
import pytest

from tests.light_meshes import random_lights
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_grid import RANGE, GridSettings, LightGrid
from vlm_addon.core.light_grid_export import save_fixed_size_lists

BOX = ((-2.0, -2.0, -1.0), (2.0, 3.0, 1.0))


@pytest.mark.parametrize(("moving", "kinds"), [(0, ["static"]), (12, ["static", "dynamic"]), (40, ["dynamic"])])
def test_another_program_finds_the_candidates_of_every_point(moving, kinds, tmp_path):
    lights = replace(random_lights(4, 40), dynamic=np.arange(40) < moving)
    grid = LightGrid.bake(lights, BOX, GridSettings(mode=RANGE, grid=5, range=2.0, max_lights=6))
    save_fixed_size_lists(grid, tmp_path / "lists.npz")
    points = np.random.default_rng(1).uniform(*BOX, (100, 3))
    found = [[] for _ in points]
    with np.load(tmp_path / "lists.npz") as read:
        assert sorted(read) == sorted(["empty", *(f"{kind}_{name}" for kind in kinds for name in ("lists", "faces"))])
        for kind in kinds:
            x, y, z = (np.searchsorted(faces, points[:, axis]) - 1 for axis, faces in enumerate(read[f"{kind}_faces"]))
            rows = read[f"{kind}_lists"][x + 5 * (y + 5 * z)]
            assert rows.shape == (100, 6)
            for lights_of_point, row in zip(found, rows, strict=True):
                lights_of_point += row[row != read["empty"]].tolist()
    asked = grid.candidates(points)
    assert len(asked.light_ids)
    for point, ids in enumerate(found):
        own = asked.light_ids[asked.light_offsets[point] : asked.light_offsets[point + 1]]
        assert sorted(ids) == own.tolist()


def test_without_cells_there_is_nothing_to_write(tmp_path):
    grid = LightGrid.bake(random_lights(4), BOX, GridSettings(tolerance=0.1))
    with pytest.raises(InvalidInput, match="no cells; bake it with a range"):
        save_fixed_size_lists(grid, tmp_path / "lists.npz")
    assert [*tmp_path.iterdir()] == []
