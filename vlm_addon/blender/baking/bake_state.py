# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether light meshes and the baked light grid are up to date: cheaply all the time, by content when asked.

Blender tells of every change of objects; that sets "may be out of date". What really differs is found by extracting
the scene and comparing hashes, which takes a second for a large scene, so it is done by an operator.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...core.array_codec import content_hash
from ...core.bake_key import BakeKey, grid_changes, grid_key, surface_changes, surface_hashes
from ...core.errors import InvalidInput
from ..extraction.light_mesh_io import extract
from ..interface.availability import GEOMETRY_TYPES
from ..interface.properties import technique_settings
from ..interface.translation import told
from ..light_grid_options import TECHNIQUE, scene_grid_settings
from ..light_meshes import light_meshes, source_names, sources
from ..names import DYNAMIC_PROPERTY, LINKS_PROPERTY
from ..stored_values import plain, text, wrong_value
from . import bake_store

WINDOW_PROPERTY = "vlm_bake"
MADE_FROM_PROPERTY = "vlm_made_from"
"""On light mesh objects: hash of each surface that it was made from, as JSON."""

STAMPED = (LINKS_PROPERTY, DYNAMIC_PROPERTY)
"""Custom properties of light meshes that a baked grid depends on."""

NONE, CURRENT, UNKNOWN, OLD = "NONE", "CURRENT", "UNKNOWN", "OLD"
NOT_TAKEN_ALONG = "The light grid could not be written beside the file: save elsewhere, or bake again"
NOT_BAKED_TO_END = "The light grid was not baked to its end: bake it again"
ICONS = {NONE: "RADIOBUT_OFF", CURRENT: "CHECKMARK", UNKNOWN: "QUESTION", OLD: "ERROR"}


@dataclass(frozen=True)
class Badge:
    """What a panel shows: one of NONE, CURRENT, UNKNOWN, OLD, a sentence and an icon of Blender's."""

    state: str
    text: str

    @property
    def icon(self) -> str:
        """Name of the icon."""
        return ICONS[self.state]


class VLM_PG_bake(bpy.types.PropertyGroup):  # noqa: N801 (Blender's naming of classes)
    """What is known of the age of baked data, in this window manager; not saved."""

    scene: bpy.props.StringProperty(name="Scene")  # type: ignore[valid-type]
    looked: bpy.props.BoolProperty(name="Compared")  # type: ignore[valid-type]
    touched: bpy.props.BoolProperty(name="Changed since")  # type: ignore[valid-type]
    changes: bpy.props.StringProperty(name="What is out of date")  # type: ignore[valid-type]
    stamp: bpy.props.StringProperty(name="What Blender tells no changes of")  # type: ignore[valid-type]
    folder: bpy.props.StringProperty(name="Folder of baked data before a save")  # type: ignore[valid-type]
    left: bpy.props.StringProperty(name="Scenes whose baked data did not go along")  # type: ignore[valid-type]


def badge(context: Any) -> Badge:
    """For a panel: quick, reads no geometry."""
    scene, known = context.scene, _state(context)
    has_grid = bake_store.has_grid(scene)
    if scene.name in known.left.split("\n"):
        return Badge(OLD, NOT_TAKEN_ALONG)
    if bake_store.is_interrupted(scene):
        return Badge(OLD, NOT_BAKED_TO_END)
    if not has_grid and not any(MADE_FROM_PROPERTY in thing for thing in light_meshes(scene)):
        return Badge(NONE, "Nothing is baked")
    if not known.looked or known.scene != scene.name:
        subject = "Light grid baked" if has_grid else "Light mesh made"
        return Badge(UNKNOWN, f"{subject} earlier: compare to see whether it is up to date")
    if known.touched or known.stamp != _stamp(context):
        return Badge(UNKNOWN, "The scene was changed: the bake may be out of date")
    if known.changes:
        return Badge(OLD, f"{told('Out of date:')} {known.changes}")
    return Badge(CURRENT, "Up to date" if has_grid else "Up to date; no light grid is baked")


def compare_problem(context: Any) -> str | None:
    """Why there is nothing to compare the scene with, or None."""
    return "Nothing is baked: create a light mesh first" if badge(context).state == NONE else None


def compare(context: Any) -> tuple[str, ...]:
    """What of the scene's light meshes and light grid is out of date, in phrases, found by content; also remembered.

    Raises InvalidInput where the scene cannot be read, or what is stored cannot.
    """
    scene = context.scene
    for thing in context.objects_in_mode:
        thing.update_from_editmode()
    found = extract()
    hashes = surface_hashes(found.snapshot.meshes)
    changes = []
    for thing in light_meshes(scene):
        before = made_from_by_present_names(thing, scene)
        changes += [f"{thing.name}: {phrase}" for phrase in surface_changes(before, hashes)] if before else []
    stored, settings = bake_store.stored_key(scene), scene_grid_settings(scene)
    if stored is not None and (found.light_mesh is None or settings is None):
        changes.append("light grid: the scene uses none any more")
    elif stored is not None and found.light_mesh is not None:
        now = grid_key(found.snapshot.meshes, found.light_mesh, settings)
        changes += [f"light grid: {phrase}" for phrase in grid_changes(stored, now)]
    if bake_store.is_interrupted(scene):
        changes.append("light grid: it was not baked to its end")
    remember(context, changes)
    return tuple(changes)


def made_from(thing: Any) -> dict[str, str]:
    """Hash by name of the surfaces that a light mesh was made from; empty where that is not known.

    Raises InvalidInput where it cannot be read.
    """
    stored = text(thing, MADE_FROM_PROPERTY)
    if not stored:
        return {}
    try:
        tree = {"surfaces": json.loads(stored), "lights": "", "settings": ""}
        return dict(BakeKey.from_json(tree, MADE_FROM_PROPERTY).surfaces)
    except (ValueError, InvalidInput) as error:
        raise wrong_value(thing, MADE_FROM_PROPERTY, "what a light mesh was made from") from error


def made_from_by_present_names(thing: Any, scene: Any) -> dict[str, str]:
    """`made_from` by the names that the sources have now: renaming changes no surface. Raises InvalidInput."""
    pairs = zip(source_names(thing), sources(thing, scene), strict=True)
    present = {name: source.name for name, source in pairs if source is not None}
    return {present.get(name, name): found for name, found in made_from(thing).items()}


def readable_made_from(thing: Any, scene: Any) -> dict[str, str]:
    """`made_from_by_present_names`, empty where it cannot be read: comparing says so, following goes on."""
    try:
        return made_from_by_present_names(thing, scene)
    except InvalidInput:
        return {}


def set_made_from(thing: Any, hashes: Mapping[str, str]) -> None:
    """Remember what a light mesh was made from, as `surface_hashes` tells."""
    thing[MADE_FROM_PROPERTY] = json.dumps(dict(hashes))


def remember(context: Any, changes: list[str] | tuple[str, ...]) -> None:
    """The scene was compared just now."""
    known = _state(context)
    known.scene, known.looked, known.touched = context.scene.name, True, False
    known.changes = "; ".join(changes)
    known.stamp = _stamp(context)


def forget(context: Any) -> None:
    """Whether baked data is up to date is not known."""
    known = _state(context)
    known.looked, known.touched, known.changes, known.left = False, False, "", ""


def _stamp(context: Any) -> str:
    """What a bake depends on and Blender tells no changes of: custom properties, settings, what is hidden."""
    things = context.view_layer.objects
    hidden = np.zeros(len(things), bool)
    things.foreach_get("hide_render", hidden)
    stored = [(thing.name, [str(plain(thing.get(key))) for key in STAMPED]) for thing in light_meshes(context.scene)]
    settings = technique_settings(context.scene, TECHNIQUE)
    return content_hash([repr(settings), repr(stored), hidden])


def _state(context: Any) -> Any:
    return getattr(context.window_manager, WINDOW_PROPERTY)


def _counts(update: Any) -> bool:
    """Whether an update of the depsgraph is about what lights are made from."""
    identity = update.id
    if isinstance(identity, bpy.types.Object):
        moved = update.is_updated_geometry or update.is_updated_transform
        return moved and (identity.type in GEOMETRY_TYPES or identity.is_instancer)
    if isinstance(identity, bpy.types.Image):
        return identity.source != "VIEWER"  # pictures that Blender renders
    if isinstance(identity, bpy.types.Material):
        return bool(update.is_updated_shading)
    return isinstance(identity, bpy.types.Scene) and update.is_updated_geometry


@persistent
def _after_update(scene: Any, depsgraph: Any) -> None:
    known = _state(bpy.context)
    if known.touched or not known.looked:
        return
    if any(map(_counts, depsgraph.updates)):
        known.touched = True


@persistent
def _after_undo(*_: Any) -> None:
    _state(bpy.context).touched = True


@persistent
def _after_load(*_: Any) -> None:
    forget(bpy.context)
    bake_store.clear_unsaved()


@persistent
def _before_save(*_: Any) -> None:
    known = _state(bpy.context)
    if not known.left:  # what did not go along is tried again from where it is
        known.folder = str(bake_store.folder_beside(bpy.data.filepath))


@persistent
def _after_save(path: str, *_: Any) -> None:
    # A copy that is saved elsewhere is another program's or a backup; the open file goes on where it is.
    if Path(path) == Path(bpy.data.filepath):
        known = _state(bpy.context)
        known.left = "\n".join(bake_store.take_along(Path(known.folder), path))


def register(undo: ExitStack) -> None:
    """Keep the badge up to date from now on; `undo` hears how to stop that."""
    bpy.utils.register_class(VLM_PG_bake)
    undo.callback(bpy.utils.unregister_class, VLM_PG_bake)
    setattr(bpy.types.WindowManager, WINDOW_PROPERTY, bpy.props.PointerProperty(type=VLM_PG_bake))
    undo.callback(delattr, bpy.types.WindowManager, WINDOW_PROPERTY)
    handlers = bpy.app.handlers
    for listed, handler in (
        (handlers.depsgraph_update_post, _after_update),
        (handlers.undo_post, _after_undo),
        (handlers.redo_post, _after_undo),
        (handlers.load_post, _after_load),
        (handlers.save_pre, _before_save),
        (handlers.save_post, _after_save),
    ):
        listed.append(handler)
        undo.callback(listed.remove, handler)
