# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual point lights from reflective shadow maps: Halton points warped by the flux of the maps (seed 004, 4.8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...core.scene import Float32, Float64
from ..gpu_layout import VIRTUAL_POINT_LIGHT
from ..local_space import LocalSpace
from ..map_fluxes import MapFluxes
from ..shader_library import ShaderLibrary, set_uniforms
from .point_lights import LIGHT_BINDING, PointLights
from .rsm import LampReflections, ReflectiveShadowMap

if TYPE_CHECKING:
    import moderngl

GROUP_SIZE = 64
MAP_UNITS = {"RSM_POSITION_UNIT": 0, "RSM_NORMAL_UNIT": 1, "RSM_FLUX_UNIT": 2, "RSM_GEOMETRIC_NORMAL_UNIT": 3}


class FluxLightPass:
    """Places the lights of a picture where the lamps' light is reflected: bright texels get more of them.

    All lights of a picture have the same flux, mean of the channels, so the sum over them estimates the light of all
    maps without bias: for any number of lights, maps and black texels. The maps are the uppermost level of the warp, so
    a lamp gets lights by its power, and a faint one gets one in some pictures only.
    """

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self._context = context
        defines = {"GROUP_SIZE": GROUP_SIZE, "LIGHT_BINDING": LIGHT_BINDING, **MAP_UNITS}
        self._shader = shaders.compute("passes/flux_lights.comp", defines)

    def render(
        self, maps: LampReflections, space: LocalSpace, count: int, first: int, shift: tuple[float, float]
    ) -> PointLights:
        """`count` lights in units of `space`, in the order of Halton's sequence; all of no flux where no lamp lights
        anything.

        first: index of the first one in the sequence, from 1; below 3^20 - count. shift: in [0, 1), by which all points
        are moved around the unit square: over random shifts, the mean is what the maps hold.
        """
        lights = PointLights(self._context.buffer(reserve=max(count, 1) * VIRTUAL_POINT_LIGHT.dtype.itemsize), count)
        fluxes = maps.fluxes()
        if not count or not fluxes.powers.sum() > 0.0:
            lights.buffer.clear()
            return lights
        ends = parts_of_unit(fluxes.powers)
        set_uniforms(self._shader, {"count": count, "first_index": first, "shift": shift})
        for index, found in enumerate(maps.maps()):
            if ends[index] < ends[index + 1]:
                # A map that is not kept is drawn on the way, with buffers of its own.
                lights.buffer.bind_to_storage_buffer(LIGHT_BINDING)
                part = float(ends[index]), float(ends[index + 1])
                self._run(found, space, fluxes, index, part, count)
        self._context.memory_barrier()
        return lights

    def _run(
        self,
        found: ReflectiveShadowMap,
        space: LocalSpace,
        fluxes: MapFluxes,
        index: int,
        part: tuple[float, float],
        count: int,
    ) -> None:
        """The lights in one map."""
        found.bind(MAP_UNITS["RSM_POSITION_UNIT"])
        found.geometric_normal.use(MAP_UNITS["RSM_GEOMETRIC_NORMAL_UNIT"])
        scale, offset = found.space.to(space)
        width, height = found.flux.size
        light_flux = float(fluxes.powers.sum()) / count
        uniforms = {"part": part, "faces": (width // found.side, height // found.side), "levels": found.levels}
        uniforms |= {"map_scale": scale, "map_offset": offset.tolist(), "share": float(fluxes.shares[index])}
        uniforms |= {"light_flux": light_flux / space.unit**2, "map_flux": light_flux / found.space.unit**2}
        set_uniforms(self._shader, uniforms)
        self._shader.run(-(-count // GROUP_SIZE))


def parts_of_unit(powers: Float64) -> Float32:
    """(m + 1,) float32 from 0 to 1: where the parts of [0, 1) begin and end that are as large as `powers`, (m,), which
    are not all zero. A part of no power is empty."""
    ends = np.append(0.0, np.cumsum(powers) / powers.sum())
    ends[np.searchsorted(ends, ends[-1]) :] = 1.0
    return ends.astype(np.float32)
