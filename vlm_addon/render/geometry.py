# SPDX-License-Identifier: GPL-3.0-or-later
"""The visible triangles of a snapshot on the GPU, uploaded once and drawn in batches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import DeviceError, InvalidInput
from ..core.scene import NO_TEXTURE, PRINCIPLED, Float32, Float64, Material, Mesh, SceneSnapshot, Texture
from .gpu_layout import CONSTANTS, MATERIAL, TRIANGLE
from .tangents import corner_tangents

if TYPE_CHECKING:
    import moderngl

# texture unit: the field of Material that names its texture
TEXTURE_FIELDS = {
    CONSTANTS["BASE_COLOR_UNIT"]: "base_color_texture",
    CONSTANTS["ALPHA_UNIT"]: "alpha_texture",
    CONSTANTS["ROUGHNESS_UNIT"]: "roughness_texture",
    CONSTANTS["METALLIC_UNIT"]: "metallic_texture",
    CONSTANTS["EMISSION_UNIT"]: "emission_texture",
    CONSTANTS["NORMAL_UNIT"]: "normal_texture",
}


Share = Callable[[str, Callable[[], Any]], Any]
"""Gives what is on the device already under a name, or what the function makes."""


def made_anew(name: str, make: Callable[[], Any]) -> Any:
    """The Share of geometry that shares nothing."""
    return make()


@dataclass(frozen=True)
class _Batch:
    """A run of triangles that need the same textures. textures: index by texture unit, NO_TEXTURE for none."""

    textures: tuple[int, ...]
    first: int
    count: int


class GpuGeometry:
    """All visible triangles in float32 relative to `origin`, opaque ones first.

    Vertex attributes: `in_position` (from the origin), `in_normal`, `in_uv`, `in_color` and `in_tangent` (xyz and
    the bitangent's sign) where some material reads them. What is constant over a triangle is in the storage buffer
    TRIANGLE_BINDING at gl_VertexID / 3, the materials are in MATERIAL_BINDING.

    origin: (3,) float64, in the snapshot's own space. low, high: (3,) float64, visible bounds from the origin.
    """

    def __init__(
        self,
        context: moderngl.Context,
        snapshot: SceneSnapshot,
        origin: Float64 | None = None,
        share: Share = made_anew,
        for_shadows: bool = False,
    ) -> None:
        """origin: the centre of the visible bounds by default. share: is asked for each buffer and for the textures, by
        name (render/kept_geometry.py). for_shadows: only what `draw_opaque` and `draw_with_alpha` read of shadow maps.

        Raises InvalidInput for vertices that are not finite or a material index without material.
        """
        self._context = context
        self._materials = snapshot.materials or (Material("default"),)
        meshes = [mesh for mesh in snapshot.meshes if len(mesh.triangles)]
        for mesh in meshes:
            _require_usable(mesh, len(self._materials))
        low, high = snapshot.bounds()
        self.origin: Float64 = 0.5 * (low + high) if origin is None else origin
        self.low: Float64 = low - self.origin
        self.high: Float64 = high - self.origin
        self.triangle_count = sum(len(mesh.triangles) for mesh in meshes)
        ranks = self._make_batches(meshes)
        # Sorted only where something is uploaded.
        order = cache(lambda: np.argsort(ranks, kind="stable"))
        self._buffers = self._upload_vertices(meshes, order, share, for_shadows)
        self._vertex_arrays: dict[moderngl.Program, moderngl.VertexArray] = {}
        if for_shadows and not self.has_alpha:
            return
        self._triangles = share("triangles", lambda: self._upload_triangles(meshes, order()))
        self._material_buffer = share("materials", self._upload_materials)
        self._textures: list[moderngl.Texture] = [
            share(f"texture {index}", partial(_upload_texture, context, texture))
            for index, texture in enumerate(snapshot.textures)
        ]
        self._white = context.texture((1, 1), 4, np.ones(4, np.float32).tobytes(), dtype="f4")

    @property
    def variants(self) -> dict[str, bool]:
        """Preprocessor names for the attributes that are not always there, and whether they are."""
        return {"HAS_CORNER_COLORS": "in_color" in self._buffers, "HAS_TANGENTS": "in_tangent" in self._buffers}

    @property
    def has_alpha(self) -> bool:
        """Whether some triangles may let light through."""
        return self.opaque_count < self.triangle_count

    def draw(self, program: moderngl.Program) -> None:
        """Draws every triangle with one call."""
        self._render(program, 0, self.triangle_count)

    def draw_opaque(self, program: moderngl.Program) -> None:
        """Draws the triangles that have no alpha with one call."""
        self._render(program, 0, self.opaque_count)

    def draw_with_alpha(self, program: moderngl.Program) -> None:
        """Draws the triangles that have alpha, materials and textures bound as for `draw_materials`."""
        self.bind()
        for batch in self._batches:
            if batch.first >= self.opaque_count:
                self._draw_batch(program, batch)

    def draw_materials(self, program: moderngl.Program) -> None:
        """Draws every triangle with TRIANGLE_BINDING, MATERIAL_BINDING and the material's texture units bound."""
        self.bind()
        for batch in self._batches:
            self._draw_batch(program, batch)

    def bind(self) -> None:
        """Binds the storage buffers of triangles and materials."""
        self._triangles.bind_to_storage_buffer(int(CONSTANTS["TRIANGLE_BINDING"]))
        self._material_buffer.bind_to_storage_buffer(int(CONSTANTS["MATERIAL_BINDING"]))

    def _draw_batch(self, program: moderngl.Program, batch: _Batch) -> None:
        for unit, index in enumerate(batch.textures):
            texture = self._white if index == NO_TEXTURE else self._textures[index]
            texture.use(unit)
        self._render(program, batch.first, batch.count)

    def _render(self, program: moderngl.Program, first: int, count: int) -> None:
        if count == 0:
            return
        if program not in self._vertex_arrays:
            content = [
                (buffer, attribute_format, name)
                for name, (buffer, attribute_format) in self._buffers.items()
                if name in program
            ]
            self._vertex_arrays[program] = self._context.vertex_array(program, content)
        self._vertex_arrays[program].render(vertices=3 * count, first=3 * first)

    def _make_batches(self, meshes: Sequence[Mesh]) -> np.ndarray:
        """(t,) place of each triangle's batch; fills `_batches`, opaque ones first, and `opaque_count`."""
        keys = [batch_key(material) for material in self._materials]
        ranking = sorted(set(keys))
        rank_of_material = np.array([ranking.index(key) for key in keys])
        indices = [mesh.material_indices for mesh in meshes]
        ranks = rank_of_material[np.concatenate(indices)] if indices else np.zeros(0, np.intp)
        counts = np.bincount(ranks, minlength=len(ranking))
        starts = np.cumsum(counts) - counts
        self._batches = [
            _Batch(textures, int(start), int(count))
            for (_, textures), start, count in zip(ranking, starts, counts, strict=True)
            if count
        ]
        is_opaque = np.array([not has_alpha for has_alpha, _ in ranking])
        self.opaque_count = int(counts[is_opaque].sum())
        return ranks

    def _upload_vertices(
        self, meshes: Sequence[Mesh], order: Callable[[], np.ndarray], share: Share, for_shadows: bool
    ) -> dict[str, tuple[moderngl.Buffer, str]]:
        """Attribute name: (buffer, moderngl format)."""
        if not meshes:
            return {}
        attributes: dict[str, tuple[str, Callable[[], Sequence[np.ndarray]]]] = {
            "in_position": ("3f4", lambda: self._corners(meshes))
        }
        if not for_shadows or self.has_alpha:
            attributes["in_uv"] = ("2f4", lambda: [mesh.corner_uvs for mesh in meshes])
        with_normal_map = np.array([material.normal_texture != NO_TEXTURE for material in self._materials])
        if not for_shadows:
            attributes["in_normal"] = ("3f4", lambda: [mesh.corner_normals for mesh in meshes])
            if any(material.base_color_from_corners for material in self._materials):
                attributes["in_color"] = ("3f4", lambda: [_filled_colors(mesh) for mesh in meshes])
            if with_normal_map.any():
                tangents = [(mesh, with_normal_map[mesh.material_indices]) for mesh in meshes]
                attributes["in_tangent"] = ("4f4", lambda: [corner_tangents(*item) for item in tangents])
        return {
            name: (share(name, partial(self._vertex_buffer, parts, order)), attribute_format)
            for name, (attribute_format, parts) in attributes.items()
        }

    def _corners(self, meshes: Sequence[Mesh]) -> list[np.ndarray]:
        return [(mesh.positions - self.origin).astype(np.float32)[mesh.triangles] for mesh in meshes]

    def _vertex_buffer(
        self, parts: Callable[[], Sequence[np.ndarray]], order: Callable[[], np.ndarray]
    ) -> moderngl.Buffer:
        return self._context.buffer(_joined(parts(), order()).tobytes())

    def _upload_triangles(self, meshes: Sequence[Mesh], order: np.ndarray) -> moderngl.Buffer:
        return self._storage_buffer(_triangle_records(meshes, order, self.origin).tobytes(), "triangles")

    def _upload_materials(self) -> moderngl.Buffer:
        return self._storage_buffer(_material_records(self._materials).tobytes(), "materials")

    def _storage_buffer(self, data: bytes, what: str) -> moderngl.Buffer:
        limit = int(self._context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        if len(data) > limit:
            raise DeviceError(
                f"the {what} need {len(data):,} bytes and the device's blocks hold {limit:,}; "
                "hide what the camera does not need or simplify it"
            )
        return self._context.buffer(data or bytes(16))


def batch_key(material: Material) -> tuple[bool, tuple[int, ...]]:
    """Whether a material may let light through, and the textures it needs: what is drawn together has the same."""
    has_alpha = material.alpha < 1.0 or material.alpha_texture != NO_TEXTURE
    return has_alpha, tuple(getattr(material, TEXTURE_FIELDS[unit]) for unit in sorted(TEXTURE_FIELDS))


def _require_usable(mesh: Mesh, material_count: int) -> None:
    if not np.isfinite(mesh.positions).all():
        row = int(np.argwhere(~np.isfinite(mesh.positions))[0][0])
        raise InvalidInput(f"mesh {mesh.name!r} vertex {row}", "its position is not finite", "delete or repair it")
    if mesh.triangles.min() < 0 or mesh.triangles.max() >= len(mesh.positions):
        raise InvalidInput(f"mesh {mesh.name!r}", "a triangle names a vertex that is not there", "repair the mesh")
    if mesh.material_indices.min() < 0 or mesh.material_indices.max() >= material_count:
        problem = f"material index {int(mesh.material_indices.max())} of {material_count} materials"
        raise InvalidInput(f"mesh {mesh.name!r}", problem, "assign a material that exists")


def _joined(parts: Sequence[np.ndarray], order: np.ndarray) -> Float32:
    """The parts' triangles as one contiguous float32 array in `order`."""
    return np.ascontiguousarray(np.concatenate(parts)[order], np.float32)


def _filled_colors(mesh: Mesh) -> Float32:
    if len(mesh.corner_colors) == len(mesh.triangles):
        return mesh.corner_colors
    return np.ones((len(mesh.triangles), 3, 3), np.float32)


def _triangle_records(meshes: Sequence[Mesh], order: np.ndarray, origin: Float64) -> np.ndarray:
    records = TRIANGLE.zeros(sum(len(mesh.triangles) for mesh in meshes))
    start = 0
    for mesh in meshes:
        part = records[start : start + len(mesh.triangles)]
        normals = _geometric_normals(mesh)
        corners = (mesh.positions - origin)[mesh.triangles]
        part["geometric_normal"] = normals
        part["plane_offset"] = np.einsum("ij,ij->i", normals, corners[:, 0])
        part["reach"] = np.linalg.norm(corners, axis=2).max(axis=1)
        part["material"] = mesh.material_indices
        part["tag_id"] = mesh.tag_ids
        start += len(mesh.triangles)
    records["face_id"] = np.arange(len(records))
    return records[order]


def _geometric_normals(mesh: Mesh) -> Float64:
    """(t, 3) unit normals by the winding; the mean corner normal where a triangle has no area."""
    a, b, c = (mesh.positions[mesh.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    flat = lengths[:, 0] == 0.0
    normals[~flat] /= lengths[~flat]
    normals[flat] = mesh.corner_normals[flat].mean(axis=1)
    return normals


def _material_records(materials: Sequence[Material]) -> np.ndarray:
    records = MATERIAL.zeros(len(materials))
    same_fields = (
        *("base_color", "alpha", "emission", "roughness", "metallic", "specular_ior_level", "ior"),
        *("normal_strength", "alpha_channel", "roughness_channel", "metallic_channel"),
    )
    for record, material in zip(records, materials, strict=True):
        for name in same_fields:
            record[name] = getattr(material, name)
        flags = int(CONSTANTS["MATERIAL_PRINCIPLED"]) if material.model == PRINCIPLED else 0
        flags |= int(CONSTANTS["MATERIAL_CORNER_COLOR"]) if material.base_color_from_corners else 0
        for unit, field in TEXTURE_FIELDS.items():
            flags |= 1 << int(unit) if getattr(material, field) != NO_TEXTURE else 0
        record["flags"] = flags
    return records


def _upload_texture(context: moderngl.Context, texture: Texture) -> moderngl.Texture:
    """Without mipmaps: the jittered samples average the texture as Cycles' samples do."""
    import moderngl

    height, width = texture.pixels.shape[:2]
    pixels = np.ascontiguousarray(texture.pixels, np.float32)
    uploaded = context.texture((width, height), 4, pixels.tobytes(), dtype="f4")
    kind = moderngl.LINEAR if texture.linear_filter else moderngl.NEAREST
    uploaded.filter = (kind, kind)
    uploaded.repeat_x = uploaded.repeat_y = texture.repeat
    return uploaded
