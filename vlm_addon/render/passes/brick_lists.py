# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of each brick of an octree on the device, for lib/octree_triangles.glsl to ask.

Counted, summed and filled from the pairs of a brick and a triangle that voxelisation has anyway. Within a brick they
stand in any order, and nothing that asks for them depends on it.
"""

from __future__ import annotations

from collections.abc import Sequence
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
"""Before the lists in a buffer; see `_header`."""
RECORD_WORDS = 16
"""Of a triangle: three corners with a component of the normal each, and its reflectance."""

_NAMES = ("TRIANGLE", "BLOCK", "MEETING", "TOTAL", "BIT", "RANK", "COUNT", "LIST")
_BINDINGS = {f"{name}_BINDING": binding for binding, name in enumerate(_NAMES)}


@dataclass(frozen=True)
class BrickPairs:
    """What a voxelisation knows of bricks. blocks: `count` pairs of a packed brick and a triangle; bits, ranks: of the
    bricks along the Z-order curve from word `brick_word` on."""

    blocks: moderngl.Buffer
    count: int
    bits: moderngl.Buffer
    ranks: moderngl.Buffer
    brick_word: int


@dataclass(frozen=True)
class GpuBrickLists:
    """Behind the header: where the list of each brick begins and the last one ends, the lists, and the triangles."""

    buffer: moderngl.Buffer
    brick_count: int
    pair_count: int
    triangle_count: int

    @property
    def words(self) -> int:
        """Without the header."""
        return self.brick_count + 1 + self.pair_count + RECORD_WORDS * self.triangle_count

    @property
    def nbytes(self) -> int:
        """Without the header."""
        return 4 * self.words

    def read(self) -> tuple[UInt32, UInt32, Float32]:
        """On the host: (b + 1,) starts, (p,) triangles of the bricks, and (t, 4, 4) records of the triangles."""
        words = np.frombuffer(self.buffer.read(self.nbytes, offset=4 * LIST_HEADER_WORDS), np.uint32)
        ends = np.cumsum([self.brick_count + 1, self.pair_count])
        starts, lists, records = np.split(words, ends)
        return starts, lists, records.view(np.float32).reshape(-1, 4, 4)

    def places(self, first: int) -> tuple[int, int, int]:
        """Words of the starts, of the lists and of the triangles where they begin at word `first`."""
        lists = first + self.brick_count + 1
        return first, lists, lists + self.pair_count


class BrickListPass:
    """Fills and joins lists of triangles."""

    def __init__(
        self, context: moderngl.Context, shaders: ShaderLibrary, pool: BufferPool, prefix_sum: PrefixSum
    ) -> None:
        self._context, self._pool, self._sum = context, pool, prefix_sum
        self._shaders = {
            fill: shaders.compute("passes/voxelize_lists.comp", {**_BINDINGS, "GROUP_SIZE": INVOCATIONS, "FILL": fill})
            for fill in (False, True)
        }

    def fill(self, pairs: BrickPairs, brick_count: int, records: Float32, target: GrowingBuffer) -> GpuBrickLists:
        """The lists of a tree's bricks in `target`'s buffer. records: (t, 4, 4), see RECORD_WORDS.

        Raises DeviceError where the device has no block for them.
        """
        lists = GpuBrickLists(
            target.of(4 * self._words(pairs, brick_count, records)), brick_count, pairs.count, len(records)
        )
        starts, firsts, triangles = lists.places(LIST_HEADER_WORDS)
        lists.buffer.write(_header([(starts, firsts, triangles)]))
        if len(records):
            lists.buffer.write(records.tobytes(), offset=4 * triangles)
        require_block(self._context, 4 * pairs.count, "voxelisation")
        counted = np.zeros(brick_count + 1, np.uint32)
        with self._pool.uploaded(counted) as counts, self._pool.take(4 * max(pairs.count, 1)) as slots:
            self._run(False, pairs, counts, slots, lists.buffer, firsts)
            self._sum.run(counts, brick_count + 1)
            self._run(True, pairs, counts, slots, lists.buffer, firsts)
            self._context.copy_buffer(lists.buffer, counts, 4 * (brick_count + 1), write_offset=4 * starts)
        return lists

    def join(self, lists: Sequence[GpuBrickLists], target: GrowingBuffer) -> moderngl.Buffer:
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

    def _words(self, pairs: BrickPairs, brick_count: int, records: Float32) -> int:
        return LIST_HEADER_WORDS + brick_count + 1 + pairs.count + RECORD_WORDS * len(records)

    def _run(
        self,
        fill: bool,
        pairs: BrickPairs,
        counts: moderngl.Buffer,
        slots: moderngl.Buffer,
        lists: moderngl.Buffer,
        first: int,
    ) -> None:
        buffers = {"BLOCK": pairs.blocks, "BIT": pairs.bits, "RANK": pairs.ranks, "COUNT": counts, "MEETING": slots}
        for name, buffer in {**buffers, "LIST": lists}.items():
            buffer.bind_to_storage_buffer(_BINDINGS[f"{name}_BINDING"])
        values = {"block_count": pairs.count, "brick_word": pairs.brick_word, "first_list": first}
        set_uniforms(self._shaders[fill], values)
        run_for_each(self._context, self._shaders[fill], pairs.count)


def _header(places: Sequence[tuple[int, int, int]]) -> bytes:
    """First words of the starts, of the lists and of the triangles of each tree."""
    words = np.zeros(LIST_HEADER_WORDS, np.uint32)
    words[: 3 * len(places)] = np.ravel(places)
    return words.tobytes()
