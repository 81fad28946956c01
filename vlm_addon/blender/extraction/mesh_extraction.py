# SPDX-License-Identifier: GPL-3.0-or-later
"""Visible objects of a depsgraph as world-space meshes with materials, tags and averages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.counting import counted
from ...core.errors import InvalidInput
from ...core.scene import Float32, Float64, Int32, Mesh
from ..names import TAG_PROPERTY
from ..stored_values import whole_number
from .color_space import into_rec709
from .dynamics import is_dynamic
from .materials import FindingList, MaterialTable, MaterialUse
from .mesh_arrays import FARTHEST, LocalMesh, flipped, place, read_mesh
from .painted_detail import painted_detail
from .surface_value import IDENTITY_UV
from .triangle_averages import TextureAverager, triangle_averages

RAY_VISIBILITY = ("visible_camera", "visible_diffuse", "visible_glossy", "visible_shadow")
DEGENERATE_RATIO = 1e-12


@dataclass(frozen=True)
class _Look:
    """What instances of one mesh with the same materials share; the fields are those of Mesh."""

    material_indices: Int32
    corner_uvs: Float32
    corner_colors: Float32
    reflectance: Float32
    emission: Float32


class MeshExtractor:
    """Turns instances into meshes; what instances share is read and averaged once."""

    def __init__(self, materials: MaterialTable, to_rec709: Float64, report: FindingList, depsgraph: Any) -> None:
        self._materials = materials
        self._to_rec709 = to_rec709
        self._report = report
        self._override = depsgraph.view_layer.material_override
        self._averager = TextureAverager(materials.textures)
        self._local: dict[tuple[str, int], LocalMesh] = {}
        self._detail: dict[tuple[str, int], Float32] = {}
        self._looks: dict[tuple[int, tuple[MaterialUse, ...]], _Look] = {}
        self._dynamic: dict[str, bool] = {}

    def meshes(self, instance: Any, name: str, matrix: Float64) -> list[Mesh]:
        """One mesh, or none for an instance without surface. Raises InvalidInput for one that is broken."""
        blender_object = instance.object
        local = self._read(blender_object)
        if not len(local.triangles):
            self._without_surface(instance, local)
            return []
        if not self._placeable(instance, name, local, matrix):
            return []
        self._report_unsupported(blender_object)
        return [self._placed(instance, name, local, matrix)]

    def _read(self, blender_object: Any) -> LocalMesh:
        key = _key(blender_object)
        if key not in self._local:
            mesh = blender_object.to_mesh()
            try:
                local = read_mesh(mesh, f"object {blender_object.name!r}")
                self._detail[key] = painted_detail(blender_object, mesh, local.triangles)
                self._local[key] = local
            finally:
                blender_object.to_mesh_clear()
        return self._local[key]

    def _without_surface(self, instance: Any, local: LocalMesh) -> None:
        """A mesh with vertices and no faces is a mistake, unless it only carries instances; no vertices is not."""
        blender_object = instance.object
        subject = f"object {blender_object.name!r}"
        carries = blender_object.is_instancer or len(blender_object.particle_systems)
        if len(local.positions) and not carries and not instance.is_instance:
            problem = f"its mesh has {counted(len(local.positions), 'vertex')} but no faces"
            raise InvalidInput(subject, problem, "add faces, delete it or disable it in renders")
        if not carries:
            self._report(subject, "it has no surface", "it is left out")

    def _placeable(self, instance: Any, name: str, local: LocalMesh, matrix: Float64) -> bool:
        """False for an instance of zero scale. Raises InvalidInput for an object of zero scale."""
        if not (np.abs(matrix) <= FARTHEST).all():
            problem = "is not finite" if not np.isfinite(matrix).all() else f"has numbers beyond {FARTHEST:g}"
            raise InvalidInput(f"object {name!r}", f"its world matrix {problem}", "repair its transform")
        scale = np.linalg.norm(matrix[:3, :3], axis=0)
        extents = np.ptp(local.positions, axis=0)
        # A flat mesh may be flattened further along its own normal: nothing is lost.
        matters = np.where(extents > 0.0, scale, 1.0)
        flat = abs(np.linalg.det(matrix[:3, :3])) <= DEGENERATE_RATIO * max(float(np.prod(scale)), 1e-300)
        if matters.min() > 0.0 and not (flat and scale.min() > 0.0):
            return True
        if instance.is_instance:
            self._report(f"object {name!r}", "this instance has a scale of zero", "it is left out")
            return False
        axis = "xyz"[int(np.argmin(matters))]
        problem = f"its scale along {axis} is zero"
        raise InvalidInput(f"object {name!r}", problem, "give it a scale or disable it in renders")

    def _placed(self, instance: Any, name: str, local: LocalMesh, matrix: Float64) -> Mesh:
        positions, triangles, normals, mirrored = place(local, matrix)
        look = self._look(local, self._uses(instance.object), name)
        return Mesh(
            name=name,
            owner=str((instance.parent if instance.is_instance and instance.parent else instance.object).name),
            positions=positions,
            triangles=triangles,
            corner_normals=normals,
            corner_uvs=flipped(look.corner_uvs) if mirrored else look.corner_uvs,
            corner_colors=flipped(look.corner_colors) if mirrored else look.corner_colors,
            material_indices=look.material_indices,
            tag_ids=_tags(instance, local),
            reflectance=look.reflectance,
            emission=look.emission,
            dynamic=self._is_dynamic(instance),
            detail=self._detail[_key(instance.object)],
        )

    def _look(self, local: LocalMesh, uses: tuple[MaterialUse, ...], name: str) -> _Look:
        key = (id(local), uses)
        if key not in self._looks:
            self._looks[key] = self._new_look(local, uses, name)
        return self._looks[key]

    def _new_look(self, local: LocalMesh, uses: tuple[MaterialUse, ...], name: str) -> _Look:
        slots = np.clip(local.material_slots, 0, len(uses) - 1)
        indices = np.array([use.index for use in uses], np.int32)[slots]
        uvs, colors = self._corner_uvs(local, uses, slots), self._corner_colors(local, uses, slots, name)
        averages = triangle_averages(self._materials.materials, self._averager, indices, uvs, colors)
        return _Look(indices, uvs, colors, *averages)

    def averages(self, blender_object: Any, local: LocalMesh) -> tuple[Float32, Float32]:
        """Diffuse reflectance and radiant exitance (W/m²), (t, 3) each, of triangles with the materials of an object.

        local: any triangles, as of parts of its mesh; their positions are not looked at.
        """
        look = self._new_look(local, self._uses(blender_object), blender_object.name)
        return look.reflectance, look.emission

    def read_material(self, material: Any | None) -> None:
        """Read a material with its pictures before it is needed."""
        self._materials.use(material)

    def halve_pictures(self) -> None:
        """Make the smaller pictures of all that was read; may be called in a thread."""
        self._averager.halve_all()

    def _uses(self, blender_object: Any) -> tuple[MaterialUse, ...]:
        if self._override is not None:
            return (self._materials.use(self._override),)
        materials = [slot.material for slot in blender_object.material_slots]
        return tuple(self._materials.use(material) for material in materials or [None])

    def _corner_uvs(self, local: LocalMesh, uses: tuple[MaterialUse, ...], slots: Int32) -> Float32:
        """The coordinates that each triangle's material asks for, its mapping applied."""
        result = np.zeros((len(local.triangles), 3, 2), np.float32)
        for slot, use in enumerate(uses):
            uv = local.uv_maps.get(use.uv.uv_map or local.active_uv_map)
            if uv is None:
                continue
            chosen = slots == slot
            result[chosen] = uv[chosen]
            if use.uv.matrix != IDENTITY_UV:
                matrix = np.reshape(use.uv.matrix, (2, 3))
                result[chosen] = uv[chosen].astype(np.float64) @ matrix[:, :2].T + matrix[:, 2]
        return result

    def _corner_colors(self, local: LocalMesh, uses: tuple[MaterialUse, ...], slots: Int32, name: str) -> Float32:
        if not any(use.color_attribute is not None for use in uses):
            return np.zeros((0, 3, 3), np.float32)
        result = np.ones((len(local.triangles), 3, 3), np.float32)
        for slot, use in enumerate(uses):
            if use.color_attribute is None:
                continue
            chosen = slots == slot
            colors = local.corner_colors.get(use.color_attribute or next(iter(local.corner_colors), ""))
            if colors is None:
                self._report(f"object {name!r}", f"it has no color attribute {use.color_attribute!r}", "it is black")
                result[chosen] = 0.0
                continue
            result[chosen] = into_rec709(colors[chosen], self._to_rec709)
        return result

    def _is_dynamic(self, instance: Any) -> bool:
        owners = [instance.object, instance.parent] if instance.is_instance else [instance.object]
        for owner in owners:
            if owner is None:
                continue
            original = owner.original
            if original.name_full not in self._dynamic:
                self._dynamic[original.name_full] = is_dynamic(original)
            if self._dynamic[original.name_full]:
                return True
        return False

    def _report_unsupported(self, blender_object: Any) -> None:
        subject = f"object {blender_object.name!r}"
        hidden = [name for name in RAY_VISIBILITY if not getattr(blender_object, name, True)]
        if hidden:
            self._report(subject, f"ray visibility ({', '.join(hidden)}) is not simulated", "it is seen by all rays")
        for flag in ("is_holdout", "is_shadow_catcher"):
            if getattr(blender_object, flag, False):
                self._report(subject, f"{flag[3:].replace('_', ' ')} is not simulated", "it is an ordinary surface")
        if any(system.settings.type == "HAIR" for system in blender_object.particle_systems):
            self._report(subject, "hair strands are not simulated", "they are left out")


def _key(blender_object: Any) -> tuple[str, int]:
    return blender_object.name_full, blender_object.data.as_pointer()


def _tags(instance: Any, local: LocalMesh) -> Int32:
    """Tag of each triangle: the face's where it has one, else the object's, else the instancer's."""
    own = whole_number(instance.object, TAG_PROPERTY)
    if not own and instance.is_instance and instance.parent is not None:
        own = whole_number(instance.parent, TAG_PROPERTY)
    return np.where(local.face_tags != 0, local.face_tags, own).astype(np.int32)
