# SPDX-License-Identifier: GPL-3.0-or-later
"""Every repair takes its finding away, keeps to the lights that it is given, and pushes nothing through a thin body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.core.surface_shapes import cube, grid, mesh_of, sheet
from vlm_addon.core import finding_kinds as kinds
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_links import leaves_out
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.nearest_lights import pair_nearest
from vlm_addon.core.repair import can_fix, fix
from vlm_addon.core.scene import Mesh
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh

SURFACE = mesh_of(*grid(4, 4), reflectance=0.5)
WALL = create_light_mesh([SURFACE], SimplifySettings(100)).light_mesh
ROWS = [2, 5, 7]
OTHERS = np.setdiff1d(np.arange(len(WALL)), ROWS)


def changed(name: str, value: object) -> VirtualLightMesh:
    values = getattr(WALL, name).copy()
    values[ROWS] = value
    return replace(WALL, **{name: values})


def fixed(kind: str, light_mesh: VirtualLightMesh, rows: object = ROWS) -> VirtualLightMesh:
    return fix(kind, light_mesh, [SURFACE], rows).applied(light_mesh)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize(("name", "instead"), [("colour", 0.0), ("emission", 0.0), ("strength", 1.0)])
def test_broken_values_are_cleared(name: str, instead: float, bad: float) -> None:
    mended = fixed(kinds.NOT_FINITE, changed(name, bad))
    assert (getattr(mended, name)[ROWS] == instead).all()
    assert (getattr(mended, name)[OTHERS] == getattr(WALL, name)[OTHERS]).all()


def test_lights_with_a_broken_vertex_go() -> None:
    vertices = WALL.vertices.copy()
    vertices[WALL.triangles[0, 0]] = np.nan
    rows = np.flatnonzero((WALL.triangles == WALL.triangles[0, 0]).any(axis=1))
    mended = fixed(kinds.NOT_FINITE, replace(WALL, vertices=vertices), rows)
    assert len(mended) == len(WALL) - len(rows)
    assert np.isfinite(mended.vertices).all()


@pytest.mark.parametrize("name", ["colour", "emission", "strength"])
def test_negative_values_become_zero(name: str) -> None:
    mended = fixed(kinds.NEGATIVE, changed(name, -0.5))
    assert (getattr(mended, name)[ROWS] == 0).all()
    assert (getattr(mended, name)[OTHERS] == getattr(WALL, name)[OTHERS]).all()


def test_bright_colours_keep_their_hue() -> None:
    mended = fixed(kinds.BRIGHT, changed("colour", [4.0, 2.0, 1.0]))
    np.testing.assert_allclose(mended.colour[ROWS], [[1.0, 0.5, 0.25]] * 3)
    assert (mended.colour[OTHERS] == WALL.colour[OTHERS]).all()


@pytest.mark.parametrize("kind", [kinds.INSIDE_OUT, kinds.NON_MANIFOLD])
def test_reversed_lights_are_turned_over(kind: str) -> None:
    triangles = WALL.triangles.copy()
    triangles[ROWS] = triangles[ROWS][:, ::-1]
    mended = fixed(kind, replace(WALL, triangles=triangles))
    np.testing.assert_allclose(mended.area_vectors, WALL.area_vectors)


@pytest.mark.parametrize("kind", [kinds.DEGENERATE, kinds.OVERLAPPING])
def test_superfluous_lights_are_deleted(kind: str) -> None:
    mended = fixed(kind, WALL)
    np.testing.assert_array_equal(mended.corners, WALL.corners[OTHERS])


def test_lost_tags_are_cleared() -> None:
    mended = fixed(kinds.LOST_TAG, replace(WALL, tag_ids=np.full(len(WALL), 3, np.int32)))
    assert (mended.tag_ids[ROWS] == 0).all()
    assert (mended.tag_ids[OTHERS] == 3).all()


def test_lights_in_front_move_behind_and_keep_their_power() -> None:
    sphere_like = mesh_of(*cube(6)[:2])
    made = create_light_mesh([sphere_like], SimplifySettings(60)).light_mesh
    raised = replace(made, vertices=1.02 * made.vertices)
    repair = fix(kinds.IN_FRONT, raised, [sphere_like], np.arange(len(made)))
    mended = repair.applied(raised)
    assert np.abs(mended.vertices).max() < 0.5
    assert repair.tag_ids is None
    np.testing.assert_allclose(mended.areas * mended.strength, raised.areas * raised.strength, rtol=1e-5)


def test_only_what_the_chosen_lights_stand_for_moves_them() -> None:
    raised = replace(WALL, vertices=WALL.vertices + np.array([0, 0, 0.03]))
    mended = fixed(kinds.IN_FRONT, raised, [0])
    touched = np.isin(np.arange(len(WALL.vertices)), WALL.triangles[0])
    assert (mended.vertices[touched, 2] < 0).all()
    assert (mended.vertices[~touched] == raised.vertices[~touched]).all()


def bump(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.2 * np.sin(np.pi * x) * np.sin(np.pi * y)


def shell(cells: int, thickness: float) -> list[Mesh]:
    top, triangles = sheet(bump, cells, cells)
    return [mesh_of(top, triangles), mesh_of(top - np.array([0, 0, thickness]), triangles[:, ::-1])]


def bent_shell(thickness: float) -> list[Mesh]:
    return shell(16, thickness)


def test_thin_body_gets_tags_where_moving_would_pass_its_other_side() -> None:
    thickness = 4e-3
    meshes = bent_shell(thickness)
    # As many lights as triangles: nothing is placed but by the inset.
    light_mesh = create_light_mesh(shell(4, thickness), SimplifySettings(1000)).light_mesh
    repair = fix(kinds.IN_FRONT, light_mesh, meshes, np.arange(len(light_mesh)))
    mended, surface = repair.applied(light_mesh), repair.applied_to(meshes)
    # Around the open rim of the shell there is no other side.
    inner = (np.abs(light_mesh.vertices[:, :2] - 0.5) < 0.4).all(axis=1)
    height = mended.vertices[:, 2] - bump(mended.vertices[:, 0], mended.vertices[:, 1])
    assert np.linalg.norm(mended.vertices - light_mesh.vertices, axis=1)[inner].max() > 0.1 * thickness
    assert height[inner].max() < 1e-4
    assert height[inner].min() > -thickness - 1e-4
    assert repair.tag_ids is not None
    for mesh, lights in zip(surface, pair_nearest(light_mesh, meshes), strict=True):
        tagged = repair.tag_ids[lights] != 0
        assert tagged.any()
        assert leaves_out(mended.links, mended.tag_ids[lights], mesh.tag_ids)[tagged].all()


def test_tags_of_the_artist_stay() -> None:
    meshes = [replace(mesh, tag_ids=np.full(len(mesh.tag_ids), 4, np.int32)) for mesh in bent_shell(2e-3)]
    made = create_light_mesh(meshes, SimplifySettings(16))
    own = made.light_mesh.tag_ids.copy()
    own[:] = np.where(np.arange(len(own)) % 2, 9, 0)
    light_mesh = replace(made.light_mesh, tag_ids=own)
    repair = fix(kinds.THIN, light_mesh, meshes, np.arange(len(own)), made.light_of_triangle)
    mended, surface = repair.applied(light_mesh), repair.applied_to(meshes)
    assert all((mesh.tag_ids == 4).all() for mesh in surface)
    assert (mended.tag_ids[own == 9] == 9).all()
    for mesh, lights in zip(surface, made.light_of_triangle, strict=True):
        assert leaves_out(mended.links, mended.tag_ids[lights], mesh.tag_ids).all()


def test_a_face_gets_one_tag_for_all_its_triangles() -> None:
    faces = np.arange(len(SURFACE.triangles)) % 16
    made = create_light_mesh([SURFACE], SimplifySettings(100))
    repair = fix(kinds.TWO_SIDED, WALL, [SURFACE], np.arange(len(WALL)), made.light_of_triangle, [faces])
    tags = repair.applied_to([SURFACE])[0].tag_ids
    assert all(len(set(tags[faces == face])) == 1 for face in range(16))
    assert leaves_out(repair.links, repair.tag_ids[made.light_of_triangle[0]], tags).all()


def test_what_cannot_be_repaired_says_so() -> None:
    assert not can_fix(kinds.UNSAMPLED)
    with pytest.raises(InvalidInput, match="no repair"):
        fix(kinds.UNSAMPLED, WALL, [SURFACE], [0])
    with pytest.raises(InvalidInput, match=f"row 99 of {len(WALL)} lights"):
        fix(kinds.INSIDE_OUT, WALL, [SURFACE], [99])
