# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole pictures with reflections against Cycles, by the benchmark in a small form."""

from __future__ import annotations

import sys

import pytest

from benchmarks import reflections


def test_maps_fill_in_what_the_screen_does_not_show(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = "--size 64x48 --samples 8 --reference-samples 768 --roughness 0.4"
    monkeypatch.setattr(sys, "argv", ["reflections", *arguments.split()])
    reflections.main()
    row = capsys.readouterr().out.splitlines()[-1].split()
    errors, light = ([float(row[first + 3 * i].rstrip("%")) for i in range(3)] for first in (1, 2))
    assert errors[2] < 0.5 * errors[0]
    assert errors[2] < 25.0
    assert light[2] == pytest.approx(100.0, abs=8.0)
    assert light[0] < light[2]
