# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones of cells and what touches what in blocks, against floods voxel by voxel."""

from __future__ import annotations

from collections import deque
from itertools import product

import numpy as np
import pytest

from vlm_addon.core.visibility_cells import CORNERS, SIDE, UNKNOWN, VisibilityCells, corner_bits, make_cells

STEPS = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]


def wall_with_door(resolution: int, x: int, door: slice | None = None) -> np.ndarray:
    """(v, 3) voxels of a wall across the cube at voxel x, without those of a door from y to y."""
    solid = np.zeros((resolution,) * 3, bool)
    solid[x] = True
    if door is not None:
        solid[x, door] = False
    return np.argwhere(solid)


def zone_of(cells: VisibilityCells, *place: float) -> int:
    return int(cells.zones_at(np.array([place]))[0])


def touch(cells: VisibilityCells, a: int, b: int, block: np.ndarray) -> bool:
    """Whether two zones have the same number in a block; they have to be in cells of it."""
    numbers = []
    for zone in (a, b):
        corner = block - cells.zone_cells()[zone]
        assert ((corner >= 0) & (corner <= 1)).all()
        numbers.append(cells.component[zone, corner @ np.array([1, 2, 4])])
    return bool(numbers[0] == numbers[1])


def test_a_wall_through_a_cell_makes_two_zones_of_it() -> None:
    cells = make_cells(wall_with_door(32, 11), 32)
    left, right = zone_of(cells, 9.5, 12.0, 12.0), zone_of(cells, 14.0, 12.0, 12.0)
    assert left != right
    assert zone_of(cells, 11.5, 12.0, 12.0) == UNKNOWN
    assert zone_of(cells, 8.5, 12.0, 12.0) == left
    for block in corner_bits(np.arange(CORNERS)) + cells.zone_cells()[left]:
        assert not touch(cells, left, right, block)


def test_a_wall_between_two_cells_parts_them() -> None:
    cells = make_cells(wall_with_door(32, 15), 32)
    left, right = zone_of(cells, 12.0, 12.0, 12.0), zone_of(cells, 20.0, 12.0, 12.0)
    block = cells.zone_cells()[right]
    assert not touch(cells, left, right, block)
    free = make_cells(np.zeros((0, 3), np.int64), 32)
    assert touch(free, zone_of(free, 12.0, 12.0, 12.0), zone_of(free, 20.0, 12.0, 12.0), block)


def test_sides_of_a_wall_touch_where_a_door_is_in_the_block_and_nowhere_else() -> None:
    cells = make_cells(wall_with_door(64, 19, slice(26, 30)), 64)
    left, right = zone_of(cells, 17.0, 17.0, 17.0), zone_of(cells, 22.0, 17.0, 17.0)
    at_door, away = cells.zone_cells()[left] + [1, 1, 1], cells.zone_cells()[left] + [1, 0, 1]
    assert left != right
    assert touch(cells, left, right, at_door)
    assert not touch(cells, left, right, away)


def flood(free: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """A number for each free cell: the same for those that are joined over faces and in one group."""
    numbers = np.full(free.shape, -1)
    for count, start in enumerate(map(tuple, np.argwhere(free))):
        if numbers[start] >= 0:
            continue
        numbers[start] = count
        queue = deque([start])
        while queue:
            here = queue.popleft()
            for step in STEPS:
                there = tuple(np.add(here, step))
                if min(there) < 0 or any(np.greater_equal(there, free.shape)):
                    continue
                if free[there] and numbers[there] < 0 and groups[there] == groups[here]:
                    numbers[there] = count
                    queue.append(there)
    return numbers


@pytest.mark.parametrize("seed", [0, 1])
def test_zones_and_blocks_are_those_of_a_flood(seed: int) -> None:
    """Random solids in 2 x 2 x 2 cells: half of the voxels, so that zones are ragged."""
    resolution = 2 * SIDE
    solid = np.random.default_rng(seed).random((resolution,) * 3) < 0.5
    cells = make_cells(np.argwhere(solid), resolution)
    places = np.indices(solid.shape).reshape(3, -1).T + 0.5
    found = cells.zones_at(places).reshape(solid.shape)
    groups = cells.cell_numbers(places.astype(int) // SIDE).reshape(solid.shape)
    zones = flood(~solid, groups)
    assert ((found == UNKNOWN) == solid).all()
    pairs = np.unique(np.stack([found[~solid], zones[~solid]]), axis=1)
    assert len(np.unique(pairs[0])) == len(np.unique(pairs[1])) == pairs.shape[1]
    # All eight cells have the block of their common corner.
    blocks = flood(~solid, np.zeros_like(zones))
    block = np.array([2, 2, 2])
    corners = block - cells.zone_cells()[found[~solid]]
    numbers = cells.component[found[~solid], corners @ np.array([1, 2, 4])]
    pairs = np.unique(np.stack([numbers, blocks[~solid]]), axis=1)
    assert len(np.unique(pairs[0])) == len(np.unique(pairs[1])) == pairs.shape[1]


def test_places_outside_belong_to_the_cells_around_the_voxels() -> None:
    cells = make_cells(wall_with_door(32, 11), 32)
    for place in product((-20.0, 50.0), repeat=3):
        assert zone_of(cells, *place) >= 0
    assert cells.block_count == 7**3


def test_a_cell_of_very_many_zones_joins_the_last_ones() -> None:
    """A chequered cell has 256 voxels that touch none of each other, one more than a byte can name."""
    x, y, z = np.indices((16,) * 3)
    cells = make_cells(np.argwhere((x + y + z) % 2 == 0), 16)
    assert np.diff(cells.first_zone).max() == 255
