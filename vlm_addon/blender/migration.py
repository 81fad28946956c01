# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes that an earlier version of the extension wrote, brought up to the present table of names.

Version 1 knew its sources by name alone; version 2 gives them ids. Linked light meshes stay as they are: they are
read in either form.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ..core.errors import InvalidInput
from .light_factors import describe_factors
from .light_meshes import is_local, light_meshes, set_sources, source_names
from .names import SCHEMA_PROPERTY, SCHEMA_VERSION, SOURCES_PROPERTY
from .stored_values import whole_number


def migrate_file() -> int:
    """Bring all light meshes of the open file up to SCHEMA_VERSION; returns how many were older."""
    return sum(_migrate(thing, scene) for scene in bpy.data.scenes for thing in light_meshes(scene))


def _migrate(thing: Any, scene: Any) -> bool:
    try:
        if not is_local(thing) or whole_number(thing, SCHEMA_PROPERTY) >= SCHEMA_VERSION:
            return False
        names = source_names(thing)
    except InvalidInput:
        return False  # who works with it is told so
    describe_factors(thing)
    if SOURCES_PROPERTY in thing:
        set_sources(thing, names, scene)
    thing[SCHEMA_PROPERTY] = SCHEMA_VERSION
    return True


@persistent
def _after_load(*_: Any) -> None:
    migrate_file()


def register(undo: ExitStack) -> None:
    """Migrate what is opened from now on; `undo` hears how to stop that."""
    bpy.app.handlers.load_post.append(_after_load)
    undo.callback(bpy.app.handlers.load_post.remove, _after_load)
