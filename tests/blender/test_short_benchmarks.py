# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmarks run to their ends in their smallest forms, and print the rows that they promise.

What the figures are is not tested here: so small, they say nothing. Other tests hold the renderer to its errors.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from types import ModuleType

import pytest
from PIL import Image

from benchmarks import (
    effects,
    lightwave_energy,
    many_light,
    rsm_gather,
    rsm_tables,
    second_order,
    technique_sheet,
    world_light,
)
from vlm_addon.render.technique import technique_list

Run = Callable[..., str]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """run(module, *arguments): what the benchmark prints."""

    def main(module: ModuleType, *arguments: object) -> str:
        monkeypatch.setattr(sys, "argv", [module.__name__, *map(str, arguments)])
        module.main()
        return capsys.readouterr().out

    return main


def tables(printed: str) -> list[list[tuple[str, ...]]]:
    """Of each table that was printed the rows, cut where the dashes under the header are."""
    lines = printed.splitlines()
    found = []
    for number, line in enumerate(lines):
        columns = [match.span() for match in re.finditer("-+", line)]
        if len(columns) < 2 or line.strip("- "):
            continue
        rows: list[tuple[str, ...]] = []
        for row in lines[number + 1 :]:
            cells = tuple(row[start:end].strip() for start, end in columns)
            # A line that is no row has letters between the columns, or beyond the last one.
            if not row or row.split() != " ".join(cells).split():
                break
            rows.append(cells)
        found.append(rows)
    return found


def numbers(cells: tuple[str, ...]) -> list[float]:
    """Those of the cells that are not empty, all finite."""
    found = [float(cell.strip("()%").replace(",", "")) for cell in cells if cell]
    assert found
    assert all(map(math.isfinite, found)), cells
    return found


def test_second_order_has_the_published_figures_beside_ours(run: Run) -> None:
    lights, resolution = tables(run(second_order, "--size", "32x24", "--runs", 1))
    assert [(int(row[0]), int(row[1]), float(row[-1])) for row in lights] == [
        (*counts, fps) for counts, fps in second_order.PUBLISHED_FPS.items()
    ]
    shares = [0.0, *(0.5, 0.875) * len(second_order.TESTS), 1.0]
    assert [(float(row[3].strip("%")), float(row[-1])) for row in resolution] == [
        second_order.PUBLISHED_SHARES[share] for share in shares
    ]
    for row in lights:
        assert len(numbers(row)) == 7
    for row in resolution:
        assert len(numbers(row[1:])) == 9
    # Nothing is left out of the frame that all are compared with, and nothing gathered but at the low resolution.
    assert [resolution[0][1], resolution[-1][1]] == ["0.0%", "100.0%"]


def test_rsm_gather_has_a_row_for_each_variant(run: Run) -> None:
    (rows,) = tables(run(rsm_gather, "empty_room", "--size", 12, "--reference-samples", 4))
    assert [row[:2] for row in rows] == [
        ("empty_room", name) for name in (*rsm_gather.VARIANTS, "virtual light mesh", "noise of the reference")
    ]
    assert [len(numbers(row[2:])) for row in rows] == [4] * len(rsm_gather.VARIANTS) + [3, 1]


def test_rsm_tables_have_the_published_figures_beside_ours(run: Run) -> None:
    chosen = ("7.1 algorithms", "7.6 moving lights")
    small = ("--triangles", 2000, "--scale", 0.02, "--maps", 64, "--frames", 1)
    found = tables(run(rsm_tables, *small, *(name.split()[0] for name in chosen)))
    assert len(found) == len(chosen)
    for name, rows in zip(chosen, found, strict=True):
        published = rsm_tables.TABLES[name]
        assert [(row[0], float(row[1]), float(row[2])) for row in rows] == [
            (each.label, *each.published) for each in published
        ]
        others = [2 if rsm_tables.ID in each.effects else 0 for each in published]
        assert [len(numbers(row[1:])) for row in rows] == [
            6 + len(each.effects) + count for each, count in zip(published, others, strict=True)
        ]
        assert all(min(numbers(row[3:])[:3]) > 0.0 for row in rows)
    assert [row[6] for row in found[-1]] == ["0", "1", "2", "3"], "maps drawn are those of the lamps that move"


def test_world_light_has_a_row_for_each_number_of_lights(run: Run) -> None:
    # One sky: Cycles takes seconds to prepare each, however few its samples.
    small = ("--skies", "sun", "--size", "16x12", "--samples", 1, "--reference-samples", 4)
    found = tables(run(world_light, *small, "--counts", 16, 32))
    assert [[row[:2] for row in rows] for rows in found] == [[("sun", "16"), ("sun", "32")]] * 3
    assert [{len(numbers(row[2:])) for row in rows} for rows in found] == [{3}, {2}, {8}]


def test_lightwave_energy_has_every_lamp_and_every_variant(run: Run) -> None:
    (rows,) = tables(run(lightwave_energy))
    first, *others = (light.name for light in lightwave_energy.LAMPS)
    default = next(iter(lightwave_energy.VARIANTS))
    assert [row[:2] for row in rows] == [
        *((first, name) for name in lightwave_energy.VARIANTS),
        *((name, default) for name in others),
    ]
    for row in rows:
        assert len(numbers(row[2:])) == 6
        assert min(numbers(row[2:])) > 0.0


def test_technique_sheet_has_every_technique_in_its_table_and_its_picture(
    run: Run, tmp_path_factory: pytest.TempPathFactory
) -> None:
    target = tmp_path_factory.mktemp("sheet") / "sheet.jpg"
    small = ("--scenes", "lightwave_room", "--size", 32, "--lights", 50, "--reference-samples", 4)
    (rows,) = tables(run(technique_sheet, *small, "--out", target))
    names = [technique.name for technique in technique_list()]
    assert [row[:2] for row in rows] == [("lightwave_room", name) for name in (*names, "Cycles, one bounce")]
    assert [len(numbers(row[2:])) for row in rows] == [4] * len(names) + [2]
    with Image.open(target) as sheet:
        assert sheet.width >= 32 * (len(names) + 1)


def test_many_light_has_the_published_figures_and_every_visibility(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    stages = many_light.PUBLISHED["cornell_box"].stages
    monkeypatch.setattr(many_light, "LIGHTS", many_light.LIGHTS[:1])
    coarse = {"none": {}, "octree": {"octree_resolution": 32}, "baked": {"visibility_cells": 8, "visibility_points": 1}}
    visibilities = {name: {"visibility": name, **values} for name, values in coarse.items()}
    monkeypatch.setattr(many_light, "VISIBILITIES", visibilities)
    monkeypatch.setattr(many_light, "MANY_LIGHTS", {"few": {"lights": 16, "octree_resolution": 32, "resolution": 64}})
    small = ("--divide", 96, "--runs", 1, "--reference-samples", 4, "--room-size", 8)
    published, *others = tables(run(many_light, *small, "--scenes", "cornell_box", "--rooms", "cornell_box"))
    found = {row[0]: row[1:] for row in published}
    assert [float(found[row][1]) for name, row in many_light.PUBLISHED_STAGES.items()] == [
        stages[name][0] for name in many_light.PUBLISHED_STAGES
    ]
    assert all(numbers(cells) for cells in found.values())
    for rows, variants in zip(others, (many_light.VISIBILITIES, many_light.MANY_LIGHTS), strict=True):
        assert [row[0] for row in rows] == [*variants, "noise of the reference"]
        assert all(len(numbers(row[1:4])) == 3 for row in rows[:-1])


def test_effects_compares_plans_with_everything(run: Run) -> None:
    scenes = ("empty_room", effects.NO_LIGHT)
    printed = run(effects, "--scenes", *scenes, "--size", 16, 12, "--samples", 1, "--frames", 1)
    (rows,) = tables(printed)
    assert [row[0] for row in rows] == [*scenes]
    assert all(len(numbers(row[1:])) == 6 for row in rows)
    assert "Shadows: skip, nothing can occlude anything" in printed
    assert all(float(row[-1]) <= 1.0 for row in rows)


@pytest.mark.parametrize("module", [rsm_gather, lightwave_energy], ids=lambda module: module.__name__)
def test_help_explains_instead_of_measuring(
    module: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [module.__name__, "--help"])
    with pytest.raises(SystemExit) as left:
        module.main()
    assert left.value.code == 0
    assert "usage:" in capsys.readouterr().out
