# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists ask of a simplification: more lights here, none there, and lights that stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.core.surface_shapes import areas_of, grid, icosphere, mesh_of
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.kept_lights import kept_regions
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.core.source_surface import join_surface

SPHERE = icosphere(5)
WALL = grid(60, 60, 6.0, 6.0)


def painted(shape: tuple, side: np.ndarray, value: float):
    """A mesh with `value` as the detail of the triangles of `side`."""
    mesh = mesh_of(*shape)
    return replace(mesh, detail=np.where(side, value, 1.0).astype(np.float32))


def left_of(shape: tuple) -> np.ndarray:
    """Whether the middle of each triangle lies left of the middle of the shape."""
    middles = shape[0][shape[1]].mean(axis=1)[:, 0]
    return middles < 0.5 * (middles.min() + middles.max())


@pytest.mark.parametrize("shape", [SPHERE, WALL], ids=["sphere", "wall"])
def test_more_detail_gives_more_lights_there(shape: tuple) -> None:
    left = left_of(shape)
    created = create_light_mesh([painted(shape, left, 4.0)], SimplifySettings(300, 1))
    middles = created.light_mesh.corners.mean(axis=1)[:, 0]
    lights_left = (middles < 0.5 * (shape[0][:, 0].min() + shape[0][:, 0].max())).sum()
    ratio = lights_left / (len(middles) - lights_left)
    assert 2.5 < ratio < 8.0
    assert 285 <= len(middles) <= 300


def test_neutral_detail_changes_nothing() -> None:
    asked = create_light_mesh([painted(SPHERE, left_of(SPHERE), 1.0)], SimplifySettings(200)).light_mesh
    unasked = create_light_mesh([mesh_of(*SPHERE)], SimplifySettings(200)).light_mesh
    np.testing.assert_array_equal(asked.corners, unasked.corners)
    np.testing.assert_array_equal(asked.strength, unasked.strength)


@pytest.mark.parametrize("target", [100, 100_000])
def test_where_there_are_no_lights_there_is_no_power(target: int) -> None:
    left = left_of(WALL)
    mesh = painted(WALL, left, 0.0)
    created = create_light_mesh([mesh], SimplifySettings(target))
    of_triangle = created.light_of_triangle[0]
    assert (of_triangle[left] == -1).all()
    assert (of_triangle[~left] >= 0).all()
    areas = areas_of(*WALL)
    np.testing.assert_allclose(created.light_mesh.reflected_power, 0.5 * areas[~left].sum(), rtol=1e-4)
    assert created.light_mesh.corners[..., 0].min() > 2.9
    assert created.report.unlit_area == pytest.approx(areas[left].sum())
    assert any("no lights" in finding.problem for finding in created.report.findings)


def test_nothing_but_unlit_surface_gives_no_lights() -> None:
    mesh = painted(WALL, np.ones(len(WALL[1]), bool), 0.0)
    created = create_light_mesh([mesh])
    assert len(created.light_mesh) == 0
    assert (created.light_of_triangle[0] == -1).all()


@pytest.mark.parametrize("bad", [-1.0, np.nan])
def test_detail_that_means_nothing_names_the_mesh(bad: float) -> None:
    with pytest.raises(InvalidInput, match="mesh 'shape': detail"):
        create_light_mesh([painted(WALL, left_of(WALL), bad)])


def test_detail_of_too_few_triangles_is_refused() -> None:
    with pytest.raises(InvalidInput, match="detail for 3"):
        create_light_mesh([replace(mesh_of(*WALL), detail=np.ones(3, np.float32))])


def some_kept(shape: tuple, target: int) -> VirtualLightMesh:
    """The lights on the left of a first light mesh, painted blue by hand."""
    first = create_light_mesh([mesh_of(*shape)], SimplifySettings(target)).light_mesh
    middle = 0.5 * (shape[0][:, 0].min() + shape[0][:, 0].max())
    kept = first.subset(first.corners.mean(axis=1)[:, 0] < middle)
    return replace(kept, colour=np.full_like(kept.colour, (0.0, 0.0, 5.0)))


@pytest.mark.parametrize("shape", [SPHERE, WALL], ids=["sphere", "wall"])
def test_kept_lights_stay_as_they_are_and_count(shape: tuple) -> None:
    kept = some_kept(shape, 200)
    created = create_light_mesh([mesh_of(*shape)], SimplifySettings(260), keep=kept)
    found = created.light_mesh
    assert 250 <= len(found) <= 260
    own = found.subset(np.arange(len(found)) < len(kept))
    for name in ("colour", "emission", "strength", "tag_ids", "dynamic", "corners"):
        np.testing.assert_array_equal(getattr(own, name), getattr(kept, name))
    np.testing.assert_array_equal(own.samples.positions, kept.samples.positions)
    assert created.report.kept_lights == len(kept)


@pytest.mark.parametrize("shape", [SPHERE, WALL], ids=["sphere", "wall"])
def test_surface_of_kept_lights_gets_no_second_light(shape: tuple) -> None:
    kept = some_kept(shape, 200)
    created = create_light_mesh([mesh_of(*shape)], SimplifySettings(260), keep=kept)
    of_triangle, areas = created.light_of_triangle[0], areas_of(*shape)
    assert of_triangle.min() >= 0
    left = left_of(shape)
    held = of_triangle < len(kept)
    # Regions end at the triangles of the lights: a jagged line through the middle.
    assert areas[left & held].sum() > 0.9 * areas[left].sum()
    assert areas[~left & held].sum() < 0.1 * areas[~left].sum()
    new = created.light_mesh.subset(np.arange(len(created.light_mesh)) >= len(kept))
    np.testing.assert_allclose(new.reflected_power, 0.5 * areas[~held].sum(), rtol=1e-3)


def test_a_small_kept_light_does_not_take_a_large_triangle() -> None:
    wall = mesh_of([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    spot = mesh_of([[2.4, 1.1, -0.01], [2.8, 1.1, -0.01], [2.6, 1.5, -0.01]], [[0, 1, 2]])
    kept = create_light_mesh([spot]).light_mesh
    surface = join_surface([wall])
    assert (kept_regions(kept, surface.corners, surface.normals) == -1).all()


def test_a_light_of_the_other_side_does_not_hold_a_surface() -> None:
    wall = mesh_of(*WALL)
    surface = join_surface([wall])
    kept = create_light_mesh([mesh_of(WALL[0], WALL[1][:, ::-1])], SimplifySettings(50)).light_mesh
    assert (kept_regions(kept, surface.corners, surface.normals) == -1).all()


def test_more_kept_lights_than_asked_for_are_refused() -> None:
    kept = some_kept(SPHERE, 200)
    with pytest.raises(InvalidInput, match="unlock"):
        create_light_mesh([mesh_of(*SPHERE)], SimplifySettings(20), keep=kept)


def test_lights_that_hold_all_of_the_surface_are_all_there_is() -> None:
    kept = create_light_mesh([mesh_of(*WALL)], SimplifySettings(50)).light_mesh
    created = create_light_mesh([mesh_of(*WALL)], SimplifySettings(len(kept)), keep=kept)
    assert created.light_mesh is kept
    assert set(created.light_of_triangle[0].tolist()) == set(range(len(kept)))
