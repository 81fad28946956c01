# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np

from vlm_addon.core.morton import BITS_PER_AXIS, morton_codes, spread_bits


def test_every_third_bit_is_that_of_the_number():
    values = np.append(np.random.default_rng(0).integers(0, 1 << 21, 200), [0, 1, (1 << 21) - 1])
    expected = [int(f"{value:b}".replace("0", "000").replace("1", "001"), 2) for value in values.tolist()]
    assert spread_bits(values).tolist() == expected


def test_codes_follow_the_curve():
    """x decides first, then y, then z; then the same within the half that was chosen."""
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    codes = morton_codes(corners)
    assert (np.diff(codes) > 0).all()
    assert codes.tolist() == [place * ((1 << 3 * BITS_PER_AXIS) - 1) // 7 for place in range(8)]
    assert morton_codes(np.zeros((0, 3))).shape == (0,)
