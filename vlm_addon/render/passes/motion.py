# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the surface that each pixel shows was in the picture before: motion vectors in space, not in the picture.

    motion = MotionPass(context, shaders, kept, scene.world, space, width, height)
    found = motion.render(gbuffer)      # once for each picture

Whoever has a history asks the earlier picture's own view where that place is seen. The G-buffer names each pixel's
triangle, so nothing is drawn again: the pixel's place among the corners, and by how much these have moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.scene import SceneSnapshot
from ..kept import Kept
from ..local_space import LocalSpace
from ..mesh_motion import MeshMove, MeshPlaces, SceneMotion
from ..shader_library import ShaderLibrary, set_uniforms
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
MOVE_BINDING, VERTEX_BINDING, CORNER_BINDING = 0, 1, 2
BYTES_PER_VERTEX = 32


@dataclass(frozen=True)
class SurfacesBefore:
    """Of each pixel's surface in the picture before; textures of the picture's size.

    place: RGBA32F, in the local units of this picture's space, to the bit the G-buffer's for what has not moved; w: 1,
    or 0 where there is no surface or none that was there before. normal, plane: RGBA16F, its shading and geometric
    normal then.
    """

    place: moderngl.Texture
    normal: moderngl.Texture
    plane: moderngl.Texture

    def use(self, first_unit: int) -> None:
        """Binds place, normal and plane to three texture units."""
        for unit, texture in enumerate((self.place, self.normal, self.plane), first_unit):
            texture.use(unit)


@dataclass(frozen=True)
class Motion:
    """What moved up to one picture. scene: of the meshes. surfaces: None where none has moved or is new."""

    scene: SceneMotion
    surfaces: SurfacesBefore | None


class MotionPass:
    """Finds where surfaces were; made once a frame."""

    def __init__(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        kept: Kept,
        world: SceneSnapshot,
        space: LocalSpace,
        width: int,
        height: int,
    ) -> None:
        """world: the frame's scene in world space. space: of its G-buffers."""
        self._context = context
        self._places: MeshPlaces = kept.hold("mesh_places", MeshPlaces)
        self._world = world
        self._space = space
        self._size = width, height
        defines = {"MOVE_BINDING": MOVE_BINDING, "VERTEX_BINDING": VERTEX_BINDING, "CORNER_BINDING": CORNER_BINDING}
        self._shaders = shaders
        self._defines = {"GROUP_SIDE": GROUP_SIDE, **defines}
        self._has_begun = False

    def render(self, gbuffer: GBuffer) -> Motion:
        """What has moved since the last picture, of this frame or an earlier one, that was asked for."""
        if self._has_begun:
            return Motion(self._places.rest(), None)
        self._has_begun = True
        found = self._places.advance(self._world)
        return Motion(found, self._surfaces(gbuffer, found.moves) if found.moves else None)

    def _surfaces(self, gbuffer: GBuffer, moves: Sequence[MeshMove]) -> SurfacesBefore:
        limit = int(self._context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        records, vertices, corners = move_buffers(moves, self._space, limit)
        result = SurfacesBefore(
            self._context.texture(self._size, 4, dtype="f4"),
            self._context.texture(self._size, 4, dtype="f2"),
            self._context.texture(self._size, 4, dtype="f2"),
        )
        gbuffer.bind()
        for image, texture in enumerate((result.place, result.normal, result.plane)):
            texture.bind_to_image(image, read=False, write=True)
        bindings = (MOVE_BINDING, VERTEX_BINDING, CORNER_BINDING)
        for binding, data in zip(bindings, (records, vertices, corners), strict=True):
            self._context.buffer(data.tobytes() or bytes(16)).bind_to_storage_buffer(binding)
        shader = self._shaders.compute("passes/motion.comp", self._defines)
        set_uniforms(shader, {"move_count": len(records)})
        width, height = self._size
        shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
        self._context.memory_barrier()
        return result


def move_buffers(moves: Sequence[MeshMove], space: LocalSpace, limit: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the shader reads: (m, 4) int32, of each move its first and end face, its first corner in the third array or
    -1 where nothing is known of before; (v, 2, 4) float32, local places of the vertices now, and the way back to where
    they were; (3 t,) uint32, vertices of triangles.

    limit: bytes that a buffer may have. Meshes that do not fit have no earlier place.
    """
    records: list[tuple[int, int, int, int]] = []
    vertices: list[np.ndarray] = []
    corners: list[np.ndarray] = []
    vertex_count = corner_count = 0
    for move in moves:
        mesh, end_face = move.mesh, move.first_face + len(move.mesh.triangles)
        fits = BYTES_PER_VERTEX * (vertex_count + len(mesh.positions)) <= limit
        fits &= 4 * (corner_count + mesh.triangles.size) <= limit
        if move.before is None or not fits:
            records.append((move.first_face, end_face, -1, 0))
            continue
        records.append((move.first_face, end_face, corner_count, 0))
        pair = np.zeros((len(mesh.positions), 2, 4), np.float32)
        pair[:, 0, :3] = space.local_points(mesh.positions)
        pair[:, 1, :3] = (move.before - mesh.positions) / space.unit
        vertices.append(pair)
        corners.append((mesh.triangles + vertex_count).astype(np.uint32).ravel())
        vertex_count += len(mesh.positions)
        corner_count += mesh.triangles.size
    return (
        np.array(records, np.int32).reshape(-1, 4),
        np.concatenate(vertices) if vertices else np.zeros((0, 2, 4), np.float32),
        np.concatenate(corners) if corners else np.zeros(0, np.uint32),
    )
