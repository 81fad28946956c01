# SPDX-License-Identifier: GPL-3.0-or-later
"""What makes a bake out of date and what does not, and that stored keys are read or refused."""

from dataclasses import replace

import numpy as np
import pytest

from vlm_addon.core.bake_key import BakeKey, grid_changes, grid_key, light_hash, surface_changes, surface_hashes
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_grid import GridSettings
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh
from vlm_addon.core.scene import Mesh

SETTINGS = GridSettings()


def mesh(name="Cube", dynamic=False):
    generator = np.random.default_rng(1)
    return Mesh(
        name=name,
        positions=generator.random((4, 3)),
        triangles=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        corner_normals=np.zeros((2, 3, 3), np.float32),
        corner_uvs=np.zeros((2, 3, 2), np.float32),
        corner_colors=np.zeros((0, 3, 3), np.float32),
        material_indices=np.zeros(2, np.int32),
        tag_ids=np.zeros(2, np.int32),
        reflectance=np.full((2, 3), 0.5, np.float32),
        emission=np.zeros((2, 3), np.float32),
        dynamic=dynamic,
    )


def lights(dynamic=(False, True)):
    count = len(dynamic)
    samples = SourceSamples(
        np.zeros((count, 3)), np.zeros((count, 3), np.float32), np.ones(count, np.float32), np.arange(count + 1)
    )
    return VirtualLightMesh(
        vertices=np.random.default_rng(2).random((3 * count, 3)),
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        colour=np.ones((count, 3), np.float32),
        emission=np.zeros((count, 3), np.float32),
        strength=np.ones(count, np.float32),
        tag_ids=np.zeros(count, np.int32),
        dynamic=np.array(dynamic),
        samples=samples,
    )


def changed(mesh_before, mesh_after):
    return surface_changes(surface_hashes([mesh_before]), surface_hashes([mesh_after]))


@pytest.mark.parametrize(
    "change",
    [
        {"positions": mesh().positions + 1e-6},
        {"triangles": mesh().triangles[:, [0, 2, 1]]},
        {"reflectance": np.full((2, 3), 0.6, np.float32)},
        {"emission": np.ones((2, 3), np.float32)},
        {"dynamic": True},
    ],
    ids=lambda change: next(iter(change)),
)
def test_what_lights_are_made_from_changes_a_surface(change):
    assert changed(mesh(), replace(mesh(), **change)) == ("'Cube' changed",)


@pytest.mark.parametrize("name", ["corner_normals", "corner_uvs", "material_indices", "tag_ids"])
def test_what_is_only_seen_or_says_which_lights_count_does_not(name):
    assert changed(mesh(), replace(mesh(), **{name: getattr(mesh(), name) + 1})) == ()


def test_what_moves_by_itself_may_be_elsewhere_but_not_otherwise():
    moving = mesh(dynamic=True)
    assert changed(moving, replace(moving, positions=moving.positions + 1.0)) == ()
    assert changed(moving, replace(moving, reflectance=moving.reflectance * 2)) == ("'Cube' changed",)


def test_one_instance_of_many_changes_their_instancer():
    instances = [mesh("Trees/Leaf/0"), mesh("Trees/Leaf/1")]
    moved = [instances[0], replace(instances[1], positions=instances[1].positions + 1.0)]
    assert list(surface_hashes(instances)) == ["Trees"]
    assert surface_changes(surface_hashes(instances), surface_hashes(moved)) == ("'Trees' changed",)


def test_many_changes_are_one_phrase():
    before = surface_hashes([mesh(name) for name in "ABCDE"])
    after = surface_hashes([replace(mesh(name), emission=np.ones((2, 3), np.float32)) for name in "ABCD"])
    assert surface_changes(before, after) == ("'A', 'B', 'C' and 1 more changed", "'E' is gone")


def test_a_new_surface_is_a_change_of_the_grid_and_not_of_what_a_light_mesh_was_made_from():
    before, after = surface_hashes([mesh("A")]), surface_hashes([mesh("A"), mesh("B")])
    assert surface_changes(before, after) == ()
    assert grid_changes(BakeKey(before), BakeKey(after)) == ("'B' is new",)


def test_settings_of_the_grid_count():
    keys = [grid_key([mesh()], lights(), settings) for settings in (SETTINGS, replace(SETTINGS, tolerance=0.01))]
    assert grid_changes(*keys) == ("the light grid's settings changed",)


@pytest.mark.parametrize(("row", "counts"), [(0, True), (1, False)])
def test_lights_that_stand_still_count_by_their_place_and_moving_ones_do_not(row, counts):
    before = lights()
    vertices = before.vertices.copy()
    vertices[3 * row] += 0.5
    assert (light_hash(replace(before, vertices=vertices)) != light_hash(before)) == counts


@pytest.mark.parametrize(
    ("change", "counts"),
    [
        ({"tag_ids": np.array([0, 5], np.int32)}, True),
        ({"links": np.array([[1, 2]], np.int32)}, True),
        ({"dynamic": np.array([False, False])}, True),
        ({"colour": np.full((2, 3), 5.0, np.float32)}, False),
        ({"strength": np.full(2, 5.0, np.float32)}, False),
        ({"emission": np.ones((2, 3), np.float32)}, False),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else str(value),
)
def test_light_itself_needs_no_new_bake(change, counts):
    assert (light_hash(replace(lights(), **change)) != light_hash(lights())) == counts


def test_a_key_comes_back_from_json():
    key = grid_key([mesh()], lights(), SETTINGS)
    assert BakeKey.from_json(key.to_json(), "test") == key


@pytest.mark.parametrize("tree", [None, [], {}, {"surfaces": []}, {"surfaces": {"A": 3}, "lights": "", "settings": ""}])
def test_anything_else_is_refused(tree):
    with pytest.raises(InvalidInput, match="make it again"):
        BakeKey.from_json(tree, "test")
