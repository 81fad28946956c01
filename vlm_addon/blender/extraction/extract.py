# SPDX-License-Identifier: GPL-3.0-or-later
"""What one frame of the open scene shows, as a SceneSnapshot: the way from Blender's data to ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.errors import InvalidInput
from ...core.scene import Camera, Float64, Light, Mesh, SceneSnapshot
from ...core.world_light import is_lit_by_world
from ..names import is_light_mesh
from .color_space import working_to_rec709
from .evaluation import TEMPORARY_PROPERTY, evaluate
from .lamps import read_camera, read_light
from .materials import FindingList, MaterialTable
from .mesh_extraction import MeshExtractor
from .world import read_world

SURFACE_TYPES = ("CURVE", "SURFACE", "FONT", "META")
"""Object types that Blender turns into meshes, which it presents beside them as instances."""

IGNORED_TYPES = ("ARMATURE", "EMPTY", "LATTICE", "SPEAKER", "CAMERA", "LIGHT_PROBE", *SURFACE_TYPES)
"""Object types that no renderer draws itself."""

UNUSED_ID = 2**31 - 1
"""What fills the persistent id of an instance up to its fixed length."""


@dataclass(frozen=True)
class ExtractOptions:
    """What to extract.

    viewport_levels: modifiers as in the viewport instead of as in a render. objects: names of objects; where given,
    only they and what is instanced by them are extracted as surfaces. samples_per_light: points at which the light on
    a virtual light of median size is measured, for light meshes read from the scene.
    """

    viewport_levels: bool = False
    objects: frozenset[str] | None = None
    samples_per_light: int = 16


def extract_scene(options: ExtractOptions | None = None, depsgraph: Any = None) -> SceneSnapshot:
    """The current scene, view layer and frame as a snapshot.

    depsgraph: an evaluated depsgraph to read as it is (a render engine's); without one the scene is evaluated as for
    a render. Raises InvalidInput for a visible mesh that cannot be rendered: no faces, a vertex that is not finite,
    a scale of zero.
    """
    options = options or ExtractOptions()
    return evaluate(lambda graph: extract_from(graph, options), options.viewport_levels, depsgraph)


def extract_from(depsgraph: Any, options: ExtractOptions) -> SceneSnapshot:
    """`extract_scene` for a depsgraph that is there."""
    return _Extraction(depsgraph, options).snapshot()


def require_camera(snapshot: SceneSnapshot) -> Camera:
    """The camera of the snapshot. Raises InvalidInput where there is none."""
    if snapshot.camera is None:
        problem = "it has no perspective or orthographic camera"
        raise InvalidInput(f"scene {snapshot.name!r}", problem, "add one (Add > Camera) or name one by --camera")
    return snapshot.camera


def require_lights(snapshot: SceneSnapshot) -> tuple[Light, ...]:
    """The lamps of the snapshot. Raises InvalidInput where neither a lamp, a surface nor the world sends out light."""
    shines = is_lit_by_world(snapshot) or any(mesh.emission.any() for mesh in snapshot.meshes)
    if not snapshot.lights and not shines:
        problem = "nothing in it sends out light"
        raise InvalidInput(f"scene {snapshot.name!r}", problem, "add a light (Add > Light) or an emissive material")
    return snapshot.lights


def require_surfaces(snapshot: SceneSnapshot) -> tuple[Mesh, ...]:
    """The visible meshes of the snapshot. Raises InvalidInput where there are none."""
    if not snapshot.triangle_count:
        problem = "no visible object in it has a surface"
        raise InvalidInput(f"scene {snapshot.name!r}", problem, "add a mesh or enable one in renders")
    return snapshot.meshes


class _Extraction:
    """One walk over a depsgraph."""

    def __init__(self, depsgraph: Any, options: ExtractOptions) -> None:
        self._depsgraph = depsgraph
        self._options = options
        self._report = FindingList()
        self._to_rec709 = working_to_rec709()
        self._materials = MaterialTable(self._to_rec709, self._report)
        self._meshes = MeshExtractor(self._materials, self._to_rec709, self._report, depsgraph)

    def snapshot(self) -> SceneSnapshot:
        meshes: list[Mesh] = []
        lights: list[Light] = []
        scene = self._depsgraph.scene
        for instance in self._depsgraph.object_instances:
            self._visit(instance, meshes, lights)
        radiance, environment = read_world(scene.world, self._to_rec709, self._report)
        camera = self._camera(scene)
        return SceneSnapshot(
            name=scene.name,
            meshes=tuple(meshes),
            materials=tuple(self._materials.materials),
            textures=tuple(self._materials.textures),
            lights=tuple(lights),
            camera=camera,
            world_radiance=radiance,
            environment=environment,
            frame=scene.frame_current,
            findings=self._report.findings,
        )

    def _visit(self, instance: Any, meshes: list[Mesh], lights: list[Light]) -> None:
        blender_object = instance.object
        if not instance.show_self or is_light_mesh(blender_object) or self._hidden(instance):
            return
        if blender_object.type == "LIGHT":
            light = read_light(
                blender_object,
                _matrix(instance),
                instance_name(instance),
                self._materials.evaluator,
                self._to_rec709,
                self._report,
            )
            if light is not None:
                lights.append(light)
        elif blender_object.type == "MESH":
            if self._chosen(instance):
                meshes += self._meshes.meshes(instance, instance_name(instance), _matrix(instance))
        elif blender_object.type not in IGNORED_TYPES:
            subject = f"object {blender_object.name!r}"
            self._report(subject, f"objects of type {blender_object.type} are not simulated", "it is left out")

    def _hidden(self, instance: Any) -> bool:
        """Whether F12 would not show it; a depsgraph of render mode holds only what it shows."""
        owner = instance.parent if instance.is_instance else instance.object
        return self._depsgraph.mode != "RENDER" and owner is not None and owner.hide_render

    def _chosen(self, instance: Any) -> bool:
        chosen = self._options.objects
        if chosen is None:
            return True
        owner = instance.parent if instance.is_instance else instance.object
        return owner is not None and owner.name in chosen

    def _camera(self, scene: Any) -> Camera | None:
        original = scene.camera.original if scene.camera is not None else None
        if original is None or TEMPORARY_PROPERTY in original:
            return None
        evaluated = original.evaluated_get(self._depsgraph)
        return read_camera(evaluated, np.array(evaluated.matrix_world, np.float64), scene, self._report)


def _matrix(instance: Any) -> Float64:
    """(4, 4) float64 world matrix."""
    return np.array(instance.matrix_world, np.float64)


def instance_name(instance: Any) -> str:
    """Name of the object, or of instancer and object with the instance's own id."""
    name, parent = str(instance.object.name), instance.parent
    if not instance.is_instance or parent is None:
        return name
    numbers = [str(number) for number in instance.persistent_id if number != UNUSED_ID]
    if parent.type in SURFACE_TYPES and parent.name == name and numbers == ["0"]:
        return name
    return f"{parent.name}/{name}/{'.'.join(reversed(numbers))}"
