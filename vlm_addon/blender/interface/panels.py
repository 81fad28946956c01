# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab of the 3D view, in the order of the work; each panel shows what the selection can use."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.spans import numbers_in, parse_spans
from .. import authoring
from ..baking import bake_state
from ..drawing.draw_tool import TOOLS, tool_name
from ..findings import fixable_kinds
from ..light_meshes import light_meshes
from ..names import HUE_PROPERTY, STRENGTH_PROPERTY, is_light_mesh
from ..overlays import overlays
from ..tagging import light_tags
from . import availability, workflow
from .panel_layout import SidebarPanel, hint, labelled, wrapped
from .setting_presets import VLM_PT_presets
from .translation import told_finding
from .workflow import Step

FINDINGS_SHOWN = 8
BIG_BUTTON = 1.5
FIRST_BUTTON = "vlm.light_scene"
FACTORS = ((STRENGTH_PROPERTY, "Strength"), (HUE_PROPERTY, "Hue"))


def _buttons(layout: Any, step: Step) -> None:
    column = layout.column(align=True)
    for each in step.buttons:
        column.operator(each.operator, icon=each.icon)


class VLM_PT_create(SidebarPanel, bpy.types.Panel):  # noqa: N801 (Blender's naming of classes)
    """What makes a light mesh of what is visible."""

    bl_label = workflow.CREATE.label

    def draw_header_preset(self, context: Any) -> None:
        """The menu of presets."""
        VLM_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: Any) -> None:
        """Buttons, the setting they share, and what the scene lacks."""
        layout = self.layout
        settings = context.scene.vlm
        problem = availability.light_scene_problem(context)
        for each in workflow.CREATE.buttons:
            column = layout.column(align=True)
            if each.operator == FIRST_BUTTON:
                column.scale_y = BIG_BUTTON
            column.operator(each.operator, icon=each.icon).target_triangles = settings.target_triangles
            if each.operator == FIRST_BUTTON:
                hint(layout, context, problem)
                layout.prop(settings, "target_triangles")
        if problem is None:
            hint(layout, context, availability.selection_problem(context))


class VLM_PT_detail(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Where the next light mesh is fine, where it has nothing, and which lights it keeps."""

    bl_label = workflow.DETAIL.label
    bl_parent_id = "VLM_PT_create"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012 (Blender's way)

    def draw(self, context: Any) -> None:
        """Painting on the visible mesh, locks on the light mesh."""
        paint, *locks = workflow.DETAIL.buttons
        self.layout.operator_menu_enum(paint.operator, "group", icon=paint.icon)
        row = self.layout.row(align=True)
        for each in locks:
            row.operator(each.operator, icon=each.icon)


class VLM_PT_draw(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Lights drawn by hand."""

    bl_label = workflow.DRAW.label

    def draw(self, context: Any) -> None:
        """The tools of the toolbar, and lights from faces."""
        if context.mode not in ("OBJECT", "EDIT_MESH"):
            hint(self.layout, context, "Lights are drawn in Object Mode and in Edit Mode")
            return
        grid = self.layout.grid_flow(columns=2, even_columns=True, align=True)
        for tool in TOOLS:
            grid.operator("wm.tool_set_by_id", text=tool.label).name = tool_name(tool, context.mode)
        _buttons(self.layout, workflow.DRAW)


class VLM_PT_color(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Hue and strength of the bounce, apart from the visible materials."""

    bl_label = workflow.COLOR.label

    def draw(self, context: Any) -> None:
        """What the selected lights can be given; factors of the active light mesh."""
        problem = availability.light_faces_problem(context)
        if problem is not None:
            hint(self.layout, context, problem)
            return
        active = context.active_object
        if active is not None and is_light_mesh(active):
            column = self.layout.column(align=True)
            for name, text in FACTORS:
                if name in active:
                    column.prop(active, f'["{name}"]', text=text)
        _buttons(self.layout, workflow.COLOR)


class VLM_PT_tags(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Which lights which surfaces leave out."""

    bl_label = workflow.TAGS.label
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: Any) -> None:
        """What tags can be given to, or what to select."""
        problem = light_tags.tag_problem(context)
        if problem is not None:
            hint(self.layout, context, problem)
            return
        _buttons(self.layout, workflow.TAGS)


class VLM_PT_check(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """What the scene's light meshes are and what is wrong with them."""

    bl_label = workflow.CHECK.label

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
        check, fix = workflow.CHECK.buttons
        row = layout.row(align=True)
        row.operator(check.operator, icon=check.icon)
        findings = scene.vlm.findings
        if fixable_kinds(scene):
            row.operator(fix.operator, text="Fix All", icon=fix.icon).kind = ""
        for index, finding in enumerate(findings[:FINDINGS_SHOWN]):
            self._finding(context, index, finding)
        if len(findings) > FINDINGS_SHOWN:
            layout.label(text=f"and {len(findings) - FINDINGS_SHOWN} more")

    def _finding(self, context: Any, index: int, finding: Any) -> None:
        box = self.layout.box().column(align=True)
        count = sum(len(numbers_in(parse_spans(mark.faces, "face", 0))) for mark in finding.marks)
        wrapped(box, context, told_finding(finding.kind, finding.text, count), "ERROR")
        row = box.row(align=True)
        if len(finding.marks):
            row.operator("vlm.select_offenders", text="Select", icon="RESTRICT_SELECT_OFF").index = index
        if finding.fixable:
            row.operator("vlm.fix_findings", text="Fix", icon="TOOL_SETTINGS").kind = finding.kind


class VLM_PT_animate(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Light meshes that move and deform with what they stand for."""

    bl_label = workflow.ANIMATE.label
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: Any) -> None:
        """The buttons, or what to select."""
        hint(self.layout, context, availability.light_faces_problem(context))
        _buttons(self.layout, workflow.ANIMATE)


class VLM_PT_bake(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Whether light meshes and light grid are up to date, and making them so."""

    bl_label = workflow.BAKE.label

    def draw(self, context: Any) -> None:
        """The badge and the buttons."""
        badge = bake_state.badge(context)
        wrapped(self.layout.column(align=True), context, badge.text, badge.icon)
        _buttons(self.layout, workflow.BAKE)


class VLM_PT_view(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """What the 3D views show of light meshes."""

    bl_label = workflow.VIEW.label

    def draw_header(self, context: Any) -> None:
        """Whether anything is shown."""
        self.layout.prop(overlays.settings_of(context), "show", text="")

    def draw(self, context: Any) -> None:
        """What is shown, and the button that makes the light grid's cells."""
        layout, settings = self.layout, overlays.settings_of(context)
        column = layout.column()
        column.active = settings.show
        labelled(column, settings, "fill")
        column.prop(settings, "opacity", slider=True)
        for name in ("sides", "findings", "in_front", "half_balls", "grid"):
            column.prop(settings, name)
        if settings.grid:
            labelled(column, settings, "grid_place")
            _buttons(column, workflow.VIEW)
        hint(layout, context, overlays.overlay_hint(context))


class VLM_PT_support(SidebarPanel, bpy.types.Panel):  # noqa: N801
    """Help, and what to send along when something fails."""

    bl_label = workflow.SUPPORT.label
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: Any) -> None:
        """The buttons."""
        _buttons(self.layout, workflow.SUPPORT)


CLASSES = (
    VLM_PT_create,
    VLM_PT_detail,
    VLM_PT_draw,
    VLM_PT_color,
    VLM_PT_tags,
    VLM_PT_check,
    VLM_PT_animate,
    VLM_PT_bake,
    VLM_PT_view,
)
LAST_CLASSES = (VLM_PT_support,)
"""Below the panels of rendering."""
