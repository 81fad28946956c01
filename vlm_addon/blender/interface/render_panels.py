# SPDX-License-Identifier: GPL-3.0-or-later
"""The end of the sidebar tab: how F12 renders, and what its frames run."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.effect_rules import RULES
from ...core.effects import OFF
from ...core.settings import describe
from ...render.frame_effects import SETTINGS as EFFECT_SETTINGS
from ...render.technique import technique_by_name
from ..engine import ENGINE_ID
from . import availability
from .panel_layout import SidebarPanel, hint, labelled
from .properties import effect_property, shown_settings, technique_group

EFFECT_LABEL_SHARE = 0.62


class VLM_PT_render(SidebarPanel, bpy.types.Panel):  # noqa: N801 (Blender's naming of classes)
    """How F12 renders."""

    bl_label = "Render"

    def draw(self, context: Any) -> None:
        """The engine, its settings and the render button."""
        layout = self.layout
        scene = context.scene
        labelled(layout, scene.render, "engine")
        column = layout.column()
        column.active = scene.render.engine == ENGINE_ID
        labelled(column, scene.vlm, "technique")
        _technique_settings(column, scene)
        column.prop(scene.vlm, "samples")
        column.prop(scene.vlm, "world_lights")
        layout.operator("render.render", text="Render Image", icon="RENDER_STILL")
        hint(layout, context, availability.rendering_problem())


class VLM_PT_effects(SidebarPanel, bpy.types.Panel):  # noqa: N801
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
            labelled(column, group, rule.name, EFFECT_LABEL_SHARE)
            settings_type = EFFECT_SETTINGS.get(rule.name)
            for info in describe(settings_type) if settings_type is not None and choice != OFF else ():
                column.prop(group, effect_property(rule.name, info.name))


def _technique_settings(layout: Any, scene: Any) -> None:
    technique = technique_by_name(scene.vlm.technique)
    group = technique_group(scene, technique.name)
    for name in shown_settings(group, technique.settings):
        if isinstance(getattr(group, name), str):
            labelled(layout, group, name)
        else:
            layout.prop(group, name)


CLASSES = (VLM_PT_render, VLM_PT_effects)
