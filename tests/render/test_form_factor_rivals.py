# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmark's samples are what they are called, and its rivals are as good as their papers say where it is easy."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.form_factor_classes import CLASSES, EXACTLY_ZERO, FAR, WITHOUT_ORACLE
from benchmarks.form_factor_errors import measure_errors
from benchmarks.form_factor_timing import room
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.render.device import Device

COUNT = 2000


@pytest.mark.parametrize("name", list(CLASSES))
def test_samples_are_float32_numbers_with_unit_normals(name: str) -> None:
    points, normals, triangles = CLASSES[name](np.random.default_rng(1), COUNT)
    assert [array.shape for array in (points, normals, triangles)] == [(COUNT, 3), (COUNT, 3), (COUNT, 3, 3)]
    for array in (points, normals, triangles):
        np.testing.assert_array_equal(array, array.astype(np.float32).astype(np.float64))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=0.0, atol=2e-7)


@pytest.mark.parametrize("name", [name for name in CLASSES if name not in WITHOUT_ORACLE])
def test_only_the_classes_of_zeros_are_all_zero(name: str) -> None:
    values = paired_form_factor(*CLASSES[name](np.random.default_rng(1), COUNT))
    assert (not values.any()) == (name in EXACTLY_ZERO)


def test_a_class_of_the_lists_exists() -> None:
    assert {*EXACTLY_ZERO, *FAR, *WITHOUT_ORACLE} <= set(CLASSES)


def test_rivals_are_good_at_two_to_four_sizes(device: Device) -> None:
    """Near enough for no cancellation, not near enough for an edge to fill the view: what they were made for."""
    errors = measure_errors(device, "d/s 2 to 4", COUNT)
    limits = {"rational fit": 1e-6, "printed formula": 1e-3, "clipless sphere": 0.02}
    for name, limit in limits.items():
        assert 0.0 < errors[name].percentile_99 < limit, name


def test_a_third_of_the_timed_pairs_is_cut_by_the_horizon() -> None:
    workload = room(np.random.default_rng(1), tiles=8)
    assert 0.25 < workload.clipped < 0.45
    assert workload.hidden < 0.5
