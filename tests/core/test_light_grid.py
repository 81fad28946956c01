# SPDX-License-Identifier: GPL-3.0-or-later
"""The light grid in both modes: what lights a point, what is rebuilt, what is reported, what it must refuse."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.light_meshes import random_lights
from vlm_addon.core.array_codec import content_hash
from vlm_addon.core.errors import Cancelled, InvalidInput
from vlm_addon.core.light_grid import RANGE, TOLERANCE, GridSettings, LightGrid, LitTree
from vlm_addon.core.light_mesh import empty_light_mesh
from vlm_addon.core.light_tree_error import expected_error
from vlm_addon.core.range_grid import RangeGrid, RangeSettings
from vlm_addon.core.settings import from_mapping
from vlm_addon.core.surface_points import SurfacePoints

BOX = ((-2.0, -2.0, -1.0), (2.0, 3.0, 1.0))
BY_RANGE = GridSettings(mode=RANGE, grid=6, range=3.0)
WITHIN = GridSettings(tolerance=0.1)
POINTS = np.random.default_rng(0).uniform(*BOX, (60, 3))


def lights(count=200, moving=0.25, seed=0):
    light_mesh = random_lights(seed, count)
    return replace(light_mesh, dynamic=np.arange(count) < moving * count)


def moved(light_mesh):
    """The dynamic lights a little farther on."""
    vertices = light_mesh.vertices.copy()
    vertices[light_mesh.triangles[light_mesh.dynamic]] += [0.25, 0.0, 0.0]
    return replace(light_mesh, vertices=vertices)


LIGHTS = lights()


def of_point(offsets, values, point):
    return values[offsets[point] : offsets[point + 1]]


def test_candidates_within_a_range_are_those_of_both_grids():
    light_mesh = lights()
    found = LightGrid.bake(light_mesh, BOX, BY_RANGE).candidates(POINTS)
    offsets, ids = RangeGrid.bake(light_mesh, BOX, RangeSettings(6, 3.0)).candidates(POINTS)
    assert len(ids)
    assert np.array_equal(found.light_offsets, offsets)
    assert np.array_equal(found.light_ids, ids)
    assert (found.light_weights == 1.0).all()
    assert found.cluster_offsets.tolist() == [0] * 61
    assert len(found.clusters) == len(found.cluster_weights) == 0


def test_candidates_within_a_tolerance_count_every_light_once():
    """At each point a light weighs, with the clusters that it is in, 1."""
    light_mesh = lights()
    grid = LightGrid.bake(light_mesh, BOX, WITHIN)
    found = grid.candidates(POINTS)
    trees = [grid.static.tree, grid.dynamic.tree]
    first = np.array([0, len(trees[0])])
    assert (found.light_weights > 0.0).all()
    assert (found.light_weights < 1.0).any()
    assert len(found.clusters)
    for point in range(len(POINTS)):
        weight = np.zeros(len(light_mesh))
        weight[of_point(found.light_offsets, found.light_ids, point)] = of_point(
            found.light_offsets, found.light_weights, point
        )
        of_cluster = np.zeros(sum(map(len, trees)))
        of_cluster[of_point(found.cluster_offsets, found.clusters, point)] = of_point(
            found.cluster_offsets, found.cluster_weights, point
        )
        for tree, start in zip(trees, first, strict=True):
            cluster = tree.light_parent.copy()
            inside = np.flatnonzero(cluster >= 0)
            while (cluster[inside] >= 0).any():
                weight[inside] += np.where(cluster[inside] >= 0, of_cluster[start + cluster[inside]], 0.0)
                cluster[inside] = np.where(cluster[inside] >= 0, tree.parent[cluster[inside]], -1)
        np.testing.assert_allclose(weight, 1.0, atol=1e-9)


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_ids_ascend_at_every_point(settings):
    found = LightGrid.bake(lights(), BOX, settings).candidates(POINTS)
    for offsets, ids in ((found.light_offsets, found.light_ids), (found.cluster_offsets, found.clusters)):
        assert len(offsets) == len(POINTS) + 1
        for point in range(len(POINTS)):
            assert (np.diff(of_point(offsets, ids, point).astype(np.int64)) > 0).all()


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_moving_dynamic_lights_rebuilds_nothing_static(settings):
    before, after = lights(), moved(lights())
    grid = LightGrid.bake(before, BOX, settings)
    again = grid.moved(after)
    assert content_hash(again) == content_hash(LightGrid.bake(after, BOX, settings))
    assert content_hash(again.dynamic) != content_hash(grid.dynamic)
    if settings.mode == RANGE:
        assert again.static is grid.static
    else:
        assert again.static.tree is grid.static.tree
    again.require_made_of(after)
    with pytest.raises(InvalidInput, match="bake it again"):
        again.require_made_of(before)


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_relighting_changes_what_clusters_send_out_alone(settings):
    light_mesh = lights()
    grid = LightGrid.bake(light_mesh, BOX, settings)
    lit = grid.relit(light_mesh, light_mesh.nominal_radiosity * np.linspace(0.0, 2.0, 200)[:, None])
    if settings.mode == RANGE:
        assert content_hash(lit) == content_hash(grid)
        return
    for before, after in ((grid.static, lit.static), (grid.dynamic, lit.dynamic)):
        assert after.tree is before.tree
        assert not np.array_equal(after.clusters.power, before.clusters.power)


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
@pytest.mark.parametrize("moving", [0.0, 1.0])
def test_lights_of_one_kind_have_one_structure(settings, moving):
    grid = LightGrid.bake(lights(moving=moving), BOX, settings)
    assert [name for name, _ in grid.structures] == (["dynamic"] if moving else ["static"])


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_no_lights(settings):
    grid = LightGrid.bake(empty_light_mesh(), BOX, settings)
    assert grid.structures == []
    assert grid.nbytes == 0
    assert grid.occupancy == {}
    found = grid.candidates(POINTS)
    assert found.light_offsets.tolist() == found.cluster_offsets.tolist() == [0] * 61


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_bytes_are_those_of_all_arrays(settings):
    grid = LightGrid.bake(lights(), BOX, settings)
    total = 0
    for _, part in grid.structures:
        if isinstance(part, LitTree):
            total += part.tree.nbytes + sum(array.nbytes for array in vars(part.clusters).values())
        else:
            total += part.nbytes
    assert grid.nbytes == total > 0


def test_occupancy_of_a_range_grid():
    settings = replace(BY_RANGE, max_lights=5)
    grid = LightGrid.bake(lights(), BOX, settings)
    report = grid.occupancy
    assert json.loads(json.dumps(report)) == report
    for name, part in grid.structures:
        cells, blocks = report[name]
        counts = part.lists.cell_counts()
        assert (cells["name"], cells["places"], cells["entries"]) == ("cells", 216, counts.sum())
        assert cells["fullest"] == counts.max() == 5
        assert cells["mean"] == pytest.approx(counts.mean())
        assert cells["overflowing"] == len(part.occupancy.overflowing_cells) > 0
        assert cells["dropped_entries"] == part.occupancy.dropped_entries > 0
        assert cells["dropped_lights"] == len(part.occupancy.dropped_lights) > 0
        assert (blocks["name"], blocks["places"]) == ("blocks", 8)
        assert blocks["entries"] == len(part.lists.light_ids)


def test_occupancy_of_trees():
    grid = LightGrid.bake(lights(), BOX, WITHIN)
    report = grid.occupancy
    assert json.loads(json.dumps(report)) == report
    for name, part in grid.structures:
        assert sum(level["places"] for level in report[name]) == len(part.tree)
        inside = (part.tree.light_parent >= 0).sum() + (part.tree.parent >= 0).sum()
        assert sum(level["entries"] for level in report[name]) == inside


def test_overflow_is_told():
    assert LightGrid.bake(lights(), BOX, BY_RANGE).overflow == ""
    assert LightGrid.bake(lights(), BOX, WITHIN).overflow == ""
    grid = LightGrid.bake(lights(), BOX, replace(BY_RANGE, max_lights=5))
    cells = sum(len(part.occupancy.overflowing_cells) for _, part in grid.structures)
    dropped = sum(len(part.occupancy.dropped_lights) for _, part in grid.structures)
    assert grid.overflow.startswith(f"{cells:,} cells have more than 5 lights; {dropped:,} lights are left out of some")
    entries = sum(part.occupancy.dropped_entries for _, part in grid.structures)
    assert f"{entries:,} or" in grid.overflow


def test_the_expected_error_is_that_of_both_trees_as_if_independent():
    grid = LightGrid.bake(lights(), BOX, WITHIN)
    parts = [expected_error(part.tree, part.clusters, POINTS) for _, part in grid.structures]
    assert all(part.any() for part in parts)
    np.testing.assert_allclose(grid.expected_error(POINTS), np.hypot(*parts))
    with pytest.raises(InvalidInput, match="light grid points"):
        grid.expected_error([[0.0, np.nan, 0.0]])
    with pytest.raises(InvalidInput, match="measure its error"):
        LightGrid.bake(lights(), BOX, BY_RANGE).expected_error(POINTS)


def test_tags_make_a_tree_but_no_grid_stale():
    light_mesh = lights()
    tagged = replace(light_mesh, tag_ids=np.full(200, 3, np.int32))
    LightGrid.bake(light_mesh, BOX, BY_RANGE).require_made_of(tagged)
    with pytest.raises(InvalidInput, match="bake it again"):
        LightGrid.bake(light_mesh, BOX, WITHIN).require_made_of(tagged)


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_other_lights_are_refused(settings):
    light_mesh = lights()
    grid = LightGrid.bake(light_mesh, BOX, settings)
    others = (lights(seed=1), lights(moving=0.5), lights(count=199))
    for other in others:
        with pytest.raises(InvalidInput, match="bake it again"):
            grid.require_made_of(other)
    brighter = replace(light_mesh, colour=2.0 * light_mesh.colour, emission=light_mesh.emission + 1.0)
    grid.require_made_of(brighter)


def test_settings_take_texts_and_refuse_what_is_out_of_range():
    texts = {"mode": "range", "grid": "20", "range": "3.5", "max_lights": "40", "tolerance": "0.05"}
    assert from_mapping(GridSettings, texts, "bake") == GridSettings(20, 3.5, 40, RANGE, 0.05)
    assert GridSettings().mode == TOLERANCE
    for bad in ({"mode": "both"}, {"tolerance": 0.0}, {"tolerance": 1.5}):
        with pytest.raises(InvalidInput):
            from_mapping(GridSettings, bad, "bake")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mode", "foo"),
        ("mode", None),
        ("tolerance", np.nan),
        ("tolerance", -0.02),
        ("range", np.nan),
        ("range", -1.0),
        ("grid", 0),
        ("grid", 2.5),
        ("max_lights", 4.5),
        ("max_lights", "many"),
    ],
)
def test_settings_made_in_python_are_refused_as_typed_ones_are(name, value):
    with pytest.raises(InvalidInput, match="the light grid") as caught:
        GridSettings(**{name: value})
    assert name in caught.value.subject
    assert str(value) in caught.value.problem
    assert caught.value.remedy


def test_settings_of_another_kind_are_refused():
    for other in ({"tolerance": 0.1}, RangeSettings()):
        with pytest.raises(InvalidInput, match=f"{type(other).__name__}; give a GridSettings"):
            LightGrid.bake(lights(), BOX, other)


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
@pytest.mark.parametrize(
    "bounds", [((0, 0, 0), (1, np.nan, 1)), ((0, 0, 1), (1, 1, 0)), ((0, 0), (1, 1)), "box", None, ((0, 0, 0),) * 3]
)
def test_refuses_bounds_it_cannot_use(settings, bounds):
    with pytest.raises(InvalidInput, match="bounds"):
        LightGrid.bake(lights(), bounds, settings)


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_refuses_lights_it_cannot_use(settings):
    dark = replace(lights(), colour=-lights().colour - 1.0)
    with pytest.raises(InvalidInput, match="negative"):
        LightGrid.bake(dark, BOX, settings)
    with pytest.raises(InvalidInput, match="negative"):
        LightGrid.bake(lights(), BOX, settings).moved(dark)


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
@pytest.mark.parametrize(
    ("points", "says"),
    [
        ([[1.0, 2.0, 3.0], [0.0, np.nan, 0.0]], r"row 1: .*nan.* is not finite"),
        ("x", "'x' is not an array of numbers"),
        ([[1.0, 2.0, 3.0], [1.0]], "is not an array of numbers"),
        ([1.0, 2.0, 3.0], r"shape \(3,\) is not"),
        (np.zeros((4, 2)), r"shape \(4, 2\) is not"),
    ],
)
def test_refuses_points_it_cannot_use(settings, points, says):
    with pytest.raises(InvalidInput, match=f"light grid points.*{says}"):
        LightGrid.bake(lights(), BOX, settings).candidates(points)


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_refuses_radiosity_it_cannot_use(settings):
    light_mesh = lights(6)
    grid = LightGrid.bake(light_mesh, BOX, settings)
    for values, says in (
        (np.zeros((5, 3)), r"light grid: shape \(5, 3\) for 6 lights"),
        (np.zeros((6, 1)), r"light grid: shape \(6, 1\)"),
        (np.zeros(18), r"light grid: shape \(18,\)"),
        ("bright", "light grid: 'bright' is not an array of numbers"),
        (with_light_4(np.nan), "light 4: .*nan.* is not finite"),
        (with_light_4(np.inf), "light 4: .*inf.* is not finite"),
        (with_light_4(-1.0), "light 4: .*-1.* is negative"),
    ):
        with pytest.raises(InvalidInput, match=f"radiosity of {says}"):
            grid.relit(light_mesh, values)


def with_light_4(value):
    """Radiosity of 1 W/m² of six lights, but for a channel of light 4."""
    radiosity = np.ones((6, 3))
    radiosity[4, 1] = value
    return radiosity


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_refuses_to_relight_with_another_number_of_lights(settings):
    grid = LightGrid.bake(lights(6), BOX, settings)
    with pytest.raises(InvalidInput, match="7 lights, the light grid was baked from 6"):
        grid.relit(lights(7), np.ones((7, 3)))


def test_refuses_to_relight_with_other_lights():
    other = replace(LIGHTS, vertices=LIGHTS.vertices + 0.1)
    with pytest.raises(InvalidInput, match="other lights"):
        LightGrid.bake(LIGHTS, BOX, WITHIN).relit(other, np.ones((len(other), 3)))


@pytest.mark.parametrize(
    ("probes", "says"),
    [
        (np.zeros((4, 3)), "type ndarray"),
        (SurfacePoints(np.zeros((5, 2)), np.zeros((5, 3)), np.zeros(5, np.int32)), r"shape \(5, 2\)"),
        (SurfacePoints(np.full((5, 3), np.nan), np.ones((5, 3)), np.zeros(5, np.int32)), "not finite"),
    ],
)
def test_refuses_probes_it_cannot_use(probes, says):
    with pytest.raises(InvalidInput, match=says):
        LightGrid.bake(LIGHTS, BOX, WITHIN, probes=probes)


@pytest.mark.parametrize("index", [-1, 10**6])
def test_refuses_corners_that_are_no_vertices(index):
    triangles = LIGHTS.triangles.copy()
    triangles[2, 1] = index
    with pytest.raises(InvalidInput, match="light 2"):
        LightGrid.bake(replace(LIGHTS, triangles=triangles), BOX, WITHIN)


@pytest.mark.parametrize("settings", [BY_RANGE, WITHIN])
def test_baking_can_be_cancelled(settings):
    with pytest.raises(Cancelled):
        LightGrid.bake(lights(), BOX, settings, lambda fraction, label: False)
