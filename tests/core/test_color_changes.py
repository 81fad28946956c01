# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes of light colours against the standard library's colour conversions and closed forms."""

import colorsys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vlm_addon.core import color_changes
from vlm_addon.core.errors import InvalidInput

CHANNEL = st.floats(0.0, 1e6) | st.sampled_from([0.0, 1e-30, 7.5])
COLOR = st.tuples(CHANNEL, CHANNEL, CHANNEL)
NOWHERE = np.zeros((1, 3))


def rows(*colors):
    return np.array(colors, np.float64)


@given(COLOR)
def test_hue_and_saturation_are_those_of_colorsys(color):
    hue, saturation, _ = colorsys.rgb_to_hsv(*color)
    (found_hue,), (found_saturation,) = color_changes.hue_and_saturation(rows(color))
    assert found_saturation == pytest.approx(saturation, abs=1e-12)
    # A circle: just under 1 is next to 0.
    assert abs((found_hue - hue + 0.5) % 1.0 - 0.5) < 1e-9


@given(st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
def test_colours_of_a_hue_are_those_of_colorsys(hue, saturation):
    found = color_changes.from_hue(np.array([hue]), np.array([saturation]))
    assert found[0] == pytest.approx(colorsys.hsv_to_rgb(hue % 1.0, saturation, 1.0), abs=1e-9)


@given(COLOR, st.floats(-10.0, 10.0), st.floats(0.0, 4.0))
def test_a_turned_hue_keeps_what_a_light_sends_out_and_is_never_negative(color, turn, saturation):
    found = color_changes.shift_hue(turn, saturation)(rows(color), NOWHERE)
    assert (found >= 0.0).all()
    assert found.mean() == pytest.approx(np.mean(color), rel=1e-9, abs=1e-300)


def test_a_third_of_a_turn_exchanges_the_channels():
    found = color_changes.shift_hue(2.0 * np.pi / 3.0, 1.0)(rows((7.5, 0.5, 1.0)), NOWHERE)
    assert found == pytest.approx(rows((1.0, 7.5, 0.5)), rel=1e-12)


def test_without_saturation_all_channels_are_their_mean():
    found = color_changes.shift_hue(0.3, 0.0)(rows((9.0, 0.0, 3.0)), NOWHERE)
    assert found == pytest.approx(rows((4.0, 4.0, 4.0)))


@pytest.mark.parametrize("grey", [0.0, 0.5, 100.0])
def test_grey_stays_grey(grey):
    assert color_changes.shift_hue(1.0, 2.0)(rows((grey,) * 3), NOWHERE) == pytest.approx(rows((grey,) * 3))


def test_a_gradient_is_linear_between_its_points_and_constant_beyond():
    change = color_changes.gradient((0, 0, 1), (0, 0, 3), (1, 0, 0), (0, 10, 0))
    middles = rows((5, 5, -9), (5, 5, 1), (5, 5, 1.5), (0, 0, 3), (0, 0, 9))
    expected = rows((1, 0, 0), (1, 0, 0), (0.75, 2.5, 0), (0, 10, 0), (0, 10, 0))
    assert change(np.ones((5, 3)), middles) == pytest.approx(expected)


def test_a_gradient_over_colours_multiplies_them():
    change = color_changes.over(color_changes.gradient((0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 0.5, 5)))
    assert change(rows((2, 2, 2)), rows((1, 0, 0))) == pytest.approx(rows((0, 1, 10)))


def test_the_extent_along_a_direction_holds_all_lights_just_so():
    low, high = color_changes.extent_along(rows((1, 2, 3), (1, 9, -4)), (0, 0, 2))
    assert (low.tolist(), high.tolist()) == ([0, 0, -4], [0, 0, 3])


@pytest.mark.parametrize("direction", [(0, 0, 0), (np.nan, 0, 0), (np.inf, 0, 0)])
def test_a_direction_that_is_none_is_refused(direction):
    with pytest.raises(InvalidInput, match="direction"):
        color_changes.extent_along(rows((0, 0, 0), (1, 1, 1)), direction)


def test_lights_at_one_place_along_the_direction_are_refused():
    with pytest.raises(InvalidInput, match="same place"):
        color_changes.extent_along(rows((0, 0, 0), (1, 1, 0)), (0, 0, 1))


def test_an_extent_that_placement_alone_has_made_is_none():
    middles = rows((0, 0, -1e-6), (4, 1, 2e-6), (2, 3, 0))
    with pytest.raises(InvalidInput, match=r"same place along its direction; choose another one, such as X, .* 4 m"):
        color_changes.extent_along(middles, (0, 0, 1))


def test_a_gradient_between_one_point_is_refused():
    with pytest.raises(InvalidInput, match="two different points"):
        color_changes.gradient((1, 1, 1), (1, 1, 1), (0, 0, 0), (1, 1, 1))


@pytest.mark.parametrize("wrong", [-1e-6, np.nan, np.inf, 1e39])
def test_a_colour_that_no_face_may_hold_is_refused_with_its_row(wrong):
    with pytest.raises(InvalidInput, match="light 1 would be"):
        color_changes.require_colors(rows((0, 0, 0), (1, wrong, 1)), "light mesh 'x'")
