# SPDX-License-Identifier: GPL-3.0-or-later
"""The quick forms of array work give what NumPy's own plain ones do, to the bit, also side by side in threads."""

import threading

import numpy as np
import pytest

from vlm_addon.core.corner_arrays import highest, lowest, middles, squares
from vlm_addon.core.mesh_topology import Rows, sorted_with_order, used_only
from vlm_addon.core.parallel import side_by_side, slices
from vlm_addon.core.region_heights import RegionCorners


@pytest.fixture
def random():
    return np.random.default_rng(5)


@pytest.mark.parametrize("bound", [1, 7, 2**30, 2**62])
@pytest.mark.parametrize("count", [0, 1, 2, 1000])
def test_order_is_numpys_stable_order(random, bound, count):
    keys = random.integers(0, bound, count)
    keys[: count // 2] = keys[count - count // 2 :]
    ascending, order = sorted_with_order(keys, bound)
    np.testing.assert_array_equal(order, np.argsort(keys, kind="stable"))
    np.testing.assert_array_equal(ascending, np.sort(keys))


@pytest.mark.parametrize(
    ("quick", "plain"), [(lowest, np.min), (highest, np.max), (middles, np.mean)], ids=["lowest", "highest", "middles"]
)
def test_corners_are_reduced_to_the_bit(random, quick, plain):
    corners = random.normal(size=(999, 3, 3)) * 10.0 ** random.integers(-9, 9, (999, 1, 1))
    np.testing.assert_array_equal(quick(corners), plain(corners, axis=1))


def test_squares_are_those_of_lengths(random):
    vectors = random.normal(size=(999, 3))
    np.testing.assert_array_equal(np.sqrt(squares(vectors)), np.linalg.norm(vectors, axis=1))


def test_vertices_that_triangles_use_are_numbered_in_order(random):
    triangles = random.choice(random.choice(500, 60, replace=False), (40, 3))
    used, numbered = used_only(triangles, 500)
    np.testing.assert_array_equal(used, np.unique(triangles))
    np.testing.assert_array_equal(used[numbered], triangles)


def test_slices_are_all_and_in_order():
    assert [list(range(10))[part] for part in slices(10, 4)] == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9]]
    assert slices(0, 4) == []


def test_parts_side_by_side_come_in_order():
    first_may_end = threading.Event()

    def work(part):
        if part == 0:
            first_may_end.wait(5.0)
        first_may_end.set()
        return part * part

    assert list(side_by_side(work, range(50))) == [part * part for part in range(50)]


def test_whoever_stops_asking_stops_the_work():
    done = []
    for result in side_by_side(lambda part: done.append(part) or part, range(1000)):
        if result == 3:
            break
    assert len(done) < 100


def test_what_a_part_raises_is_raised():
    def work(part):
        if part == 7:
            raise ValueError("seven")

    with pytest.raises(ValueError, match="seven"):
        list(side_by_side(work, range(50)))


def test_heights_and_places_of_regions_are_those_of_their_corners(random):
    source = random.choice(np.linspace(-1.0, 1.0, 7), (60, 3, 3))
    lengths = np.array([20, 0, 25, 15])
    regions = Rows(random.permutation(60), np.concatenate([[0], np.cumsum(lengths)]))
    points, normals = random.normal(size=(4, 3)), random.normal(size=(4, 3))
    places = RegionCorners.of(regions, source)
    found = np.split(places.heights(points, normals), places.starts[1:-1])
    for light, rows in enumerate(np.split(regions.values, regions.starts[1:-1])):
        # Each place once, where it is named first.
        distinct = list(dict.fromkeys(map(tuple, source[rows].reshape(-1, 3).tolist())))
        expected = [(np.array(place) - points[light]) @ normals[light] for place in distinct]
        np.testing.assert_allclose(found[light], expected, rtol=0.0, atol=1e-12)
