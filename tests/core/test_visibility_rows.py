# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the points of rows lie."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.core.visible_room import block_room, host_rows
from tests.render.closed_rooms import inward_box
from tests.render.rooms import quad
from vlm_addon.core.scene import Material, SceneSnapshot
from vlm_addon.core.visibility_rows import lifted_places, ways_of


def test_points_lie_on_surfaces_in_their_zone_and_face_their_way() -> None:
    frame, cells, rows = host_rows(block_room(), 4, 8)
    places, normals = rows.places.reshape(-1, 3), rows.normals.reshape(-1, 3)
    assert (cells.zones_at(lifted_places(places, normals)) == np.repeat(rows.zones, 8)).all()
    assert (ways_of(normals) == np.repeat(rows.ways, 8)).all()
    world = frame.points(places)
    on_wall = np.isclose(world, 0.0) | np.isclose(world, 2.0)
    on_block = np.isclose(world, (0.7, 0.75, 0.3)) | np.isclose(world, (1.3, 1.2, 0.8))
    along = np.abs(normals) > 0.5
    assert ((on_wall | on_block) & along).any(axis=1).all()
    assert len(np.unique(np.stack([rows.zones, rows.ways]), axis=1).T) == len(rows)


def test_every_run_makes_the_same_rows() -> None:
    first, second = (host_rows(block_room(), 4, 8)[2] for _ in range(2))
    for name, values in vars(first).items():
        assert np.array_equal(values, getattr(second, name))


def test_both_sides_of_a_sheet_have_rows() -> None:
    _, _, rows = host_rows(SceneSnapshot("sheet", (quad((0, 0, 0), (1, 0, 0), (0, 1, 0)),)), 4, 4)
    assert sorted(np.unique(rows.ways)) == [4, 5]
    assert (rows.normals[..., 2] == np.where(rows.ways == 4, 1.0, -1.0)[:, None]).all()


def test_points_spread_over_the_area_of_a_row() -> None:
    """A row that is a whole cell of a wall has half of its points in each half of it."""
    sheet = SceneSnapshot("sheet", (quad((0, 0, 0), (1, 0, 0), (0, 1, 0)),))
    _, cells, rows = host_rows(sheet, 4, 16)
    lifted = lifted_places(rows.places.reshape(-1, 3), rows.normals.reshape(-1, 3))
    within = (lifted / 8.0 % 1.0).reshape(len(rows), 16, 3)
    inner = np.isin(cells.zone_cells()[rows.zones][:, 0], (2, 3)) & np.isin(
        cells.zone_cells()[rows.zones][:, 1], (2, 3)
    )
    assert inner.sum() == 8
    for axis in (0, 1):
        assert np.abs((within[inner][..., axis] < 0.5).mean(axis=1) - 0.5).max() <= 0.13


def test_a_ceiling_close_behind_a_panel_is_no_part_of_what_is_under_the_panel() -> None:
    walls = tuple(inward_box((0, 0, 0), (2, 2, 2), [0] * 6))
    panel = quad((0.6, 1.4, 1.99), (0.8, 0, 0), (0, -0.8, 0), name="panel")
    frame, _, rows = host_rows(SceneSnapshot("panel", (*walls, panel)), 4, 16)
    places = frame.points(rows.places.reshape(-1, 3))
    faces_down = rows.normals.reshape(-1, 3)[:, 2] < -0.5
    under_panel = (np.abs(places[:, :2] - 1.0) < 0.39).all(axis=1)
    heights = places[faces_down & under_panel & (places[:, 2] > 1.5), 2]
    assert len(heights) > 20
    assert (np.abs(heights - 1.99) < 1e-9).all()


def test_what_is_transparent_has_no_rows() -> None:
    sheet = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    glass = SceneSnapshot("glass", (sheet,), (Material("glass", alpha=0.0),))
    assert len(host_rows(glass, 4, 4)[2]) == 0
    half = replace(glass, materials=(Material("half", alpha=0.5),))
    assert len(host_rows(half, 4, 4)[2]) > 0
