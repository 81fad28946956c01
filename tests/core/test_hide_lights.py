# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights go behind their surface as far as they shine on it: little own light, and little accuracy lost for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.core.surface_shapes import cube, icosphere, mesh_of, sheet
from vlm_addon.core import finding_kinds as kinds
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.hand_over import hand_over
from vlm_addon.core.mesh_topology import Rows
from vlm_addon.core.own_light import OwnLight, own_light, region_points
from vlm_addon.core.own_shares import Allowance, allowance_of
from vlm_addon.core.scene import Mesh
from vlm_addon.core.simplify import CreatedLightMesh, SimplifySettings, create_light_mesh
from vlm_addon.core.validate import check_light_mesh


def measured(created: CreatedLightMesh, meshes: list[Mesh]) -> OwnLight:
    points = region_points(meshes, created.light_of_triangle, 4000)
    return own_light(created.light_mesh, np.zeros(len(created.light_mesh), np.int64), points, 300)


def waves(amplitude: float) -> Mesh:
    positions, triangles = sheet(lambda x, y: amplitude * np.sin(7 * x) * np.cos(5 * y), 24, 24)
    return mesh_of(positions, triangles, reflectance=1.0)


def room_around(body: Mesh) -> list[Mesh]:
    positions, triangles, _ = cube(2)
    return [body, mesh_of(4.0 * positions, triangles[:, ::-1], reflectance=1.0)]


@pytest.mark.parametrize("target", [12, 60])
@pytest.mark.parametrize("amplitude", [0.1, 0.3])
def test_own_light_is_at_most_one_percent_of_all_without_a_room(amplitude: float, target: int) -> None:
    hilly = [waves(amplitude)]
    assert measured(create_light_mesh(hilly, SimplifySettings(target)), hilly).share < 0.01


def test_lights_that_hardly_shine_on_their_surface_stay_in_it() -> None:
    scene = room_around(mesh_of(*icosphere(4), reflectance=1.0))
    lying, hidden = (create_light_mesh(scene, SimplifySettings(200), whole_regions=whole) for whole in (False, True))
    radius = [np.linalg.norm(made.light_mesh.vertices, axis=1) for made in (lying, hidden)]
    inner, outer = (values[values < 1.2] for values in radius)
    assert inner.mean() == pytest.approx(1.0, abs=0.02)
    assert outer.mean() < inner.mean() - 0.01
    assert measured(lying, scene).share < 2e-3
    assert lying.report.share_in_front > 10 * hidden.report.share_in_front


def test_created_lights_are_no_finding_and_those_that_float_are() -> None:
    scene = room_around(mesh_of(*icosphere(4), reflectance=1.0))
    made = create_light_mesh(scene, SimplifySettings(200)).light_mesh
    assert check_light_mesh(made, scene) == ()
    ball = np.linalg.norm(made.vertices, axis=1) < 1.2
    raised = replace(made, vertices=np.where(ball[:, None], 1.1 * made.vertices, made.vertices))
    (finding,) = check_light_mesh(raised, scene)
    assert finding.kind == kinds.IN_FRONT
    assert set(finding.lights) == set(np.flatnonzero(ball[made.triangles[:, 0]]).tolist())


def test_side_of_a_hollow_goes_to_the_light_that_does_not_see_it() -> None:
    # A floor light that holds a wall, and the wall's own light, which it does not hold.
    floor, wall = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 1]]
    corners = np.array([floor, wall], float)
    source = np.concatenate([corners, corners[1:] + np.array([0, 0, 1.0])])
    group = np.zeros(3, np.int64)
    strict = Allowance(1e-3, 1e-3)
    held = np.array([0, 1, 0])
    np.testing.assert_array_equal(hand_over(held, corners, source, group, group[:2], strict), [0, 1, 1])
    np.testing.assert_array_equal(hand_over(held, corners, source, group, np.array([0, 1]), strict), held)
    np.testing.assert_array_equal(hand_over(held, corners, source, group, group[:2], Allowance(1.0, 1.0)), held)


def test_allowance_is_a_share_of_what_a_room_gives_itself() -> None:
    positions, triangles, _ = cube(8)
    corners = positions[triangles[:, ::-1]]
    every = Rows(np.arange(len(corners)), np.arange(len(corners) + 1))
    # Of a closed room, the form factors of all walls sum to 1.
    assert allowance_of(corners, every, corners).together == pytest.approx(3e-3, rel=0.1)


def test_progress_may_stop_it() -> None:
    def stop(share: float, label: str) -> bool:
        return not (label == "place" and share > 0.75)

    with pytest.raises(Cancelled):
        create_light_mesh([waves(0.3)], SimplifySettings(60), stop)
