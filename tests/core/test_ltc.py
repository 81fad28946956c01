# SPDX-License-Identifier: GPL-3.0-or-later
"""Linearly transformed cosines: the shape of the fit, and the table that ships against GGX."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.fit_ltc import fit, fitted_lobe, ggx_lobe, lobe_points
from vlm_addon.core import ltc
from vlm_addon.core.errors import VlmError
from vlm_addon.core.scene import Float64

PARAMETERS = np.array([-0.3, 1.7, 1.4, -0.5])


def sphere(count: int) -> Float64:
    """Directions as even as a spiral can be."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(count)
    side = np.sqrt(1.0 - height * height)
    return np.stack([side * np.cos(turn), side * np.sin(turn), height], axis=1)


@pytest.mark.parametrize("cos_view", [1.0, 0.6, 0.1])
def test_a_fitted_lobe_is_whole_above_the_surface_and_nothing_below(cos_view: float) -> None:
    directions = sphere(200_000)
    to_lobe = ltc.lobe_map(PARAMETERS, 0.3, cos_view)
    density = ltc.lobe_density(to_lobe, directions)
    assert (density[directions[:, 2] < 0.0] == 0.0).all()
    assert density.mean() * 4.0 * np.pi == pytest.approx(1.0, rel=2e-3)


@pytest.mark.parametrize("cos_view", [1.0, 0.6, 0.1])
def test_what_is_above_the_surface_is_the_share_of_cosine_directions_that_land_there(cos_view: float) -> None:
    to_lobe = ltc.lobe_map(PARAMETERS, 0.8, cos_view)
    upper = sphere(400_000)
    upper = upper[upper[:, 2] > 0.0]
    landed = np.linalg.solve(to_lobe, upper.T)[2] > 0.0
    assert ltc.upper_share(to_lobe) == pytest.approx((upper[:, 2] * landed).sum() / upper[:, 2].sum(), abs=2e-3)


def test_the_axis_without_lean_is_the_mirror_direction() -> None:
    to_lobe = ltc.lobe_map(np.array([0.0, 2.0, 1.5, 0.0]), 0.05, 0.6)
    mapped = to_lobe @ [-0.8, 0.0, 0.6]
    assert mapped == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


def test_coordinates_of_views_there_and_back() -> None:
    cosines = np.array([1.0, 0.7, 0.2, ltc.LEAST_COSINE])
    assert ltc.view_cosine(ltc.view_coordinate(cosines)) == pytest.approx(cosines)
    assert ltc.view_coordinate([1.0, ltc.LEAST_COSINE, 0.0, -1.0]) == pytest.approx([0.0, 1.0, 1.0, 1.0])


def test_the_table_is_read_at_its_own_entries_and_between_them() -> None:
    table = ltc.ltc_table().astype(float)
    steps = np.linspace(0.0, 1.0, ltc.TABLE_SIZE)
    found = ltc.lookup_ltc(steps[:, None], ltc.view_cosine(steps))
    assert found == pytest.approx(table, abs=1e-6)
    between = ltc.lookup_ltc(0.5 * (steps[4] + steps[5]), ltc.view_cosine(steps[7]))
    assert between == pytest.approx(0.5 * (table[4, 7] + table[5, 7]), abs=1e-9)


# By cosine of the eye; one transformed cosine comes no nearer: towards the horizon GGX is no longer of its shape.
VARIATIONS = {0.9: 0.04, 0.5: 0.09, 0.2: 0.18}


@pytest.mark.parametrize("cos_view", VARIATIONS)
@pytest.mark.parametrize("roughness", [0.05, 0.13, 0.3, 0.42, 0.68, 1.0])
def test_the_table_is_near_ggx_between_its_entries_too(roughness: float, cos_view: float) -> None:
    """Half the integral of what is off, over the integral of the lobe."""
    points = lobe_points(roughness, cos_view)
    off = np.abs(points.lobe - fitted_lobe(points, ltc.lookup_ltc(roughness, cos_view)))
    assert 0.5 * off @ points.solid_angles < VARIATIONS[cos_view] * points.albedo


@pytest.mark.parametrize(("row", "column"), [(6, 10), (16, 0), (16, 20), (31, 28)])
def test_no_fit_that_begins_at_an_entry_gets_better(row: int, column: int) -> None:
    """That the table is what the script makes, without making all of it."""
    cos_view = float(ltc.view_cosine(column / (ltc.TABLE_SIZE - 1)))
    points = lobe_points(row / (ltc.TABLE_SIZE - 1), cos_view)
    entry = ltc.ltc_table()[row, column].astype(float)
    again = fit(points, entry)
    assert again.parameters == pytest.approx(entry, abs=3e-3)


def test_points_of_a_lobe_integrate_it() -> None:
    """GGX without Fresnel at roughness 0.5 against an even sum over the hemisphere."""
    directions = sphere(400_000)
    directions = directions[directions[:, 2] > 0.0]
    expected = ggx_lobe(directions, 0.6, 0.25).sum() * 4.0 * np.pi / 400_000
    assert lobe_points(0.5, 0.6).albedo == pytest.approx(expected, rel=3e-3)


def test_a_table_that_is_none_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ltc.ltc_table.cache_clear()
    for content in (None, b"no table", "short"):
        path = tmp_path / "ltc_ggx.npy"
        if isinstance(content, bytes):
            path.write_bytes(content)
        elif content:
            np.save(path, np.zeros((2, 2, 4), np.float32))
        monkeypatch.setattr(ltc, "TABLE_FILE", path)
        with pytest.raises(VlmError, match=r"ltc_ggx\.npy"):
            ltc.ltc_table()
    ltc.ltc_table.cache_clear()
