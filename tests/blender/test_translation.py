# SPDX-License-Identifier: GPL-3.0-or-later
"""Every operator and panel has a German name, and Blender shows it."""

import ast
from contextlib import ExitStack
from pathlib import Path

import bpy
import pytest

from vlm_addon.blender.baking import bake_state
from vlm_addon.blender.drawing.draw_tool import TOOLS
from vlm_addon.blender.following.animation import LEFT_BEHIND
from vlm_addon.blender.interface import availability, german, panels, render_panels, translation
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.overlays import overlays
from vlm_addon.core import finding_kinds

OPERATORS = Path(__file__).resolve().parents[2] / "operators"


def operator_ids():
    """Of every operator: each has a file of its name."""
    return {f"vlm.{path.stem}" for path in OPERATORS.glob("*.py")} - {"vlm.__init__"}


@pytest.fixture
def german_blender(_empty_file):
    """Blender in German, with one operator of ours, after `translation.register`."""
    bake = {"bl_idname": "vlm.bake", "bl_label": "Bake", "__doc__": "Make lights"}
    operator = type("VLM_OT_bake", (bpy.types.Operator,), bake)
    view = bpy.context.preferences.view
    before = view.language, view.use_translate_interface, view.use_translate_tooltips
    with ExitStack() as undo:
        bpy.utils.register_class(operator)
        undo.callback(bpy.utils.unregister_class, operator)
        translation.register(undo)
        try:
            view.language = "de_DE"
        except TypeError:
            pytest.skip("this Blender was built without languages")
        view.use_translate_interface = view.use_translate_tooltips = True
        yield undo
    view.language, view.use_translate_interface, view.use_translate_tooltips = before


def test_every_operator_has_a_german_label_and_tooltip():
    assert operator_ids() == set(german.OPERATORS)
    assert all(label and tooltip for label, tooltip in german.OPERATORS.values())


def test_every_panel_has_a_german_title():
    titles = {panel.bl_label for panel in (*panels.CLASSES, *panels.LAST_CLASSES, *render_panels.CLASSES)}
    assert sorted(titles - set(german.LABELS)) == []


def test_the_settings_that_the_panels_show_first_have_german_names(scene):
    ensure_scene_settings()
    shown = scene.vlm.bl_rna.properties, scene.vlm.vlm_settings.bl_rna.properties
    names = {prop.name for group in shown for prop in group if prop.type != "POINTER" and prop.identifier != "name"}
    names |= {prop.name for prop in scene.vlm.effects.bl_rna.properties if prop.type == "ENUM"} - {"Combine"}
    assert sorted(names - set(german.PROPERTIES | german.LABELS)) == []


def test_blender_shows_them(german_blender):
    tell = bpy.app.translations.pgettext_iface
    assert tell("Bake", "Operator") == german.OPERATORS["vlm.bake"][0]
    assert bpy.app.translations.pgettext_tip("Make lights") == german.OPERATORS["vlm.bake"][1]
    assert tell("Target Triangles") == german.PROPERTIES["Target Triangles"]


def test_afterwards_blender_shows_english_again(german_blender):
    german_blender.close()
    assert bpy.app.translations.pgettext_iface("Target Triangles") == "Target Triangles"


def test_an_operator_that_is_there_has_its_texts():
    bake = {"bl_idname": "vlm.bake", "bl_label": "Bake", "__doc__": "Make lights"}
    operator = type("VLM_OT_bake", (bpy.types.Operator,), bake)
    bpy.utils.register_class(operator)
    try:
        texts = translation.messages()["de_DE"]
    finally:
        bpy.utils.unregister_class(operator)
    assert (texts["Operator", "Bake"], texts["*", "Make lights"]) == german.OPERATORS["vlm.bake"]


def test_an_operator_that_is_not_there_stops_nothing():
    texts = translation.messages()["de_DE"]
    assert ("Operator", "Light Scene") not in texts
    assert texts["*", "Target Triangles"] == german.PROPERTIES["Target Triangles"]


def told_by(module):
    """The constant sentences that functions of a module return, or put into a badge."""
    returned = [node.value for node in ast.walk(ast.parse(Path(module.__file__).read_text())) if is_return(node)]
    constants = [node.value for value in returned for node in ast.walk(value) if isinstance(node, ast.Constant)]
    return {text for text in constants if isinstance(text, str) and " " in text.strip()}


def is_return(node):
    """Of a whole sentence: what is put together of parts is not looked for."""
    return (
        isinstance(node, ast.Return)
        and node.value
        and not any(isinstance(part, ast.JoinedStr) for part in ast.walk(node.value))
    )


@pytest.mark.parametrize("module", [availability, overlays, bake_state])
def test_what_panels_say_has_german_words(module):
    sentences = told_by(module)
    assert len(sentences) >= 3
    assert sorted(sentences - set(german.SENTENCES)) == []


def test_every_tool_has_a_german_name_and_tooltip():
    assert {tool.label for tool in TOOLS} <= set(german.BUTTONS)
    assert {tool.text for tool in TOOLS} <= set(german.SENTENCES)


def test_every_kind_of_finding_has_german_words():
    kinds = {value for name, value in vars(finding_kinds).items() if name.isupper() and isinstance(value, str)}
    assert kinds | {LEFT_BEHIND} == set(german.FINDINGS)


def test_words_that_blender_has_in_another_sense_are_ours(german_blender):
    assert translation.told("Tags") == german.LABELS["Tags"]
    assert translation.told("Nothing is baked") == german.SENTENCES["Nothing is baked"]
    assert "7" in translation.told_finding("thin", "7 lights stand", 7) != "7 lights stand"
    assert translation.told_finding("", "as it is", 7) == "as it is"
