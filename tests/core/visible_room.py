# SPDX-License-Identifier: GPL-3.0-or-later
"""A room with a block in it, what of it is baked, and rays between its triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.render.closed_rooms import inward_box
from tests.render.rooms import lights_from_triangles, split
from vlm_addon.core.baked_visibility import (
    FULL,
    GRAZING,
    UNFACED,
    BakedVisibility,
    make_baked,
    sample_numbers,
    visibility_frame,
)
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.octree_march import reaches
from vlm_addon.core.scene import DIFFUSE, Float64, Material, SceneSnapshot
from vlm_addon.core.triangle_tree import TriangleTree, build_tree
from vlm_addon.core.visibility_cells import VisibilityCells, make_cells
from vlm_addon.core.visibility_rows import VisibilityRows, make_rows, opaque_corners
from vlm_addon.core.voxel_frame import VoxelFrame
from vlm_addon.core.voxel_octree import build_octree

OFF_SURFACE = 1e-3
"""How far rays begin and end off their surfaces, in voxels."""


def block_room() -> SceneSnapshot:
    """A closed room of 2 m and a block in the air."""
    walls = inward_box((0, 0, 0), (2, 2, 2), [0] * 6)
    block = inward_box((0.7, 0.75, 0.3), (1.3, 1.2, 0.8), [0] * 6, outward=True)
    return SceneSnapshot("block room", tuple(walls + block), (Material("white", DIFFUSE, (0.8, 0.8, 0.8)),))


def surface_lights(snapshot: SceneSnapshot, times: int) -> VirtualLightMesh:
    """All of its surface, each triangle cut in 4^times, with four samples each."""
    corners = split(np.concatenate([mesh.positions[mesh.triangles] for mesh in snapshot.meshes]), times)
    lights = lights_from_triangles(corners, emission=0.0, colour=0.6)
    return with_samples(lights, corners)


def with_samples(lights: VirtualLightMesh, corners: Float64) -> VirtualLightMesh:
    """Lights that are measured at the middles of four parts of (n, 3, 3) corners."""
    parts = split(corners, 1).reshape(4, len(corners), 3, 3).mean(axis=2).transpose(1, 0, 2)
    samples = replace(
        lights.samples,
        positions=np.ascontiguousarray(parts.reshape(-1, 3)),
        normals=np.repeat(lights.samples.normals, 4, axis=0),
        weights=np.full(4 * len(corners), 0.25, np.float32),
        offsets=np.arange(0, 4 * len(corners) + 1, 4, dtype=np.int32),
    )
    return replace(lights, samples=samples)


def are_open(tree: TriangleTree, places: Float64, normals: Float64) -> np.ndarray:
    """core.visibility_rows.IsOpen by rays between triangles."""
    over = places + normals * reaches(normals)[:, None]
    return np.isinf(tree.first_hits(places + OFF_SURFACE * normals, over))


def host_rows(snapshot: SceneSnapshot, cells: int, points: int) -> tuple[VoxelFrame, VisibilityCells, VisibilityRows]:
    frame = visibility_frame(snapshot, cells)
    corners = opaque_corners(snapshot, frame)
    tree = build_tree(corners)
    air = make_cells(build_octree(corners, frame.depth).voxels(), frame.resolution)
    return frame, air, make_rows(snapshot, frame, air, points, lambda *way: are_open(tree, *way))


def exact_shares(
    snapshot: SceneSnapshot,
    frame: VoxelFrame,
    rows: VisibilityRows,
    lights: VirtualLightMesh,
    chosen_rows: np.ndarray,
    chosen_lights: np.ndarray,
) -> np.ndarray:
    """(k,) bytes of pairs of a row and a light, by rays between triangles in float64."""
    tree = build_tree(opaque_corners(snapshot, frame))
    offsets = lights.samples.offsets.astype(np.int64)
    counts = (offsets[1:] - offsets[:-1])[chosen_lights]
    points = np.arange(rows.places.shape[1])
    samples = offsets[chosen_lights][:, None] + sample_numbers(chosen_rows[:, None], points, counts[:, None])
    start, normal = rows.places[chosen_rows], rows.normals[chosen_rows]
    end = frame.voxels(lights.samples.positions)[samples]
    end_normal = lights.samples.normals[samples].astype(float)
    way = end - start
    least = GRAZING * np.maximum(np.linalg.norm(way, axis=2), 1.0)
    facing = ((way * normal).sum(2) > least) & ((way * end_normal).sum(2) < -least)
    begins, ends = start + OFF_SURFACE * normal, end + OFF_SURFACE * end_normal
    hits = tree.first_hits(begins.reshape(-1, 3), ends.reshape(-1, 3)).reshape(facing.shape)
    seen = (np.isinf(hits) & facing).sum(axis=1)
    return np.where(facing.any(axis=1), np.floor(FULL * seen / np.maximum(facing.sum(axis=1), 1) + 0.5), UNFACED)


def host_bake(snapshot: SceneSnapshot, lights: VirtualLightMesh, cells: int = 4, points: int = 4) -> BakedVisibility:
    """All of it in numpy."""
    frame, air, rows = host_rows(snapshot, cells, points)
    pairs = np.indices((len(rows), len(lights))).reshape(2, -1)
    shares = exact_shares(snapshot, frame, rows, lights, *pairs).reshape(len(rows), len(lights))
    return make_baked(frame, air, rows, shares.astype(np.uint8), "made by hand")
