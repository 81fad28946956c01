# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of pixels from samples of reflective shadow maps (seed 003, 4.3.3; Dachsbacher and Stamminger 2005)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.halton import halton_points
from ...core.progress import Progress, step
from ...core.scene import Float32
from ..gpu_layout import CONSTANTS, LAMP
from ..local_space import LocalSpace
from ..shader_library import ShaderLibrary, set_uniforms
from .low_resolution import PickedPixels
from .phase_two import EVALUATIONS_PER_DISPATCH, IrradianceImage
from .rsm import ReflectiveShadowMap

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
TAP_BINDING = 0
PLACES_IMAGE = 1
RSM_UNIT = 10
PICKED_PIXEL_UNIT, AGE_UNIT = RSM_UNIT + 3, RSM_UNIT + 4
UNBIASED, SQUARED = "unbiased", "squared"
LEAST_TAPS_PER_DISPATCH = 16


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


@dataclass(frozen=True)
class Part:
    """What pixels with a history look up. first, end: of the taps. age: of TemporalPass.begin. reach: pixels to each
    side that must have a history as well, or else all taps are looked up."""

    first: int
    end: int
    age: moderngl.Texture
    reach: int


@dataclass(frozen=True)
class Sampling:
    """How pixels look up the maps. taps: of sample_taps. pictures: how many, each with other taps, are averaged.
    radius: share of the map. part: None for all taps everywhere."""

    taps: Float32
    pictures: int = 1
    radius: float = 1.0
    part: Part | None = None


@dataclass(frozen=True)
class Marks:
    """Where one pixel of the picture looks in the maps. images: by the number of the map, R32F of its size, 1 there."""

    pixel: tuple[int, int]
    images: dict[int, moderngl.Texture]


class RsmGatherPass:
    """Irradiance of every pixel from reflective shadow maps. brightest: W/m², what no sum of the latest exceeds."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._library = shaders
        self._irradiance = IrradianceImage(context, width, height)
        self._lamp = context.buffer(reserve=LAMP.dtype.itemsize)
        self.brightest = (0.0, 0.0, 0.0)

    def render(
        self,
        picked: PickedPixels,
        space: LocalSpace,
        maps: Iterator[ReflectiveShadowMap],
        count: int,
        sampling: Sampling,
        progress: Progress,
        marks: Marks | None = None,
    ) -> moderngl.Texture:
        """Sum over all `count` maps in W/m², RGBA32F; w: what bounds took off, mean of the channels, likewise.

        space: of the G-buffer. A sum that is not part of a mean is cut at what the brightest surface reflects.
        `progress` hears of each dispatch and may cancel. The next call overwrites the texture.
        """
        self._irradiance.clear()
        taps, part = sampling.taps, sampling.part
        tap_buffer = self._context.buffer(taps.tobytes())
        uniforms: dict[str, Any] = {"tap_count": len(taps), "area_share": 1.0 / (len(taps) * sampling.pictures)}
        uniforms["radius"] = sampling.radius
        if part is not None:
            uniforms |= {"part": (part.first, part.end), "reach": part.reach}
        brightest = np.zeros(3)
        for index, found in enumerate(maps):
            brightest += found.brightest
            self._lamp.orphan()
            self._lamp.write(found.record.tobytes())
            # Drawing a map binds textures and buffers of its own.
            picked.gbuffer.bind()
            picked.pixel.use(PICKED_PIXEL_UNIT)
            found.bind(RSM_UNIT)
            if part is not None:
                part.age.use(AGE_UNIT)
            self._irradiance.texture.bind_to_image(0)
            self._lamp.bind_to_storage_buffer(int(CONSTANTS["LAMP_BINDING"]))
            tap_buffer.bind_to_storage_buffer(TAP_BINDING)
            is_marked = marks is not None and index in marks.images
            if marks is not None and is_marked:
                marks.images[index].bind_to_image(PLACES_IMAGE, read=False, write=True)
                uniforms["marked"] = marks.pixel
            shader = self._shader(found.is_cube, part is not None, is_marked)
            scale, offset = space.to(found.space)
            uniforms |= {"side": found.side, "map_scale": scale, "map_offset": offset.tolist()}
            for first, end in self._runs(len(taps)):
                is_cut = part is None and index == count - 1 and end == len(taps)
                run = {"first_tap": first, "end_tap": end, "is_cut": is_cut, "brightest": brightest.tolist()}
                set_uniforms(shader, {**uniforms, **run})
                width, height = self._irradiance.size
                shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
                self._context.memory_barrier()
                step(progress, (index + end / len(taps)) / count, "gather")
        red, green, blue = brightest.tolist()
        self.brightest = red, green, blue
        return self._irradiance.texture

    def _shader(self, is_cube: bool, has_history: bool, marks_places: bool) -> moderngl.ComputeShader:
        units = {f"RSM_{name}_UNIT": RSM_UNIT + i for i, name in enumerate(("POSITION", "NORMAL", "FLUX"))}
        units |= {"PICKED_PIXEL_UNIT": PICKED_PIXEL_UNIT, "AGE_UNIT": AGE_UNIT}
        variant = {"IS_CUBE": is_cube, "HAS_HISTORY": has_history, "MARKS_PLACES": marks_places}
        defines = {"GROUP_SIDE": GROUP_SIDE, "TAP_BINDING": TAP_BINDING, **units, **variant}
        return self._library.compute("passes/rsm_gather.comp", defines)

    def _runs(self, taps: int) -> Iterator[tuple[int, int]]:
        """First and end of the taps of each dispatch."""
        width, height = self._irradiance.size
        at_once = max(EVALUATIONS_PER_DISPATCH // (width * height), LEAST_TAPS_PER_DISPATCH)
        for first in range(0, taps, at_once):
            yield first, min(first + at_once, taps)
