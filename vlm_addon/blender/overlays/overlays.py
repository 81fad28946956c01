# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays in the 3D view: which are shown, and what draws them while they are. Off, they cost nothing: no handler.

State is in the window manager: it is no part of the file and needs no undo.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...core.grid_samples import GridView
from ...core.light_grid import FEW_LIGHTS, TOLERANCE
from ..interface.translation import OWN_CONTEXT
from ..light_meshes import light_meshes
from .overlay_drawing import OverlayDrawing, reach_of
from .overlay_shapes import COLOR, EMISSION, MOST_HALF_BALLS, NONE, TAGS

WINDOW_PROPERTY = "vlm_overlay"
CURSOR = "CURSOR"
FILLS = (
    (NONE, "None", "Faces are not filled"),
    (COLOR, "Color", "Color times hue and strength; what is brighter than white still differs"),
    (EMISSION, "Emission", "What lights send out by themselves"),
    (TAGS, "Tags", "A color for each tag id, on lights and on visible faces; gray lights have none"),
)
PLACES = (
    (CURSOR, "Around 3D Cursor", "Boxes around the 3D cursor, with numbers"),
    ("X", "Slice X", "The layer across X that holds the 3D cursor"),
    ("Y", "Slice Y", "The layer across Y that holds the 3D cursor"),
    ("Z", "Slice Z", "The layer across Z that holds the 3D cursor"),
)

_DRAWING = OverlayDrawing()
"""What is drawn, and Blender's handles for it, which Blender keeps no list of."""


def _switched(settings: Any, context: Any) -> None:
    _follow(settings.show)
    _redraw(settings, context)


def _redraw(settings: Any, context: Any) -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


class VLM_PG_overlay(bpy.types.PropertyGroup):  # noqa: N801 (Blender's naming of classes)
    """Which overlays the 3D views of this window manager show; not saved."""

    show: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Light Mesh Overlays",
        description="Show light meshes in the 3D views; off, they cost nothing",
        default=False,
        update=_switched,
        options={"SKIP_SAVE"},
    )
    fill: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Fill",
        description="What the faces of lights show",
        items=FILLS,
        default=COLOR,
        update=_redraw,
        translation_context=OWN_CONTEXT,
    )
    sides: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Shining Side",
        description="Outlines, a line towards the side that shines, and stripes on the back",
        default=True,
        update=_redraw,
    )
    findings: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Findings", description="Mark in red what the last check found", default=True, update=_redraw
    )
    half_balls: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Reach",
        description=f"Half ball that each chosen light reaches, with Lights set to Range; at most {MOST_HALF_BALLS}",
        default=False,
        update=_redraw,
    )
    grid: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Light Grid",
        description="Cells of what Show Light Grid has made: how many lights count, or how far light may be off",
        default=False,
        update=_redraw,
    )
    grid_place: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Cells", description="Which cells to show", items=PLACES, default=CURSOR, update=_redraw
    )
    in_front: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="In Front", description="Show lights through whatever is before them", default=False, update=_redraw
    )
    opacity: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Opacity", description="Of filled faces", min=0.05, max=1.0, default=0.7, subtype="FACTOR", update=_redraw
    )


def settings_of(context: Any) -> Any:
    """The overlay settings of this window manager."""
    return getattr(context.window_manager, WINDOW_PROPERTY)


def overlay_hint(context: Any) -> str | None:
    """A sentence for the panel where something that is switched on shows nothing, or None."""
    settings = settings_of(context)
    if not settings.show:
        return None
    if not light_meshes(context.scene):
        return "There is no light mesh to show: create one first"
    if settings.half_balls and reach_of(context.scene) is None:
        return "Lights reach everywhere: Reach shows something with Lights set to Range (Render)"
    if not settings.grid:
        return None
    shown = _DRAWING.grid_of(context.scene)
    if shown is None:
        return "No light grid is shown yet: press Show Light Grid"
    if shown.grid.settings.mode == TOLERANCE and shown.grid.light_count <= FEW_LIGHTS:
        return f"Up to {FEW_LIGHTS} lights are summed one by one: pictures have no such error"
    return None


def show_grid(context: Any, scene: Any, view: GridView) -> None:
    """Show a light grid of `scene` from now on."""
    _DRAWING.set_grid(scene, view)
    settings = settings_of(context)
    settings.grid = True
    settings.show = True


def _follow(is_shown: bool) -> None:
    """Handlers while something is shown, none otherwise."""
    handlers = bpy.app.handlers
    for found, own in (
        (handlers.depsgraph_update_post, _depsgraph_changed),
        (handlers.undo_post, _data_replaced),
        (handlers.redo_post, _data_replaced),
    ):
        if is_shown and own not in found:
            found.append(own)
        elif not is_shown and own in found:
            found.remove(own)
    if is_shown:
        _DRAWING.begin()
    else:
        _DRAWING.end()


@persistent
def _depsgraph_changed(scene: Any, depsgraph: Any) -> None:
    for update in depsgraph.updates:
        _DRAWING.touch(update.id)


@persistent
def _data_replaced(scene: Any, *rest: Any) -> None:
    _DRAWING.forget()


@persistent
def _file_loaded(*rest: Any) -> None:
    _DRAWING.forget(with_grids=True)
    _follow(settings_of(bpy.context).show)


def register(undo: ExitStack) -> None:
    """Add the settings; nothing draws until they are switched on."""
    bpy.utils.register_class(VLM_PG_overlay)
    undo.callback(bpy.utils.unregister_class, VLM_PG_overlay)
    setattr(bpy.types.WindowManager, WINDOW_PROPERTY, bpy.props.PointerProperty(type=VLM_PG_overlay))
    undo.callback(delattr, bpy.types.WindowManager, WINDOW_PROPERTY)
    bpy.app.handlers.load_post.append(_file_loaded)
    undo.callback(bpy.app.handlers.load_post.remove, _file_loaded)
    undo.callback(_follow, False)
