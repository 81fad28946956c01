# SPDX-License-Identifier: GPL-3.0-or-later
"""Connectivity of triangle soups: welding, cutting to a manifold, edges, connected components, closed shells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .scene import Float64

Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

WELD_SHARE = 2.0**-22
# Side of a cell of the look-up grid, in welding tolerances.
CELL_TOLERANCES = 8.0


@dataclass(frozen=True)
class HalfEdges:
    """The 3 t half-edges of t triangles; half-edge 3 f + k runs from corner k to corner k + 1 of triangle f.

    edge: (3 t,) int64, index of the undirected edge. ends: (e, 2) int64, vertices of each edge, smaller first.
    face_count: (e,) int64, triangles on the edge. twin: (3 t,) int64, the half-edge that runs the other way where
    exactly two triangles with one orientation share the edge, else -1.
    """

    edge: Int64
    ends: Int64
    face_count: Int64
    twin: Int64


@dataclass(frozen=True)
class Rows:
    """A ragged table: the entries of row r are values[starts[r]:starts[r + 1]]."""

    values: Int64
    starts: Int64

    @property
    def lengths(self) -> Int64:
        """(r,) int64, entries of each row."""
        return np.diff(self.starts)

    def expand(self, rows: Int64) -> tuple[Int64, Int64]:
        """(owner, entry): every entry of each of `rows`, and the position in `rows` that it belongs to."""
        lengths = self.starts[rows + 1] - self.starts[rows]
        owner = np.repeat(np.arange(len(rows)), lengths)
        first = np.cumsum(lengths) - lengths
        position = np.arange(len(owner)) - first[owner] + self.starts[rows][owner]
        return owner, self.values[position]


def rows_by_key(keys: Int64, row_count: int, values: Int64 | None = None) -> Rows:
    """The `values` (default: their positions) gathered by key, in their order within a key."""
    _, order = sorted_with_order(keys, row_count)
    starts = np.concatenate([[0], np.cumsum(np.bincount(keys, minlength=row_count))])
    return Rows(order if values is None else values[order], starts)


def rows_of(regions: Rows, chosen: Int64) -> Rows:
    """The rows `chosen` of a ragged table, in that order."""
    _, values = regions.expand(chosen)
    return Rows(values, np.concatenate([[0], np.cumsum(regions.lengths[chosen])]))


def only_rows(regions: Rows, chosen: Bool) -> Rows:
    """The ragged table with the rows that are not chosen empty."""
    lengths = np.where(chosen, regions.lengths, 0)
    return Rows(regions.values[np.repeat(chosen, regions.lengths)], np.concatenate([[0], np.cumsum(lengths)]))


def sorted_with_order(keys: Int64, bound: int) -> tuple[Int64, Int64]:
    """(keys ascending, where each was), equal ones in their order. keys: from 0 to bound - 1.

    Where key and place fit into one number together, that is sorted: a few times as fast as NumPy's stable order.
    """
    bits = len(keys).bit_length()
    if bound.bit_length() + bits < 63:
        packed = np.sort((keys.astype(np.int64) << bits) | np.arange(len(keys)))
        return packed >> bits, packed & ((1 << bits) - 1)
    order = np.argsort(keys)
    ascending = keys[order]
    # Equal keys stand in any order yet: sorted by place within each run of them.
    run = np.cumsum(np.concatenate([[0], ascending[1:] != ascending[:-1]]))[: len(keys)]
    return ascending, np.sort((run << bits) | order) & ((1 << bits) - 1)


def used_only(triangles: Int64, vertex_count: int) -> tuple[Int64, Int64]:
    """(vertices that triangles use, ascending, the triangles in numbers of these)."""
    used = np.zeros(vertex_count, bool)
    used[triangles] = True
    number = np.cumsum(used) - 1
    return np.flatnonzero(used), number[triangles]


def sum_by(index: Int64, values: Float64, count: int) -> Float64:
    """(count,) float64: the sum of the values that have each index."""
    sums: Float64 = np.bincount(index, weights=values, minlength=count).astype(np.float64)
    return sums


def vertex_faces(triangles: Int64, vertex_count: int) -> Rows:
    """The triangles around each vertex."""
    return rows_by_key(triangles.ravel(), vertex_count, np.arange(triangles.size) // 3)


def half_edges(triangles: Int64, vertex_count: int) -> HalfEdges:
    """Edges of `triangles` ((t, 3) int, distinct vertices in each) and which half-edges face each other."""
    start = triangles.ravel()
    end = np.roll(triangles, -1, axis=1).ravel()
    key = np.minimum(start, end) * np.int64(max(vertex_count, 1)) + np.maximum(start, end)
    sorted_key, order = sorted_with_order(key, max(vertex_count, 1) ** 2)
    first = np.flatnonzero(np.concatenate([[True], sorted_key[1:] != sorted_key[:-1]])) if len(key) else order
    face_count = np.diff(np.append(first, len(key)))
    edge = np.empty(len(key), np.int64)
    edge[order] = np.repeat(np.arange(len(first)), face_count)
    ends = np.stack([sorted_key[first] // max(vertex_count, 1), sorted_key[first] % max(vertex_count, 1)], axis=1)
    pairs = first[face_count == 2]
    one, other = order[pairs], order[pairs + 1]
    opposite = start[one] != start[other]
    one, other = one[opposite], other[opposite]
    twin = np.full(len(key), -1, np.int64)
    twin[one], twin[other] = other, one
    return HalfEdges(edge, ends, face_count, twin)


def connected_components(count: int, one: Int64, other: Int64) -> tuple[int, Int64]:
    """(number of components, (count,) int64 label of each node) of the graph with edges one[i] to other[i].

    Labels follow the smallest node of each component. Roots are hooked to smaller labels and paths halved until
    nothing changes (after Shiloach and Vishkin 1982), in about log(count) array passes.
    """
    root = np.arange(count)
    while True:
        a, b = root[one], root[other]
        differ = a != b
        if not differ.any():
            break
        one, other, a, b = one[differ], other[differ], a[differ], b[differ]
        low = np.minimum(a, b)
        np.minimum.at(root, np.maximum(a, b), low)
        while True:
            halved = root[root]
            if (halved == root).all():
                break
            root = halved
    # Each root is the smallest of its component.
    is_root = root == np.arange(count)
    return int(is_root.sum()), (np.cumsum(is_root) - 1)[root]


def weld(positions: Float64, owner: Int64) -> Int64:
    """(v,) int64: for each vertex the first one of the same owner at the same place.

    Places are the same within WELD_SHARE of the owner's largest extent, some rounding errors of float32 coordinates:
    files and modifiers split or mirror vertices without moving them further, and millimetre detail survives in a
    kilometre scene.
    """
    if not len(positions):
        return np.zeros(0, np.int64)
    count = int(owner.max()) + 1
    low, extent = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, owner, positions)
    np.maximum.at(extent, owner, positions)
    extent -= low
    tolerance = WELD_SHARE * np.maximum(extent.max(axis=1), np.finfo(float).tiny)[owner]
    place = (positions - low[owner]) / (CELL_TOLERANCES * tolerance)[:, None]
    vertex, cells = np.arange(len(positions)), np.floor(place).astype(np.int64)
    near_low = place - cells < 1.0 / CELL_TOLERANCES
    for axis in range(3):
        # A vertex just above a cell's lower face also belongs to the cell below, where its like may lie.
        twice = near_low[vertex, axis]
        below = cells[twice]
        below[:, axis] -= 1
        vertex, cells = np.concatenate([vertex, vertex[twice]]), np.concatenate([cells, below])
    hashed = owner[vertex].astype(np.uint64)
    for axis in range(3):
        hashed = (hashed ^ cells[:, axis].astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        hashed ^= hashed >> np.uint64(29)
    order = np.argsort(hashed, kind="stable")
    vertex, hashed = vertex[order], hashed[order]
    starts = np.concatenate([[True], hashed[1:] != hashed[:-1]])
    first = vertex[np.maximum.accumulate(np.where(starts, np.arange(len(starts)), 0))]
    before = np.where(starts, vertex, np.roll(vertex, 1))
    pairs = [(vertex, other) for other in (first, before)]
    one, other = (np.concatenate(side) for side in zip(*pairs, strict=True))
    same = (one != other) & (owner[one] == owner[other])
    one, other = one[same], other[same]
    same = np.abs(positions[one] - positions[other]).max(axis=1) <= tolerance[one]
    components, label = connected_components(len(positions), one[same], other[same])
    representative = np.full(components, -1, np.int64)
    representative[label[::-1]] = np.arange(len(positions))[::-1]
    return representative[label]


def cut_to_manifold(triangles: Int64, vertex_count: int) -> tuple[Int64, Int64]:
    """(triangles, origin): each fan of triangles around a vertex gets a vertex of its own.

    Fans are joined across edges that exactly two triangles of one orientation share, so the result is an oriented
    manifold with border. origin: (new vertices,) the vertex each one was.
    """
    return fans_apart(triangles, half_edges(triangles, vertex_count))


def fans_apart(triangles: Int64, edges: HalfEdges) -> tuple[Int64, Int64]:
    """`cut_to_manifold` of triangles whose edges are known."""
    one = np.flatnonzero(edges.twin > np.arange(len(edges.twin)))
    other = edges.twin[one]
    after_one, after_other = one - one % 3 + (one + 1) % 3, other - other % 3 + (other + 1) % 3
    # (h + 1) % 3 equals (h % 3 + 1) % 3, so the lines above step to the next corner of the same triangle.
    pairs = np.concatenate([one, after_one]), np.concatenate([after_other, other])
    count, label = connected_components(triangles.size, *pairs)
    origin = np.empty(count, np.int64)
    origin[label] = triangles.ravel()
    return label.reshape(-1, 3), origin


def closed_shells(triangles: Int64, vertex_count: int) -> tuple[Int64, Bool]:
    """((t,) shell of each triangle, (shells,) whether each edge of the shell has exactly two triangles).

    Shells are joined across edges with two triangles of one orientation.
    """
    return joined_shells(half_edges(triangles, vertex_count))


def joined_shells(edges: HalfEdges) -> tuple[Int64, Bool]:
    """`closed_shells` of triangles whose edges are known."""
    is_open = edges.twin < 0
    open_faces: Bool = is_open[0::3] | is_open[1::3] | is_open[2::3]
    return shells_of(edges, len(open_faces), open_faces)


def shells_of(edges: HalfEdges, triangle_count: int, open_faces: Bool) -> tuple[Int64, Bool]:
    """Shell of each triangle and whether none of its triangles is among `open_faces`."""
    one = np.flatnonzero(edges.twin > np.arange(len(edges.twin)))
    count, shell = connected_components(triangle_count, one // 3, edges.twin[one] // 3)
    return shell, np.bincount(shell[open_faces], minlength=count) == 0


def unit_normals(corners: Float64) -> Float64:
    """(n, 3) unit normals of triangles (n, 3, 3), 0 for those without area."""
    return normals_and_areas(corners)[0]


def normals_and_areas(corners: Float64) -> tuple[Float64, Float64]:
    """(n, 3) unit normals of triangles (n, 3, 3), 0 for those without area, and (n,) areas, m²."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    return normal / np.where(length > 0, length, 1.0)[:, None], 0.5 * length
