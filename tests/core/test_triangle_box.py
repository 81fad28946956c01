# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangle against cube: rational clipping as oracle, so that touching is decided without rounding."""

from fractions import Fraction

import numpy as np
import pytest

from vlm_addon.core.triangle_box import triangles_meet_cubes


def clipped(polygon, axis, bound, sign):
    """What of a polygon of Fractions is on the side sign * x[axis] <= sign * bound, closed."""
    kept = []
    for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        da, db = sign * (a[axis] - bound), sign * (b[axis] - bound)
        if da <= 0:
            kept.append(a)
        if da * db < 0:
            share = Fraction(da, da - db)
            kept.append(tuple(p + share * (q - p) for p, q in zip(a, b, strict=True)))
    return kept


def meets_exactly(triangle, centre, half):
    polygon = [tuple(Fraction(x) for x in corner) for corner in triangle.tolist()]
    for axis in range(3):
        for sign in (1, -1):
            if polygon:
                polygon = clipped(polygon, axis, Fraction(centre[axis]) + sign * Fraction(half), sign)
    return bool(polygon)


@pytest.mark.parametrize("spread", [1, 4])
def test_lattice_triangles_are_decided_as_rational_clipping_decides(spread):
    """Corners, edges and planes that touch the cube are common among small integers, and float64 is exact there."""
    rng = np.random.default_rng(spread)
    triangles = rng.integers(-2 * spread, 2 * spread + 1, (1500, 3, 3)).astype(float)
    triangles[::10, 2] = triangles[::10, 1]
    triangles[1::50] = triangles[1::50, :1]
    centres = rng.integers(-1, 2, (1500, 3)).astype(float)
    found = triangles_meet_cubes(triangles, centres, float(spread))
    expected = [meets_exactly(t, c, spread) for t, c in zip(triangles, centres.tolist(), strict=True)]
    assert found.tolist() == expected
    assert 0.2 < found.mean() < 0.98


def test_general_triangles():
    rng = np.random.default_rng(0)
    triangles = rng.normal(size=(1500, 3, 3)) * 2.0 ** rng.uniform(-3, 3, (1500, 1, 1)) + rng.normal(size=(1500, 1, 3))
    centres = np.zeros((1500, 3))
    found = triangles_meet_cubes(triangles, centres, 0.5)
    expected = [meets_exactly(t, (0, 0, 0), Fraction(1, 2)) for t in triangles]
    assert found.tolist() == expected
    assert 0.1 < found.mean() < 0.9
