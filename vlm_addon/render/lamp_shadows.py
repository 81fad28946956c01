# SPDX-License-Identifier: GPL-3.0-or-later
"""The shadow maps of a scene's lamps, kept over frames: drawn again where something in them or their lamp changed."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..core.lamps import is_soft, lamp_samples
from ..core.scene import SUN, Light
from .geometry import GpuGeometry
from .kept import Kept
from .kept_shadow_maps import KeptShadowMaps
from .lamp_records import lamp_record
from .local_space import LocalSpace
from .passes.shadow_map import ShadowMap, ShadowMapPass, rounding
from .shader_library import ShaderLibrary
from .shadow_casters import ShadowCasters
from .shadow_views import cone_widening, shadow_kind
from .shadow_windows import Bounds, ShadowWindow, same_window

if TYPE_CHECKING:
    import moderngl

KIND = "shadow maps"
"""Of what is counted as kept over frames."""
FINEST = 2.0**-7
"""What float32 may leave of places in the still space, texels of a map that is drawn there."""


@dataclass(frozen=True)
class StillLamps:
    """Lamps and what they shine on in a space that no camera moves, so that maps of them outlast a frame.

    lights: in world space, as those of the frame. space: the frame's.
    """

    casters: ShadowCasters
    kept: Kept
    lights: tuple[Light, ...]
    space: LocalSpace


@dataclass(frozen=True)
class _Source:
    """What a lamp's maps are drawn from. light, window: in the space of the geometry; key: of all that they depend on
    but the sample; bounds: of what shows in them; space: of the geometry, None for the frame's."""

    light: Light
    key: str
    geometry: Callable[[], GpuGeometry]
    bounds: Bounds | None
    space: LocalSpace | None = None
    window: ShadowWindow | None = None


class LampShadows:
    """The maps of a scene's lamps over the samples of a frame and, with StillLamps, over frames.

    Maps are drawn in the still space and outlast camera moves, but for the smallest windows around the eye, for which
    only the frame's space has digits enough.
    """

    def __init__(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        geometry: GpuGeometry,
        lights: Sequence[Light],
        resolution: int,
        still: StillLamps | None = None,
    ) -> None:
        """lights: in the geometry's space. Without `still`, all maps are drawn from the geometry and last as long as
        this."""
        self.lights = tuple(lights)
        self.bounds: Bounds = geometry.low, geometry.high
        self._geometry: Callable[[], GpuGeometry] = lambda: geometry
        self._is_empty, self._has_alpha = geometry.triangle_count == 0, geometry.has_alpha
        self._origin = geometry.origin
        self._pass = ShadowMapPass(context, shaders, resolution)
        self._still = still
        self._world = {} if still is None else dict(zip(self.lights, still.lights, strict=True))
        self._space = None if still is None else still.space
        self._keeps_samples = still is not None
        self._sources: dict[tuple[Light, ShadowWindow | None], _Source] = {}
        self._shared: dict[tuple[int, int], moderngl.Texture] = {}
        self._maps = KeptShadowMaps()
        if still is not None:
            self._maps = still.kept.hold(KIND, KeptShadowMaps)

    def for_lights(self, lights: Sequence[Light]) -> LampShadows:
        """The same for other lights, of these or SUNs; what both have is drawn once for both."""
        other = copy.copy(self)
        other.lights = tuple(lights)
        return other

    def still(self) -> tuple[LampShadows, LocalSpace]:
        """The same lamps, with a power of 1 but for the world's, in the space that no camera moves; and that space."""
        assert self._still is not None
        casters, space = self._still.casters, self._still.casters.space
        other = copy.copy(self)
        world = [
            replace(_with_unit_power(self._world_light(light)), casts_shadow=light.casts_shadow)
            for light in self.lights
        ]
        other.lights = tuple(space.light(light) for light in world)
        other.bounds = casters.low, casters.high
        other._geometry, other._origin, other._space = casters.geometry, np.zeros(3), space
        other._world = dict(zip(other.lights, world, strict=True))
        other._keeps_samples = False
        other._sources = {}
        return other, space

    def uses_windows(self, lamp_index: int) -> bool:
        """Whether the lamp's map can be confined to a part of the scene."""
        light = self.lights[lamp_index]
        return light.kind == SUN and light.casts_shadow and not self._is_empty

    def side(self, lamp_index: int) -> int:
        """Texels along the lamp's map."""
        return self._pass.size(self.lights[lamp_index])[0]

    def key(self, lamp_index: int) -> str:
        """Hash of all that the shadows of a lamp depend on, in the still space."""
        light = self.lights[lamp_index]
        return self._source(light, None).key if light.casts_shadow and not self._is_empty else ""

    def shadow_map(
        self,
        lamp_index: int,
        sample_index: int,
        sample_count: int,
        together: int = 1,
        window: ShadowWindow | None = None,
    ) -> ShadowMap:
        """The map of one of `sample_count` samples of a lamp; valid until the next call for another one.

        together: how many consecutive samples are used in one picture. window: as in ShadowMapPass.render.
        """
        light = self.lights[lamp_index]
        sampled = (sample_index, sample_count, together)
        source = None if self._is_empty or not light.casts_shadow else self._source(light, window)
        if source is None or (source.bounds is None and source.space is not None):
            return ShadowMap(self._pass.empty, self._record(light, *sampled))
        changes = self._changes(light)
        key = f"{source.key} {sampled}" if changes else source.key
        found = self._maps.get(key)
        if found is None:
            found = self._draw(source, sampled, key, self._keeps_samples or not changes)
        elif self._still is not None:
            self._still.kept.count(KIND, is_new=False)
        return ShadowMap(found.texture, self._placed(found.record, source, light, sampled))

    def samples_of(self, lamp_index: int, most: int) -> int:
        """How many samples of a lamp differ, at most `most`."""
        light = self.lights[lamp_index]
        return most if self._changes(light) and not light.from_world else 1

    def _changes(self, light: Light) -> bool:
        """Whether samples differ: points of a soft lamp, or occluders that are let through by chance."""
        return is_soft(light) or (light.casts_shadow and self._has_alpha)

    def _source(self, light: Light, window: ShadowWindow | None) -> _Source:
        if (light, window) not in self._sources:
            self._sources[light, window] = self._new_source(light, window)
        return self._sources[light, window]

    def _new_source(self, light: Light, window: ShadowWindow | None) -> _Source:
        if self._still is None:
            return _Source(light, repr((light, window)), self._geometry, None, window=window)
        casters, digests, world = self._still.casters, self._still.kept.digests, self._world_light(light)
        size = self._pass.size(light)
        widening = cone_widening(size[0]) if shadow_kind(light) == "SHADOW_CONE" else 0.0
        seen, bounds = casters.seen_by(world, widening)
        key = digests.of(seen, _shadow_shape(world), size)
        if window is not None and self._is_too_fine(window, size):
            return _Source(light, digests.of(key, window, self._space), self._geometry, self.bounds, window=window)
        if window is not None:
            window = same_window(window, self.bounds, (casters.low, casters.high))
            key = digests.of(key, window)
        return _Source(casters.space.light(world), key, casters.geometry, bounds, casters.space, window)

    def _is_too_fine(self, window: ShadowWindow, size: tuple[int, int]) -> bool:
        """Whether a window shows what the still space has no digits for, or is of that space already."""
        assert self._still is not None
        texel = 2.0 * window.radius / size[0]
        return self._space is self._still.casters.space or rounding(self.bounds) > FINEST * texel

    def _world_light(self, light: Light) -> Light:
        # A sun is the same in every space.
        return light if light.kind == SUN else self._world[light]

    def _draw(self, source: _Source, sampled: tuple[int, int, int], key: str, keep: bool) -> ShadowMap:
        size = self._pass.size(source.light)
        keep = keep and self._maps.has_room(size)
        texture = None if keep else self._shared.get(size)
        found = self._pass.render(source.geometry(), source.light, *sampled, texture, source.window, source.bounds)
        if keep:
            self._maps.add(key, found)
        else:
            self._shared[size] = found.texture
        if self._still is not None:
            self._still.kept.count(KIND, is_new=True)
        return found

    def _record(self, light: Light, sample_index: int, sample_count: int, together: int) -> np.ndarray:
        samples = lamp_samples(light, sample_count, together)
        return lamp_record(light, samples[sample_index % len(samples)], self._origin)

    def _placed(self, drawn: np.ndarray, source: _Source, light: Light, sampled: tuple[int, int, int]) -> np.ndarray:
        """The record of a sample of a lamp with the shadow fields of its map, taken into the frame's space."""
        record = self._record(light, *sampled)
        for name in _SHADOW_FIELDS:
            record[name] = drawn[name]
        if source.space is None or source.space is self._space:
            return record
        assert self._space is not None
        scale, offset = source.space.to(self._space)
        origin = scale * drawn["shadow_origin"][0].astype(np.float64) + offset
        record["shadow_origin"] = origin
        record["shadow_origin_rest"] = origin - record["shadow_origin"][0].astype(np.float64)
        record["shadow_scale"] = 1.0 / scale
        # The receiver is rounded in another space than what it is compared with.
        record["shadow_rounding"] += rounding(self.bounds) / scale
        return record


_SHADOW_FIELDS = (
    "shadow_kind",
    "shadow_origin",
    "shadow_extent",
    "shadow_centre",
    "shadow_near",
    "shadow_rounding",
)


def _with_unit_power(light: Light) -> Light:
    return light if light.from_world else replace(light, power=(1.0, 1.0, 1.0))


def _shadow_shape(light: Light) -> Light:
    """`light` without what its shadows do not depend on."""
    position = (0.0, 0.0, 0.0) if light.kind == SUN else light.position
    return replace(light, name="", power=(1.0, 1.0, 1.0), position=position, spot_blend=0.0, soft_falloff=True)
