# SPDX-License-Identifier: GPL-3.0-or-later
"""Edge collapse in batches: fewer triangles with the same outline, none opened, none flipped.

Garland and Heckbert 1997 (quadric error) with two changes that suit light. The plane quadrics are weighted by the
power each triangle reflects, so lights go where the light is; and a second moment of the surface about its vertex
is added, so that flat surfaces keep triangles of even power instead of two giants. The link condition (Dey et al.
1999) keeps a closed manifold closed. Each pass collapses an independent set of the cheapest edges at once, which
array operations do fast; the loss against one edge at a time is small because every pass recomputes all costs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .mesh_topology import Bool, HalfEdges, Int64, Rows, half_edges, rows_by_key, vertex_faces
from .progress import Report
from .quadrics import border_quadrics, energy, minimum, plane_quadrics, sum_at
from .scene import Float64

FREE, LINE, CORNER = 0, 1, 2
# Share of the edges, cheapest first, that one pass may touch.
BATCH_SHARE = 0.1
MINIMUM_BATCH = 16
# Where every edge is looked at because none of the cheapest may go, so many of those that may.
FEWEST_OF_ALL = 2
# What a collapse that makes a poor shape must be cheaper by to go before one that makes none: without such a price
# the last sound collapses would take half of a wall before a small body gets an ugly triangle.
POOR_SHAPE_PRICE = 10.0
SELECTION_ROUNDS = 4


@dataclass(frozen=True)
class Shapes:
    """What a collapse may do to the triangles around it.

    minimum_turn_cosine: between a triangle's normal after and both before and at the very start. minimum_quality: of
    a triangle that becomes worse, 1 for equilateral.
    """

    minimum_turn_cosine: float
    minimum_quality: float


GOOD, POOR = Shapes(0.2, 0.05), Shapes(0.0, 0.001)


@dataclass(frozen=True)
class CollapsedMesh:
    """What is left. positions: (v, 3) float64. triangles: (n, 3) int64. source_triangle: (n,) int64, the triangle of
    the input that each one continues. vertex_map: (input vertices,) int64, the vertex each one was merged into, -1
    for unused. merged_borders: whether the target could only be reached by giving up borders between groups."""

    positions: Float64
    triangles: Int64
    source_triangle: Int64
    vertex_map: Int64
    merged_borders: bool


@dataclass(frozen=True)
class _State:
    positions: Float64
    triangles: Int64
    source_triangle: Int64
    group: Int64
    first_normal: Float64
    """(t, 3): unit normal of the input triangle that each continues."""
    planes: Float64
    """(v, 10): xx xy xz yy yz zz of A, b, c of the plane quadric x.A x - 2 b.x + c."""
    moments: Float64
    """(v, 5): w, w p, w |p|^2 summed over the surface merged into the vertex."""
    vertex_map: Int64


@dataclass(frozen=True)
class _Edges:
    half: HalfEdges
    feature: Bool
    ring: Rows
    """Triangles around each vertex."""
    neighbours: Rows
    keys: Int64
    """Ascending key of each edge, for look-up."""


def collapse_edges(
    positions: Float64,
    triangles: Int64,
    group: Int64,
    weight: Float64,
    target: int,
    normals: Float64 | None = None,
    report: Report = lambda share: None,
) -> CollapsedMesh:
    """At most `target` triangles where the topology allows it, and at most one or two fewer than that.

    positions: (v, 3), an oriented manifold with border (mesh_topology.cut_to_manifold). group: (t,) int64,
    triangles of different groups keep the line between them. weight: (t,) importance, for example reflected power.
    normals: (t, 3) directions from which no triangle may turn away; of the triangles themselves if not given. report:
    called with the share of the work that is done, may raise.
    """
    state = _initial_state(positions, triangles, group, weight, normals)
    merged_borders = False
    while len(state.triangles) > target:
        report(np.log(len(triangles) / len(state.triangles)) / np.log(len(triangles) / target))
        excess = len(state.triangles) - target
        keep = not merged_borders
        advanced = _collapse_pass(state, keep, excess, True) or _collapse_pass(state, keep, excess, False)
        if advanced is not None:
            state = advanced
        elif merged_borders:
            break
        else:
            merged_borders = True
    return CollapsedMesh(state.positions, state.triangles, state.source_triangle, state.vertex_map, merged_borders)


def _initial_state(
    positions: Float64, triangles: Int64, group: Int64, weight: Float64, normals: Float64 | None
) -> _State:
    vertex_count = len(positions)
    corners = positions[triangles]
    planes, own_normals = plane_quadrics(corners, weight / 3.0)
    normals = own_normals if normals is None else normals
    planes_at = sum_at(np.repeat(planes, 3, axis=0), triangles.ravel(), vertex_count)
    edges = half_edges(triangles, vertex_count)
    planes_at += border_quadrics(positions, triangles, group, weight, edges)
    share = sum_at(np.repeat(weight / 3.0, 3)[:, None], triangles.ravel(), vertex_count)[:, 0]
    square = np.einsum("ij,ij->i", positions, positions)
    moments = np.column_stack([share, share[:, None] * positions, share * square])
    rows, vertices = np.arange(len(triangles)), np.arange(vertex_count)
    state = _State(positions, triangles, rows, group, normals, planes_at, moments, vertices)
    return _compacted(state, np.arange(vertex_count))


def _collapse_pass(state: _State, keep_features: bool, excess: int, of_cheapest: bool) -> _State | None:
    """The state after collapsing an independent set of the cheapest edges; None if no edge may be collapsed.

    of_cheapest: whether only the cheapest edges are looked at, which is faster.
    """
    edges = _edges(state, keep_features)
    kind = _vertex_kinds(edges, len(state.positions))
    allowed = np.flatnonzero(_allowed_by_kind(edges, kind))
    position, cost = _best_positions(state, edges, kind, allowed)
    count = max(int(BATCH_SHARE * len(edges.half.ends)), MINIMUM_BATCH)
    order = _cheapest(cost, count) if of_cheapest and count < len(cost) else np.arange(len(cost))
    candidate, position, cost = allowed[order], position[order], cost[order]
    legal = _link_condition(edges, candidate) & _survives(state, edges, candidate)
    candidate, position, cost = candidate[legal], position[legal], cost[legal]
    good, poor = _shapes_hold(state, edges, candidate, position)
    order = np.flatnonzero(good | poor)
    order = order[np.argsort(np.where(good, 1.0, POOR_SHAPE_PRICE)[order] * cost[order], kind="stable")]
    candidate, position = candidate[order], position[order]
    chosen = _independent(edges, candidate, len(state.triangles))
    if not of_cheapest:
        chosen = chosen[chosen < max(int(BATCH_SHARE * len(candidate)), FEWEST_OF_ALL)]
    removed = np.cumsum(edges.half.face_count[candidate[chosen]])
    # The last collapse of the run may remove one triangle more than asked for, never fewer.
    chosen = chosen[: int(np.searchsorted(removed, excess)) + 1]
    if not len(chosen):
        return None
    return _apply(state, edges.half.ends[candidate[chosen]], position[chosen])


def _cheapest(cost: Float64, count: int) -> Int64:
    return np.sort(np.argpartition(cost, count)[:count])


def _edges(state: _State, keep_features: bool) -> _Edges:
    vertex_count = len(state.positions)
    half = half_edges(state.triangles, vertex_count)
    feature = half.face_count != 2
    if keep_features:
        face_group = np.repeat(state.group, 3)
        low = np.full(len(half.ends), -1)
        low[half.edge] = face_group
        feature |= np.bincount(half.edge, face_group != low[half.edge], len(half.ends)) > 0
    a, b = half.ends.T
    neighbours = rows_by_key(np.concatenate([a, b]), vertex_count, np.concatenate([b, a]))
    return _Edges(half, feature, vertex_faces(state.triangles, vertex_count), neighbours, a * vertex_count + b)


def _vertex_kinds(edges: _Edges, vertex_count: int) -> Int64:
    lines = np.bincount(edges.half.ends[edges.feature].ravel(), minlength=vertex_count)
    return np.where(lines == 0, FREE, np.where(lines == 2, LINE, CORNER))


def _allowed_by_kind(edges: _Edges, kind: Int64) -> Bool:
    """A vertex on a line moves along its line only; a corner stays, others may move onto it."""
    one, other = kind[edges.half.ends.T]
    return ((one == FREE) | (other == FREE) | edges.feature) & ~((one == CORNER) & (other == CORNER))


def _best_positions(state: _State, edges: _Edges, kind: Int64, allowed: Int64) -> tuple[Float64, Float64]:
    """(position, cost) of each allowed edge: the power-weighted squared distance that the collapse adds."""
    a, b = edges.half.ends[allowed].T
    planes, moments = state.planes[a] + state.planes[b], state.moments[a] + state.moments[b]
    before = energy(state.planes, state.moments, state.positions)
    position = minimum(planes, moments)
    at_a, at_b = state.positions[a], state.positions[b]
    position = np.where((kind[a] > kind[b])[:, None], at_a, position)
    position = np.where((kind[b] > kind[a])[:, None], at_b, position)
    along = np.flatnonzero((kind[a] == LINE) & (kind[b] == LINE))
    options = np.stack([at_a[along], at_b[along], 0.5 * (at_a[along] + at_b[along])])
    energies = np.stack([energy(planes[along], moments[along], option) for option in options])
    position[along] = options[energies.argmin(axis=0), np.arange(len(along))]
    return position, energy(planes, moments, position) - before[a] - before[b]


def _link_condition(edges: _Edges, candidate: Int64) -> Bool:
    """Whether the ends of each edge share no neighbours but those across its own triangles (Dey et al. 1999)."""
    a, b = edges.half.ends[candidate].T
    degree = edges.neighbours.lengths
    small, large = np.where(degree[a] <= degree[b], a, b), np.where(degree[a] <= degree[b], b, a)
    owner, neighbour = edges.neighbours.expand(small)
    far = large[owner]
    vertex_count = len(degree)
    key = np.minimum(neighbour, far) * vertex_count + np.maximum(neighbour, far)
    found = edges.keys[np.minimum(np.searchsorted(edges.keys, key), len(edges.keys) - 1)] == key
    common = np.bincount(owner[found], minlength=len(candidate))
    return common == edges.half.face_count[candidate]


def _survives(state: _State, edges: _Edges, candidate: Int64) -> Bool:
    """Whether something is left of the piece: no tetrahedron is folded flat, no lone triangle removed."""
    a, b = edges.half.ends[candidate].T
    interior = edges.half.face_count[candidate] == 2
    degree = edges.neighbours.lengths
    tetrahedron = interior & (degree[a] == 3) & (degree[b] == 3)
    lone = ~interior & (degree[a] == 2) & (degree[b] == 2)
    return ~(tetrahedron | lone)


def _stars(edges: _Edges, candidate: Int64) -> tuple[Int64, Int64]:
    """(owner, triangle): the triangles around either end of each candidate; those on the edge come twice."""
    a, b = edges.half.ends[candidate].T
    owner_a, face_a = edges.ring.expand(a)
    owner_b, face_b = edges.ring.expand(b)
    return np.concatenate([owner_a, owner_b]), np.concatenate([face_a, face_b])


def _shapes_hold(state: _State, edges: _Edges, candidate: Int64, position: Float64) -> tuple[Bool, Bool]:
    """Whether all triangles around the edge keep GOOD shapes, and whether POOR ones: neither turned nor slivers."""
    owner, face = _stars(edges, candidate)
    vertex = state.triangles[face]
    a, b = edges.half.ends[candidate[owner]].T
    moved = (vertex == a[:, None]) | (vertex == b[:, None])
    remains = np.flatnonzero(moved.sum(axis=1) == 1)
    owner, face, corner = owner[remains], face[remains], moved[remains].argmax(axis=1)
    following = np.stack([vertex[remains, (corner + 1) % 3], vertex[remains, (corner + 2) % 3]])
    normal, doubled, quality = _shape(*np.moveaxis(state.positions[state.triangles], 1, 0))
    turned = np.einsum("ij,ij->i", state.first_normal, normal)
    normal_after, doubled_after, quality_after = _shape(position[owner], *state.positions[following])
    turn = np.einsum("ij,ij->i", normal[face], normal_after)
    turned_after = np.einsum("ij,ij->i", state.first_normal[face], normal_after)

    def hold(shapes: Shapes) -> Bool:
        flipped = (turn <= shapes.minimum_turn_cosine) & (doubled[face] > 0)
        flipped |= turned_after < np.minimum(shapes.minimum_turn_cosine, turned[face])
        sliver = quality_after < np.minimum(shapes.minimum_quality, quality[face])
        sliver |= doubled_after <= 0
        return np.bincount(owner[flipped | sliver], minlength=len(candidate)) == 0

    return hold(GOOD), hold(POOR)


def _shape(a: Float64, b: Float64, c: Float64) -> tuple[Float64, Float64, Float64]:
    """(unit normal or 0, twice the area, quality 4 sqrt(3) area / sum of squared sides) of triangles a b c."""
    ab, ac = b - a, c - a
    bc = ac - ab
    normal = np.cross(ab, ac)
    doubled = np.sqrt(np.einsum("ij,ij->i", normal, normal))
    squares = np.einsum("ij,ij->i", ab, ab) + np.einsum("ij,ij->i", ac, ac) + np.einsum("ij,ij->i", bc, bc)
    quality = 2 * np.sqrt(3.0) * doubled / np.maximum(squares, np.finfo(float).tiny)
    return normal / np.where(doubled > 0, doubled, 1.0)[:, None], doubled, quality


def _independent(edges: _Edges, candidate: Int64, triangle_count: int) -> Int64:
    """Indices of candidates (cheapest first) that share no triangle with each other: a cheaper one goes before.

    In rounds (Luby 1986): who is cheapest around all of its triangles is chosen, its rivals drop out.
    """
    owner, face = _stars(edges, candidate)
    backwards = np.argsort(-owner, kind="stable")
    owner, face = owner[backwards], face[backwards]
    chosen = np.zeros(len(candidate), bool)
    for _ in range(SELECTION_ROUNDS):
        # Of several values for one place NumPy keeps the last: here the smallest owner.
        first = np.full(triangle_count, len(candidate))
        first[face] = owner
        beaten = np.bincount(owner[first[face] != owner], minlength=len(candidate)) > 0
        present = np.bincount(owner, minlength=len(candidate)) > 0
        winner = present & ~beaten
        chosen |= winner
        taken = np.zeros(triangle_count, bool)
        taken[face[winner[owner]]] = True
        out = np.bincount(owner[taken[face]], minlength=len(candidate)) > 0
        stays = ~out[owner]
        owner, face = owner[stays], face[stays]
    return np.flatnonzero(chosen)


def _apply(state: _State, ends: Int64, position: Float64) -> _State:
    kept, gone = ends.T
    target = np.arange(len(state.positions))
    target[gone] = kept
    positions, planes, moments = state.positions.copy(), state.planes.copy(), state.moments.copy()
    positions[kept] = position
    planes[kept] += planes[gone]
    moments[kept] += moments[gone]
    return _compacted(replace(state, positions=positions, planes=planes, moments=moments), target)


def _compacted(state: _State, target: Int64) -> _State:
    """`state` with vertices merged into `target` and without the triangles and vertices that this leaves unused."""
    triangles = target[state.triangles]
    a, b, c = triangles.T
    keep = (a != b) & (b != c) & (c != a)
    triangles = triangles[keep]
    used = np.zeros(len(target), bool)
    used[triangles] = True
    number = np.where(used, np.cumsum(used) - 1, -1)
    merged = number[target]
    vertex_map = np.where(state.vertex_map >= 0, merged[state.vertex_map], -1)
    return _State(
        positions=state.positions[used],
        triangles=number[triangles],
        source_triangle=state.source_triangle[keep],
        group=state.group[keep],
        first_normal=state.first_normal[keep],
        planes=state.planes[used],
        moments=state.moments[used],
        vertex_map=vertex_map,
    )
