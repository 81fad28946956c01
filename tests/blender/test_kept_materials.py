# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials are read once by strokes, and again when they change."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.drawing.draw_lights import draw
from vlm_addon.blender.light_faces import read_faces

SQUARE = 0.1 * np.array([(-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0)])
BLUE = (0.1, 0.2, 0.7, 1.0)


@pytest.fixture
def shader(make_plane, make_material):
    """The shader of a plane's material."""
    material, made = make_material("Paint", "ShaderNodeBsdfDiffuse")
    make_plane(size=4.0, material=material)
    bpy.context.view_layer.update()
    return made


def drawn_color():
    beside = np.array([0.1 * len(bpy.context.object.data.polygons), 0.0, 0.0]) if bpy.context.object else 0.0
    draw(bpy.context, SQUARE + beside, [[0, 1, 2, 3]], np.array([[0.0, 0.0, 1.0]]), 0.0)
    return read_faces(bpy.context.object, "vlm_color")[-1]


def test_strokes_read_a_material_once(reads, shader):
    first, second = drawn_color(), drawn_color()
    assert np.array_equal(first, second)
    assert reads == ["Paint"]


def test_a_changed_material_is_read_again(reads, shader):
    drawn_color()
    shader.inputs["Color"].default_value = BLUE
    bpy.context.view_layer.update()
    assert np.allclose(drawn_color(), BLUE)
    assert reads == ["Paint", "Paint"]


def test_a_changed_picture_is_read_again(reads, shader):
    image = bpy.data.images.new("Picture", 4, 4, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    tree = bpy.data.materials["Paint"].node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs[0], shader.inputs["Color"])
    bpy.context.view_layer.update()
    drawn_color()
    image.pixels.foreach_set(np.tile(np.array(BLUE, np.float32), 16))
    image.update()
    image.update_tag()
    bpy.context.view_layer.update()
    assert np.allclose(drawn_color(), BLUE)


def test_another_frame_and_another_file_are_read_again(reads, shader):
    drawn_color()
    bpy.context.scene.frame_set(2)
    drawn_color()
    assert reads == ["Paint", "Paint"]


def test_an_override_of_all_materials_is_not_kept(reads, shader, make_material):
    override, over = make_material("Override", "ShaderNodeBsdfDiffuse")
    over.inputs["Color"].default_value = BLUE
    bpy.context.view_layer.material_override = override
    bpy.context.view_layer.update()
    assert np.allclose(drawn_color(), BLUE)
    bpy.context.view_layer.material_override = None
    bpy.context.view_layer.update()
    assert not np.allclose(drawn_color(), BLUE)


def test_nothing_is_kept_where_nobody_listens(shader, monkeypatch):
    drawn_color()
    shader.inputs["Color"].default_value = BLUE
    assert np.allclose(drawn_color(), BLUE)
