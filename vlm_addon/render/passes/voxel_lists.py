# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of each voxel of an octree on the device, for lib/octree_triangles.glsl to ask.

Counted, summed and filled from the pairs of a brick and a triangle that voxelisation has anyway. Within a voxel they
stand in any order, and nothing that asks for them depends on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ...core.scene import Float32
from ..buffer_pool import BufferPool
from ..growing_buffer import GrowingBuffer, require_block
from ..prefix_sum import INVOCATIONS, PrefixSum, run_for_each
from ..shader_library import ShaderLibrary, set_uniforms

if TYPE_CHECKING:
    import moderngl

UInt32 = npt.NDArray[np.uint32]

LIST_HEADER_WORDS = 8
"""Before the lists in a buffer; see `GpuVoxelLists.places`."""
RECORD_WORDS = 16
"""Of a triangle: three corners with a component of the normal each, and its reflectance."""

_NAMES = ("MEETING", "BLOCK", "BIT", "RANK", "OCTREE", "VOXEL", "COUNT", "LIST")
_BINDINGS = {f"{name}_BINDING": binding for binding, name in enumerate(_NAMES)}


@dataclass(frozen=True)
class BrickPairs:
    """What a voxelisation knows. blocks: `count` pairs of a packed brick and a triangle; masks: the voxels in which the
    two meet; bits, ranks: of the bricks along the Z-order curve from word `brick_word` on; octree, first_brick,
    brick_count: the bricks in the tree's buffer."""

    blocks: moderngl.Buffer
    masks: moderngl.Buffer
    count: int
    bits: moderngl.Buffer
    ranks: moderngl.Buffer
    brick_word: int
    octree: moderngl.Buffer
    first_brick: int
    brick_count: int


@dataclass(frozen=True)
class GpuVoxelLists:
    """Behind the header: voxels before each brick, where the list of each voxel begins and the last one ends, the lists
    and the triangles."""

    buffer: moderngl.Buffer
    brick_count: int
    voxel_count: int
    pair_count: int
    triangle_count: int

    @property
    def words(self) -> int:
        """Without the header."""
        return self.places(0)[-1] + RECORD_WORDS * self.triangle_count

    @property
    def nbytes(self) -> int:
        """Without the header."""
        return 4 * self.words

    def read(self) -> tuple[UInt32, UInt32, Float32]:
        """On the host: (v + 1,) starts, (p,) triangles of the voxels, and (t, 4, 4) records of the triangles."""
        words = np.frombuffer(self.buffer.read(self.nbytes, offset=4 * LIST_HEADER_WORDS), np.uint32)
        _, starts, lists, records = np.split(words, self.places(0)[1:])
        return starts, lists, records.view(np.float32).reshape(-1, 4, 4)

    def places(self, first: int) -> tuple[int, int, int, int]:
        """First words of the parts where they begin at word `first`: the header's words for a tree."""
        return _places(first, self.brick_count, self.voxel_count, self.pair_count)


def _places(first: int, brick_count: int, voxel_count: int, pair_count: int) -> tuple[int, int, int, int]:
    voxels, starts, lists, triangles = np.cumsum([first, brick_count, voxel_count + 1, pair_count]).tolist()
    return voxels, starts, lists, triangles


class VoxelListPass:
    """Fills and joins lists of triangles."""

    def __init__(
        self, context: moderngl.Context, shaders: ShaderLibrary, pool: BufferPool, prefix_sum: PrefixSum
    ) -> None:
        self._context, self._pool, self._sum = context, pool, prefix_sum
        defines = {**_BINDINGS, "GROUP_SIZE": INVOCATIONS}
        self._sizes = shaders.compute("passes/voxelize_brick_sizes.comp", defines)
        self._lists = {
            fill: shaders.compute("passes/voxelize_lists.comp", {**defines, "FILL": fill}) for fill in (False, True)
        }

    def fill(self, pairs: BrickPairs, records: Float32, target: GrowingBuffer) -> GpuVoxelLists:
        """The lists of a tree's voxels in `target`'s buffer. records: (t, 4, 4), see RECORD_WORDS.

        Raises DeviceError where the device has no block for them.
        """
        with ExitStack() as stack:
            voxels = self._zeros(stack, pairs.brick_count + 1)
            _bind(OCTREE=pairs.octree, VOXEL=voxels)
            self._run(self._sizes, pairs, pairs.brick_count)
            voxel_count = self._summed(voxels, pairs.brick_count)
            counts = self._zeros(stack, voxel_count + 1)
            _bind_pairs(pairs, voxels, counts)
            self._run(self._lists[False], pairs, pairs.count)
            pair_count = self._summed(counts, voxel_count)
            sizes = pairs.brick_count, voxel_count, pair_count
            places = _places(LIST_HEADER_WORDS, *sizes)
            lists = GpuVoxelLists(target.of(4 * places[-1] + records.nbytes), *sizes, len(records))
            lists.buffer.write(_header([places]))
            if len(records):
                lists.buffer.write(records.tobytes(), offset=4 * places[-1])
            for part, count, place in ((voxels, pairs.brick_count, places[0]), (counts, voxel_count + 1, places[1])):
                self._context.copy_buffer(lists.buffer, part, 4 * count, write_offset=4 * place)
            _bind_pairs(pairs, voxels, counts)
            _bind(LIST=lists.buffer)
            self._run(self._lists[True], pairs, pairs.count, places[2])
            return lists

    def join(self, lists: Sequence[GpuVoxelLists], target: GrowingBuffer) -> moderngl.Buffer:
        """A buffer with copies of one or two trees' lists."""
        buffer = target.of(4 * (LIST_HEADER_WORDS + sum(part.words for part in lists)))
        first, places = LIST_HEADER_WORDS, []
        for part in lists:
            self._context.copy_buffer(
                buffer, part.buffer, part.nbytes, read_offset=4 * LIST_HEADER_WORDS, write_offset=4 * first
            )
            places.append(part.places(first))
            first += part.words
        buffer.write(_header(places))
        return buffer

    def _zeros(self, stack: ExitStack, count: int) -> moderngl.Buffer:
        require_block(self._context, 4 * count, "voxelisation")
        return stack.enter_context(self._pool.uploaded(np.zeros(count, np.uint32)))

    def _summed(self, counts: moderngl.Buffer, count: int) -> int:
        """Turns `count` counts and a zero into sums of those before them; the sum of all."""
        self._sum.run(counts, count + 1)
        return int(np.frombuffer(counts.read(4, offset=4 * count), np.uint32)[0])

    def _run(self, shader: moderngl.ComputeShader, pairs: BrickPairs, count: int, first_list: int = 0) -> None:
        values = {
            "block_count": pairs.count,
            "brick_count": pairs.brick_count,
            "brick_word": pairs.brick_word,
            "first_brick": pairs.first_brick,
            "first_list": first_list,
        }
        set_uniforms(shader, values)
        run_for_each(self._context, shader, count)


def _header(places: Sequence[tuple[int, int, int, int]]) -> bytes:
    words = np.zeros(LIST_HEADER_WORDS, np.uint32)
    words[: 4 * len(places)] = np.ravel(places)
    return words.tobytes()


def _bind_pairs(pairs: BrickPairs, voxels: moderngl.Buffer, counts: moderngl.Buffer) -> None:
    _bind(MEETING=pairs.masks, BLOCK=pairs.blocks, BIT=pairs.bits, RANK=pairs.ranks)
    _bind(OCTREE=pairs.octree, VOXEL=voxels, COUNT=counts)


def _bind(**buffers: moderngl.Buffer) -> None:
    for name, buffer in buffers.items():
        buffer.bind_to_storage_buffer(_BINDINGS[f"{name}_BINDING"])
