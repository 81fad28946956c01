# SPDX-License-Identifier: GPL-3.0-or-later
"""Which share of each virtual light the rows of baked visibility see, through the octree of the scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...core.baked_visibility import (
    FULL,
    GRAZING,
    POINT_STEP,
    ROW_STEP,
    UNFACED,
    WEIGHT_STEPS,
    UInt8,
    words_of,
)
from ...core.errors import DeviceError
from ...core.light_mesh import SourceSamples
from ...core.progress import Progress, step
from ...core.scene import Float64
from ...core.visibility_cells import Bools
from ...core.visibility_rows import VisibilityRows
from ..buffer_pool import BufferPool
from ..prefix_sum import INVOCATIONS, run_for_each
from ..scene_octree import SceneOctree
from ..shader_library import ShaderLibrary, set_uniforms

if TYPE_CHECKING:
    import moderngl

# About a second on two cores without a GPU, so that a cancellation is heard; less than a millisecond with one.
RAYS_PER_DISPATCH = 1 << 18
NEAR_REACH = 2
"""Voxels near the ends of a way where triangles are asked at first; all along it where that finds it blocked."""
BAKED_DEFINES: dict[str, int | float | bool | str] = {
    "BAKED_WEIGHT_STEPS": f"{WEIGHT_STEPS}u",
    "BAKED_WEIGHT_BITS": f"{WEIGHT_STEPS.bit_length()}u",
    "BAKED_FULL": f"{FULL}u",
    "BAKED_UNFACED": f"{UNFACED}u",
    "BAKED_GRAZING": GRAZING,
    "BAKED_POINT_STEP": f"{POINT_STEP}u",
    "BAKED_ROW_STEP": f"{ROW_STEP}u",
}
"""What lib/baked_visibility.glsl needs."""
_BINDINGS = {
    name: binding
    for binding, name in enumerate(
        (
            *("ROW_POINT_BINDING", "LIGHT_SAMPLE_BINDING", "SAMPLE_OFFSET_BINDING", "SHARE_BINDING"),
            *("OCTREE_BINDING", "OCTREE_TRIANGLE_BINDING"),
        )
    )
}


_OPEN_BINDINGS = {
    name: binding
    for binding, name in enumerate(
        ("PLACE_BINDING", "NORMAL_BINDING", "OPEN_BINDING", "OCTREE_BINDING", "OCTREE_TRIANGLE_BINDING")
    )
}


class BakeVisibilityPass:
    """Casts the rays; everything in the voxel coordinates of one octree."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, near_reach: int = NEAR_REACH) -> None:
        """near_reach: 0 asks triangles all along every way."""
        self._context = context
        self._pool = BufferPool(context)
        defines = {**_BINDINGS, **BAKED_DEFINES, "GROUP_SIZE": INVOCATIONS, "NEAR_REACH": near_reach}
        self._shader = shaders.compute("passes/bake_visibility.comp", defines)
        self._open = shaders.compute("passes/bake_open.comp", {**_OPEN_BINDINGS, "GROUP_SIZE": INVOCATIONS})

    def are_open(self, places: Float64, normals: Float64, octree: SceneOctree) -> Bools:
        """core.visibility_rows.IsOpen, of the triangles of `octree`."""
        count, padding = len(places), ((0, 0), (0, 1))
        if not count:
            return np.zeros(0, bool)
        with (
            self._pool.uploaded(np.pad(places, padding).astype(np.float32)) as place_buffer,
            self._pool.uploaded(np.pad(normals, padding).astype(np.float32)) as normal_buffer,
            self._pool.take(4 * count) as opens,
        ):
            for binding, buffer in enumerate((place_buffer, normal_buffer, opens)):
                buffer.bind_to_storage_buffer(binding)
            octree.bind(_OPEN_BINDINGS["OCTREE_BINDING"], _OPEN_BINDINGS["OCTREE_TRIANGLE_BINDING"])
            set_uniforms(self._open, {"count": count})
            run_for_each(self._context, self._open, count)
            return np.frombuffer(opens.read(4 * count), np.uint32) != 0

    def bake(self, rows: VisibilityRows, samples: SourceSamples, octree: SceneOctree, progress: Progress) -> UInt8:
        """(rows, lights) uint8, FULL where all of a light is seen. samples: of the lights, in the octree's space.

        Raises DeviceError where the device's blocks are too small, Cancelled when `progress` says so.
        """
        lights, points = len(samples.offsets) - 1, rows.places.shape[1]
        pairs, words = len(rows) * lights, len(rows) * words_of(lights)
        if not pairs:
            return np.zeros((len(rows), lights), np.uint8)
        sample_places = octree.frame.voxels(samples.positions)
        with (
            self._pool.uploaded(_facets(rows.places.reshape(-1, 3), rows.normals.reshape(-1, 3))) as row_points,
            self._pool.uploaded(_facets(sample_places, samples.normals.astype(np.float64))) as light_samples,
            self._pool.uploaded(samples.offsets.astype("<u4")) as offsets,
            self._pool.uploaded(np.zeros(words, "<u4")) as shares,
        ):
            for binding, buffer in enumerate((row_points, light_samples, offsets, shares)):
                buffer.bind_to_storage_buffer(binding)
            octree.bind(_BINDINGS["OCTREE_BINDING"], _BINDINGS["OCTREE_TRIANGLE_BINDING"])
            set_uniforms(
                self._shader,
                {"points_per_row": points, "light_count": lights, "words_per_row": words_of(lights)},
            )
            at_once = max(RAYS_PER_DISPATCH // points, 1)
            for first in range(0, pairs, at_once):
                end = min(first + at_once, pairs)
                set_uniforms(self._shader, {"first_pair": first, "end_pair": end})
                run_for_each(self._context, self._shader, end - first)
                # Drivers queue dispatches; what is asked for next would wait for all of them.
                self._context.finish()
                step(progress, end / pairs, "visibility")
            data = np.frombuffer(shares.read(4 * words), np.uint8)
        return np.ascontiguousarray(data.reshape(len(rows), -1)[:, :lights])


def require_room(context: moderngl.Context, size: int) -> None:
    """Raises DeviceError where no block of the device holds `size` bytes."""
    limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
    if size > limit:
        needs, holds = (f"{1e-6 * bytes_:,.0f} MB" for bytes_ in (size, limit))
        remedy = "bake fewer lights or fewer cells"
        raise DeviceError(f"baked visibility needs a block of {needs}, the device holds {holds}; {remedy}")


def _facets(places: Float64, normals: Float64) -> np.ndarray:
    """Records of Facet."""
    records = np.zeros((len(places), 2, 4), np.float32)
    records[:, 0, :3], records[:, 1, :3] = places, normals
    return records
