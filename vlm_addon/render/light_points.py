# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the visibility of virtual lights is asked for: the points of the visible surface that phase one measures at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import DeviceError
from ..core.light_mesh import VirtualLightMesh
from ..core.scene import Float64
from .gpu_layout import LIGHT_POINT

if TYPE_CHECKING:
    import moderngl


class GpuLightPoints:
    """points: a LIGHT_POINT for each source sample; offsets: where those of each light begin and, at last, end."""

    def __init__(self, context: moderngl.Context, light_mesh: VirtualLightMesh, origin: Float64) -> None:
        """origin: (3,) float64, of the light mesh's space. Raises DeviceError where the samples do not fit."""
        samples = light_mesh.samples
        records = LIGHT_POINT.zeros(len(samples.positions))
        limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        if records.nbytes > limit:
            most = limit // LIGHT_POINT.dtype.itemsize
            raise DeviceError(
                f"{len(records):,} source samples; the device holds {most:,}; bake fewer lights or samples"
            )
        records["position"] = samples.positions - origin
        records["weight"] = samples.weights
        records["normal"] = samples.normals
        records["light"] = np.repeat(np.arange(len(light_mesh)), np.diff(samples.offsets))
        self.points = context.buffer(records.tobytes() or bytes(32))
        self.offsets = context.buffer(samples.offsets.astype(np.uint32).tobytes())
