# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension as a user has it: zip installed into an empty Blender, then the steps of extension_story.py.

Each Blender is a Python with its bpy wheel: the one that runs the tests, and .venv-4.2, .venv-4.5 and .venv-5.2 in the
checkout (or the interpreters that VLM_PYTHON_4_2, VLM_PYTHON_4_5 and VLM_PYTHON_5_2 name; 5.2 needs Python 3.13).
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
STORY = Path(__file__).with_name("extension_story.py")
OLDEST, OLDER, OURS, NEWEST = "4.2", "4.5", "5.0", "5.2"
BLENDERS = [OURS, OLDEST, *(pytest.param(version, marks=pytest.mark.full) for version in (OLDER, NEWEST))]
MINUTES = 4


def python_of(version):
    """The interpreter that has the bpy wheel of `version`."""
    if version == OURS:
        return Path(sys.executable)
    named = os.environ.get(f"VLM_PYTHON_{version.replace('.', '_')}")
    return Path(named) if named else ROOT / f".venv-{version}" / "bin" / "python"


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    folder = tmp_path_factory.mktemp("zips")
    subprocess.run([sys.executable, ROOT / "tools" / "package.py", "--output", folder], check=True)
    (path,) = folder.glob("*-linux_x64.zip")
    return path


@pytest.fixture(scope="module", params=BLENDERS)
def told(request, package, tmp_path_factory):
    """What each step of the story showed in one Blender, and its output under "output"."""
    python = python_of(request.param)
    if not python.exists():
        pytest.skip(f"no Python with the bpy wheel {request.param} at .venv-{request.param}")
    folder = tmp_path_factory.mktemp(f"story-{request.param}")
    done = subprocess.run(
        [python, "-I", STORY, package, folder],
        cwd=folder,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")},
        capture_output=True,
        text=True,
        timeout=60 * MINUTES,
    )
    output = done.stdout + done.stderr
    assert (folder / "story.json").exists(), output
    return {**json.loads((folder / "story.json").read_text()), "output": output}


def test_it_installs_and_enables(told):
    assert told["install"]


def test_no_step_raises(told):
    assert "Traceback" not in told["output"], told["output"]


def test_enabling_loads_no_native_module(told):
    assert told["imports_of_native_modules"] == []


@pytest.mark.parametrize(
    ("lacking", "remedy"),
    [
        ("nothing selected", "select the objects"),
        ("no light mesh to check", "create one"),
        ("edit mode", "Object Mode"),
        ("no light", "add a light"),
        ("no camera", "add one (Add > Camera)"),
        ("empty scene", "add a mesh"),
    ],
)
def test_what_a_scene_lacks_is_said_with_what_to_do(told, lacking, remedy):
    assert remedy in told["refusals"][lacking]


def test_a_refusal_changes_nothing(told):
    assert told["unchanged_by_refusals"]


def test_a_light_mesh_is_created_from_the_selection_in_a_file_never_saved(told):
    assert not told["create"]["saved"]
    assert len(told["create"]["light meshes"]) == 1
    assert 0 < told["create"]["lights"] <= 40


def test_undo_takes_it_away_and_redo_brings_it_back(told):
    assert told["undo_and_redo"]["undone"] == []
    assert told["undo_and_redo"]["redone"] == told["create"]["light meshes"]
    assert told["undo_and_redo"]["lights"] == told["create"]["lights"]


def test_check_ends_and_finds_nothing_wrong_with_what_create_made(told):
    assert told["check"] == {"result": ["FINISHED"], "findings": []}


def test_a_light_mesh_for_surfaces_that_have_one_is_a_finding(told):
    assert any("'Cube' has bounce light in 'VLM Room' already" in finding for finding in told["counted_twice"])


@pytest.mark.parametrize(
    ("step", "missing"),
    [("create", "fast_simplification"), ("light scene", "moderngl"), ("render", "moderngl, glcontext")],
)
def test_missing_native_modules_are_named_with_a_remedy(told, step, missing):
    assert f"Missing {missing}" in told["without_native_modules"][step]
    assert "reinstall the extension" in told["without_native_modules"][step]


def test_a_picture_shows_bounce_light_and_no_pixel_is_darker_for_it(told):
    assert sum(told["f12"]["lit"]) > 1.1 * sum(told["f12"]["direct"]) > 0
    assert told["f12"]["least bounce"] > -1e-4
    assert told["f12"]["alpha"] == 1


def test_bounce_light_in_a_red_room_is_red(told):
    bounce = [lit - direct for lit, direct in zip(told["f12"]["lit"], told["f12"]["direct"], strict=True)]
    assert bounce[0] > 2 * bounce[1]


def test_the_scenes_light_grid_is_what_f12_renders_with(told):
    assert told["light_grid"] == pytest.approx(sum(told["f12"]["direct"]) / 3)


def test_direct_and_indirect_light_are_passes_of_their_own(told):
    assert told["passes"] == ["Combined", "Direct Light", "Indirect Light"]


def test_cancelling_leaves_no_picture_and_a_renderer_that_goes_on(told):
    assert told["cancelled"] == {
        "cancelled": 0,
        "again": pytest.approx(sum(told["f12"]["lit"]) / 3),
        "same process": True,
    }


def test_a_render_border_cuts_the_same_pixels_out_of_the_picture(told):
    assert told["border"] == {"inside": 0, "outside": 0}


def test_a_light_mesh_is_absent_from_a_cycles_render(told):
    assert told["hidden_from_cycles"]["mean"] > 0
    assert told["hidden_from_cycles"]["difference"] == 0


def test_without_a_light_mesh_direct_light_is_rendered_and_said(told):
    assert told["no_light_mesh"]["mean"] == pytest.approx(told["f12"]["direct"], rel=1e-5)
    assert "has no virtual light mesh" in told["output"]


def test_light_scene_makes_lights_switches_the_engine_and_renders(told):
    assert told["light_scene"]["result"] == ["FINISHED"]
    assert told["light_scene"]["engine"] == "VLM_ENGINE"
    assert told["light_scene"]["lights"] > 0


def test_a_second_bake_keeps_the_light_mesh(told):
    assert told["bake"]["result"] == ["FINISHED"]
    assert told["bake"]["light meshes"] == told["bake"]["after a second bake"]


def test_blenders_material_panel_stays_with_our_engine(told):
    assert told["material_panel_is_shown"]


def test_the_renderer_runs_beside_blender_and_ends_with_the_extension(told):
    assert told["renderers"]
    assert told["disable"]["renderers"] == []


def test_disabling_leaves_nothing_behind(told):
    left = {name: value for name, value in told["disable"].items() if name != "renderers"}
    assert left == {"engine in panels": [], "settings": False, "classes": [], "operators": []}


def test_enabling_again_works(told):
    assert told["enable_again"]["lights"] > 0
    assert sum(told["enable_again"]["mean"]) > 0
