# SPDX-License-Identifier: GPL-3.0-or-later
"""Which surfaces and virtual lights are chosen, and a scene without what they bounce (seed 002, 3.5).

A light of a tag stands for surfaces of that tag, and lights of objects that move are marked as such; so one choice
names both, and each surface's light is counted once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .light_mesh import VirtualLightMesh
from .light_tree_bounds import triangle_areas
from .scene import DIFFUSE, UNTAGGED, Float64, Material, Mesh, SceneSnapshot
from .spans import parse_spans

Bools = npt.NDArray[np.bool_]

DYNAMIC, TAGGED = "dynamic", "tagged"


@dataclass(frozen=True)
class Choice:
    """Surfaces and lights of one kind. by: DYNAMIC for what moves or deforms, TAGGED for what has one of the tag ids.
    spans: (first, last) tag ids, both included."""

    by: str
    spans: tuple[tuple[int, int], ...] = ()

    def triangles(self, mesh: Mesh) -> Bools:
        """(t,) which triangles are chosen."""
        if self.by == DYNAMIC:
            return np.full(len(mesh.triangles), mesh.dynamic)
        return self._has(mesh.tag_ids)

    def lights(self, light_mesh: VirtualLightMesh) -> Bools:
        """(n,) which lights are chosen."""
        return light_mesh.dynamic if self.by == DYNAMIC else self._has(light_mesh.tag_ids)

    def _has(self, tag_ids: npt.NDArray[np.int32]) -> Bools:
        found = np.zeros(len(tag_ids), bool)
        for first, last in self.spans:
            found |= (tag_ids >= first) & (tag_ids <= last)
        return found


def tag_spans(text: str) -> tuple[tuple[int, int], ...]:
    """The spans of tag ids that `text` names, such as "3, 5-8". Raises InvalidInput for anything else."""
    return parse_spans(text, "tag id", UNTAGGED + 1)


def without_bounce(snapshot: SceneSnapshot, choice: Choice) -> SceneSnapshot:
    """`snapshot` with chosen triangles that reflect and emit nothing; they hide, and let through, what they did.

    `snapshot` itself where none is chosen. Its material indices have to be usable.
    """
    materials = list(snapshot.materials or (Material("default"),))
    black: dict[int, int] = {}
    meshes = tuple(_without_bounce(mesh, choice.triangles(mesh), materials, black) for mesh in snapshot.meshes)
    return replace(snapshot, meshes=meshes, materials=tuple(materials)) if black else snapshot


def _without_bounce(mesh: Mesh, chosen: Bools, materials: list[Material], black: dict[int, int]) -> Mesh:
    """black: the black material of each that has one; `materials` grows by new ones."""
    if not chosen.any():
        return mesh
    turned = np.zeros(len(materials), np.int32)
    for index in np.flatnonzero(np.bincount(mesh.material_indices[chosen])).tolist():
        if index not in black:
            black[index] = len(materials)
            materials.append(_black(materials[index]))
        turned[index] = black[index]
    indices = np.where(chosen, turned[mesh.material_indices], mesh.material_indices)
    reflectance, emission = (np.where(chosen[:, None], np.float32(0.0), of) for of in (mesh.reflectance, mesh.emission))
    return replace(mesh, material_indices=indices, reflectance=reflectance, emission=emission)


def _black(material: Material) -> Material:
    """As opaque as `material`, and black."""
    return Material(
        name=f"{material.name} (no bounce)",
        model=DIFFUSE,
        base_color=(0.0, 0.0, 0.0),
        alpha=material.alpha,
        alpha_texture=material.alpha_texture,
        alpha_channel=material.alpha_channel,
    )


@dataclass(frozen=True)
class Reflected:
    """What chosen surfaces, and the lights that stand for them, reflect of a unit irradiance, m², mean of the channels.

    names: of the meshes with chosen triangles. triangles, lights: how many are chosen. all_triangles: there are."""

    names: tuple[str, ...]
    triangles: int
    all_triangles: int
    lights: int
    of_surfaces: float
    of_lights: float


def reflected(snapshot: SceneSnapshot, light_mesh: VirtualLightMesh, choice: Choice) -> Reflected:
    """Of `snapshot` and `light_mesh` in the same space."""
    names, count, power = [], 0, np.zeros(3)
    for mesh in snapshot.meshes:
        chosen = choice.triangles(mesh)
        if chosen.any():
            names.append(mesh.name)
            count += int(chosen.sum())
            areas: Float64 = triangle_areas(mesh.positions[mesh.triangles[chosen]])
            power += areas @ mesh.reflectance[chosen].astype(np.float64)
    lights = light_mesh.subset(choice.lights(light_mesh))
    return Reflected(
        tuple(names),
        count,
        snapshot.triangle_count,
        len(lights),
        float(power.mean()),
        float(lights.reflected_power.mean()),
    )
