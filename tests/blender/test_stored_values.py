# SPDX-License-Identifier: GPL-3.0-or-later
"""Custom properties that somebody has changed: every reader names object, property, value and what to do."""

import re

import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring, checking, create_again, light_colors, migration
from vlm_addon.blender.baking import bake_state
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.following import animation
from vlm_addon.blender.light_geometry import light_faces_in_world
from vlm_addon.blender.light_meshes import sources
from vlm_addon.blender.overlays.overlay_shapes import COLOR, fill_shape, tagged_surface_shapes
from vlm_addon.blender.tagging import light_tags, links, tag_pairing
from vlm_addon.core import finding_kinds as kinds
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.progress import silent

OF_LIGHTS = {
    "vlm_strength": ["strong", [1.0, 2.0], {"a": 1}],
    "vlm_hue": ["red", 0.5, [1.0, 1.0], ["a", "b", "c"], {"r": 1.0}],
    "vlm_links": ["1 2", 5, [1, 2, 3], [1.5, 2.5], ["a", "b"]],
    "vlm_sources": [5, 1.5, [1, 2], {"a": 1}],
    "vlm_source_ids": ["a", 3, [1.5]],
    "vlm_schema": ["two", [1, 2], 2.5],
    "vlm_dynamic": ["yes", [1, 0]],
    "vlm_made_from": [5, "no json", "[1, 2]", '{"a": 1}'],
}
OF_SURFACES = {"vlm_tag": ["seven", 1.5, [1, 2], {"a": 1}]}
READERS = {
    "extract": lambda context, thing: extract(),
    "extract for the check": lambda context, thing: extract(broken_values=True),
    "check": lambda context, thing: checking.check(context)(silent),
    "sources": lambda context, thing: sources(thing, context.scene),
    "pair tags": lambda context, thing: tag_pairing.read_tagging(context, [thing]),
    "clear tags": lambda context, thing: light_tags.clear_tag(context),
    "leave out": lambda context, thing: links.link_receivers(context, links.named_receivers(context, "Cube")),
    "compare": lambda context, thing: bake_state.compare(context),
    "move with source": lambda context, thing: animation.follow(context, "AUTO"),
    "overlay of lights": lambda context, thing: fill_shape(thing, light_faces_in_world(thing), COLOR, 1.0),
    "overlay of tags": lambda context, thing: list(tagged_surface_shapes(context.evaluated_depsgraph_get(), 1.0)),
    "visible": lambda context, thing: extract_scene(),
    "create again": lambda context, thing: authoring.write(
        create_again.again(context, BakeSettings(target_triangles=12), False)(silent)
    ),
}
QUIET = {
    "poll of create again": lambda context, thing: create_again.again_problem(context),
    "poll of following": lambda context, thing: animation.follow_problem(context),
    "badge": lambda context, thing: bake_state.badge(context),
    "strength for a field": lambda context, thing: light_colors.strength_of(thing),
    "migration": lambda context, thing: migration.migrate_file(),
}
"""What Blender calls by itself, where an exception would print a traceback each time."""


def state(thing):
    """What a refused operator must leave as it was."""
    places = np.zeros(3 * len(thing.data.vertices), np.float32)
    thing.data.vertices.foreach_get("co", places)
    return (
        places.tobytes(),
        sorted(each.name for each in bpy.data.objects),
        sorted(each.name for each in bpy.data.meshes),
    )


def refusals(thing, owner):
    """What each reader says of the broken property; those that do not need it say nothing."""
    owner.update_tag()
    bpy.context.view_layer.update()
    told = {}
    for name, reader in READERS.items():
        before = state(thing)
        try:
            reader(bpy.context, thing)
        except InvalidInput as error:
            told[name] = str(error)
            assert state(thing) == before, name
    for reader in QUIET.values():
        reader(bpy.context, thing)
    return told


@pytest.fixture
def selected_lights(cube_lights, watched_bakes):
    bpy.data.objects["Cube"].select_set(False)
    cube_lights.select_set(True)
    return cube_lights


@pytest.mark.parametrize(("name", "value"), [(name, value) for name in OF_LIGHTS for value in OF_LIGHTS[name]])
def test_a_property_of_the_wrong_type_is_named_by_every_reader(selected_lights, name, value):
    selected_lights[name] = value
    told = refusals(selected_lights, selected_lights)
    assert told, "nothing reads it"
    for reader, sentence in told.items():
        assert re.search(rf"'VLM'.*\b{name} is ", sentence), (reader, sentence)
        assert "Custom Properties" in sentence or "again" in sentence, (reader, sentence)


@pytest.mark.parametrize(("name", "value"), [(name, value) for name in OF_SURFACES for value in OF_SURFACES[name]])
def test_a_tag_of_the_wrong_type_on_a_surface_is_named_by_every_reader(selected_lights, name, value):
    cube = bpy.data.objects["Cube"]
    cube[name] = value
    told = refusals(selected_lights, cube)
    assert {"extract", "check", "visible", "overlay of tags"} <= set(told)
    assert all("'Cube': its custom property vlm_tag is" in sentence for sentence in told.values()), told


@pytest.mark.parametrize(("name", "value"), [("vlm_strength", np.nan), ("vlm_hue", [1.0, np.inf, 1.0])])
def test_factors_that_are_no_numbers_stop_pictures_and_are_found_and_fixed(selected_lights, name, value):
    selected_lights[name] = value
    with pytest.raises(InvalidInput, match=rf"'VLM': its custom property {name} is .*(nan|inf)"):
        extract()
    found = checking.check(bpy.context)(silent).findings
    assert found[0].kind == kinds.NOT_FINITE


@pytest.mark.parametrize("value", ["7", 7.5, [7]])
def test_an_id_that_is_none_counts_as_none(selected_lights, value):
    """Ids are ours to give: what was made of them is no reason to refuse anything."""
    bpy.data.objects["Cube"]["vlm_id"] = value
    authoring.write(authoring.from_scene(bpy.context, BakeSettings(target_triangles=12))(silent))
    assert sources(bpy.data.objects["VLM"], bpy.context.scene) == [bpy.data.objects["Cube"]]


def test_long_values_are_cut_in_messages(selected_lights):
    selected_lights["vlm_links"] = 100_000 * "x"
    with pytest.raises(InvalidInput) as caught:
        extract()
    assert len(str(caught.value)) < 250
