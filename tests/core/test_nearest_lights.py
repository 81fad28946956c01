# SPDX-License-Identifier: GPL-3.0-or-later
"""The nearest light of each triangle, where lights lie in the very surface that they stand for."""

import numpy as np

from vlm_addon.core.nearest_lights import light_of_triangles


def test_lights_in_the_surface_itself_stand_for_their_own_triangles():
    corners = np.random.default_rng(7).normal(size=(400, 3, 3))
    assert np.array_equal(light_of_triangles(corners, corners), np.arange(400))


def test_one_light_in_its_own_triangle_is_found_whatever_its_normal_rounds_to():
    random = np.random.default_rng(3)
    for corners in random.normal(size=(300, 1, 3, 3)):
        assert light_of_triangles(corners, corners).tolist() == [0]
