# SPDX-License-Identifier: GPL-3.0-or-later
"""Voxelisation, octree and rays through it, as in the first row of the document's table 5.1.

`./dev bench octree [scene …] [--resolution n …] [--reach n …] [--rays n]` prints two tables.

Builds: `numpy ms`: voxel coordinates and what the shaders get of each triangle; `build ms`: upload, voxels and octree;
`exact ms`: that and the triangles of each voxel. All are the best of three runs to the end of all work; `threads ms`:
of `build ms`, the time of all threads, which means the same on a busy machine (on a GPU it means nothing).
`document MB`: 16 bytes for each of eight children of every node down to the voxels (seed 004, 3.1), for the same
voxels.

Rays between random points of the surface that face each other. `reach`: within so many voxels of either end triangles
are asked, farther away voxels block (octree_points_see); 0: voxels alone, from where lib/octree.glsl lifts the ends.
`wrongly dark`, `wrongly lit`: shares of EXACT_RAYS of those pairs where Blender's own rays between the triangles say
otherwise. `first hit`: as many rays into random directions of the hemispheres; their two columns are the shares of
EXACT_RAYS that hit nothing, or another place than Blender's by more than HIT_TOLERANCE, and that hit where Blender's
do not.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.support import open_sample
from vlm_addon.core.brick_triangles import ALL_EXACT, LIFT_SHARE
from vlm_addon.core.octree_march import FAR_OUTSIDE
from vlm_addon.core.scene import Float32, Float64, SceneSnapshot
from vlm_addon.core.surface_points import random_surface_points
from vlm_addon.core.voxel_frame import VoxelFrame, make_voxel_frame
from vlm_addon.core.voxel_octree import Bools, VoxelOctree, codes_of
from vlm_addon.render.device import Device
from vlm_addon.render.growing_buffer import GrowingBuffer
from vlm_addon.render.passes.voxel_lists import GpuVoxelLists
from vlm_addon.render.passes.voxelize import GpuTree, VoxelizePass
from vlm_addon.render.prefix_sum import INVOCATIONS, run_for_each
from vlm_addon.render.shader_library import set_uniforms
from vlm_addon.terminal import table

RAYS_SHADER = "../benchmarks/octree_rays.comp"
_BINDINGS = {"PAIR_BINDING": 0, "RESULT_BINDING": 1, "OCTREE_BINDING": 2, "OCTREE_TRIANGLE_BINDING": 3}
EXACT_RAYS = 10_000
# Voxels.
HIT_TOLERANCE = 0.01
# Of the length of a way: what is left out at both of its ends, which lie on triangles.
ENDS = 1e-4
# The cosine from which on two points face each other: those of one plane do so by nothing but rounding.
GRAZING = 1e-3
SCENES, RESOLUTIONS, RAYS = ("cornell_box", "atrium"), (64, 128, 256), 200_000
REACHES = (0, 1, 2, 4, ALL_EXACT)
REPEATS = 3
# Random points that are tried for one pair that faces each other.
TRIES = 8

DOCUMENT_MS = {("cornell_box", 128): 0.57, ("atrium", 256): 4.65}
"""Seed 004, table 5.1: a GeForce Titan X; its Cornell box has a dragon and an elephant in it (150,000 triangles), its
atrium is Crytek's Sponza (180,000)."""

BUILD_HEADER = (
    "scene",
    "triangles",
    "resolution",
    "numpy ms",
    "build ms",
    "threads ms",
    "document ms",
    "exact ms",
    "voxels",
    "nodes",
    "bricks",
    "pairs",
    "octree MB",
    "document MB",
    "triangle MB",
    "device MB",
)
RAY_HEADER = ("scene", "resolution", "reach", "rays seen", "Mrays/s", "Mrays/s a thread", "wrongly dark", "wrongly lit")
Built = tuple[GpuTree, GpuVoxelLists]


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--resolution", nargs="+", type=int, default=RESOLUTIONS)
    parser.add_argument("--reach", nargs="+", type=int, default=REACHES)
    parser.add_argument("--rays", type=int, default=RAYS)
    options = parser.parse_args()
    builds, rays = [], []
    with Device() as device, device.current():
        for scene in options.scenes:
            snapshot = open_sample(scene).snapshot
            for resolution in options.resolution:
                frame = make_voxel_frame(snapshot.bounds(), resolution)
                row, built = build_row(device, scene, snapshot, frame)
                builds.append(row)
                start = (scene, f"{resolution}³")
                rays += [
                    (*start, *row) for row in ray_rows(device, built, snapshot, frame, options.reach, options.rays)
                ]
        print(device.name)
    print(table(BUILD_HEADER, builds))
    print(table(RAY_HEADER, rays))


def build_row(device: Device, scene: str, snapshot: SceneSnapshot, frame: VoxelFrame) -> tuple[tuple[str, ...], Built]:
    """One line of the first table, and what has been built."""
    builder = VoxelizePass(device.context, device.shaders)
    target, list_target = (GrowingBuffer(device.context, name) for name in ("the octree", "its triangles"))
    places, numpy_ms, _ = best(device, lambda: corners(snapshot, frame))
    reflectance = np.concatenate([mesh.reflectance for mesh in snapshot.meshes])
    _, build_ms, threads_ms = best(device, lambda: builder.build(places, frame.depth, target))
    built, exact_ms, _ = best(
        device, lambda: builder.build_with_lists(places, reflectance, frame.depth, target, list_target)
    )
    tree, lists = built
    voxels = tree.read()
    document = DOCUMENT_MS.get((scene, frame.resolution))
    row = (
        scene,
        f"{len(places):,}",
        f"{frame.resolution}³",
        f"{numpy_ms:.1f}",
        f"{build_ms:.1f}",
        f"{threads_ms:.1f}",
        "" if document is None else f"{document:g}",
        f"{exact_ms:.1f}",
        f"{voxels.voxel_count:,}",
        f"{tree.node_count:,}",
        f"{tree.brick_count:,}",
        f"{lists.pair_count:,}",
        f"{1e-6 * tree.nbytes:.3f}",
        f"{1e-6 * document_bytes(voxels):.1f}",
        f"{1e-6 * lists.nbytes:.3f}",
        f"{1e-6 * (builder.pool.nbytes + target.nbytes + list_target.nbytes):.1f}",
    )
    return row, built


def ray_rows(
    device: Device, built: Built, snapshot: SceneSnapshot, frame: VoxelFrame, reaches: Sequence[int], count: int
) -> list[tuple[str, ...]]:
    """The lines of the second table for one octree, but for the scene and the resolution."""
    caster = Caster(corners(snapshot, frame))
    pairs = facing_pairs(snapshot, frame, count)
    exact = caster.seen(pairs[:EXACT_RAYS])
    rows = []
    for reach in reaches:
        seen, *times = best(device, rays_of(device, built, pairs, {"REACH": reach}))
        seen = seen[:, 0] > 0.0
        shown = seen[:EXACT_RAYS]
        shares = (exact & ~shown).mean(), (~exact & shown).mean()
        rows.append(ray_row("all" if reach == ALL_EXACT else str(reach), seen, times, shares))
    ways = random_ways(pairs)
    hits, *times = best(device, rays_of(device, built, ways, {"FIRST_HIT": True}))
    shares = differences(hits[:EXACT_RAYS], caster.first_hits(ways[:EXACT_RAYS], LIFT_SHARE * frame.resolution))
    return [*rows, ray_row("first hit", hits[:, 3] == 0.0, times, shares)]


def ray_row(name: str, seen: Bools, times: Sequence[float], shares: tuple[float, float]) -> tuple[str, ...]:
    """One line of the second table."""
    rates = (f"{1e-3 * len(seen) / ms:.3g}" for ms in times)
    return name, f"{seen.mean():.0%}", *rates, *(f"{share:.2%}" for share in shares)


def differences(hits: Float32, exact: Float32) -> tuple[float, float]:
    """Shares of ways whose first hit is missing or elsewhere, and that hit what is not there. (n, 4): place, found."""
    found, there = hits[:, 3] > 0.0, exact[:, 3] > 0.0
    elsewhere = np.linalg.norm(hits[:, :3] - exact[:, :3], axis=1) > HIT_TOLERANCE
    return float((there & (~found | elsewhere)).mean()), float((found & ~there).mean())


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
    least = GRAZING * np.linalg.norm(way, axis=1)
    towards, back = (np.einsum("ij,ij->i", side, way) for side in (normals[:half], normals[half:]))
    faces = (towards > least) & (back < -least)
    rows = np.flatnonzero(faces)[:count]
    pairs = np.zeros((len(rows), 4, 4), np.float32)
    for column, values in enumerate((places[:half], normals[:half], places[half:], normals[half:])):
        pairs[:, column, :3] = values[rows]
    return pairs


def random_ways(pairs: Float32) -> Float32:
    """As many ways from the first points of `pairs` evenly into the hemispheres: in the third column, a direction."""
    directions = np.random.default_rng(0).normal(size=(len(pairs), 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions *= np.sign(np.einsum("ij,ij->i", directions, pairs[:, 1, :3]))[:, None]
    ways = pairs.copy()
    ways[:, 2, :3] = directions
    return ways


def rays_of(device: Device, built: Built, pairs: Float32, defines: Mapping[str, int | bool]) -> Callable[[], Float32]:
    """A function that asks for all pairs, and returns (p, 4): what octree_rays.comp says."""
    context = device.context
    shader = device.shaders.compute(
        RAYS_SHADER, {**_BINDINGS, "GROUP_SIZE": INVOCATIONS, "REACH": 0, "FIRST_HIT": False, **defines}
    )
    uploaded, results = context.buffer(pairs.tobytes()), context.buffer(reserve=16 * len(pairs))

    def ask() -> Float32:
        for binding, buffer in enumerate((uploaded, results, built[0].buffer, built[1].buffer)):
            buffer.bind_to_storage_buffer(binding)
        set_uniforms(shader, {"count": len(pairs)})
        run_for_each(context, shader, len(pairs))
        return np.frombuffer(results.read(), np.float32).reshape(-1, 4)

    return ask


class Caster:
    """Blender's own rays between (t, 3, 3) triangles."""

    def __init__(self, places: Float64) -> None:
        # There as soon as Blender has opened a file.
        from mathutils.bvhtree import BVHTree

        rows = np.arange(3 * len(places)).reshape(-1, 3)
        self._tree = BVHTree.FromPolygons(places.reshape(-1, 3).tolist(), rows.tolist())

    def seen(self, pairs: Float32) -> Bools:
        """(p,) whether no triangle is between the points of each pair."""
        ways = (pairs[:, 2, :3] - pairs[:, 0, :3]).astype(float)
        starts = pairs[:, 0, :3] + ENDS * ways
        lengths = (1.0 - 2.0 * ENDS) * np.linalg.norm(ways, axis=1)
        return np.array([self._cast(*ray)[0] is None for ray in zip(starts, ways, lengths, strict=True)])

    def first_hits(self, ways: Float32, lift: float) -> Float32:
        """(p, 4): places of the first triangles along ways that begin by `lift` over one, and 1; zeros where none."""
        result = np.zeros((len(ways), 4), np.float32)
        starts = ways[:, 0, :3] + lift * ways[:, 1, :3]
        for row, (start, along) in enumerate(zip(starts.astype(float), ways[:, 2, :3].astype(float), strict=True)):
            place = self._cast(start, along, float(FAR_OUTSIDE))[0]
            if place is not None:
                result[row] = (*place, 1.0)
        return result

    def _cast(self, start: Float64, along: Float64, length: float) -> tuple[Any, ...]:
        from mathutils import Vector

        hit: tuple[Any, ...] = self._tree.ray_cast(Vector(start), Vector(along), length)
        return hit


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
