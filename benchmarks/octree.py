# SPDX-License-Identifier: GPL-3.0-or-later
"""Voxelisation, octree and rays through it, as in the first row of the document's table 5.1.

`./dev bench octree [scene …] [--resolution n …] [--rays n]` prints a table. `numpy ms`: voxel coordinates and what the
shaders get of each triangle; `build ms`: upload, voxels and octree. Both are the best of three runs to the end of all
work; `threads ms`: the same build in the time of all threads, which means the same on a busy machine (on a GPU it means
nothing). Rays go between random points of the surface that face each other, from where lib/octree.glsl lifts them.
`wrongly dark`, `wrongly
lit`: shares of EXACT_RAYS of those pairs where Blender's own rays between the triangles say otherwise.
`document MB`: 16 bytes for each of eight children of every node down to the voxels (seed 004, 3.1), for the same
voxels.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.support import open_sample
from vlm_addon.core.scene import Float32, Float64, SceneSnapshot
from vlm_addon.core.surface_points import random_surface_points
from vlm_addon.core.voxel_frame import VoxelFrame, make_voxel_frame
from vlm_addon.core.voxel_octree import VoxelOctree, codes_of
from vlm_addon.render.device import Device
from vlm_addon.render.growing_buffer import GrowingBuffer
from vlm_addon.render.passes.voxelize import GpuTree, VoxelizePass
from vlm_addon.render.prefix_sum import INVOCATIONS, run_for_each
from vlm_addon.render.shader_library import set_uniforms
from vlm_addon.terminal import table

RAYS_SHADER = "../benchmarks/octree_rays.comp"
_BINDINGS = {"PAIR_BINDING": 0, "RESULT_BINDING": 1, "OCTREE_BINDING": 2}
EXACT_RAYS = 10_000
# Of the length of a way: what is left out at both of its ends, which lie on triangles.
ENDS = 1e-4
SCENES, RESOLUTIONS, RAYS = ("cornell_box", "atrium"), (64, 128, 256), 200_000
REPEATS = 3
# Random points that are tried for one pair that faces each other.
TRIES = 8

DOCUMENT_MS = {("cornell_box", 128): 0.57, ("atrium", 256): 4.65}
"""Seed 004, table 5.1: a GeForce Titan X; its Cornell box has a dragon and an elephant in it (150,000 triangles), its
atrium is Crytek's Sponza (180,000)."""

HEADER = (
    "scene",
    "triangles",
    "resolution",
    "numpy ms",
    "build ms",
    "threads ms",
    "document ms",
    "voxels",
    "nodes",
    "bricks",
    "octree MB",
    "document MB",
    "device MB",
    "rays seen",
    "Mrays/s",
    "Mrays/s a thread",
    "wrongly dark",
    "wrongly lit",
)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--resolution", nargs="+", type=int, default=RESOLUTIONS)
    parser.add_argument("--rays", type=int, default=RAYS)
    options = parser.parse_args()
    rows = []
    with Device() as device, device.current():
        for scene in options.scenes:
            snapshot = open_sample(scene).snapshot
            rows += [row(device, scene, snapshot, resolution, options.rays) for resolution in options.resolution]
        print(device.name)
    print(table(HEADER, rows))


def row(device: Device, scene: str, snapshot: SceneSnapshot, resolution: int, rays: int) -> tuple[str, ...]:
    """One line of the table."""
    frame = make_voxel_frame(snapshot.bounds(), resolution)
    builder, target = VoxelizePass(device.context, device.shaders), GrowingBuffer(device.context, "the octree")
    places, numpy_ms, _ = best(device, lambda: corners(snapshot, frame))
    tree, build_ms, threads_ms = best(device, lambda: builder.build(places, frame.depth, target))
    voxels = tree.read()
    pairs = facing_pairs(snapshot, frame, rays)
    seen, ray_ms, ray_threads_ms = best(device, rays_of(device, tree, pairs))
    exact = exactly_seen(places, pairs[:EXACT_RAYS])
    shown = seen[:EXACT_RAYS]
    document = DOCUMENT_MS.get((scene, resolution))
    return (
        scene,
        f"{len(places):,}",
        f"{resolution}³",
        f"{numpy_ms:.1f}",
        f"{build_ms:.1f}",
        f"{threads_ms:.1f}",
        "" if document is None else f"{document:g}",
        f"{voxels.voxel_count:,}",
        f"{tree.node_count:,}",
        f"{tree.brick_count:,}",
        f"{1e-6 * tree.nbytes:.3f}",
        f"{1e-6 * document_bytes(voxels):.1f}",
        f"{1e-6 * (builder.pool.nbytes + target.nbytes):.1f}",
        f"{seen.mean():.0%}",
        f"{1e-3 * len(seen) / ray_ms:.3g}",
        f"{1e-3 * len(seen) / ray_threads_ms:.3g}",
        f"{(exact & ~shown).mean():.2%}",
        f"{(~exact & shown).mean():.2%}",
    )


def best(device: Device, work: Callable[[], Any]) -> tuple[Any, float, float]:
    """What `work` returns, and the least milliseconds of wall clock and of all threads over REPEATS runs."""
    times = []
    for _ in range(REPEATS):
        device.context.finish()
        wall, threads = time.perf_counter(), time.process_time()
        result = work()
        device.context.finish()
        times.append((1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - threads)))
    walls, all_threads = zip(*times, strict=True)
    return result, min(walls), min(all_threads)


def corners(snapshot: SceneSnapshot, frame: VoxelFrame) -> Float64:
    """(t, 3, 3) corners of all triangles in voxel coordinates."""
    return np.concatenate([frame.voxels(mesh.positions)[mesh.triangles] for mesh in snapshot.meshes])


def facing_pairs(snapshot: SceneSnapshot, frame: VoxelFrame, count: int) -> Float32:
    """(p, 4, 4) float32, p about `count` or less: place, normal, place and normal of random points of the surface that
    face each other."""
    points = random_surface_points(snapshot.meshes, TRIES * count)
    places, normals = frame.voxels(points.positions), points.normals.astype(np.float64)
    half = len(places) // 2
    way = places[half:] - places[:half]
    faces = (np.einsum("ij,ij->i", normals[:half], way) > 0.0) & (np.einsum("ij,ij->i", normals[half:], way) < 0.0)
    rows = np.flatnonzero(faces)[:count]
    pairs = np.zeros((len(rows), 4, 4), np.float32)
    for column, values in enumerate((places[:half], normals[:half], places[half:], normals[half:])):
        pairs[:, column, :3] = values[rows]
    return pairs


def rays_of(device: Device, tree: GpuTree, pairs: Float32) -> Callable[[], np.ndarray]:
    """A function that asks for all pairs, and returns (p,) bool: whether they see each other."""
    context = device.context
    shader = device.shaders.compute(RAYS_SHADER, {**_BINDINGS, "GROUP_SIZE": INVOCATIONS})
    uploaded, results = context.buffer(pairs.tobytes()), context.buffer(reserve=4 * len(pairs))

    def ask() -> np.ndarray:
        for binding, buffer in enumerate((uploaded, results, tree.buffer)):
            buffer.bind_to_storage_buffer(binding)
        set_uniforms(shader, {"count": len(pairs)})
        run_for_each(context, shader, len(pairs))
        return np.frombuffer(results.read(), np.uint32) > 0

    return ask


def exactly_seen(places: Float64, pairs: Float32) -> np.ndarray:
    """(p,) bool: whether no triangle is between the points of each pair."""
    # There as soon as Blender has opened a file.
    from mathutils import Vector
    from mathutils.bvhtree import BVHTree

    tree = BVHTree.FromPolygons(places.reshape(-1, 3).tolist(), np.arange(3 * len(places)).reshape(-1, 3).tolist())
    result = np.zeros(len(pairs), bool)
    for row, pair in enumerate(pairs.astype(float)):
        start, way = Vector(pair[0, :3]), Vector(pair[2, :3] - pair[0, :3])
        result[row] = tree.ray_cast(start + ENDS * way, way, (1.0 - 2.0 * ENDS) * way.length)[0] is None
    return result


def document_bytes(tree: VoxelOctree) -> int:
    """Of the same voxels in the document's layout."""
    codes = codes_of(tree.voxels())
    parents = 0
    for _ in range(tree.depth):
        codes = np.unique(codes >> 3)
        parents += len(codes)
    return 8 * 16 * parents + 16


if __name__ == "__main__":
    main()
