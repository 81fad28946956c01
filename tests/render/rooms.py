# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes built from code."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh
from vlm_addon.core.scene import DIFFUSE, POINT, UNTAGGED, Camera, Float64, Light, Material, Mesh, SceneSnapshot

Vector = Sequence[float]


def quad(corner: Vector, u: Vector, v: Vector, material: int = 0, tag_id: int = UNTAGGED, name: str = "quad") -> Mesh:
    """Two triangles from `corner` along u and v, facing u x v; uv runs from 0 to 1."""
    o, u_axis, v_axis = (np.asarray(a, float) for a in (corner, u, v))
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    normal = np.cross(u_axis, v_axis)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return Mesh(
        name=name,
        positions=np.array([o, o + u_axis, o + u_axis + v_axis, o + v_axis]),
        triangles=triangles,
        corner_normals=np.tile(normal / np.linalg.norm(normal), (2, 3, 1)).astype(np.float32),
        corner_uvs=uvs[triangles],
        corner_colors=np.zeros((0, 3, 3), np.float32),
        material_indices=np.full(2, material, np.int32),
        tag_ids=np.full(2, tag_id, np.int32),
        reflectance=np.zeros((2, 3), np.float32),
        emission=np.zeros((2, 3), np.float32),
    )


def camera_at(position: Vector, target: Vector, **values: object) -> Camera:
    """A camera that looks at `target`, z up (y up where it looks along z)."""
    backward = np.asarray(position, float) - np.asarray(target, float)
    backward /= np.linalg.norm(backward)
    up = np.array([0.0, 1.0, 0.0]) if abs(backward[2]) > 0.999 else np.array([0.0, 0.0, 1.0])
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(backward, right), backward, position
    return Camera("camera", matrix, **values)  # type: ignore[arg-type]


def facing_camera(distance: float = 2.0, **values: object) -> Camera:
    """On the z axis, looking down at the origin, x to the right and y up; the view is 36/50 of the distance wide."""
    return camera_at((0.0, 0.0, distance), (0.0, 0.0, 0.0), **values)


def box_room(offset: Vector = (0.0, 0.0, 0.0)) -> SceneSnapshot:
    """A white room of 2 m, open to the camera, with a red and a green wall, a lamp and a tagged glowing quad."""

    def at(x: float, y: float, z: float) -> Float64:
        return np.add(offset, (x, y, z))

    materials = (
        Material("white", DIFFUSE, (0.8, 0.8, 0.8)),
        Material("red", DIFFUSE, (0.8, 0.05, 0.05)),
        Material("green", DIFFUSE, (0.05, 0.8, 0.05)),
        Material("glow", DIFFUSE, (0.0, 0.0, 0.0), emission=(2.0, 2.0, 2.0)),
    )
    meshes = (
        quad(at(0, 0, 0), (2, 0, 0), (0, 2, 0), name="floor"),
        quad(at(0, 2, 2), (2, 0, 0), (0, -2, 0), name="ceiling"),
        quad(at(0, 2, 0), (2, 0, 0), (0, 0, 2), name="back"),
        quad(at(0, 0, 0), (0, 2, 0), (0, 0, 2), material=1, name="left"),
        quad(at(2, 2, 0), (0, -2, 0), (0, 0, 2), material=2, name="right"),
        quad(at(0.7, 1.3, 1.99), (0.6, 0, 0), (0, -0.6, 0), material=3, tag_id=5, name="glow"),
    )
    lamp = Light("lamp", POINT, (40.0, 40.0, 40.0), tuple(at(1.0, 1.0, 1.5)))
    camera = camera_at(at(1, -3, 1), at(1, 1, 1), lens=35.0)
    return SceneSnapshot("box room", meshes, materials, lights=(lamp,), camera=camera)


def lights_from_triangles(
    corners: npt.ArrayLike, emission: npt.ArrayLike = 1.0, colour: npt.ArrayLike = 0.0, tag_ids: npt.ArrayLike = 0
) -> VirtualLightMesh:
    """One light for each of (n, 3, 3) `corners`, measured at its own centre."""
    points = np.asarray(corners, float)
    count = len(points)
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return VirtualLightMesh(
        vertices=points.reshape(-1, 3),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(count, 3),
        colour=np.broadcast_to(np.asarray(colour, np.float32), (count, 3)).copy(),
        emission=np.broadcast_to(np.asarray(emission, np.float32), (count, 3)).copy(),
        strength=np.ones(count, np.float32),
        tag_ids=np.broadcast_to(np.asarray(tag_ids, np.int32), count).copy(),
        dynamic=np.zeros(count, bool),
        samples=SourceSamples(
            points.mean(axis=1),
            normals.astype(np.float32),
            np.ones(count, np.float32),
            np.arange(count + 1, dtype=np.int32),
        ),
    )


def mesh_lights(meshes: Sequence[Mesh], **values: npt.ArrayLike) -> VirtualLightMesh:
    """One light for each triangle of the meshes."""
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in meshes])
    tag_ids = np.concatenate([mesh.tag_ids for mesh in meshes])
    return lights_from_triangles(corners, tag_ids=tag_ids, **values)


def split(corners: Float64, times: int) -> Float64:
    """(4^times n, 3, 3): each of (n, 3, 3) triangles as four, by the midpoints of its edges, `times` over."""
    for _ in range(times):
        a, b, c = np.moveaxis(corners, 1, 0)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
    return corners
