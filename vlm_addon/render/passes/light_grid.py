# SPDX-License-Identifier: GPL-3.0-or-later
"""The lists of a light grid by compute shaders: the same, bit for bit, as core/block_lists.py makes.

From large blocks of cells to small ones: a block tests the lights of the larger block that holds it. Each size counts,
sums up the counts and writes, so nothing depends on the order in which a device does things.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...core.active_hemisphere import HalfBalls
from ...core.block_lists import BlockLists
from ...core.block_masks import SIDE
from ...core.errors import DeviceError
from ...core.progress import Progress, silent, step
from ...core.scene import Float32
from ..buffer_pool import BufferPool
from ..gpu_layout import HALF_BALL
from ..prefix_sum import INVOCATIONS, PrefixSum, run_for_each
from ..shader_library import ShaderLibrary, set_uniforms

if TYPE_CHECKING:
    import moderngl

# Blocks along each axis of the next larger block.
BRANCHING = 4
# Invocations that keep a large device busy: long lists of few blocks are shared among several.
ENOUGH_INVOCATIONS = 1 << 18
LEAST_LIGHTS_PER_PART = 64
# Mesa's llvmpipe ends an invocation's loops after 65,535 rounds in all, without a word. A mask takes up to 16 + 64.
MOST_LIGHTS_PER_PART = 1 << 15
MOST_MASKS_PER_PART = 1 << 9
# Invocations in one dispatch, so that a software renderer hears of a cancellation.
INVOCATIONS_PER_DISPATCH = 1 << 18

_BINDINGS = (
    "HALF_BALL_BINDING",
    "EDGE_BINDING",
    "PARENT_POSITION_BINDING",
    "PARENT_LIGHT_BINDING",
    "POSITION_BINDING",
    "LIGHT_BINDING",
    "MASK_BINDING",
)
_DEFINES = {name: binding for binding, name in enumerate(_BINDINGS)} | {
    "GROUP_SIZE": INVOCATIONS,
    "BRANCHING": BRANCHING,
}


@dataclass(frozen=True)
class GpuBlockLists:
    """Lists on the device, as core.block_lists.BlockLists; `lib/block_lists.glsl` finds a point's place in them.

    offsets: (blocks + 1) uint. light_ids: (pairs) uint. masks: (pairs) uvec2. The latter two hold at least one element.
    """

    cells_per_axis: int
    offsets: moderngl.Buffer
    light_ids: moderngl.Buffer
    masks: moderngl.Buffer
    pairs: int

    def read(self) -> BlockLists:
        """The lists on the host."""
        masks = np.frombuffer(self.masks.read(8 * self.pairs), np.uint64) if self.pairs else np.zeros(0, np.uint64)
        return BlockLists(self.cells_per_axis, _uints(self.offsets), _uints(self.light_ids)[: self.pairs], masks)


def upload(context: moderngl.Context, lists: BlockLists) -> GpuBlockLists:
    """`lists` on the device."""
    return GpuBlockLists(
        cells_per_axis=lists.cells_per_axis,
        offsets=context.buffer(lists.offsets.tobytes()),
        light_ids=context.buffer(lists.light_ids.tobytes() or bytes(4)),
        masks=context.buffer(lists.masks.tobytes() or bytes(8)),
        pairs=len(lists.light_ids),
    )


@dataclass(frozen=True)
class _Inputs:
    """Half balls and the cells' faces on the device."""

    half_balls: moderngl.Buffer
    edges: moderngl.Buffer
    cells_per_axis: int


@dataclass(frozen=True)
class _Blocks:
    """Blocks of `side` cells along each axis, per_axis of them. Part p of block b begins at positions[b parts + p]."""

    side: int
    per_axis: int
    parts: int
    positions: moderngl.Buffer

    @property
    def slots(self) -> int:
        """Parts of all blocks."""
        return self.per_axis**3 * self.parts

    def offsets(self) -> npt.NDArray[np.uint32]:
        """(blocks + 1,): where each block begins, and the entries of all."""
        return _uints(self.positions)[:: self.parts]


class LightGridPass:
    """Builds the lists of a grid of cells (seed 002, 4.2)."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self._context = context
        self._refine = {
            (masks, fill): shaders.compute("passes/light_grid_refine.comp", {**_DEFINES, "MASKS": masks, "FILL": fill})
            for masks in (False, True)
            for fill in (False, True)
        }
        self._sum = PrefixSum(context, shaders, BufferPool(context))
        self._block_limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])

    def build(self, half_balls: HalfBalls, edges: Float32, progress: Progress = silent) -> GpuBlockLists:
        """The lights whose half ball overlaps each cell, on the device; arguments as `build_block_lists`.

        From one block that holds all cells and lights down to the smallest. Raises DeviceError where the device's
        storage blocks are too small for the lists, Cancelled when `progress` says so.
        """
        records = half_ball_records(half_balls).tobytes() or bytes(HALF_BALL.dtype.itemsize)
        faces = self._context.buffer(np.ascontiguousarray(edges, np.float32).tobytes())
        inputs = _Inputs(self._context.buffer(records), faces, edges.shape[1] - 1)
        total = longest = len(half_balls)
        blocks = _Blocks(BRANCHING * max(inputs.cells_per_axis, SIDE), 1, 1, self._uploaded(np.array([0, total])))
        lights = self._uploaded(np.arange(max(total, 1)))
        masks = None
        for side in _sides(inputs.cells_per_axis):
            if BRANCHING**3 * total >= 2**32:
                raise DeviceError("the light grid may have 2^32 entries or more; use a smaller grid or range")
            per_axis = -(-inputs.cells_per_axis // side)
            parts = _parts(per_axis**3, longest, MOST_MASKS_PER_PART if side == SIDE else MOST_LIGHTS_PER_PART)
            children = _Blocks(side, per_axis, parts, self._buffer(4 * (per_axis**3 * parts + 1)))
            self._run(inputs, children, blocks, lights, None, None, progress)
            self._sum.run(children.positions, children.slots + 1)
            offsets = children.offsets()
            total, longest = int(offsets[-1]), int(np.diff(offsets.astype(np.int64)).max())
            masks = self._buffer(8 * total) if side == SIDE else None
            child_lights = self._buffer(4 * total)
            self._run(inputs, children, blocks, lights, child_lights, masks, progress)
            blocks, lights = children, child_lights
        assert masks is not None
        return GpuBlockLists(inputs.cells_per_axis, self._uploaded(offsets), lights, masks, total)

    def _run(
        self,
        inputs: _Inputs,
        blocks: _Blocks,
        parents: _Blocks,
        parent_lights: moderngl.Buffer,
        lights: moderngl.Buffer | None,
        masks: moderngl.Buffer | None,
        progress: Progress,
    ) -> None:
        """Counts the lights of blocks, or writes them to `lights`, and masks of the smallest blocks to `masks`."""
        buffers = (inputs.half_balls, inputs.edges, parents.positions, parent_lights, blocks.positions, lights, masks)
        for binding, buffer in enumerate(buffers):
            if buffer is not None:
                buffer.bind_to_storage_buffer(binding)
        shader = self._refine[blocks.side == SIDE, lights is not None]
        values = {
            "cells_per_axis": inputs.cells_per_axis,
            "side": blocks.side,
            "blocks_per_axis": blocks.per_axis,
            "parents_per_axis": parents.per_axis,
            "parent_parts": parents.parts,
            "parts": blocks.parts,
        }
        for start in range(0, blocks.slots, INVOCATIONS_PER_DISPATCH):
            stop = min(start + INVOCATIONS_PER_DISPATCH, blocks.slots)
            set_uniforms(shader, {**values, "first": start, "end": stop})
            run_for_each(self._context, shader, stop - start)
            step(progress, stop / blocks.slots, "light grid")

    def _buffer(self, size: int) -> moderngl.Buffer:
        """A buffer of `size` bytes, or of a few where that is 0."""
        if size > self._block_limit:
            needs, holds = (f"{1e-6 * size:,.0f} MB" for size in (size, self._block_limit))
            raise DeviceError(f"the light grid needs a block of {needs}, the device holds {holds}; use a smaller grid")
        return self._context.buffer(reserve=max(size, 8))

    def _uploaded(self, values: npt.NDArray[Any]) -> moderngl.Buffer:
        return self._context.buffer(values.astype(np.uint32).tobytes())


def _sides(cells_per_axis: int) -> Iterator[int]:
    """Cells along the blocks of each size, from the largest that does not hold all cells to SIDE."""
    side = SIDE
    while side * BRANCHING < cells_per_axis:
        side *= BRANCHING
    while side >= SIDE:
        yield side
        side //= BRANCHING


def _parts(blocks: int, longest: int, most: int) -> int:
    """Into how many parts the lists that blocks look through are cut; `most`: lights in a part."""
    wanted = min(ENOUGH_INVOCATIONS // blocks, longest // LEAST_LIGHTS_PER_PART)
    return max(1, wanted, -(-longest // most))


def half_ball_records(half_balls: HalfBalls) -> np.ndarray:
    """(n,) records of HALF_BALL."""
    records = HALF_BALL.zeros(len(half_balls))
    records["centre"] = half_balls.centres.T
    records["radius_squared"] = half_balls.radii_squared
    records["normal"] = half_balls.normals.T
    records["inverse_normal"] = half_balls.inverse_normals.T
    return records


def _uints(buffer: moderngl.Buffer) -> npt.NDArray[np.uint32]:
    return np.frombuffer(buffer.read(), np.uint32)
