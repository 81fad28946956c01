# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects on the command line and in scenes: what is printed and reported, what is forced, what is refused."""

import json

import bpy
import pytest

from vlm_addon.blender.interface.properties import effect_values, ensure_scene_settings
from vlm_addon.cli import main
from vlm_addon.core.effect_rules import RULES
from vlm_addon.render.frame_effects import SETTINGS

SMALL = ("--size", "16x12")


@pytest.fixture
def lit_room(make_cube, make_light, make_camera, tmp_path):
    """A cube under a lamp before a camera, saved."""
    make_cube()
    make_light(location=(0.0, 0.0, 4.0))
    make_camera(location=(0.0, 0.0, 8.0))
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def run(capsys, *arguments):
    """(exit code, lines on standard output, lines on standard error)"""
    code = main([str(argument) for argument in arguments])
    output, errors = capsys.readouterr()
    return code, output.splitlines(), errors.strip().splitlines()


def report_of(path):
    return json.loads(path.read_text())


def test_the_command_says_of_each_effect_what_it_does_and_why(lit_room, tmp_path, capsys):
    path = tmp_path / "plan.json"
    code, lines, _ = run(capsys, "effects", lit_room, "--technique", "rsm_gather", *SMALL, "--json", path)
    assert code == 0
    listed = {each["name"]: each for each in report_of(path)["effects"]}
    assert list(listed) == [rule.name for rule in RULES]
    assert listed["world_lights"]["action"] == "skip"
    assert listed["direct_light"]["action"] == "run"
    for name, decision in listed.items():
        (line,) = [line for line in lines if line.startswith(name + " ")]
        assert decision["action"] in line
        assert decision["reason"] in line


def test_a_forced_effect_is_marked_in_the_plan_and_in_the_report(lit_room, tmp_path, capsys):
    path, picture = tmp_path / "report.json", tmp_path / "picture.exr"
    force = ("--effect", "shadows=off", "--effect", "ambient_occlusion.radius=0.1")
    assert run(capsys, "effects", lit_room, "--technique", "direct", *SMALL, *force, "--json", path)[0] == 0
    planned = {each["name"]: each for each in report_of(path)["effects"]}
    code, lines, _ = run(
        capsys,
        "render",
        lit_room,
        "--technique",
        "direct",
        *SMALL,
        *force,
        "--samples",
        1,
        "--out",
        picture,
        "--json",
        path,
    )
    assert code == 0
    rendered = {each["name"]: each for each in report_of(path)["plan"]["effects"]}
    assert planned["shadows"]["is_forced"] == rendered["shadows"]["is_forced"]
    assert report_of(path)["settings"]["effects"]["ambient_occlusion.radius"] == pytest.approx(0.1)
    assert any(line.startswith("effect: Shadows: skip") for line in lines)


def test_everything_runs_what_the_plan_leaves_out(lit_room, tmp_path, capsys):
    path, picture = tmp_path / "report.json", tmp_path / "picture.exr"
    command = (
        "render",
        lit_room,
        "--technique",
        "rsm_gather",
        *SMALL,
        "--samples",
        1,
        "--out",
        picture,
        "--json",
        path,
    )
    actions = []
    for more in ((), ("--everything",)):
        assert run(capsys, *command, *more)[0] == 0
        actions.append({each["name"]: each["action"] for each in report_of(path)["plan"]["effects"]})
    assert actions[0]["world_lights"] == "skip"
    assert actions[1]["world_lights"] == "run"
    assert actions[1]["ambient_occlusion"] in ("run", "idle")


@pytest.mark.parametrize(
    ("effect", "named"),
    [
        ("glow=on", "'glow'"),
        ("shadows=maybe", "'maybe'"),
        ("shadows", "--effect 'shadows': it is not KEY=VALUE"),
        ("ambient_occlusion.radius=wide", "wide"),
    ],
)
@pytest.mark.parametrize("command", ["render", "effects"])
def test_bad_effects_are_one_line_and_exit_2(command, effect, named, lit_room, tmp_path, capsys):
    out = ("--out", tmp_path / "never.exr") if command == "render" else ()
    code, _, errors = run(capsys, command, lit_room, "--technique", "direct", *SMALL, *out, "--effect", effect)
    assert code == 2
    assert len(errors) == 1
    assert named in errors[0]
    assert not (tmp_path / "never.exr").exists()


def test_scenes_keep_choices_and_settings(tmp_path):
    ensure_scene_settings()
    values = effect_values(bpy.context.scene)
    assert {name for name in values if "." not in name} == {rule.name for rule in RULES}
    assert {name.partition(".")[0] for name in values if "." in name} == set(SETTINGS)
    assert all(values[rule.name] == rule.default for rule in RULES)
    group = bpy.context.scene.vlm.effects
    group.shadows, group.ambient_occlusion_radius = "off", 0.125
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    again = effect_values(bpy.context.scene)
    assert again["shadows"] == "off"
    assert again["ambient_occlusion.radius"] == 0.125
    assert {name: value for name, value in again.items() if name not in ("shadows", "ambient_occlusion.radius")} == {
        name: value for name, value in values.items() if name not in ("shadows", "ambient_occlusion.radius")
    }


def test_a_scene_s_choice_is_taken_and_the_command_line_overrules_it(lit_room, tmp_path, capsys):
    ensure_scene_settings()
    bpy.ops.wm.open_mainfile(filepath=str(lit_room))
    bpy.context.scene.vlm.effects.direct_light = "off"
    kept = tmp_path / "kept.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(kept))
    path = tmp_path / "plan.json"
    for more, action in (((), "skip"), (("--effect", "direct_light=auto"), "run")):
        assert run(capsys, "effects", kept, "--technique", "direct", *SMALL, *more, "--json", path)[0] == 0
        assert {each["name"]: each["action"] for each in report_of(path)["effects"]}["direct_light"] == action
