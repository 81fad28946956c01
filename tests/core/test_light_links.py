# SPDX-License-Identifier: GPL-3.0-or-later
"""Which surfaces lights leave out, pair by pair, and what of it every structure on the processor keeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.render.rooms import lights_from_triangles
from vlm_addon.core.array_codec import flatten, unflatten
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.light_clusters import light_clusters
from vlm_addon.core.light_cut import cut_irradiance
from vlm_addon.core.light_grid import GridSettings, LightGrid
from vlm_addon.core.light_grid_error import grid_error
from vlm_addon.core.light_links import MOST_LINKS, leaves_out, make_links, no_links
from vlm_addon.core.light_mesh import VirtualLightMesh, join, require_valid
from vlm_addon.core.light_tree import build_light_tree
from vlm_addon.core.light_tree_error import full_irradiance
from vlm_addon.core.scene import Float64
from vlm_addon.core.scene_codec import light_mesh_from_tree
from vlm_addon.core.surface_points import SurfacePoints

LARGEST = 2**31 - 1
TAGS = np.array([0, 1, 2, 3, 4, 5, -7, LARGEST, -LARGEST - 1], np.int64)
PAIRS = {(1, 2), (2, 1), (3, -7), (-7, 4), (LARGEST, -LARGEST - 1), (4, LARGEST), (5, 3)}


UNTAGGED_POINTS = np.zeros(60, np.int32)


def lights_with_links(count: int = 300) -> VirtualLightMesh:
    generator = np.random.default_rng(4)
    centres = generator.uniform(0.0, 1.0, (count, 1, 3))
    corners = centres + generator.normal(0.0, 0.02, (count, 3, 3))
    lights = lights_from_triangles(corners, tag_ids=generator.integers(0, 6, count))
    return replace(lights, links=make_links([pair for pair in sorted(PAIRS) if max(map(abs, pair)) < 6]))


def points_of(tags: npt.NDArray[np.int32]) -> SurfacePoints:
    generator = np.random.default_rng(5)
    normals = generator.normal(size=(len(tags), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return SurfacePoints(generator.uniform(0.0, 1.0, (len(tags), 3)), normals, tags)


def lit_points() -> tuple[VirtualLightMesh, SurfacePoints, Float64]:
    """Lights with links, points of all tags, and what the lights send out, (n, 3) W/m²."""
    lights, generator = lights_with_links(), np.random.default_rng(6)
    points = points_of(np.arange(len(UNTAGGED_POINTS), dtype=np.int32) % 6)
    return lights, points, generator.uniform(0.0, 2.0, (len(lights), 3))


def kept_by_surface(light_tags: npt.NDArray[np.int32]) -> dict[int, npt.NDArray[np.bool_]]:
    """By tag of a surface, which lights or clusters of `light_tags` it gets light from."""
    return {
        surface: np.array([(light, surface) not in PAIRS and (light == 0 or light != surface) for light in light_tags])
        for surface in range(6)
    }


def by_hand(lights: VirtualLightMesh, radiosity: Float64, points: SurfacePoints) -> Float64:
    """(p, 3) W/m², one pair of a point and a light after the other."""
    factors = polygon_form_factor(points.positions, points.normals, lights.corners)
    pairs = {tuple(pair) for pair in lights.links.tolist()}
    for row, surface in enumerate(points.tag_ids.tolist()):
        for column, light in enumerate(lights.tag_ids.tolist()):
            if (light != 0 and light == surface) or (light, surface) in pairs:
                factors[row, column] = 0.0
    return factors @ radiosity


@pytest.mark.parametrize("light", TAGS.tolist())
@pytest.mark.parametrize("surface", TAGS.tolist())
def test_a_light_leaves_out_its_own_tag_and_those_it_is_linked_to(light: int, surface: int) -> None:
    links = make_links(sorted(PAIRS))
    expected = (light == surface and light != 0) or (light, surface) in PAIRS
    assert leaves_out(links, np.int32(light), np.int32(surface)) == expected


def test_without_links_a_light_leaves_out_its_own_tag_alone() -> None:
    tags = TAGS.astype(np.int32)
    expected = np.eye(len(tags), dtype=bool) & (tags != 0)
    assert (leaves_out(no_links(), tags, tags[:, None]) == expected).all()


def test_pairs_are_sorted_and_each_is_there_once() -> None:
    links = make_links([(3, 1), (1, 9), (3, 1), (1, -2), (6, 6)])
    assert links.tolist() == [[1, -2], [1, 9], [3, 1]]
    assert links.dtype == np.int32


@pytest.mark.parametrize(
    ("pairs", "reason"),
    [
        ([(0, 3)], "means none"),
        ([(3, 0)], "means none"),
        ([1, 2, 3], "shape"),
        ([(1, 2, 3)], "shape"),
        ([(1.0, 2.0)], "float64"),
        ([(1, 2**31)], "32 bits"),
        (np.stack([np.arange(1, MOST_LINKS + 2), np.full(MOST_LINKS + 1, -5)], axis=1), "one tag id"),
    ],
)
def test_what_is_no_pair_of_tags_is_refused(pairs: npt.ArrayLike, reason: str) -> None:
    with pytest.raises(InvalidInput, match=reason):
        make_links(pairs)


@pytest.mark.parametrize("links", [[[2, 1], [1, 2]], [[1, 2], [1, 2]], [[4, 4]]], ids=["unsorted", "twice", "itself"])
def test_a_light_mesh_with_disorderly_links_is_not_valid(links: list[list[int]]) -> None:
    lights = replace(lights_with_links(3), links=np.array(links, np.int32))
    with pytest.raises(InvalidInput, match="make_links"):
        require_valid(lights)


def test_links_hold_for_all_that_is_joined_and_for_what_is_picked_out() -> None:
    first, second = lights_with_links(5), replace(lights_with_links(4), links=make_links([(9, 1), (1, 2)]))
    joined = join([first, second])
    assert joined.links.tolist() == [[1, 2], [2, 1], [5, 3], [9, 1]]
    assert joined.subset(np.arange(9) < 2).links.tolist() == joined.links.tolist()


@pytest.mark.parametrize("lights", [lights_with_links(5), replace(lights_with_links(5), links=no_links())])
def test_links_reach_the_renderers_process(lights: VirtualLightMesh) -> None:
    tree, arrays = flatten(lights)
    assert np.array_equal(light_mesh_from_tree(unflatten(tree, arrays)).links, lights.links)


def test_the_full_sum_leaves_out_what_links_say() -> None:
    lights, points, radiosity = lit_points()
    found = full_irradiance(lights, radiosity, points.positions, points.normals, points.tag_ids)
    expected = np.zeros_like(found)
    for tag, kept in kept_by_surface(lights.tag_ids).items():
        at = points.tag_ids == tag
        sent = radiosity * kept[:, None]
        expected[at] = full_irradiance(lights, sent, points.positions[at], points.normals[at], UNTAGGED_POINTS[at])
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_a_light_tree_leaves_out_what_links_say() -> None:
    """As the same clusters do of which those left out have no power."""
    lights, points, radiosity = lit_points()
    tree = build_light_tree(lights)
    clusters = light_clusters(tree, lights, radiosity, 0.1)
    where = points.positions, points.normals
    found = cut_irradiance(tree, clusters, lights, radiosity, *where, points.tag_ids).irradiance
    expected = np.zeros_like(found)
    for tag, kept in kept_by_surface(lights.tag_ids).items():
        at = points.tag_ids == tag
        dark = replace(clusters, power=clusters.power * kept_by_surface(tree.tag_ids)[tag])
        sent = radiosity * kept[:, None]
        at_points = (points.positions[at], points.normals[at], UNTAGGED_POINTS[at])
        expected[at] = cut_irradiance(tree, dark, lights, sent, *at_points).irradiance
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert np.abs(found - by_hand(lights, radiosity, points)).max() > 1e-3 * found.mean(), "no cluster takes part"


def test_a_grid_of_cells_leaves_out_what_links_say() -> None:
    lights, points, radiosity = lit_points()
    grid = LightGrid.bake(lights, (np.zeros(3), np.ones(3)), GridSettings(mode="range", range=1e3))
    error = grid_error(grid, lights, radiosity, points)
    expected = by_hand(lights, radiosity, points)
    assert error.full == pytest.approx(expected)
    assert error.found == pytest.approx(expected)
