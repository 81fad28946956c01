# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/z_order.glsl` against core's order of nodes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.voxel_octree import codes_of

PATH = "lib/z_order.glsl"


@pytest.fixture(scope="module")
def cells():
    cells = np.random.default_rng(0).integers(0, 1024, (2000, 3))
    cells[0], cells[1] = 0, 1023
    cells[2:5] = 1023 * np.eye(3)
    return cells


def word(device, expression, inputs):
    """The 32 bits of an expression: in halves, which float32 holds."""
    low, high = (evaluate(device, PATH, f"float({expression} >> {shift}u & 0xFFFFu)", inputs) for shift in (0, 16))
    return low.astype(np.int64) | high.astype(np.int64) << 16


def test_codes(device, cells):
    inputs = {"cell": cells.astype(np.float32)}
    assert np.array_equal(word(device, "z_order(uvec3(cell))", inputs), codes_of(cells))


def test_bits_are_spread_and_gathered(device, cells):
    numbers = cells[:, 0]
    spread = codes_of(np.stack([numbers, 0 * numbers, 0 * numbers], axis=1))
    assert np.array_equal(word(device, "every_third_bit(uint(x))", {"x": numbers.astype(np.float32)}), spread)
    # Bits in between do not count.
    codes = codes_of(cells).astype(np.int32)
    assert np.array_equal(word(device, "gathered_bits(uint(code))", {"code": codes}), numbers)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_cells_of_codes(device, cells, axis):
    codes = codes_of(cells).astype(np.int32)
    assert np.array_equal(word(device, f"cell_at(uint(code))[{axis}]", {"code": codes}), cells[:, axis])
