# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking on arrays: the light mesh a scene has or a new one, validated, with a report. Needs no Blender."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .core.errors import InvalidInput
from .core.exact_tags import tagged_by_map
from .core.light_marks import LightHistory, creation_marks
from .core.light_mesh import VirtualLightMesh, join, require_valid
from .core.progress import Progress, as_report, part, silent
from .core.scene import Finding, Int32, SceneSnapshot
from .core.settings import OWN, setting
from .core.simplify import SimplifyReport, SimplifySettings, create_light_mesh, subdivide_light_mesh
from .core.tag_pairs import SurfaceFaces
from .core.validate import check_light_mesh

# Share of the work that is done when lights are made and yet to be checked.
CREATION_TIME = 0.85


@dataclass(frozen=True)
class BakeSettings(SimplifySettings):
    """How many lights there are, and how they are shared between shape and size."""

    split_share: float = setting(
        0.0,
        "share",
        0.0,
        0.9,
        "Of the lights, how many are spent on halving the largest: simplification keeps a flat wall as two lights, and "
        "light on it is then even all over",
        source=OWN,
    )

    even_power: float = setting(
        1.0,
        "share",
        0.0,
        1.0,
        "What is halved first: at 0 the largest lights, at 1 those that reflect most, so that bright objects get more",
        source=OWN,
    )

    @property
    def shape_lights(self) -> int:
        """Lights that surfaces are simplified to before large ones are halved."""
        return max(round(self.target_triangles * (1.0 - self.split_share)), 1)


@dataclass(frozen=True)
class Bake:
    """A validated light mesh. creation: how it was made, None where the scene had one already. findings: what the
    check, the creation and the extraction found, the check's first. face_tags: (f,) int32, new tags of the surface
    where some were asked for; paired_links: (p, 2) int32, the links of the light mesh that were made for these."""

    light_mesh: VirtualLightMesh
    creation: SimplifyReport | None
    findings: tuple[Finding, ...]
    face_tags: Int32 | None = None
    paired_links: Int32 | None = None

    def report(self) -> dict[str, Any]:
        """The bake as JSON-able values: counts, powers in m² under unit irradiance, milliseconds, findings."""
        made: dict[str, Any] = {}
        if self.creation is not None:
            made = {
                "source_triangles": self.creation.source_triangles,
                "source_reflected_power_m2": list(self.creation.reflected_power_before),
                "closed_shells_before": self.creation.closed_shells_before,
                "closed_shells_after": self.creation.closed_shells_after,
                "share_of_source_in_front_of_its_light": self.creation.share_in_front,
                "milliseconds": [list(entry) for entry in self.creation.milliseconds],
            }
        return {
            "created": self.creation is not None,
            "lights": len(self.light_mesh),
            "vertices": len(self.light_mesh.vertices),
            "samples": len(self.light_mesh.samples.positions),
            "area_m2": float(self.light_mesh.areas.sum()),
            "reflected_power_m2": self.light_mesh.reflected_power.tolist(),
            **made,
            "findings": [str(finding) for finding in self.findings],
        }


def bake(
    snapshot: SceneSnapshot,
    existing: VirtualLightMesh | None,
    settings: BakeSettings | None = None,
    progress: Progress = silent,
    faces: SurfaceFaces | None = None,
    keep: VirtualLightMesh | None = None,
    history: LightHistory | None = None,
) -> Bake:
    """The light mesh of a scene: `existing` where there is one and no `settings` ask for another, else a new one.

    faces: where given, a new light mesh and its surface get tags by which each face leaves out the lights that stand
    for it. keep: lights that stay as they are, first in the new light mesh, and count. history: how those of `existing`
    were made. Raises InvalidInput where the scene shows no surface that gets any light, or `existing` holds values that
    are not finite or negative, for fewer lights than are kept, and for more links than there can be; Cancelled.
    """
    creation, face_tags, meshes, paired_links = None, None, snapshot.meshes, None
    light_of_triangle = None
    if existing is not None and settings is None:
        require_valid(existing)
        light_mesh = existing
    else:
        if not snapshot.triangle_count:
            problem = "no visible object in it has a surface"
            raise InvalidInput(f"scene {snapshot.name!r}", problem, "add a mesh or enable one in renders")
        chosen = settings or BakeSettings()
        locked = len(keep) if keep is not None else 0
        shape = replace(chosen, target_triangles=max(chosen.shape_lights, min(locked + 1, chosen.target_triangles)))
        created = create_light_mesh(snapshot.meshes, shape, part(progress, 0.0, CREATION_TIME), keep)
        light_mesh, creation, light_of_triangle = created.light_mesh, created.report, created.light_of_triangle
        if not len(light_mesh):
            problem = "none of its surface gets a light: it has no area, or is painted with None Here"
            raise InvalidInput(f"scene {snapshot.name!r}", problem, "choose other surfaces, or paint less of None Here")
        if faces is not None:
            light_mesh, tags = tagged_by_map(light_mesh, created.light_of_triangle, faces)
            face_tags, paired_links = tags.face_tags, tags.paired
            meshes = faces.tagged(meshes, face_tags)
        if chosen.split_share > 0.0:
            light_mesh, light_of_triangle = _split(light_mesh, locked, chosen), None
    if creation is not None:
        history = LightHistory(creation_marks(light_mesh))
    checking = as_report(part(progress, 0.0 if creation is None else CREATION_TIME, 1.0), "check")
    findings = check_light_mesh(light_mesh, meshes, checking, light_of_triangle, history)
    made = creation.findings if creation is not None else ()
    return Bake(light_mesh, creation, (*findings, *made, *snapshot.findings), face_tags, paired_links)


def _split(light_mesh: VirtualLightMesh, locked: int, settings: BakeSettings) -> VirtualLightMesh:
    """`light_mesh` with its lights halved up to the number asked for, but for the first `locked` ones."""
    first = np.arange(len(light_mesh)) < locked
    free = light_mesh.subset(~first) if locked else light_mesh
    target = max(settings.target_triangles - locked, 1)
    halved = subdivide_light_mesh(free, target, settings.samples_per_light, settings.even_power)
    return join([light_mesh.subset(first), halved]) if locked else halved
