# SPDX-License-Identifier: GPL-3.0-or-later
"""The virtual lights on the GPU."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import DeviceError
from ..core.light_mesh import VirtualLightMesh
from ..core.scene import Float64
from .gpu_layout import CONSTANTS, VIRTUAL_LIGHT
from .link_table import LinkTable

if TYPE_CHECKING:
    import moderngl


class GpuVirtualLights:
    """One VirtualLight record for each triangle of a light mesh, relative to a local origin, and its links."""

    def __init__(self, context: moderngl.Context, light_mesh: VirtualLightMesh, origin: Float64) -> None:
        """origin: (3,) float64, world space. Raises DeviceError where the device's blocks are too small."""
        limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        self.count = len(light_mesh)
        if self.count * VIRTUAL_LIGHT.dtype.itemsize > limit:
            most = limit // VIRTUAL_LIGHT.dtype.itemsize
            raise DeviceError(f"{self.count:,} virtual lights; the device holds {most:,}; bake fewer")
        self._buffer = context.buffer(virtual_light_records(light_mesh, origin).tobytes() or bytes(16))
        self._links = LinkTable(context, light_mesh.links) if len(light_mesh.links) else None

    def bind(self) -> None:
        """Binds the records to VIRTUAL_LIGHT_BINDING, and the links, if there are any, to LINK_UNIT."""
        self._buffer.bind_to_storage_buffer(int(CONSTANTS["VIRTUAL_LIGHT_BINDING"]))
        if self._links is not None:
            self._links.bind()


def virtual_light_records(light_mesh: VirtualLightMesh, origin: Float64) -> np.ndarray:
    """(n,) records of VIRTUAL_LIGHT, everything in float64 relative to `origin` before it is rounded."""
    corners = light_mesh.corners - origin
    records = VIRTUAL_LIGHT.zeros(len(light_mesh))
    for k in range(3):
        records[f"v{k}"] = corners[:, k]
    records["tag_id"] = light_mesh.tag_ids
    records["strength"] = light_mesh.strength
    records["area_vector"] = light_mesh.area_vectors
    records["area"] = light_mesh.areas
    from_centroid = corners - corners.mean(axis=1, keepdims=True)
    records["bounding_radius"] = np.linalg.norm(from_centroid, axis=2).max(axis=1)
    return records
