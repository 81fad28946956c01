# SPDX-License-Identifier: GPL-3.0-or-later
"""The dancer bounces by her virtual lights, the room around her by another technique."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("bpy", reason="bpy is not installed in this Python")

from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.scene_file import open_scene
from vlm_addon.cli import main
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings

DANCER = Path(__file__).resolve().parents[2] / "sample_blends" / "dancer.blend"
SMALL = ("--size", "16x12", "--samples", "1", "--shadow-samples", "1")


def render(folder: Path, *chosen: str) -> tuple[int, Path]:
    """Exit code, and where the report is."""
    report = folder / "report.json"
    out = ("--out", str(folder / "out.png"), "--json", str(report))
    pairs = [text for each in chosen for text in ("--set", each)]
    return main(["render", str(DANCER), "--technique", "vlm_and_rest", *SMALL, *out, *pairs]), report


def test_what_is_animated_in_the_file_is_chosen_and_settings_of_both_parts_are_heard(tmp_path: Path) -> None:
    code, report = render(tmp_path, "rest=many_light", "many_light_lights=64", "lights=all")
    assert code == 0
    found = json.loads(report.read_text())
    assert any("Dancer, Skirt bounces by 332 virtual lights" in text for text in found["reasons"])
    assert found["counters"]["chosen_virtual_lights"] == 332
    assert found["counters"]["rest_point_lights"] == 64


@pytest.mark.parametrize(
    ("chosen", "says"),
    [
        (("rest=radiosity",), "'radiosity' is not a choice"),
        (("many_light_lights=0",), "out of range"),
        (("chosen=tagged", "tags=legs"), "'legs' is no tag id"),
    ],
)
def test_what_cannot_be_chosen_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], chosen: tuple[str, ...], says: str
) -> None:
    assert render(tmp_path, *chosen)[0] == 2
    assert says in capsys.readouterr().err


@pytest.mark.full
def test_the_room_around_her_is_as_right_as_by_the_other_technique_alone() -> None:
    """Against Cycles with one diffuse bounce, where the room shows: light counted twice would show there."""
    open_scene(DANCER)
    truth = render_reference(64, 64, 1, 1024).images["indirect"]
    scene = extract()
    errors, shares = [], []
    with Device() as device:
        for technique, chosen in (("many_light", {}), ("vlm_and_rest", {"rest": "many_light"})):
            settings = RenderSettings(64, 64, technique, chosen, 8, buffers=True)
            frame = device.render(scene.snapshot, scene.light_mesh, settings)
            shown = frame.images["material_id"][..., 0]
            around = np.lib.stride_tricks.sliding_window_view(np.pad(shown, 1, mode="edge"), (3, 3))
            moving = [mesh.material_indices for mesh in scene.snapshot.meshes if mesh.dynamic]
            room = (around.min(axis=(2, 3)) == around.max(axis=(2, 3))) & ~np.isin(shown, np.concatenate(moving))
            errors.append(relative_rmse(frame.images["indirect"], truth, room))
            shares.append(frame.images["indirect"][room].mean() / truth[room].mean())
    assert errors[0] < 0.1
    assert errors[1] < errors[0] + 0.02
    assert abs(shares[1] - shares[0]) < 0.03
