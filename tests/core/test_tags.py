# SPDX-License-Identifier: GPL-3.0-or-later
"""Tags of regions leave out exactly the own lights; ids that unrelated things share are told and taken apart."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.core.surface_shapes import cube, grid, icosphere, mesh_of
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_links import leaves_out
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.core.tags import (
    light_of_triangles,
    next_tag,
    pair_nearest,
    region_tags,
    separated_tags,
    shared_wrongly,
)

MAPS = st.lists(st.tuples(st.integers(-1, 6), st.integers(0, 5)), min_size=1, max_size=40)


def left_out(found: object, light: int, face: int) -> bool:
    return bool(leaves_out(found.links, found.light_tags[light], found.face_tags[face]))


@given(rows=MAPS, first=st.integers(1, 1000))
def test_a_face_leaves_out_the_lights_of_its_triangles_and_no_other(rows: list, first: int) -> None:
    lights, faces = np.array(rows).T
    found = region_tags(lights, faces, first, light_count=7, face_count=6)
    for face in range(6):
        own = {light for light, of in rows if of == face and light >= 0}
        assert {light for light in range(7) if left_out(found, light, face)} == own
    assert found.light_tags.min() >= first
    assert (np.diff(found.links, axis=0) >= 0).any(axis=1).all()


@given(rows=MAPS, groups=st.lists(st.integers(0, 3), min_size=7, max_size=7))
def test_lights_of_a_group_are_left_out_together(rows: list, groups: list) -> None:
    lights, faces = np.array(rows).T
    found = region_tags(lights, faces, 1, light_count=7, face_count=6, group_of_light=groups)
    for face in range(6):
        own = {groups[light] for light, of in rows if of == face and light >= 0}
        assert {light for light in range(7) if left_out(found, light, face)} == {
            light for light in range(7) if groups[light] in own
        }


def test_faces_of_one_light_each_need_no_links() -> None:
    found = region_tags([0, 0, 1, 2], [0, 0, 1, 2])
    assert found.links.shape == (0, 2)
    assert found.face_tags.tolist() == found.light_tags.tolist() == [1, 2, 3]


def test_faces_of_equal_sets_of_lights_share_a_tag() -> None:
    found = region_tags([0, 1, 1, 0, 1, 2], [0, 0, 1, 1, 2, 2])
    assert found.face_tags[0] == found.face_tags[1] != found.face_tags[2]
    assert len(found.links) == 4


def test_arrays_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InvalidInput, match="2 lights for 1 faces"):
        region_tags([0, 1], [0])
    with pytest.raises(InvalidInput, match="1 lights in 1 groups"):
        region_tags([3], [0], light_count=1)


def nearest_by_brute_force(lights: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Scores by distances to a dense set of points of each light, to within their spacing."""
    steps = np.linspace(0, 1, 30)
    u, v = (each.ravel() for each in np.meshgrid(steps, steps))
    inside = u + v <= 1
    weights = np.stack([u, v, 1 - u - v], axis=1)[inside]
    points = np.einsum("pk,nkj->npj", weights, lights)
    area = np.cross(lights[:, 1] - lights[:, 0], lights[:, 2] - lights[:, 0])
    size = np.linalg.norm(area, axis=1)
    normal = np.cross(source[:, 1] - source[:, 0], source[:, 2] - source[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    middle = source.mean(axis=1)
    square = ((middle[:, None, None] - points) ** 2).sum(axis=3).min(axis=2)
    return square + (1 - normal @ (area / size[:, None]).T) * 0.5 * size


def test_nearest_light_is_that_of_brute_force() -> None:
    rng = np.random.default_rng(3)
    lights = rng.uniform(-1, 1, (40, 1, 3)) + rng.uniform(-0.3, 0.3, (40, 3, 3))
    source = rng.uniform(-1, 1, (300, 1, 3)) + rng.uniform(-0.05, 0.05, (300, 3, 3))
    found = light_of_triangles(lights, source)
    score = nearest_by_brute_force(lights, source)
    assert (score[np.arange(300), found] <= score.min(axis=1) + 0.02).all()
    assert (found == score.argmin(axis=1)).mean() > 0.97


@pytest.mark.parametrize(("shape", "target"), [(icosphere(4), 300), (cube(12)[:2], 60)])
def test_nearest_lights_are_mostly_those_of_the_map(shape: tuple, target: int) -> None:
    mesh = mesh_of(*shape)
    created = create_light_mesh([mesh], SimplifySettings(target))
    found = pair_nearest(created.light_mesh, [mesh])[0]
    assert (found == created.light_of_triangle[0]).mean() > 0.9


def test_both_sides_of_a_thin_body_keep_their_own_lights() -> None:
    top, triangles = grid(6, 6)
    sides = [mesh_of(top, triangles), mesh_of(top - [0, 0, 1e-4], triangles[:, ::-1])]
    created = create_light_mesh(sides, SimplifySettings(100))
    for found, mapped in zip(pair_nearest(created.light_mesh, sides), created.light_of_triangle, strict=True):
        assert set(found) == set(mapped)


def test_without_lights_or_triangles_nothing_is_paired() -> None:
    corners = np.zeros((2, 3, 3))
    assert light_of_triangles(corners[:0], corners).tolist() == [-1, -1]
    assert light_of_triangles(corners, corners[:0]).tolist() == []


def test_an_id_of_two_groups_is_told_and_taken_apart() -> None:
    light_tags, light_group = [5, 5, 6, 0], [0, 1, 0, 1]
    face_tags, face_group = [5, 5, 6, 0, 5], [0, 1, 0, 1, 2]
    assert shared_wrongly(light_tags, light_group, face_tags, face_group).tolist() == [5]
    first = next_tag(light_tags, face_tags)
    found = separated_tags(light_tags, light_group, face_tags, face_group, first)
    # Group 0 keeps it, group 1 shares a new one, group 2 has no light of it.
    assert found.light_tags.tolist() == [5, 7, 6, 0]
    assert found.face_tags.tolist() == [5, 7, 6, 0, 0]
    again = shared_wrongly(found.light_tags, light_group, found.face_tags, face_group)
    assert again.tolist() == []


def test_tags_that_nothing_shares_stay() -> None:
    found = separated_tags([1, 2], [0, 1], [1, 2, 2], [0, 1, 1], 10)
    assert found.light_tags.tolist() == [1, 2]
    assert found.face_tags.tolist() == [1, 2, 2]
    assert not len(found.repaired)
