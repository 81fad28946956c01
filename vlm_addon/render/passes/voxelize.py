# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles into a sparse voxel octree by compute shaders (seed 004, 4.3): the layout of core/voxel_octree.py.

The document lets the rasteriser make the voxels and names the holes that this leaves as its flaw. Here every pair of a
triangle and a cell is tested, from cells about the size of the triangle down to voxels, so nothing slips through
between pixels, and large triangles spread over as many invocations as they have cells. Tests are in float32; cells are
larger by `growth_of` on each side, so that rounding adds voxels and never loses one.

Which bricks there are is one bit for each place of the Z-order curve. A byte of it says which octants the cell above
has, so the levels above follow without any order of work, and where a node stands is the number of bits before its own:
the same triangles give the same words on every run. Lists of pairs are as long as a count before says; nothing is
written that has not been counted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ...core.brick_triangles import lattice_step
from ...core.errors import DeviceError
from ...core.scene import Float32, Float64
from ...core.voxel_octree import BRICK_LEVELS, MOST_NODES, VoxelOctree, require_places, starting_blocks
from ..buffer_pool import BufferPool
from ..growing_buffer import GrowingBuffer, require_block
from ..prefix_sum import INVOCATIONS, PrefixSum, run_for_each
from ..shader_library import ShaderLibrary, set_uniforms
from .voxel_lists import BrickPairs, GpuVoxelLists, VoxelListPass

if TYPE_CHECKING:
    import moderngl

UInt32 = npt.NDArray[np.uint32]

_NAMES = ("TRIANGLE", "BLOCK", "MEETING", "TOTAL", "NEXT", "BIT", "RANK", "OCTREE")
_BINDINGS = {name: binding for binding, name in enumerate(_NAMES)}
_DEFINES = {f"{name}_BINDING": binding for name, binding in _BINDINGS.items()} | {"GROUP_SIZE": INVOCATIONS}
_WORD_BITS = 32
HEADER_WORDS = 8
"""Before the trees in a buffer; see `_header`."""
MOST_TREES = 2
# Bytes: of one triangle, of a block and its mask, and of a mask of a brick's voxels.
_TRIANGLE_BYTES, _BLOCK_BYTES, _MASK_BYTES = 48, 8, 8


def growth_of(depth: int) -> float:
    """By how many voxels cells are larger on each side on the device. Rounding to the lattice and in the sums of
    lib/triangle_box.glsl is less than that, so a voxel is found at most twice as far from the triangle."""
    return 4.0 * lattice_step(depth)


@dataclass(frozen=True)
class GpuTree:
    """One octree on the device: words of nodes, then of bricks, two each, behind the header that lib/octree.glsl reads.

    level_starts: as VoxelOctree.
    """

    depth: int
    buffer: moderngl.Buffer
    node_count: int
    brick_count: int
    level_starts: tuple[int, ...]

    @property
    def words(self) -> int:
        """Of nodes and bricks."""
        return self.node_count + 2 * self.brick_count

    @property
    def nbytes(self) -> int:
        """Of nodes and bricks."""
        return 4 * self.words

    def read(self) -> VoxelOctree:
        """The tree on the host."""
        words = np.frombuffer(self.buffer.read(self.nbytes, offset=4 * HEADER_WORDS), np.uint32)
        nodes, bricks = words[: self.node_count].copy(), words[self.node_count :].copy().view(np.uint64)
        return VoxelOctree(self.depth, nodes, np.array(self.level_starts), bricks)


@dataclass(frozen=True)
class _Layout:
    """Bits of every level one after the other. starts: first word of each level, and the number of all words."""

    depth: int
    starts: tuple[int, ...]

    @property
    def brick_level(self) -> int:
        """The last level."""
        return self.depth - BRICK_LEVELS

    @property
    def words(self) -> int:
        """Of all levels."""
        return self.starts[-1]


def _layout(depth: int) -> _Layout:
    words = [-(-(8**level) // _WORD_BITS) for level in range(depth - BRICK_LEVELS + 1)]
    return _Layout(depth, tuple(np.cumsum([0, *words]).tolist()))


class VoxelizePass:
    """Builds octrees. pool: what it works with and keeps for the next one."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self._context = context
        self.pool = BufferPool(context)
        self._sum = PrefixSum(context, shaders, self.pool)

        def shader(name: str, **flags: bool) -> moderngl.ComputeShader:
            return shaders.compute(f"passes/voxelize_{name}.comp", {**_DEFINES, **flags})

        self._test = {mark: shader("test", MARK=mark) for mark in (False, True)}
        self._spread = {last: shader("spread", LAST=last) for last in (False, True)}
        self._bricks = {keep: shader("bricks", KEEP=keep) for keep in (False, True)}
        self._levels, self._count = shader("levels"), shader("count")
        self._nodes, self._clear = shader("nodes"), shader("clear")
        self._lists = VoxelListPass(context, shaders, self.pool, self._sum)

    def build(self, places: Float64, depth: int, target: GrowingBuffer) -> GpuTree:
        """The octree of (t, 3, 3) corners in voxel coordinates, in `target`'s buffer.

        depth: 2^depth voxels along each axis. Raises InvalidInput for corners outside the voxels, DeviceError where
        the device has no block for the lists or the tree, or nodes are more than a word can name.
        """
        with ExitStack() as stack:
            return self._build(stack, places, depth, target, False)[0]

    def build_with_lists(
        self, places: Float64, reflectance: Float32, depth: int, target: GrowingBuffer, list_target: GrowingBuffer
    ) -> tuple[GpuTree, GpuVoxelLists]:
        """As `build`, and the triangles of each voxel in `list_target`'s buffer. reflectance: (t, 3)."""
        with ExitStack() as stack:
            tree, pairs = self._build(stack, places, depth, target, True)
            records = np.zeros((len(places), 4, 4), np.float32)
            records[:, :3], records[:, 3, :3] = triangle_records(places, depth), reflectance
            return tree, self._lists.fill(pairs, records, list_target)

    def _build(
        self, stack: ExitStack, places: Float64, depth: int, target: GrowingBuffer, keeps_masks: bool
    ) -> tuple[GpuTree, BrickPairs]:
        require_places(places, depth)
        layout = _layout(depth)
        bits, ranks = self._take(stack, 4 * layout.words), self._take(stack, 4 * (layout.words + 1))
        self._zero(bits, 0, layout.words)
        require_block(self._context, _TRIANGLE_BYTES * len(places), "voxelisation")
        triangles = stack.enter_context(self.pool.uploaded(triangle_records(places, depth)))
        pairs, pair_count = self._brick_pairs(stack, places, triangles, bits, layout)
        self._link_levels(bits, ranks, layout)
        tree = self._allocated(ranks, layout, target)
        self._write_nodes(tree, bits, ranks, layout)
        masks = self._take(stack, _MASK_BYTES * pair_count if keeps_masks else 0)
        _bind(TRIANGLE=triangles, BLOCK=pairs, MEETING=masks)
        brick_word, first_brick = layout.starts[layout.brick_level], HEADER_WORDS + tree.node_count
        values = {"block_count": pair_count, "brick_word": brick_word, "first_brick": first_brick}
        self._run(self._bricks[keeps_masks], pair_count, {**values, "growth": growth_of(depth)})
        listed = BrickPairs(
            pairs, masks, pair_count, bits, ranks, brick_word, tree.buffer, first_brick, tree.brick_count
        )
        return tree, listed

    def join_lists(self, lists: Sequence[GpuVoxelLists], target: GrowingBuffer) -> moderngl.Buffer:
        """A buffer with copies of the triangles of one or two trees, in the order of `join`."""
        return self._lists.join(lists, target)

    def join(self, trees: Sequence[GpuTree], target: GrowingBuffer) -> moderngl.Buffer:
        """A buffer with copies of one or two trees of the same depth, for lib/octree.glsl to look at both."""
        if len({tree.depth for tree in trees}) != 1 or len(trees) > MOST_TREES:
            raise ValueError("one or two octrees of the same depth can be joined")
        buffer = target.of(4 * (HEADER_WORDS + sum(tree.words for tree in trees)))
        first, starts = HEADER_WORDS, []
        for tree in trees:
            self._context.copy_buffer(
                buffer, tree.buffer, tree.nbytes, read_offset=4 * HEADER_WORDS, write_offset=4 * first
            )
            starts += [first, first + tree.node_count]
            first += tree.words
        buffer.write(_header(trees[0].depth, starts))
        return buffer

    def _brick_pairs(
        self, stack: ExitStack, places: Float64, triangles: moderngl.Buffer, bits: moderngl.Buffer, layout: _Layout
    ) -> tuple[moderngl.Buffer, int]:
        """Pairs of a brick and a triangle that meets it, and their number; marks the bricks in `bits`."""
        deepest = layout.brick_level
        starting = _starting_lists(places, layout.depth, deepest)
        blocks, count = stack.enter_context(self.pool.uploaded(starting[0])), len(starting[0])
        for level in range(1, deepest + 1):
            is_last = level == deepest
            with self.pool.take(4 * max(count, 1)) as meetings:
                values = {
                    "block_count": count,
                    "side": float(1 << (layout.depth - level)),
                    "growth": growth_of(layout.depth),
                    "brick_word": layout.starts[deepest],
                }
                with self.pool.uploaded(np.zeros(1, np.uint32)) as total:
                    _bind(TRIANGLE=triangles, BLOCK=blocks, MEETING=meetings, TOTAL=total, BIT=bits)
                    self._run(self._test[is_last], count, values)
                    (meeting,) = self._uints(total, [0])
                added = starting[level] if not is_last else starting[0][:0]
                following = self._take(stack, _BLOCK_BYTES * (meeting + len(added)))
                with self.pool.uploaded(np.zeros(1, np.uint32)) as total:
                    _bind(BLOCK=blocks, MEETING=meetings, TOTAL=total, NEXT=following)
                    self._run(self._spread[is_last], count, values)
                if len(added):
                    following.write(added.tobytes(), offset=_BLOCK_BYTES * meeting)
            blocks, count = following, meeting + len(added)
        return blocks, count

    def _link_levels(self, bits: moderngl.Buffer, ranks: moderngl.Buffer, layout: _Layout) -> None:
        """The bits of the levels above the bricks, and before each word the number of bits."""
        _bind(BIT=bits)
        for level in range(layout.brick_level - 1, -1, -1):
            words = {"level_word": layout.starts[level], "child_word": layout.starts[level + 1], "cells": 8**level}
            self._run(self._levels, -(-(8**level) // _WORD_BITS), words)
        _bind(BIT=bits, RANK=ranks)
        self._run(self._count, layout.words + 1, {"words": layout.words})
        self._sum.run(ranks, layout.words + 1)

    def _allocated(self, ranks: moderngl.Buffer, layout: _Layout, target: GrowingBuffer) -> GpuTree:
        """The tree with its header and with bricks of zeros; a tree without anything has one node without children."""
        *starts, total = self._uints(ranks, layout.starts)
        node_count, brick_count = max(starts[-1], 1), total - starts[-1]
        if max(node_count, brick_count) > MOST_NODES:
            raise DeviceError(f"the octree has {max(node_count, brick_count):,} nodes; use a lower resolution")
        buffer = target.of(4 * (HEADER_WORDS + node_count + 2 * brick_count))
        buffer.write(_header(layout.depth, [HEADER_WORDS, HEADER_WORDS + node_count]))
        is_empty = starts[-1] == 0
        level_starts = (0, *[1] * (layout.brick_level)) if is_empty else (*starts[:-1], node_count)
        self._zero(buffer, HEADER_WORDS + (0 if is_empty else node_count), 2 * brick_count + int(is_empty))
        return GpuTree(layout.depth, buffer, node_count, brick_count, level_starts)

    def _write_nodes(self, tree: GpuTree, bits: moderngl.Buffer, ranks: moderngl.Buffer, layout: _Layout) -> None:
        _bind(BIT=bits, RANK=ranks, OCTREE=tree.buffer)
        for level in range(layout.brick_level):
            word_count = layout.starts[level + 1] - layout.starts[level]
            values = {
                "level_word": layout.starts[level],
                "child_word": layout.starts[level + 1],
                "word_count": word_count,
                "child_start": tree.node_count if level == layout.brick_level - 1 else 0,
                "first_node": HEADER_WORDS,
            }
            self._run(self._nodes, word_count, values)

    def _take(self, stack: ExitStack, size: int) -> moderngl.Buffer:
        require_block(self._context, size, "voxelisation")
        return stack.enter_context(self.pool.take(size))

    def _uints(self, buffer: moderngl.Buffer, indices: Sequence[int]) -> list[int]:
        """Some words of a buffer: gathered on the device, as every reading waits for it."""
        with self.pool.take(4 * len(indices)) as gathered:
            for place, index in enumerate(indices):
                self._context.copy_buffer(gathered, buffer, 4, read_offset=4 * index, write_offset=4 * place)
            return np.frombuffer(gathered.read(4 * len(indices)), np.uint32).astype(int).tolist()

    def _zero(self, buffer: moderngl.Buffer, first: int, count: int) -> None:
        _bind(BIT=buffer)
        self._run(self._clear, count, {"first": first, "count": count})

    def _run(self, shader: moderngl.ComputeShader, count: int, values: Mapping[str, int | float]) -> None:
        set_uniforms(shader, values)
        run_for_each(self._context, shader, count)


def triangle_records(places: Float64, depth: int) -> Float32:
    """(t, 3, 4) float32: corners on the lattice of `lattice_step`, and in the fourth components the normal."""
    step = lattice_step(depth)
    # Multiples of the step have at most 25 bits, so float64 finds their differences and products without rounding.
    corners = np.rint(places / step)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.concatenate([corners * step, (normals * step**2)[:, :, None]], axis=2).astype(np.float32)


def _starting_lists(places: Float64, depth: int, deepest: int) -> list[UInt32]:
    """(b, 2) blocks to begin with on levels 1 to `deepest`: the packed first cell and the triangle."""
    starting = starting_blocks(places, depth, deepest, growth_of(depth) + lattice_step(depth))
    x, y, z = starting.cells.T
    packed = x | y << 10 | z << 20
    order = np.argsort(starting.levels, kind="stable")
    ends = np.searchsorted(starting.levels[order], np.arange(1, deepest + 1), "right")
    blocks = np.stack([packed[order], order], axis=1).astype(np.uint32)
    return np.split(blocks, ends[:-1])


def _header(depth: int, starts: Sequence[int]) -> bytes:
    """Number of trees, depth, and first words of the nodes and of the bricks of each tree."""
    words = np.zeros(HEADER_WORDS, np.uint32)
    words[: 2 + len(starts)] = (len(starts) // 2, depth, *starts)
    return words.tobytes()


def _bind(**buffers: moderngl.Buffer) -> None:
    for name, buffer in buffers.items():
        buffer.bind_to_storage_buffer(_BINDINGS[name])
