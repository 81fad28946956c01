# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets that come with the extension work in every Blender, and what a preset keeps can be read back."""

from contextlib import ExitStack
from pathlib import Path

import bpy
import pytest

from vlm_addon.blender.interface import setting_presets
from vlm_addon.blender.interface.properties import ensure_scene_settings, technique_settings
from vlm_addon.core.settings import from_mapping
from vlm_addon.render.technique import technique_by_name, technique_list

SHIPPED = Path(setting_presets.__file__).parent / "presets" / setting_presets.FOLDER
NAMES = ["final_picture", "quick_look", "thesis_grid"]


@pytest.fixture(autouse=True)
def _registered(_empty_file):
    with ExitStack() as undo:
        ensure_scene_settings()
        setting_presets.register(undo)
        yield


def test_these_presets_ship_and_blender_finds_them():
    assert sorted(path.stem for path in SHIPPED.glob("*.py")) == NAMES
    assert {"Final Picture", "Quick Look", "Thesis Grid"} <= set(setting_presets.preset_names())


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_sets_what_it_says_and_nothing_that_is_not_allowed(scene, name):
    path = SHIPPED / f"{name}.py"
    bpy.ops.script.execute_preset(filepath=str(path), menu_idname="VLM_PT_presets")
    values = technique_settings(scene, scene.vlm.technique)
    from_mapping(technique_by_name(scene.vlm.technique).settings, values, name)
    lines = [line for line in path.read_text().splitlines() if line.startswith("settings.")]
    assert len(lines) > 3
    for line in lines:
        target, value = line.split(" = ")
        assert eval(target, {"settings": scene.vlm}) == pytest.approx(eval(value)), line


def test_presets_differ_in_what_they_cost(scene):
    samples = {}
    for name in ("quick_look", "final_picture"):
        bpy.ops.script.execute_preset(filepath=str(SHIPPED / f"{name}.py"), menu_idname="VLM_PT_presets")
        samples[name] = scene.vlm.samples, scene.vlm.target_triangles, -scene.vlm.vlm_settings.tolerance
    assert samples["quick_look"] < samples["final_picture"]
    assert samples["quick_look"][2] < samples["final_picture"][2]


@pytest.mark.parametrize("technique", [technique.name for technique in technique_list()])
def test_what_a_preset_keeps_is_there_for_every_technique(scene, technique):
    scene.vlm.technique = technique
    kept = setting_presets.preset_values(scene)
    for path in kept:
        assert eval(path, {"settings": scene.vlm}) is not None
    assert f"settings.{technique}_settings" in kept or not technique_settings(scene, technique)
