# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of the visible materials for lights: of each light's own region, or picked at a place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.errors import InvalidInput
from ..core.mesh_topology import Bool
from ..core.progress import Progress
from ..core.scene import Float64
from .authoring import lights
from .drawing.draw_points import LIKELY_SPAN, require_distance
from .extraction.color_space import convert, rec709_to_working
from .extraction.extract import ExtractOptions, extract_scene
from .light_colors import ATTRIBUTES, FaceValues, chosen_areas, new_values, one_per_mesh, write_planned
from .light_faces import chosen_faces, read_faces
from .light_geometry import LightFaces, light_faces_in_world
from .light_meshes import require_editable, unchanged_light_mesh
from .names import COLOR_ATTRIBUTE, EMISSION_ATTRIBUTE, LOCK_ATTRIBUTE
from .source_colors import SourceColors, SurfaceColors
from .tagging.source_faces import owners_of

POINT, OBJECT = "POINT", "OBJECT"
PLACES = (
    (POINT, "Point", "The visible surface around a point, over the size of the selected lights"),
    (OBJECT, "Object", "The mean of a whole object"),
)
"""Items of a Blender enum: where a colour is picked."""
ON_SURFACE = 1e-3
"""How far from an object, as a share of its size, a point is still on it."""


@dataclass(frozen=True)
class Wanted:
    """Lights of one light mesh that are to be recoloured: its name, which faces, and where these are."""

    name: str
    chosen: Bool
    lights: LightFaces


@dataclass(frozen=True)
class Recolored:
    """Colours found for the lights of each light mesh. quantity: which of them count. locked: lights left out."""

    found: tuple[tuple[Wanted, SurfaceColors], ...]
    quantity: str
    locked: int


def from_materials(
    context: Any, things: Sequence[Any], quantity: str, keep_locked: bool
) -> Callable[[Progress], Recolored]:
    """Work that looks up the materials in front of the chosen lights of `things`. Raises InvalidInput."""
    depsgraph = context.evaluated_depsgraph_get()
    wanted, locked = [], 0
    for thing in one_per_mesh(things):
        require_editable(thing)
        chosen = chosen_faces(thing)
        if keep_locked:
            held = chosen & (read_faces(thing, LOCK_ATTRIBUTE) != 0)
            locked, chosen = locked + int(held.sum()), chosen & ~held
        wanted.append(Wanted(thing.name, chosen, light_faces_in_world(thing, depsgraph).subset(chosen)))
    if not any(each.chosen.any() for each in wanted):
        problem = f"all {lights(locked)} that are chosen are locked" if locked else "no light is chosen"
        raise InvalidInput("the selection", problem, "select faces of the light mesh, or unlock them")
    snapshot = extract_scene()

    def work(progress: Progress) -> Recolored:
        source = SourceColors(snapshot)
        return Recolored(tuple((each, source.of_lights(each.lights, progress)) for each in wanted), quantity, locked)

    return work


def write_recolored(context: Any, made: Recolored) -> str:
    """Write the colours that were found; returns a sentence with counts.

    Raises InvalidInput where a light mesh is not what it was when the work began; nothing is changed then.
    """
    planned: list[FaceValues] = []
    missed = 0
    for wanted, colors in made.found:
        count, doing = len(wanted.chosen), "its materials were looked up"
        thing = unchanged_light_mesh(context.scene, wanted.name, count, doing, "recolor it again")
        chosen = wanted.chosen.copy()
        chosen[wanted.chosen] = colors.found
        missed += int((~colors.found).sum())
        planned += _values(thing, chosen, colors, made.quantity)
    told = f"Recolored {lights(write_planned(planned))} from materials"
    if missed:
        told += f"; {lights(missed)} with no visible surface in front as before"
    return told + (f"; {lights(made.locked)} locked" if made.locked else "")


def _values(thing: Any, chosen: Bool, colors: SurfaceColors, quantity: str) -> list[FaceValues]:
    """`colors`, one row for all or one for each face of `chosen`, as values of that light mesh."""
    rows = {COLOR_ATTRIBUTE: colors.reflectance, EMISSION_ATTRIBUTE: colors.emission}
    return [
        new_values(thing, name, chosen, _all_are(_in_working_space(rows[name][colors.found])), colors=True)
        for name in ATTRIBUTES[quantity]
    ]


def _all_are(colors: Float64) -> Callable[[Float64], Float64]:
    return lambda before: np.broadcast_to(colors, before.shape)


def _in_working_space(colors: Float64) -> Float64:
    return np.maximum(convert(colors, rec709_to_working()), 0.0)


@dataclass(frozen=True)
class Place:
    """Where a colour is picked.

    kind: POINT, the surface nearest to `location` (m, world space) within `radius` (m; 0: the size of the lights that
    get the colour), or OBJECT, the mean of a whole object. source: name of the object, "" for any at a point.
    """

    kind: str
    location: tuple[float, float, float]
    source: str
    radius: float


def pick(context: Any, things: Sequence[Any], place: Place, quantity: str) -> int:
    """Give the chosen lights of `things` the colour of the visible surface at `place`; returns how many lights.

    The surface is what the viewport shows. Raises InvalidInput.
    """
    require_distance(place.radius, "radius")
    if not (np.abs(place.location) <= LIKELY_SPAN).all():
        raise InvalidInput("location", f"it is {place.location}", f"give meters up to {LIKELY_SPAN:g}")
    if place.kind == OBJECT:
        colors = _surface(place.source).of_all()
    else:
        radius = place.radius or float(np.sqrt(chosen_areas(things).mean() / np.pi))
        colors = _surface_at(place).around(place.location, radius)
    planned: list[FaceValues] = []
    for thing in one_per_mesh(things):
        require_editable(thing)
        planned += _values(thing, chosen_faces(thing), colors, quantity)
    return write_planned(planned)


def _surface(source: str) -> SourceColors:
    """All that the viewport shows of one object, and of what it instances. Raises InvalidInput where it is nothing."""
    snapshot = extract_scene(ExtractOptions(viewport_levels=True, objects=frozenset([source])))
    if not snapshot.triangle_count:
        raise InvalidInput(f"object {source!r}", "the view shows no surface of it", "name an object that is shown")
    return SourceColors(snapshot)


def _surface_at(place: Place) -> SourceColors:
    """What a point is looked up on: its object alone, or all where none is named or the point is on an instance."""
    if not place.source:
        return SourceColors(extract_scene(ExtractOptions(viewport_levels=True)))
    chosen = extract_scene(ExtractOptions(viewport_levels=True, objects=frozenset([place.source])))
    if chosen.triangle_count:
        alone = SourceColors(chosen)
        low, high = chosen.bounds()
        if alone.distance(place.location) <= ON_SURFACE * np.linalg.norm(high - low):
            return alone
    everything = extract_scene(ExtractOptions(viewport_levels=True))
    meshes = tuple(mesh for mesh in everything.meshes if place.source in owners_of(mesh.name))
    if not meshes:
        raise InvalidInput(
            f"object {place.source!r}", "the view shows no surface of it", "name an object that is shown"
        )
    return SourceColors(replace(everything, meshes=meshes))
