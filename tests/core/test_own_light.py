# SPDX-License-Identifier: GPL-3.0-or-later
"""Own light: closed forms, and that tags of regions make it nought while objects still light their other parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.core.surface_shapes import cube, grid, mesh_of, sheet
from vlm_addon.core.own_light import own_light, region_points
from vlm_addon.core.own_tags import tagged_regions
from vlm_addon.core.scene import Mesh
from vlm_addon.core.simplify import CreatedLightMesh, SimplifySettings, create_light_mesh


def measured(created: CreatedLightMesh, meshes: list[Mesh]) -> object:
    points = region_points(meshes, created.light_of_triangle, 2000)
    return own_light(created.light_mesh, np.zeros(len(created.light_mesh), np.int64), points, 300)


def test_room_lights_itself_by_its_reflectance_and_nothing_is_own() -> None:
    positions, triangles, _ = cube(2)
    room = [mesh_of(positions, triangles[:, ::-1], reflectance=0.5)]
    found = measured(create_light_mesh(room, SimplifySettings(100)), room)
    # Of a closed room, the form factors of all walls sum to 1.
    assert found.total == pytest.approx(0.5, rel=1e-3)
    assert found.own == 0.0
    assert found.on_itself_untagged == pytest.approx(found.total)
    assert found.kept_on_itself == 1.0


def test_light_just_in_front_of_its_wall_shines_on_it_alone() -> None:
    wall = [mesh_of(*grid(4, 4), reflectance=1.0)]
    created = create_light_mesh(wall, SimplifySettings(100))
    # Turned over and in front: every point sees nothing but the light right over it.
    light_mesh = created.light_mesh
    turned = replace(
        light_mesh,
        vertices=light_mesh.vertices + np.array([0, 0, 1e-4]),
        triangles=light_mesh.triangles[:, ::-1].copy(),
    )
    found = measured(replace(created, light_mesh=turned), wall)
    assert found.own == pytest.approx(1.0, abs=0.02)
    assert found.share == pytest.approx(1.0, abs=0.02)
    assert found.share_of_arriving == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("faces_of", [1, 2, 5])
def test_tags_leave_no_own_light_and_the_light_of_other_parts(faces_of: int) -> None:
    positions, triangles = sheet(lambda x, y: 0.3 * np.sin(6 * x) * np.cos(5 * y), 20, 20)
    wavy = [mesh_of(positions, triangles, reflectance=1.0)]
    created = create_light_mesh(wavy, SimplifySettings(60))
    before = measured(created, wavy)
    rows = np.arange(len(created.light_mesh))
    faces = [np.arange(len(triangles)) // faces_of]
    tags, parts, links = tagged_regions(created.light_mesh, wavy, rows, created.light_of_triangle, faces)
    tagged = replace(created, light_mesh=replace(created.light_mesh, tag_ids=tags, links=links))
    after = measured(tagged, [replace(wavy[0], tag_ids=parts[0])])
    assert before.own > 0.0
    assert after.own == 0.0
    assert after.kept_on_itself > (0.999 if faces_of == 1 else 0.8)
    assert (len(links) > 0) == (faces_of > 1)
