# SPDX-License-Identifier: GPL-3.0-or-later
"""Tangents of corners for tangent-space normal maps."""

from __future__ import annotations

import numpy as np

from ..core.scene import Float32, Float64, Mesh


def corner_tangents(mesh: Mesh, wanted: np.ndarray) -> Float32:
    """(t, 3, 4) float32: unit tangent along growing u, and the sign of the bitangent; zero where not `wanted`.

    A triangle's tangent is projected into each corner's normal plane and averaged, weighted by the corner's angle,
    over the corners that share position, normal, uv and orientation, as Mikkelsen's tangent space does.
    """
    result = np.zeros((len(mesh.triangles), 3, 4), np.float32)
    rows = np.flatnonzero(wanted)
    if len(rows) == 0:
        return result
    corners = mesh.positions[mesh.triangles[rows]]
    uvs = mesh.corner_uvs[rows].astype(np.float64)
    normals = mesh.corner_normals[rows].astype(np.float64)
    tangents, signs = _triangle_tangents(corners, uvs)
    projected = tangents[:, None] - normals * np.sum(tangents[:, None] * normals, axis=2, keepdims=True)
    weighted = _normalized(projected) * _corner_angles(corners)[:, :, None]

    keys = np.concatenate(
        [
            mesh.triangles[rows].reshape(-1, 1),
            mesh.corner_normals[rows].reshape(-1, 3).view(np.int32),
            mesh.corner_uvs[rows].reshape(-1, 2).view(np.int32),
            np.repeat(signs, 3).astype(np.int32)[:, None],
        ],
        axis=1,
    )
    _, group = np.unique(keys, axis=0, return_inverse=True)
    sums = np.zeros((group.max() + 1, 3))
    np.add.at(sums, group.ravel(), weighted.reshape(-1, 3))
    result[rows, :, :3] = _normalized(sums)[group.ravel()].reshape(-1, 3, 3)
    result[rows, :, 3] = signs[:, None]
    return result


def _triangle_tangents(corners: Float64, uvs: Float64) -> tuple[Float64, Float64]:
    """(t, 3) direction of growing u, not of unit length, and (t,) orientation of the uv triangle, +1 or -1."""
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (du1, dv1), (du2, dv2) = (uvs[:, 1] - uvs[:, 0]).T, (uvs[:, 2] - uvs[:, 0]).T
    signs = np.where(du1 * dv2 - du2 * dv1 < 0.0, -1.0, 1.0)
    return signs[:, None] * (edge1 * dv2[:, None] - edge2 * dv1[:, None]), signs


def _corner_angles(corners: Float64) -> Float64:
    following = _normalized(np.roll(corners, -1, axis=1) - corners)
    preceding = _normalized(np.roll(corners, 1, axis=1) - corners)
    return np.arccos(np.clip(np.sum(following * preceding, axis=2), -1.0, 1.0))


def _normalized(vectors: Float64) -> Float64:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)
