# SPDX-License-Identifier: GPL-3.0-or-later
"""Second-order illumination by point lights and negative point lights (seed 001; Cochran and Steele 2007)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.halton import halton_points
from ...core.progress import Progress
from ...core.scene import Float32, Float64
from ...core.settings import setting
from ...core.surface_points import SurfacePoints, random_surface_points
from ...core.vpl import VirtualPointLights
from ..gpu_layout import VIRTUAL_POINT_LIGHT
from ..indirect_lights import IndirectLights, light_records
from ..map_settings import MapSettings, map_images
from ..passes.accumulate import read_image
from ..passes.gbuffer import GBuffer
from ..passes.low_resolution import LowResolutionGather, LowResolutionSettings, PickedPixels, SizedPasses
from ..passes.point_lights import GROUP_SIDE, LIGHT_BINDING, BoundPass, PointLightPass, PointLights, uploaded
from ..passes.rsm import LampReflections
from ..point_picture import DIMMED, SQUARE, with_points
from ..shader_library import ShaderLibrary, set_uniforms
from ..technique import FrameInputs, SceneInputs, Technique
from ..view import View

if TYPE_CHECKING:
    import moderngl

NEGATIVE_GROUP_SIZE = 64
PIXEL_BINDING, NEGATIVE_BINDING = 1, 2
BOUND_RECEIVERS = 512
"""Surface points where it is measured what the bounded geometry term takes off."""
LOOKED_AT = 4
"""Pixels for each negative light: at most of them no light is stopped."""
LEAST_FLUX = 1e-4
"""Of a negative light that counts, for a pixel and of the strongest one: rounding makes some on even walls."""
WHITE, BLUE = (1.0, 1.0, 1.0), (0.1, 0.3, 1.0)


@dataclass(frozen=True)
class Placement:
    """How many lights there are and where they are looked up."""

    indirect_lights: int = setting(
        200, "count", 0, 4096, "Point lights on what the lamps light, shared by all lamps", source="001, 3.1, table 1"
    )
    negative_lights: int = setting(
        100,
        "count",
        0,
        4096,
        "Lights that take away what surfaces stop, on the dark sides of those in the picture; 0: nothing is occluded",
        source="001, 3.3, table 1",
    )


@dataclass(frozen=True)
class Settings(LowResolutionSettings, MapSettings, Placement):
    """Lights, and where a low resolution does."""


@dataclass(frozen=True)
class PlacedLights:
    """The lights of each picture of a frame, in world space. brightest: (3,) W/m², what no irradiance exceeds."""

    pictures: tuple[VirtualPointLights, ...]
    brightest: Float64


class NegativeLightPass:
    """Places negative lights on pixels of a picture."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self._context = context
        bindings = {"LIGHT_BINDING": LIGHT_BINDING, "PIXEL_BINDING": PIXEL_BINDING}
        defines = {**bindings, "NEGATIVE_BINDING": NEGATIVE_BINDING, "GROUP_SIZE": NEGATIVE_GROUP_SIZE}
        self._shader = shaders.compute("techniques/second_order_negative.comp", defines)

    def render(self, gbuffer: GBuffer, view: View, lights: PointLights, count: int, picture: int) -> PointLights:
        """The first `count` on pixels where light is stopped; fewer where that is rare. picture: each takes others.

        Waits for the device.
        """
        width, height = gbuffer.size
        tried = LOOKED_AT * count
        places = halton_points(tried, first=1 + picture * tried)
        pixels = (places * (width, height)).astype(np.int32)
        pixel_buffer = self._context.buffer(pixels.tobytes())
        found = PointLights(self._context.buffer(reserve=VIRTUAL_POINT_LIGHT.dtype.itemsize * tried), tried)
        gbuffer.bind()
        lights.buffer.bind_to_storage_buffer(LIGHT_BINDING)
        pixel_buffer.bind_to_storage_buffer(PIXEL_BINDING)
        found.buffer.bind_to_storage_buffer(NEGATIVE_BINDING)
        at_0, per_depth = (across / width for across in view.picture_width(width))
        uniforms = {"width_at_0": at_0, "width_per_depth": per_depth}
        uniforms |= {"light_count": lights.count, "is_orthographic": view.is_orthographic}
        uniforms |= {"camera_position": view.position.tolist(), "camera_backward": view.backward.tolist()}
        set_uniforms(self._shader, uniforms)
        self._shader.run(tried)
        self._context.memory_barrier()
        records = found.records().copy()
        flux = records["flux"].max(axis=1)
        kept = np.flatnonzero(flux > LEAST_FLUX * flux.max())[:count]
        # The first `count` stand for the pixels up to the last of them, all for the whole picture.
        reached = int(kept[-1]) + 1 if len(kept) == count else tried
        records = records[kept]
        for name in ("flux", "area"):
            records[name] *= width * height / reached
        return uploaded(self._context, records)


class SecondOrder(Technique):
    """One diffuse bounce from point lights on what the lamps light, less what negative point lights take away.

    Known bias: a light shines through everything; negative lights make up for that where the camera sees a surface's
    dark side, as a glow of the mean direction, and nowhere else: no shadow falls from what hides its dark side from the
    camera, and shadows have no edges. Few lights make each of them visible as a spot. The bounded geometry term darkens
    corners; as much light as it takes off all surfaces together is given back evenly (counter bound_removes_share).
    Light of glowing surfaces does not bounce, surfaces reflect on their counter-clockwise side only, and a lamp that
    casts no shadow still bounces off the nearest surface alone. Where lamps outnumber lights, the brightest lit
    surfaces stand for all.
    """

    name = "second_order"
    label = "Second-order illumination"
    description = "One diffuse bounce from point lights on lit surfaces, with negative lights for what is occluded"
    settings = Settings

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        context, shaders = scene.context, scene.shaders
        self._maps = LampReflections(context, shaders, scene.kept, scene.world, settings.resolution, settings.area_maps)
        with scene.timer.measure("reflective shadow maps"):
            self._placed = self._placed_lights()
        width, height = scene.settings.width, scene.settings.height
        self._negative_pass = NegativeLightPass(context, shaders)
        self._passes = SizedPasses(lambda wide, high: PointLightPass(context, shaders, wide, high))
        self._low = LowResolutionGather(context, shaders, width, height, settings, scene.settings.buffers)
        self._finish = shaders.compute("techniques/second_order_finish.comp", {"GROUP_SIDE": GROUP_SIDE})
        with scene.timer.measure("indirect lights"):
            self._removed = self._bound_share()
        self._lights = self._negative = self._none = uploaded(context, VIRTUAL_POINT_LIGHT.zeros(0))
        self._irradiance: moderngl.Texture | None = None
        self._frame: FrameInputs | None = None

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over the lights of flux times the bounded geometry term, less that of the negative ones."""
        timer, chosen = self.scene.timer, self.chosen
        with timer.measure("indirect lights"):
            records = light_records(
                self._placed.pictures[frame.sample_index], self.scene.space, 1.0 / (1.0 - self._removed)
            )
            self._lights = uploaded(self.scene.context, records)
        self._negative = self._none
        if self._lights.count and chosen.negative_lights:
            with timer.measure("negative lights"):
                self._negative = self._negative_pass.render(
                    frame.gbuffer, frame.view, self._lights, chosen.negative_lights, frame.sample_index
                )
        with timer.measure("gather"):
            self._irradiance = self._low.render(
                frame.gbuffer, frame.view, lambda picked: self._gathered(picked, self._negative, frame.progress)
            )
            self._irradiance.bind_to_image(0)
            self._finish.run(*(-(-side // GROUP_SIDE) for side in self._irradiance.size))
            self.scene.context.memory_barrier()
        self._frame = frame
        return self._irradiance

    def _placed_lights(self) -> PlacedLights:
        """All lights of the frame, kept over frames: they change with the lamps and with what these light."""
        scene, count = self.scene, self.chosen.indirect_lights
        pictures = scene.settings.samples

        def place() -> PlacedLights:
            self._maps.draw()
            source = IndirectLights(scene.context, scene.shaders, self._maps)
            return PlacedLights(tuple(source.take(count, pictures)), source.brightest)

        return scene.kept.get("indirect_lights", scene.kept.digests.of(self._maps.key, count, pictures), place)

    def _bound_share(self) -> float:
        """Of the light on all surfaces, what the bounded geometry term takes off."""
        context, space = self.scene.context, self.scene.space
        receivers = self._receivers()
        bound = BoundPass(context, self.scene.shaders, space.local_points(receivers.positions), receivers.normals)
        first = uploaded(context, light_records(self._placed.pictures[0], space))
        return bound.share(first, float(self._placed.brightest.mean()))

    def _receivers(self) -> SurfacePoints:
        """Points of all surfaces, the same for the same scene."""
        meshes = self.scene.world.meshes
        key = self.scene.kept.digests.of([[mesh.positions, mesh.triangles] for mesh in meshes])
        return self.scene.kept.get("surface_receivers", key, lambda: random_surface_points(meshes, BOUND_RECEIVERS))

    def _gathered(self, picked: PickedPixels, negative: PointLights, progress: Progress) -> moderngl.Texture:
        brightest = self._placed.brightest
        return self._passes.of(picked.gbuffer).render(picked.gbuffer, self._lights, negative, brightest, progress)

    def lamp_maps(self) -> LampReflections:
        """Those that it gathers from."""
        return self._maps

    def counters(self) -> dict[str, float]:
        """Of the last picture: lights; negative lights that take something away and how much, W, mean of the channels;
        shares of the light that they and the bounded term take off. Of the frame: share of pixels for which the low
        resolution did, maps, maps that were drawn."""
        negative = self._negative.records()
        return {
            "indirect_lights": self._lights.count,
            "negative_lights": self._negative.count,
            "negative_flux": float(negative["flux"].mean(axis=1).sum()) * self.scene.space.unit**2,
            "negative_removes_share": self._negative_share(),
            "bound_removes_share": self._removed,
            **self._low.counters(),
            "reflective_maps": len(self._maps),
            "reflective_maps_drawn": self._maps.drawn,
        }

    def _negative_share(self) -> float:
        if self._irradiance is None:
            return 0.0
        image = read_image(self._irradiance)
        kept, taken = float(image[..., :3].mean(axis=2).sum()), float(image[..., 3].sum())
        return taken / (kept + taken) if taken > 0.0 else 0.0

    def reasons(self) -> list[str]:
        """Which lamps' light does not bounce as they shine."""
        names = [light.name for light in self.scene.snapshot.lights if not light.casts_shadow]
        return [f"{', '.join(names)}: no shadow, yet the light bounces off the nearest surfaces only"] if names else []

    def images(self) -> dict[str, Float32]:
        """Irradiance from either kind of light at full resolution, where the low resolution did not do, what was found
        at low resolution, the first maps, and the lights in the picture: white, negative ones blue."""
        frame = self._frame
        if frame is None:
            return {}
        whole = PickedPixels(frame.gbuffer, frame.gbuffer.ids)
        positive = read_image(self._gathered(whole, self._none, frame.progress))[..., :3]
        taken = positive - read_image(self._gathered(whole, self._negative, frame.progress))[..., :3]
        found = {"positive": positive, "negative": np.maximum(taken, 0.0), **self._low.images()}
        found |= map_images(self._maps)
        found["lights"] = self._marked(frame)
        return {f"{self.name}_{name}": np.ascontiguousarray(image, np.float32) for name, image in found.items()}

    def _marked(self, frame: FrameInputs) -> Float32:
        """Base colour with a mark for each light, over everything that may hide it."""
        image = DIMMED * read_image(frame.gbuffer.base_color)[..., :3]
        for records, colour in ((self._lights.records(), WHITE), (self._negative.records(), BLUE)):
            points = records["position"].astype(np.float64)
            colours = np.tile(np.array(colour, np.float32), (len(points), 1))
            image = with_points(image, frame.view, points, colours, SQUARE)
        return image
