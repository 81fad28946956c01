# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps, camera and world of the snapshot mean what Blender means by them."""

import math

import bpy
import numpy as np
import pytest

from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.extract import extract_scene, require_camera, require_lights, require_surfaces
from vlm_addon.core.errors import InvalidInput

HAS_EXPOSURE = "exposure" in bpy.types.Light.bl_rna.properties
newer = pytest.mark.skipif(
    not HAS_EXPOSURE, reason="this Blender has no exposure, temperature and normalisation of lamps"
)


def only_light():
    snapshot = extract_scene()
    assert not snapshot.findings, [str(finding) for finding in snapshot.findings]
    (light,) = snapshot.lights
    return light


@pytest.fixture
def lit_floor(make_plane, make_material, make_camera):
    """A white floor seen from above, to measure lamps by."""
    material, shader = make_material("white", "ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    make_plane(size=20.0, material=material)
    make_camera(location=(0.0, 0.0, 5.0))


def floor_radiance():
    return render_reference(8, 8, 0, 256).images["direct"].astype(np.float64).mean(axis=(0, 1))


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "SUN", "AREA"])
def test_every_kind_of_lamp_keeps_its_place_and_colour(make_light, kind):
    lamp = make_light(kind, 12.0, (1.0, 2.0, 3.0))
    lamp.data.color = (1.0, 0.5, 0.25)
    lamp.rotation_euler = (math.pi / 2, 0.0, 0.0)
    light = only_light()
    assert light.kind == kind
    assert light.power == pytest.approx((12.0, 6.0, 3.0))
    assert light.position == (1.0, 2.0, 3.0)
    assert light.z_axis == pytest.approx((0.0, -1.0, 0.0), abs=1e-6)


def test_a_spot_has_its_cone(make_light):
    lamp = make_light("SPOT").data
    lamp.spot_size, lamp.spot_blend, lamp.shadow_soft_size = 1.2, 0.3, 0.05
    light = only_light()
    assert (light.spot_angle, light.spot_blend, light.radius) == pytest.approx((1.2, 0.3, 0.05))


def test_a_squashed_spot_has_its_scale(make_light):
    make_light("SPOT").scale = (0.5, 2.0, 4.0)
    assert only_light().spot_scale == pytest.approx((0.125, 0.5))


def test_a_sun_has_its_angle(make_light):
    make_light("SUN").data.angle = 0.1
    assert only_light().angle == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("shape", "expected", "size_y"),
    [
        ("SQUARE", "RECTANGLE", 2.0),
        ("RECTANGLE", "RECTANGLE", 3.0),
        ("DISK", "ELLIPSE", 2.0),
        ("ELLIPSE", "ELLIPSE", 3.0),
    ],
)
def test_an_area_light_has_its_scaled_size(make_light, shape, expected, size_y):
    lamp = make_light("AREA")
    lamp.data.shape = shape
    lamp.data.size = 2.0
    if shape in ("RECTANGLE", "ELLIPSE"):
        lamp.data.size_y = 3.0
    lamp.scale = (0.5, 0.25, 7.0)
    light = only_light()
    assert light.shape == expected
    assert (light.size_x, light.size_y) == pytest.approx((1.0, size_y * 0.25))


@newer
@pytest.mark.parametrize("kind", ["POINT", "SPOT", "SUN", "AREA"])
def test_exposure_and_temperature_are_those_of_cycles(lit_floor, make_light, kind):
    lamp = make_light(kind, 10.0, (0.0, 0.0, 2.0)).data
    plain = floor_radiance()
    lamp.exposure, lamp.use_temperature, lamp.temperature = 1.5, True, 3000.0
    assert floor_radiance() / plain * 10.0 == pytest.approx(only_light().power, rel=0.02)


UNNORMALIZED = [
    ("POINT", {"shadow_soft_size": 0.4}),
    ("SPOT", {"shadow_soft_size": 0.4}),
    ("SUN", {"angle": 0.5}),
    ("AREA", {"shape": "SQUARE", "size": 0.5}),
    ("AREA", {"shape": "ELLIPSE", "size": 0.5, "size_y": 0.8}),
]


@newer
@pytest.mark.parametrize(("kind", "settings"), UNNORMALIZED)
def test_a_strength_that_is_not_normalised_is_that_of_cycles(lit_floor, make_light, kind, settings):
    lamp_object = make_light(kind, 10.0, (0.0, 0.0, 3.0))
    lamp_object.scale = (1.0, 2.0, 1.0)
    for name, value in settings.items():
        setattr(lamp_object.data, name, value)
    plain = floor_radiance()
    lamp_object.data.normalize = False
    assert floor_radiance() / plain * 10.0 == pytest.approx(only_light().power, rel=0.02)


def test_nodes_of_a_lamp_multiply_its_power(lit_floor, make_light):
    lamp = make_light("POINT", 10.0, (0.0, 0.0, 3.0)).data
    lamp.color = (1.0, 0.5, 1.0)
    plain = floor_radiance() / np.array(only_light().power)
    lamp.use_nodes = True
    emission = next(node for node in lamp.node_tree.nodes if node.type == "EMISSION")
    emission.inputs["Color"].default_value = (0.5, 1.0, 0.25, 1.0)
    emission.inputs["Strength"].default_value = 3.0
    assert only_light().power == pytest.approx(floor_radiance() / plain, rel=0.02)


def test_lamps_in_instances_and_hidden_lamps(make_light, scene):
    collection = bpy.data.collections.new("chandelier")
    lamp = make_light("POINT")
    collection.objects.link(lamp)
    scene.collection.objects.unlink(lamp)
    make_light("SUN", name="hidden").hide_render = True
    for x in (1.0, 2.0):
        instancer = bpy.data.objects.new("at", None)
        instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
        instancer.location.x = x
        scene.collection.objects.link(instancer)
    assert [light.position[0] for light in extract_scene().lights] == [1.0, 2.0]


def test_what_a_lamp_does_that_is_not_simulated_is_listed(make_light):
    lamp = make_light("AREA")
    lamp.data.spread = 1.0
    lamp.data.diffuse_factor = 0.5
    lamp.visible_diffuse = False
    problems = " ".join(finding.problem for finding in extract_scene().findings)
    for text in ("spread of 57 degrees", "diffuse, glossy", "ray visibility"):
        assert text in problems


def test_a_portal_is_no_light(make_light):
    make_light("AREA").data.cycles.is_portal = True
    assert not extract_scene().lights


CAMERAS = [
    {},
    {"shift_x": 0.3, "shift_y": -0.2},
    {"sensor_fit": "VERTICAL", "sensor_height": 30.0},
    {"sensor_fit": "HORIZONTAL", "lens": 20.0},
    {"type": "ORTHO", "ortho_scale": 3.0, "shift_x": 0.25},
]


@pytest.mark.parametrize("settings", CAMERAS)
@pytest.mark.parametrize("size", [(30, 20), (20, 30)])
@pytest.mark.parametrize("aspect", [(1.0, 1.0), (1.0, 2.0)])
def test_the_camera_frames_what_blenders_does(make_camera, scene, settings, size, aspect):
    camera_object = make_camera((1.0, 2.0, 3.0), (0.4, 0.5, 0.6))
    for name, value in settings.items():
        setattr(camera_object.data, name, value)
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    camera = require_camera(extract_scene())
    left, right, bottom, top = camera.frame(*size)
    corners = np.array([corner[:] for corner in camera_object.data.view_frame(scene=scene)])
    # Blender gives the frame at a distance that it does not divide out.
    depth = 1.0 if camera.kind == "ORTHOGRAPHIC" else -corners[:, 2:]
    expected = corners[:, :2] / depth
    assert expected.min(axis=0) == pytest.approx([left, bottom], abs=1e-6)
    assert expected.max(axis=0) == pytest.approx([right, top], abs=1e-6)
    assert camera.matrix_world == pytest.approx(np.array(camera_object.matrix_world))


def test_the_cameras_matrix_is_rigid(make_camera):
    make_camera((1.0, 2.0, 3.0)).scale = (2.0, 3.0, 4.0)
    matrix = require_camera(extract_scene()).matrix_world
    assert matrix[:3, :3] == pytest.approx(np.eye(3))
    assert matrix[:3, 3] == pytest.approx((1.0, 2.0, 3.0))


def test_a_panoramic_camera_is_no_camera(make_camera):
    make_camera().data.type = "PANO"
    snapshot = extract_scene()
    assert "PANO" in snapshot.findings[0].problem
    with pytest.raises(InvalidInput, match="no perspective or orthographic camera"):
        require_camera(snapshot)


def test_an_empty_scene_says_what_it_lacks(scene):
    snapshot = extract_scene()
    for require, text in (
        (require_camera, "camera"),
        (require_lights, "nothing in it sends out light"),
        (require_surfaces, "no visible object"),
    ):
        with pytest.raises(InvalidInput, match=f"scene 'Scene': .*{text}"):
            require(snapshot)
    assert scene.camera is None


def test_an_emissive_surface_is_light_enough(make_plane, make_material):
    make_plane(material=make_material("glow", "ShaderNodeEmission")[0])
    assert require_lights(extract_scene()) == ()


def test_an_even_world_has_the_radiance_of_its_node(scene, make_plane, make_camera):
    scene.world = bpy.data.worlds.new("sky")
    if bpy.app.version < (5, 0):
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.1, 0.2, 0.4, 1.0)
    background.inputs["Strength"].default_value = 2.0
    make_camera()
    snapshot = extract_scene()
    assert snapshot.world_radiance == pytest.approx(render_reference(2, 2, 0, 2).images["combined"][0, 0])
    assert snapshot.environment is None
    assert snapshot.findings == ()


def test_negative_light_counts_as_none_and_is_told(make_plane, make_light):
    make_plane()
    lamp = make_light("POINT", -12.0, (1.0, 2.0, 3.0))
    snapshot = extract_scene()
    assert [light.power for light in snapshot.lights] == [(0.0, 0.0, 0.0)]
    (finding,) = snapshot.findings
    assert lamp.name in finding.subject
    assert "-12" in finding.problem
