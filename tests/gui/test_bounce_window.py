# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 5.5 of seed 002 made again in the window: drive_bounce.py uses mouse and keys, the tests read its pictures.

Blender is found as blender_window.py says.
"""

import numpy as np
import pytest

from tests.gui.blender_window import ROOT, assert_ended_well

pytestmark = pytest.mark.full

DRIVER = "bounce"
MINUTES = 15
SCREEN = (1000, 2300)
FILES = (ROOT / "sample_blends" / "cornell_box.blend",)
WHITE = {"floor": 0, "block": 3, "ball": 4}
"""Surfaces of the white material, by their number in drive_bounce.SURFACES."""
REFLECTANCE = np.array([0.738, 0.736, 0.74])
"""Of that material."""
RED_WALL_LIGHTS = [18, 19, 20, 21]
NOTICEABLE = 0.003
"""Radiance, W/(m² sr), from which ratios are compared."""


@pytest.fixture(scope="module")
def pictures(story):
    """Radiances by name, (h, w, 3) float64, and "surfaces", (h, w)."""
    names = (*story["pictures"], "surfaces")
    return {name: np.load(story["folder"] / f"{name}.npy").astype(np.float64) for name in names}


def inner(surfaces, number):
    """Pixels of one surface with no other one beside them: the rim of a surface is mixed with its neighbour's."""
    own = surfaces == number
    for axis in (0, 1):
        own = own & np.roll(surfaces == number, 1, axis) & np.roll(surfaces == number, -1, axis)
    return own


def white_pixels(pictures):
    return np.any([inner(pictures["surfaces"], number) for number in WHITE.values()], axis=0)


def test_the_story_came_to_its_end_and_nothing_was_raised_on_the_way(story):
    assert_ended_well(story)


def test_a_box_in_the_view_chooses_the_red_walls_lights(story):
    assert story["chosen"] == RED_WALL_LIGHTS


def test_the_buttons_and_adjust_last_turn_these_lights_alone_blue_and_five_times_as_strong(story):
    before, after = np.array(story["colors before"]), np.array(story["colors after"])
    others = [row for row in range(len(before)) if row not in RED_WALL_LIGHTS]
    assert np.array_equal(before[others], after[others])
    red, blue = before[RED_WALL_LIGHTS], after[RED_WALL_LIGHTS]
    assert blue.argmax(axis=1).tolist() == [2] * 4
    assert blue.mean(axis=1) == pytest.approx(5.0 * red.mean(axis=1), rel=1e-3)
    assert {name: story["pressed"][name]["did"] for name in ("shift_hue", "multiply_color")} == {
        "shift_hue": "VLM_OT_shift_hue",
        "multiply_color": "VLM_OT_multiply_color",
    }


def test_direct_light_is_as_it_was(pictures):
    assert pictures["direct_before"].max() > 0.1
    assert np.array_equal(pictures["direct_before"], pictures["direct_after"])


def test_the_bounce_of_the_red_wall_changes_by_the_ratio_of_its_colours(story, pictures):
    """Light is linear: what a white surface got of the red wall changes in each channel by the lights' change there."""
    change = np.array(story["colors after"])[18] - np.array(story["colors before"])[18]
    told = pictures["after"] - pictures["before"]
    seen = white_pixels(pictures) & (np.abs(told[..., 0]) > NOTICEABLE)
    assert seen.sum() > 1000
    for channel in (1, 2):
        expected = change[channel] * REFLECTANCE[channel] / (change[0] * REFLECTANCE[0])
        assert told[seen][:, channel] / told[seen][:, 0] == pytest.approx(expected, rel=0.02, abs=0.02)


def test_what_it_lit_turns_from_red_to_blue_and_gets_more_light(story, pictures):
    before, after = (story[f"colors {when}"][RED_WALL_LIGHTS[0]][0] for when in ("before", "after"))
    told = (pictures["after"] - pictures["before"])[..., 0] * before / (after - before)
    bounce = {name: pictures[name] - pictures["direct_before"] for name in ("before", "after")}
    share = np.where(white_pixels(pictures), told / np.maximum(bounce["before"][..., 0], 1e-6), 0.0)
    lit = share > 0.5
    assert lit.sum() > 300, "the block's side and what is beside the wall get most of their red from it"
    before, after = bounce["before"][lit], bounce["after"][lit]
    assert (before[:, 0] > before[:, 2]).all()
    assert (after[:, 2] > after[:, 0]).all()
    assert (after.sum(axis=1) > 1.5 * before.sum(axis=1)).all()


def test_what_the_camera_sees_of_the_red_wall_stays_red(pictures):
    wall = inner(pictures["surfaces"], 1)
    shown = pictures["after"][wall].mean(axis=0)
    assert shown[0] > 2.0 * max(shown[1], shown[2])


def test_an_object_that_is_left_out_gets_direct_light_alone_and_all_else_stays(story, pictures):
    assert story["pressed"]["link_receiver"]["did"] == "VLM_OT_link_receiver"
    block = inner(pictures["surfaces"], WHITE["block"])
    bounce = pictures["after"][block] - pictures["direct_before"][block]
    assert bounce.max() > 0.01
    assert pictures["left_out"][block] == pytest.approx(pictures["direct_before"][block], abs=1e-5)
    for name, number in WHITE.items():
        if name != "block":
            own = inner(pictures["surfaces"], number)
            assert pictures["left_out"][own] == pytest.approx(pictures["after"][own], abs=1e-5)


def test_check_finds_what_stands_in_front_and_fix_mends_it(story):
    assert story["lifted"] > 0
    checked, fixed = ({kind for kind, _ in story[step]} for step in ("checked", "fixed"))
    assert {"in_front", "bright"} <= checked
    assert fixed == {"bright"}, "more than 1 is allowed: only its own button dims it"


def test_select_shows_the_lights_that_the_finding_names(story):
    assert story["offenders"] == ["bright", RED_WALL_LIGHTS]
