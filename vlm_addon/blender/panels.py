# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab of the 3D view, in the order of the work: create, draw, colour, tags, check, animate, bake."""

from __future__ import annotations

from typing import Any

import bpy

from . import authoring, availability
from .light_meshes import light_meshes
from .names import HUE_PROPERTY, STRENGTH_PROPERTY, is_light_mesh
from .panel_layout import SidebarPanel, hint, wrapped

FINDINGS_SHOWN = 8
BIG_BUTTON = 1.5

COLOR_BUTTONS = (
    ("vlm.fill_color", "BRUSH_DATA"),
    ("vlm.multiply_color", "ADD"),
    ("vlm.shift_hue", "COLOR"),
    ("vlm.gradient_color", "IPO_LINEAR"),
)


class VLM_PT_create(SidebarPanel, bpy.types.Panel):  # noqa: N801 (Blender's naming of classes)
    """What makes a light mesh of what is visible."""

    bl_label = "Create"

    def draw(self, context: Any) -> None:
        """Buttons, the settings they share, and what the scene lacks."""
        layout = self.layout
        settings = context.scene.vlm
        column = layout.column()
        column.scale_y = BIG_BUTTON
        column.operator("vlm.light_scene", icon="LIGHT_SUN").target_triangles = settings.target_triangles
        problem = availability.light_scene_problem(context)
        hint(layout, context, problem)
        layout.prop(settings, "target_triangles")
        column = layout.column(align=True)
        for idname, icon in (
            ("vlm.create_from_selection", "RESTRICT_SELECT_OFF"),
            ("vlm.create_from_collection", "OUTLINER_COLLECTION"),
            ("vlm.create_from_scene", "SCENE_DATA"),
        ):
            column.operator(idname, icon=icon).target_triangles = settings.target_triangles
        if problem is None:
            hint(layout, context, availability.selection_problem(context))


class VLM_PT_detail(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Where the next light mesh is fine, where it has nothing, and which lights it keeps."""

    bl_label = "Detail"
    bl_parent_id = "VLM_PT_create"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012 (Blender's way)

    def draw(self, context: Any) -> None:
        """Painting on the visible mesh, locks on the light mesh."""
        row = self.layout.row(align=True)
        row.operator_menu_enum("vlm.paint_detail", "group", icon="WPAINT_HLT")
        row = self.layout.row(align=True)
        row.operator("vlm.lock_lights", icon="LOCKED")
        row.operator("vlm.unlock_lights", icon="UNLOCKED")


class VLM_PT_color(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Hue and strength of the bounce, apart from the visible materials."""

    bl_label = "Color"

    def draw(self, context: Any) -> None:
        """What the selected lights can be given; factors of the active light mesh."""
        layout = self.layout
        problem = availability.light_faces_problem(context)
        if problem is not None:
            hint(layout, context, problem)
            return
        active = context.active_object
        if active is not None and is_light_mesh(active):
            column = layout.column(align=True)
            for name, text in ((STRENGTH_PROPERTY, "Strength"), (HUE_PROPERTY, "Hue")):
                if name in active:
                    column.prop(active, f'["{name}"]', text=text)
        column = layout.column(align=True)
        for idname, icon in COLOR_BUTTONS:
            column.operator(idname, icon=icon)


class VLM_PT_check(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """What the scene's light meshes are and what is wrong with them."""

    bl_label = "Check"

    def draw(self, context: Any) -> None:
        """The light meshes with their size, the budget, the buttons and the findings of the last check."""
        layout = self.layout
        scene = context.scene
        found = light_meshes(scene)
        if not found:
            layout.label(text="No light mesh yet", icon="INFO")
        for thing in found:
            layout.label(text=f"{thing.name}: {authoring.lights(len(thing.data.polygons))}", icon="MESH_DATA")
        layout.prop(scene.vlm, "light_budget")
        layout.operator("vlm.check", icon="CHECKMARK")
        findings = scene.vlm.findings
        for index, finding in enumerate(findings[:FINDINGS_SHOWN]):
            self._finding(context, index, finding)
        if len(findings) > FINDINGS_SHOWN:
            layout.label(text=f"and {len(findings) - FINDINGS_SHOWN} more")

    def _finding(self, context: Any, index: int, finding: Any) -> None:
        box = self.layout.box().column(align=True)
        wrapped(box, context, finding.text, "ERROR")
        if len(finding.marks):
            row = box.row(align=True)
            row.operator("vlm.select_offenders", text="Select", icon="RESTRICT_SELECT_OFF").index = index


class VLM_PT_bake(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Bringing the light meshes up to date."""

    bl_label = "Bake"

    def draw(self, context: Any) -> None:
        """The button."""
        self.layout.operator("vlm.bake", icon="FILE_REFRESH")


CLASSES = (VLM_PT_create, VLM_PT_detail, VLM_PT_color, VLM_PT_check, VLM_PT_bake)
