# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene has and shows, as far as it decides which effects are worth their time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .lamps import lamp_hull
from .light_mesh import VirtualLightMesh
from .occluders import Occlusion
from .reach import box_corners, in_reach
from .scene import PRINCIPLED, SUN, UNTAGGED, Float64, Light, Material, SceneSnapshot
from .world_light import is_lit_by_world

NO_SPECULAR, OWN_SPECULAR, SPECULAR_BY_EFFECTS = "none", "own", "effects"


@dataclass(frozen=True)
class TechniqueFacts:
    """What the technique of the frame finds by itself.

    has_indirect: whether there is indirect light in its picture. knows_visibility: whether that light is occluded where
    something stands in its way. asks_visibility: whether its settings ask for what the plan may leave out for that.
    specular: whether it has indirect light in glossy surfaces: none, its own, or what effects add.
    has_reflecting_lights: whether it has virtual lights, which are polygons that show in glossy surfaces;
    bounces_without_lights: whether it finds other light beside theirs. gains_by_occlusion: whether ambient occlusion
    was measured to bring its indirect light nearer to the truth.
    """

    name: str
    has_indirect: bool = True
    knows_visibility: bool = False
    asks_visibility: bool = False
    specular: str = SPECULAR_BY_EFFECTS
    has_reflecting_lights: bool = False
    bounces_without_lights: bool = False
    gains_by_occlusion: bool = False


@dataclass(frozen=True)
class ScreenFacts:
    """What one picture shows, counted on the device. pixels: of the picture; shown: with a surface; glossy: of those,
    with a specular layer; low, high: (3,) float64 bounds of the shown surface, meaningless without any."""

    pixels: int
    shown: int
    glossy: int
    low: Float64
    high: Float64


@dataclass(frozen=True)
class LightMeshFacts:
    """Of a virtual light mesh. reflecting: lights that reflect; glowing: lights that shine by themselves. links: pairs
    of a light's tag and one that such lights leave out beside their own."""

    lights: int
    reflecting: int
    glowing: int
    tagged: int
    links: int = 0


@dataclass(frozen=True)
class LampFacts:
    """Names of lamps. shining: that may light a surface; dark: without power; beside: that shine past every surface.
    not_on_screen: of the shining ones, those that light nothing that the picture shows. on_lights: that may shine on
    the source samples of virtual lights, which need not lie on a surface."""

    shining: tuple[str, ...]
    dark: tuple[str, ...]
    beside: tuple[str, ...]
    not_on_screen: tuple[str, ...]
    on_lights: tuple[str, ...] = ()


@dataclass(frozen=True)
class SceneFacts:
    """What decides; names are those of the snapshot.

    glossy, glowing, layered: names of materials that some triangle has and that have a specular layer, shine, or are
    Principled. tagged_surface: whether a triangle has a tag. occlusion: of light between surfaces; lamp_occlusion: of
    that from lamps, too. screen: None before there is a picture. samples: pictures of the frame.
    """

    scene: str
    triangles: int
    lamps: LampFacts
    is_lit_by_world: bool
    glowing: tuple[str, ...]
    glossy: tuple[str, ...]
    layered: tuple[str, ...]
    tagged_surface: bool
    light_mesh: LightMeshFacts | None
    occlusion: Occlusion
    lamp_occlusion: Occlusion
    technique: TechniqueFacts
    screen: ScreenFacts | None
    samples: int

    @property
    def has_light(self) -> bool:
        """Whether anything shines."""
        glows = self.light_mesh is not None and self.light_mesh.glowing > 0
        shines = bool(self.lamps.shining or self.lamps.on_lights)
        return shines or self.is_lit_by_world or bool(self.glowing) or glows


def gather_facts(
    snapshot: SceneSnapshot,
    light_mesh: VirtualLightMesh | None,
    technique: TechniqueFacts,
    occlusion: Occlusion,
    lamp_occlusion: Occlusion,
    samples: int,
) -> SceneFacts:
    """The facts of a snapshot in world space without the lights of its world, before there is a picture."""
    used = _used_materials(snapshot)
    return SceneFacts(
        scene=snapshot.name,
        triangles=snapshot.triangle_count,
        lamps=lamp_facts(snapshot, light_mesh),
        is_lit_by_world=is_lit_by_world(snapshot),
        glowing=tuple(material.name for material in used if max(material.emission) > 0.0),
        layered=tuple(material.name for material in used if material.model == PRINCIPLED),
        glossy=tuple(material.name for material in used if material.has_specular_layer),
        tagged_surface=any((mesh.tag_ids != UNTAGGED).any() for mesh in snapshot.meshes),
        light_mesh=None if light_mesh is None else _light_mesh_facts(light_mesh),
        occlusion=occlusion,
        lamp_occlusion=lamp_occlusion,
        technique=technique,
        screen=None,
        samples=samples,
    )


def lamp_sources(lights: Sequence[Light]) -> tuple[Float64, Float64]:
    """Where light of lamps starts, for occluders.find_occlusion: (p, 3) points that have the lamps between them, m, and
    (d, 3) directions towards suns."""
    shining = [lamp for lamp in lights if max(lamp.power) > 0.0]
    found, suns = ([lamp_hull(lamp) for lamp in shining if (lamp.kind == SUN) == is_sun] for is_sun in (False, True))
    return np.concatenate([np.zeros((0, 3)), *found]), np.concatenate([np.zeros((0, 3)), *suns])


def _used_materials(snapshot: SceneSnapshot) -> tuple[Material, ...]:
    if not snapshot.materials:
        return (Material("default"),) if snapshot.triangle_count else ()
    used = {int(index) for mesh in snapshot.meshes for index in np.unique(mesh.material_indices)}
    return tuple(snapshot.materials[index] for index in sorted(used))


def lamp_facts(
    snapshot: SceneSnapshot, light_mesh: VirtualLightMesh | None, screen: ScreenFacts | None = None
) -> LampFacts:
    """Of the lamps of a snapshot in world space; the others likewise."""
    boxes = np.array([box_corners(*mesh.bounds()) for mesh in snapshot.meshes if len(mesh.triangles)])
    lit = [lamp for lamp in snapshot.lights if max(lamp.power) > 0.0]
    shining = [lamp for lamp in lit if in_reach(lamp, boxes.reshape(-1, 8, 3)).any()]
    hidden = [] if screen is None else [lamp for lamp in shining if not lights_picture(lamp, screen)]
    return LampFacts(
        _names(shining),
        _names(lamp for lamp in snapshot.lights if lamp not in lit),
        _names(lamp for lamp in lit if lamp not in shining),
        _names(hidden),
        _names(lamp for lamp in lit if _lights_samples(lamp, light_mesh)),
    )


def _lights_samples(lamp: Light, light_mesh: VirtualLightMesh | None) -> bool:
    if light_mesh is None or not len(light_mesh.samples.positions):
        return False
    points = light_mesh.samples.positions
    return bool(in_reach(lamp, box_corners(points.min(axis=0), points.max(axis=0))[None]).any())


def lights_picture(lamp: Light, screen: ScreenFacts) -> bool:
    """Whether a lamp with power can shine on something that a picture shows, whatever stands in between."""
    return screen.shown > 0 and bool(in_reach(lamp, box_corners(screen.low, screen.high)[None]).any())


def _names(lamps: Iterable[Light]) -> tuple[str, ...]:
    return tuple(lamp.name for lamp in lamps)


def _light_mesh_facts(light_mesh: VirtualLightMesh) -> LightMeshFacts:
    sends = light_mesh.strength > 0.0
    return LightMeshFacts(
        len(light_mesh),
        int((sends & (light_mesh.colour > 0.0).any(axis=1)).sum()),
        int((sends & (light_mesh.emission > 0.0).any(axis=1)).sum()),
        int((light_mesh.tag_ids != UNTAGGED).sum()),
        len(light_mesh.links),
    )
