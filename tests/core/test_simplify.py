# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual lights made from surfaces whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.core.surface_shapes import (
    areas_of,
    cube,
    grid,
    icosphere,
    mesh_of,
    open_edges,
    split_vertices,
)
from vlm_addon.core.errors import Cancelled, InvalidInput
from vlm_addon.core.light_mesh import require_valid
from vlm_addon.core.settings import describe
from vlm_addon.core.simplify import CreatedLightMesh, SimplifySettings, create_light_mesh

SPHERE = icosphere(4)


def made(meshes: list, target: int, **values: int) -> CreatedLightMesh:
    created = create_light_mesh(meshes, SimplifySettings(target, **values))
    require_valid(created.light_mesh)
    return created


def source_power(meshes: list) -> np.ndarray:
    return sum((areas_of(m.positions, m.triangles) @ m.reflectance.astype(float) for m in meshes), np.zeros(3))


@pytest.mark.parametrize("target", [20, 21, 50, 100, 500, 1000, 4000])
def test_count_is_within_four_percent_below_the_target(target: int) -> None:
    lights = len(made([mesh_of(*SPHERE)], target).light_mesh)
    # A closed surface has an even number of triangles.
    assert min(0.96 * target, target - 1) <= lights <= target


def test_a_surface_with_fewer_triangles_keeps_all_of_them_in_place() -> None:
    positions, triangles, _ = cube(2)
    created = made([mesh_of(positions, triangles)], 1000)
    assert len(created.light_mesh) == len(triangles)
    corners = np.sort(positions[triangles].mean(axis=1).round(4), axis=0)
    np.testing.assert_allclose(np.sort(created.light_mesh.corners.mean(axis=1).round(4), axis=0), corners, atol=1e-4)
    np.testing.assert_array_equal(created.light_of_triangle[0], np.arange(len(triangles)))


def test_power_is_kept_for_each_colour() -> None:
    rng = np.random.default_rng(3)
    positions, triangles = SPHERE
    meshes = [mesh_of(positions, triangles, reflectance=rng.uniform(0, 1, (len(triangles), 3)))]
    light_mesh = made(meshes, 100).light_mesh
    np.testing.assert_allclose(light_mesh.reflected_power, source_power(meshes), rtol=0.01)


def test_emitted_power_is_kept() -> None:
    positions, triangles = SPHERE
    emission = np.where(positions[triangles].mean(axis=1)[:, :1] > 0, [[3.0, 2.0, 1.0]], [[0.0, 0.0, 0.0]])
    light_mesh = made([mesh_of(positions, triangles, emission=emission)], 200).light_mesh
    emitted = (light_mesh.areas * light_mesh.strength) @ light_mesh.emission.astype(float)
    np.testing.assert_allclose(emitted, areas_of(positions, triangles) @ emission, rtol=0.01)


def test_sphere_stays_closed_and_round() -> None:
    light_mesh = made([mesh_of(*SPHERE)], 300).light_mesh
    assert open_edges(light_mesh.vertices, light_mesh.triangles) == 0
    radius = np.linalg.norm(light_mesh.vertices, axis=1)
    assert 0.85 < radius.min() <= radius.max() < 1.05
    assert (np.einsum("ij,ij->i", light_mesh.area_vectors, light_mesh.corners.mean(axis=1)) > 0).all()


def test_split_vertices_are_welded() -> None:
    light_mesh = made([mesh_of(*split_vertices(*SPHERE))], 300).light_mesh
    assert open_edges(light_mesh.vertices, light_mesh.triangles) == 0


def test_border_between_materials_survives_and_the_box_stays_closed() -> None:
    positions, triangles, side = cube(12)
    red, green = [0.8, 0.1, 0.1], [0.1, 0.8, 0.1]
    top = side == 0
    mesh = mesh_of(positions, triangles, reflectance=np.where(top[:, None], red, green), materials=top.astype(int))
    light_mesh = made([mesh], 48).light_mesh
    pure = [np.isclose(light_mesh.colour, colour, atol=1e-5).all(axis=1) for colour in (red, green)]
    assert (pure[0] | pure[1]).all()
    # The top is as large as before: its four edges have not moved.
    assert light_mesh.areas[pure[0]].sum() == pytest.approx(1.0, rel=1e-4)
    assert open_edges(light_mesh.vertices, light_mesh.triangles) == 0


def test_border_between_tags_survives() -> None:
    positions, triangles = grid(20, 20)
    left = positions[triangles].mean(axis=1)[:, 0] < 0.5
    created = made([mesh_of(positions, triangles, tags=np.where(left, 7, 9))], 40)
    light_mesh = created.light_mesh
    for tag in (7, 9):
        assert light_mesh.areas[light_mesh.tag_ids == tag].sum() == pytest.approx(0.5, rel=1e-4)
    np.testing.assert_array_equal(light_mesh.tag_ids[created.light_of_triangle[0]], np.where(left, 7, 9))


def test_objects_that_touch_are_not_joined() -> None:
    positions, triangles = grid(10, 10)
    still = mesh_of(positions, triangles, name="still", reflectance=[1, 0, 0])
    moving = mesh_of(positions + np.array([1, 0, 0]), triangles, name="moving", reflectance=[0, 0, 1], dynamic=True)
    light_mesh = made([still, moving], 40).light_mesh
    np.testing.assert_allclose(light_mesh.colour[light_mesh.dynamic], [[0, 0, 1]] * light_mesh.dynamic.sum(), atol=1e-6)
    assert light_mesh.areas[light_mesh.dynamic].sum() == pytest.approx(1.0, rel=1e-4)


def test_every_source_triangle_has_exactly_one_light_and_every_light_some() -> None:
    created = made([mesh_of(*SPHERE), mesh_of(*grid(30, 30))], 150)
    of_triangle = np.concatenate(created.light_of_triangle)
    assert of_triangle.min() == 0
    assert set(of_triangle.tolist()) == set(range(len(created.light_mesh)))


def test_region_of_a_light_is_near_it() -> None:
    created = made([mesh_of(*SPHERE)], 320)
    centres = SPHERE[0][SPHERE[1]].mean(axis=1)
    lights = created.light_mesh.corners.mean(axis=1)[created.light_of_triangle[0]]
    # 320 lights on a unit sphere have sides of about 0.33.
    assert np.linalg.norm(centres - lights, axis=1).max() < 0.45


def test_flat_wall_keeps_its_outline_and_even_lights() -> None:
    light_mesh = made([mesh_of(*grid(40, 40, 4.0, 4.0))], 100).light_mesh
    assert light_mesh.areas.sum() == pytest.approx(16.0, rel=1e-4)
    assert light_mesh.areas.max() < 6 * np.median(light_mesh.areas)


def test_weak_shells_give_their_power_to_neighbours() -> None:
    positions, triangles = icosphere(0, 0.01)
    centres = np.stack(np.meshgrid(*[np.arange(12.0)] * 3), axis=-1).reshape(-1, 3)
    faces = np.concatenate([triangles + i * len(positions) for i in range(len(centres))])
    mesh = mesh_of((centres[:, None] + positions).reshape(-1, 3), faces)
    created = made([mesh], 1000)
    report = created.report
    assert 960 <= report.lights <= 1000
    assert report.shells == len(centres)
    assert report.shells_dropped == report.shells - report.closed_shells_before > 0
    assert report.closed_shells_after == report.closed_shells_before
    assert any("got no light" in finding.problem for finding in report.findings)
    np.testing.assert_allclose(created.light_mesh.reflected_power, source_power([mesh]), rtol=0.01)


def test_degenerate_triangles_and_isolated_vertices_are_counted_and_left_out() -> None:
    positions, triangles = grid(4, 4)
    extra = np.concatenate([positions, [[9e9, 9, 9], [0.1, 0, 0], [0.2, 0, 0], [0.4, 0, 0]]])
    first = len(positions) + 1
    faces = np.concatenate([triangles, [[0, 0, 1], [2, 2, 2], [first, first + 1, first + 2]]])
    created = made([mesh_of(extra, faces)], 1000)
    assert len(created.light_mesh) == len(triangles)
    assert created.report.degenerate_triangles == 3
    assert created.light_mesh.vertices.max() <= 1.0 + 1e-4


@pytest.mark.parametrize(
    "meshes", [[], [mesh_of(np.zeros((3, 3)), np.zeros((0, 3)))], [mesh_of(np.zeros((3, 3)), [[0, 1, 2]])]]
)
def test_nothing_to_simplify_gives_no_lights_and_says_so(meshes: list) -> None:
    created = create_light_mesh(meshes)
    assert len(created.light_mesh) == 0
    assert "no surface" in created.report.findings[0].problem


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_vertex_that_is_not_finite_names_the_mesh(bad: float) -> None:
    positions, triangles = grid(2, 2)
    positions[4, 1] = bad
    with pytest.raises(InvalidInput, match="mesh 'broken': vertex 4 is not finite"):
        create_light_mesh([mesh_of(positions, triangles, name="broken")])


@pytest.mark.parametrize("target", [0, -5])
def test_target_below_one_is_refused(target: int) -> None:
    with pytest.raises(InvalidInput, match="at least 1"):
        create_light_mesh([mesh_of(*grid(2, 2))], SimplifySettings(target))


def test_result_does_not_depend_on_the_run() -> None:
    first, second = (made([mesh_of(*SPHERE)], 200).light_mesh for _ in range(2))
    np.testing.assert_array_equal(first.corners, second.corners)
    np.testing.assert_array_equal(first.samples.positions, second.samples.positions)


@pytest.mark.parametrize("last", [0.0, 0.05, 0.2, 0.4, 0.65, 0.8, 0.92])
def test_progress_can_cancel_at_any_step(last: float) -> None:
    seen: list[float] = []
    with pytest.raises(Cancelled):
        create_light_mesh(
            [mesh_of(*SPHERE)], SimplifySettings(100), lambda fraction, label: seen.append(fraction) or fraction <= last
        )
    assert seen[-1] > last
    assert all(fraction <= last for fraction in seen[:-1])


def test_progress_never_goes_back() -> None:
    seen: list[float] = []
    create_light_mesh([mesh_of(*SPHERE)], SimplifySettings(100), lambda fraction, label: seen.append(fraction) or True)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_settings_carry_unit_and_range() -> None:
    assert {info.name: (info.unit, info.low) for info in describe(SimplifySettings)} == {
        "target_triangles": ("count", 1),
        "samples_per_light": ("count", 1),
    }


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    target=st.integers(1, 200),
    scale=st.sampled_from([1e-3, 1.0, 1e3]),
    offset=st.sampled_from([0.0, 1e4]),
)
def test_random_soup_gives_finite_lights_of_the_same_power(seed: int, target: int, scale: float, offset: float) -> None:
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-1, 1, (40, 3)) * scale + offset
    triangles = rng.integers(0, 40, (300, 3))
    meshes = [
        mesh_of(
            vertices,
            triangles,
            reflectance=rng.uniform(0.1, 0.9, (300, 1)),
            materials=rng.integers(0, 3, 300),
            tags=rng.integers(0, 2, 300),
        )
    ]
    created = made(meshes, target)
    assert len(created.light_mesh) <= target
    assert (created.light_mesh.areas > 0).all()
    np.testing.assert_allclose(created.light_mesh.reflected_power, source_power(meshes), rtol=0.01)
