# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of every pixel from near lights one by one and from far ones by clusters, within a tolerance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...core.progress import Progress, step
from ..buffer_pool import BufferPool
from ..light_forest import GpuLightForest
from ..shader_library import Defines, ShaderLibrary, set_uniforms
from ..virtual_lights import GpuVirtualLights
from .gbuffer import GBuffer
from .light_picks import LightPicks
from .phase_two import (
    MAX_LIGHTS_PER_DISPATCH,
    PHASE_TWO_DEFINES,
    LightSumPass,
    bind_lights,
    entry_runs,
)
from .tile_bounds import TILE_SIDE, Tiles
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


class ClusteredPhaseTwoPass(LightSumPass):
    """The sum over what core.light_cut finds for each pixel, a tile of pixels at a time.

    entries: in the lists of all tiles of the pictures so far. tiles: that showed a surface.
    """

    def _prepare(self) -> None:
        self._pool = BufferPool(self._context)
        self._walk = TileWalkPass(self._context, self._shaders, self._pool)
        self._sums = _of_both(self._shaders, self._sum_defines)
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
            self._irradiance.texture.bind_to_image(0)
            shader, most = self._sums[lists.of_lights], _most(lists)
            if self._visibility is not None:
                self._visibility.bind(shader, of_clusters=not lists.of_lights)
                most = self._visibility.per_dispatch(most)
            self._meet(shader, most, tiles, lists, gbuffer, lights, radiosity, forest)
            step(progress, share, "phase two")
        return self._irradiance.texture

    def pick(
        self,
        picks: LightPicks,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        forest: GpuLightForest,
        progress: Progress,
    ) -> None:
        """As PhaseTwoPass.pick; picks may be clusters, as rows of `forest.nodes`."""
        both = _of_both(self._shaders, picks.defines)
        tiles = self._tile_bounds.render(gbuffer)
        picks.begin(both[False], self._irradiance.texture)
        for share, lists in self._walk.lists(tiles, tiles.shown(), forest):
            shader, most = both[lists.of_lights], picks.per_dispatch(_most(lists))
            picks.bind(shader, self._irradiance.texture)
            self._meet(shader, most, tiles, lists, gbuffer, lights, radiosity, forest)
            step(progress, share, "phase two")

    def _meet(
        self,
        shader: moderngl.ComputeShader,
        most: int,
        tiles: Tiles,
        lists: TileLists,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        forest: GpuLightForest,
    ) -> None:
        """Lets `shader` meet what is in `lists`. most: entries of a dispatch."""
        gbuffer.bind()
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
            for first, end in entry_runs(lists.longest, len(lists.tiles) * TILE_SIDE**2, most):
                set_uniforms(shader, {**tiles.uniforms(), "first_entry": first, "end_entry": end})
                shader.run(len(lists.tiles))
                self._context.memory_barrier()


def _of_both(shaders: ShaderLibrary, defines: Defines) -> dict[bool, moderngl.ComputeShader]:
    """Shaders for lists of clusters (False) and of lights (True)."""
    files = {False: "passes/phase_two_clusters.comp", True: "passes/phase_two.comp"}
    return {of_lights: shaders.compute(file, {**_DEFINES, **defines}) for of_lights, file in files.items()}


def _most(lists: TileLists) -> int:
    return MAX_LIGHTS_PER_DISPATCH if lists.of_lights else MAX_CLUSTERS_PER_DISPATCH
