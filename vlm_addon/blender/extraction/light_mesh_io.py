# SPDX-License-Identifier: GPL-3.0-or-later
"""The virtual light meshes of the open scene as arrays, with the points of the visible surface that they stand for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ...core.counting import counted
from ...core.errors import InvalidInput
from ...core.light_mesh import VirtualLightMesh, empty_light_mesh, join, require_valid
from ...core.scene import Float32, Float64, Int32, SceneSnapshot
from ..names import (
    AREA_SCALE_ATTRIBUTE,
    COLOR_ATTRIBUTE,
    DYNAMIC_PROPERTY,
    EMISSION_ATTRIBUTE,
    MARK_ATTRIBUTE,
    SCHEMA_PROPERTY,
    SCHEMA_VERSION,
    TAG_ATTRIBUTE,
    is_light_mesh,
)
from ..stored_values import factors, whole_number
from ..tagging.stored_links import read_links
from .color_space import into_rec709, working_to_rec709
from .dynamics import is_dynamic
from .evaluation import evaluate
from .extract import ExtractOptions, extract_from
from .materials import FindingList
from .mesh_arrays import face_attribute, flipped, read_mesh
from .source_points import find_source_points, unsampled

WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class LightOrigins:
    """Where the lights of a scene are stored. objects: names of the light meshes, in the order of their lights and
    vertices. vertex_counts: of each. owner: (n,) int32, row in objects. faces: (n,) int32, the face of the stored mesh
    that each light is (a part of), -1 where modifiers made it or the light mesh is linked. marks: (n,) int32, with whom
    each was made (core/light_marks.py). face_counts: of the stored mesh of each object, by which it is known later
    whether the numbers of faces still mean the same. instanced: whether an instance of the object shines, elsewhere."""

    objects: tuple[str, ...]
    vertex_counts: tuple[int, ...]
    owner: Int32
    faces: Int32
    marks: Int32
    face_counts: tuple[int, ...]
    instanced: tuple[bool, ...]

    def faces_by_object(self, lights: npt.ArrayLike) -> dict[str, Int32]:
        """The stored faces of some lights, (k,) rows, by the name of their object, each once, ascending."""
        rows = np.asarray(lights, np.int64)
        rows = rows[self.faces[rows] >= 0]
        return {
            self.objects[at]: np.unique(self.faces[rows[self.owner[rows] == at]]) for at in np.unique(self.owner[rows])
        }


@dataclass(frozen=True)
class Extraction:
    """One evaluation of a scene: what it shows; its virtual lights and where they are stored, None without any."""

    snapshot: SceneSnapshot
    light_mesh: VirtualLightMesh | None
    origins: LightOrigins | None = None


@dataclass(frozen=True)
class _Read:
    """The lights of one light mesh object, with the rows of LightOrigins."""

    lights: VirtualLightMesh
    name: str
    faces: Int32
    marks: Int32
    face_count: int
    is_instance: bool = False


def extract(options: ExtractOptions | None = None, depsgraph: Any = None, broken_values: bool = False) -> Extraction:
    """`extract_scene` and `extract_light_mesh` from one evaluation; the snapshot's findings are those of both.

    broken_values: whether lights may have colours and strengths that no light can have, for the check to find.
    """
    options = options or ExtractOptions()
    snapshot, lights, report = evaluate(
        lambda graph: _both(graph, options, broken_values), options.viewport_levels, depsgraph, light_meshes=True
    )
    light_mesh = _with_source_points(lights, snapshot, options, report, broken_values)
    findings = dict.fromkeys((*snapshot.findings, *report.findings))
    return Extraction(replace(snapshot, findings=tuple(findings)), light_mesh, _origins(lights) if lights else None)


def extract_light_mesh(
    snapshot: SceneSnapshot,
    options: ExtractOptions | None = None,
    depsgraph: Any = None,
    report: FindingList | None = None,
) -> VirtualLightMesh | None:
    """All virtual lights of the current view layer, or None where no object carries any.

    Objects are found by their property `vlm_schema`, whatever they are called and although they are hidden from
    renders, and read with their modifiers. Where phase one measures is found by rays onto the meshes of `snapshot`.
    report takes what had to be approximated. Raises InvalidInput for values that no light can have.
    """
    options = options or ExtractOptions()
    report = report if report is not None else FindingList()
    lights = evaluate(
        lambda graph: _read_light_meshes(graph, report), options.viewport_levels, depsgraph, light_meshes=True
    )
    return _with_source_points(lights, snapshot, options, report)


def _both(
    depsgraph: Any, options: ExtractOptions, broken_values: bool
) -> tuple[SceneSnapshot, list[_Read], FindingList]:
    report = FindingList()
    return extract_from(depsgraph, options), _read_light_meshes(depsgraph, report, broken_values), report


def origins_of(thing: Any) -> LightOrigins:
    """The origins of the lights of one light mesh of triangles, as `write_light_mesh` has just stored it."""
    count = len(thing.data.polygons)
    marks = face_attribute(thing.data, MARK_ATTRIBUTE, "INT")
    return LightOrigins(
        (thing.name,),
        (len(thing.data.vertices),),
        np.zeros(count, np.int32),
        np.arange(count, dtype=np.int32),
        np.zeros(count, np.int32) if marks is None else marks,
        (count,),
        (False,),
    )


def _origins(found: list[_Read]) -> LightOrigins:
    owner = np.repeat(np.arange(len(found), dtype=np.int32), [len(each.faces) for each in found])
    names = tuple(each.name for each in found)
    vertices = tuple(len(each.lights.vertices) for each in found)
    faces, marks = (np.concatenate(parts) for parts in zip(*((each.faces, each.marks) for each in found), strict=True))
    counts, instanced = tuple(each.face_count for each in found), tuple(each.is_instance for each in found)
    return LightOrigins(names, vertices, owner, faces, marks, counts, instanced)


def _with_source_points(
    lights: list[_Read],
    snapshot: SceneSnapshot,
    options: ExtractOptions,
    report: FindingList,
    broken_values: bool = False,
) -> VirtualLightMesh | None:
    if not lights:
        return None
    light_mesh = join([each.lights for each in lights])
    samples, missed = find_source_points(light_mesh, snapshot.meshes, options.samples_per_light)
    if missed:
        verb = "has" if missed == 1 else "have"
        problem = f"{missed:,} of {counted(len(light_mesh), 'light')} {verb} no visible surface in front"
        report("light mesh", problem, "the light there is measured at the lights themselves")
    found = replace(light_mesh, samples=samples)
    if not broken_values:
        require_valid(found)
    return found


def _read_light_meshes(depsgraph: Any, report: FindingList, broken_values: bool = False) -> list[_Read]:
    """The light meshes of a depsgraph, one per object or instance, without source points."""
    to_rec709 = working_to_rec709()
    found, seen = [], set()
    for instance in depsgraph.object_instances:
        if is_light_mesh(instance.object) and instance.object.type == "MESH":
            seen.add(instance.object.name_full)
            matrix = np.array(instance.matrix_world, np.float64)
            read = _read_object(instance.object, matrix, to_rec709, report, broken_values)
            found.append(replace(read, is_instance=instance.is_instance))
    for blender_object in _left_out(depsgraph, seen, report):
        matrix = np.array(blender_object.matrix_world, np.float64)
        found.append(_read_object(blender_object, matrix, to_rec709, report, broken_values))
    return [each for each in found if len(each.lights)]


def _left_out(depsgraph: Any, seen: set[str], report: FindingList) -> Iterator[Any]:
    """Light meshes of the view layer that this depsgraph does not show: a render engine's leaves out what is hidden.

    They are taken as the viewport has evaluated them, or as they are stored.
    """
    layer = depsgraph.scene.original.view_layers[depsgraph.view_layer.name]
    for blender_object in layer.objects:
        if blender_object.type != "MESH" or not is_light_mesh(blender_object) or blender_object.name_full in seen:
            continue
        evaluated = blender_object.evaluated_get(layer.depsgraph) if layer.depsgraph else blender_object
        if not evaluated.is_evaluated and (len(blender_object.modifiers) or is_dynamic(blender_object)):
            problem = "its modifiers and animation are not evaluated in this render"
            report(f"light mesh {blender_object.name!r}", problem, "show it in the viewport")
        yield evaluated


def _read_object(
    blender_object: Any, matrix: Float64, to_rec709: Float64, report: FindingList, broken_values: bool
) -> _Read:
    owner = f"light mesh {blender_object.name!r}"
    version = whole_number(blender_object, SCHEMA_PROPERTY)
    if not 1 <= version <= SCHEMA_VERSION:
        problem = f"{SCHEMA_PROPERTY} is {version}, not 1 to {SCHEMA_VERSION}"
        raise InvalidInput(owner, problem, "open it with the version of the extension that wrote it")
    mesh = blender_object.to_mesh()
    try:
        return _read_lights(blender_object, mesh, matrix, owner, to_rec709, report, broken_values)
    finally:
        blender_object.to_mesh_clear()


def _read_lights(
    blender_object: Any,
    mesh: Any,
    matrix: Float64,
    owner: str,
    to_rec709: Float64,
    report: FindingList,
    broken_values: bool,
) -> _Read:
    local = read_mesh(mesh, owner)
    if not len(local.triangles):
        report(owner, "it has no faces", "it gives no light: draw some, or delete it")
        none = np.zeros(0, np.int32)
        return _Read(empty_light_mesh(), blender_object.original.name, none, none, 0)
    count = len(mesh.polygons)
    color = face_attribute(mesh, COLOR_ATTRIBUTE, "FLOAT_COLOR")
    if color is None:
        report(owner, f"it has no face attribute {COLOR_ATTRIBUTE!r}", "its lights reflect as white")
        color = np.ones((count, 4), np.float32)
    emission = face_attribute(mesh, EMISSION_ATTRIBUTE, "FLOAT_COLOR")
    area_scale = face_attribute(mesh, AREA_SCALE_ATTRIBUTE, "FLOAT")
    area_scale = np.ones(count, np.float32) if area_scale is None else area_scale
    tags = face_attribute(mesh, TAG_ATTRIBUTE, "INT")
    strength, hue = factors(blender_object, broken_values)
    original = blender_object.original

    def tinted(values: np.ndarray | None) -> Float32:
        rgb = np.zeros((count, 3), np.float32) if values is None else values[:, :3]
        with np.errstate(invalid="ignore", over="ignore"):  # what cannot be is found by the check
            return into_rec709(rgb * hue.astype(np.float32), to_rec709)[local.faces]

    mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
    lights = len(local.triangles)
    stored = original.library is None and len(original.data.polygons) == count
    read = VirtualLightMesh(
        vertices=local.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3],
        triangles=flipped(local.triangles) if mirrored else local.triangles,
        colour=tinted(color),
        emission=tinted(emission),
        strength=np.float32(strength) * area_scale[local.faces],
        tag_ids=(np.zeros(count, np.int32) if tags is None else tags)[local.faces],
        dynamic=np.full(lights, bool(whole_number(blender_object, DYNAMIC_PROPERTY)) or is_dynamic(original)),
        samples=unsampled(lights),
        links=read_links(blender_object),
    )
    marks = face_attribute(mesh, MARK_ATTRIBUTE, "INT")
    marks = (np.zeros(count, np.int32) if marks is None else marks)[local.faces]
    faces = local.faces if stored else np.full(lights, -1, np.int32)
    return _Read(read, original.name, faces, marks, len(original.data.polygons))
