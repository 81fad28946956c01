# SPDX-License-Identifier: GPL-3.0-or-later
"""Levels of an octree as boxes over a picture."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.rooms import camera_at, quad
from vlm_addon.core.scene import ORTHOGRAPHIC, Material, SceneSnapshot
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import make_local_space
from vlm_addon.render.octree_view import cell_edges, edge_pixels, octree_images
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.point_picture import DIMMED, palette
from vlm_addon.render.scene_octree import scene_octree
from vlm_addon.render.view import make_view

WIDTH, HEIGHT = 96, 64
CAMERAS = {
    "perspective": camera_at((1.0, -6.0, 3.0), (0.0, 0.0, 0.5)),
    "orthographic": camera_at((1.0, -6.0, 3.0), (0.0, 0.0, 0.5), kind=ORTHOGRAPHIC, ortho_scale=6.0),
}


@pytest.fixture(params=CAMERAS)
def view(request):
    return make_view(CAMERAS[request.param], WIDTH, HEIGHT, np.zeros(3))


def test_edges_that_cells_share_are_there_once():
    starts, ends = cell_edges(np.array([[0, 0, 0], [1, 0, 0]]))
    assert len(starts) == 12 + 8
    assert len(np.unique(np.concatenate([starts, ends], axis=1), axis=0)) == 20
    assert (np.abs(ends - starts).sum(axis=1) == 1).all()


def line_pixels(view, start, end, surface_depth):
    """Points along a line at very small steps, each on its own."""
    points = start + np.linspace(0.0, 1.0, 50_001)[:, None] * (end - start)
    clip = points @ view.clip_from_local[:, :3].T + view.clip_from_local[:, 3]
    inside = (np.abs(clip[:, :3]) < clip[:, 3:]).all(axis=1)
    place = (0.5 + 0.5 * clip[inside, :2] / clip[inside, 3:]) * (WIDTH, HEIGHT)
    columns, rows = np.floor(place).astype(int).T
    rows = HEIGHT - 1 - rows
    near = (view.position - points[inside]) @ view.backward <= surface_depth[rows, columns]
    shown = np.zeros((HEIGHT, WIDTH), bool)
    shown[rows[near], columns[near]] = True
    return shown


def near_to(pixels):
    """`pixels` and their neighbours."""
    padded = np.pad(pixels, 1)
    return np.any([np.roll(padded, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)[1:-1, 1:-1]


@pytest.mark.parametrize("surface", [np.inf, 6.0])
def test_a_line_shows_where_its_points_do(view, surface):
    """Lines of every kind: out of the picture, from behind the camera, behind a surface."""
    rng = np.random.default_rng(0)
    depth = np.full((HEIGHT, WIDTH), surface)
    drawn = 0
    for _ in range(24):
        start, end = rng.uniform((-8, -9, -5), (8, 6, 8), (2, 3))
        found = edge_pixels(view, start[None], end[None], depth)
        expected = line_pixels(view, start, end, depth)
        assert not (found & ~near_to(expected)).any()
        assert not (expected & ~near_to(found)).any()
        drawn += int(found.any())
    assert drawn >= 3


def images(device, **values):
    """Of a floor before a wall, seen from above."""
    meshes = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0)), quad((-2, 2, 0), (4, 0, 0), (0, 0, 3))
    camera = CAMERAS["perspective"]
    snapshot = SceneSnapshot("room", meshes=meshes, materials=(Material("grey"),), camera=camera)
    space = make_local_space(snapshot)
    local = space.scene(snapshot)
    with device.current() as context:
        view = make_view(local.camera, WIDTH, HEIGHT, np.zeros(3))
        kept = Kept(), GpuGeometry(context, local, np.zeros(3)), GBufferPass(context, device.shaders, WIDTH, HEIGHT)
        gbuffer = kept[2].render(kept[1], view, 0)
        octree = scene_octree(context, device.shaders, kept[0], snapshot, 16)
        found = octree_images(octree, view, gbuffer, space, **values)
    return found, octree, space, view


def test_every_level_is_a_picture_over_the_dimmed_surfaces(device):
    found, octree, *_ = images(device)
    assert list(found) == ["octree_level_1", "octree_level_2", "octree_level_4"]
    colors = palette(np.arange(octree.frame.depth + 1))
    for name, image in found.items():
        assert image.shape == (HEIGHT, WIDTH, 3)
        line = (image == colors[int(name[-1])]).all(axis=2)
        assert 50 < line.sum() < 0.7 * line.size
        rest = image[~line]
        assert ((rest == 0.0) | np.isclose(rest, DIMMED * 0.8)).all()


def test_corners_of_the_bricks_are_drawn_where_they_are(device):
    found, octree, space, view = images(device, levels=(2,), through_surfaces=True)
    with device.current():
        cells = octree.trees[0].read().cells(2)
    corners = space.local_points(octree.frame.points(4.0 * cells))
    clip = corners @ view.clip_from_local[:, :3].T + view.clip_from_local[:, 3]
    place = (0.5 + 0.5 * clip[:, :2] / clip[:, 3:]) * (WIDTH, HEIGHT)
    inside = ((place > 1.0) & (place < (WIDTH - 1.0, HEIGHT - 1.0))).all(axis=1)
    columns, rows = np.floor(place[inside]).astype(int).T
    line = (found["octree_level_2"] == palette(np.arange(5))[2]).all(axis=2)
    assert near_to(line)[HEIGHT - 1 - rows, columns].all()
    assert inside.sum() > 5


def test_what_is_behind_a_surface_shows_only_through_it(device):
    before, through = (
        images(device, levels=(2,), through_surfaces=value)[0]["octree_level_2"] for value in (False, True)
    )
    color = palette(np.arange(5))[2]
    shown, all_ = ((image == color).all(axis=2) for image in (before, through))
    assert (all_ | ~shown).all()
    assert all_.sum() > 1.1 * shown.sum()
