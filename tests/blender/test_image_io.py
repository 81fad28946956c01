# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures on disk: EXR keeps every bit, PNG is what the scene's view transform shows."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.image_io import LOCAL_VIEW, read_image, require_view, view_transforms, write_display, write_image
from vlm_addon.core.errors import InvalidInput


def srgb(linear):
    clipped = np.clip(linear, 0.0, 1.0)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)


def picture(channels=3, height=5, width=7):
    return np.random.default_rng(4).random((height, width, channels)).astype(np.float32)


def loaded(path):
    """(h, w, 4) float32 in [0, 1] as stored in a PNG, row 0 at the top."""
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "CHANNEL_PACKED"
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, 4)[::-1]


@pytest.fixture
def standard(scene):
    """The scene shows plain sRGB."""
    scene.view_settings.view_transform = "Standard"
    return scene


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_exr_keeps_every_bit(tmp_path, channels):
    image = picture(channels) * np.float32(1e6) - np.float32(10.0)
    write_image(tmp_path / "picture.exr", image)
    assert np.array_equal(read_image(tmp_path / "picture.exr"), image)


def test_blender_reads_our_exr(tmp_path):
    image = picture(height=40, width=33)
    write_image(tmp_path / "picture.exr", image)
    found = bpy.data.images.load(str(tmp_path / "picture.exr"))
    pixels = np.array(found.pixels[:], np.float32).reshape(40, 33, 4)[::-1]
    assert np.array_equal(pixels[..., :3], image)


def test_png_is_the_view_of_the_scene(tmp_path, standard):
    image = picture() * np.float32(1.5)
    write_image(tmp_path / "picture.png", image)
    assert loaded(tmp_path / "picture.png")[..., :3] == pytest.approx(srgb(image), abs=0.51 / 255)


def test_premultiplied_alpha_becomes_straight(tmp_path, standard):
    image = np.full((2, 2, 4), 0.25, np.float32)
    image[..., 3] = 0.5
    write_image(tmp_path / "picture.png", image)
    found = loaded(tmp_path / "picture.png")
    assert found[..., :3] == pytest.approx(np.full((2, 2, 3), srgb(0.5)), abs=0.51 / 255)
    assert found[..., 3] == pytest.approx(np.full((2, 2), 0.5), abs=0.51 / 255)


def test_exposure_and_look_of_the_scene_count(tmp_path, standard):
    standard.view_settings.exposure = 1.0
    write_image(tmp_path / "picture.png", picture() * np.float32(0.4))
    assert loaded(tmp_path / "picture.png")[..., :3] == pytest.approx(srgb(picture() * 0.8), abs=0.51 / 255)


def test_the_default_view_is_that_of_blenders_own_pictures(tmp_path, scene, make_plane, make_material, make_camera):
    """An emissive plane rendered by Cycles to PNG by Blender itself, against our PNG of the same radiance."""
    material, shader = make_material("glow", "ShaderNodeEmission")
    shader.inputs["Color"].default_value = (0.9, 0.3, 0.1, 1.0)
    shader.inputs["Strength"].default_value = 2.0
    make_plane(size=10.0, material=material)
    make_camera()
    render = scene.render
    render.engine, render.filepath, render.dither_intensity = "CYCLES", str(tmp_path / "blender.png"), 0.0
    render.resolution_x = render.resolution_y = 4
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    bpy.ops.render.render(write_still=True)
    write_image(tmp_path / "ours.png", np.full((4, 4, 3), (1.8, 0.6, 0.2), np.float32))
    expected = loaded(tmp_path / "blender.png")[..., :3]
    assert loaded(tmp_path / "ours.png")[..., :3] == pytest.approx(expected, abs=1.01 / 255)


def test_another_view_for_one_picture(tmp_path, scene, file_state):
    assert scene.view_settings.view_transform != "Standard"
    before = file_state()
    write_image(tmp_path / "picture.png", picture(), view="Standard")
    assert loaded(tmp_path / "picture.png")[..., :3] == pytest.approx(srgb(picture()), abs=0.51 / 255)
    bpy.data.images.remove(bpy.data.images["picture.png"])
    assert file_state() == before


def test_an_unknown_view_lists_those_there_are(tmp_path, file_state):
    before = file_state()
    with pytest.raises(InvalidInput, match=r"view transform 'Nope': .*Standard, .*AgX"):
        write_image(tmp_path / "picture.png", picture(), view="Nope")
    assert file_state() == before
    assert not list(tmp_path.iterdir())
    assert "Standard" in view_transforms()


@pytest.mark.parametrize("name", ["picture.jpg", "picture", "picture.exr.bak"])
def test_other_formats_are_refused(tmp_path, name):
    with pytest.raises(InvalidInput, match=r"end the name in .exr or .png"):
        write_image(tmp_path / name, picture())


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 2), (0, 4, 3)])
def test_what_is_no_picture_is_refused(tmp_path, shape):
    with pytest.raises(InvalidInput, match="it is not a picture"):
        write_image(tmp_path / "picture.exr", np.zeros(shape, np.float32))


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InvalidInput, match="it cannot be written"):
        write_image(tmp_path / "missing" / "picture.exr", picture())


def test_a_display_picture_is_stored_whatever_the_views_settings(tmp_path, scene, file_state):
    scene.view_settings.exposure, scene.view_settings.gamma = 3.0, 2.0
    scene.render.image_settings.file_format = "JPEG"
    scene.render.image_settings.color_mode = "BW"
    before = file_state()
    image = picture(4)
    image[..., 3] = 1.0
    write_display(tmp_path / "picture.png", image)
    assert file_state() == before
    assert loaded(tmp_path / "picture.png")[..., :3] == pytest.approx(srgb(image[..., :3]), abs=0.51 / 255)


def test_a_display_pictures_alpha_becomes_straight(tmp_path, scene):
    image = np.zeros((2, 3, 4), np.float32)
    image[:, :2] = 0.25
    image[:, :2, 3] = 0.5
    write_display(tmp_path / "picture.png", image)
    found = loaded(tmp_path / "picture.png")
    assert found[:, :2, :3] == pytest.approx(np.full((2, 2, 3), srgb(0.5)), abs=0.51 / 255)
    assert found[:, :2, 3] == pytest.approx(np.full((2, 2), 0.5), abs=0.51 / 255)
    assert not found[:, 2].any()


def test_a_display_picture_that_cannot_be_written_is_named(tmp_path, scene, file_state):
    before = file_state()
    with pytest.raises(InvalidInput, match="it cannot be written"):
        write_display(tmp_path / "missing" / "picture.png", picture(4))
    assert file_state() == before


def test_the_local_operator_is_a_view_by_name(scene):
    require_view(LOCAL_VIEW)
    require_view("Standard")
    with pytest.raises(InvalidInput, match=r"view transform 'Local': .*Standard, .*AgX.*, or local"):
        require_view("Local")
