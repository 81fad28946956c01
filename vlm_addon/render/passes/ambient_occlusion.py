# SPDX-License-Identifier: GPL-3.0-or-later
"""How open each pixel's surface is to what is around it, from one view or from several (seed 003, 4.2.3 and 4.3.2).

What is meant is the cosine-weighted share of the directions over a point in which nothing is met within a radius. A
view knows only what is nearest along its rays: what it does not show hides nothing, and how thick things are is a
setting. Further views know what stands behind, and where nothing does.

The document weighs what each view makes of a point that it sees. That averages the errors of all views. Joined, views
answer for each point of the kernel: where one sees it before what it shows, nothing is there, whatever others take to
be thick; else one that has something there is right.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.settings import setting
from ..gpu_layout import CONSTANTS, LAMP
from ..local_space import HALF_DIAGONAL, LocalSpace
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .gbuffer import GBuffer
from .rsm import ReflectiveShadowMap

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
VIEW_POSITION_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
VIEW_NORMAL_UNIT, SUMS_UNIT = VIEW_POSITION_UNIT + 1, VIEW_POSITION_UNIT + 2
POINTS_IN_RUN = 64
"""Points of a kernel that are told of in one texture, two bits each."""
BLUR_REACH = 2
"""Pixels to each side: any 4 x 4 pixels together have all directions of the kernel."""
BLUR_COSINE = 0.9
BLUR_PLANE_DISTANCE = 0.1
"""Of the radius: what is this far from a pixel's plane is another surface."""
BLUR_DISTANCE = 0.35
"""Of the radius: over more than that, openness itself changes."""
JOINED, WEIGHTED = "joined", "weighted"


@dataclass(frozen=True)
class OcclusionSettings:
    """What counts as near, and how it is looked for."""

    radius: float = setting(
        0.05,
        "diagonals of the scene",
        0.0,
        1.0,
        "Surfaces farther away than this hide nothing",
        source="003, 4.2.3",
    )
    directions: int = setting(
        8, "count", 1, 256, "In which each pixel of each picture looks", source="003, 6.2.3: 64 points in all"
    )
    steps: int = setting(
        8,
        "count",
        1,
        POINTS_IN_RUN,
        "Points along each direction, denser near the surface",
        source="003, 6.2.3: 64 points in all",
    )
    thickness: float = setting(
        0.5,
        "radii",
        0.0,
        100.0,
        "Of things: a point farther behind what a view shows counts as free",
        source="003, 4.2.3: range check",
    )
    combine: str = setting(
        JOINED,
        "",
        None,
        None,
        "Several views: point by point what any of them knows, or a mean by weights of what each makes of a pixel",
        source="joined: own; weighted: 003, 4.3.2",
        choices=(JOINED, WEIGHTED),
    )
    distance_share: float = setting(
        0.25,
        "share",
        0.0,
        1.0,
        "Of the distance weight in the weight of a view; the rest is the directional weight",
        source="003, 6.3.2: bias",
        only_with=("combine", WEIGHTED),
    )
    blur: bool = setting(
        True, "", None, None, "Means over the pixels around that show the same surface", source="003, 6.3.2; edges: own"
    )


class AmbientOcclusionPass:
    """Share of the directions over each pixel in which nothing near is met."""

    def __init__(
        self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int, settings: OcclusionSettings
    ) -> None:
        """width, height: of the picture."""
        self._context = context
        self._shaders = shaders
        self._settings = settings
        self._sums = context.texture((width, height), 2, dtype="f4")
        self._sums_framebuffer = context.framebuffer([self._sums])
        self._told: list[moderngl.Texture] = []
        self._result = context.texture((width, height), 1, dtype="f4")
        self._lamp = context.buffer(LAMP.zeros(1).tobytes())
        self._groups = -(-width // GROUP_SIDE), -(-height // GROUP_SIDE)

    def render(
        self,
        gbuffer: GBuffer,
        view: View,
        sample_index: int,
        maps: Iterable[ReflectiveShadowMap] = (),
        space: LocalSpace | None = None,
    ) -> moderngl.Texture:
        """1 where nothing near is in the way, 0 where everything is; R32F, 1 where no surface shows.

        view: that the G-buffer was drawn through. maps: further views. space: of the G-buffer, needed with maps. The
        next call overwrites the texture returned.
        """
        self._sums_framebuffer.clear()
        if self._settings.radius > 0.0:
            rest = iter(maps)
            first = next(rest, None)
            joins = first is not None and self._settings.combine == JOINED
            variant = {"TELLS_POINTS": joins, "WEIGHS": first is not None and not joins}
            camera = _camera(view, gbuffer) | {"sample_index": sample_index}
            self._look(gbuffer, (gbuffer.position, gbuffer.geometric_normal), camera, variant | {"VIEW_IS_MAP": False})
            for found in () if first is None else chain([first], rest):
                assert space is not None
                self._lamp.orphan()
                self._lamp.write(found.record.tobytes())
                uniforms = _map(found, space) | {"sample_index": sample_index}
                shown = found.position, found.geometric_normal
                self._look(gbuffer, shown, uniforms, variant | {"VIEW_IS_MAP": True})
            if joins:
                self._join(gbuffer)
        return self._mean(gbuffer)

    def _runs(self) -> list[tuple[int, int]]:
        """First and end of the directions of each dispatch."""
        count, at_once = self._settings.directions, POINTS_IN_RUN // self._settings.steps
        return [(first, min(first + at_once, count)) for first in range(0, count, at_once)]

    def _look(
        self,
        gbuffer: GBuffer,
        shown: tuple[moderngl.Texture, moderngl.Texture],
        uniforms: dict[str, Any],
        variant: dict[str, bool],
    ) -> None:
        """Adds what one view tells. shown: position and normal of what shows in it."""
        shader = self._shader("", **variant)
        # Drawing a map binds textures and buffers of its own.
        gbuffer.bind()
        for unit, texture in zip((VIEW_POSITION_UNIT, VIEW_NORMAL_UNIT), shown, strict=True):
            texture.use(unit)
        self._lamp.bind_to_storage_buffer(int(CONSTANTS["LAMP_BINDING"]))
        settings, radius = self._settings, self._radius * uniforms["scale"]
        kernel = {
            "radius": radius,
            "thickness": radius * settings.thickness,
            "directions": settings.directions,
            "steps": settings.steps,
            "distance_share": settings.distance_share,
        }
        set_uniforms(shader, uniforms | kernel)
        for run, (first, end) in enumerate(self._runs()):
            (self._told_of(run) if variant["TELLS_POINTS"] else self._sums).bind_to_image(0)
            set_uniforms(shader, {"first_direction": first, "end_direction": end})
            shader.run(*self._groups)
            self._context.memory_barrier()

    def _join(self, gbuffer: GBuffer) -> None:
        """Adds the directions that are open as far as all views together know."""
        gbuffer.bind()
        shader = self._shader("_join")
        self._sums.bind_to_image(1)
        for run, (first, end) in enumerate(self._runs()):
            self._told_of(run).bind_to_image(0, write=False)
            set_uniforms(shader, {"directions": end - first, "steps": self._settings.steps})
            shader.run(*self._groups)
            self._context.memory_barrier()

    def _mean(self, gbuffer: GBuffer) -> moderngl.Texture:
        """Openness from the sums of a pixel and its like around."""
        gbuffer.bind()
        shader = self._shader("_blur")
        self._sums.use(SUMS_UNIT)
        self._result.bind_to_image(0, read=False, write=True)
        uniforms = {
            "reach": BLUR_REACH if self._settings.blur else 0,
            "least_cosine": BLUR_COSINE,
            "plane_distance": BLUR_PLANE_DISTANCE * self._radius,
            "distance_limit": BLUR_DISTANCE * self._radius,
        }
        set_uniforms(shader, uniforms)
        shader.run(*self._groups)
        self._context.memory_barrier()
        return self._result

    @property
    def _radius(self) -> float:
        """In local units of the picture."""
        return self._settings.radius * 2.0 * HALF_DIAGONAL

    def _told_of(self, run: int) -> moderngl.Texture:
        """What is told of the points of a run of directions."""
        while len(self._told) <= run:
            self._told.append(self._context.texture(self._result.size, 4, dtype="u4"))
        return self._told[run]

    def _shader(self, suffix: str, **variant: bool) -> moderngl.ComputeShader:
        units = {"VIEW_POSITION_UNIT": VIEW_POSITION_UNIT, "VIEW_NORMAL_UNIT": VIEW_NORMAL_UNIT, "SUMS_UNIT": SUMS_UNIT}
        defines = {"GROUP_SIDE": GROUP_SIDE, "BLUR_REACH": BLUR_REACH, **units, **variant}
        return self._shaders.compute(f"passes/ambient_occlusion{suffix}.comp", defines)


def _camera(view: View, gbuffer: GBuffer) -> dict[str, Any]:
    """Uniforms of the view that the picture itself is."""
    width = gbuffer.size[0]
    at_0, per_depth = view.picture_width(width)
    return {
        "scale": 1.0,
        "offset": (0.0, 0.0, 0.0),
        "clip_from_view_space": view.clip_from_local,
        "eye": view.backward if view.is_orthographic else view.position,
        "is_parallel": view.is_orthographic,
        "texel_at_0": at_0 / width,
        "texel_per_depth": per_depth / width,
    }


def _map(found: ReflectiveShadowMap, space: LocalSpace) -> dict[str, Any]:
    """Uniforms of a lamp's view. space: of the picture."""
    scale, offset = space.to(found.space)
    record = found.record[0]
    is_parallel = int(record["shadow_kind"]) == CONSTANTS["SHADOW_PARALLEL"]
    texel = 2.0 * float(np.max(record["shadow_extent"])) / found.side
    return {
        "scale": scale,
        "offset": offset.tolist(),
        "eye": (record["z_axis"] if is_parallel else record["shadow_origin"]).tolist(),
        "is_parallel": is_parallel,
        "texel_at_0": texel if is_parallel else 0.0,
        "texel_per_depth": 0.0 if is_parallel else texel,
    }
