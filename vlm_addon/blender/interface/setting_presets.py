# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of the scene's settings, in Blender's own way: a menu in the panel's header, files that a user can share."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import bpy
from bl_ui.utils import PresetPanel  # type: ignore[import-not-found]

from .properties import SCENE_PROPERTY, technique_group

FOLDER = "virtual_light_mesh"
"""Folder of presets, ours and the user's, inside folders named `presets`."""
DEFINES = [f"settings = bpy.context.scene.{SCENE_PROPERTY}"]
COMMON = ("technique", "samples", "world_lights", "target_triangles", "effects")
"""Settings of the scene that every preset keeps."""


def preset_values(scene: Any) -> list[str]:
    """What a preset of the scene's settings holds: the technique with its settings, the effects, the size of light
    meshes. Settings of other techniques stay as they are."""
    names = list(COMMON)
    group = technique_group(scene, getattr(scene, SCENE_PROPERTY).technique)
    if group is not None:
        names.append(group.path_from_id().split(".")[-1])
    return [f"settings.{name}" for name in names]


def preset_names() -> list[str]:
    """Display names of all presets, the user's and ours."""
    folders = bpy.utils.preset_paths(FOLDER)
    return sorted({bpy.path.display_name(path.name) for folder in folders for path in Path(folder).glob("*.py")})


class VLM_PT_presets(PresetPanel, bpy.types.Panel):  # noqa: N801 (Blender's naming of classes)
    """The menu of presets."""

    bl_label = "Presets"
    preset_subdir = FOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = "vlm.add_preset"


def register(undo: ExitStack) -> None:
    """Show the presets that come with the extension; `undo` hears how to hide them."""
    bpy.utils.register_class(VLM_PT_presets)
    undo.callback(bpy.utils.unregister_class, VLM_PT_presets)
    folder = str(Path(__file__).parent)
    bpy.utils.register_preset_path(folder)
    undo.callback(bpy.utils.unregister_preset_path, folder)
