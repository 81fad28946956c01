# SPDX-License-Identifier: GPL-3.0-or-later
"""The corners of a scene's triangles, those that are alike taken together, for light that is computed at corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import DeviceError
from ..core.scene import Float32, Float64, Int32, Mesh
from .digests import Digests

if TYPE_CHECKING:
    import moderngl


BYTES_PER_CORNER = 48
"""Of what a corner receives: three vec4."""


@dataclass(frozen=True)
class Corners:
    """Corners that differ in vertex, normal or material. vertices: (n,) of all meshes' vertices in order. normals:
    (n, 3). materials: (n,). faces: (t, 4) corners of each triangle of the snapshot in order; the last column is 0."""

    vertices: Int32
    normals: Float32
    materials: Int32
    faces: Int32


def corners_key(meshes: Sequence[Mesh], digests: Digests) -> str:
    """A hash of all that `find_corners` reads: not of where vertices are."""
    return digests.of([[mesh.triangles, mesh.corner_normals, mesh.material_indices] for mesh in meshes])


def find_corners(meshes: Sequence[Mesh]) -> Corners:
    """The corners of the meshes that have triangles."""
    filled = [mesh for mesh in meshes if len(mesh.triangles)]
    rows, start = [np.zeros((0, 5), np.int32)], 0
    for mesh in filled:
        row = np.empty((3 * len(mesh.triangles), 5), np.int32)
        row[:, 0] = mesh.triangles.ravel() + start
        row[:, 1:4] = np.ascontiguousarray(mesh.corner_normals, np.float32).reshape(-1, 3).view(np.int32)
        row[:, 4] = np.repeat(mesh.material_indices, 3)
        rows.append(row)
        start += len(mesh.positions)
    together = np.concatenate(rows)
    _, first, index = np.unique(
        together.view(f"V{together.strides[0]}").ravel(), return_index=True, return_inverse=True
    )
    faces = np.zeros((len(together) // 3, 4), np.int32)
    faces[:, :3] = index.reshape(-1, 3)
    found = together[first]
    normals = np.ascontiguousarray(found[:, 1:4]).view(np.float32)
    return Corners(found[:, 0].copy(), normals, found[:, 4].copy(), faces)


class GpuCorners:
    """Corners in storage buffers. count: how many. points: two vec4 each, position (m from `origin`) and material,
    normal. faces: ivec4 of each triangle by its face id."""

    def __init__(self, context: moderngl.Context, corners: Corners, meshes: Sequence[Mesh], origin: Float64) -> None:
        self.count = len(corners.vertices)
        limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        if max(BYTES_PER_CORNER * self.count, corners.faces.nbytes) > limit:
            raise DeviceError(
                f"{self.count:,} corners do not fit the device's blocks of {limit:,} bytes; compute light at pixels"
            )
        positions = [mesh.positions for mesh in meshes if len(mesh.triangles)]
        points = np.zeros((max(self.count, 1), 8), np.float32)
        if self.count:
            points[:, :3] = np.concatenate(positions)[corners.vertices] - origin
            points[:, 3] = corners.materials
            points[:, 4:7] = corners.normals
        self.points = context.buffer(points.tobytes())
        self.faces = context.buffer(corners.faces.tobytes() or bytes(16))
