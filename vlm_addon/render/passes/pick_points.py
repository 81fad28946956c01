# SPDX-License-Identifier: GPL-3.0-or-later
"""From picked lights and clusters to the source samples that rays are cast to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..gpu_layout import CONSTANTS
from ..light_forest import GpuLightForest
from ..light_points import GpuLightPoints
from ..shader_library import ShaderLibrary
from ..virtual_lights import GpuVirtualLights
from .gbuffer import GBuffer
from .light_picks import PICK_DEFINES, LightPicks

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
LIGHT_POINT_BINDING, POINT_OFFSET_BINDING = 0, 1
_NODE_BINDING, _CLUSTER_BINDING, _ID_BINDING = 4, 5, 6
POINT_DEFINES: dict[str, int | float | str] = {
    **PICK_DEFINES,
    "GROUP_SIDE": GROUP_SIDE,
    "LIGHT_POINT_BINDING": LIGHT_POINT_BINDING,
    "HIDDEN_POINT": "0x80000000u",
}
"""What shaders need that know of picked points."""


class PickPointsPass:
    """Chooses a source sample for each pick."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self._context = context
        self._shaders = shaders

    def render(
        self,
        picks: LightPicks,
        gbuffer: GBuffer,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        points: GpuLightPoints,
        forest: GpuLightForest | None,
    ) -> None:
        """Puts rows of `points` in place of lights and clusters in `picks`, with the highest bit set where all samples
        of the light face away. forest: that the clusters are in, if there are any."""
        defines = {
            **POINT_DEFINES,
            "PICK_GROUPS": picks.groups,
            "CLUSTERED": forest is not None,
            "POINT_OFFSET_BINDING": POINT_OFFSET_BINDING,
            "LIGHT_NODE_BINDING": _NODE_BINDING,
            "LIGHT_CLUSTER_BINDING": _CLUSTER_BINDING,
            "LIGHT_ID_BINDING": _ID_BINDING,
        }
        shader = self._shaders.compute("passes/pick_points.comp", defines)
        gbuffer.bind()
        lights.bind()
        radiosity.bind_to_storage_buffer(int(CONSTANTS["RADIOSITY_BINDING"]))
        points.points.bind_to_storage_buffer(LIGHT_POINT_BINDING)
        points.offsets.bind_to_storage_buffer(POINT_OFFSET_BINDING)
        if forest is not None:
            forest.nodes.bind_to_storage_buffer(_NODE_BINDING)
            forest.clusters.bind_to_storage_buffer(_CLUSTER_BINDING)
            forest.light_ids.bind_to_storage_buffer(_ID_BINDING)
        picks.bind_read(shader)
        width, height = picks.met.size
        shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE), picks.count)
        self._context.memory_barrier()
