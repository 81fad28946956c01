# SPDX-License-Identifier: GPL-3.0-or-later
"""The octree of a scene on the device and the triangles behind its voxels: static and dynamic objects in trees of their
own, each kept until it changes.

Two trees beside each other rather than one that is merged: the static one is never touched, the dynamic one costs what
its own triangles cost, and a walk asks both. Everything visible stands in the way except what is wholly transparent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..core.scene import Float32, Float64, Mesh, SceneSnapshot
from ..core.voxel_fit import MOST_IN_A_VOXEL, fitting_resolution
from ..core.voxel_frame import VoxelFrame, make_voxel_frame
from .growing_buffer import GrowingBuffer
from .kept import Kept
from .local_space import LocalSpace
from .passes.voxel_lists import GpuVoxelLists
from .passes.voxelize import GpuTree, VoxelizePass
from .shader_library import ShaderLibrary

if TYPE_CHECKING:
    import moderngl

_KINDS = ("static", "dynamic")


@dataclass(frozen=True)
class SceneOctree:
    """What lib/octree.glsl and lib/octree_triangles.glsl need. buffer: for OCTREE_BINDING; triangles: for
    OCTREE_TRIANGLE_BINDING; frame: in the snapshot's space; trees, lists: one or two in the buffers; device_bytes: all
    that is kept on the device to make it again."""

    buffer: moderngl.Buffer
    triangles: moderngl.Buffer
    frame: VoxelFrame
    trees: tuple[GpuTree, ...]
    lists: tuple[GpuVoxelLists, ...]
    device_bytes: int

    def bind(self, octree_binding: int, triangle_binding: int) -> None:
        """Binds the octree, and the triangles of its voxels."""
        self.buffer.bind_to_storage_buffer(octree_binding)
        self.triangles.bind_to_storage_buffer(triangle_binding)

    def uniform(self, space: LocalSpace) -> tuple[float, float, float, float]:
        """The `frame` of lib/octree.glsl for positions in `space`: the lower corner and voxels for each unit."""
        x, y, z = space.local_points(self.frame.low).tolist()
        return x, y, z, space.unit / self.frame.voxel_size

    def counters(self) -> dict[str, float]:
        """Nodes and bricks of all trees, and megabytes of them, of their triangles and of all that is kept."""
        return {
            "octree_nodes": sum(tree.node_count for tree in self.trees),
            "octree_bricks": sum(tree.brick_count for tree in self.trees),
            "octree_mb": 1e-6 * sum(tree.nbytes for tree in self.trees),
            "octree_triangle_mb": 1e-6 * sum(lists.nbytes for lists in self.lists),
            "octree_device_mb": 1e-6 * self.device_bytes,
        }


class _Builder:
    """The pass and the buffers that trees are built into, again and again."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self.voxelize = VoxelizePass(context, shaders)
        kinds = (*_KINDS, "joined")
        self.trees = {kind: GrowingBuffer(context, f"the {kind} octree") for kind in kinds}
        self.lists = {kind: GrowingBuffer(context, f"the triangles of the {kind} octree") for kind in kinds}

    @property
    def nbytes(self) -> int:
        """On the device."""
        buffers = (*self.trees.values(), *self.lists.values())
        return self.voxelize.pool.nbytes + sum(buffer.nbytes for buffer in buffers)

    def build(self, kind: str, places: Float64, reflectance: Float32, depth: int) -> tuple[GpuTree, GpuVoxelLists]:
        """The tree of a kind of objects and the triangles of its voxels."""
        return self.voxelize.build_with_lists(places, reflectance, depth, self.trees[kind], self.lists[kind])

    def joined(self, built: Sequence[tuple[GpuTree, GpuVoxelLists]]) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        """Buffers of all trees, and of the triangles of their voxels."""
        trees = self.voxelize.join([tree for tree, _ in built], self.trees["joined"])
        return trees, self.voxelize.join_lists([lists for _, lists in built], self.lists["joined"])


def scene_octree(
    context: moderngl.Context, shaders: ShaderLibrary, kept: Kept, world: SceneSnapshot, resolution: int
) -> SceneOctree:
    """The octree of all visible triangles of `world`, the snapshot in world space: there, nothing moves but objects.

    resolution: one of core.voxel_frame.RESOLUTIONS. Trees whose triangles and frame are as before are not built again.
    Raises InvalidInput for another resolution or bounds that are not finite, DeviceError where it does not fit.
    """
    frame = make_voxel_frame(world.bounds(), resolution)
    builder = kept.hold("octree_builder", lambda: _Builder(context, shaders))
    opaque = np.array([material.alpha > 0.0 for material in world.materials])
    built, keys = [], []
    for kind in _KINDS:
        meshes = [mesh for mesh in world.meshes if mesh.dynamic == (kind == "dynamic") and len(mesh.triangles)]
        if not meshes and (kind == "dynamic" or any(len(mesh.triangles) for mesh in world.meshes)):
            continue
        shown = [_opaque(mesh, opaque) for mesh in meshes]
        reflectance = [mesh.reflectance[rows] for mesh, rows in zip(meshes, shown, strict=True)]
        triangles = [mesh.triangles[rows] for mesh, rows in zip(meshes, shown, strict=True)]
        stands = [[mesh.positions, mesh.triangles, mesh.material_indices, mesh.reflectance] for mesh in meshes]
        key = kept.digests.of(frame, stands, opaque)

        def build(
            kind: str = kind,
            meshes: Sequence[Mesh] = meshes,
            triangles: Sequence[np.ndarray] = triangles,
            reflectance: Sequence[Float32] = reflectance,
        ) -> tuple[GpuTree, GpuVoxelLists]:
            colours = np.concatenate([np.zeros((0, 3), np.float32), *reflectance])
            return builder.build(kind, _places(meshes, triangles, frame), colours, frame.depth)

        built.append(kept.get(f"{kind}_octree", key, build))
        keys.append(key)
    buffers = built[0][0].buffer, built[0][1].buffer
    if len(built) > 1:
        buffers = kept.get("joined_octree", " ".join(keys), lambda: builder.joined(built))
    trees, lists = zip(*built, strict=True)
    return SceneOctree(*buffers, frame, trees, lists, builder.nbytes)


def fitted_octree(
    context: moderngl.Context, shaders: ShaderLibrary, kept: Kept, world: SceneSnapshot, resolution: int
) -> SceneOctree:
    """`scene_octree` with the `needed_resolution`. Raises as that."""
    return scene_octree(context, shaders, kept, world, needed_resolution(kept, world, resolution))


def needed_resolution(kept: Kept, world: SceneSnapshot, resolution: int) -> int:
    """What core.voxel_fit finds from `resolution` on. Raises InvalidInput as that."""
    meshes, bounds = world.meshes, world.bounds()
    key = kept.digests.of(resolution, bounds, [[mesh.positions, mesh.triangles] for mesh in meshes])
    return kept.get("octree_resolution", key, lambda: fitting_resolution(meshes, bounds, resolution))


def finer_text(octree: SceneOctree, resolution: int) -> str:
    """Why the voxels are finer than the `resolution` asked for; "" if they are not."""
    if octree.frame.resolution == resolution:
        return ""
    return (
        f"the octree has {octree.frame.resolution:,} voxels along an axis in place of {resolution}: "
        f"over {MOST_IN_A_VOXEL} triangles would share one of them"
    )


def _opaque(mesh: Mesh, opaque: np.ndarray) -> np.ndarray:
    """(t,) which triangles stand in the way."""
    return opaque[mesh.material_indices] if len(opaque) else np.ones(len(mesh.triangles), bool)


def _places(meshes: Sequence[Mesh], triangles: Sequence[np.ndarray], frame: VoxelFrame) -> Float64:
    """(t, 3, 3) corners in voxel coordinates; rounding may have moved those on the bounds by a hair, never outside."""
    parts = [frame.voxels(mesh.positions)[shown] for mesh, shown in zip(meshes, triangles, strict=True)]
    return np.concatenate(parts) if parts else np.zeros((0, 3, 3))
