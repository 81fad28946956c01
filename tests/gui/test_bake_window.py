# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work that an artist disturbs in Blender's window does no harm: drive_bake.py disturbs, the tests read on.

Blender is found as blender_window.py says.
"""

import pytest

from tests.gui.blender_window import assert_ended_well

pytestmark = pytest.mark.full

DRIVER = "bake"
MINUTES = 10
LIGHTS = 100
GOES_ON = ("delete_source", "edit_source", "undo", "save", "begin_again")
"""What does not stop the work."""
ENDS = ("delete_scene", "escape", "load")
"""What leaves it without a result."""


def test_the_story_came_to_its_end_and_nothing_was_raised_on_the_way(story):
    assert_ended_well(story)


@pytest.mark.parametrize("name", [*GOES_ON, *ENDS, "disable"])
def test_the_work_ran_when_it_was_disturbed_and_nothing_is_left_over(story, name):
    told = story[name]
    assert told["began"] == ["RUNNING_MODAL"]
    assert told["ran"]
    assert told["orphans"] == []


@pytest.mark.parametrize("name", GOES_ON)
def test_what_does_not_stop_the_work_gives_the_lights(story, name):
    (count,) = story[name]["lights"].values()
    assert 0 < count <= LIGHTS


@pytest.mark.parametrize("name", ENDS)
def test_what_stops_the_work_leaves_no_lights(story, name):
    assert story[name]["lights"] == {}


def test_a_loaded_file_is_as_it_was_saved(story):
    assert story["load"]["said"] == ["FINISHED"]
    assert story["load"]["objects"] == 3


def test_the_extension_works_after_all_that(story):
    assert story["after all"]["began"] == ["RUNNING_MODAL"]
    assert story["after all"]["lights"]


def test_the_interface_is_german_where_blender_is(story):
    assert story["german"] == ["Lichtgitter backen", "Anzahl der Lichter"]


def test_words_that_blender_has_in_another_sense_are_told_in_ours(story):
    """Blender's German for Tags are those of a shop."""
    assert story["german of ours"] == ["Kennungen", "Lichtpolygon", "Nichts ist gebacken"]
