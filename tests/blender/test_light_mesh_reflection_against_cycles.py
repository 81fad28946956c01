# SPDX-License-Identifier: GPL-3.0-or-later
"""A glossy floor under a glowing polygon: by linearly transformed cosines and by Cycles."""

import bpy
import numpy as np
import pytest
from mathutils import Vector

from tests.render.glossy_pixels import GlossyPixels, reflection
from tests.render.rooms import lights_from_triangles
from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.core.brdf import lookup_albedo
from vlm_addon.render.device import Device

WIDTH, HEIGHT = 64, 48
RADIANCE = 2.0
SINGLE, MULTIPLE = "GGX", "MULTI_GGX"
# It leans over the far end of the floor: what the eye sees ranges from its mirror image to far away from that.
CORNERS = ((-1.0, 1.5, 0.3), (-0.7, 1.2, 1.6), (0.8, 1.4, 1.9), (1.2, 1.6, 0.2))


@pytest.fixture(scope="module")
def device():
    with Device() as opened:
        yield opened


def principled(name, **values):
    """A material, and its Principled node with input values set."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    node = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    for key, value in values.items():
        node.inputs[key].default_value = value
    return material, node


def build(make_mesh, distribution, corners, height, **values):
    """The scene; returns its camera as extracted."""
    floor, node = principled("floor", **values)
    node.distribution = distribution
    make_mesh("floor", [(-2, -2, 0), (2, -2, 0), (2, 1, 0), (-2, 1, 0)], [(0, 1, 2, 3)], material=floor)
    glow, _ = principled(
        "glow", **{"Base Color": (0, 0, 0, 1), "Specular IOR Level": 0.0, "Emission Strength": RADIANCE}
    )
    glow.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1, 1, 1, 1)
    make_mesh("glow", corners, [(0, 1, 2, 3)], material=glow)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.scene.collection.objects.link(camera)
    camera.location = (0.3, -3.5, height)
    camera.data.lens = 60.0
    camera.rotation_euler = (Vector((0.0, -0.4, 0.0)) - camera.location).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = camera
    bpy.context.view_layer.update()
    return extract_scene().camera


def floor_pixels(camera, roughness, metallic, color):
    """The floor where the eye sees it at the middles of pixels, and (h, w) cosines of the eye."""
    pixels = GlossyPixels(np.random.default_rng(0), (WIDTH, HEIGHT), roughness, metallic)
    pixels.camera = camera
    left, right, bottom, top = camera.frame(WIDTH, HEIGHT)
    x = left + (np.arange(WIDTH) + 0.5) * (right - left) / WIDTH
    y = top - (np.arange(HEIGHT) + 0.5) * (top - bottom) / HEIGHT
    rays = np.stack([*np.meshgrid(x, y), np.full((HEIGHT, WIDTH), -1.0)], axis=-1) @ camera.matrix_world[:3, :3].T
    eye = camera.matrix_world[:3, 3]
    places = eye + rays * (-eye[2] / rays[..., 2:])
    inside = (np.abs(places[..., 0]) < 1.95) & (places[..., 1] > -1.95) & (places[..., 1] < 0.95) & (rays[..., 2] < 0)
    pixels.shown[:] = inside
    pixels.positions[:], pixels.normals[:], pixels.tag_ids[:] = places, (0.0, 0.0, 1.0), 0
    pixels.color[:] = color
    return pixels, -(rays / np.linalg.norm(rays, axis=-1, keepdims=True))[..., 2]


def rival_pictures(device, make_mesh, distribution, roughness, metallic, samples, corners=CORNERS, height=1.8):
    """(n,) radiance of the floor's pixels by us and by Cycles, and their cosines of the eye."""
    color = (1, 1, 1, 1) if metallic else (0, 0, 0, 1)
    values = {"Base Color": color, "Roughness": roughness, "Metallic": float(metallic), "IOR": 1.5}
    camera = build(make_mesh, distribution, corners, height, **values)
    pixels, cosines = floor_pixels(camera, roughness, metallic, color[:3])
    cycles = render_reference(WIDTH, HEIGHT, 0, samples, at_centres=True).images["combined"][..., 0]
    corners = np.array(corners, np.float32)
    lights = lights_from_triangles(np.stack([corners[[0, 2, 1]], corners[[0, 3, 2]]]))
    assert (lights.area_vectors @ ([0.0, -2.0, 0.0] - corners.mean(axis=0)) > 0.0).all()
    ours = reflection(device, pixels, lights, np.full((2, 3), RADIANCE * np.pi, np.float32))[..., 0]
    return ours[pixels.shown], cycles[pixels.shown], cosines[pixels.shown]


def relative_rmse(found, truth):
    return float(np.sqrt(((found - truth) ** 2).mean() / (truth**2).mean()))


@pytest.mark.parametrize("roughness", [0.1, 0.2, 0.3, 0.5, 0.7, 1.0])
def test_single_scattering(device, make_mesh, roughness):
    ours, cycles, cosines = rival_pictures(device, make_mesh, SINGLE, roughness, 1, 64)
    # White metal reflects all light after many scatterings: ours has the gain of one over the albedo.
    ours = ours * lookup_albedo(1.5, cosines, roughness)[:, 1]
    assert relative_rmse(ours, cycles) < 0.08
    assert ours.mean() == pytest.approx(cycles.mean(), rel=0.05)


@pytest.mark.parametrize("metallic", [1, 0], ids=["metal", "dielectric"])
@pytest.mark.parametrize("roughness", [0.2, 0.5, 0.8])
def test_blenders_own_distribution(device, make_mesh, roughness, metallic):
    ours, cycles, _ = rival_pictures(device, make_mesh, MULTIPLE, roughness, metallic, 64)
    assert relative_rmse(ours, cycles) < 0.08
