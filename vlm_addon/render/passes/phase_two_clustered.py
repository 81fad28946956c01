# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of every pixel from near lights one by one and from far ones by clusters, within a tolerance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...core.progress import Progress, step
from ..buffer_pool import BufferPool
from ..light_forest import GpuLightForest
from ..shader_library import ShaderLibrary, set_uniforms
from ..virtual_lights import GpuVirtualLights
from .gbuffer import GBuffer
from .phase_two import MAX_LIGHTS_PER_DISPATCH, PHASE_TWO_DEFINES, IrradianceImage, bind_lights, entry_runs
from .tile_bounds import TILE_SIDE, TileBoundsPass, Tiles
from .tile_walk import (
    LIGHT_NODE_BINDING,
    LIST_BINDING,
    LIST_OFFSET_BINDING,
    LIST_TILE_BINDING,
    TileLists,
    TileWalkPass,
)

if TYPE_CHECKING:
    import moderngl

LIGHT_CLUSTER_BINDING = 3
LIGHT_WINDOW_BINDING = 6
# As MAX_LIGHTS_PER_DISPATCH; a cluster takes four rounds more for each pixel, unless a compiler unrolls them.
MAX_CLUSTERS_PER_DISPATCH = 2048
_DEFINES = {
    **PHASE_TWO_DEFINES,
    "LISTED": True,
    "LIST_BINDING": LIST_BINDING,
    "LIST_OFFSET_BINDING": LIST_OFFSET_BINDING,
    "LIST_TILE_BINDING": LIST_TILE_BINDING,
    "LIGHT_NODE_BINDING": LIGHT_NODE_BINDING,
    "LIGHT_CLUSTER_BINDING": LIGHT_CLUSTER_BINDING,
    "LIGHT_WINDOW_BINDING": LIGHT_WINDOW_BINDING,
}


class ClusteredPhaseTwoPass:
    """The sum over what core.light_cut finds for each pixel, a tile of pixels at a time.

    entries: in the lists of all tiles of the pictures so far. tiles: that showed a surface.
    """

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._pool = BufferPool(context)
        self._irradiance = IrradianceImage(context, width, height)
        self._tile_bounds = TileBoundsPass(context, shaders, width, height)
        self._walk = TileWalkPass(context, shaders, self._pool)
        self._lights = shaders.compute("passes/phase_two.comp", _DEFINES)
        self._clusters = shaders.compute("passes/phase_two_clusters.comp", _DEFINES)
        self.entries = 0
        self.tiles = 0

    @property
    def nbytes(self) -> int:
        """Bytes of the buffers that lists were made in."""
        return self._pool.nbytes

    def render(
        self,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        forest: GpuLightForest,
        progress: Progress,
    ) -> moderngl.Texture:
        """As PhaseTwoPass.render, but for what the clusters differ from their lights."""
        tiles = self._tile_bounds.render(gbuffer)
        self._irradiance.clear()
        shown = tiles.shown()
        self.tiles += len(shown)
        for share, lists in self._walk.lists(tiles, shown, forest):
            self.entries += lists.count
            self._add(tiles, lists, gbuffer, lights, radiosity, forest)
            step(progress, share, "phase two")
        return self._irradiance.texture

    def _add(
        self,
        tiles: Tiles,
        lists: TileLists,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        forest: GpuLightForest,
    ) -> None:
        """Adds what is in `lists`."""
        shader = self._lights if lists.of_lights else self._clusters
        gbuffer.bind()
        self._irradiance.texture.bind_to_image(0)
        with (
            self._pool.uploaded(lists.offsets.astype("<u4")) as offsets,
            self._pool.uploaded(lists.tiles) as list_tiles,
        ):
            bind_lights(tiles, lights, radiosity)
            offsets.bind_to_storage_buffer(LIST_OFFSET_BINDING)
            list_tiles.bind_to_storage_buffer(LIST_TILE_BINDING)
            lists.entries.bind_to_storage_buffer(LIST_BINDING)
            if lists.of_lights:
                forest.light_windows.bind_to_storage_buffer(LIGHT_WINDOW_BINDING)
            else:
                forest.nodes.bind_to_storage_buffer(LIGHT_NODE_BINDING)
                forest.clusters.bind_to_storage_buffer(LIGHT_CLUSTER_BINDING)
            most = MAX_LIGHTS_PER_DISPATCH if lists.of_lights else MAX_CLUSTERS_PER_DISPATCH
            for first, end in entry_runs(lists.longest, len(lists.tiles) * TILE_SIDE**2, most):
                set_uniforms(shader, {**tiles.uniforms(), "first_entry": first, "end_entry": end})
                shader.run(len(lists.tiles))
                self._context.memory_barrier()
