# SPDX-License-Identifier: GPL-3.0-or-later
"""For each tile of the picture, the clusters and lights of a light forest that may count at one of its points.

All tiles go down the trees together, a level at a time: pairs of a tile and a cluster are tested, what is below the
open ones is counted, the counts are summed up and every new pair finds its place by them. Pairs stay in the order of
tiles and of clusters, whatever the order in which a device does things. Lists are made for as many tiles at once as a
fixed number of entries allows.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..buffer_pool import BufferPool
from ..light_forest import GpuLightForest
from ..prefix_sum import INVOCATIONS, PrefixSum, run_for_each
from ..shader_library import ShaderLibrary, set_uniforms
from .tile_bounds import TILE_BINDING, Tiles

if TYPE_CHECKING:
    import moderngl

# Entries of the lists that are made at once, unless one tile alone has more.
MAX_ENTRIES = 1 << 20
# Work groups in a row of a dispatch.
MAX_TILES = 65535

LIST_BINDING = 1
LIGHT_NODE_BINDING = 2
LIST_OFFSET_BINDING = 4
LIST_TILE_BINDING = 5
_BINDINGS = {
    "TILE_BINDING": TILE_BINDING,
    "LIST_BINDING": LIST_BINDING,
    "LIGHT_NODE_BINDING": LIGHT_NODE_BINDING,
    "LIST_OFFSET_BINDING": LIST_OFFSET_BINDING,
    "PAIR_TILE_BINDING": 5,
    "NODE_COUNT_BINDING": 6,
    "LIGHT_COUNT_BINDING": 7,
    "OFFSET_BINDING": 6,
    "CHILD_BINDING": 7,
    "GATHERED_BINDING": 7,
    "LIGHT_ID_BINDING": 0,
    "CHILD_TILE_BINDING": 4,
    "INVOCATIONS": INVOCATIONS,
}

Offsets = npt.NDArray[np.int64]


@dataclass(frozen=True)
class TileLists:
    """Lists of clusters or of lights, one for each of some tiles, valid until the next is asked for.

    of_lights: entries are lights, else nodes of the forest. tiles: (t,) tiles of the picture. offsets: (t + 1,), where
    the list of each begins in `entries`.
    """

    of_lights: bool
    tiles: npt.NDArray[np.uint32]
    offsets: Offsets
    entries: moderngl.Buffer

    @property
    def longest(self) -> int:
        """Entries of the longest list."""
        return int(np.diff(self.offsets).max(initial=0))

    @property
    def count(self) -> int:
        """Entries of all lists."""
        return int(self.offsets[-1])


class TileWalkPass:
    """Walks down the trees of a light forest."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, pool: BufferPool) -> None:
        self._context = context
        self._pool = pool
        self._sum = PrefixSum(context, shaders, pool)
        self._walk = shaders.compute("passes/tile_walk.comp", _BINDINGS)
        self._gather = shaders.compute("passes/tile_gather.comp", _BINDINGS)
        self._expand = {
            of_lights: shaders.compute("passes/tile_expand.comp", {**_BINDINGS, "LIGHTS": of_lights})
            for of_lights in (False, True)
        }

    def lists(
        self, tiles: Tiles, shown: npt.NDArray[np.uint32], forest: GpuLightForest
    ) -> Iterator[tuple[float, TileLists]]:
        """What lights the tiles `shown`, part by part, each after the share of them that was begun with.

        Over all parts each cluster and light that has weight and is not dark, turned away or below the horizon for all
        of a tile comes up once for it. Raises DeviceError where a tile alone needs more than the device's blocks hold.
        """
        roots = forest.roots
        if not len(roots):
            return
        # No sum of counts exceeds 32 bits, for a tile meets nothing twice.
        most = (2**32 - 1) // (forest.light_count + forest.node_count)
        at_once = max(min(MAX_ENTRIES // len(roots), MAX_TILES, most), 1)
        for first in range(0, len(shown), at_once):
            chunk = shown[first : first + at_once]
            share = min((first + at_once) / len(shown), 1.0)
            offsets = len(roots) * np.arange(len(chunk) + 1)
            with (
                self._pool.uploaded(np.tile(roots, len(chunk))) as nodes,
                self._pool.uploaded(np.repeat(chunk, len(roots))) as pair_tiles,
            ):
                for part in self._from(tiles, forest, TileLists(False, chunk, offsets, nodes), pair_tiles):
                    yield share, part

    def _from(
        self, tiles: Tiles, forest: GpuLightForest, pairs: TileLists, pair_tiles: moderngl.Buffer
    ) -> Iterator[TileLists]:
        """`pairs` and all below them. pair_tiles: the tile of each pair."""
        yield pairs
        if not pairs.count:
            return
        with ExitStack() as held:
            # One more than there are pairs: the sum of all.
            node_counts, light_counts = (held.enter_context(self._pool.take(4 * (pairs.count + 1))) for _ in range(2))
            self._count(tiles, forest, pairs, pair_tiles, node_counts, light_counts)
            light_offsets = self._summed(pairs, light_counts)
            node_offsets = self._summed(pairs, node_counts)
            for first, end in _runs(light_offsets):
                with self._pool.take(4 * _length(light_offsets, first, end)) as lights:
                    self._fill(forest, pairs, pair_tiles, light_counts, light_offsets[[first, end]], lights, None)
                    yield _part(True, pairs, light_offsets, first, end, lights)
            for first, end in _runs(node_offsets):
                size = 4 * _length(node_offsets, first, end)
                with self._pool.take(size) as nodes, self._pool.take(size) as node_tiles:
                    self._fill(forest, pairs, pair_tiles, node_counts, node_offsets[[first, end]], nodes, node_tiles)
                    part = _part(False, pairs, node_offsets, first, end, nodes)
                    yield from self._from(tiles, forest, part, node_tiles)

    def _count(
        self,
        tiles: Tiles,
        forest: GpuLightForest,
        pairs: TileLists,
        pair_tiles: moderngl.Buffer,
        node_counts: moderngl.Buffer,
        light_counts: moderngl.Buffer,
    ) -> None:
        """How many clusters and lights below each pair its tile needs, and a 0 after them."""
        _bind(
            TILE_BINDING=tiles.bounds,
            LIGHT_NODE_BINDING=forest.nodes,
            LIST_BINDING=pairs.entries,
            PAIR_TILE_BINDING=pair_tiles,
            NODE_COUNT_BINDING=node_counts,
            LIGHT_COUNT_BINDING=light_counts,
        )
        set_uniforms(self._walk, {"count": pairs.count})
        run_for_each(self._context, self._walk, pairs.count + 1)

    def _summed(self, pairs: TileLists, counts: moderngl.Buffer) -> Offsets:
        """Turns counts into what comes before each pair; what comes before the pairs of each tile."""
        self._sum.run(counts, pairs.count + 1)
        count = len(pairs.offsets)
        with (
            self._pool.uploaded(pairs.offsets.astype(np.uint32)) as offsets,
            self._pool.take(4 * count) as gathered,
        ):
            _bind(LIST_OFFSET_BINDING=offsets, OFFSET_BINDING=counts, GATHERED_BINDING=gathered)
            set_uniforms(self._gather, {"count": count})
            run_for_each(self._context, self._gather, count)
            return np.frombuffer(gathered.read(4 * count), np.uint32).astype(np.int64)

    def _fill(
        self,
        forest: GpuLightForest,
        pairs: TileLists,
        pair_tiles: moderngl.Buffer,
        offsets: moderngl.Buffer,
        run: Offsets,
        entries: moderngl.Buffer,
        entry_tiles: moderngl.Buffer | None,
    ) -> None:
        """Writes the clusters with their tiles, or where `entry_tiles` is None the lights, from run[0] to run[1]."""
        buffers: dict[str, Any] = {
            "LIGHT_NODE_BINDING": forest.nodes,
            "LIST_BINDING": pairs.entries,
            "PAIR_TILE_BINDING": pair_tiles,
            "OFFSET_BINDING": offsets,
            "CHILD_BINDING": entries,
        }
        if entry_tiles is None:
            _bind(**buffers, LIGHT_ID_BINDING=forest.light_ids)
        else:
            _bind(**buffers, CHILD_TILE_BINDING=entry_tiles)
        shader = self._expand[entry_tiles is None]
        first, end = (int(value) for value in run)
        set_uniforms(shader, {"first": first, "end": end, "pair_count": pairs.count})
        run_for_each(self._context, shader, end - first)


def _bind(**buffers: moderngl.Buffer) -> None:
    for name, buffer in buffers.items():
        buffer.bind_to_storage_buffer(_BINDINGS[name])


def _length(offsets: Offsets, first: int, end: int) -> int:
    return int(offsets[end] - offsets[first])


def _part(
    of_lights: bool, pairs: TileLists, offsets: Offsets, first: int, end: int, entries: moderngl.Buffer
) -> TileLists:
    return TileLists(of_lights, pairs.tiles[first:end], offsets[first : end + 1] - offsets[first], entries)


def _runs(offsets: Offsets) -> Iterator[tuple[int, int]]:
    """First and end of runs of tiles whose lists together have at most MAX_ENTRIES, or of one tile; none if empty."""
    first, count = 0, len(offsets) - 1
    while first < count and offsets[count] > offsets[first]:
        end = int(np.searchsorted(offsets, offsets[first] + MAX_ENTRIES, "right")) - 1
        end = min(max(end, first + 1), count)
        if offsets[end] > offsets[first]:
            yield first, end
        first = end
