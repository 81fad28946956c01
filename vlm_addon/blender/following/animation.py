# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators of animation do with the selected light meshes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ...core.bake_key import surface_hashes
from ...core.counting import counted
from ...core.errors import VlmError
from ...core.scene import Finding
from ..baking.bake_state import readable_made_from, set_made_from
from ..extraction.dynamics import is_dynamic
from ..extraction.extract import ExtractOptions, extract_scene
from ..interface.availability import has_geometry
from ..light_meshes import chosen_light_meshes, is_local, light_meshes, require_editable, sources
from .follow_rig import is_following
from .follow_source import AUTO, Following, follow_sources, require_followable, stop_following

MILLIMETRES = 1000.0
LEFT_BEHIND = "left_behind"
"""Kind of a finding."""


def follow_problem(context: Any) -> str | None:
    """Why no light mesh can follow anything, or None."""
    return _selection_problem(context)


def free_problem(context: Any) -> str | None:
    """Why no light mesh can be freed, or None."""
    problem = _selection_problem(context)
    if problem is None and not any(map(is_following, chosen_light_meshes(context))):
        return "No selected light mesh follows its source: select one that does"
    return problem


def follow(context: Any, way: str = AUTO) -> list[tuple[str, str]]:
    """Let the selected light meshes follow their sources, or the other selected objects where there are any.

    Returns reports as (level, sentence). Raises VlmError before anything is changed.
    """
    things = chosen_light_meshes(context)
    others = [thing for thing in context.selected_objects if has_geometry(thing)]
    for thing in things:
        require_followable(thing, context, others)
    done = [entry for thing in things for entry in follow_sources(thing, context, others, way)]
    _keep_up_to_date(context.scene, {context.scene.objects[entry.light_mesh]: entry.source for entry in done})
    return [_report(entry) for entry in done]


def _keep_up_to_date(scene: Any, followed: dict[Any, str]) -> None:
    """Light meshes that were up to date are so with a source that moves by now: it is known by its shape alone then."""
    meshes = extract_scene(ExtractOptions(objects=frozenset(followed.values()))).meshes
    moving, still = surface_hashes(meshes), surface_hashes(replace(mesh, dynamic=False) for mesh in meshes)
    for thing, source in followed.items():
        before = readable_made_from(thing, scene)
        if source in moving and before.get(source) == still[source]:
            set_made_from(thing, {**before, source: moving[source]})


def free(context: Any) -> int:
    """Free the selected light meshes; returns how many followed something. Raises VlmError."""
    things = chosen_light_meshes(context)
    for thing in things:
        require_editable(thing)
    return sum(stop_following(thing, context) for thing in things)


def followed_by(name: str, scene: Any) -> Any | None:
    """What a light mesh that is about to be made anew follows; None where it is new or follows nothing."""
    thing = scene.objects.get(name)
    return thing.parent if thing is not None and is_following(thing) else None


def follow_again(thing: Any, followed: Any | None, context: Any) -> str:
    """Let a light mesh that was made anew follow what it followed, with its new shape; returns what to add to a report.

    Where that is not what it now stands for alone, or cannot be bound at this frame, it stands still.
    """
    if not is_following(thing):
        return ""
    stop_following(thing, context)
    if followed is None or sources(thing, context.scene) != [followed]:
        return "; it follows nothing any more: use Follow Source"
    try:
        follow_sources(thing, context)
    except VlmError as error:
        return f"; it follows nothing any more ({error})"
    return f"; it follows {followed.name} again"


def left_behind(scene: Any) -> list[Finding]:
    """A finding for each light mesh that stands still while something that it was made from moves."""
    found = []
    for thing in light_meshes(scene):
        moving = [source.name for source in sources(thing, scene) if source is not None and is_dynamic(source)]
        if moving and not is_dynamic(thing):
            problem = f"it stands still and {moving[0]!r}, which it was made from, moves"
            found.append(Finding(f"light mesh {thing.name!r}", problem, "use Follow Source", kind=LEFT_BEHIND))
    return found


def _selection_problem(context: Any) -> str | None:
    if context.mode != "OBJECT":
        return "Leave this mode first (Tab): light meshes are bound to their sources in Object Mode"
    chosen = chosen_light_meshes(context)
    if not chosen:
        return "Select a light mesh (collection Virtual Light Meshes)"
    linked = next((thing for thing in chosen if not is_local(thing)), None)
    return f"{linked.name} is linked from another file: make it local first" if linked is not None else None


def _report(entry: Following) -> tuple[str, str]:
    how = f"{entry.light_mesh} follows {entry.source} by its {entry.way.lower()}"
    distance = f"{counted(entry.vertices, 'vertex')}, {MILLIMETRES * entry.distance:.2g} mm from it on average"
    if not entry.note:
        return "INFO", f"{how}: {distance}"
    return "WARNING", f"{how}: {distance}; {entry.note}"
