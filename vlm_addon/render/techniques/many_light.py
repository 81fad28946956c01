# SPDX-License-Identifier: GPL-3.0-or-later
"""Many point lights on lit surfaces, with rays through a voxel octree (seed 004; Sun 2015)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.light_walk import SurfaceMeans, bounce_counts, surface_means
from ...core.progress import Progress, step
from ...core.scene import Float32
from ...core.scene_facts import TechniqueFacts
from ...core.settings import OWN, setting
from ..light_marks import marked_lights
from ..map_settings import MapSettings, map_images
from ..octree_settings import OctreeSettings
from ..octree_view import octree_images
from ..passes.accumulate import read_image
from ..passes.bounce_lights import BounceLightPass
from ..passes.filter import FilterSettings, GeometryFilterPass
from ..passes.flux_lights import FluxLightPass
from ..passes.interleave import MergePass, SplitPass
from ..passes.low_resolution import PickedPixels
from ..passes.phase_two import IrradianceImage
from ..passes.point_lights import GROUP_SIDE, LIGHT_BINDING, PointLights
from ..passes.rsm import LampReflections
from ..scene_octree import SceneOctree, finer_text, fitted_octree
from ..shader_library import ShaderLibrary, set_uniforms
from ..technique import FrameInputs, SceneInputs, Technique

if TYPE_CHECKING:
    import moderngl

OCTREE_BINDING, TRIANGLE_BINDING, CUT_BINDING = 1, 2, 3
WAYS_PER_DISPATCH = 16
"""For each pixel; see lib/octree.glsl."""


@dataclass(frozen=True)
class Lights:
    """How many lights there are and who sums which."""

    lights: int = setting(
        2048,
        "count",
        1,
        65536,
        "Point lights in each picture, of all bounces together, rounded up so that all tiles have the same number",
        source="004, 5: 512 to 2048",
    )
    bounces: int = setting(
        1, "count", 1, 3, "Bounces that the lights stand for; each shares their number", source="004, 3.3"
    )
    interleave: int = setting(
        4,
        "pixels",
        1,
        8,
        "Of every so many pixels in both directions each sums another part of the lights, and a filter shares what "
        "they found; 1: all pixels sum all lights",
        source="004, 4.6: 4 x 4",
    )
    least_share: float = setting(
        1e-3,
        "share",
        0.0,
        1.0,
        "Of the mean irradiance, that lights may bring together which are left out before their rays because each "
        "brings too little",
        source="004, 3.3: a preset epsilon",
    )
    seed: int = setting(0, "number", 0, 65535, "Another seed moves all lights to other places", source=OWN)


@dataclass(frozen=True)
class Settings(FilterSettings, OctreeSettings, MapSettings, Lights):
    """Lights, maps they are placed with, octree that is walked, and the filter after interleaving."""


class ManyLightPass:
    """Irradiance of every pixel of a split picture from the lights of its tile that it sees."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        """width, height: of the split picture."""
        self._context = context
        self._irradiance = IrradianceImage(context, width, height)
        self._groups = -(-width // GROUP_SIDE), -(-height // GROUP_SIDE)
        self._cut = context.buffer(bytes(4))
        bindings = {"LIGHT_BINDING": LIGHT_BINDING, "OCTREE_BINDING": OCTREE_BINDING, "CUT_BINDING": CUT_BINDING}
        defines = {**bindings, "OCTREE_TRIANGLE_BINDING": TRIANGLE_BINDING, "GROUP_SIDE": GROUP_SIDE}
        self._shaders = {
            occluded: shaders.compute("techniques/many_light.comp", {**defines, "IS_OCCLUDED": occluded})
            for occluded in (False, True)
        }

    def render(
        self,
        picked: PickedPixels,
        tile_size: tuple[int, int],
        lights: Sequence[PointLights],
        least: float,
        rays: tuple[SceneOctree, tuple[float, ...], int] | None,
        progress: Progress,
    ) -> moderngl.Texture:
        """In W/m², RGBA32F; w: how many ways were asked for.

        lights: of each bounce, cut into as many equal runs as there are tiles. least: W/m² that a light has to bring,
        mean of the channels. rays: octree, where it lies and its exact reach; None for light that nothing stops.
        `progress` hears of each dispatch and may cancel. The next call overwrites the texture.
        """
        self._irradiance.clear()
        picked.gbuffer.bind()
        shader = self._shaders[rays is not None]
        width, height = self._irradiance.size
        across = width // tile_size[0]
        tiles = across * (height // tile_size[1])
        values: dict[str, Any] = {"tile_size": tile_size, "tiles_across": across, "gain": float(tiles), "least": least}
        if rays is not None:
            octree, frame, exact_reach = rays
            octree.bind(OCTREE_BINDING, TRIANGLE_BINDING)
            self._cut.bind_to_storage_buffer(CUT_BINDING)
            values |= {"octree_frame": frame, "exact_reach": exact_reach}
        for bounce in lights:
            bounce.buffer.bind_to_storage_buffer(LIGHT_BINDING)
            each = bounce.count // tiles
            for first in range(0, each, WAYS_PER_DISPATCH):
                end = min(first + WAYS_PER_DISPATCH, each)
                set_uniforms(shader, {**values, "tile_lights": each, "first": first, "end": end})
                shader.run(*self._groups)
                self._context.memory_barrier()
                step(progress, end / each, "gather")
        return self._irradiance.texture

    def cut_off(self) -> int:
        """How often a software renderer ended the loop over a pixel's lights before its time, so far."""
        return int(np.frombuffer(self._cut.read(), np.uint32)[0])


class ManyLight(Technique):
    """Up to three diffuse bounces from point lights on what the lamps light, each hidden by what stands between.

    Known bias: each light spreads over a square of the surface that it stands for, so bright corners are softer than
    they are, the less the more lights. With an exact_reach below octree_resolution, what comes within a voxel of a way
    stops it: shadows are wider by up to that. Transparent surfaces cast them whole. Lights that bring too little are
    left out (least_share). With interleaving, what few lights miss shows as grain that the filter smooths, and small
    things that its thresholds take for their surroundings are smoothed with them. Light of glowing surfaces does not
    bounce, nor does light that leaves a surface by its specular layer; surfaces reflect on their counter-clockwise side
    only, and a lamp that casts no shadow still bounces off the nearest surface alone. Lights of later bounces know a
    triangle's mean colour and its own normal.
    """

    name = "many_light"
    label = "Many lights"
    description = "Diffuse bounces from point lights on lit surfaces, with rays through a voxel octree"
    settings = Settings

    @classmethod
    def facts(cls, settings: Any) -> TechniqueFacts:
        """What it finds by itself."""
        return TechniqueFacts(cls.name, knows_visibility=True)

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        context, shaders, timer = scene.context, scene.shaders, scene.timer
        with timer.measure("octree"):
            self._octree = fitted_octree(context, shaders, scene.kept, scene.world, settings.octree_resolution)
        with timer.measure("reflective shadow maps"):
            self._maps = LampReflections(
                context, shaders, scene.kept, scene.world, settings.resolution, settings.area_maps
            )
            self._maps.draw()
        width, height = scene.settings.width, scene.settings.height
        self._place = FluxLightPass(context, shaders)
        self._bounce = BounceLightPass(context, shaders)
        self._means = self._surface_means()
        self._split = SplitPass(context, shaders, width, height, settings.interleave)
        self._gather = ManyLightPass(context, shaders, *self._split.size)
        self._merge = MergePass(context, shaders, width, height, settings.interleave)
        self._filter = GeometryFilterPass(context, shaders, width, height, settings.interleave)
        self._shift = _shift_of(settings.seed)
        self._lights: list[PointLights] = []
        self._found: moderngl.Texture | None = None
        self._frame: FrameInputs | None = None

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over the lights that a pixel sees of flux times the bounded geometry term."""
        timer = self.scene.timer
        with timer.measure("virtual point lights"):
            self._lights = self._placed(frame.sample_index)
        with timer.measure("indirect light"):
            self._found = self._gathered(frame, is_occluded=True)
            merged = self._merge.render(self._found)
        self._frame = frame
        if self.chosen.interleave == 1:
            return merged
        with timer.measure("filter"):
            return self._filter.render(frame.gbuffer, merged, frame.view, self.chosen)

    def _placed(self, picture: int) -> list[PointLights]:
        """The lights of one picture of the frame, each bounce apart; every picture has others."""
        chosen, space = self.chosen, self.scene.space
        means = self._means
        reflectance = float(means.reflectance.mean())
        counts = bounce_counts(chosen.lights, chosen.bounces, reflectance, chosen.interleave**2)
        first = 1 + picture * counts[0]
        lights = [self._place.render(self._maps, space, counts[0], first, self._shift)]
        for number, count in enumerate(counts[1:], 2):
            walked = self._bounce.render(lights[-1], self._octree, space, count, number, first, self._shift, means.area)
            lights.append(walked)
        return lights

    def _gathered(self, frame: FrameInputs, is_occluded: bool) -> moderngl.Texture:
        """What each pixel of the split picture receives."""
        picked = self._split.render(frame.gbuffer)
        rays = None
        if is_occluded:
            rays = self._octree, self._octree.uniform(self.scene.space), self.chosen.exact_reach
        least = self.chosen.least_share * self._mean_irradiance() / self._lights_each
        return self._gather.render(picked, self._split.tile_size, self._lights, least, rays, frame.progress)

    @property
    def _lights_each(self) -> int:
        """Lights that a pixel sums."""
        return sum(bounce.count for bounce in self._lights) // int(self.chosen.interleave**2)

    def _mean_irradiance(self) -> float:
        """W/m², mean of the channels, of one bounce if none of it leaves the scene."""
        area = self._means.area
        return float(self._maps.fluxes().powers.sum()) / area if area > 0.0 else 0.0

    def _surface_means(self) -> SurfaceMeans:
        """Of all surfaces, kept while they stay as they are."""
        meshes = self.scene.world.meshes
        key = self.scene.kept.digests.of([[mesh.positions, mesh.triangles, mesh.reflectance] for mesh in meshes])
        means: SurfaceMeans = self.scene.kept.get("surface_means", key, lambda: surface_means(meshes))
        return means

    def lamp_maps(self) -> LampReflections:
        """Those that it gathers from."""
        return self._maps

    def counters(self) -> dict[str, float]:
        """Of the last picture: lights; ways asked for at a pixel, and the share of its lights for which none was, as
        they bring too little. Of the frame: maps, maps drawn in it, what the octree holds, values not finite."""
        counted: dict[str, float] = {"reflective_maps": len(self._maps), "reflective_maps_drawn": self._maps.drawn}
        if self._frame is not None and self._found is not None:
            normals = read_image(self._frame.gbuffer.geometric_normal)[..., :3]
            shown = max(int((normals**2).sum(axis=2).round().sum()), 1)
            ways = float(read_image(self._found)[..., 3].sum(dtype=np.float64)) / shown
            counted |= {"point_lights": sum(bounce.count for bounce in self._lights), "rays_per_pixel": ways}
            counted["skipped_share"] = 1.0 - ways / self._lights_each
        return {**counted, **self._octree.counters(), **self._filter.counters()}

    def images(self) -> dict[str, Float32]:
        """Of the last picture: what the gather saw and found, split; merged, before the filter; the share of the light
        that nothing stops; lights; levels of the octree; and what the first maps show."""
        frame = self._frame
        if frame is None:
            return {}
        picked = self._split.render(frame.gbuffer)
        found = {
            "split_position": self.scene.space.world_points(read_image(picked.gbuffer.position)[..., :3]),
            "split_normal": read_image(picked.gbuffer.geometric_normal)[..., :3],
        }
        unhindered = read_image(self._merge.render(self._gathered(frame, is_occluded=False)))[..., :3]
        self._found = self._gathered(frame, is_occluded=True)
        merged = read_image(self._merge.render(self._found))[..., :3]
        found |= {"split_irradiance": read_image(self._found)[..., :3], "merged_irradiance": merged}
        found["visibility"] = np.divide(merged, unhindered, out=np.ones_like(merged), where=unhindered > 0.0)
        found["lights"] = marked_lights(frame.gbuffer, frame.view, self._lights)
        found |= octree_images(self._octree, frame.view, frame.gbuffer, self.scene.space)
        found |= map_images(self._maps)
        return {f"{self.name}_{name}": np.ascontiguousarray(image, np.float32) for name, image in found.items()}

    def reasons(self) -> list[str]:
        """Why the octree is another one than was asked for, what is missing, and which lamps' light does not bounce as
        they shine."""
        found = [finer_text(self._octree, self.chosen.octree_resolution)]
        if cut := self._gather.cut_off():
            found.append(f"light is missing: rays were cut off {cut:,} times; use a finer octree_resolution")
        names = [light.name for light in self.scene.snapshot.lights if not light.casts_shadow]
        if names:
            found.append(f"{', '.join(names)}: no shadow, yet the light bounces off the nearest surfaces only")
        return [text for text in found if text]


def _shift_of(seed: int) -> tuple[float, float]:
    """By which the lights of a seed are moved around the unit square: none for 0, else at random."""
    x, y = np.random.default_rng(seed).random(2).tolist() if seed else (0.0, 0.0)
    return x, y
