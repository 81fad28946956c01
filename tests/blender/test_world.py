# SPDX-License-Identifier: GPL-3.0-or-later
"""The world as a light and as the background, by our renderer and by Cycles."""

import math

import bpy
import numpy as np
import pytest

from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extract import extract_scene, require_lights
from vlm_addon.core.world_light import world_lights
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings

WIDTH, HEIGHT = 32, 24


@pytest.fixture(scope="module")
def device():
    with Device() as opened:
        yield opened


@pytest.fixture
def world(scene):
    """A world with a Background node alone."""
    made = bpy.data.worlds.new("sky")
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    scene.world = made
    return made


def nodes_of(world):
    return world.node_tree.nodes


def background(world):
    return next(node for node in nodes_of(world) if node.type == "BACKGROUND")


def smooth_picture(height=64, width=128):
    """(h, w, 3): even enough that all agree about what lies between its texels, and alike in no two directions.

    The same at both poles, between which Cycles goes on as it does around.
    """
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    red = 0.6 + 0.5 * np.cos(2 * np.pi * u) * np.sin(np.pi * v)
    green = 0.6 + 0.5 * np.sin(2 * np.pi * u) * np.sin(np.pi * v)
    blue = 0.6 + 0.4 * np.sin(2 * np.pi * v)
    return np.stack([red, green, blue], axis=-1)


def add_picture(world, radiance, **mapping):
    """An environment texture of `radiance` (h, w, 3), through a Mapping node where its values are given."""
    height, width = radiance.shape[:2]
    image = bpy.data.images.new("panorama", width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = radiance
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    texture = nodes_of(world).new("ShaderNodeTexEnvironment")
    texture.image = image
    links = world.node_tree.links
    links.new(texture.outputs["Color"], background(world).inputs["Color"])
    if mapping:
        node = nodes_of(world).new("ShaderNodeMapping")
        node.vector_type = mapping.pop("vector_type", "POINT")
        for name, value in mapping.items():
            node.inputs[name.title()].default_value = value
        coordinates = nodes_of(world).new("ShaderNodeTexCoord")
        links.new(coordinates.outputs["Generated"], node.inputs["Vector"])
        links.new(node.outputs["Vector"], texture.inputs["Vector"])
    return texture


def problems(snapshot):
    return [str(finding) for finding in snapshot.findings]


TURNS = {
    "not turned": {},
    "about z": {"rotation": (0.0, 0.0, 0.7)},
    "about all": {"rotation": (0.4, -0.9, 2.0)},
    "as a texture": {"rotation": (0.4, -0.9, 2.0), "vector_type": "TEXTURE"},
    "scaled": {"rotation": (0.0, 0.3, 0.0), "scale": (2.0, 2.0, 2.0)},
}


VIEWS = [*((name, "PERSP") for name in TURNS), ("about all", "ORTHO")]


@pytest.mark.parametrize(("turn", "kind"), VIEWS)
def test_the_background_shows_where_cycles_shows_it(device, world, make_camera, turn, kind):
    add_picture(world, smooth_picture(), **TURNS[turn])
    background(world).inputs["Strength"].default_value = 2.0
    camera = make_camera(rotation=(1.1, 0.4, 0.8))
    camera.data.type = kind
    camera.data.lens = 12.0
    snapshot = extract_scene()
    assert problems(snapshot) == []
    ours = device.render(snapshot, None, RenderSettings(WIDTH, HEIGHT, "direct", samples=16)).images["combined"]
    cycles = render_reference(WIDTH, HEIGHT, 0, 32).images["combined"]
    assert ours[..., :3] == pytest.approx(cycles, rel=0.01, abs=0.01)
    if kind == "PERSP":
        assert np.ptp(cycles, axis=(0, 1)).min() > 0.3
