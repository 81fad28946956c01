# SPDX-License-Identifier: GPL-3.0-or-later
"""The drawing tools in the toolbar of the 3D view, in object mode and in edit mode, each with a keymap of its own."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import bpy

from ..extraction import kept_materials
from . import draw_ahead, draw_keys, draw_preview

MODES = {"OBJECT": "object", "EDIT_MESH": "edit_mesh"}


@dataclass(frozen=True)
class Tool:
    """One tool: name, what it starts, a sentence, Blender's icon, and what the header offers of the operator."""

    name: str
    label: str
    operator: str
    text: str
    icon: str
    options: tuple[str, ...]


TOOLS = (
    Tool(
        "polygon",
        "Light Polygon",
        "vlm.draw_polygon",
        "Click corners on a surface, or drag around an area: a virtual light behind it, in its color",
        "ops.mesh.polybuild_hover",
        ("snap", "offset"),
    ),
    Tool(
        "rectangle",
        "Light Rectangle",
        "vlm.draw_rectangle",
        "Drag a rectangle on a surface: virtual lights behind it, in its color",
        "ops.mesh.primitive_grid_add_gizmo",
        ("snap", "columns", "rows", "offset"),
    ),
    Tool(
        "extrude",
        "Extrude Lights",
        "vlm.draw_extrude",
        "Drag an edge of a virtual light along a surface: a strip of lights follows",
        "ops.mesh.extrude_region_move",
        ("offset",),
    ),
    Tool(
        "cut",
        "Cut Lights",
        "vlm.draw_cut",
        "Click or drag across virtual lights of the selected light meshes: they are cut in two",
        "ops.mesh.knife_tool",
        ("snap",),
    ),
    Tool(
        "erase",
        "Erase Lights",
        "vlm.draw_erase",
        "Drag over virtual lights of the selected light meshes to delete them",
        "ops.gpencil.draw.eraser",
        ("radius",),
    ),
)


def tool_classes() -> list[type]:
    """A WorkSpaceTool for each tool and mode, those of one mode after each other."""
    return [_tool_class(tool, mode) for mode in MODES for tool in TOOLS]


def tool_name(tool: Tool, mode: str) -> str:
    """The id of a tool in a mode, as `bpy.ops.wm.tool_set_by_id` takes it."""
    return f"vlm.{tool.name}_{MODES[mode]}"


def register(undo: ExitStack) -> None:
    """Add keys and tools; `undo` hears how to take them out."""
    draw_preview.register(undo)
    draw_ahead.register(undo)
    kept_materials.register(undo)
    draw_keys.register_keys(undo)
    classes = tool_classes()
    for cls, following in zip(classes, [None, *classes], strict=False):
        first = following is None or following.bl_context_mode != cls.bl_context_mode  # type: ignore[attr-defined]
        after = None if first else {following.bl_idname}  # type: ignore[union-attr]
        bpy.utils.register_tool(cls, after=after, separator=first, group=first)
        undo.callback(bpy.utils.unregister_tool, cls)


def _tool_class(tool: Tool, mode: str) -> type:
    def draw_settings(context: Any, layout: Any, workspace_tool: Any) -> None:
        properties = workspace_tool.operator_properties(tool.operator)
        for name in tool.options:
            layout.prop(properties, name)

    def draw_cursor(context: Any, workspace_tool: Any, place: tuple[float, float]) -> None:
        draw_ahead.mouse_is_at(context, *place)

    members = {
        "bl_space_type": "VIEW_3D",
        "bl_context_mode": mode,
        "bl_idname": tool_name(tool, mode),
        "bl_label": tool.label,
        "bl_description": tool.text,
        "bl_icon": tool.icon,
        "bl_cursor": "CROSSHAIR",
        "bl_keymap": ((tool.operator, {"type": "LEFTMOUSE", "value": "PRESS"}, None),),
        "draw_settings": staticmethod(draw_settings),
        "draw_cursor": staticmethod(draw_cursor),
    }
    return type(f"VLM_WST_{tool.name}_{MODES[mode]}", (bpy.types.WorkSpaceTool,), members)
