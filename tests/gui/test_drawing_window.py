# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights drawn with the mouse in Blender's window: drive_drawing.py draws, the tests read on.

Blender is found as blender_window.py says.
"""

import numpy as np
import pytest

from tests.gui.blender_window import ROOT, assert_ended_well, pixels

pytestmark = pytest.mark.full

DRIVER = "drawing"
MINUTES = 8
FILES = (ROOT / "sample_blends" / "cornell_box.blend",)
WALLS = {"back wall": 0, "red wall": 0, "green wall": 1}
"""The channel in which the wall reflects most."""


def test_the_story_came_to_its_end_and_nothing_was_raised_on_the_way(story):
    assert_ended_well(story)


def test_nothing_changes_before_a_stroke_ends_and_esc_leaves_nothing(story):
    assert story["before the end"] == 0
    assert story["after Esc"] == [0, 0, 0]


def test_the_wheel_zooms_amid_a_stroke(story):
    assert story["zoomed amid a stroke"]


@pytest.mark.parametrize(
    "name", ["back wall", "red wall", "green wall", "floor", "ceiling", "block front", "block side"]
)
def test_a_polygon_on_a_flat_surface_is_one_light(story, name):
    assert story["made"][name]["lights"] == 1


@pytest.mark.parametrize("name", ["ball, left", "ball, right", "freehand on the ball"])
def test_a_polygon_on_the_ball_is_several_lights(story, name):
    assert story["made"][name]["lights"] > 1


@pytest.mark.parametrize(("name", "channel"), WALLS.items())
def test_lights_take_the_colour_of_their_wall(story, name, channel):
    color = story["made"][name]["color"]
    assert max(color) == pytest.approx(color[channel], rel=0.01)
    assert (min(color) < 0.2 * max(color)) == (name != "back wall")


def test_lights_face_into_the_room(story):
    normals = {name: told["normal"] for name, told in story["made"].items() if "normal" in told}
    assert normals["red wall"][0] > 0.99
    assert normals["green wall"][0] < -0.99
    assert normals["floor"][2] > 0.99
    assert normals["ceiling"][2] < -0.99


def test_each_stroke_is_one_undo_step(story):
    undone, redone = story["undo and redo"]
    assert undone == story["made"]["freehand on the ball"]["lights"]
    assert redone == 0


def test_each_tool_does_its_work(story):
    made = {name: told["lights"] for name, told in story["made"].items()}
    assert made["rectangle"] == 6
    assert made["round the corner"] > 1
    assert made["cut"] == 1
    assert made["erase"] == -3


def test_it_works_in_edit_mode_and_in_orthographic_views(story):
    assert story["made"]["in edit mode"]["lights"] == 1
    assert story["made"]["orthographic"]["lights"] == 1


def test_no_stroke_is_left_running(story):
    assert [value for name, value in story.items() if name.startswith("left after")] == [0] * 5


def test_the_header_tells_of_a_stroke_and_is_blenders_again_after_it(story):
    names = ("1_polygon", "2_ten_polygons", "7_edit_mode")
    amid, after, later = (pixels(story["folder"] / f"{name}.png")[56:78, 8:250] for name in names)
    assert not np.array_equal(amid, after)
    assert np.array_equal(after, later)


def test_a_surface_is_made_ready_while_the_mouse_rests_over_it(story):
    assert len(story["milliseconds"]["262k triangles: ahead"]) > 1
