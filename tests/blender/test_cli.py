# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: what it writes, its exit codes, and one line for everything that can be wrong."""

import json
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.image_io import read_image
from vlm_addon.blender.light_grid_options import scene_grid_settings
from vlm_addon.blender.scene_file import open_scene
from vlm_addon.cli import main
from vlm_addon.core.light_grid_file import load_light_grid

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def save(tmp_path):
    def save(name="scene.blend"):
        path = tmp_path / name
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        return path

    return save


@pytest.fixture
def lit_room(make_cube, make_light, make_camera, save):
    """A cube under a lamp before a camera, saved."""
    make_cube()
    make_light(location=(0.0, 0.0, 4.0))
    make_camera(location=(0.0, 0.0, 8.0))
    return save()


def run(capsys, *arguments):
    """(exit code, lines on standard error)"""
    code = main([str(argument) for argument in arguments])
    return code, capsys.readouterr().err.strip().splitlines()


def others(folder, *known):
    return sorted(path.name for path in folder.iterdir() if path not in known)


def test_bake_writes_the_scene_with_its_lights_and_a_report(lit_room, tmp_path, capsys):
    baked, report = tmp_path / "baked.blend", tmp_path / "report.json"
    before = lit_room.read_bytes()
    code, _ = run(capsys, "bake", lit_room, "--triangles", 12, "--save", baked, "--json", report)
    assert code == 0
    assert lit_room.read_bytes() == before
    written = json.loads(report.read_text())
    open_scene(baked)
    assert len(extract().light_mesh) == written["lights"] == 12
    assert written["reflected_power_m2"] == pytest.approx(written["source_reflected_power_m2"], rel=0.01)


def test_baking_again_with_another_budget_replaces_what_was_made(lit_room, tmp_path, capsys):
    first, second = tmp_path / "first.blend", tmp_path / "second.blend"
    run(capsys, "bake", lit_room, "--triangles", 12, "--save", first)
    assert run(capsys, "bake", first, "--triangles", 4, "--save", second)[0] == 0
    open_scene(second)
    assert len(extract().light_mesh) <= 4


def test_a_share_of_the_lights_halves_large_ones(lit_room, tmp_path, capsys):
    report = tmp_path / "report.json"
    assert run(capsys, "bake", lit_room, "--triangles", 40, "--split", 0.5, "--json", report)[0] == 0
    assert json.loads(report.read_text())["lights"] == 40
    code, errors = run(capsys, "bake", lit_room, "--split", 0.5, "--json", report)
    assert code == 2
    assert "--triangles" in errors[0]
    code, errors = run(capsys, "bake", lit_room, "--triangles", 40, "--split", 1.5, "--json", report)
    assert code == 2
    assert "split_share" in errors[0]


def test_a_light_mesh_drawn_by_hand_is_kept(tmp_path, capsys):
    cornell, report = ROOT / "sample_blends" / "cornell_box.blend", tmp_path / "report.json"
    assert run(capsys, "bake", cornell, "--triangles", 9, "--json", report)[0] == 0
    written = json.loads(report.read_text())
    assert (written["lights"], written["created"]) == (44, False)
    assert "drawn by hand" in written["findings"][0]


def test_baking_again_keeps_the_strength_that_an_artist_gave(lit_room, tmp_path, capsys):
    first, second = tmp_path / "first.blend", tmp_path / "second.blend"
    run(capsys, "bake", lit_room, "--triangles", 12, "--save", first)
    open_scene(first)
    bpy.data.objects["VLM"]["vlm_strength"] = 3.0
    bpy.ops.wm.save_as_mainfile(filepath=str(first))
    run(capsys, "bake", first, "--triangles", 4, "--save", second)
    open_scene(second)
    assert bpy.data.objects["VLM"]["vlm_strength"] == 3.0


def test_a_light_mesh_hidden_from_the_view_layer_is_never_replaced(lit_room, tmp_path, capsys):
    open_scene(lit_room)
    hidden = bpy.data.objects.new("by hand", bpy.data.meshes.new("by hand"))
    hidden["vlm_schema"] = 1
    folder = bpy.data.collections.new("off")
    bpy.context.scene.collection.children.link(folder)
    folder.objects.link(hidden)
    bpy.context.view_layer.layer_collection.children["off"].exclude = True
    scene = tmp_path / "hidden.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(scene))
    code, errors = run(capsys, "bake", scene, "--triangles", 12, "--save", tmp_path / "o.blend")
    assert code == 2
    assert "'by hand'" in errors[0]
    assert not (tmp_path / "o.blend").exists()


def test_render_writes_a_lit_picture_and_its_times(lit_room, tmp_path, capsys):
    image, report = tmp_path / "picture.exr", tmp_path / "report.json"
    code, _ = run(
        capsys, "render", lit_room, "--technique", "direct", "--size", "24x16", "--samples", 2, "--out", image,
        "--json", report, "--buffers", tmp_path / "buffers",
    )  # fmt: skip
    assert code == 0
    picture = read_image(image)
    assert picture.shape == (16, 24, 4)
    assert picture[8, 12, :3].min() > 0.01
    assert {"G-buffer", "direct light"} <= {name for name, _ in json.loads(report.read_text())["milliseconds"]}
    depth = read_image(tmp_path / "buffers" / "depth.exr")
    assert depth[8, 12, 0] == pytest.approx(7.0, rel=1e-3)


def test_check_of_a_sound_light_mesh_is_silent_and_of_none_is_a_finding(lit_room, tmp_path, capsys):
    baked = tmp_path / "baked.blend"
    run(capsys, "bake", lit_room, "--triangles", 12, "--save", baked)
    assert run(capsys, "check", baked)[0] == 0
    report = tmp_path / "check.json"
    assert run(capsys, "check", lit_room, "--json", report)[0] == 3
    assert len(json.loads(report.read_text())["findings"]) == 1


def test_check_says_when_there_are_more_lights_than_the_budget(lit_room, tmp_path, capsys):
    baked = tmp_path / "baked.blend"
    run(capsys, "bake", lit_room, "--triangles", 12, "--save", baked)
    open_scene(baked)
    bpy.context.scene.vlm.light_budget = 11
    over, enough = tmp_path / "over.blend", tmp_path / "enough.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(over))
    bpy.context.scene.vlm.light_budget = 12
    bpy.ops.wm.save_as_mainfile(filepath=str(enough))
    report = tmp_path / "check.json"
    assert run(capsys, "check", over, "--json", report)[0] == 3
    (finding,) = json.loads(report.read_text())["findings"]
    assert finding["problem"] == "its light meshes have 12 virtual lights, the budget is 11"
    assert run(capsys, "check", enough)[0] == 0


def test_bake_keeps_the_light_grid_it_was_asked_for_in_the_scene_and_in_a_file(lit_room, tmp_path, capsys):
    baked, grid, report = tmp_path / "baked.blend", tmp_path / "room.vlmgrid", tmp_path / "report.json"
    options = ["--range", 8, "--grid", 10, "--max-lights", 5]
    run(capsys, "bake", lit_room, "--triangles", 12, *options, "--save", baked, "--light-grid", grid, "--json", report)
    written = json.loads(report.read_text())["light_grid"]
    assert written["settings"] == {"mode": "range", "tolerance": 0.02, "grid": 10, "range": 8.0, "max_lights": 5}
    open_scene(baked)
    light_mesh = extract().light_mesh
    loaded = load_light_grid(grid, light_mesh)
    assert loaded.settings == scene_grid_settings(bpy.context.scene)
    assert loaded.nbytes == written["bytes"]


def test_bake_writes_the_lists_of_one_size_that_other_programs_read(lit_room, tmp_path, capsys):
    lists = tmp_path / "room.npz"
    options = ["--range", 8, "--grid", 10, "--max-lights", 5]
    assert run(capsys, "bake", lit_room, "--triangles", 12, *options, "--light-grid", lists)[0] == 0
    with np.load(lists) as read:
        assert read["static_lists"].shape == (1000, 5)
    code, errors = run(capsys, "bake", lit_room, "--triangles", 12, "--tolerance", 0.1, "--light-grid", lists)
    assert code == 2
    assert "no cells" in errors[0]


def test_bake_says_how_far_off_the_light_grid_is(lit_room, tmp_path, capsys):
    report = tmp_path / "report.json"
    assert run(capsys, "bake", lit_room, "--triangles", 12, "--tolerance", 0.05, "--json", report)[0] == 0
    errors = json.loads(report.read_text())["light_grid"]["point_error"]
    assert 0.0 <= errors["median"] <= errors["95 %"] <= 0.05


def test_a_light_grid_whose_cells_overflow_is_a_finding(lit_room, tmp_path, capsys):
    baked, report = tmp_path / "baked.blend", tmp_path / "report.json"
    run(capsys, "bake", lit_room, "--triangles", 12, "--range", 8, "--max-lights", 1, "--save", baked)
    assert run(capsys, "check", baked, "--json", report)[0] == 3
    (finding,) = json.loads(report.read_text())["findings"]
    assert "lights are left out" in finding["problem"]


def test_render_takes_the_settings_that_the_scene_keeps(lit_room, tmp_path, capsys):
    baked, report = tmp_path / "baked.blend", tmp_path / "report.json"
    run(capsys, "bake", lit_room, "--triangles", 12, "--tolerance", 0.1, "--save", baked)
    picture = ["--technique", "vlm", "--size", "16x16", "--samples", 1, "--out", tmp_path / "o.png", "--json", report]
    for options, tolerance in (([], 0.1), (["--set", "tolerance=0.3"], 0.3)):
        assert run(capsys, "render", baked, *picture, *options)[0] == 0
        assert json.loads(report.read_text())["settings"]["technique_settings"]["tolerance"] == tolerance


def test_techniques_lists_each_with_its_settings(tmp_path, capsys):
    report = tmp_path / "techniques.json"
    assert run(capsys, "techniques", "--json", report)[0] == 0
    listed = json.loads(report.read_text())["techniques"]
    assert {"direct", "vlm"} <= {technique["name"] for technique in listed}
    main(["techniques"])
    assert "lights=tolerance  (tolerance, range, all)" in capsys.readouterr().out


BAD_OPTIONS = {
    "no file": (["bake", "{folder}/nope.blend", "--save", "{folder}/o.blend"], "there is no such file"),
    "zero triangles": (["bake", "{scene}", "--triangles", "0", "--save", "{folder}/o.blend"], "at least 1"),
    "negative triangles": (["bake", "{scene}", "--triangles", "-5", "--save", "{folder}/o.blend"], "at least 1"),
    "nothing to write": (["bake", "{scene}"], "name --save"),
    "tolerance out of range": (["bake", "{scene}", "--tolerance", "2", "--save", "{folder}/o.blend"], "out of range"),
    "tolerance not a number": (["bake", "{scene}", "--tolerance", "nan", "--save", "{folder}/o.blend"], "out of range"),
    "cells without a range": (["bake", "{scene}", "--grid", "20", "--save", "{folder}/o.blend"], "give --range too"),
    "negative range": (["bake", "{scene}", "--range", "-1", "--save", "{folder}/o.blend"], "out of range"),
    "too many cells": (
        ["bake", "{scene}", "--range", "4", "--grid", "5000", "--save", "{folder}/o.blend"], "out of range"),
    "grid onto the scene": (["bake", "{scene}", "--light-grid", "{scene}"], "the source is never changed"),
    "no folder": (["bake", "{scene}", "--save", "{folder}/no/o.blend"], "its folder does not exist"),
    "check onto the source": (["check", "{scene}", "--json", "{scene}"], "the source is never changed"),
    "one name for two": (
        ["bake", "{scene}", "--save", "{folder}/o.blend", "--json", "{folder}/o.blend"], "two outputs"),
    "endless name": (["bake", "{scene}", "--save", "{folder}/" + 300 * "x" + ".blend"], "give a shorter one"),
    "buffers nowhere": (
        ["render", "{scene}", "--technique", "direct", "--out", "{folder}/o.png", "--buffers", "{folder}/a/b"],
        "it cannot be made"),
    "onto the source": (["bake", "{scene}", "--save", "{scene}"], "the source is never changed"),
    "unknown technique": (["render", "{scene}", "--technique", "x", "--out", "{folder}/o.png"], "use one of: direct"),
    "unknown format": (["render", "{scene}", "--technique", "direct", "--out", "{folder}/o.gif"], ".exr or .png"),
    "unknown setting": (
        ["render", "{scene}", "--technique", "direct", "--set", "a=1", "--out", "{folder}/o.png"], "no such setting"),
    "malformed setting": (
        ["render", "{scene}", "--technique", "direct", "--set", "a", "--out", "{folder}/o.png"], "KEY=VALUE"),
    "no samples": (
        ["render", "{scene}", "--technique", "direct", "--samples", "0", "--out", "{folder}/o.png"], "give 1 to"),
    "no size": (
        ["render", "{scene}", "--technique", "direct", "--size", "0x9", "--out", "{folder}/o.png"], "give 1 to"),
    "no light mesh": (["render", "{scene}", "--technique", "vlm", "--out", "{folder}/o.png"], "bake"),
    "unknown camera": (["check", "{scene}", "--camera", "x"], "camera 'x'"),
    "unknown scene": (["check", "{scene}", "--scene", "x"], "scene 'x'"),
    "unknown view layer": (["check", "{scene}", "--view-layer", "x"], "view layer 'x'"),
    "unknown view": (
        ["render", "{scene}", "--technique", "direct", "--size", "8x8", "--view", "x", "--out", "{folder}/o.png"],
        "view transform 'x'"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_OPTIONS)
def test_bad_options_are_one_line_and_exit_2(name, lit_room, tmp_path, capsys):
    arguments, says = BAD_OPTIONS[name]
    filled = [argument.format(scene=lit_room, folder=tmp_path) for argument in arguments]
    code, errors = run(capsys, *filled)
    assert code == 2
    assert len(errors) == 1
    assert says in errors[0]
    assert others(tmp_path, lit_room) == []


def test_a_light_grid_has_a_tolerance_or_a_range(lit_room, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["bake", str(lit_room), "--tolerance", "0.1", "--range", "4", "--save", str(tmp_path / "o.blend")])
    assert ended.value.code == 2
    assert "--range: not allowed with argument --tolerance" in capsys.readouterr().err
    assert others(tmp_path, lit_room) == []


def empty_mesh(make):
    make("bad", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [])


def nan_mesh(make):
    make("bad", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]).data.vertices[1].co.x = float("nan")


def flat_object(make):
    make("bad", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]).scale = (0.0, 0.0, 0.0)


@pytest.mark.parametrize("break_it", [empty_mesh, nan_mesh, flat_object])
@pytest.mark.parametrize("command", ["bake", "render", "check"])
def test_geometry_that_cannot_be_lit_names_its_object(break_it, command, make_mesh, make_cube, make_light, make_camera,
                                                      save, tmp_path, capsys):  # fmt: skip
    make_cube()
    make_light()
    make_camera()
    break_it(make_mesh)
    scene = save()
    output = {"bake": ["--save", tmp_path / "o.blend"], "check": [],
              "render": ["--technique", "direct", "--size", "8x8", "--out", tmp_path / "o.png"]}  # fmt: skip
    code, errors = run(capsys, command, scene, *output[command])
    assert (code, len(errors)) == (2, 1)
    assert "'bad'" in errors[0]
    assert others(tmp_path, scene) == []


def test_a_scene_without_lights_or_camera_says_what_to_add(make_cube, make_light, make_camera, save, tmp_path, capsys):
    make_cube()
    dark = save("dark.blend")
    options = ["--technique", "direct", "--size", "8x8", "--out", tmp_path / "o.png"]
    assert "add one (Add > Camera)" in run(capsys, "render", dark, *options)[1][0]
    make_camera()
    code, errors = run(capsys, "render", save("seen.blend"), *options)
    assert (code, len(errors)) == (2, 1)
    assert "add a light" in errors[0]


def test_a_scene_without_surfaces_cannot_be_baked(make_light, save, tmp_path, capsys):
    make_light()
    code, errors = run(capsys, "bake", save(), "--save", tmp_path / "o.blend")
    assert (code, len(errors)) == (2, 1)
    assert "add a mesh" in errors[0]


@pytest.mark.skipif(os.getuid() == 0, reason="root may write anywhere")
def test_a_folder_that_takes_no_file_is_named(lit_room, tmp_path, capsys):
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    assert run(capsys, "bake", lit_room, "--save", closed / "o.blend")[0] == 2


def test_the_module_runs_as_a_program(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "vlm_addon", "techniques"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0
    assert "vlm: " in done.stdout
    usage = subprocess.run(
        [sys.executable, "-m", "vlm_addon", "paint"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (usage.returncode, len(usage.stderr.strip().splitlines())) == (2, 1)


def test_the_view_transform_changes_the_png_only(lit_room, tmp_path, capsys):
    from PIL import Image

    pictures = []
    for view in ("Standard", "Raw"):
        path = tmp_path / f"{view}.png"
        options = ["--technique", "direct", "--size", "16x16", "--samples", 1, "--out", path, "--view", view]
        assert run(capsys, "render", lit_room, *options)[0] == 0
        pictures.append(np.asarray(Image.open(path).convert("RGB"), float))
    assert pictures[0].mean() > pictures[1].mean() + 1.0


def test_the_local_operator_makes_the_png_and_leaves_the_exr_linear(lit_room, tmp_path, capsys):
    from PIL import Image

    options = ["--technique", "direct", "--size", "32x24", "--samples", 1, "--buffers", tmp_path / "buffers"]
    picture, linear, plain = (tmp_path / name for name in ("o.png", "local.exr", "plain.exr"))
    assert run(capsys, "render", lit_room, *options, "--view", "local", "--out", picture)[0] == 0
    display = read_image(tmp_path / "buffers" / "display.exr")
    stored = np.asarray(Image.open(picture).convert("RGB"), float) / 255.0
    encoded = np.where(display <= 0.0031308, 12.92 * display, 1.055 * display ** (1 / 2.4) - 0.055)
    assert stored == pytest.approx(encoded[..., :3], abs=0.51 / 255)
    assert stored.max() > 0.2
    for view, path in (("local", linear), ("Standard", plain)):
        assert run(capsys, "render", lit_room, *options[:-2], "--view", view, "--out", path)[0] == 0
    assert np.array_equal(read_image(linear), read_image(plain))
