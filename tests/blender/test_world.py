# SPDX-License-Identifier: GPL-3.0-or-later
"""The world as a light and as the background, by our renderer and by Cycles."""

import math

import bpy
import numpy as np
import pytest

from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.extract import extract_scene, require_lights
from vlm_addon.core.environment import map_directions, map_solid_angles
from vlm_addon.core.settings import from_mapping
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
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
    "about all": {"rotation": (0.4, -0.9, 2.0)},
    "as a texture": {"rotation": (0.4, -0.9, 2.0), "vector_type": "TEXTURE"},
    "scaled": {"rotation": (0.0, 0.3, 0.0), "scale": (2.0, 2.0, 2.0)},
}


VIEWS = [("about all", "PERSP"), ("as a texture", "PERSP"), ("scaled", "ORTHO")]


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


def sun_picture(height=64, width=128):
    """(h, w, 3): a blue sky above brown ground, and a sun of a few degrees with about half of the light."""
    directions = map_directions(height, width)
    above = np.clip(directions[..., 2:], 0.0, 1.0)
    even = np.where(directions[..., 2:] > 0.0, (0.3, 0.5, 0.9) * (0.4 + 0.6 * above), (0.2, 0.15, 0.1))
    towards_sun = directions @ (np.array([0.5, -0.4, 0.8]) / np.linalg.norm([0.5, -0.4, 0.8]))
    return even + 300.0 * np.exp(-600.0 * (1.0 - towards_sun))[..., None] * (1.0, 0.9, 0.7)


@pytest.fixture
def courtyard(make_mesh, make_material, make_camera):
    """A floor, a wall at its end and one at its side, a block on it; diffuse and grey."""
    material, shader = make_material("grey", "ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (0.6, 0.6, 0.6, 1.0)
    make_mesh("floor", [(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)], [(0, 1, 2, 3)], material=material)
    make_mesh("end", [(-3, 3, 0), (3, 3, 0), (3, 3, 3), (-3, 3, 3)], [(0, 1, 2, 3)], material=material)
    make_mesh("side", [(-3, -3, 0), (-3, 3, 0), (-3, 3, 3), (-3, -3, 3)], [(0, 1, 2, 3)], material=material)
    camera = make_camera(location=(0.5, -2.0, 4.5), rotation=(0.55, 0.0, 0.1))
    camera.data.lens = 30.0

    def block():
        corners = [(x, y, z) for x in (0.0, 1.0) for y in (0.5, 1.5) for z in (0.0, 1.2)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3)]
        make_mesh("block", corners, faces, material=material)

    return block


def relative_rmse(ours, reference):
    return math.sqrt(np.mean((ours - reference) ** 2)) / reference.mean()


@pytest.mark.parametrize(("sky", "error"), [("even", 0.08), ("sun", 0.06)])
def test_direct_light_of_the_sky_is_that_of_cycles(device, world, courtyard, sky, error):
    courtyard()
    if sky == "sun":
        add_picture(world, sun_picture(), rotation=(0.0, 0.0, 0.4))
    snapshot = extract_scene()
    settings = RenderSettings(48, 36, "direct", samples=8, shadow_resolution=512)
    ours = device.render(snapshot, None, settings).images["direct"]
    reference = render_reference(48, 36, 0, 128).images["direct"]
    assert reference.mean() > 0.0
    assert ours.mean(axis=(0, 1)) == pytest.approx(reference.mean(axis=(0, 1)), rel=0.015)
    assert relative_rmse(ours, reference) < error


def test_light_of_the_sky_bounces_as_in_cycles(device, world, courtyard):
    """Three walls that do not hide each other: all that differs is where virtual lights measure the sky."""
    add_picture(world, sun_picture())
    snapshot = extract_scene()
    settings = from_mapping(SimplifySettings, {"target_triangles": 150}, "test")
    light_mesh = create_light_mesh(snapshot.meshes, settings).light_mesh
    frame = device.render(snapshot, light_mesh, RenderSettings(48, 36, "vlm", samples=4, shadow_resolution=512))
    reference = render_reference(48, 36, 1, 128).images["indirect"]
    assert frame.images["indirect"].mean(axis=(0, 1)) == pytest.approx(reference.mean(axis=(0, 1)), rel=0.03)


def test_shaders_may_be_added_and_mixed(device, world, make_camera):
    """(2 x even + 3/4 picture + 1/4 of another) as Cycles shows it; an emission shader is a background, too."""
    make_camera(rotation=(1.1, 0.4, 0.8))
    nodes, links = nodes_of(world), world.node_tree.links
    add_picture(world, smooth_picture())
    output = next(node for node in nodes if node.type == "OUTPUT_WORLD")
    mix, add = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeAddShader")
    glow, even = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeBackground")
    glow.inputs["Color"].default_value, glow.inputs["Strength"].default_value = (0.1, 0.4, 0.2, 1.0), 2.0
    even.inputs["Color"].default_value, even.inputs["Strength"].default_value = (0.3, 0.2, 0.1, 1.0), 2.0
    mix.inputs[0].default_value = 0.25
    links.new(background(world).outputs[0], mix.inputs[1])
    links.new(glow.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], add.inputs[0])
    links.new(even.outputs[0], add.inputs[1])
    links.new(add.outputs[0], output.inputs["Surface"])
    snapshot = extract_scene()
    assert problems(snapshot) == []
    ours = device.render(snapshot, None, RenderSettings(WIDTH, HEIGHT, "direct", samples=4)).images["combined"]
    assert ours[..., :3] == pytest.approx(render_reference(WIDTH, HEIGHT, 0, 16).images["combined"], abs=0.02)


def test_a_light_path_is_read_as_for_light_on_surfaces(world):
    nodes, links = nodes_of(world), world.node_tree.links
    mix, shown, path = (nodes.new(f"ShaderNode{name}") for name in ("MixShader", "Background", "LightPath"))
    background(world).inputs["Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    shown.inputs["Color"].default_value = (1.0, 0.0, 0.0, 1.0)
    links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    links.new(background(world).outputs[0], mix.inputs[1])
    links.new(shown.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], next(node for node in nodes if node.type == "OUTPUT_WORLD").inputs["Surface"])
    snapshot = extract_scene()
    assert snapshot.world_radiance == pytest.approx((0.1, 0.2, 0.3))
    (problem,) = problems(snapshot)
    assert "'Light Path'" in problem


def test_what_is_not_simulated_is_named(world):
    texture = nodes_of(world).new("ShaderNodeTexSky")
    world.node_tree.links.new(texture.outputs["Color"], background(world).inputs["Color"])
    (problem,) = problems(extract_scene())
    assert problem.startswith("world 'sky', node 'Sky Texture': Sky Texture is not simulated")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda texture: setattr(texture, "projection", "MIRROR_BALL"), "mirror ball projection is not simulated"),
        (lambda texture: setattr(texture, "image", None), "the node has no image"),
    ],
)
def test_a_texture_that_cannot_be_shown_is_named(world, change, text):
    change(add_picture(world, smooth_picture()))
    (problem,) = problems(extract_scene())
    assert problem.startswith("world 'sky', node 'Environment Texture'")
    assert text in problem


@pytest.mark.parametrize("values", [{"scale": (1.0, 1.0, -1.0)}, {"scale": (1.0, 2.0, 1.0)}, {"location": (0.5, 0, 0)}])
def test_a_mapping_that_is_no_turn_is_named(world, values):
    add_picture(world, smooth_picture(), **values)
    (problem,) = problems(extract_scene())
    assert problem.startswith("world 'sky', node 'Mapping': only turns of a world are simulated")


def test_broken_texels_are_cleaned_and_counted(world):
    radiance = smooth_picture()
    radiance[10, 10, 0], radiance[20, 20] = np.nan, np.inf
    radiance[30, 30] = -1.0
    add_picture(world, radiance)
    snapshot = extract_scene()
    (problem,) = problems(snapshot)
    assert "from 3 texels" in problem
    found = snapshot.environment.radiance
    assert found[10, 10, 0] == 0.0
    assert found[20, 20] == pytest.approx(np.nanmax(np.where(np.isfinite(radiance), radiance, 0.0)))
    assert not found[30, 30].any()
    assert world_lights(snapshot.world_radiance, snapshot.environment, 16)


def test_a_large_picture_keeps_its_light(world):
    height, width = 30, 4100
    radiance = np.random.default_rng(0).uniform(0.0, 2.0, (height, width, 3))
    add_picture(world, radiance)
    found = extract_scene().environment.radiance
    assert found.shape[1] == 2048
    before = map_solid_angles(height, width) @ radiance.sum(axis=1)
    assert map_solid_angles(*found.shape[:2]) @ found.sum(axis=1) == pytest.approx(before, rel=1e-5)


def test_a_world_is_light_enough(world, make_plane):
    make_plane()
    assert require_lights(extract_scene()) == ()


def test_a_scene_without_a_world_is_black(scene, make_plane):
    scene.world = None
    make_plane()
    snapshot = extract_scene()
    assert snapshot.world_radiance == (0.0, 0.0, 0.0)
    assert snapshot.environment is None
