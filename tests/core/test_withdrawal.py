# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that shine on their own region go to where they do not, inside of the body; the others stay to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from tests.core.surface_shapes import cube, grid, icosphere, mesh_of, sheet
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.core.mesh_topology import Rows
from vlm_addon.core.own_shares import own_shares
from vlm_addon.core.progress import step
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.core.withdrawal import ALLOWED, withdraw


def bowl(depth: float) -> tuple[np.ndarray, np.ndarray]:
    """A hollow in a block: its rim is flat, and below is room."""
    return sheet(lambda x, y: -depth * np.sin(np.pi * x) ** 2 * np.sin(np.pi * y) ** 2, 24, 24)


def below(positions: np.ndarray, triangles: np.ndarray, depth: float) -> np.ndarray:
    """Source triangles of the bowl with the bottom of its block."""
    bottom, faces = grid(1, 1)
    return np.concatenate([positions[triangles], (bottom - np.array([0, 0, depth]))[faces[:, ::-1]]])


def one_light(depth: float) -> tuple[np.ndarray, np.ndarray, Rows, np.ndarray]:
    positions, triangles = bowl(depth)
    source = below(positions, triangles, 3.0)
    light = np.array([[0.0, 0.0, -depth - 1e-6], [1.5, 0.0, -depth - 1e-6], [0.0, 1.5, -depth - 1e-6]])
    return light, np.array([[0, 1, 2]]), Rows(np.arange(len(triangles)), np.array([0, len(triangles)])), source


def measured(corners: np.ndarray, regions: Rows, source: np.ndarray) -> float:
    """Own light by 20,000 random points of the region."""
    triangles = source[regions.values]
    vector = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(vector, axis=1)
    rng = np.random.default_rng(7)
    row = rng.choice(len(area), 20_000, p=area / area.sum())
    points = np.einsum("ik,ikj->ij", rng.dirichlet([1, 1, 1], len(row)), triangles[row])
    factors = paired_form_factor(points, vector[row] / area[row, None], np.repeat(corners, len(row), axis=0))
    light = np.linalg.norm(np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0]))
    return float(factors.mean() * area.sum() / light)


def test_own_share_is_that_of_many_points() -> None:
    positions, triangles, regions, source = one_light(0.5)
    found = own_shares(positions[triangles], regions, source, 256)[0]
    assert found > 2 * ALLOWED
    assert found == pytest.approx(measured(positions[triangles], regions, source), rel=0.1)


def test_light_behind_a_bowl_goes_to_where_its_sides_do_not_see_it() -> None:
    positions, triangles, regions, source = one_light(0.5)
    found = withdraw(positions, triangles, regions, source)
    corners = found.positions[found.triangles]
    assert found.moved.all()
    assert measured(corners, regions, source) < 1.5 * ALLOWED
    # Inside of the block, behind all of the bowl.
    assert corners[..., 2].max() < -0.5
    assert corners[..., 2].min() > -3.0


def test_room_for_it_decides_how_deep_it_goes() -> None:
    positions, triangles, regions, source = one_light(0.5)
    shallow = source.copy()
    shallow[-2:, :, 2] = -0.52
    found = withdraw(positions, triangles, regions, shallow)
    assert found.positions[found.triangles][..., 2].min() > -0.52


@pytest.mark.parametrize("shape", [icosphere(4), cube(8)[:2]])
def test_lights_of_convex_bodies_stay_to_the_bit(shape: tuple) -> None:
    mesh = mesh_of(*shape)
    created = create_light_mesh([mesh], SimplifySettings(200))
    light_mesh, lights = created.light_mesh, created.light_of_triangle[0].astype(np.int64)
    order = np.argsort(lights, kind="stable")
    regions = Rows(order, np.searchsorted(lights[order], np.arange(len(light_mesh) + 1)))
    found = withdraw(light_mesh.vertices, light_mesh.triangles, regions, mesh.positions[mesh.triangles])
    assert not found.moved.any()
    assert found.positions is light_mesh.vertices


def test_only_lights_with_own_light_leave_their_neighbours() -> None:
    positions, _, regions, source = one_light(0.5)
    flat = np.array([[4.0, 0.0, 0.0], [5.0, 0.0, 0.0], [4.0, 1.0, 0.0]])
    source = np.concatenate([source, flat[None] + np.array([0, 0, 1e-3])])
    every = np.concatenate([positions, flat])
    both = Rows(np.append(regions.values, len(source) - 1), np.append(regions.starts, len(regions.values) + 1))
    found = withdraw(every, np.array([[0, 1, 2], [3, 4, 5]]), both, source)
    assert found.moved.tolist() == [True, False]
    np.testing.assert_array_equal(found.positions[found.triangles[1]], flat)
    assert len(found.positions) == 6


def test_progress_may_stop_it() -> None:
    positions, triangles, regions, source = one_light(0.5)
    with pytest.raises(Cancelled):
        withdraw(positions, triangles, regions, source, lambda share: step(lambda *_: False, share, "withdraw"))


def test_power_is_kept_where_lights_withdraw() -> None:
    positions, triangles = bowl(0.5)
    mesh = mesh_of(positions, triangles, reflectance=0.5)
    report = create_light_mesh([mesh], SimplifySettings(8)).report
    assert report.reflected_power_after == pytest.approx(report.reflected_power_before, rel=1e-5)
