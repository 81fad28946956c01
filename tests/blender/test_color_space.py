# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene is the same whatever working space its file has (Blender 5.0 and later)."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.color_space import (
    convert,
    into_rec709,
    rec709_to_working,
    srgb_to_linear,
    working_to_rec709,
)
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.image_io import write_image
from vlm_addon.blender.write_back import write_light_mesh

HAS_WORKING_SPACES = hasattr(bpy.data, "colorspace")
newer = pytest.mark.skipif(not HAS_WORKING_SPACES, reason="this Blender always works in linear Rec.709")


@pytest.fixture(params=["Linear Rec.2020", "ACEScg"])
def other_space(request):
    """Converts the open file to another working space when called."""

    def convert_file():
        bpy.ops.wm.set_working_color_space(working_space=request.param, convert_colors=True)
        assert bpy.data.colorspace.working_space == request.param

    yield convert_file
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.fixture
def room(make_plane, make_material, make_light, make_camera):
    """A lit floor of a texture, a colour attribute's square, and a light mesh."""
    material, shader = make_material("floor", "ShaderNodeBsdfDiffuse")
    image = bpy.data.images.new("picture", 4, 4)
    texels = np.random.default_rng(0).integers(0, 256, (16, 4)).astype(np.float32) / 255.0
    texels[:, 3] = 1.0
    image.pixels.foreach_set(texels.ravel())
    image.pack()
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = image, "Closest"
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Color"])
    make_plane(size=4.0, material=material)
    glow, emission = make_material("glow", "ShaderNodeEmission")
    emission.inputs["Color"].default_value = (0.9, 0.3, 0.1, 1.0)
    make_plane("glow", size=0.5, material=glow).location = (1.0, 1.0, 0.5)
    make_light("POINT", 100.0, (0.0, 0.0, 2.0)).data.color = (1.0, 0.4, 0.2)
    make_camera()
    lights = make_plane("lights", size=3.9)
    lights.location.z = -0.1
    lights["vlm_schema"] = 1
    lights.hide_render = True
    attribute = lights.data.attributes.new("vlm_color", "FLOAT_COLOR", "FACE")
    attribute.data.foreach_set("color", np.array([0.8, 0.2, 0.05, 1.0], np.float32))


def test_blender_4_and_files_of_rec709_need_no_conversion():
    assert np.array_equal(working_to_rec709(), np.eye(3))
    colors = np.array([[0.1, 0.2, 0.3]], np.float32)
    assert convert(colors, working_to_rec709()) is colors


@newer
def test_white_stays_white_and_the_way_back_is_the_inverse(other_space):
    other_space()
    white = np.ones(3)
    assert working_to_rec709() @ white == pytest.approx(white, abs=1e-3)
    assert working_to_rec709() @ rec709_to_working() == pytest.approx(np.eye(3), abs=1e-12)
    assert not np.allclose(working_to_rec709(), np.eye(3), atol=0.01)


@newer
def test_a_scene_keeps_its_colours(room, other_space):
    before = extract()
    other_space()
    after = extract()
    for old, new in zip(before.snapshot.lights, after.snapshot.lights, strict=True):
        assert new.power == pytest.approx(old.power, rel=1e-3)
    for old, new in zip(before.snapshot.materials, after.snapshot.materials, strict=True):
        assert (new.base_color, new.emission) == (
            pytest.approx(old.base_color, rel=1e-3, abs=1e-5),
            pytest.approx(old.emission, rel=1e-3, abs=1e-5),
        )
    for old, new in zip(before.snapshot.textures, after.snapshot.textures, strict=True):
        assert new.pixels == pytest.approx(old.pixels, rel=1e-3, abs=1e-5)


@newer
@pytest.mark.skipif(bpy.app.version >= (5, 1), reason="Blender 5.2 leaves colour attributes as they are")
def test_a_light_mesh_keeps_its_colours(room, other_space):
    before = extract().light_mesh
    other_space()
    assert extract().light_mesh.colour == pytest.approx(before.colour, rel=1e-3, abs=1e-4)


@newer
def test_references_are_in_rec709(room, other_space):
    before = render_reference(8, 8, 0, 16).images
    other_space()
    after = render_reference(8, 8, 0, 16).images
    # Lit colours are products, which are not the same in every space.
    for name in ("diffuse_color", "emission"):
        assert after[name] == pytest.approx(before[name], rel=0.01, abs=1e-3), name


@newer
def test_light_meshes_are_written_in_the_files_space(room, other_space):
    light_mesh = extract().light_mesh
    other_space()
    bpy.data.objects.remove(bpy.data.objects["lights"])
    write_light_mesh(light_mesh, "written")
    assert extract().light_mesh.colour == pytest.approx(light_mesh.colour, rel=1e-3, abs=1e-4)


@newer
def test_png_shows_the_same_in_every_space(tmp_path, other_space, scene):
    scene.view_settings.view_transform = "Standard"
    picture = np.random.default_rng(1).random((4, 4, 3)).astype(np.float32)
    write_image(tmp_path / "before.png", picture)
    other_space()
    scene.view_settings.view_transform = "Standard"
    write_image(tmp_path / "after.png", picture)
    found = [np.array(bpy.data.images.load(str(tmp_path / f"{name}.png")).pixels[:]) for name in ("before", "after")]
    assert found[1] == pytest.approx(found[0], abs=1.01 / 255)


@pytest.mark.parametrize(("encoded", "linear"), [(0.0, 0.0), (0.04045, 0.0031308), (0.5, 0.2140411), (1.0, 1.0)])
def test_srgb_is_decoded_as_the_standard_says(encoded, linear):
    assert srgb_to_linear(np.float64(encoded)) == pytest.approx(linear, rel=1e-4)


def test_what_rec709_cannot_show_is_cut_at_zero_and_what_was_negative_stays():
    matrix = np.array([[1.66, -0.59, -0.07], [-0.12, 1.13, -0.01], [-0.02, -0.10, 1.12]])
    colors = np.array([[0.1, 0.8, 0.1], [0.5, 0.5, 0.5], [-0.2, 0.1, 0.1]], np.float32)
    cut = into_rec709(colors, matrix)
    assert (cut[:2] >= 0.0).all()
    assert cut[1] == pytest.approx(convert(colors, matrix)[1])
    assert cut[2, 0] < 0.0
    assert into_rec709(colors, np.eye(3)) is colors
