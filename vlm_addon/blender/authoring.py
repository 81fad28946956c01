# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators do with the scene's light meshes, each function one step of theirs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import bpy

from ..bake import Bake, bake
from ..core.errors import InvalidInput, VlmError
from ..core.progress import Progress
from ..core.scene import Finding, SceneSnapshot
from ..core.simplify import SimplifySettings
from ..core.validate import check_light_mesh
from .availability import light_mesh_objects
from .engine import ENGINE_ID
from .extract import ExtractOptions, extract_scene, require_camera, require_lights
from .light_mesh_io import extract_light_mesh
from .write_back import write_light_mesh

NAME = "VLM"


@dataclass(frozen=True)
class Made:
    """A bake and where it goes: the scene's name and the light mesh's; name is None where the scene keeps its own."""

    scene: str
    name: str | None
    bake: Bake


def from_selection(context: Any, settings: SimplifySettings) -> Callable[[Progress], Made]:
    """Work that makes a light mesh of the selected objects."""
    chosen = [thing.name for thing in context.selected_objects]
    snapshot = extract_scene(ExtractOptions(objects=frozenset(chosen)))
    active = context.active_object
    name = f"{NAME} {active.name if active is not None and active.name in chosen else chosen[0]}"
    return _work(context.scene.name, name, snapshot, settings)


def from_visible_scene(context: Any, settings: SimplifySettings) -> Callable[[Progress], Made]:
    """Work that makes a light mesh of the visible scene where it has none, and checks the one it has."""
    return _work_on_scene(context.scene, extract_scene(), settings)


def from_lit_scene(context: Any, settings: SimplifySettings) -> Callable[[Progress], Made]:
    """The same for a scene that is about to be rendered. Raises InvalidInput where nothing in it sends out light."""
    snapshot = extract_scene()
    require_camera(snapshot)
    require_lights(snapshot)
    return _work_on_scene(context.scene, snapshot, settings)


def _work_on_scene(scene: Any, snapshot: SceneSnapshot, settings: SimplifySettings) -> Callable[[Progress], Made]:
    if light_mesh_objects(scene):
        existing = extract_light_mesh(snapshot)
        return lambda progress: Made(scene.name, None, bake(snapshot, existing, None, progress))
    return _work(scene.name, NAME, snapshot, settings)


def _work(scene: str, name: str, snapshot: SceneSnapshot, settings: SimplifySettings) -> Callable[[Progress], Made]:
    return lambda progress: Made(scene, name, bake(snapshot, None, settings, progress))


def write(made: Made) -> str:
    """Put what was made into Blender's data, with its findings; returns a sentence with counts."""
    scene = bpy.data.scenes.get(made.scene)
    if scene is None:
        raise InvalidInput(f"scene {made.scene!r}", "it is gone", "create the light mesh again")
    list_findings(scene, made.bake.findings)
    count = lights(len(made.bake.light_mesh))
    if made.name is None or made.bake.creation is None:
        return f"Kept the {count} that the scene has"
    write_light_mesh(made.bake.light_mesh, made.name, scene)
    seconds = sum(milliseconds for _, milliseconds in made.bake.creation.milliseconds) / 1000
    return f"Made {count} from {made.bake.creation.source_triangles:,} triangles in {seconds:.1f} s"


def check(context: Any) -> tuple[Finding, ...]:
    """What is wrong with the light meshes of the scene, and what extraction had to approximate; also listed."""
    snapshot = extract_scene()
    findings = (*check_light_mesh(extract_light_mesh(snapshot), snapshot.meshes), *snapshot.findings)
    list_findings(context.scene, findings)
    return findings


def list_findings(scene: Any, findings: Sequence[Finding]) -> None:
    """Show the findings in the sidebar, in place of those before."""
    scene.vlm.findings.clear()
    for finding in findings:
        scene.vlm.findings.add().text = str(finding)


def render_picture(context: Any) -> None:
    """Render the scene by our engine: beside the window that shows the picture, or at once where there is no window."""
    context.scene.render.engine = ENGINE_ID
    try:
        bpy.ops.render.render(*(() if bpy.app.background else ("INVOKE_DEFAULT",)))
    except RuntimeError as error:
        raise VlmError(str(error).strip()) from error


def allow(operator: Any, problem: str | None) -> bool:
    """What `poll` returns; a problem becomes the tooltip of the disabled button."""
    if problem is not None:
        operator.poll_message_set(problem)
    return problem is None


def lights(count: int) -> str:
    """A number of virtual lights in words."""
    return "1 virtual light" if count == 1 else f"{count:,} virtual lights"
