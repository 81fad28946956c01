# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking for what is wrong with the scene's light meshes, in steps: read, look without Blender's data, list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..core.bake_key import surface_hashes
from ..core.progress import Progress
from ..core.scene import Finding
from ..light_grid_bake import check_lights
from .authoring import lights, require_scene
from .extraction.light_mesh_io import Extraction, LightOrigins, extract
from .findings import list_findings
from .following import animation
from .light_grid_options import scene_grid_settings
from .light_history import light_history
from .source_changes import changed_sources


@dataclass(frozen=True)
class Checked:
    """What a check found, and where the lights that it names are stored."""

    scene: str
    findings: tuple[Finding, ...]
    origins: LightOrigins | None


def check(context: Any) -> Callable[[Progress], Checked]:
    """Work that looks for what is wrong with the light meshes and the light grid of the scene, and what extraction had
    to approximate."""
    found = extract_edited(context)
    look = findings_of(context.scene, found)
    return lambda progress: Checked(found.snapshot.name, (*look(progress), *found.snapshot.findings), found.origins)


def findings_of(scene: Any, found: Extraction) -> Callable[[Progress], tuple[Finding, ...]]:
    """Work that looks for what is wrong with the lights that were `found` in `scene`, with whatever values they have:
    first what has become of the sources, which is often why the rest is wrong."""
    causes = changed_sources(scene, surface_hashes(found.snapshot.meshes))
    settings = scene_grid_settings(scene)
    notes = (*over_budget(scene, len(found.light_mesh or ())), *animation.left_behind(scene))
    history = light_history(scene, found)

    def work(progress: Progress) -> tuple[Finding, ...]:
        findings = check_lights(found.snapshot, found.light_mesh, settings, progress, history)
        return (*causes, *findings, *notes)

    return work


def list_checked(checked: Checked) -> None:
    """Keep what a check found in its scene. Raises InvalidInput where that is gone."""
    list_findings(require_scene(checked.scene), checked.findings, checked.origins)


def extract_edited(context: Any) -> Extraction:
    """The scene with the meshes in edit mode as they are now, and lights with whatever values they have."""
    for thing in context.objects_in_mode:
        thing.update_from_editmode()
    return extract(broken_values=True)


def over_budget(scene: Any, count: int) -> list[Finding]:
    """A finding where `count` lights are more than the scene's budget."""
    budget = scene.vlm.light_budget
    if not 0 < budget < count:
        return []
    problem = f"its light meshes have {lights(count)}, the budget is {budget:,}"
    return [Finding(f"scene {scene.name!r}", problem, "create them again with fewer, delete some or raise the budget")]
