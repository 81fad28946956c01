# SPDX-License-Identifier: GPL-3.0-or-later
"""What this machine and this scene lack, as sentences that say what to do."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterable, Iterator

import bpy

from ..light_meshes import chosen_light_meshes, is_local
from ..names import is_light_mesh

AUTHORING_MODULES = ("fast_simplification", "trimesh")
RENDERING_MODULES = ("moderngl", "glcontext")
REINSTALL = "reinstall the extension from the zip made for this system and restart Blender"

GEOMETRY_TYPES = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD"}


def authoring_problem() -> str | None:
    """Why light meshes cannot be created here, or None."""
    return _missing(AUTHORING_MODULES)


def rendering_problem() -> str | None:
    """Why pictures cannot be rendered here, or None."""
    if sys.platform == "darwin":
        return "macOS stops at OpenGL 4.1: create, check and bake here, render on Linux or Windows"
    if not sys.executable:
        return "Blender's Python was not found, so the renderer cannot start: use an official build of Blender"
    return _missing(RENDERING_MODULES)


def _missing(modules: Iterable[str]) -> str | None:
    # find_spec does not load the module: on Windows a loaded .pyd cannot be replaced at an update
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    return f"Missing {', '.join(missing)}: {REINSTALL}" if missing else None


def light_mesh_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The virtual light meshes of `scene`, in order of name."""
    return sorted((thing for thing in scene.objects if is_light_mesh(thing)), key=lambda thing: thing.name)


def has_geometry(thing: bpy.types.Object) -> bool:
    """Whether the object may show surfaces, its own or those of a collection that it instances."""
    shows = thing.type in GEOMETRY_TYPES or thing.is_instancer
    return shows and not is_light_mesh(thing)


def selection_problem(context: bpy.types.Context) -> str | None:
    """Why the selection gives no light mesh, or None."""
    if not any(has_geometry(thing) for thing in context.selected_objects):
        return "Nothing to make lights from: select the objects that should bounce light"
    return _writing_problem(context) or authoring_problem()


def collection_problem(context: bpy.types.Context) -> str | None:
    """Why the active collection gives no light mesh, or None."""
    collection = context.collection
    if collection is None or not any(has_geometry(thing) for thing in collection.all_objects):
        return "The active collection shows no surfaces: click one that holds meshes in the outliner"
    return _writing_problem(context) or authoring_problem()


def painting_problem(context: bpy.types.Context) -> str | None:
    """Why there is no visible mesh to paint detail on, or None."""
    thing = context.active_object
    if thing is None or thing.type != "MESH" or is_light_mesh(thing):
        return "Select the visible mesh first: detail is painted there, not on the light mesh"
    if not is_local(thing):
        return f"{thing.name} is linked from another file: make it local first"
    return None


def visible_scene_problem(context: bpy.types.Context) -> str | None:
    """Why the visible scene gives no light mesh, or None."""
    if not any(has_geometry(thing) for thing in rendered_objects(context)):
        return "The scene shows no surfaces: add a mesh (Add > Mesh) or enable an object for rendering"
    return _writing_problem(context) or authoring_problem()


def _writing_problem(context: bpy.types.Context) -> str | None:
    if context.mode != "OBJECT":
        return (
            "Leave this mode first (Tab, or the menu at the left of the header): light meshes are made in Object Mode"
        )
    if context.scene.library is not None:
        return f"The scene is linked from {context.scene.library.filepath}: open that file, or make the scene local"
    return None


def light_faces_problem(context: bpy.types.Context) -> str | None:
    """Why a tool that changes lights has nothing to change, or None."""
    chosen = chosen_light_meshes(context)
    if context.mode not in ("OBJECT", "EDIT_MESH"):
        return "Leave this mode first: lights are changed in Object Mode (all of a light mesh) or Edit Mode (selected)"
    if not chosen:
        return "Select a light mesh (collection Virtual Light Meshes), or edit one and select faces"
    linked = next((thing for thing in chosen if not is_local(thing)), None)
    return f"{linked.name} is linked from another file: make it local first" if linked is not None else None


def whole_light_mesh_problem(context: bpy.types.Context) -> str | None:
    """Why a tool that changes light mesh objects as a whole has nothing to change, or None.

    In edit mode it could not be undone: Blender's undo steps there hold meshes alone.
    """
    if context.mode != "OBJECT":
        return "Leave this mode first (Tab): whole light meshes are changed in Object Mode"
    return light_faces_problem(context)


def light_scene_tags_problem(context: bpy.types.Context) -> str | None:
    """Why the tags of the scene's light meshes cannot be repaired, or None."""
    if context.mode != "OBJECT":
        return "Leave this mode first (Tab): tags of whole scenes are repaired in Object Mode"
    return check_problem(context)


def check_problem(context: bpy.types.Context) -> str | None:
    """Why there is nothing to check, or None."""
    if not light_mesh_objects(context.scene):
        return "The scene has no virtual light mesh: create one first"
    return None


def findings_problem(context: bpy.types.Context) -> str | None:
    """Why there is no finding to look at, or None."""
    if not len(context.scene.vlm.findings):
        return "There are no findings: run Check first, or there is nothing wrong"
    return None


def light_scene_problem(context: bpy.types.Context) -> str | None:
    """Why the scene cannot be lit and rendered, or None."""
    if context.scene.camera is None:
        return "The scene has no camera: add one (Add > Camera) and aim it (View > Align View > Align Active Camera)"
    return rendering_problem() or visible_scene_problem(context)


def rendered_objects(context: bpy.types.Context) -> Iterator[bpy.types.Object]:
    """The objects of the view layer that are enabled for renders.

    A layer that has yet to hear that objects were deleted lists None for them.
    """
    return (thing for thing in context.view_layer.objects if thing is not None and not thing.hide_render)
