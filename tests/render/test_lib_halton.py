# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/halton.glsl` against the oracle in core, below 1 whatever is rounded."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core import halton
from vlm_addon.render.device import Device

FILE = "lib/halton.glsl"


@pytest.mark.parametrize("base", [2, 3, 5, 7, 11, 13])
def test_mirrored_digits_are_those_of_the_oracle(device: Device, base: int) -> None:
    numbers = np.concatenate([np.arange(5000), [2**20 - 1, 2**20, 10**6, base**5 - 1, base**5]]).astype(np.int32)
    found = evaluate(device, FILE, f"radical_inverse(uint(number), {base}u)", {"number": numbers})
    np.testing.assert_allclose(found, halton.radical_inverse(numbers, base), rtol=2e-7)
    assert found.max() < 1.0


@pytest.mark.parametrize(("number", "base"), [(2**31 - 1, 2), (3**20 - 1, 3), (5**13 - 1, 5), (13**8 - 1, 13)])
def test_all_highest_digits_stay_below_1(device: Device, number: int, base: int) -> None:
    found = evaluate(device, FILE, f"radical_inverse({number}u, {base}u)", {"x": np.zeros(1)})
    assert found[0] == np.float32(1.0 - 2.0**-24)


def test_a_rotated_coordinate_goes_around(device: Device) -> None:
    random = np.random.default_rng(4)
    below_1 = np.float32(1.0 - 2.0**-24)
    edges = np.array([0.0, 1e-30, 0.5, below_1], np.float32)
    coordinate = np.concatenate([random.random(500, np.float32), np.repeat(edges, 4)])
    shift = np.concatenate([random.random(500, np.float32), np.tile(edges, 4)])
    found = evaluate(device, FILE, "rotated(coordinate, shift)", {"coordinate": coordinate, "shift": shift})
    assert ((found >= 0.0) & (found < 1.0)).all()
    expected = (coordinate.astype(float) + shift) % 1.0
    # On the circle: what rounds up to 1 is at 0.
    away = np.abs(found - expected)
    assert np.minimum(away, 1.0 - away).max() < 2e-7
