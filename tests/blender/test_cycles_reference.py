# SPDX-License-Identifier: GPL-3.0-or-later
"""References hold the number of bounces that they claim: a closed sphere has the series in closed form."""

import bmesh
import bpy
import numpy as np
import pytest

from vlm_addon.blender.cycles_reference import CONVERGED_BOUNCES, render_reference
from vlm_addon.core.errors import InvalidInput

ALBEDO = 0.5
SIZE = 8


@pytest.fixture
def sphere(make_material, make_light, make_camera):
    """A matt sphere of radius 1 with a lamp in its centre: E is uniform and each bounce adds its share evenly."""
    material, shader = make_material("wall", "ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (ALBEDO, ALBEDO, ALBEDO, 1.0)
    mesh = bpy.data.meshes.new("sphere")
    builder = bmesh.new()
    bmesh.ops.create_icosphere(builder, subdivisions=5, radius=1.0)
    bmesh.ops.reverse_faces(builder, faces=builder.faces)
    builder.to_mesh(mesh)
    builder.free()
    mesh.materials.append(material)
    blender_object = bpy.data.objects.new("sphere", mesh)
    bpy.context.scene.collection.objects.link(blender_object)
    make_light("POINT", 10.0).data.shadow_soft_size = 0.0
    make_camera(location=(0.0, 0.0, 0.5))
    return blender_object


@pytest.mark.parametrize(("bounces", "share"), [(0, 0.0), (1, ALBEDO), (2, ALBEDO + ALBEDO**2)])
def test_each_diffuse_bounce_adds_its_albedo(sphere, bounces, share):
    images = render_reference(SIZE, SIZE, bounces, 32).images
    assert images["indirect"].mean() == pytest.approx(share * images["direct"].mean(), rel=0.01, abs=1e-7)


def test_a_converged_reference_is_the_sum_of_the_series(sphere):
    images = render_reference(SIZE, SIZE, CONVERGED_BOUNCES, 32).images
    total = images["direct"].mean() / (1.0 - ALBEDO)
    assert images["combined"].mean() == pytest.approx(total, rel=0.01)


def test_direct_light_is_that_of_blenders_watts(sphere):
    # A point lamp of P watts has the intensity P / (4 pi), so E is P / (4 pi) at a distance of 1.
    images = render_reference(SIZE, SIZE, 0, 16).images
    irradiance = 10.0 / (4.0 * np.pi)
    assert images["direct"].mean() == pytest.approx(ALBEDO / np.pi * irradiance, rel=0.01)


def test_pictures_have_the_top_row_first(make_plane, make_material, make_camera):
    material, _ = make_material("glow", "ShaderNodeEmission")
    plane = make_plane(size=10.0, material=material)
    plane.location = (0.0, 5.0, 0.0)
    make_camera()
    emission = render_reference(4, 4, 0, 2).images["emission"]
    assert emission[0].mean() == pytest.approx(1.0)
    assert emission[-1].mean() == pytest.approx(0.0)


def test_noise_is_that_of_the_picture(make_plane, make_material, make_light, make_camera):
    material, _ = make_material("wall", "ShaderNodeBsdfDiffuse")
    make_plane(size=10.0, material=material)
    make_light("POINT", 100.0, (0.0, 0.0, 2.0)).data.shadow_soft_size = 1.5
    make_camera()
    truth = render_reference(16, 16, 0, 1024).images["direct"].astype(np.float64)
    noisy = render_reference(16, 16, 0, 8, seed=5)
    error = np.sqrt(np.mean((noisy.images["direct"] - truth) ** 2)) / truth.mean()
    assert noisy.noise["direct"] == pytest.approx(error, rel=0.3)


def test_every_setting_is_as_before(sphere, scene, file_state):
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.filepath = "//somewhere"
    scene.view_layers.new("other")
    before = file_state()
    render_reference(4, 4, 1, 2)
    assert file_state() == before


def test_light_meshes_are_not_in_the_picture(sphere, make_plane, make_material, scene):
    material, _ = make_material("glow", "ShaderNodeEmission")
    plane = make_plane(material=material)
    plane.location = (0.0, 0.0, -0.5)
    plane["vlm_schema"] = 1
    assert render_reference(4, 4, 0, 2).images["emission"].max() == 0.0
    assert not plane.hide_render


@pytest.mark.parametrize(
    ("arguments", "text"),
    [((0, 4, 1, 2), "size 0x4"), ((4, 4, -1, 2), "diffuse bounces -1"), ((4, 4, 1, 1), "samples 1")],
)
def test_values_out_of_range_are_named(sphere, arguments, text):
    with pytest.raises(InvalidInput, match=text):
        render_reference(*arguments)


def test_a_scene_without_camera_says_so(make_plane):
    make_plane()
    with pytest.raises(InvalidInput, match="no camera"):
        render_reference(4, 4, 1, 2)
