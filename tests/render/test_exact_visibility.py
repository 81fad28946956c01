# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact ways from where pixels show surfaces: positions and normals as float32 G-buffers of local space have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.octree_rays import BINDING, TRIANGLE_BINDING, ask_exact
from tests.render.rooms import camera_at, quad
from tests.voxel_scenes import crossings, torus
from vlm_addon.core.brick_triangles import LIFT_SHARE
from vlm_addon.core.scene import Material, SceneSnapshot
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import make_local_space
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.scene_octree import scene_octree
from vlm_addon.render.view import make_view

WIDTH, HEIGHT = 56, 40
SIDES = (16, 8)


def ring(offset, size):
    """A ring on the floor as one mesh."""
    corners = (torus(0, sides=SIDES) - 0.5) * 2.0 * size + np.array(offset) + (0.0, 0.0, 0.6 * size)
    template = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    count = len(corners)

    def repeated(values, shape):
        return np.broadcast_to(values[:1], (count, *shape)).copy()

    return replace(
        template,
        positions=corners.reshape(-1, 3),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        corner_normals=repeated(template.corner_normals, (3, 3)),
        corner_uvs=repeated(template.corner_uvs, (3, 2)),
        material_indices=np.zeros(count, np.int32),
        tag_ids=np.zeros(count, np.int32),
        reflectance=repeated(template.reflectance, (3,)),
        emission=repeated(template.emission, (3,)),
    )


def room(offset, size):
    """A slanted floor, a wall and a ring, seen from above."""
    x, y, z = offset
    floor = quad((x - 2 * size, y - 2 * size, z), (4 * size, 0, 0.3 * size), (0, 4 * size, 0))
    wall = quad((x - 2 * size, y + 2 * size, z), (4 * size, 0, 0), (0, 0, 3 * size))
    camera = camera_at((x + size, y - 4 * size, z + 3 * size), (x, y, z + 0.3 * size), clip_end=100.0 * size)
    camera = replace(camera, clip_start=0.01 * size)
    return SceneSnapshot("room", meshes=(floor, wall, ring(offset, size)), materials=(Material("grey"),), camera=camera)


@pytest.fixture(params=[((0.0, 0.0, 0.0), 1.0), ((8000.0, -3000.0, 5000.0), 1.0), ((0.0, 0.0, 0.0), 1e-3)])
def seen(request, device):
    """(n, 3) positions and geometric normals of pixels in local space, the octree's uniform, and all triangles in voxel
    coordinates; the octree is bound."""
    snapshot = room(*request.param)
    space = make_local_space(snapshot)
    local = space.scene(snapshot)
    with device.current() as context:
        view = make_view(local.camera, WIDTH, HEIGHT, np.zeros(3))
        kept = Kept(), GpuGeometry(context, local, np.zeros(3)), GBufferPass(context, device.shaders, WIDTH, HEIGHT)
        gbuffer = kept[2].render(kept[1], view, 0)
        octree = scene_octree(context, device.shaders, kept[0], snapshot, 128)
        octree.bind(BINDING, TRIANGLE_BINDING)
        position, normal = (read_image(image)[..., :3] for image in (gbuffer.position, gbuffer.geometric_normal))
    shown = normal.any(axis=2)
    triangles = np.concatenate([octree.frame.voxels(mesh.positions)[mesh.triangles] for mesh in snapshot.meshes])
    frame = "vec4(" + ", ".join(repr(value) for value in octree.uniform(space)) + ")"
    yield position[shown], normal[shown], frame, triangles
    del kept


def heights(places, normals, triangles):
    """How far (n, 3) places are over the nearest triangle below them."""
    above = places + 0.5 * normals
    fractions = crossings(above, places - 0.5 * normals, triangles)[0]
    return fractions - 0.5


def test_positions_lie_within_an_eighth_of_the_lift_of_the_surface(device, seen):
    position, normal, frame, triangles = seen
    places = ask_exact(device, f"octree_place(p, {frame})", {"p": position}, 3).astype(float)
    found = np.abs(heights(places, normal.astype(float), triangles))
    assert len(found) > 1000
    # A pixel on an outline may be measured to what lies behind it.
    assert (found > LIFT_SHARE * 128.0 / 8.0).mean() <= 2e-3


@pytest.mark.parametrize("steepest", [1.0, 0.02])
def test_pixels_do_not_shadow_themselves_and_see_what_is_near(device, seen, steepest):
    """First hits along ways at any and at low angles: those of all triangles from the same place, also near ones."""
    position, normal, frame, triangles = seen
    rng = np.random.default_rng(0)
    along = rng.normal(size=normal.shape)
    along -= (along * normal).sum(axis=1, keepdims=True) * normal
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    sine = rng.uniform(0.0, steepest, (len(normal), 1))
    way = (np.sqrt(1.0 - sine**2) * along + sine * normal).astype(np.float32)
    inputs = {"p": position, "n": normal, "d": way}
    hit = f"octree_first_hit(octree_place(p, {frame}), n, d)"
    found = ask_exact(device, f"{hit}.found ? {hit}.distance : 1e9", inputs)
    places = ask_exact(device, f"octree_place(p, {frame})", {"p": position}, 3).astype(float)
    starts = places + LIFT_SHARE * 128.0 * normal.astype(float)
    fractions = crossings(starts, starts + 300.0 * way.astype(float), triangles)[0]
    exact = np.where(np.isinf(fractions), 1e9, 300.0 * fractions)
    assert (np.abs(found - exact) > 0.01 * np.maximum(exact, 1.0)).mean() <= 1e-3
    assert 0.02 < (exact < 1e9).mean() < 0.98
