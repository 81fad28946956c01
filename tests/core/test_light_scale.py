# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale of a tolerance: what the surface receives, and never more than a closed room would."""

import numpy as np
import pytest

from tests.core.surface_shapes import mesh_of
from tests.form_factor_cases import room
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.light_clusters import room_irradiance
from vlm_addon.core.light_scale import PROBES, mean_irradiance
from vlm_addon.core.light_tree import build_light_tree
from vlm_addon.core.surface_points import NO_POINTS, SurfacePoints, random_surface_points

STEP = 2.0 ** (1 / 8)
WALLS = room(16)


def measured(corners, radiosity, surface=WALLS):
    lights = lights_from_triangles(corners)
    return mean_irradiance([build_light_tree(lights)], lights, radiosity, probes(surface))


def probes(surface) -> SurfacePoints:
    mesh = mesh_of(surface.reshape(-1, 3), np.arange(3 * len(surface)).reshape(-1, 3))
    return random_surface_points([mesh], PROBES)


def test_walls_of_a_closed_room_receive_what_they_send() -> None:
    # Lights a little behind the walls, so that no point lies in the plane of its own.
    found = measured(1.01 * WALLS, np.ones((len(WALLS), 3)))
    assert 3.0 / STEP / 1.05 <= found <= 3.0


def test_light_that_meets_no_surface_does_not_count() -> None:
    """A roof that faces the sky, as large as the room and a thousand times as bright."""
    roof = WALLS + np.array([0.0, 0.0, 50.0])
    outward = roof[:, ::-1]
    radiosity = np.ones((2 * len(WALLS), 3))
    radiosity[len(WALLS) :] *= 1000.0
    corners = np.concatenate([1.01 * WALLS, outward])
    room_mean = room_irradiance(lights_from_triangles(corners), radiosity)
    assert measured(corners, radiosity) < 0.2 * room_mean


def test_a_small_change_of_light_changes_nothing() -> None:
    found = {measured(1.01 * WALLS, scale * np.ones((len(WALLS), 3))) for scale in np.linspace(1.0, 1.01, 5)}
    assert len(found) <= 2


@pytest.mark.parametrize("points", [NO_POINTS, probes(WALLS)])
def test_the_dark_has_no_scale(points: SurfacePoints) -> None:
    lights = lights_from_triangles(WALLS)
    assert mean_irradiance([build_light_tree(lights)], lights, np.zeros((len(WALLS), 3)), points) == 0.0
