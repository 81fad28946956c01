# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of lights in object and edit mode: what is chosen changes, what cannot be a colour is never written."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender import light_colors
from vlm_addon.blender.light_colors import BOTH, COLOR, EMISSION
from vlm_addon.blender.light_faces import read_faces, select_faces
from vlm_addon.blender.light_geometry import light_faces_in_world
from vlm_addon.core import color_changes
from vlm_addon.core.errors import InvalidInput

BLUE = color_changes.fill((0.0, 0.5, 7.5))
GRID = [(x, y, 0.0) for y in range(3) for x in range(4)]
QUADS = [(x + 4 * y, x + 1 + 4 * y, x + 5 + 4 * y, x + 4 + 4 * y) for y in range(2) for x in range(3)]


@pytest.fixture
def lights(make_mesh):
    """A light mesh of six quads in a row of three by two, each of another colour."""
    thing = make_mesh("lights", GRID, QUADS)
    thing["vlm_schema"] = 2
    colors = np.linspace(0.1, 2.4, 24, dtype=np.float32)
    thing.data.attributes.new("vlm_color", "FLOAT_COLOR", "FACE").data.foreach_set("color", colors)
    return thing


def editing(thing, *faces):
    """Edit mode with just these faces selected."""
    chosen = np.zeros(len(thing.data.polygons), bool)
    chosen[list(faces)] = True
    select_faces(thing, chosen)
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")


def colors(thing, name="vlm_color"):
    return read_faces(thing, name)[:, :3]


def test_object_mode_changes_all_faces_and_keeps_hdr(lights):
    assert light_colors.change_colors([lights], BLUE, COLOR) == 6
    assert colors(lights).tolist() == [[0.0, 0.5, 7.5]] * 6


def test_edit_mode_changes_the_selected_faces_alone(lights):
    before = colors(lights)
    editing(lights, 1, 4)
    assert light_colors.change_colors([lights], BLUE, COLOR) == 2
    bpy.ops.object.mode_set(mode="OBJECT")
    changed = (colors(lights) != before).any(axis=1)
    assert np.flatnonzero(changed).tolist() == [1, 4]
    assert colors(lights)[4].tolist() == [0.0, 0.5, 7.5]


@pytest.mark.parametrize(("quantity", "color", "emission"), [(COLOR, 6, 0), (EMISSION, 0, 6), (BOTH, 6, 6)])
def test_only_the_quantity_that_is_meant_changes(lights, quantity, color, emission):
    before = colors(lights), colors(lights, "vlm_emission")
    light_colors.change_colors([lights], BLUE, quantity)
    after = colors(lights), colors(lights, "vlm_emission")
    assert [int((a != b).any(axis=1).sum()) for a, b in zip(before, after, strict=True)] == [color, emission]


def test_a_mesh_that_two_objects_share_changes_once(lights, scene):
    twin = lights.copy()
    scene.collection.objects.link(twin)
    before = colors(lights)
    assert light_colors.change_colors([lights, twin], color_changes.multiply((2, 2, 2)), COLOR) == 6
    assert colors(lights) == pytest.approx(2 * before)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -1.0])
def test_what_is_no_colour_is_refused_and_nothing_of_any_light_mesh_is_written(lights, scene, wrong):
    other = lights.copy()
    other.data = lights.data.copy()
    scene.collection.objects.link(other)
    values = read_faces(other, "vlm_color")
    values[5, 1] = wrong
    other.data.attributes["vlm_color"].data.foreach_set("color", values.ravel())
    before = colors(lights)
    with pytest.raises(InvalidInput, match="light 5 would be"):
        light_colors.change_colors([lights, other], color_changes.multiply((3, 3, 3)), COLOR)
    assert np.array_equal(colors(lights), before)
    assert light_colors.change_colors([other], BLUE, COLOR) == 6


def test_a_factor_that_overflows_is_refused(lights):
    with pytest.raises(InvalidInput, match="would be"):
        light_colors.change_colors([lights], color_changes.multiply((3e38, 1, 1)), COLOR)


def test_a_linked_light_mesh_is_refused(lights, tmp_path):
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["lights"]
    with pytest.raises(InvalidInput, match="linked from another file"):
        light_colors.change_colors(wanted.objects, BLUE, COLOR)


def test_a_gradient_runs_from_the_first_to_the_last_chosen_light(lights):
    lights.rotation_euler.z = np.pi / 2
    bpy.context.view_layer.update()
    ends = light_colors.gradient_ends([lights], light_colors.DIRECTION, (0, 1, 0), (0, 0, 0), (0, 0, 0))
    change = light_colors.gradient(ends, (0, 0, 0), (1, 2, 4), multiplies=False)
    light_colors.change_colors([lights], change, COLOR)
    # What was along x lies along y now.
    expected = np.array([0.0, 0.5, 1.0] * 2)[:, None] * [1, 2, 4]
    assert colors(lights) == pytest.approx(expected, abs=1e-6)


def test_the_gradient_in_edit_mode_fits_the_selected_faces(lights):
    editing(lights, 0, 1)
    ends = light_colors.gradient_ends([lights], light_colors.DIRECTION, (1, 0, 0), (0, 0, 0), (0, 0, 0))
    assert (ends[0][0], ends[1][0]) == pytest.approx((0.5, 1.5))


def test_locking_counts_what_was_not_locked(lights):
    editing(lights, 2)
    assert light_colors.lock([lights], locked=True) == 1
    bpy.ops.object.mode_set(mode="OBJECT")
    assert light_colors.lock([lights], locked=True) == 5
    assert read_faces(lights, "vlm_lock").tolist() == [1] * 6
    assert light_colors.lock([lights], locked=False) == 6


def test_strength_and_hue_leave_the_faces_alone(lights):
    before = colors(lights)
    assert light_colors.set_strength([lights], 5.0, (0.0, 0.5, 1.0)) == 1
    assert light_colors.strength_of(lights) == (5.0, (0.0, 0.5, 1.0))
    assert np.array_equal(colors(lights), before)


def test_a_strength_with_which_colours_overflow_is_refused(lights):
    """Blender makes the largest float32 of an infinite number that a script gives an operator."""
    with pytest.raises(InvalidInput, match=r"would send out 7.8e\+38, more than can be stored"):
        light_colors.set_strength([lights], 3.4028234663852886e38, (1.0, 1.0, 1.0))
    assert light_colors.strength_of(lights) == (1.0, (1.0, 1.0, 1.0))


@pytest.mark.parametrize(("strength", "hue"), [(-1.0, (1, 1, 1)), (np.nan, (1, 1, 1)), (1.0, (1, np.inf, 1))])
def test_a_strength_that_no_light_can_have_is_refused(lights, strength, hue):
    with pytest.raises(InvalidInput, match="strength and hue"):
        light_colors.set_strength([lights], strength, hue)
    assert light_colors.strength_of(lights) == (1.0, (1.0, 1.0, 1.0))


def test_faces_in_the_world_are_where_they_are_in_either_mode(lights):
    lights.scale = (-1.0, 2.0, 1.0)
    bpy.context.view_layer.update()
    found = light_faces_in_world(lights)
    assert found.areas == pytest.approx(np.full(6, 2.0))
    assert found.middles[0] == pytest.approx([-0.5, 1.0, 0.0])
    # A mirrored light mesh shines to the mirrored side.
    edges = found.corners[:, 1:] - found.corners[:, :1]
    assert (np.cross(edges[:, 0], edges[:, 1])[:, 2] > 0.0).all()
    editing(lights, 0)
    bpy.ops.mesh.delete(type="FACE")
    assert light_faces_in_world(lights).count == 5
    assert light_faces_in_world(lights).middles[0] == pytest.approx([-1.5, 1.0, 0.0])


def test_modifiers_that_move_lights_count_where_they_are_asked_for(lights):
    modifier = lights.modifiers.new("up", "DISPLACE")
    modifier.strength, modifier.mid_level, modifier.direction = 3.0, 0.0, "Z"
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert light_faces_in_world(lights, depsgraph).middles[:, 2] == pytest.approx(np.full(6, 3.0))
    assert light_faces_in_world(lights).middles[:, 2] == pytest.approx(np.zeros(6))


def test_a_part_of_the_faces_is_numbered_anew(lights):
    found = light_faces_in_world(lights)
    chosen = np.array([False, True, False, False, True, False])
    part = found.subset(chosen)
    assert part.count == 2
    assert np.array_equal(part.middles, found.middles[chosen])
