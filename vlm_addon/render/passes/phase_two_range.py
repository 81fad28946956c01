# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of every pixel from the lights of its cell in light grids of range mode (seed 002, 4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.cell_limit import Occupancy
from ...core.grid_frame import Bounds, GridFrame
from ...core.progress import Progress, step
from ..gpu_layout import HALF_BALL
from ..local_space import LocalSpace
from ..shader_library import set_uniforms
from ..virtual_lights import GpuVirtualLights
from .gbuffer import GBuffer
from .light_grid import GpuBlockLists
from .light_picks import LightPicks
from .phase_two import PHASE_TWO_DEFINES, LightSumPass, bind_lights, entry_runs
from .tile_walk import LIST_BINDING, LIST_OFFSET_BINDING

if TYPE_CHECKING:
    import moderngl

_MASK_BINDING = 5
_HALF_BALL_BINDING = 6
# Software renderers run eight invocations in step, each of which may look for its next light in turn: so many rounds
# for each of four pixels stay below Mesa's 65,535.
_MOST_PER_RUN = 1024
FACE_SLACK = 1e-5
"""How far outside a grid of side 1 a point counts as on its face: some hundred roundings of a position."""
_DEFINES: dict[str, int | float | str] = {
    **PHASE_TWO_DEFINES,
    "LIST_BINDING": LIST_BINDING,
    "LIST_OFFSET_BINDING": LIST_OFFSET_BINDING,
    "MASK_BINDING": _MASK_BINDING,
    "HALF_BALL_BINDING": _HALF_BALL_BINDING,
    "FACE_SLACK": FACE_SLACK,
}


@dataclass(frozen=True)
class GpuRangeGrid:
    """A grid of range mode on the device. half_balls: records of HALF_BALL. longest: lights of the fullest block.

    occupancy: None where it was not counted, since cells hold any number of lights.
    """

    frame: GridFrame
    lists: GpuBlockLists
    half_balls: moderngl.Buffer
    longest: int
    occupancy: Occupancy | None

    @property
    def light_count(self) -> int:
        """Lights of the light mesh."""
        return self.half_balls.size // HALF_BALL.dtype.itemsize


class RangePhaseTwoPass(LightSumPass):
    """The sum over the lights of each pixel's cell; outside, over those whose active hemisphere holds it."""

    def _prepare(self) -> None:
        self._shader = self._shaders.compute("passes/phase_two_range.comp", {**_DEFINES, **self._sum_defines})

    def render(
        self,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        grids: Sequence[GpuRangeGrid],
        space: LocalSpace,
        bounds: Bounds,
        progress: Progress,
    ) -> moderngl.Texture:
        """As PhaseTwoPass.render. space: of the G-buffer and of `lights`. bounds: of the visible scene, world space."""
        self._irradiance.clear()
        most = _MOST_PER_RUN
        if self._visibility is not None:
            self._visibility.bind(self._shader)
            most = self._visibility.per_dispatch(most)
        self._walk(self._shader, most, gbuffer, lights, radiosity, grids, space, bounds, progress)
        return self._irradiance.texture

    def pick(
        self,
        picks: LightPicks,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        grids: Sequence[GpuRangeGrid],
        space: LocalSpace,
        bounds: Bounds,
        progress: Progress,
    ) -> None:
        """As PhaseTwoPass.pick."""
        shader = self._shaders.compute("passes/phase_two_range.comp", {**_DEFINES, **picks.defines})
        picks.begin(shader, self._irradiance.texture)
        most = picks.per_dispatch(_MOST_PER_RUN)
        self._walk(shader, most, gbuffer, lights, radiosity, grids, space, bounds, progress)

    def _walk(
        self,
        shader: moderngl.ComputeShader,
        most_per_run: int,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        grids: Sequence[GpuRangeGrid],
        space: LocalSpace,
        bounds: Bounds,
        progress: Progress,
    ) -> None:
        """most_per_run: lights of a dispatch."""
        tiles = self._tile_bounds.render(gbuffer)
        width, height = tiles.size
        for done, grid in enumerate(grids):
            bind_lights(tiles, lights, radiosity)
            grid.lists.offsets.bind_to_storage_buffer(LIST_OFFSET_BINDING)
            grid.lists.light_ids.bind_to_storage_buffer(LIST_BINDING)
            grid.lists.masks.bind_to_storage_buffer(_MASK_BINDING)
            grid.half_balls.bind_to_storage_buffer(_HALF_BALL_BINDING)
            set_uniforms(shader, {**tiles.uniforms(), **_frame_uniforms(grid, space)})
            # Points outside look through all lights.
            most = grid.longest if _holds(grid.frame, bounds) else max(grid.longest, grid.light_count)
            for first, end in entry_runs(most, width * height, most_per_run):
                set_uniforms(shader, {"first_entry": first, "end_entry": end})
                shader.run(*tiles.grid)
                self._context.memory_barrier()
                step(progress, (done + end / most) / len(grids), "phase two")


def _holds(frame: GridFrame, bounds: Bounds) -> bool:
    """Whether no point within `bounds` is outside the grid."""
    low, high = frame.local(np.asarray(bounds, np.float64))
    slack = 0.5 * FACE_SLACK
    return bool((low >= frame.edges[:, 0] - slack).all() and (high <= frame.edges[:, -1] + slack).all())


def _frame_uniforms(grid: GpuRangeGrid, space: LocalSpace) -> dict[str, object]:
    frame = grid.frame
    return {
        "frame_scale": space.unit / frame.unit,
        "frame_offset": tuple(np.asarray((space.origin - frame.middle) / frame.unit)),
        "low": tuple(frame.edges[:, 0]),
        "high": tuple(frame.edges[:, -1]),
        "cells": frame.cells_per_axis,
        "light_count": grid.light_count,
    }
