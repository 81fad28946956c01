# SPDX-License-Identifier: GPL-3.0-or-later
"""Indirect light gathered from reflective shadow maps (seed 003, 4.3.3; Dachsbacher and Stamminger 2005)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.array_codec import content_hash
from ...core.scene import Float32
from ...core.settings import OWN, setting
from ...core.world_light import merged_world_lights
from ..map_settings import MapSettings, map_images, shown_maps
from ..passes.accumulate import read_image
from ..passes.low_resolution import LowResolutionGather, LowResolutionSettings, PickedPixels, SizedPasses
from ..passes.rsm import LampReflections
from ..passes.rsm_gather import SQUARED, UNBIASED, Marks, Part, RsmGatherPass, Sampling, sample_taps
from ..passes.temporal import TemporalPass
from ..technique import FrameInputs, SceneInputs, Technique

if TYPE_CHECKING:
    import moderngl

STATIC, ROTATING = "static", "rotating"
WHOLE, PART = "whole", "part"
MOVING_AGE = 4.0
"""Pictures that a history counts for at most where something has moved in a lamp's view, with restart `part`."""


@dataclass(frozen=True)
class Settings(LowResolutionSettings, MapSettings):
    """How the maps are drawn and sampled."""

    samples: int = setting(
        200, "count", 1, 8192, "Places that a pixel looks up in each map", source="003, 4.3.3: 200 static samples"
    )
    radius: float = setting(
        1.0,
        "share",
        1e-3,
        1.0,
        "Of the disc around a pixel's place in a map; 1 covers the map, less leaves out the light from farther away",
        source="003, 4.3.3: left open",
    )
    weight: str = setting(
        UNBIASED,
        "",
        None,
        None,
        "Of a sample at share x of the radius: 2 x (unbiased), or x² as published (squared), which loses light",
        source="003, 4.3.3",
        choices=(UNBIASED, SQUARED),
    )
    world_maps: int = setting(
        16,
        "count",
        1,
        1024,
        "Directions that the world's light is joined to, with a map each; few lose light that comes from the horizon",
        source=OWN,
    )
    pattern: str = setting(
        STATIC,
        "",
        None,
        None,
        "All samples in each picture (static), or another part of them each time and the mean over earlier pictures "
        "(rotating), which is faster where only the camera moves; a picture then depends on those before it",
        source="003, 4.3.3 and 9: rotated around",
        choices=(STATIC, ROTATING),
    )
    part_samples: int = setting(
        10,
        "count",
        1,
        8192,
        "Places of the pattern that a pixel looks up in each picture",
        source="003, 4.3.3: a pattern of 10",
        only_with=("pattern", ROTATING),
    )
    history: int = setting(
        128,
        "pictures",
        1,
        65536,
        "Earlier pictures that the mean counts at most; few let the pattern show as flicker",
        source=OWN,
        only_with=("pattern", ROTATING),
    )
    restart: str = setting(
        WHOLE,
        "",
        None,
        None,
        "Where there is no history, or the maps have changed: all samples at once (whole), as right as the static "
        "pattern and as slow; or a part as everywhere (part), which is noisy and trails behind what moves",
        source="003, 4.3.3: the latter, at the cost of more artifacts",
        choices=(WHOLE, PART),
        only_with=("pattern", ROTATING),
    )


class RsmGather(Technique):
    """One diffuse bounce off what the lamps light, sampled in their reflective shadow maps.

    Known bias: indirect light is not occluded, so it passes through walls; light of glowing surfaces does not bounce;
    surfaces reflect on their counter-clockwise side only, as virtual lights do; a lamp that casts no shadow still
    bounces off the nearest surface alone. The published (squared) weight loses two thirds of light that comes evenly
    from the disc. A radius below 1 leaves out what lies outside of the disc. Where surfaces meet, the bounded geometry
    term takes off light, the less the more samples (counter bound_removes_share, image rsm_gather_bound_removes). All
    pixels use the same places around their own in the map, so what few samples miss shows as bands, not as noise.
    Interpolation from a low resolution smooths what is smaller than its pixels. The static pattern gives the same
    picture for the same scene; the rotating one does for the same pictures before it since lamps or settings changed.
    """

    name = "rsm_gather"
    label = "Reflective shadow maps"
    description = "One diffuse bounce gathered from what each lamp sees, without occlusion of the indirect light"
    settings = Settings

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        width, height = scene.settings.width, scene.settings.height
        lit = replace(scene.world, lights=merged_world_lights(scene.world.lights, settings.world_maps))
        with scene.timer.measure("reflective shadow maps"):
            self._maps = LampReflections(
                scene.context, scene.shaders, scene.kept, lit, settings.resolution, settings.area_maps
            )
            self._maps.draw()
        self._low = LowResolutionGather(
            scene.context, scene.shaders, width, height, settings, keep_low=scene.settings.buffers
        )
        self._passes = SizedPasses(lambda w, h: RsmGatherPass(scene.context, scene.shaders, w, h))
        self._temporal: TemporalPass | None = None
        if settings.pattern == ROTATING:
            self._temporal = TemporalPass(scene.context, scene.shaders, scene.kept, self.name, width, height)
        self._lights_key = content_hash([[replace(light, name="") for light in lit.lights], settings])
        self._irradiance: moderngl.Texture | None = None
        self._brightest = (0.0, 0.0, 0.0)
        self._marks: Marks | None = None

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over the maps' samples of flux times the bounded geometry term."""
        if self.scene.settings.buffers:
            self._marks = self._new_marks()
        with self.scene.timer.measure("gather"):
            if self._temporal is None:
                taps = sample_taps(self.chosen.samples, frame.sample_index, self.chosen.weight)
                sampling = Sampling(taps, self.scene.settings.samples, self.chosen.radius)
                self._irradiance = self._gathered(frame, sampling)
            else:
                self._irradiance = self._averaged(frame, self._temporal)
        return self._irradiance

    def _averaged(self, frame: FrameInputs, temporal: TemporalPass) -> moderngl.Texture:
        """The mean with earlier pictures."""
        chosen = self.chosen
        keys = self._lights_key, self._maps.key
        limit = MOVING_AGE if chosen.restart == PART else 0.0
        age = temporal.begin(frame.gbuffer, frame.view, self.scene.space, *keys, limit)
        taps = sample_taps(chosen.samples, 0, chosen.weight)
        parts = -(-chosen.samples // chosen.part_samples)
        first = temporal.step % parts * chosen.part_samples
        part = Part(first, min(first + chosen.part_samples, chosen.samples), age, self._reach())
        first_age = parts
        if chosen.restart == PART:
            taps, first_age = taps[part.first : part.end], 1
            part = replace(part, first=0, end=len(taps))
        found = self._gathered(frame, Sampling(taps, parts // first_age, chosen.radius, part))
        return temporal.finish(frame.gbuffer, found, first_age, max(chosen.history, first_age), self._brightest)

    def _gathered(self, frame: FrameInputs, sampling: Sampling) -> moderngl.Texture:
        def gather(picked: PickedPixels) -> moderngl.Texture:
            gather_pass = self._passes.of(picked.gbuffer)
            maps, count = self._maps.maps(), len(self._maps)
            found = gather_pass.render(picked, self.scene.space, maps, count, sampling, frame.progress, self._marks)
            self._brightest = gather_pass.brightest
            return found

        return self._low.render(frame.gbuffer, frame.view, gather)

    def _reach(self) -> int:
        """How far aside a pixel may lie that takes over what is found for one."""
        factor: int = self.chosen.low_resolution
        return factor - 1 + factor // 2

    def lamp_maps(self) -> LampReflections:
        """Those that it gathers from."""
        return self._maps

    def counters(self) -> dict[str, float]:
        """Maps and how many were drawn in this frame; share of the unbounded irradiance that bounds took off in the
        last picture; share of the pixels that were interpolated."""
        counted = {"reflective_maps": len(self._maps), "reflective_maps_drawn": self._maps.drawn}
        return {**counted, **self._low.counters(), "bound_removes_share": self._removed_share()}

    def _removed_share(self) -> float:
        if self._irradiance is None:
            return 0.0
        image = read_image(self._irradiance)
        kept, removed = float(image[..., :3].mean(axis=2).sum()), float(image[..., 3].sum())
        return removed / (kept + removed) if removed > 0.0 else 0.0

    def images(self) -> dict[str, Float32]:
        """Of the last picture: what bounds took off in W/m², low resolution and history; and of the first maps what
        `map_images` shows, and where the pixel amid the picture looked."""
        found = dict(self._low.images())
        if self._temporal is not None:
            found |= self._temporal.images()
        if self._irradiance is not None:
            found["bound_removes"] = np.ascontiguousarray(read_image(self._irradiance)[..., 3:])
        found |= map_images(self._maps)
        if self._marks is not None:
            found |= {f"map_{index}_places": read_image(image) for index, image in self._marks.images.items()}
        return {f"{self.name}_{part}": image for part, image in found.items()}

    def _new_marks(self) -> Marks:
        """Of the pixel amid the picture that is looked up at low resolution, too."""
        factor = self.chosen.low_resolution
        width, height = self.scene.settings.width, self.scene.settings.height
        images = {}
        for index, found in enumerate(shown_maps(self._maps)):
            images[index] = self.scene.context.texture(
                found.flux.size, 1, bytes(4 * found.flux.width * found.flux.height), dtype="f4"
            )
        return Marks((width // 2 // factor * factor, height // 2 // factor * factor), images)

    def reasons(self) -> list[str]:
        """Which lamps' light does not bounce as they shine."""
        names = [light.name for light in self.scene.snapshot.lights if not light.casts_shadow]
        if not names:
            return []
        return [f"light of {', '.join(names)} bounces off the nearest surfaces only, though it casts no shadow"]
