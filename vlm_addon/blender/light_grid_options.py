# SPDX-License-Identifier: GPL-3.0-or-later
"""Which light grid a scene asks for: its own settings, and options of the command line over them."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import fields
from typing import Any

from ..core.errors import InvalidInput
from ..core.light_grid import RANGE, TOLERANCE, GridSettings
from ..core.settings import from_mapping
from ..render.technique import technique_by_name
from ..render.techniques.vlm import BAKED
from .interface.properties import technique_group, technique_settings

TECHNIQUE = "vlm"
VISIBILITY = "visibility"
"""The technique's setting that says what stands in the way of light."""
MODE = "lights"
"""The technique's setting that holds the grid's mode, or that there is none."""


def scene_grid_settings(scene: Any) -> GridSettings | None:
    """What `scene` asks for; None where all lights are summed without a structure. Raises InvalidInput."""
    values = technique_settings(scene, TECHNIQUE)
    if values[MODE] not in (TOLERANCE, RANGE):
        return None
    values["mode"] = values.pop(MODE)
    known = {field.name for field in fields(GridSettings)}
    return from_mapping(GridSettings, {name: values[name] for name in known}, "the light grid")


def keep_options(scene: Any, arguments: Namespace) -> None:
    """Writes the options of `bake` that were given into the settings of `scene`. Raises InvalidInput."""
    values = technique_settings(scene, TECHNIQUE)
    options = {name: getattr(arguments, name) for name in ("tolerance", "range", "grid", "max_lights")}
    given = {name: value for name, value in options.items() if value is not None}
    for mode in (TOLERANCE, RANGE):
        if mode in given:
            given[MODE] = mode
    if arguments.visibility:
        given[VISIBILITY] = BAKED
    values |= given
    for name in ("grid", "max_lights"):
        if name in given and values[MODE] != RANGE:
            problem = f"{given[name]} does nothing: the light grid has no cells with a tolerance"
            raise InvalidInput(f"--{name.replace('_', '-')}", problem, "give --range too, or leave it out")
    from_mapping(technique_by_name(TECHNIQUE).settings, values, "bake")
    group = technique_group(scene, TECHNIQUE)
    for name, value in given.items():
        setattr(group, name, value)
