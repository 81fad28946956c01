# SPDX-License-Identifier: GPL-3.0-or-later
"""Welding, cutting, shells, and the two reductions that may not change them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.core.surface_shapes import areas_of, cube, grid, icosphere, open_edges, sheet, split_vertices
from vlm_addon.core.bulk_reduction import reduce_groups, reduce_roughly
from vlm_addon.core.edge_collapse import collapse_edges
from vlm_addon.core.mesh_topology import closed_shells, connected_components, cut_to_manifold, half_edges, weld

ONE_OWNER = np.zeros(100_000, np.int64)


def welded(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    return weld(positions, ONE_OWNER[: len(positions)])[triangles]


def test_components_of_a_chain_and_a_loner() -> None:
    count, label = connected_components(6, np.array([4, 0, 3]), np.array([3, 1, 0]))
    assert count == 3
    assert label[0] == label[1] == label[3] == label[4]
    assert len({int(label[0]), int(label[2]), int(label[5])}) == 3


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 60), st.data())
def test_components_agree_with_a_search(count: int, data: st.DataObject) -> None:
    node = st.integers(0, count - 1)
    edges = data.draw(st.lists(st.tuples(node, node), max_size=80))
    one, other = np.array(edges, np.int64).reshape(-1, 2).T
    _, label = connected_components(count, one, other)
    expected = list(range(count))
    for a, b in edges:
        old, new = expected[a], expected[b]
        expected = [new if group == old else group for group in expected]
    for a in range(count):
        for b in range(a):
            assert (label[a] == label[b]) == (expected[a] == expected[b])


def test_weld_joins_equal_places_of_one_owner_only() -> None:
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 0, -0.0], [1, 0, 0], [1, 1e-3, 0], [1e3, 0, 0]], float)
    np.testing.assert_array_equal(weld(positions, ONE_OWNER[:6]), [0, 1, 0, 1, 4, 5])
    np.testing.assert_array_equal(weld(positions[:4], np.array([0, 0, 0, 1])), [0, 1, 0, 3])


@pytest.mark.parametrize("offset", [0.0, 0.3, 1e4])
def test_weld_joins_vertices_apart_by_float32_rounding(offset: float) -> None:
    positions, triangles = split_vertices(*icosphere(3))
    rng = np.random.default_rng(0)
    shaken = positions + offset + rng.uniform(-1, 1, positions.shape) * 2.0**-24
    assert len(np.unique(welded(shaken, triangles))) == 642


def test_two_tetrahedra_at_one_vertex_are_cut_apart() -> None:
    triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    both = np.concatenate([triangles, np.where(triangles == 0, 0, triangles + 3)])
    cut, origin = cut_to_manifold(both, 7)
    assert len(origin) == 8
    np.testing.assert_array_equal(origin[cut], both)
    np.testing.assert_array_equal(closed_shells(cut, 8)[1], [True, True])


def test_three_triangles_on_an_edge_are_cut_apart() -> None:
    cut, origin = cut_to_manifold(np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]), 5)
    assert len(origin) == 9
    assert not closed_shells(cut, 9)[1].any()


def test_box_without_a_lid_is_not_closed() -> None:
    positions, triangles, side = cube(3)
    joined = welded(positions, triangles)
    assert closed_shells(joined, len(positions))[1].tolist() == [True]
    assert closed_shells(joined[side > 0], len(positions))[1].tolist() == [False]


def test_half_edges_pair_up_on_a_sphere() -> None:
    positions, triangles = icosphere(2)
    edges = half_edges(triangles, len(positions))
    assert (edges.face_count == 2).all()
    assert len(edges.ends) == 3 * len(triangles) // 2
    np.testing.assert_array_equal(edges.twin[edges.twin], np.arange(triangles.size))


@pytest.mark.parametrize("target", [4, 5, 20, 200])
def test_collapse_keeps_a_sphere_closed(target: int) -> None:
    positions, triangles = icosphere(3)
    group, weight = np.zeros(len(triangles), np.int64), areas_of(positions, triangles)
    result = collapse_edges(positions, triangles, group, weight, target)
    assert target - 1 <= len(result.triangles) <= target
    assert open_edges(result.positions, result.triangles) == 0


def test_collapse_keeps_a_torus_a_torus() -> None:
    count = 40
    u, v = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    a, b = 2 * np.pi * u / count, 2 * np.pi * v / count
    ring = 2 + np.cos(b)
    positions = np.stack([ring * np.cos(a), ring * np.sin(a), np.sin(b)], axis=2).reshape(-1, 3)
    index = np.arange(count * count).reshape(count, count)
    across, along = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1)
    both = np.roll(across, -1, axis=1)
    faces = [np.stack(part, axis=-1).reshape(-1, 3) for part in ((index, across, both), (index, both, along))]
    triangles = np.concatenate(faces)
    result = collapse_edges(
        positions, triangles, np.zeros(len(triangles), np.int64), areas_of(positions, triangles), 100
    )
    edges = half_edges(result.triangles, len(result.positions))
    # Euler characteristic of a torus.
    assert len(result.positions) - len(edges.ends) + len(result.triangles) == 0
    assert (edges.twin >= 0).all()


def test_collapse_leaves_the_line_between_groups_straight() -> None:
    positions, triangles = grid(16, 16)
    group = (positions[triangles].mean(axis=1)[:, 0] > 0.5).astype(np.int64)
    result = collapse_edges(positions, triangles, group, areas_of(positions, triangles), 24)
    assert not result.merged_borders
    left = group[result.source_triangle] == 0
    assert areas_of(result.positions, result.triangles)[left].sum() == pytest.approx(0.5, rel=1e-9)


def test_checkerboard_below_its_number_of_fields_merges_borders_and_says_so() -> None:
    positions, triangles = grid(12, 12)
    field = np.floor(positions[triangles].mean(axis=1) * 12).astype(np.int64)
    group = (field[:, 0] * 12 + field[:, 1]).astype(np.int64)
    result = collapse_edges(positions, triangles, group, areas_of(positions, triangles), 20)
    assert len(result.triangles) <= 20
    assert result.merged_borders


def test_vertex_map_of_the_collapse_leads_near() -> None:
    positions, triangles = icosphere(4)
    group = np.zeros(len(triangles), np.int64)
    result = collapse_edges(positions, triangles, group, areas_of(positions, triangles), 320)
    assert (result.vertex_map >= 0).all()
    assert np.linalg.norm(result.positions[result.vertex_map] - positions, axis=1).max() < 0.5


def test_rough_reduction_keeps_shells_closed_where_the_library_alone_opens_them() -> None:
    # Many small tetrahedra: the library folds some flat, which would lose them.
    positions, triangles = icosphere(1, 0.1)
    centres = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), axis=-1).reshape(-1, 3)
    points = (centres[:, None] + positions).reshape(-1, 3)
    faces = np.concatenate([triangles + i * len(positions) for i in range(len(centres))])
    reduced = reduce_roughly(points, faces, 4 * len(centres))
    closed = closed_shells(reduced.triangles, len(points))[1]
    assert len(closed) == len(centres)
    assert closed.all()


def test_rough_reduction_leaves_borders_and_group_lines_in_place() -> None:
    positions, triangles = sheet(lambda x, y: 0.1 * np.sin(6 * x) * y, 60, 60)
    group = (positions[triangles].mean(axis=1)[:, 0] > 0.5).astype(np.int64)
    reduced = reduce_groups(positions, triangles, group, areas_of(positions, triangles), 600)
    assert len(reduced.triangles) < 0.5 * len(triangles)
    on_line = (np.abs(positions[:, 0] - 0.5) < 1e-9) | (positions[:, :2] == 0).any(axis=1)
    np.testing.assert_array_equal(reduced.vertex_map[on_line], np.flatnonzero(on_line))
    np.testing.assert_array_equal(reduced.positions[on_line], positions[on_line])
    np.testing.assert_array_equal(reduced.vertex_map[triangles[reduced.source_triangle]], reduced.triangles)
    edges = half_edges(reduced.triangles, len(positions))
    assert (edges.face_count <= 2).all()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), target=st.integers(4, 300))
def test_collapse_of_random_sheets_turns_no_triangle_over(seed: int, target: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, c = rng.uniform(-1, 1, 3)
    positions, triangles = sheet(lambda x, y: 0.3 * np.sin(4 * a * x + 3 * b * y) + 0.2 * c * x * y, 14, 14)
    group = rng.integers(0, 3, 4)[(positions[triangles].mean(axis=1)[:, :2] > 0.5) @ [1, 2]]
    result = collapse_edges(positions, triangles, group, areas_of(positions, triangles), target)
    before, after = (
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        for corners in (positions[triangles[result.source_triangle]], result.positions[result.triangles])
    )
    assert (np.einsum("ij,ij->i", before, after) > 0).all()
    assert np.isfinite(result.positions).all()
    # No edge became shared by more than two triangles.
    assert (half_edges(result.triangles, len(result.positions)).face_count <= 2).all()
