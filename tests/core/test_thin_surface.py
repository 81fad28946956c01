# SPDX-License-Identifier: GPL-3.0-or-later
"""What needs tags: thin curved bodies and sheets in the open; not slabs, rooms and solid bodies."""

from __future__ import annotations

import numpy as np
import pytest

from tests.core.surface_shapes import cube, grid, icosphere, mesh_of, sheet
from vlm_addon.core.scene import Mesh
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.core.tags import ThinSurface, thin_triangles


def found_in(meshes: list[Mesh], target: int) -> ThinSurface:
    return thin_triangles(meshes, create_light_mesh(meshes, SimplifySettings(target)).light_mesh)


def shares(parts: tuple[np.ndarray, ...]) -> float:
    return float(np.concatenate(parts).mean())


def slab(thickness: float, bend: float) -> Mesh:
    top, triangles = sheet(lambda x, y: bend * np.sin(np.pi * x) * np.sin(np.pi * y), 16, 16)
    below = top - np.array([0, 0, thickness])
    return mesh_of(np.concatenate([top, below]), np.concatenate([triangles, triangles[:, ::-1] + len(top)]))


def test_flat_slab_needs_none_however_thin() -> None:
    assert shares(found_in([slab(1e-4, 0.0)], 100).thin) == 0.0


def test_bent_slab_needs_tags_where_it_is_thin_against_its_lights() -> None:
    assert shares(found_in([slab(1e-3, 0.2)], 20).thin) > 0.9
    assert shares(found_in([slab(0.5, 0.2)], 20).thin) == 0.0


def test_more_lights_need_fewer_tags() -> None:
    few, many = (shares(found_in([slab(0.02, 0.2)], target).thin) for target in (8, 500))
    assert many < 0.5 * few


@pytest.mark.parametrize("shape", [icosphere(3), cube(4)[:2]])
def test_solid_body_needs_none(shape: tuple) -> None:
    found = found_in([mesh_of(*shape)], 100)
    assert shares(found.thin) == 0.0
    assert shares(found.two_sided) == 0.0


def test_sheet_over_a_floor_is_seen_from_both_sides_and_the_floor_is_not() -> None:
    positions, triangles = grid(4, 4)
    floor = mesh_of(4.0 * positions - np.array([1.5, 1.5, 1.0]), triangles)
    found = found_in([mesh_of(positions, triangles), floor], 100)
    assert [part.all() for part in found.two_sided] == [True, False]
    assert not found.two_sided[1].any()


def test_walls_of_a_room_are_not_seen_from_behind() -> None:
    positions, triangles, side = cube(3)
    walls = [mesh_of(positions, triangles[side == wall][:, ::-1]) for wall in range(6)]
    assert shares(found_in(walls, 200).two_sided) == 0.0
