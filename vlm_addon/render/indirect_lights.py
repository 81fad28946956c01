# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual point lights on what the lamps light, found in their reflective shadow maps (seed 001, 3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..core.mesh_topology import Int64
from ..core.scene import Float64
from ..core.vpl import VirtualPointLights
from ..core.vpl_placement import share_out
from .gpu_layout import CONSTANTS, VIRTUAL_POINT_LIGHT
from .local_space import LocalSpace
from .map_places import Places, places_in
from .passes.rsm import LampReflections, ReflectiveShadowMap
from .shader_library import ShaderLibrary, set_uniforms

if TYPE_CHECKING:
    import moderngl

GROUP_SIZE = 64
TEXEL_BINDING, PICKED_BINDING = 0, 1
POINTS_APART = 4096
"""In Halton's sequence, between the first points of two maps: those of one area lamp see much the same, and should not
put their lights on the same places."""
LOOKED_UP = 4
"""Places for each light: a lamp may see nothing, or something black, at most of them."""
NO_LIGHTS = VirtualPointLights(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
FIRST_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])


@dataclass(frozen=True)
class _Picked:
    """What is in some texels of a map, and lit. records: (n,) of VIRTUAL_POINT_LIGHT, in the map's units. areas: (n,)
    float64, of the texels, likewise. texels: (n,) float64, how many such texels each stands for."""

    records: np.ndarray
    areas: Float64
    texels: Float64


@dataclass(frozen=True)
class _Source:
    """A map. flux: W, what it reflects, mean of the channels. share: of MapFluxes."""

    places: Places
    flux: float
    share: float
    space: LocalSpace


class IndirectLights:
    """Places the lights of a frame.

    flux: (3,) float64 W, all that the maps' surfaces reflect. brightest: (3,) float64 W/m², what no irradiance exceeds.
    """

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, maps: LampReflections) -> None:
        self._context = context
        self._maps = maps
        units = {f"RSM_{name}_UNIT": FIRST_UNIT + i for i, name in enumerate(("POSITION", "NORMAL", "FLUX"))}
        bindings = {"TEXEL_BINDING": TEXEL_BINDING, "PICKED_BINDING": PICKED_BINDING}
        self._shader = shaders.compute("passes/rsm_pick.comp", {"GROUP_SIZE": GROUP_SIZE, **units, **bindings})
        fluxes = maps.fluxes()
        self.flux, self.brightest = fluxes.flux.sum(axis=0), fluxes.brightest
        self._sources = [
            _Source(places_in(found.record, found.side, 1 + index * POINTS_APART), power, share, found.space)
            for index, (found, power, share) in enumerate(
                zip(maps.maps(), fluxes.powers.tolist(), fluxes.shares.tolist(), strict=True)
            )
        ]

    def take(self, count: int, pictures: int = 1) -> list[VirtualPointLights]:
        """`count` lights in world space for each of `pictures`, in all other places; fewer where lamps light next to
        nothing of what they see.

        They share `count` by what the maps reflect, and together send out all of it, mean of the channels. Pictures are
        averaged, so a light's piece of surface is a part of what it would stand for alone.
        """
        counts = share_out(count, np.array([source.flux for source in self._sources]))
        if not sum(counts):
            return [NO_LIGHTS] * pictures
        found = self._pick([number * pictures for number in counts])
        parts = [np.array_split(np.arange(len(picked.areas)), pictures) for picked in found]
        return [self._together(found, [rows[picture] for rows in parts], pictures) for picture in range(pictures)]

    def _together(self, found: list[_Picked], parts: list[Int64], pictures: int) -> VirtualPointLights:
        """One picture's lights: of what was found in each map, those in its rows."""
        scaled = [
            _scaled(picked, rows, source, pictures)
            for picked, rows, source in zip(found, parts, self._sources, strict=True)
            if len(rows)
        ]
        if not scaled:
            return NO_LIGHTS
        names = ("positions", "normals", "flux", "areas")
        lights = VirtualPointLights(*(np.concatenate([getattr(part, name) for part in scaled]) for name in names))
        # Maps that got no light leave theirs to the others.
        missing = float(self.flux.mean()) / float(lights.flux.mean(axis=1).sum())
        return VirtualPointLights(lights.positions, lights.normals, lights.flux * missing, lights.areas * missing)

    def _pick(self, most: list[int]) -> list[_Picked]:
        """What is lit at places of each map, up to as many as its part of `most`."""
        places = [source.places.take(LOOKED_UP * number) for source, number in zip(self._sources, most, strict=True)]
        counts = [len(chosen.shares) for chosen in places]
        texels = self._context.buffer(np.concatenate([chosen.texels for chosen in places]).astype(np.int32).tobytes())
        results = self._context.buffer(reserve=VIRTUAL_POINT_LIGHT.dtype.itemsize * sum(counts))
        first = 0
        for found, count in zip(self._maps.maps(), counts, strict=True):
            if count:
                self._run(found, texels, results, first, count)
            first += count
        parts = np.split(np.frombuffer(results.read(), VIRTUAL_POINT_LIGHT.dtype), np.cumsum(counts)[:-1])
        picked = []
        for records, chosen, number in zip(parts, places, most, strict=True):
            lit = np.flatnonzero(records["flux"].max(axis=1) > 0.0)[:number]
            picked.append(_Picked(records[lit], records["area"][lit].astype(np.float64), chosen.shares[lit]))
        return picked

    def _run(
        self, found: ReflectiveShadowMap, texels: moderngl.Buffer, results: moderngl.Buffer, first: int, count: int
    ) -> None:
        found.bind(FIRST_UNIT)
        texels.bind_to_storage_buffer(TEXEL_BINDING)
        results.bind_to_storage_buffer(PICKED_BINDING)
        set_uniforms(self._shader, {"first": first, "count": count})
        self._shader.run(-(-count // GROUP_SIZE))
        self._context.memory_barrier()


def _scaled(picked: _Picked, rows: Int64, source: _Source, pictures: int) -> VirtualPointLights:
    """Some of what was found in a map, sending out all that it reflects."""
    records, space, texels = picked.records[rows], source.space, picked.texels[rows]
    flux = records["flux"].astype(np.float64) * (texels * space.unit**2)[:, None]
    factor = source.flux / float(flux.mean(axis=1).sum())
    # Several lights may be in one texel, and none stands for less.
    areas = picked.areas[rows] * np.maximum(texels * (factor / pictures), 1.0) * source.share
    positions = np.asarray(space.world_points(records["position"]), np.float64)
    return VirtualPointLights(positions, records["normal"].astype(np.float64), flux * factor, areas * space.unit**2)


def light_records(lights: VirtualPointLights, space: LocalSpace, gain: float = 1.0) -> np.ndarray:
    """(n,) of VIRTUAL_POINT_LIGHT in units of `space`. gain: multiplies their flux."""
    records = VIRTUAL_POINT_LIGHT.zeros(len(lights.areas))
    records["position"] = space.local_points(lights.positions)
    records["normal"] = lights.normals
    records["flux"] = lights.flux * (gain * space.unit**-2)
    records["area"] = lights.areas * space.unit**-2
    return records
