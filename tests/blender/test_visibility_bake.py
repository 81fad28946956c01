# SPDX-License-Identifier: GPL-3.0-or-later
"""`bake --visibility` from a scene to a file, and what it refuses."""

import json

import bpy
import pytest

from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.interface.properties import technique_settings
from vlm_addon.blender.scene_file import open_scene
from vlm_addon.cli import main
from vlm_addon.core.light_grid_file import load_baked_visibility
from vlm_addon.render.device import Device


@pytest.fixture
def two_cubes(make_cube, make_light, make_camera, tmp_path):
    """Two cubes beside each other under a lamp before a camera, saved."""
    make_cube()
    make_cube().location = (4.0, 0.0, 0.0)
    make_light(location=(2.0, 0.0, 4.0))
    make_camera(location=(0.0, 0.0, 8.0))
    path = tmp_path / "cubes.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def bake(*arguments):
    return main(["bake", *(str(argument) for argument in arguments)])


def test_visibility_goes_into_the_light_grids_file_and_the_report(two_cubes, tmp_path):
    grid, report, saved = tmp_path / "cubes.vlmgrid", tmp_path / "report.json", tmp_path / "baked.blend"
    options = ("--triangles", 24, "--tolerance", 0.1, "--visibility", "--save", saved)
    assert bake(two_cubes, *options, "--light-grid", grid, "--json", report) == 0
    open_scene(saved)
    found = extract()
    loaded = load_baked_visibility(grid, found.light_mesh)
    loaded.require_made_of(found.snapshot, found.light_mesh)
    written = json.loads(report.read_text())["visibility"]
    assert written["cells"] == written["cells_asked_for"] == loaded.cells_per_axis == 16
    assert written["rows"] == len(loaded.shares)
    assert written["bytes"] == loaded.nbytes
    assert written["ways"] == loaded.ways
    assert technique_settings(bpy.context.scene, "vlm")["visibility"] == "baked"
    with Device() as device:
        here = device.bake_visibility(found.snapshot, found.light_mesh, 16, loaded.points)
    assert (here.shares == loaded.shares).all()


def test_lists_for_other_programs_hold_no_visibility(two_cubes, tmp_path, capsys):
    options = ("--triangles", 24, "--range", 2, "--visibility", "--light-grid", tmp_path / "lists.npz")
    assert bake(two_cubes, *options) == 2
    assert "--visibility" in capsys.readouterr().err
    assert not (tmp_path / "lists.npz").exists()
