# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays in Blender's own window: drive_overlays.py switches them on, the tests look at the pixels.

Blender is found as blender_window.py says.
"""

import numpy as np
import pytest

from tests.gui.blender_window import assert_ended_well, pixels

pytestmark = pytest.mark.full

DRIVER = "overlays"
MINUTES = 6
STRIPE_PIXELS = 6
"""Width of the stripes on backs, as overlay_paint.py and overlay_drawing.py draw them."""


def middle(story, name):
    """Mean colour around the middle of the 3D view, where the ball is, (3,) in [0, 1]."""
    return patch(story, name).mean(axis=(0, 1))


def patch(story, name):
    """What is shown there, (40, 60, 3)."""
    return pixels(story["folder"] / f"{name}.png")[400:440, 580:640]


def inner_ball(story, name):
    """Pixels, (n, 3), of the ball but for its rim, before which flat lights do not reach."""
    shown = pixels(story["folder"] / f"{name}.png")
    x, y, radius = story["ball"]
    rows, columns = np.indices(shown.shape[:2])
    return shown[(rows - y) ** 2 + (columns - x) ** 2 < (0.8 * radius) ** 2]


def test_the_story_came_to_its_end_without_a_message(story):
    assert_ended_well(story)
    assert story["created"] == story["grid"] == ["FINISHED"]


def test_handlers_are_there_while_something_is_shown(story):
    off, on, off_again = story["handlers"]
    assert on == off + 1
    assert off_again == off


def test_lights_show_their_colour_and_nothing_is_left_when_off(story):
    red, green, blue = middle(story, "color")
    assert red > 0.7
    assert max(green, blue) < 0.4
    assert middle(story, "off") == pytest.approx(middle(story, "off_again"), abs=0.02)
    assert np.ptp(middle(story, "off")) < 0.2, "without overlays the ball is gray"


def test_the_fill_has_no_gaps_although_lights_lie_behind_what_is_visible(story):
    """The ball's faces bulge before the flat lights that stand for them."""
    red, green, blue = inner_ball(story, "color").T
    assert len(red) > 10000
    assert (red > np.maximum(green, blue) + 0.3).mean() > 0.995


def test_tags_show_colours_of_their_own(story):
    assert np.abs(middle(story, "tags") - middle(story, "color")).max() > 0.2


def test_lights_that_are_turned_away_show_their_dark_striped_back_in_edit_mode(story):
    assert middle(story, "turned_edit")[0] < middle(story, "color")[0] - 0.2
    shown = patch(story, "turned_edit")
    black, dark_red = shown.max(axis=2) < 0.1, (shown[..., 0] > 0.2) & (shown[..., 1:].max(axis=2) < 0.15)
    assert 0.3 < black.mean() < 0.7
    assert 0.2 < dark_red.mean() < 0.7
    assert (black | dark_red).mean() > 0.8, "outlines and lines to the shining side apart, all are stripes"


def test_stripes_are_as_wide_as_they_are_meant(story):
    """Along a row they change every STRIPE_PIXELS pixels."""
    black = patch(story, "turned_edit").max(axis=2) < 0.1
    lengths = [len(run) for row in black for run in "".join("#" if each else " " for each in row).split()]
    assert np.median(lengths) == STRIPE_PIXELS


def test_a_slice_of_the_light_grid_stands_out_of_the_ball_in_blue(story):
    """Next to few lights errors are far under the tolerance; the slice is hidden where the ball is before it."""
    blue = {}
    for name in ("off", "grid"):
        red, green, found = np.moveaxis(pixels(story["folder"] / f"{name}.png")[270:600, 500:800], 2, 0)
        blue[name] = int((found > np.maximum(red, green) + 0.3).sum())
    assert blue["off"] == 0
    assert blue["grid"] > 2000
