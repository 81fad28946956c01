# SPDX-License-Identifier: GPL-3.0-or-later
import dataclasses
import json

import numpy as np

from vlm_addon.core.array_codec import content_hash, flatten, unflatten
from vlm_addon.core.light_mesh import empty_light_mesh
from vlm_addon.core.scene import Camera, Finding, Light, Material, SceneSnapshot
from vlm_addon.core.scene_codec import light_mesh_from_tree, snapshot_from_tree

SNAPSHOT = SceneSnapshot(
    "room",
    materials=(Material("red", base_color=(0.6, 0.1, 0.1)),),
    lights=(Light("lamp", "SPOT", (100.0, 90.0, 80.0), (0.0, 0.0, 2.0)),),
    camera=Camera("camera", np.eye(4)),
    findings=(Finding("a", "b", "c"),),
)


def through_json(value):
    tree, arrays = flatten(value)
    return unflatten(json.loads(json.dumps(tree)), arrays)


def test_a_snapshot_survives_json_and_arrays():
    back = snapshot_from_tree(through_json(SNAPSHOT))
    assert content_hash(back) == content_hash(SNAPSHOT)
    assert back.lights == SNAPSHOT.lights
    assert back.materials == SNAPSHOT.materials


def test_an_empty_light_mesh_survives():
    assert len(light_mesh_from_tree(through_json(empty_light_mesh()))) == 0


def test_the_hash_sees_one_changed_bit_of_an_array():
    moved = dataclasses.replace(SNAPSHOT, camera=Camera("camera", np.eye(4) + 1e-16 * np.eye(4, k=1)))
    assert content_hash(moved) != content_hash(SNAPSHOT)
