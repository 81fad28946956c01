# SPDX-License-Identifier: GPL-3.0-or-later
"""Specular reflection of the virtual light mesh by linearly transformed cosines."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...core.ltc import LEAST_COSINE
from ...core.progress import Progress, step
from ..albedo_texture import AlbedoTexture
from ..gpu_layout import CONSTANTS
from ..ltc_texture import LtcTexture
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from ..virtual_lights import GpuVirtualLights
from .gbuffer import GBuffer
from .phase_two import IrradianceImage, bind_lights, entry_runs
from .tile_bounds import TILE_DEFINES, TileBoundsPass

if TYPE_CHECKING:
    import moderngl

# The texture units of the G-buffer and of the albedo table are taken.
LTC_TABLE_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
LTC_DEFINES = {"LTC_LEAST_COSINE": LEAST_COSINE}
"""What lib/ltc.glsl needs."""
# A lobe takes as long as so many irradiances, and dispatches are to end within a second.
_COST = 8


class LightMeshReflectionPass:
    """What the specular layer of each pixel sends to the eye of the light of all virtual lights, unoccluded.

    GGX with height-correlated Smith shadowing and Fresnel as lib/brdf.glsl has them. A light far smaller than the lobe
    is reflected by the lobe itself; larger ones by a fit (Heitz et al. 2016) that has the lobe's albedo.
    """

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._image = IrradianceImage(context, width, height)
        self._tile_bounds = TileBoundsPass(context, shaders, width, height)
        self._albedo, self._table = AlbedoTexture(context), LtcTexture(context)
        defines = {**TILE_DEFINES, **LTC_DEFINES, "LTC_TABLE_UNIT": LTC_TABLE_UNIT}
        self._shader = shaders.compute("passes/light_mesh_reflection.comp", defines)

    def render(
        self, gbuffer: GBuffer, view: View, lights: GpuVirtualLights, radiosity: moderngl.Buffer, progress: Progress
    ) -> moderngl.Texture:
        """Radiance in W/(m² sr), RGBA32F with w 0; 0 where no surface shows and on surfaces without a specular layer.

        radiosity: one vec4 a light, rgb in W/m². Lights leave out surfaces as
        core.light_links.leaves_out says. `progress` hears of each dispatch and may cancel. The next call overwrites
        the texture.
        """
        tiles = self._tile_bounds.render(gbuffer)
        self._image.clear()
        self._albedo.bind()
        self._table.bind(LTC_TABLE_UNIT)
        bind_lights(tiles, lights, radiosity)
        camera = {
            "camera_position": view.position,
            "camera_backward": view.backward,
            "is_orthographic": view.is_orthographic,
        }
        set_uniforms(self._shader, {**tiles.uniforms(), **camera})
        width, height = tiles.size
        for first, end in entry_runs(lights.count, width * height * _COST):
            set_uniforms(self._shader, {"first_light": first, "end_light": end})
            self._shader.run(*tiles.grid)
            self._context.memory_barrier()
            step(progress, end / lights.count, "reflection of the light mesh")
        return self._image.texture
