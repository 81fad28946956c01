# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance averaged over pictures: what earlier ones found for the same place is used again (seed 003, 4.3.3).

For any technique that spreads its work over pictures. It asks `TemporalPass.begin` for the history of each pixel, finds
something new, less where there is a history, and hands it to `TemporalPass.finish`:

    age = temporal.begin(frame.gbuffer, frame.view, scene.space, lights_key, scene_key)
    found = my_gather(…, temporal.step, age)
    irradiance = temporal.finish(frame.gbuffer, found, first_age, most_age)

A pixel has a history where the last picture shows the same place, as seen through that picture's own view, with the
same normal. That holds for surfaces that move, too: irradiance belongs to a place and a normal, not to an object or an
eye. What lights the places is not seen that way, so keys tell it: with other lights nothing of the history is used;
where something else changed that light may come from, its weight is limited. The history stays on the device for the
next frame, so pictures with one depend on those before them; the first picture after a change of lights does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.scene import Float32
from ..gpu_layout import CONSTANTS
from ..kept import Kept
from ..local_space import LocalSpace
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .accumulate import read_image
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
SAME_NORMAL_COSINE = 0.9
"""Between normals of what counts as the same surface."""
FIRST_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
UNLIMITED = (math.inf, math.inf, math.inf)
LARGEST = 3e38
"""float32 without infinity."""


class History:
    """What one picture leaves for the next. seen: the view and space of that picture, None while there is none.

    irradiance: RGBA32F, the mean. place: RGBA32F, in local units of its space, and the number of pictures in the mean.
    normal: RGBA16F. key: hash of all without which it means nothing; scene_key: of what else it depends on. step:
    pictures since the history began.
    """

    def __init__(self, context: moderngl.Context, width: int, height: int) -> None:
        size = (width, height)
        self.irradiance, self.place = (context.texture(size, 4, dtype="f4") for _ in range(2))
        self.normal = context.texture(size, 4, dtype="f2")
        self.seen: tuple[View, LocalSpace] | None = None
        self.key = ""
        self.scene_key = ""
        self.step = 0


@dataclass(frozen=True)
class _Picture:
    """What `finish` needs to know of the picture that has begun."""

    view: View
    space: LocalSpace
    lights_key: str
    scene_key: str


class TemporalPass:
    """Averages what a technique finds over pictures and frames."""

    def __init__(
        self, context: moderngl.Context, shaders: ShaderLibrary, kept: Kept, owner: str, width: int, height: int
    ) -> None:
        """owner: name of the technique, which has a history of its own for the latest size of picture."""
        self._history: History = kept.get(
            f"{owner}_history", f"{width} x {height}", lambda: History(context, width, height)
        )
        self._context = context
        size = (width, height)
        self._reprojected, self._result = (context.texture(size, 4, dtype="f4") for _ in range(2))
        self._age = context.texture(size, 1, dtype="f4")
        self._groups = -(-width // GROUP_SIDE), -(-height // GROUP_SIDE)
        names = ("HISTORY_IRRADIANCE", "HISTORY_PLACE", "HISTORY_NORMAL")
        history_units = {f"{name}_UNIT": FIRST_UNIT + index for index, name in enumerate(names)}
        found_units = {f"{name}_UNIT": FIRST_UNIT + index for index, name in enumerate(("FOUND", "REPROJECTED", "AGE"))}
        defines = {"GROUP_SIDE": GROUP_SIDE, "SAME_NORMAL_COSINE": SAME_NORMAL_COSINE}
        self._reproject = shaders.compute("passes/temporal_reproject.comp", {**defines, **history_units})
        self._blend = shaders.compute("passes/temporal_blend.comp", {**defines, **found_units})
        self._picture: _Picture | None = None

    @property
    def step(self) -> int:
        """Pictures since the history began: 0 where the one that has begun has none."""
        return self._history.step

    def begin(
        self,
        gbuffer: GBuffer,
        view: View,
        space: LocalSpace,
        lights_key: str,
        scene_key: str,
        limit: float = 0.0,
    ) -> moderngl.Texture:
        """How many pictures are in the mean for each pixel, R32F; 0 where there is no history.

        gbuffer, view, space: of the picture. lights_key: hash of the lights and of all else without which the history
        means nothing. scene_key: hash of what the lights shine on; where it has changed, ages are limited to `limit`.
        The next call overwrites the texture.
        """
        history = self._history
        if history.key != lights_key or (limit == 0.0 and history.scene_key != scene_key):
            history.seen, history.step = None, 0
        self._picture = _Picture(view, space, lights_key, scene_key)
        most = 0.0 if history.seen is None else limit if history.scene_key != scene_key else LARGEST
        uniforms: dict[str, object] = {"most_age": most}
        if history.seen is not None:
            uniforms |= into_history(space, *history.seen, gbuffer.size[0])
        gbuffer.bind()
        for unit, texture in enumerate((history.irradiance, history.place, history.normal), FIRST_UNIT):
            texture.use(unit)
        self._reprojected.bind_to_image(0, read=False, write=True)
        self._age.bind_to_image(1, read=False, write=True)
        set_uniforms(self._reproject, uniforms)
        self._reproject.run(*self._groups)
        self._context.memory_barrier()
        return self._age

    def finish(
        self,
        gbuffer: GBuffer,
        found: moderngl.Texture,
        first_age: float,
        most_age: float,
        brightest: tuple[float, float, float] = UNLIMITED,
    ) -> moderngl.Texture:
        """The mean of what this picture found and of the history, RGBA32F; keeps it for the next picture.

        found: RGBA32F. first_age: pictures that it counts for where there is no history. most_age: what the age stops
        at, so that later pictures still count. brightest: W/m², what the mean is cut at, its w grows by that; the
        history is not cut. The next call overwrites the texture.
        """
        assert self._picture is not None
        history, picture = self._history, self._picture
        gbuffer.bind()
        for unit, texture in enumerate((found, self._reprojected, self._age), FIRST_UNIT):
            texture.use(unit)
        images = (history.irradiance, history.place, history.normal, self._result)
        for unit, texture in enumerate(images):
            texture.bind_to_image(unit, read=False, write=True)
        limit = [min(value, LARGEST) for value in brightest]
        set_uniforms(self._blend, {"first_age": first_age, "most_age": most_age, "brightest": limit})
        self._blend.run(*self._groups)
        self._context.memory_barrier()
        history.seen = picture.view, picture.space
        history.key, history.scene_key = picture.lights_key, picture.scene_key
        history.step += 1
        return self._result

    def images(self) -> dict[str, Float32]:
        """`history_age` of the last picture, (h, w, 1), row 0 at the top: how many pictures are in the mean."""
        return {"history_age": np.ascontiguousarray(read_image(self._history.place)[..., 3:])}


def into_history(space: LocalSpace, view: View, history_space: LocalSpace, width: int) -> dict[str, object]:
    """Uniforms that lead from a place in `space` into a picture of `width` pixels through `view`, in its own space."""
    scale, offset = space.to(history_space)
    at_0, per_depth = view.picture_width(width)
    return {
        "clip_from_history": view.clip_from_local,
        "history_scale": scale,
        "history_offset": offset.tolist(),
        "pixel_at_0": at_0 / width,
        "pixel_per_depth": per_depth / width,
    }
