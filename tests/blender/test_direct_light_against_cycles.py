# SPDX-License-Identifier: GPL-3.0-or-later
"""Units of every kind of lamp: an unshadowed plane by our renderer and by Cycles without bounces."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Vector

from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings

WIDTH, HEIGHT = 64, 48
RECTANGLE = {"shape": "RECTANGLE", "size": 1.0, "size_y": 0.4}
ELLIPSE = {"shape": "ELLIPSE", "size": 1.0, "size_y": 0.4}

# name: type, energy, location, values, scale of the object
LAMPS = {
    "point": ("POINT", 100.0, (0.5, 0.0, 1.5), {"shadow_soft_size": 0.0}, (1, 1, 1)),
    "near point": ("POINT", 100.0, (0.5, 0.0, 0.3), {"shadow_soft_size": 0.0}, (1, 1, 1)),
    "soft point": ("POINT", 100.0, (0.5, 0.0, 1.0), {"shadow_soft_size": 0.4}, (1, 1, 1)),
    "ball": ("POINT", 100.0, (0.5, 0.0, 1.0), {"shadow_soft_size": 0.4, "use_soft_falloff": False}, (1, 1, 1)),
    "spot": ("SPOT", 100.0, (2.0, 0.0, 2.5), {"shadow_soft_size": 0.0, "spot_size": 1.8, "spot_blend": 1.0}, (1, 1, 1)),
    "wide spot": (
        "SPOT",
        100.0,
        (0.0, 0.0, 1.5),
        {"shadow_soft_size": 0.0, "spot_size": 3.0, "spot_blend": 0.5},
        (1, 1, 1),
    ),
    "squashed spot": (
        "SPOT",
        100.0,
        (2.0, 0.0, 2.5),
        {"shadow_soft_size": 0.0, "spot_size": 1.8, "spot_blend": 1.0},
        (1.5, 0.7, 1.0),
    ),
    "sun": ("SUN", 2.0, (1.0, 1.0, 2.0), {"angle": 0.0}, (1, 1, 1)),
    "soft sun": ("SUN", 2.0, (3.0, 1.0, 2.0), {"angle": math.radians(40.0)}, (1, 1, 1)),
    "rectangle": ("AREA", 100.0, (0.5, 0.0, 1.0), RECTANGLE, (1, 1, 1)),
    "scaled rectangle": ("AREA", 100.0, (0.5, 0.0, 1.0), RECTANGLE, (0.5, 2.0, 1.0)),
    "ellipse": ("AREA", 100.0, (0.5, 0.5, 0.7), ELLIPSE, (1, 1, 1)),
}


@pytest.fixture(scope="module")
def device():
    with Device() as opened:
        yield opened


def _aim(blender_object, target):
    direction = Vector(target) - blender_object.location
    blender_object.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()


def _link(name, data, location):
    blender_object = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(blender_object)
    blender_object.location = location
    _aim(blender_object, (0.0, 0.0, 0.0))
    return blender_object


def _material(shader_type):
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    shader, output = nodes.new(shader_type), nodes.new("ShaderNodeOutputMaterial")
    shader.inputs[0].default_value = (0.8, 0.6, 0.4, 1.0)
    material.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


DIFFUSE, PRINCIPLED = "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfPrincipled"
CASES = [*((name, DIFFUSE) for name in LAMPS), *((name, PRINCIPLED) for name in ("point", "sun", "rectangle"))]


@pytest.mark.parametrize(("name", "shader_type"), CASES)
def test_lamp_on_a_plane(device, make_plane, name, shader_type):
    kind, energy, location, values, scale = LAMPS[name]
    plane = make_plane(size=8.0)
    plane.data.materials.append(_material(shader_type))
    lamp = bpy.data.lights.new("lamp", kind)
    lamp.energy = energy
    for key, value in values.items():
        setattr(lamp, key, value)
    _link("lamp", lamp, location).scale = scale
    camera = bpy.data.cameras.new("camera")
    # The plane fills the picture: its edges are not what is measured here.
    camera.lens = 60.0
    bpy.context.scene.camera = _link("camera", camera, (0.0, -5.0, 4.0))
    snapshot = extract_scene()
    settings = RenderSettings(WIDTH, HEIGHT, "direct", samples=16, shadow_resolution=128, shadow_samples=16)
    ours = device.render(snapshot, None, settings).images["direct"].mean(axis=2)
    cycles = render_reference(WIDTH, HEIGHT, 0, 64).images["combined"].mean(axis=2)
    counted = cycles > 0.01 * cycles.mean()
    errors = np.abs(ours - cycles)[counted] / cycles[counted]
    assert counted.mean() > 0.1
    assert np.median(errors) < 0.005
    assert errors.mean() < 0.015
    assert ours.sum() == pytest.approx(cycles.sum(), rel=5e-3)
