# SPDX-License-Identifier: GPL-3.0-or-later
"""The rays that specular lobes send out, and what lobes make of what these find."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ...core.settings import OWN, setting
from ..albedo_texture import AlbedoTexture
from ..gpu_layout import CONSTANTS
from ..local_space import HALF_DIAGONAL
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
RAYS_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
"""Of the rays in every pass that follows them."""
INCOMING_UNIT, DISTANCES_UNIT = RAYS_UNIT + 1, RAYS_UNIT + 4
DIAGONAL = 2.0 * HALF_DIAGONAL
"""Of every scene's visible bounds, in local units: no ray between two of its surfaces is longer."""
CORNERS = (-2, -1)
"""Where the 4 x 4 pixels around a pixel start, from one picture to the next: in the mean they lie around it."""


@dataclass(frozen=True)
class RaySettings:
    """Which surfaces send rays, and how far these go."""

    reach: float = setting(
        1.0,
        "share",
        1e-3,
        1.0,
        "Of the scene's diagonal that a ray goes at most; hits fade over the last tenth",
        source="003, 4.3.1: a certain distance",
    )
    thickness: float = setting(
        0.005,
        "share",
        0.0,
        1.0,
        "Of the scene's diagonal that things are deep behind what is seen of them: rays that come in behind fade over "
        "it and pass beyond it; more fills gaps behind thick things and smears thin ones",
        source="003, 6.2.4: a fixed distance",
    )
    fade_start: float = setting(
        0.5, "roughness", 0.0, 1.0, "From which on reflections fade: one ray for each pixel is noisy there", source=OWN
    )
    fade_end: float = setting(0.8, "roughness", 0.0, 1.0, "From which on surfaces have no such reflections", source=OWN)


class ReflectionRays:
    """One ray for each glossy pixel and picture, drawn from its lobe, and the light that these bring to the eye.

    Any 4 x 4 pixels have evenly spread rays, which they share: each weighs what the others' rays have found by what its
    own lobe reflects from there. Mirrors keep to their own. rays: RGBA32F, unit direction and density in 1/sr, 0 where
    there is none. incoming: RGBA32F, to be filled: radiance in W/(m² sr) along the ray times confidence, and confidence
    in [0, 1].
    """

    def __init__(
        self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int, distance_channel: int
    ) -> None:
        """distance_channel: of the texture of distances that `resolve` is given."""
        self._context = context
        self._albedo = AlbedoTexture(context)
        self._sampler = shaders.compute("passes/reflection_rays.comp", {"GROUP_SIDE": GROUP_SIDE})
        units = {"RAYS_UNIT": RAYS_UNIT, "INCOMING_UNIT": INCOMING_UNIT, "DISTANCES_UNIT": DISTANCES_UNIT}
        defines = {"GROUP_SIDE": GROUP_SIDE, "DISTANCE_CHANNEL": distance_channel, **units}
        self._resolver = shaders.compute("passes/reflection_resolve.comp", defines)
        self.rays, self.incoming, self._reflected = (context.texture((width, height), 4, dtype="f4") for _ in range(3))

    def sample(self, gbuffer: GBuffer, view: View, settings: RaySettings, sample_index: int) -> None:
        """Fills `rays`, the same for every pass that is given the same `sample_index`."""
        gbuffer.bind()
        self.rays.bind_to_image(0, read=False, write=True)
        set_uniforms(self._sampler, {"sample_index": sample_index})
        self._run(self._sampler, view, settings)

    def resolve(
        self, gbuffer: GBuffer, view: View, settings: RaySettings, distances: moderngl.Texture, sample_index: int
    ) -> moderngl.Texture:
        """RGBA32F: radiance in W/(m² sr) to the eye times confidence, and confidence, both times what the roughness
        leaves. distances: m along each ray to what sends `incoming`. The next call overwrites the texture."""
        width = gbuffer.size[0]
        gbuffer.bind()
        self.rays.use(RAYS_UNIT)
        self.incoming.use(INCOMING_UNIT)
        distances.use(DISTANCES_UNIT)
        self._reflected.bind_to_image(0, read=False, write=True)
        first = CORNERS[sample_index % len(CORNERS)]
        set_uniforms(self._resolver, {"first": (first, first), "pixel_size": pixel_size(view, width)})
        self._run(self._resolver, view, settings)
        return self._reflected

    def _run(self, shader: moderngl.ComputeShader, view: View, settings: RaySettings) -> None:
        self._albedo.bind()
        uniforms: dict[str, Any] = {"roughness_fade": (settings.fade_start, settings.fade_end)}
        set_uniforms(shader, view.camera_uniforms() | uniforms)
        width, height = self.rays.size
        shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
        self._context.memory_barrier()


def pixel_size(view: View, width: int) -> tuple[float, float]:
    """m across a pixel of a picture of that width: at depth 0, and for each m of depth."""
    at_eye, per_depth = view.picture_width(width)
    return at_eye / width, per_depth / width
