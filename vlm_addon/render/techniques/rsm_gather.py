# SPDX-License-Identifier: GPL-3.0-or-later
"""Indirect light gathered from reflective shadow maps (seed 003, 4.3.3; Dachsbacher and Stamminger 2005)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.halton import halton_points
from ...core.progress import Progress, step
from ...core.scene import Float32
from ...core.settings import setting
from ..gpu_layout import CONSTANTS, LAMP
from ..local_space import LocalSpace
from ..passes.accumulate import read_image
from ..passes.gbuffer import GBuffer
from ..passes.phase_two import EVALUATIONS_PER_DISPATCH, IrradianceImage
from ..passes.rsm import LampReflections, ReflectiveShadowMap
from ..shader_library import ShaderLibrary, set_uniforms
from ..technique import FrameInputs, SceneInputs, Technique

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
TAP_BINDING = 0
RSM_UNIT = 10
UNBIASED, SQUARED = "unbiased", "squared"
LEAST_TAPS_PER_DISPATCH = 16


@dataclass(frozen=True)
class Settings:
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
    resolution: int = setting(
        256, "texels", 8, 2048, "Along a face of a lamp's map, to the nearest power of two", source="003, 6.2.2"
    )
    area_maps: int = setting(
        4, "count", 1, 64, "Points of an area lamp that have a map each; one in its middle is off near the lamp"
    )


def sample_taps(count: int, picture: int, weight: str) -> Float32:
    """(count, 4) float32: places x, y in the unit disc, weight of a sample, and the unbiased weight.

    Places are e1 (sin 2 pi e2, cos 2 pi e2) of uniform e1, e2 (seed 003, 4.3.3), so that they are densest in the
    middle: one over 2 pi e1 of them to a unit of area. 2 e1 makes up for that, e1² does not. picture: each of a frame
    takes the next run of Halton's points.
    """
    distance, turn = halton_points(count, first=1 + picture * count).T
    unbiased = 2.0 * distance
    weights = unbiased if weight == UNBIASED else distance**2
    angle = 2.0 * np.pi * turn
    return np.stack([distance * np.sin(angle), distance * np.cos(angle), weights, unbiased], axis=1).astype(np.float32)


class GatherPass:
    """Irradiance of every pixel from reflective shadow maps."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._irradiance = IrradianceImage(context, width, height)
        units = {f"RSM_{name}_UNIT": RSM_UNIT + i for i, name in enumerate(("POSITION", "NORMAL", "FLUX"))}
        defines = {"GROUP_SIDE": GROUP_SIDE, "TAP_BINDING": TAP_BINDING, **units}
        self._shaders = {
            is_cube: shaders.compute("techniques/rsm_gather.comp", {**defines, "IS_CUBE": is_cube})
            for is_cube in (False, True)
        }
        self._lamp = context.buffer(reserve=LAMP.dtype.itemsize)

    def render(
        self,
        gbuffer: GBuffer,
        space: LocalSpace,
        maps: Iterator[ReflectiveShadowMap],
        count: int,
        taps: Float32,
        pictures: int,
        radius: float,
        progress: Progress,
    ) -> moderngl.Texture:
        """Sum over all `count` maps in W/m², RGBA32F; w: what bounds took off, mean of the channels, likewise.

        space: of the G-buffer. taps: of sample_taps. pictures: how many of them, each with other taps, are averaged.
        radius: share of the map.
        `progress` hears of each dispatch and may cancel. The next call overwrites the texture.
        """
        self._irradiance.clear()
        tap_buffer = self._context.buffer(taps.tobytes())
        brightest = np.zeros(3)
        for index, found in enumerate(maps):
            brightest += found.brightest
            self._lamp.orphan()
            self._lamp.write(found.record.tobytes())
            # Drawing a map binds textures and buffers of its own.
            gbuffer.bind()
            found.bind(RSM_UNIT)
            self._irradiance.texture.bind_to_image(0)
            self._lamp.bind_to_storage_buffer(int(CONSTANTS["LAMP_BINDING"]))
            tap_buffer.bind_to_storage_buffer(TAP_BINDING)
            shader = self._shaders[found.is_cube]
            for first, end in self._runs(len(taps)):
                is_last = index == count - 1 and end == len(taps)
                uniforms = {"first_tap": first, "end_tap": end, "is_last": is_last, "brightest": brightest.tolist()}
                uniforms |= {"tap_share": 1.0 / len(taps), "area_share": 1.0 / (len(taps) * pictures)}
                scale, offset = space.to(found.space)
                uniforms |= {"radius": radius, "side": found.side, "map_scale": scale, "map_offset": offset.tolist()}
                set_uniforms(shader, uniforms)
                width, height = self._irradiance.size
                shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
                self._context.memory_barrier()
                step(progress, (index + end / len(taps)) / count, "gather")
        return self._irradiance.texture

    def _runs(self, taps: int) -> Iterator[tuple[int, int]]:
        """First and end of the taps of each dispatch."""
        width, height = self._irradiance.size
        at_once = max(EVALUATIONS_PER_DISPATCH // (width * height), LEAST_TAPS_PER_DISPATCH)
        for first in range(0, taps, at_once):
            yield first, min(first + at_once, taps)


class RsmGather(Technique):
    """One diffuse bounce off what the lamps light, sampled in their reflective shadow maps.

    Known bias: indirect light is not occluded, so it passes through walls; light of glowing surfaces and of the world
    does not bounce; surfaces reflect on their counter-clockwise side only, as virtual lights do; a lamp that casts no
    shadow still bounces off the nearest surface alone. The published (squared) weight loses two thirds of light that
    comes evenly from the disc. A radius below 1 leaves out what lies outside of the disc. Where surfaces meet, the
    bounded geometry term takes off light, the less the more samples (counter bound_removes_share). All pixels use the
    same places around their own in the map, so what few samples miss shows as bands, not as noise.
    """

    name = "rsm_gather"
    label = "Reflective shadow maps"
    description = "One diffuse bounce gathered from what each lamp sees, without occlusion of the indirect light"
    settings = Settings

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        self._maps = LampReflections(
            scene.context, scene.shaders, scene.kept, scene.world, settings.resolution, settings.area_maps
        )
        self._gather = GatherPass(scene.context, scene.shaders, scene.settings.width, scene.settings.height)
        self._irradiance: moderngl.Texture | None = None
        with scene.timer.measure("reflective shadow maps"):
            self._maps.draw()

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over the maps' samples of flux times the bounded geometry term."""
        chosen = self.chosen
        taps = sample_taps(chosen.samples, frame.sample_index, chosen.weight)
        with self.scene.timer.measure("gather"):
            self._irradiance = self._gather.render(
                frame.gbuffer,
                self.scene.space,
                self._maps.maps(),
                len(self._maps),
                taps,
                self.scene.settings.samples,
                chosen.radius,
                frame.progress,
            )
        return self._irradiance

    def counters(self) -> dict[str, float]:
        """Maps and how many were drawn in this frame; share of the unbounded irradiance that bounds took off in the
        last picture."""
        counted = {"reflective_maps": len(self._maps), "reflective_maps_drawn": self._maps.drawn}
        return {**counted, "bound_removes_share": self._removed_share()}

    def _removed_share(self) -> float:
        if self._irradiance is None:
            return 0.0
        image = read_image(self._irradiance)
        kept, removed = float(image[..., :3].mean(axis=2).sum()), float(image[..., 3].sum())
        return removed / (kept + removed) if removed > 0.0 else 0.0

    def reasons(self) -> list[str]:
        """Which lamps' light does not bounce as they shine."""
        names = [light.name for light in self.scene.snapshot.lights if not light.casts_shadow]
        if not names:
            return []
        return [f"light of {', '.join(names)} bounces off the nearest surfaces only, though it casts no shadow"]
