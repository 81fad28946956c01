# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody who helps needs to know, as text: versions, device, settings, the renderer's last words.

Names of scenes, objects and folders of the user are left out: the text is meant to be posted.
"""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...core.effect_rules import RULES
from ..authoring import lights
from ..baking import bake_state
from ..interface.availability import GEOMETRY_TYPES, authoring_problem, rendering_problem
from ..interface.properties import technique_settings
from ..light_meshes import light_meshes
from ..names import is_light_mesh
from . import render_log
from .licences import BUNDLED, extension_version, version

LOG_LINES = 15
HOME = "~"


def diagnostics(context: Any) -> str:
    """The text, some 40 lines."""
    parts = (_versions(), _device(), _scene(context), _log())
    return "\n".join(line for part in parts for line in part) + "\n"


def _versions() -> Iterator[str]:
    yield f"Virtual Light Mesh {extension_version()}"
    build = f"{bpy.app.build_hash.decode()}, {bpy.app.build_branch.decode()}"
    window = "no window" if bpy.app.background else "window"
    yield f"Blender {bpy.app.version_string} ({build}), {window}"
    yield f"{platform.platform()}, Python {sys.version.split()[0]}"
    installed = ", ".join(f"{name} {version(name)}" for name, _, _ in BUNDLED)
    yield f"Modules: numpy {np.__version__}, {installed}"


def _device() -> Iterator[str]:
    yield f"Authoring: {authoring_problem() or 'ready'}"
    yield f"Renderer: {rendering_problem() or 'ready'}"
    if not bpy.app.background:
        import gpu  # fails without a window

        names = gpu.platform
        yield f"Window's device: {names.vendor_get()}, {names.renderer_get()}, {names.version_get()}"


def _scene(context: Any) -> Iterator[str]:
    scene = context.scene
    settings = scene.vlm
    shown = [thing for thing in scene.objects if thing.type in GEOMETRY_TYPES and not is_light_mesh(thing)]
    found = light_meshes(scene)
    count = lights(sum(len(thing.data.polygons) for thing in found))
    yield f"Scene: surface objects {len(shown)}, light meshes {len(found)} with {count}, frame {scene.frame_current}"
    yield f"Saved: {bool(bpy.data.filepath)}; engine {scene.render.engine}; mode {context.mode}"
    yield f"Bake: {bake_state.badge(context).state}; findings of the last check: {len(settings.findings)}"
    size = f"{scene.render.resolution_x} x {scene.render.resolution_y} at {scene.render.resolution_percentage} %"
    yield f"Picture: {size}, {settings.samples} samples, {settings.world_lights} world lights"
    values = technique_settings(scene, settings.technique)
    told = ", ".join(f"{name} {value}" for name, value in values.items())
    yield f"Technique {settings.technique}: {told or 'no settings'}"
    yield "Effects: " + ", ".join(f"{rule.name} {getattr(settings.effects, rule.name)}" for rule in RULES)


def _log() -> Iterator[str]:
    yield f"Log: {without_home(str(render_log.path()))}"
    yield from (without_home(line) for line in render_log.tail(LOG_LINES))


def without_home(text: str) -> str:
    """`text` with the user's home folder as ~, since it often holds a name."""
    return text.replace(str(Path.home()), HOME)
