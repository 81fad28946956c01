# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups in which artists paint where there are more lights, or none."""

import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings, bake
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.blender.extraction.painted_detail import MOST_DETAIL
from vlm_addon.blender.names import MORE_DETAIL_GROUP, NO_LIGHTS_GROUP


@pytest.fixture
def strip(make_mesh):
    """Four squares in a row along x, from 0 to 4."""
    vertices = [(x, y, 0) for x in range(5) for y in range(2)]
    faces = [(2 * x, 2 * x + 2, 2 * x + 3, 2 * x + 1) for x in range(4)]
    return make_mesh("strip", vertices, faces)


def paint(thing, name, first_x, weight):
    group = thing.vertex_groups.new(name=name)
    group.add([v.index for v in thing.data.vertices if v.co.x >= first_x], weight, "REPLACE")


def test_meshes_without_the_groups_ask_for_nothing(strip):
    strip.vertex_groups.new(name="Bones")
    assert len(extract_scene().meshes[0].detail) == 0


def test_weights_become_detail_of_triangles(strip):
    paint(strip, MORE_DETAIL_GROUP, 3, 0.5)
    (mesh,) = extract_scene().meshes
    half = 1.0 + 0.5 * (MOST_DETAIL - 1.0)
    middles = mesh.positions[mesh.triangles].mean(axis=1)[:, 0]
    np.testing.assert_allclose(mesh.detail[middles > 3], half)
    np.testing.assert_allclose(mesh.detail[middles < 2], 1.0)


def test_half_weight_of_none_takes_all_lights_through_modifiers(strip):
    paint(strip, NO_LIGHTS_GROUP, 2, 1.0)
    strip.modifiers.new("subdivide", "SUBSURF").subdivision_type = "SIMPLE"
    snapshot = extract_scene()
    (mesh,) = snapshot.meshes
    middles = mesh.positions[mesh.triangles].mean(axis=1)[:, 0]
    assert len(middles) > 8
    assert (mesh.detail[middles > 2] == 0.0).all()
    made = bake(snapshot, None, BakeSettings(1000))
    assert made.creation.unlit_area > 1.9
    assert made.light_mesh.corners[..., 0].max() < 2.1


def test_instances_are_painted_as_their_mesh(strip):
    paint(strip, NO_LIGHTS_GROUP, 0, 1.0)
    copy = bpy.data.objects.new("copy", strip.data)
    copy.location.z = 3.0
    bpy.context.scene.collection.objects.link(copy)
    for mesh in extract_scene().meshes:
        assert (mesh.detail == 0.0).all()
