# SPDX-License-Identifier: GPL-3.0-or-later
"""Which share of each virtual light the surfaces of a scene see, found once for what stands where it stands.

What is stored belongs to pieces of surface, not to air: half the corners of a cell with a wall in it are inside the
wall. A row is the surface in one zone of a cell that faces one of six ways (`visibility_cells`, `visibility_rows`); it
has one byte for each light, the share of the ways between points of both that nothing blocks. A point of the surface is
lit as the rows around it are, weighted by how near their cells are (trilinear) and by how much it faces their way
(squares of its normal's components, as an ambient cube does it): only zones count that its own zone touches.

Nothing here depends on lamps, colours or radiosity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .array_codec import content_hash
from .errors import InvalidInput
from .grid_frame import as_numbers
from .light_mesh import VirtualLightMesh
from .light_tree import LightTree
from .octree_march import cells_at
from .scene import Float64, SceneSnapshot
from .visibility_cells import CORNERS, SIDE, UNKNOWN, Int64, VisibilityCells, corner_bits
from .visibility_rows import WAYS, VisibilityRows, lifted_places, opaque_corners
from .voxel_frame import RESOLUTIONS, VoxelFrame, make_voxel_frame

UInt8 = npt.NDArray[np.uint8]
UInt32 = npt.NDArray[np.uint32]

FULL = 254
"""Byte of a light that is seen whole."""
UNFACED = 255
"""Byte of a light of which no sample faces a point of the row: it says nothing. Where all rows of a point say so, the
point sees nothing of the light, which may stand a little behind the surface that it stands for."""
GRAZING = 2.0**-10
"""Cosine below which points are in each other's planes, but for rounding."""
MOST_ENTRIES = 12
"""Rows that count for a point. Where there are more, the largest weight left out is taken from all of them, so that
nothing jumps where another row becomes the one that is left out."""
MOST_POINTS = 32
"""Of a row: an invocation of the bake casts a ray from each."""
WEIGHT_STEPS = 4095
"""Weights of a point's rows are stored in so many steps."""
POINT_STEP, ROW_STEP = 2654435769, 3242174889
"""Shares of 2^32, of the golden ratio and of the plastic number's square: a point of a row looks at the sample at that
share of a light's (Roberts 2018, additive recurrences)."""
MOST_ROWS = 1 << 20
"""A row and a weight are one word."""
CELL_COUNTS = tuple(resolution // SIDE for resolution in RESOLUTIONS if 4 * SIDE <= resolution <= 64 * SIDE)
"""How many cells there may be along the longest axis."""
LEAST_WEIGHT = 1e-6
"""Sum of weights below which a point has no row."""

# Shares of lights that are summed up at once: some 100 MB.
_AT_ONCE = 1 << 22
_CORNER_SHIFT, _ROW_SHIFT = 3, 6


@dataclass(frozen=True)
class RowLists:
    """Which rows count in each block of cells. offsets: (lists + 1,) uint32; entries: uint32, a row's number of shares,
    which of the block's cells it is in (CORNERS, 3 bits) and its way (3 bits), from high to low. Lists are those of
    VisibilityCells.component, then one of all rows for each block, for points whose zone is not known."""

    offsets: UInt32
    entries: UInt32


@dataclass(frozen=True)
class BakedVisibility:
    """frame: of the voxels that cells are made of, in world space. shares: (rows, lights) uint8, each different row
    once. points: of a row, from which it was baked. ways: between points that were looked at for it. made_of:
    `bake_hash` of all that it depends on."""

    frame: VoxelFrame
    cells: VisibilityCells
    lists: RowLists
    shares: UInt8
    points: int
    ways: int
    made_of: str

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        arrays = (*vars(self.cells).values(), *vars(self.lists).values(), self.shares)
        return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))

    @property
    def cells_per_axis(self) -> int:
        """Along the longest axis of the scene."""
        return self.frame.resolution // SIDE

    def require_made_of(self, snapshot: SceneSnapshot, light_mesh: VirtualLightMesh) -> None:
        """Raises InvalidInput unless it was baked from what `snapshot` shows and from these very lights."""
        if bake_hash(snapshot, light_mesh, self.cells_per_axis, self.points) != self.made_of:
            raise InvalidInput("baked visibility", "it was baked from other surfaces or other lights", "bake it again")

    def at(self, positions: npt.ArrayLike, normals: npt.ArrayLike) -> Float64:
        """(p, lights) visibility in [0, 1] at points of the surface, world space; 1 where no row is near, 0 of lights
        that face none of the rows.

        positions: (p, 3), m, in zones that are known or not. normals: (p, 3) unit, geometric, on the side that is lit.
        """
        places = self.frame.voxels(as_numbers(positions, "surface points", "give (p, 3) numbers, m"))
        weights = row_weights(self, places, np.asarray(normals, np.float64))
        known = (self.shares != UNFACED).astype(np.float64)
        total = weights @ known
        sums = weights @ (known * self.shares / FULL)
        seen = sums / np.where(total > 0.0, total, 1.0)
        return np.where(weights.any(axis=1)[:, None], seen, 1.0)


def row_weights(baked: BakedVisibility, places: Float64, normals: Float64) -> Float64:
    """(p, rows) how much each row counts at surface points in voxel coordinates, not normalised; all 0 where none does.

    A point's cell and zone are those of the place over it that its surface does not touch.
    """
    lifted = lifted_places(places, normals)
    lists = point_lists(baked.cells, lifted)
    result = np.zeros((len(places), len(baked.shares)))
    fraction = _block_fractions(lifted)
    for point, number in enumerate(lists.tolist()):
        entries = baked.lists.entries[baked.lists.offsets[number] : baked.lists.offsets[number + 1]].astype(np.int64)
        bits = corner_bits(entries >> _CORNER_SHIFT & (CORNERS - 1))
        near = np.where(bits == 1, fraction[point], 1.0 - fraction[point]).prod(axis=1)
        ways = entries & ((1 << _CORNER_SHIFT) - 1)
        along = normals[point][ways // 2] * np.where(ways % 2, -1.0, 1.0)
        weights = near * np.maximum(along, 0.0) ** 2
        np.add.at(result[point], entries >> _ROW_SHIFT, truncated(weights))
    return result


def truncated(weights: Float64) -> Float64:
    """(k,) weights of which MOST_ENTRIES at most are not 0; all 0 where their sum is below LEAST_WEIGHT."""
    if weights.sum() < LEAST_WEIGHT:
        return np.zeros_like(weights)
    if len(weights) <= MOST_ENTRIES:
        return weights
    left_out = np.sort(weights)[-MOST_ENTRIES - 1]
    return np.asarray(np.maximum(weights - left_out, 0.0))


def _block_fractions(lifted: Float64) -> Float64:
    scaled = lifted / SIDE + 0.5
    return np.asarray(scaled - np.floor(scaled))


def point_lists(cells: VisibilityCells, lifted: Float64) -> Int64:
    """(p,) the list of rows for each place over a surface, (p, 3) in voxel coordinates."""
    voxels = np.clip(cells_at(lifted) + SIDE, 0, SIDE * cells.per_axis - 1)
    blocks = np.clip(np.floor(lifted / SIDE + 0.5).astype(np.int64) + 1, 0, cells.per_axis)
    zones = cells.zones_at(lifted)
    corners = np.clip(blocks - voxels // SIDE, 0, 1) @ np.array([1, 2, 4])
    known = cells.component[np.maximum(zones, 0), corners] if cells.zone_count else zones
    return np.where(zones == UNKNOWN, cells.component_count + cells.block_numbers(blocks), known)


def make_lists(cells: VisibilityCells, rows: VisibilityRows, share_rows: Int64) -> RowLists:
    """share_rows: (r,) where the shares of each row are stored."""
    zones = rows.zones.astype(np.int64)
    corners = np.arange(CORNERS)
    components = cells.component[zones].astype(np.int64)
    blocks = cells.block_numbers((cells.zone_cells()[zones][:, None, :] + corner_bits(corners)).reshape(-1, 3))
    owners = np.concatenate([components.ravel(), cells.component_count + blocks])
    # The upper of the blocks that a cell is in has it at its lower side.
    words = share_rows[:, None] << _ROW_SHIFT | (CORNERS - 1 - corners) << _CORNER_SHIFT | rows.ways[:, None]
    entries = np.concatenate([words.ravel(), words.ravel()])
    order = np.lexsort([entries, owners])
    offsets = np.searchsorted(owners[order], np.arange(cells.component_count + cells.block_count + 1))
    return RowLists(offsets.astype(np.uint32), entries[order].astype(np.uint32))


def make_baked(
    frame: VoxelFrame, cells: VisibilityCells, rows: VisibilityRows, shares: UInt8, made_of: str
) -> BakedVisibility:
    """shares: (r, lights) of each of the rows; equal ones are stored once."""
    points = rows.places.shape[1]
    if shares.size:
        view = np.ascontiguousarray(shares).view(np.dtype((np.void, shares.shape[1]))).ravel()
        _, first, inverse = np.unique(view, return_index=True, return_inverse=True)
    else:
        first, inverse = np.arange(len(rows)), np.arange(len(rows))
    return BakedVisibility(
        frame, cells, make_lists(cells, rows, inverse.reshape(-1)), shares[first], points, shares.size * points, made_of
    )


def bake_hash(snapshot: SceneSnapshot, light_mesh: VirtualLightMesh, cells: int, points: int) -> str:
    """Hash of all that visibility depends on: what shows and what it faces, the lights' samples, and the settings."""
    frame = visibility_frame(snapshot, cells)
    samples = light_mesh.samples
    shown = opaque_corners(snapshot, frame)
    of_lights = [samples.positions, samples.normals, samples.offsets, len(light_mesh)]
    return content_hash([{"frame": frame}, cells, points, shown, of_lights])


def visibility_frame(snapshot: SceneSnapshot, cells: int) -> VoxelFrame:
    """The voxels of so many cells along the longest axis of what shows. Raises InvalidInput for another number."""
    if cells not in CELL_COUNTS:
        known = ", ".join(map(str, CELL_COUNTS))
        raise InvalidInput("baked visibility", f"{cells} cells along an axis", f"choose one of {known}")
    return make_voxel_frame(snapshot.bounds(), cells * SIDE)


def cluster_shares(tree: LightTree, shares: UInt8, areas: Float64) -> UInt8:
    """(rows, clusters): what each row sees of the clusters of a tree, the mean over lights that face it by area.

    areas: (n,) m², of all lights.
    """
    # A light without area counts as a little.
    weights = np.maximum(areas[tree.light_order], np.finfo(float).tiny)
    result = np.zeros((len(shares), len(tree)), np.uint8)
    at_once = max(1, _AT_ONCE // max(len(weights), 1))
    for start in range(0, len(shares), at_once):
        members = shares[start : start + at_once][:, tree.light_order]
        known = weights * (members != UNFACED)
        totals, sums = tree.sums(known), tree.sums(known * members)
        mean = np.rint(sums / np.where(totals > 0.0, totals, 1.0))
        result[start : start + at_once] = np.where(totals > 0.0, mean, UNFACED)
    return result


def sample_numbers(rows: Int64, points: Int64, counts: Int64) -> Int64:
    """Which of `counts` samples of a light the point of a row looks at; all (n,)."""
    turns = (points * POINT_STEP + rows * ROW_STEP) & 0xFFFFFFFF
    return np.asarray(turns * counts >> 32)


def stored_bytes(row_count: int, light_count: int) -> int:
    """Of the shares of so many rows, on the device: bytes of a row fill words."""
    return row_count * words_of(light_count) * 4


def words_of(light_count: int) -> int:
    """Words of four lights each in a row."""
    return -(-light_count // 4)


def require_sound(baked: BakedVisibility, light_count: int) -> None:
    """Raises InvalidInput where arrays do not fit each other or a light mesh of so many lights."""
    cells, lists = baked.cells, baked.lists
    n3 = cells.per_axis**3
    _require(baked.frame.resolution // SIDE in CELL_COUNTS and cells.per_axis == baked.cells_per_axis + 2, "cells")
    _require(np.isfinite(baked.frame.low).all() and baked.frame.low.shape == (3,), "frame.low")
    _require(0.0 < baked.frame.voxel_size < np.inf, "frame.voxel_size")
    for array, dtype, shape, name in (
        (cells.first_zone, np.int32, (n3 + 1,), "first_zone"),
        (cells.label_start, np.int32, (n3,), "label_start"),
        (cells.labels, np.uint8, (len(cells.labels), SIDE**3), "labels"),
        (cells.component, np.int32, (len(cells.component), CORNERS), "component"),
        (lists.offsets, np.uint32, (cells.component_count + cells.block_count + 1,), "offsets"),
        (lists.entries, np.uint32, (len(lists.entries),), "entries"),
        (baked.shares, np.uint8, (len(baked.shares), light_count), "shares"),
    ):
        _require(isinstance(array, np.ndarray) and array.dtype == dtype and array.shape == shape, name)
    _require_indices(baked)


def _require_indices(baked: BakedVisibility) -> None:
    cells, lists = baked.cells, baked.lists
    counts = np.diff(cells.first_zone)
    _require(cells.first_zone[0] == 0 and (counts >= 0).all() and cells.first_zone[-1] == cells.zone_count, "zones")
    starts = cells.label_start
    _require((starts >= UNKNOWN).all() and (starts < len(cells.labels)).all(), "label_start")
    _require((counts[starts == UNKNOWN] == 1).all(), "zones")
    labelled = np.flatnonzero(starts >= 0)
    _require((cells.labels[starts[labelled]].max(axis=1, initial=0) <= counts[labelled]).all(), "labels")
    component = cells.component
    _require(((component >= 0) & (component < cells.component_count)).all(), "component")
    offsets = lists.offsets.astype(np.int64)
    _require(offsets[0] == 0 and offsets[-1] == len(lists.entries) and (np.diff(offsets) >= 0).all(), "offsets")
    _require((lists.entries >> _ROW_SHIFT < max(len(baked.shares), 1)).all(), "entries")
    _require((lists.entries & ((1 << _CORNER_SHIFT) - 1) < WAYS).all(), "entries")


def _require(fits: object, name: str) -> None:
    if not fits:
        raise InvalidInput("baked visibility", f"its {name} do not fit the rest", "bake it again")
