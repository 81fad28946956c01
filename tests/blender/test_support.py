# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user can hand to somebody who helps: diagnostics without private names, the renderer's log, licences."""

import importlib.metadata
import os
import sys
import tomllib
from pathlib import Path

import bpy
import pytest

from vlm_addon.blender import render_process
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.blender.support import diagnostics, documentation, licences, render_log
from vlm_addon.core.errors import DeviceError, VlmError
from vlm_addon.core.scene import SceneSnapshot
from vlm_addon.render.frame_types import RenderSettings

ROOT = Path(__file__).resolve().parents[2]


pytestmark = pytest.mark.usefixtures("watched_bakes")


@pytest.fixture
def log(tmp_path, monkeypatch):
    """A log of this test's own."""
    monkeypatch.setattr(render_log, "path", lambda: tmp_path / "renderer.log")
    return tmp_path / "renderer.log"


@pytest.fixture
def process(log):
    kept = render_process.KeptRenderProcess()
    yield kept
    kept.close()


def python_that(script, monkeypatch, tmp_path):
    """The renderer's process runs `script` in place of the renderer."""
    path = tmp_path / "python"
    path.write_text(f"#!{sys.executable}\n{script}\n")
    path.chmod(0o755)
    monkeypatch.setattr(render_process, "_python", lambda: path)


def test_diagnostics_name_versions_settings_and_the_log(make_cube, scene, log):
    log.write_text("\n".join(f"line {number}" for number in range(40)))
    scene.vlm.technique = "vlm"
    scene.vlm.samples = 7
    make_cube()
    text = diagnostics.diagnostics(bpy.context)
    with (ROOT / "blender_manifest.toml").open("rb") as manifest:
        version = tomllib.load(manifest)["version"]
    for part in (
        f"Virtual Light Mesh {version}",
        f"Blender {bpy.app.version_string}",
        f"moderngl {importlib.metadata.version('moderngl')}",
        "surface objects 1, light meshes 0 with 0 virtual lights",
        "7 samples",
        "Technique vlm: ",
        "tolerance 0.02",
        "line 39",
    ):
        assert part in text
    assert "line 20" not in text


def test_diagnostics_name_no_object_scene_or_home(make_cube, scene, log):
    home = str(Path.home())
    make_cube("Secret")
    scene.name = "Classified"
    log.write_text(f"started {home}/bin/python\n")
    text = diagnostics.diagnostics(bpy.context)
    assert not [word for word in ("Secret", "Classified", home) if word in text]
    assert "started ~/bin/python" in text


def test_diagnostics_name_nothing_that_a_refusal_names(process, scene, make_plane):
    scene.name = "Classified"
    make_plane("Secret")
    bpy.context.view_layer.update()
    with pytest.raises(VlmError, match="Classified"):
        process.render(extract_scene(), None, RenderSettings(8, 8, technique="direct"), lambda fraction, label: True)
    text = diagnostics.diagnostics(bpy.context)
    assert "InvalidInput" in text
    assert not [word for word in ("Secret", "Classified") if word in text]


def test_the_log_holds_what_the_renderer_said_before_it_ended(process, log, monkeypatch, tmp_path):
    log.write_text("an earlier line\n")
    python_that("import sys; sys.exit('the driver is on fire')", monkeypatch, tmp_path)
    with pytest.raises(DeviceError, match="its last words: the driver is on fire"):
        process.render(SceneSnapshot("empty"), None, RenderSettings(8, 8), lambda fraction, label: True)
    lines = log.read_text().splitlines()
    assert lines[0] == "an earlier line"
    assert "renderer starts in" in lines[1]
    assert lines[2] == "the driver is on fire"
    assert "DeviceError: the render process ended" in lines[3]


def test_words_of_an_earlier_renderer_are_not_taken_for_the_last_ones(process, log, monkeypatch, tmp_path):
    log.write_text("an earlier renderer's last words\n")
    python_that("", monkeypatch, tmp_path)
    with pytest.raises(DeviceError) as told:
        process.render(SceneSnapshot("empty"), None, RenderSettings(8, 8), lambda fraction, label: True)
    assert "earlier" not in str(told.value)


def test_a_long_log_is_put_aside(log, monkeypatch):
    monkeypatch.setattr(render_log, "MOST_BYTES", 10)
    render_log.note("more than ten bytes")
    render_log.shorten()
    render_log.note("new")
    assert len(log.read_text().splitlines()) == 1
    assert "more than ten bytes" in log.with_name("renderer.log.old").read_text()


@pytest.mark.skipif(os.name == "nt", reason="permissions are otherwise on Windows")
def test_a_log_that_cannot_be_written_stops_nothing(log, monkeypatch, tmp_path):
    monkeypatch.setattr(render_log, "path", lambda: tmp_path / "no such folder" / "renderer.log")
    render_log.note("nobody will read this")
    assert render_log.tail(3) == []
    assert render_log.writable_path() is None


def test_the_licences_are_those_that_the_installed_packages_name():
    for licence in licences.licences()[1:]:
        told = importlib.metadata.metadata(licence.name)
        texts = " ".join(filter(None, (told["License"], told["License-Expression"])))
        assert licence.spdx in texts, licence.name


def test_every_wheel_that_ships_is_in_the_list_of_licences():
    with (ROOT / "blender_manifest.toml").open("rb") as manifest:
        shipped = {Path(path).name.split("-")[0] for path in tomllib.load(manifest)["wheels"]}
    assert shipped == {name for name, _, _ in licences.BUNDLED}


def test_the_manual_is_there():
    assert Path(documentation.open_manual(bpy.context)).is_file()
