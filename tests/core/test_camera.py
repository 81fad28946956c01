# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from vlm_addon.core.scene import ORTHOGRAPHIC, Camera


def test_auto_fit_of_a_wide_picture_spans_the_sensor_width():
    left, right, bottom, top = Camera("c", np.eye(4), lens=36.0, sensor_width=36.0).frame(200, 100)
    assert (left, right, bottom, top) == pytest.approx((-0.5, 0.5, -0.25, 0.25))


def test_auto_fit_of_a_tall_picture_spans_the_sensor_width_upwards():
    assert Camera("c", np.eye(4), lens=36.0).frame(100, 200) == pytest.approx((-0.25, 0.25, -0.5, 0.5))


def test_vertical_fit_uses_the_sensor_height():
    assert Camera("c", np.eye(4), lens=24.0, sensor_fit="VERTICAL").frame(200, 100) == pytest.approx((-1, 1, -0.5, 0.5))


def test_orthographic_frame_is_in_metres():
    assert Camera("c", np.eye(4), kind=ORTHOGRAPHIC, ortho_scale=4.0).frame(100, 50) == pytest.approx((-2, 2, -1, 1))


def test_shift_moves_the_frame_by_shares_of_the_larger_side():
    frame = Camera("c", np.eye(4), lens=36.0, shift_x=0.5, shift_y=0.25).frame(200, 100)
    assert frame == pytest.approx((0.0, 1.0, 0.0, 0.5))
