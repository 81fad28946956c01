# SPDX-License-Identifier: GPL-3.0-or-later
"""Which rows of baked visibility count at each pixel, for passes that sum lights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.baked_visibility import LEAST_WEIGHT, MOST_ENTRIES, BakedVisibility, UInt8, words_of
from ...core.visibility_cells import SIDE
from ..local_space import LocalSpace
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .bake_visibility import BAKED_DEFINES, require_room
from .gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
ESCAPE_STEPS = 16
"""Voxels towards the eye in which a pixel looks for its zone: a wall is left at angles above some 4 degrees."""
ROW_UNITS = (10, 11, 12)
SHARE_BINDING = 7
_BINDINGS = {
    name: binding
    for binding, name in enumerate(
        (
            *("CELL_BINDING", "LABEL_BINDING", "COMPONENT_BINDING", "LIST_OFFSET_BINDING", "ENTRY_BINDING"),
            *("COUNT_BINDING", "OCTREE_BINDING"),
        )
    )
}
LIGHT_SUM_DEFINES: dict[str, int | float | bool | str] = {
    **BAKED_DEFINES,
    "BAKED": True,
    "BAKED_SHARE_BINDING": SHARE_BINDING,
    **{f"BAKED_ROW_UNIT_{i}": unit for i, unit in enumerate(ROW_UNITS)},
}
"""What passes/light_sum.glsl needs to multiply what it meets by visibility."""
# Rounds of loops more for each light and pixel than the one without visibility; a light takes one, too.
_ROUNDS = MOST_ENTRIES // 4


class GpuBakedVisibility:
    """Baked visibility on the device. light_shares: rows of bytes, four in a word."""

    def __init__(self, context: moderngl.Context, baked: BakedVisibility) -> None:
        """Raises DeviceError where a block does not hold it."""

        def upload(values: np.ndarray) -> moderngl.Buffer:
            require_room(context, values.nbytes)
            return context.buffer(values.tobytes() or bytes(16))

        self._context = context
        self.baked = baked
        cells = baked.cells
        self._buffers = [
            upload(np.stack([cells.first_zone[:-1], cells.label_start], axis=1)),
            upload(cells.labels),
            upload(cells.component),
            upload(baked.lists.offsets),
            upload(baked.lists.entries),
            context.buffer(reserve=8),
        ]
        self.light_shares = self.share_buffer(baked.shares)

    def share_buffer(self, shares: UInt8) -> moderngl.Buffer:
        """Rows of bytes, each filled up to whole words. Raises DeviceError where a block does not hold it."""
        padded = np.zeros((len(shares), 4 * words_of(shares.shape[1])), np.uint8)
        require_room(self._context, padded.nbytes)
        padded[:, : shares.shape[1]] = shares
        return self._context.buffer(padded.tobytes() or bytes(16))

    def bind(self) -> None:
        """Binds all but shares."""
        for binding, buffer in enumerate(self._buffers):
            buffer.bind_to_storage_buffer(binding)

    def forget_counts(self) -> None:
        """Sets `counts` to 0."""
        self.counts.orphan()
        self.counts.write(bytes(8))

    @property
    def counts(self) -> moderngl.Buffer:
        """Two uints that the pass counts up: pixels whose zone was not found, and pixels without any row."""
        return self._buffers[-1]


class BakedPixelsPass:
    """Rows and weights of the pixels of a picture."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, width: int, height: int) -> None:
        self._context = context
        self._rows = [context.texture((width, height), 4, dtype="u4") for _ in ROW_UNITS]
        defines = {
            **BAKED_DEFINES,
            **_BINDINGS,
            "GROUP_SIDE": GROUP_SIDE,
            "CELL_SIDE": SIDE,
            "MOST_ENTRIES": MOST_ENTRIES,
            "LEAST_WEIGHT": LEAST_WEIGHT,
            "ESCAPE_STEPS": ESCAPE_STEPS,
        }
        self._shader = shaders.compute("passes/baked_pixels.comp", defines)

    def render(self, gbuffer: GBuffer, view: View, space: LocalSpace, baked: GpuBakedVisibility) -> None:
        """Finds the rows of each pixel and leaves them on ROW_UNITS. space: of the G-buffer and the view."""
        width, height = gbuffer.size
        frame = baked.baked.frame
        gbuffer.bind()
        baked.bind()
        for unit, texture in enumerate(self._rows):
            texture.bind_to_image(unit, read=False)
        set_uniforms(
            self._shader,
            {
                "frame": (*space.local_points(frame.low).tolist(), space.unit / frame.voxel_size),
                "cells_per_axis": baked.baked.cells.per_axis,
                "component_count": baked.baked.cells.component_count,
                "eye": view.position,
                "backward": view.backward,
                "is_orthographic": view.is_orthographic,
                "picture_size": (width, height),
            },
        )
        self._shader.run(-(-width // GROUP_SIDE), -(-height // GROUP_SIDE))
        self._context.memory_barrier()
        self.bind()

    def bind(self) -> None:
        """Binds the rows to ROW_UNITS."""
        for unit, texture in zip(ROW_UNITS, self._rows, strict=True):
            texture.use(unit)

    def rows(self) -> np.ndarray:
        """(h, w, MOST_ENTRIES) uint32 words of lib/baked_visibility.glsl, row 0 at the bottom; for tests."""
        width, height = self._rows[0].size
        parts = [np.frombuffer(texture.read(), np.uint32).reshape(height, width, 4) for texture in self._rows]
        return np.concatenate(parts, axis=2)


@dataclass(frozen=True)
class PixelVisibility:
    """What passes that sum lights multiply by. pixels: that were rendered for the picture. lights, clusters: rows of
    shares, four in a word, and how many of each there are; clusters None where none are summed."""

    pixels: BakedPixelsPass
    lights: moderngl.Buffer
    light_count: int
    clusters: moderngl.Buffer | None = None
    cluster_count: int = 0

    @property
    def defines(self) -> dict[str, int | float | bool | str]:
        """Of shaders that sum lights."""
        return LIGHT_SUM_DEFINES

    def per_dispatch(self, most: int) -> int:
        """How many lights a dispatch may meet where it may meet `most` without visibility."""
        return 5 * most // (5 + 4 * _ROUNDS)

    def bind(self, shader: moderngl.ComputeShader, of_clusters: bool = False) -> None:
        """Binds rows and the shares of lights, or of clusters."""
        shares, count = (self.clusters, self.cluster_count) if of_clusters else (self.lights, self.light_count)
        assert shares is not None
        self.pixels.bind()
        shares.bind_to_storage_buffer(SHARE_BINDING)
        set_uniforms(shader, {"words_per_row": words_of(count)})
