# SPDX-License-Identifier: GPL-3.0-or-later
"""The short form of the tables of seed 000, and that their rows are those of the seed."""

from __future__ import annotations

import re

import numpy as np
import pytest

from benchmarks import lightwave
from benchmarks.lightwave_published import (
    ANGLES,
    COMPLEXITY_ACCURATE,
    COMPLEXITY_INTEGRATED,
    INTEGRATED,
    SHELLS,
    TABLES,
)
from vlm_addon.core.settings import from_mapping
from vlm_addon.core.stacked_hemispheres import integrated_shadow_count, light_count
from vlm_addon.render.technique import technique_by_name


def test_rows_say_the_counts_that_their_settings_make() -> None:
    said = [int(re.findall(r"([\d,]+) lights", row.label)[0].replace(",", "")) for row in (*ANGLES, *SHELLS)]
    made = [
        light_count(float(row.settings.get("angle", 5.0)), int(row.settings.get("shells", 5)))
        for row in (*ANGLES, *SHELLS)
    ]  # type: ignore[arg-type]
    assert said == made
    for row in INTEGRATED:
        assert f"{integrated_shadow_count(5, int(row.settings['steps']))} shadows" in row.label  # type: ignore[call-overload]


def test_tables_have_the_seeds_rows_and_settings_that_exist() -> None:
    assert [len(rows) for rows in TABLES.values()] == [5, 6, 6, 6, 8, 9, 4, 3, 3, 16, 18]
    assert (COMPLEXITY_ACCURATE[8].fps, COMPLEXITY_INTEGRATED[-1].fps) == (1, 3)
    for row in (row for rows in TABLES.values() for row in rows):
        from_mapping(technique_by_name(row.technique).settings, row.settings, row.label)


def test_the_short_form_prints_every_row(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(lightwave, "REFERENCE_SIZE", (32, 18))
    monkeypatch.setattr(lightwave, "REFERENCE_SAMPLES", 4)
    lightwave.main(["5.4", "--divide", "40"])
    printed = capsys.readouterr().out
    for row in TABLES["5.4 and 5.8: indirect shadow maps"]:
        (line,) = (line for line in printed.splitlines() if line.startswith(row.label))
        assert f"{row.fps:.0f}" in line
    assert "alternatives" not in printed
    assert re.search(r"20 maps .* 100\.00% ", printed)


def test_stretching_takes_the_middle_of_each_pixel() -> None:
    picture = np.arange(6).reshape(2, 3)
    np.testing.assert_array_equal(lightwave.stretched(picture, (6, 2)), np.repeat(picture, 2, axis=1))
    np.testing.assert_array_equal(lightwave.stretched(picture, (1, 1)), [[4]])
