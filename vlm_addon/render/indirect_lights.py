# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual point lights on what the lamps light, found in their reflective shadow maps (seed 001, 3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..core.scene import Float64
from ..core.vpl import VirtualPointLights
from ..core.vpl_placement import share_out
from .gpu_layout import CONSTANTS, VIRTUAL_POINT_LIGHT
from .local_space import LocalSpace
from .map_places import MapPlaces, Places, places_in
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
    """Lights of one map, world space. texel_areas: (n,) m², what a texel covers there. share: of its lamp, which the
    map shows: what other maps of the lamp show is largely the same surface."""

    lights: VirtualPointLights
    texel_areas: Float64
    share: float


class IndirectLights:
    """Places the lights of a frame, for each picture others.

    flux: (3,) float64 W, all that the maps' surfaces reflect. brightest: (3,) float64 W/m², what no irradiance exceeds.
    """

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, maps: LampReflections) -> None:
        self._context = context
        self._maps = maps
        units = {f"RSM_{name}_UNIT": FIRST_UNIT + i for i, name in enumerate(("POSITION", "NORMAL", "FLUX"))}
        bindings = {"TEXEL_BINDING": TEXEL_BINDING, "PICKED_BINDING": PICKED_BINDING}
        self._shader = shaders.compute("passes/rsm_pick.comp", {"GROUP_SIZE": GROUP_SIZE, **units, **bindings})
        self._fluxes: list[float] = []
        self._places: list[Places] = []
        self.flux, self.brightest = np.zeros(3), np.zeros(3)
        for index, found in enumerate(maps.maps()):
            flux = found.total_flux() * found.space.unit**2
            self.flux += flux
            self.brightest += found.brightest
            self._fluxes.append(float(flux.mean()))
            self._places.append(places_in(found.record, found.side, 1 + index * POINTS_APART))

    def take(self, count: int, pictures: int = 1) -> VirtualPointLights:
        """The next `count` lights in world space; fewer where lamps light next to nothing of what they see.

        They share `count` by what the maps reflect, and together send out all of it, mean of the channels. pictures:
        how many such sets are averaged, so that a light's piece of surface is a part of what it alone would stand for.
        """
        counts = share_out(count, np.array(self._fluxes))
        if not sum(counts):
            return NO_LIGHTS
        places = [chosen.take(LOOKED_UP * number) for chosen, number in zip(self._places, counts, strict=True)]
        picked = self._pick(places, counts)
        scaled = [
            _scaled(found, flux, pictures)
            for found, flux in zip(picked, self._fluxes, strict=True)
            if len(found.texel_areas)
        ]
        if not scaled:
            return NO_LIGHTS
        names = ("positions", "normals", "flux", "areas")
        together = VirtualPointLights(*(np.concatenate([getattr(lights, name) for lights in scaled]) for name in names))
        # Maps that got no light leave theirs to the others.
        missing = float(self.flux.mean()) / float(together.flux.mean(axis=1).sum())
        return VirtualPointLights(
            together.positions, together.normals, together.flux * missing, together.areas * missing
        )

    def _pick(self, places: list[MapPlaces], most: list[int]) -> list[_Picked]:
        """What is at the places of each map: the first of it, up to as many as its part of `most`."""
        counts = [len(chosen.shares) for chosen in places]
        texels = self._context.buffer(np.concatenate([chosen.texels for chosen in places]).astype(np.int32).tobytes())
        results = self._context.buffer(reserve=VIRTUAL_POINT_LIGHT.dtype.itemsize * sum(counts))
        seen, first = [], 0
        for found, count in zip(self._maps.maps(), counts, strict=True):
            seen.append((found.space, float(found.record["sample_weight"][0])))
            if count:
                self._run(found, texels, results, first, count)
            first += count
        records = np.frombuffer(results.read(), VIRTUAL_POINT_LIGHT.dtype)
        parts = np.split(records, np.cumsum(counts)[:-1])
        return [
            _in_world(part, chosen, number, space, share)
            for part, chosen, number, (space, share) in zip(parts, places, most, seen, strict=True)
        ]

    def _run(
        self, found: ReflectiveShadowMap, texels: moderngl.Buffer, results: moderngl.Buffer, first: int, count: int
    ) -> None:
        found.bind(FIRST_UNIT)
        texels.bind_to_storage_buffer(TEXEL_BINDING)
        results.bind_to_storage_buffer(PICKED_BINDING)
        set_uniforms(self._shader, {"first": first, "count": count})
        self._shader.run(-(-count // GROUP_SIZE))
        self._context.memory_barrier()


def _in_world(records: np.ndarray, places: MapPlaces, most: int, space: LocalSpace, share: float) -> _Picked:
    """Of the first `most` records that are lit."""
    lit = np.flatnonzero(records["flux"].max(axis=1) > 0.0)[:most]
    records, shares = records[lit], places.shares[lit]
    texel_areas = records["area"].astype(np.float64) * space.unit**2
    return _Picked(
        VirtualPointLights(
            np.asarray(space.world_points(records["position"]), np.float64),
            records["normal"].astype(np.float64),
            records["flux"].astype(np.float64) * (shares * space.unit**2)[:, None],
            texel_areas * shares,
        ),
        texel_areas,
        share,
    )


def _scaled(picked: _Picked, flux: float, pictures: int) -> VirtualPointLights:
    """The lights of a map that reflects `flux`, W, mean of the channels."""
    lights = picked.lights
    factor = flux / float(lights.flux.mean(axis=1).sum())
    # Several lights may be in one texel, and none stands for less.
    areas = np.maximum(lights.areas * (factor / pictures), picked.texel_areas) * picked.share
    return VirtualPointLights(lights.positions, lights.normals, lights.flux * factor, areas)


def light_records(lights: VirtualPointLights, space: LocalSpace, gain: float = 1.0) -> np.ndarray:
    """(n,) of VIRTUAL_POINT_LIGHT in units of `space`. gain: multiplies their flux."""
    records = VIRTUAL_POINT_LIGHT.zeros(len(lights.areas))
    records["position"] = space.local_points(lights.positions)
    records["normal"] = lights.normals
    records["flux"] = lights.flux * (gain * space.unit**-2)
    records["area"] = lights.areas * space.unit**-2
    return records
