# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own panels that are shown with our engine too: material, light, world, camera, output."""

from __future__ import annotations

from typing import Any

import bpy

from ..engine import ENGINE_ID

# Panels for any engine say BLENDER_RENDER; of those, these have a fuller EEVEE twin or show what we do not render.
LEFT_OUT = {"DATA_PT_light", "NODE_DATA_PT_light"}
LEFT_OUT_WORD = "freestyle"

FROM_EEVEE = {
    "DATA_PT_EEVEE_light",
    "DATA_PT_EEVEE_light_shadow",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "MATERIAL_PT_preview",
    "NODE_DATA_PT_EEVEE_light",
}


def register() -> None:
    """Show the panels while our engine is chosen."""
    for panel in _panels():
        panel.COMPAT_ENGINES.add(ENGINE_ID)


def unregister() -> None:
    """Hide them again."""
    for panel in bpy.types.Panel.__subclasses__():
        getattr(panel, "COMPAT_ENGINES", set()).discard(ENGINE_ID)


def _panels() -> list[Any]:
    panels = [panel for panel in bpy.types.Panel.__subclasses__() if isinstance(_engines(panel), set)]
    return [panel for panel in panels if panel.__name__ in FROM_EEVEE or _is_for_any_engine(panel)]


def _engines(panel: Any) -> Any:
    return getattr(panel, "COMPAT_ENGINES", None)


def _is_for_any_engine(panel: Any) -> bool:
    name = panel.__name__
    return "BLENDER_RENDER" in _engines(panel) and name not in LEFT_OUT and LEFT_OUT_WORD not in name
