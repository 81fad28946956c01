# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked visibility between cells: continuous, exact where all is the same, and refused where it is broken."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.core.visible_room import block_room, host_bake, host_rows, surface_lights
from tests.render.closed_rooms import inward_box
from tests.render.rooms import split
from vlm_addon.core.baked_visibility import (
    FULL,
    MOST_ENTRIES,
    UNFACED,
    BakedVisibility,
    bake_hash,
    cluster_shares,
    make_baked,
    require_sound,
    sample_numbers,
    truncated,
    visibility_frame,
)
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_tree import build_light_tree
from vlm_addon.core.scene import SceneSnapshot
from vlm_addon.core.triangle_tree import build_tree


def random_shares(snapshot: SceneSnapshot, cells: int, lights: int = 3, seed: int = 0) -> BakedVisibility:
    frame, air, rows = host_rows(snapshot, cells, 2)
    shares = np.random.default_rng(seed).integers(0, FULL + 1, (len(rows), lights)).astype(np.uint8)
    return make_baked(frame, air, rows, shares, "random")


@pytest.fixture(scope="module")
def baked_room() -> BakedVisibility:
    return host_bake(block_room(), surface_lights(block_room(), 0))


def test_no_step_along_a_floor_across_cells() -> None:
    """Random rows: between the middles of cells the share goes from one row's to the next, so its slope is at most 1
    for each cell along each axis."""
    baked = random_shares(block_room(), 8)
    steps = 4001
    for direction in ((1.0, 0.0), (0.6, 0.8)):
        along = np.linspace(0.05, 1.9, steps)
        positions = np.stack([0.02 + along * direction[0], 0.04 + along * direction[1], np.zeros(steps)], axis=1)
        values = baked.at(positions, np.tile([0.0, 0.0, 1.0], (steps, 1)))
        cells_per_step = (along[1] - along[0]) / (8 * baked.frame.voxel_size)
        assert values.max() - values.min() > 0.5
        assert np.abs(np.diff(values, axis=0)).max() <= 1.05 * sum(direction) * cells_per_step


def test_no_step_where_the_normal_turns() -> None:
    """Around a box that is smaller than a cell, so that several ways of the same cells have rows."""
    small = SceneSnapshot("small", tuple(inward_box((0.9, 0.9, 0.9), (1.1, 1.1, 1.1), [0] * 6, outward=True)))
    small = replace(small, meshes=(*small.meshes, *inward_box((0, 0, 0), (4, 4, 4), [0] * 6)))
    baked = random_shares(small, 4)
    steps = 2001
    for axis, other in ((0, 1), (1, 2), (2, 0)):
        angles = np.linspace(0.0, 2.0 * np.pi, steps)
        normals = np.zeros((steps, 3))
        normals[:, axis], normals[:, other] = np.cos(angles), np.sin(angles)
        # On a ball around the box, whose voxels it does not touch.
        values = baked.at(np.tile([1.0, 1.0, 1.0], (steps, 1)) + 0.3 * normals, normals)
        assert values.max() - values.min() > 0.2
        assert np.abs(np.diff(values, axis=0)).max() <= 4.0 * (angles[1] - angles[0])


def test_no_step_where_more_rows_count_than_are_kept() -> None:
    """Weights that cross each other at the edge of what is kept."""
    generator = np.random.default_rng(3)
    start, end = generator.random((2, MOST_ENTRIES + 9))
    values = generator.random(len(start))
    shares = np.linspace(0.0, 1.0, 5001)
    found = []
    for share in shares:
        weights = truncated((1.0 - share) * start + share * end)
        assert (weights > 0.0).sum() <= MOST_ENTRIES
        found.append(weights @ values / weights.sum())
    assert np.abs(np.diff(found)).max() <= 20.0 * (shares[1] - shares[0])
    assert (truncated(start[:MOST_ENTRIES]) == start[:MOST_ENTRIES]).all()


def test_rows_that_agree_give_what_they_agree_on() -> None:
    frame, air, rows = host_rows(block_room(), 4, 2)
    shares = np.tile(np.array([FULL, 0, 127, UNFACED], np.uint8), (len(rows), 1))
    baked = make_baked(frame, air, rows, shares, "the same")
    assert len(baked.shares) == 1
    positions = np.random.default_rng(0).uniform(0.05, 1.95, (50, 3)) * (1.0, 1.0, 0.0)
    values = baked.at(positions, np.tile([0.0, 0.0, 1.0], (50, 1)))
    assert values == pytest.approx(np.tile([1.0, 0.0, 127 / FULL, 0.0], (50, 1)), abs=1e-12)


def test_a_row_that_says_nothing_of_a_light_leaves_it_to_the_others() -> None:
    frame, air, rows = host_rows(block_room(), 4, 2)
    shares = np.full((len(rows), 1), 200, np.uint8)
    shares[::2] = UNFACED
    baked = make_baked(frame, air, rows, shares, "half")
    values = baked.at(np.array([[0.3, 0.4, 0.0], [0.9, 0.3, 0.0]]), np.tile([0.0, 0.0, 1.0], (2, 1)))
    assert np.isclose(values, 200 / FULL, atol=1e-12).all()


def test_what_has_no_surface_near_sees_all() -> None:
    baked = random_shares(block_room(), 8)
    assert (baked.at([[1.0, 1.0, 1.4]], [[0.0, 0.0, 1.0]]) == 1.0).all()


def test_points_of_the_floor_see_what_rays_see(baked_room: BakedVisibility) -> None:
    """Of each light, the mean over rays to points of it; rows of half a metre, four rays each."""
    room = block_room()
    lights = surface_lights(room, 0)
    generator = np.random.default_rng(1)
    points = generator.uniform(0.05, 1.95, (60, 3)) * (1.0, 1.0, 0.0)
    up = np.tile([0.0, 0.0, 1.0], (60, 1))
    tree = build_tree(np.concatenate([mesh.positions[mesh.triangles] for mesh in room.meshes]))
    targets = split(lights.corners, 2).reshape(16, len(lights), 3, 3).mean(axis=2).transpose(1, 0, 2)
    ways = targets[None] - points[:, None, None]
    facing = (ways[..., 2] > 0.05) & ((ways * lights.samples.normals[::4][None, :, None]).sum(-1) < -0.05)
    ends = (points[:, None, None] + 0.9999 * ways).reshape(-1, 3)
    begins = np.broadcast_to((points + 1e-4 * up)[:, None, None], ways.shape).reshape(-1, 3)
    seen = np.isinf(tree.first_hits(begins, ends)).reshape(facing.shape)
    whole = facing.all(axis=2)
    truth, found = seen.mean(axis=2)[whole], baked_room.at(points, up)[whole]
    assert truth.mean() < 0.9
    assert np.sqrt(np.mean((found - truth) ** 2)) < 0.6 * np.sqrt(np.mean((1.0 - truth) ** 2))
    assert abs(found.mean() - truth.mean()) < 0.03


def test_all_samples_of_a_light_are_looked_at() -> None:
    counts = np.zeros(7, int)
    for row in range(200):
        numbers = sample_numbers(np.full(8, row), np.arange(8), np.full(8, 7))
        assert len(np.unique(numbers)) >= 5
        np.add.at(counts, numbers, 1)
    assert counts.min() > 0.8 * counts.mean()


def test_a_cluster_is_seen_as_its_lights_are_by_area() -> None:
    lights = surface_lights(block_room(), 3)
    tree = build_light_tree(lights)
    generator = np.random.default_rng(5)
    shares = generator.integers(0, 256, (7, len(lights))).astype(np.uint8)
    shares[3] = UNFACED
    found = cluster_shares(tree, shares, lights.areas)
    members: list[set[int]] = [set() for _ in range(len(tree))]
    for light, cluster in enumerate(tree.light_parent.tolist()):
        while cluster >= 0:
            members[cluster].add(light)
            cluster = int(tree.parent[cluster])
    for cluster in generator.choice(len(tree), 20, replace=False):
        rows = np.array(sorted(members[cluster]))
        for row in range(len(shares)):
            known = rows[shares[row, rows] != UNFACED]
            mean = np.average(shares[row, known], weights=lights.areas[known]) if len(known) else UNFACED
            assert abs(found[row, cluster] - mean) <= 0.5 + 1e-9


def test_hash_tells_geometry_from_light() -> None:
    room, lights = block_room(), surface_lights(block_room(), 0)
    key = bake_hash(room, lights, 4, 8)
    assert bake_hash(room, replace(lights, colour=0.5 * lights.colour), 4, 8) == key
    moved = replace(room.meshes[-1], positions=room.meshes[-1].positions + 0.01)
    for other in (
        bake_hash(replace(room, meshes=(*room.meshes[:-1], moved)), lights, 4, 8),
        bake_hash(room, lights, 8, 8),
        bake_hash(room, lights, 4, 4),
        bake_hash(room, surface_lights(room, 1), 4, 8),
    ):
        assert other != key


def test_another_number_of_cells_is_refused_with_those_there_are() -> None:
    with pytest.raises(InvalidInput, match=r"12 cells .* 4, 8, 16, 32, 64"):
        visibility_frame(block_room(), 12)


def broken(baked: BakedVisibility) -> dict[str, Any]:
    """Ways in which it may not fit together."""
    cells, lists = baked.cells, baked.lists
    far = lists.entries.copy()
    far[0] = len(baked.shares) << 6
    sideways = lists.entries.copy()
    sideways[0] |= 7
    falling = lists.offsets.copy()
    falling[5] = falling[-1] + 1
    label_start = cells.label_start.copy()
    label_start[0] = len(cells.labels)
    return {
        "shares": replace(baked, shares=baked.shares[:, :-1]),
        "floats": replace(baked, shares=baked.shares.astype(np.float32)),
        "rows": replace(baked, lists=replace(lists, entries=far)),
        "ways": replace(baked, lists=replace(lists, entries=sideways)),
        "offsets": replace(baked, lists=replace(lists, offsets=falling)),
        "label start": replace(baked, cells=replace(cells, label_start=label_start)),
        "component": replace(baked, cells=replace(cells, component=cells.component + cells.component_count)),
        "zones": replace(baked, cells=replace(cells, first_zone=cells.first_zone[:-1])),
        "voxels": replace(baked, frame=replace(baked.frame, voxel_size=float("nan"))),
        "labels": replace(baked, cells=replace(cells, labels=np.full_like(cells.labels, 250))),
    }


WAYS_TO_BREAK = (
    *("shares", "floats", "rows", "ways", "offsets", "label start", "component", "zones", "voxels", "labels"),
)


@pytest.mark.parametrize("way", WAYS_TO_BREAK)
def test_what_does_not_fit_together_is_refused(baked_room: BakedVisibility, way: str) -> None:
    require_sound(baked_room, baked_room.shares.shape[1])
    wrong = broken(baked_room)
    assert set(wrong) == set(WAYS_TO_BREAK)
    with pytest.raises(InvalidInput, match="bake it again"):
        require_sound(wrong[way], baked_room.shares.shape[1])
