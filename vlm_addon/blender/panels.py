# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab of the 3D view, in the order of work: create, check, render."""

from __future__ import annotations

import textwrap
from typing import Any

import bpy

from ..core.effect_rules import RULES
from ..core.effects import OFF
from ..core.settings import describe
from ..render.frame_effects import SETTINGS as EFFECT_SETTINGS
from ..render.technique import technique_by_name
from . import authoring, availability
from .engine import ENGINE_ID
from .properties import effect_property, shown_settings, technique_group

CATEGORY = "VLM"
PIXELS_PER_CHARACTER = 7
LABEL_SHARE = 0.38
EFFECT_LABEL_SHARE = 0.62
FINDINGS_SHOWN = 8


class _SidebarPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY


class VLM_PT_create(_SidebarPanel, bpy.types.Panel):  # noqa: N801 (Blender's naming of classes)
    """What makes a light mesh."""

    bl_label = "Create"

    def draw(self, context: Any) -> None:
        """Buttons, the one setting they share, and what the scene lacks."""
        layout = self.layout
        scene = context.scene
        column = layout.column()
        column.scale_y = 1.5
        button = column.operator("vlm.light_scene", icon="LIGHT_SUN")
        button.target_triangles = scene.vlm.target_triangles
        problem = availability.light_scene_problem(context)
        _hint(layout, context, problem)
        layout.prop(scene.vlm, "target_triangles")
        button = layout.operator("vlm.create_from_selection", icon="MESH_ICOSPHERE")
        button.target_triangles = scene.vlm.target_triangles
        if problem is None:
            _hint(layout, context, availability.selection_problem(context))


class VLM_PT_check(_SidebarPanel, bpy.types.Panel):  # noqa: N801
    """What the scene's light meshes are and what is wrong with them."""

    bl_label = "Check"

    def draw(self, context: Any) -> None:
        """The light meshes with their size, the buttons and the findings of the last check."""
        layout = self.layout
        light_meshes = availability.light_mesh_objects(context.scene)
        if not light_meshes:
            layout.label(text="No light mesh yet", icon="INFO")
        for thing in light_meshes:
            layout.label(text=f"{thing.name}: {authoring.lights(len(thing.data.polygons))}", icon="MESH_DATA")
        row = layout.row(align=True)
        row.operator("vlm.bake", icon="FILE_REFRESH")
        row.operator("vlm.check", icon="CHECKMARK")
        findings = context.scene.vlm.findings
        for finding in findings[:FINDINGS_SHOWN]:
            _wrapped(layout.box().column(align=True), context, finding.text, "ERROR")
        if len(findings) > FINDINGS_SHOWN:
            layout.label(text=f"and {len(findings) - FINDINGS_SHOWN} more")


class VLM_PT_render(_SidebarPanel, bpy.types.Panel):  # noqa: N801
    """How F12 renders."""

    bl_label = "Render"

    def draw(self, context: Any) -> None:
        """The engine, its settings and the render button."""
        layout = self.layout
        scene = context.scene
        _labelled(layout, scene.render, "engine")
        column = layout.column()
        column.active = scene.render.engine == ENGINE_ID
        _labelled(column, scene.vlm, "technique")
        _technique_settings(column, scene)
        column.prop(scene.vlm, "samples")
        column.prop(scene.vlm, "world_lights")
        layout.operator("render.render", text="Render Image", icon="RENDER_STILL")
        _hint(layout, context, availability.rendering_problem())


class VLM_PT_effects(_SidebarPanel, bpy.types.Panel):  # noqa: N801
    """What frames run: each effect where the scene calls for it, unless the artist says otherwise."""

    bl_label = "Effects"
    bl_parent_id = "VLM_PT_render"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012 (Blender's way)

    def draw(self, context: Any) -> None:
        """A choice for each effect, and the settings of those that are not off."""
        group = context.scene.vlm.effects
        for rule in RULES:
            choice = getattr(group, rule.name)
            column = self.layout.column(align=True)
            _labelled(column, group, rule.name, EFFECT_LABEL_SHARE)
            settings_type = EFFECT_SETTINGS.get(rule.name)
            for info in describe(settings_type) if settings_type is not None and choice != OFF else ():
                column.prop(group, effect_property(rule.name, info.name))


def _technique_settings(layout: Any, scene: Any) -> None:
    technique = technique_by_name(scene.vlm.technique)
    group = technique_group(scene, technique.name)
    for name in shown_settings(group, technique.settings):
        if isinstance(getattr(group, name), str):
            _labelled(layout, group, name)
        else:
            layout.prop(group, name)


def _labelled(layout: Any, owner: Any, name: str, label_share: float = LABEL_SHARE) -> None:
    # a plain menu in a narrow sidebar cuts its label off
    split = layout.split(factor=label_share)
    split.label(text=owner.bl_rna.properties[name].name)
    split.prop(owner, name, text="")


def _hint(layout: Any, context: Any, sentence: str | None) -> None:
    if sentence:
        _wrapped(layout.column(align=True), context, sentence, "INFO")


def _wrapped(layout: Any, context: Any, sentence: str, icon: str) -> None:
    width = context.region.width / (context.preferences.system.ui_scale * PIXELS_PER_CHARACTER)
    for number, line in enumerate(textwrap.wrap(sentence, max(int(width) - 5, 12))):
        layout.label(text=line, icon=icon if number == 0 else "BLANK1")


CLASSES = (VLM_PT_create, VLM_PT_check, VLM_PT_render, VLM_PT_effects)
