# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening scenes: one sentence for everything that can be wrong. Writing: whole files or none."""

import re

import bpy
import pytest

from vlm_addon.blender.scene_file import open_scene, require_writable, save_blend
from vlm_addon.core.errors import InvalidInput


def in_folder(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def blend(tmp_path, make_camera):
    """A saved file with two scenes, two view layers and two cameras; bytes are not compressed."""
    scene = bpy.context.scene
    make_camera(name="first")
    make_camera(name="second")
    scene.camera = bpy.data.objects["first"]
    scene.view_layers.new("foreground")
    scene.frame_set(7)
    bpy.data.scenes.new("other")
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return path


def test_a_file_keeps_its_own_choices(blend):
    opened = open_scene(blend)
    assert (opened.scene, opened.view_layer, opened.frame, opened.camera) == ("Scene", "ViewLayer", 7, "first")


def test_everything_can_be_chosen(blend):
    opened = open_scene(blend, frame=12, scene="Scene", view_layer="foreground", camera="second")
    assert (opened.view_layer, opened.frame, opened.camera) == ("foreground", 12, "second")
    assert bpy.context.view_layer.name == "foreground"
    assert bpy.context.scene.camera.name == "second"
    assert open_scene(blend, scene="other").scene == bpy.context.scene.name == "other"


@pytest.mark.parametrize(
    ("choice", "text"),
    [
        ({"scene": "nope"}, "scene 'nope': .*use one of: other, Scene"),
        ({"view_layer": "nope"}, "view layer 'nope': .*use one of: ViewLayer, foreground"),
        ({"camera": "nope"}, "camera 'nope': .*use one of: first, second"),
        ({"scene": "other", "camera": "first"}, "camera 'first': .*none, it has none"),
    ],
)
def test_unknown_names_list_those_there_are(blend, choice, text):
    with pytest.raises(InvalidInput, match=text):
        open_scene(blend, **choice)


def with_version(data, version):
    """The file's bytes with another version in its header: BLENDER-v402… or BLENDER17-01v0500…"""
    header = re.match(rb"(BLENDER(?:[-_][vV]|\d\d-\d\dv0))\d{3}", data)
    return header[1] + b"%03d" % version + data[header.end() :]


def test_a_file_from_the_future_is_named(blend):
    data = blend.read_bytes()
    future = (bpy.app.version[0] + 4) * 100 + 2
    blend.write_bytes(with_version(data, future))
    expected = f"it was saved by Blender {bpy.app.version[0] + 4}.2, this is {bpy.app.version_string}; use Blender"
    with pytest.raises(InvalidInput, match=re.escape(expected)):
        open_scene(blend)


def test_a_newer_file_of_the_same_generation_opens(blend):
    blend.write_bytes(with_version(blend.read_bytes(), bpy.app.version[0] * 100 + 99))
    assert open_scene(blend).scene == "Scene"


DAMAGED = {
    "empty": (lambda data: b"", "it is not a .blend file"),
    "text": (lambda data: b"# not a scene\n" * 100, "it is not a .blend file"),
    "header only": (lambda data: data[:40], "Blender cannot open it"),
    "cut in half": (lambda data: data[: len(data) // 2], "Blender cannot open it"),
    "gzip of nothing": (lambda data: b"\x1f\x8b" + bytes(30), "it cannot be read"),
    "zstd of nothing": (lambda data: b"\x28\xb5\x2f\xfd" + bytes(30), "Blender cannot open it"),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_damaged_files_are_named_in_one_line(blend, damage):
    change, text = DAMAGED[damage]
    blend.write_bytes(change(blend.read_bytes()))
    with pytest.raises(InvalidInput, match=text) as raised:
        open_scene(blend)
    assert str(raised.value).startswith(f"{blend}: ")
    assert "\n" not in str(raised.value)


def test_compressed_files_open(blend, tmp_path):
    open_scene(blend)
    packed = tmp_path / "packed.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(packed), compress=True, copy=True)
    assert open_scene(packed).frame == 7


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(InvalidInput, match="there is no such file"):
        open_scene(tmp_path / "missing.blend")
    with pytest.raises(InvalidInput, match="it is a folder"):
        open_scene(tmp_path)


def test_saving_elsewhere_leaves_the_source_alone(blend, tmp_path):
    source = blend.read_bytes()
    open_scene(blend)
    bpy.context.scene["note"] = "changed"
    save_blend(tmp_path / "out.blend")
    assert blend.read_bytes() == source
    assert in_folder(tmp_path) == ["out.blend", "scene.blend"]
    assert bpy.data.filepath == str(blend)
    open_scene(tmp_path / "out.blend")
    assert bpy.context.scene["note"] == "changed"


def test_choices_for_one_run_are_not_saved(blend, tmp_path):
    opened = open_scene(blend, frame=99, view_layer="foreground", camera="second")
    save_blend(tmp_path / "out.blend", opened)
    kept = open_scene(tmp_path / "out.blend")
    assert (kept.view_layer, kept.frame, kept.camera) == ("ViewLayer", 7, "first")


@pytest.mark.parametrize("name", ["out.blend", "out", "out.scene"])
def test_a_file_never_saved_can_be_saved_under_any_name(tmp_path, name):
    save_blend(tmp_path / name)
    assert in_folder(tmp_path) == [name]
    assert open_scene(tmp_path / name).scene == "Scene"


def test_saving_over_a_file_leaves_no_backup(tmp_path):
    for _ in range(2):
        save_blend(tmp_path / "out.blend")
    assert in_folder(tmp_path) == ["out.blend"]


@pytest.mark.parametrize(
    ("path", "text"),
    [(".", "it is a folder"), ("missing/out.blend", "its folder does not exist"), ("file/out.blend", "its folder")],
)
def test_outputs_that_cannot_be_written_are_named_before_the_work(tmp_path, path, text):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInput, match=text):
        require_writable(tmp_path / path)


def test_a_folder_that_takes_no_files_is_named(tmp_path, monkeypatch):
    # Root may write everywhere: the refusal of the system is made up.
    def refuse(*arguments, **settings):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkstemp", refuse)
    with pytest.raises(InvalidInput, match=r"out.blend: it cannot be written \(Permission denied\)"):
        require_writable(tmp_path / "out.blend")


def test_asking_does_not_touch_what_is_there(tmp_path):
    target = tmp_path / "out.blend"
    target.write_text("before")
    require_writable(target)
    assert in_folder(tmp_path) == ["out.blend"]
    assert target.read_text() == "before"
