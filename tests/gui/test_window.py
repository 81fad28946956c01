# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension in Blender's own window: drive_window.py plays a new user, the tests read what it saw.

Blender is found as blender_window.py says.
"""

import numpy as np
import pytest

from tests.gui.blender_window import assert_ended_well, pixels

pytestmark = pytest.mark.full

DRIVER = "window"
MINUTES = 8


def test_the_story_came_to_its_end_and_nothing_was_raised_on_the_way(story):
    assert_ended_well(story)


def test_the_zip_installs_and_enables(story):
    assert story["enabled"]


def test_one_button_lights_the_default_file(story):
    assert story["first button"] == ["RUNNING_MODAL"]
    assert pixels(story["folder"] / "first_picture.png").max() > 0.2


def test_creating_runs_beside_the_window_and_makes_lights(story):
    assert story["create"] == ["RUNNING_MODAL"]
    assert all(0 < count <= 200 for count in story["lights"].values())


def test_undo_takes_the_light_mesh_away_and_redo_brings_it_back(story):
    assert {"4_undone", "5_redone"} <= set(story["seen"])


def test_esc_stops_long_work_and_nothing_is_made(story):
    assert story["ran at Esc"]
    assert story["after Esc"] == []


def test_light_scene_shows_a_picture_lit_by_our_engine(story):
    assert story["engine"] == "VLM_ENGINE"
    picture = pixels(story["folder"] / "render_result.png")
    assert picture.mean() > 0.05
    assert (picture.max(axis=2) > 0.02).mean() > 0.95, "most of the room should have some light"


def test_the_red_wall_colours_what_is_beside_it(story):
    picture = pixels(story["folder"] / "render_result.png")
    assert (picture[..., 0] - picture[..., 1]).max() > 0.1


def test_a_light_mesh_is_absent_from_an_eevee_render(story):
    with_light_mesh, without = (pixels(story["folder"] / f"eevee_{name}.png") for name in ("with", "without"))
    assert without.mean() > 0.05
    assert np.array_equal(with_light_mesh, without)
