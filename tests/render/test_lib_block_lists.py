# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/block_lists.glsl` finds the cell, the block and the bit that core finds."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.block_lists import BlockLists
from vlm_addon.core.grid_frame import OUTSIDE, make_frame

PATH = "lib/block_lists.glsl"
BOX = ((-2.0, -2.0, -1.0), (2.0, 3.0, 1.0))


def place_of(cells, n):
    return np.stack((cells % n, cells // n % n, cells // n**2), axis=1)


@pytest.mark.parametrize("n", [1, 6, 17])
def test_cell_of(device, n):
    frame = make_frame(BOX, n)
    points = np.random.default_rng(0).uniform(-4.0, 4.0, (2000, 3))
    low, high = (str(tuple(map(float, frame.edges[:, end]))) for end in (0, -1))
    inputs = {"point": frame.local(points).astype(np.float32)}
    found = evaluate(device, PATH, f"vec3(cell_of(point, vec3{low}, vec3{high}, {n}u))", inputs, 3)
    cells = frame.cells(points)
    inside = cells != OUTSIDE
    assert 0.05 < inside.mean() < 0.95
    assert np.array_equal(found[inside], place_of(cells[inside], n))
    nearest = frame.cells(np.clip(points, *(frame.middle + frame.unit * frame.edges[:, end] for end in (0, -1))))
    assert np.array_equal(found, place_of(nearest, n))


@pytest.mark.parametrize("n", [1, 6, 17])
def test_block_of_and_has_cell(device, n):
    cells = np.arange(n**3)
    lists = BlockLists(n, np.zeros(1, np.uint32), np.zeros(0, np.uint32), np.zeros(0, np.uint64))
    blocks, bits = lists.places(cells)
    inputs = {"cell": place_of(cells, n).astype(np.float32), "bit": bits.astype(np.float32)}
    assert np.array_equal(evaluate(device, PATH, f"float(block_of(uvec3(cell), {n}u))", inputs), blocks)
    # The mask of one bit, and of all others.
    only = "uvec2(bit < 31.5 ? 1u << uint(bit) : 0u, bit > 31.5 ? 1u << (uint(bit) - 32u) : 0u)"
    assert (evaluate(device, PATH, f"float(has_cell({only}, uvec3(cell)))", inputs) == 1.0).all()
    assert (evaluate(device, PATH, f"float(has_cell(~{only}, uvec3(cell)))", inputs) == 0.0).all()
