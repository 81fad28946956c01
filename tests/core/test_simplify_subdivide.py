# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights halved until there are enough: the same light, sent from more places, measured at more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.core.surface_shapes import cube, icosphere, mesh_of
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_mesh import empty_light_mesh, require_valid
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh, subdivide_light_mesh

POSITIONS, TRIANGLES, SIDE = cube(1, 4.0)
ROOM = create_light_mesh(
    [mesh_of(POSITIONS, TRIANGLES[:, ::-1], reflectance=np.linspace(0.1, 0.9, 12)[:, None], tags=SIDE)]
).light_mesh


@pytest.mark.parametrize("target", [13, 50, 200, 2000])
def test_count_power_and_area_are_exact(target: int) -> None:
    fine = subdivide_light_mesh(ROOM, target)
    require_valid(fine)
    assert len(fine) == target
    np.testing.assert_allclose(fine.reflected_power, ROOM.reflected_power, rtol=1e-6)
    assert fine.areas.sum() == pytest.approx(ROOM.areas.sum(), rel=1e-9)
    assert fine.areas.max() < 4.5 * fine.areas.min()


def test_lights_stay_well_shaped() -> None:
    corners = subdivide_light_mesh(ROOM, 2000).corners
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    assert (sides.max(axis=1) < 2.0 * sides.min(axis=1)).all()


def test_samples_lie_on_the_wall_inside_the_light() -> None:
    fine = subdivide_light_mesh(ROOM, 300)
    samples = fine.samples
    np.testing.assert_allclose(np.abs(samples.positions).max(axis=1), 2.0, atol=1e-12)
    np.testing.assert_allclose(np.add.reduceat(samples.weights, samples.offsets[:-1]), 1.0, rtol=1e-6)
    owner = np.repeat(np.arange(len(fine)), np.diff(samples.offsets))
    corners = fine.corners[owner]
    pieces = np.stack([corners[:, [1, 2]], corners[:, [2, 0]], corners[:, [0, 1]]], axis=1)
    spokes = pieces - samples.positions[:, None, None]
    inside = 0.5 * np.linalg.norm(np.cross(spokes[:, :, 0], spokes[:, :, 1]), axis=2).sum(axis=1)
    # A point inside a triangle splits it into three of the same total area; the inset adds next to nothing.
    np.testing.assert_allclose(inside, fine.areas[owner], rtol=1e-3)
    assert (np.diff(samples.offsets) >= 4).all()


def test_tags_and_colours_follow_the_parent() -> None:
    fine = subdivide_light_mesh(ROOM, 100)
    for tag in range(6):
        assert fine.areas[fine.tag_ids == tag].sum() == pytest.approx(16.0, rel=1e-4)
    assert {tuple(row) for row in fine.colour.tolist()} == {tuple(row) for row in ROOM.colour.tolist()}


def test_samples_of_a_curved_surface_stay_near_it() -> None:
    created = create_light_mesh([mesh_of(*icosphere(4))], SimplifySettings(100)).light_mesh
    fine = subdivide_light_mesh(created, 400)
    radius = np.linalg.norm(fine.samples.positions, axis=1)
    assert radius.min() > 0.97
    assert radius.max() < 1.1


def test_enough_lights_are_left_alone() -> None:
    assert subdivide_light_mesh(ROOM, 12) is ROOM
    assert len(subdivide_light_mesh(empty_light_mesh(), 50)) == 0


def test_target_below_one_is_refused() -> None:
    with pytest.raises(InvalidInput, match="at least 1"):
        subdivide_light_mesh(ROOM, 0)


def test_halving_by_power_evens_it_out() -> None:
    even = subdivide_light_mesh(ROOM, 1000, even_power=1.0)
    power = even.areas * even.strength * even.colour.mean(axis=1)
    assert power.max() < 4.5 * power.min()
    by_area = subdivide_light_mesh(ROOM, 1000)
    uneven = by_area.areas * by_area.strength * by_area.colour.mean(axis=1)
    assert uneven.max() > 6.0 * uneven.min()


def test_black_lights_are_halved_when_nothing_else_is_left() -> None:
    black = replace(ROOM, colour=np.zeros_like(ROOM.colour))
    assert len(subdivide_light_mesh(black, 100, even_power=1.0)) == 100
