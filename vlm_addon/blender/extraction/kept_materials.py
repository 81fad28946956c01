# SPDX-License-Identifier: GPL-3.0-or-later
"""The materials that strokes have read, kept until one of them changes: reading a picture takes longer than a stroke.

Nothing of Blender's data is kept, only arrays made of it.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import bpy
from bpy.app.handlers import persistent

from .color_space import working_to_rec709
from .materials import FindingList, MaterialTable
from .mesh_extraction import MeshExtractor

DECIDE_COLORS = ("MATERIAL", "IMAGE", "NODETREE", "TEXTURE")
"""Types of data that decide what a surface reflects."""

MOST_BYTES = 2**28
"""Pictures of more than this are read again for each stroke."""

_KEPT: list[tuple[MaterialTable, MeshExtractor]] = []
"""One entry at most. Blender calls the handlers without any object that could hold it."""
_WATCHED: list[bool] = []
"""Not empty while the handlers tell of changes; without them nothing is kept."""


def material_reader(depsgraph: Any) -> MeshExtractor:
    """Reads the materials of what is under a stroke, each once until it changes."""
    if _KEPT:
        return _KEPT[0][1]
    to_rec709, report = working_to_rec709(), FindingList()
    table = MaterialTable(to_rec709, report)
    reader = MeshExtractor(table, to_rec709, report, depsgraph)
    # An override is Blender's data, which must not be kept.
    if _WATCHED and depsgraph.view_layer.material_override is None:
        _KEPT.append((table, reader))
    return reader


def forget_large() -> None:
    """After a stroke: keep no more than MOST_BYTES."""
    if _KEPT and sum(texture.pixels.nbytes for texture in _KEPT[0][0].textures) > MOST_BYTES:
        _KEPT.clear()


@persistent
def _forget(*_: Any) -> None:
    _KEPT.clear()


@persistent
def _forget_changed(scene: Any, depsgraph: Any) -> None:
    if _KEPT and any(depsgraph.id_type_updated(kind) for kind in DECIDE_COLORS):
        _KEPT.clear()


def register(undo: ExitStack) -> None:
    """Listen for changes from now on; `undo` hears how to stop that."""
    handlers = bpy.app.handlers
    for listeners in (handlers.load_post, handlers.undo_post, handlers.redo_post, handlers.frame_change_post):
        listeners.append(_forget)
        undo.callback(listeners.remove, _forget)
    handlers.depsgraph_update_post.append(_forget_changed)
    undo.callback(handlers.depsgraph_update_post.remove, _forget_changed)
    _WATCHED.append(True)
    undo.callback(_WATCHED.clear)
    undo.callback(_KEPT.clear)
