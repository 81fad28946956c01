# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/form_factor.glsl` against the float64 oracle, on the same float32 numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from benchmarks.form_factor_classes import CLASSES
from tests.form_factor_cases import FLOAT32_ABSOLUTE, HARD_CASES, float32_bound, summed, summed_bound, unit
from tests.render.form_factor_shader import PI, Array, oracle, random_case, shader
from vlm_addon.render.device import Device

CLASS_COUNT, CAMPAIGN_COUNT, CAMPAIGN_ROWS = 10_000, 1_000_000, 200_000

# --- named cases ------------------------------------------------------------------------------------------------------


# Where the edge passes at a float32 unit of the corners' distance, rounding of the offsets decides.
AT_ROUNDING = {"2^-23 from the hypotenuse"}


@pytest.mark.parametrize("name", HARD_CASES)
def test_hard_case(device: Device, name: str) -> None:
    case = HARD_CASES[name]
    value = summed(case, lambda *pairs: shader(device, *pairs))
    if case.limit == 0.0:
        assert value == 0.0
    else:
        bound = summed_bound(case) if name in AT_ROUNDING else FLOAT32_ABSOLUTE
        assert value == pytest.approx(case.exact(), abs=bound)


# --- classes of adversarial samples -----------------------------------------------------------------------------------


def absolute(bound: float) -> Callable[..., Array]:
    return lambda points, normals, triangles, exact: np.full(len(points), bound)


def conditioned(points: Array, normals: Array, triangles: Array, exact: Array) -> Array:
    """What float32 can hold near edges."""
    return float32_bound(points, normals, triangles)


def far(points: Array, normals: Array, triangles: Array, exact: Array) -> Array:
    """1e-4 relative, and 2^-21 of the triangle squarely seen: heights over grazing horizons are rounded."""
    areas = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    squared = ((triangles.mean(axis=1) - points) ** 2).sum(axis=1)
    return 1e-4 * exact + 2.0**-21 * areas / (PI * squared)


def nothing(points: Array, normals: Array, triangles: Array, exact: Array) -> Array:
    assert not exact.any()
    return np.zeros(len(points))


BOUNDS: dict[str, Callable[..., Array]] = {
    "d/s 1 to 100": absolute(FLOAT32_ABSOLUTE),
    "d/s 2 to 4": absolute(FLOAT32_ABSOLUTE),
    "d/s 300": far,
    "d/s 100 to 1e6": far,
    "interior, h 1e-30 to 1": absolute(5e-6),
    "interior, h 1e-6 to 1e-3": absolute(5e-6),
    "1e-7 to 1e-3 from an edge": conditioned,
    "on a corner or an edge's line": nothing,
    "grazing the horizon": absolute(FLOAT32_ABSOLUTE),
    "in the plane": nothing,
    "behind": nothing,
    "under the horizon": nothing,
    "slivers 1e-7 to 1e-1": conditioned,
    "no area": nothing,
    "huge, 1e4 m": absolute(FLOAT32_ABSOLUTE),
    "tiny, 1e-4 m": far,
    "moved by 1e2 to 1e4 m": absolute(FLOAT32_ABSOLUTE),
}
# Where coordinates differ by 38 powers of ten, float32 loses all but the range of the result.
RANGE_ONLY = "0, 1, 1e-20, 1e18 anywhere"


def test_every_class_has_a_bound() -> None:
    assert set(CLASSES) == {*BOUNDS, RANGE_ONLY}


@pytest.mark.parametrize("name", CLASSES)
def test_class_of_samples(device: Device, name: str) -> None:
    samples = CLASSES[name](np.random.default_rng(11), CLASS_COUNT)
    values = shader(device, *samples)
    assert np.isfinite(values).all()
    assert ((values >= 0.0) & (values <= 1.0)).all()
    if name != RANGE_ONLY:
        exact = oracle(*samples)
        over = np.abs(values - exact) - BOUNDS[name](*samples, exact)
        worst = int(over.argmax())
        assert over[worst] <= 0.0, [array[worst] for array in (values, exact, *samples)]


@pytest.mark.full
@pytest.mark.parametrize("name", CLASSES)
def test_million_samples_of_a_class(device: Device, name: str) -> None:
    """Finite and within [0, 1] in every one, and exactly 0 where it is 0."""
    random = np.random.default_rng(12)
    for _ in range(CAMPAIGN_COUNT // CAMPAIGN_ROWS):
        values = shader(device, *CLASSES[name](random, CAMPAIGN_ROWS))
        assert np.isfinite(values).all()
        assert ((values >= 0.0) & (values <= 1.0)).all()
        if BOUNDS.get(name) is nothing:
            assert not values.any()


FARTHEST = float(np.float32(1e18))


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=arrays(
        np.float32, (64, 15), elements=st.floats(-FARTHEST, FARTHEST, width=32), fill=st.floats(-2.0, 2.0, width=32)
    )
)
def test_any_numbers_give_a_share(device: Device, rows: Array) -> None:
    points, directions, triangles = rows[:, :3], rows[:, 3:6].astype(np.float64), rows[:, 6:].reshape(-1, 3, 3)
    directions[~directions.any(axis=1)] = (0.0, 0.0, 1.0)
    values = shader(device, points, unit(directions), triangles)
    assert ((values >= 0.0) & (values <= 1.0)).all()


@pytest.mark.parametrize("distance", [0.1, 1.0, 4.0, 14.0, 18.0, 33.0, 100.0])
def test_random_triangles(device: Device, distance: float) -> None:
    case = random_case(distance)
    np.testing.assert_allclose(shader(device, *case), oracle(*case), rtol=0.0, atol=FLOAT32_ABSOLUTE)
