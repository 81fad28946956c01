# SPDX-License-Identifier: GPL-3.0-or-later
"""The octree of a scene on the device: static and dynamic objects in trees of their own, each kept until it changes.

Two trees beside each other rather than one that is merged: the static one is never touched, the dynamic one costs what
its own triangles cost, and a walk asks both. Everything visible stands in the way except what is wholly transparent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..core.array_codec import content_hash
from ..core.scene import Float64, Mesh, SceneSnapshot
from ..core.voxel_frame import VoxelFrame, make_voxel_frame
from .growing_buffer import GrowingBuffer
from .kept import Kept
from .local_space import LocalSpace
from .passes.voxelize import GpuTree, VoxelizePass
from .shader_library import ShaderLibrary

if TYPE_CHECKING:
    import moderngl

_KINDS = ("static", "dynamic")


@dataclass(frozen=True)
class SceneOctree:
    """What lib/octree.glsl needs. buffer: for OCTREE_BINDING; frame: in the snapshot's space; trees: one or two in the
    buffer; device_bytes: all that is kept on the device to make it again."""

    buffer: moderngl.Buffer
    frame: VoxelFrame
    trees: tuple[GpuTree, ...]
    device_bytes: int

    def uniform(self, space: LocalSpace) -> tuple[float, float, float, float]:
        """The `frame` of lib/octree.glsl for positions in `space`: the lower corner and voxels for each unit."""
        x, y, z = space.local_points(self.frame.low).tolist()
        return x, y, z, space.unit / self.frame.voxel_size

    def counters(self) -> dict[str, float]:
        """Nodes and bricks of all trees, and megabytes of them and of all that is kept."""
        return {
            "octree_nodes": sum(tree.node_count for tree in self.trees),
            "octree_bricks": sum(tree.brick_count for tree in self.trees),
            "octree_mb": 1e-6 * sum(tree.nbytes for tree in self.trees),
            "octree_device_mb": 1e-6 * self.device_bytes,
        }


class _Builder:
    """The pass and the buffers that trees are built into, again and again."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self.voxelize = VoxelizePass(context, shaders)
        self.buffers = {kind: GrowingBuffer(context, f"the {kind} octree") for kind in (*_KINDS, "joined")}

    @property
    def nbytes(self) -> int:
        """On the device."""
        return self.voxelize.pool.nbytes + sum(buffer.nbytes for buffer in self.buffers.values())


def scene_octree(
    context: moderngl.Context, shaders: ShaderLibrary, kept: Kept, world: SceneSnapshot, resolution: int
) -> SceneOctree:
    """The octree of all visible triangles of `world`, the snapshot in world space: there, nothing moves but objects.

    resolution: one of core.voxel_frame.RESOLUTIONS. Trees whose triangles and frame are as before are not built again.
    Raises InvalidInput for another resolution or bounds that are not finite, DeviceError where it does not fit.
    """
    frame = make_voxel_frame(world.bounds(), resolution)
    builder = kept.get("octree_builder", "", lambda: _Builder(context, shaders))
    opaque = np.array([material.alpha > 0.0 for material in world.materials])
    trees, keys = [], []
    for kind in _KINDS:
        meshes = [mesh for mesh in world.meshes if mesh.dynamic == (kind == "dynamic") and len(mesh.triangles)]
        if not meshes and (kind == "dynamic" or len(world.meshes)):
            continue
        shown = [_opaque_triangles(mesh, opaque) for mesh in meshes]
        key = content_hash(({"frame": frame}, [mesh.positions for mesh in meshes], shown))

        def build(kind: str = kind, meshes: Sequence[Mesh] = meshes, shown: Sequence[np.ndarray] = shown) -> GpuTree:
            places = _places(meshes, shown, frame)
            return builder.voxelize.build(places, frame.depth, builder.buffers[kind])

        trees.append(kept.get(f"{kind}_octree", key, build))
        keys.append(key)
    buffer = trees[0].buffer
    if len(trees) > 1:
        target = builder.buffers["joined"]
        buffer = kept.get("joined_octree", " ".join(keys), lambda: builder.voxelize.join(trees, target))
    return SceneOctree(buffer, frame, tuple(trees), builder.nbytes)


def _opaque_triangles(mesh: Mesh, opaque: np.ndarray) -> np.ndarray:
    return mesh.triangles[opaque[mesh.material_indices]] if len(opaque) else mesh.triangles


def _places(meshes: Sequence[Mesh], shown: Sequence[np.ndarray], frame: VoxelFrame) -> Float64:
    """(t, 3, 3) corners in voxel coordinates; rounding may have moved those on the bounds by a hair, never outside."""
    parts = [frame.voxels(mesh.positions)[triangles] for mesh, triangles in zip(meshes, shown, strict=True)]
    return np.concatenate(parts) if parts else np.zeros((0, 3, 3))
