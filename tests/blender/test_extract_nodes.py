# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees mean what Cycles makes of them: each graph is rendered by Cycles and compared texel by texel.

The graph feeds an Emission shader on a square that fills an orthographic picture, one texel a pixel.
"""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.core.scene import NO_TEXTURE

SIZE = 8


@pytest.fixture
def picture():
    """picture(name, data, alpha): an image of SIZE x SIZE random texels."""

    def make(name="picture", data=False, alpha=False, seed=1, float_buffer=False):
        generator = np.random.default_rng(seed)
        image = bpy.data.images.new(name, SIZE, SIZE, alpha=alpha, is_data=data, float_buffer=float_buffer)
        texels = generator.integers(0, 256, (SIZE, SIZE, 4)).astype(np.float32) / 255.0
        # Where alpha is small, Cycles loses most of a byte image's colour in rounding.
        texels[..., 3] = 0.5 + 0.5 * texels[..., 3] if alpha else 1.0
        image.pixels.foreach_set(texels.ravel())
        image.pack()
        return image

    return make


@pytest.fixture
def square(make_plane, make_material, make_camera):
    """square(build): a square whose Emission colour is the socket that build(tree) returns; the material's name."""

    def make(build):
        material, shader = make_material("graph", "ShaderNodeEmission")
        socket = build(material.node_tree)
        material.node_tree.links.new(socket, shader.inputs["Color"])
        plane = make_plane(size=2.0, material=material)
        camera = make_camera(location=(0.0, 0.0, 1.0)).data
        camera.type, camera.ortho_scale = "ORTHO", 2.0
        return plane

    return make


def texture(tree, image, output="Color"):
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = image, "Closest"
    return node.outputs[output]


def node(tree, kind, output=0, links=None, values=None, **settings):
    made = tree.nodes.new(kind)
    for name, value in settings.items():
        setattr(made, name, value)
    for name, value in (values or {}).items():
        made.inputs[name].default_value = value
    for name, socket in (links or {}).items():
        tree.links.new(socket, made.inputs[name])
    return made.outputs[output]


def emission_of(snapshot, corner_uvs=True):
    """(SIZE, SIZE, 3), row 0 at the top: radiance of the only material at the centre of each texel."""
    (material,) = snapshot.materials
    radiance = np.broadcast_to(np.array(material.emission, np.float32), (SIZE, SIZE, 3))
    if material.emission_texture == NO_TEXTURE:
        return radiance
    pixels = snapshot.textures[material.emission_texture].pixels
    (mesh,) = snapshot.meshes
    # The texture coordinates of the square are affine: solve for them at the centres of the pixels.
    corners = mesh.positions[mesh.triangles].reshape(-1, 3)[:, :2]
    matrix, *_ = np.linalg.lstsq(np.column_stack([corners, np.ones(6)]), mesh.corner_uvs.reshape(-1, 2), rcond=None)
    centres = (np.arange(SIZE) + 0.5) / SIZE * 2.0 - 1.0
    x, y = np.meshgrid(centres, centres[::-1])
    uv = np.stack([x, y, np.ones_like(x)], axis=-1) @ matrix
    column, row = (np.floor(np.mod(uv, 1.0) * SIZE).astype(int)[..., i] for i in (0, 1))
    return radiance * pixels[row, column, :3]


def assert_as_cycles(expect_findings=False, tolerance=2e-4):
    snapshot = extract_scene()
    assert bool(snapshot.findings) == expect_findings, [str(finding) for finding in snapshot.findings]
    expected = render_reference(SIZE, SIZE, 0, 2).images["emission"]
    assert emission_of(snapshot) == pytest.approx(expected, rel=2e-3, abs=tolerance)
    return snapshot


CONSTANT = (0.2, 0.5, 0.9, 1.0)
OTHER = (0.7, 0.1, 0.4, 1.0)

COLOR_GRAPHS = {
    "image": lambda tree, image: image,
    "gamma": lambda tree, image: node(tree, "ShaderNodeGamma", links={"Color": image}, values={"Gamma": 2.2}),
    "invert": lambda tree, image: node(tree, "ShaderNodeInvert", links={"Color": image}, values={0: 0.7}),
    "contrast": lambda tree, image: node(
        tree, "ShaderNodeBrightContrast", links={"Color": image}, values={1: 0.1, "Contrast": 0.3}
    ),
    "hue": lambda tree, image: node(
        tree,
        "ShaderNodeHueSaturation",
        links={"Color": image},
        values={"Hue": 0.8, "Saturation": 0.6, "Value": 1.3},
    ),
    "full saturation": lambda tree, image: node(
        tree, "ShaderNodeHueSaturation", links={"Color": image}, values={"Saturation": 1.8}
    ),
    "luminance": lambda tree, image: node(tree, "ShaderNodeRGBToBW", links={"Color": image}),
    "red": lambda tree, image: node(tree, "ShaderNodeSeparateColor", links={"Color": image}),
    "blue to red": lambda tree, image: node(
        tree,
        "ShaderNodeCombineColor",
        links={"Red": node(tree, "ShaderNodeSeparateColor", 2, links={"Color": image})},
        values={"Green": 0.25},
    ),
    "ramp": lambda tree, image: node(tree, "ShaderNodeValToRGB", links={0: image}),
    "power": lambda tree, image: node(
        tree, "ShaderNodeMath", links={0: image}, values={1: 1.7}, operation="POWER", use_clamp=True
    ),
    "multiply and add": lambda tree, image: node(
        tree, "ShaderNodeMath", links={0: image}, values={1: 2.0, 2: 0.5}, operation="MULTIPLY_ADD"
    ),
    "greater": lambda tree, image: node(
        tree, "ShaderNodeMath", links={0: image}, values={1: 0.4}, operation="GREATER_THAN"
    ),
    "map range": lambda tree, image: node(
        tree,
        "ShaderNodeMapRange",
        links={0: image},
        values={"From Min": 0.2, "From Max": 0.7, "To Min": 1.0, "To Max": 0.1},
    ),
    "clamp": lambda tree, image: node(tree, "ShaderNodeClamp", links={0: image}, values={"Min": 0.3, "Max": 0.6}),
}


@pytest.mark.parametrize("graph", COLOR_GRAPHS)
def test_nodes_over_an_image(square, picture, graph):
    image = picture()
    square(lambda tree: COLOR_GRAPHS[graph](tree, texture(tree, image)))
    assert_as_cycles()


@pytest.mark.parametrize("graph", [name for name in COLOR_GRAPHS if name != "image"])
def test_nodes_over_a_constant(square, graph):
    def build(tree):
        color = tree.nodes.new("ShaderNodeRGB").outputs[0]
        color.default_value = CONSTANT
        return COLOR_GRAPHS[graph](tree, color)

    square(build)
    assert_as_cycles()


BLENDS = ["MIX", "MULTIPLY", "ADD", "SUBTRACT", "DIVIDE", "DIFFERENCE", "DARKEN", "LIGHTEN", "SCREEN", "OVERLAY"]


@pytest.mark.parametrize("blend", BLENDS)
def test_blend_types(square, picture, blend):
    image = picture()

    def build(tree):
        mix = tree.nodes.new("ShaderNodeMix")
        mix.data_type, mix.blend_type = "RGBA", blend
        factor, a, b = (next(s for s in mix.inputs if s.enabled and s.name == name) for name in ("Factor", "A", "B"))
        factor.default_value, b.default_value = 0.7, OTHER
        tree.links.new(texture(tree, image), a)
        return next(s for s in mix.outputs if s.enabled)

    square(build)
    assert_as_cycles()


def test_two_images_are_mixed_by_a_third(square, picture):
    images = [picture(str(seed), seed=seed) for seed in range(3)]

    def build(tree):
        mix = tree.nodes.new("ShaderNodeMix")
        mix.data_type = "RGBA"
        for image, name in zip(images, ("Factor", "A", "B"), strict=True):
            socket = next(s for s in mix.inputs if s.enabled and s.name == name)
            tree.links.new(texture(tree, image), socket)
        return next(s for s in mix.outputs if s.enabled)

    square(build)
    assert_as_cycles()


def test_data_images_stay_raw(square, picture):
    image = picture(data=True)
    square(lambda tree: texture(tree, image))
    assert_as_cycles()


@pytest.mark.parametrize("float_buffer", [False, True])
@pytest.mark.parametrize("use_alpha", [False, True])
@pytest.mark.parametrize("mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"])
def test_alpha_is_associated_as_in_cycles(square, picture, mode, use_alpha, float_buffer):
    if bpy.app.version >= (5, 2) and mode == ("STRAIGHT" if float_buffer else "PREMUL"):
        pytest.skip("Cycles 5.2 goes by the mode of a packed image, not by what Blender keeps of it")
    image = picture(alpha=True, float_buffer=float_buffer)
    image.alpha_mode = mode

    def build(tree):
        color = texture(tree, image)
        if not use_alpha:
            return color
        # Used, but with no weight: what counts is that the output is linked. (Cycles folds a plain product away.)
        settings = {"values": {1: 0.0, 2: 0.0}, "operation": "MULTIPLY_ADD"}
        alpha = node(tree, "ShaderNodeMath", links={0: color.node.outputs["Alpha"]}, **settings)
        mix = tree.nodes.new("ShaderNodeMix")
        mix.data_type = "RGBA"
        factor, a = (next(s for s in mix.inputs if s.enabled and s.name == name) for name in ("Factor", "A"))
        tree.links.new(alpha, factor)
        tree.links.new(color, a)
        return next(s for s in mix.outputs if s.enabled)

    square(build)
    # Cycles rounds the product of byte images to bytes before it divides by alpha again.
    assert_as_cycles(tolerance=0.02 if use_alpha and not float_buffer else 2e-4)


def test_the_alpha_output_is_a_number(square, picture):
    image = picture(alpha=True)
    square(lambda tree: texture(tree, image, "Alpha"))
    assert_as_cycles()


@pytest.mark.parametrize(("kind", "scale"), [("POINT", 0.5), ("TEXTURE", 2.0)])
def test_mapping_turns_scales_and_moves(square, picture, kind, scale):
    image = picture()

    def build(tree):
        coordinates = node(tree, "ShaderNodeTexCoord", "UV")
        values = {"Location": (0.25, 0.5, 0.0), "Rotation": (0.0, 0.0, np.pi / 2), "Scale": (scale, -1.0, 1.0)}
        mapped = node(tree, "ShaderNodeMapping", links={"Vector": coordinates}, values=values, vector_type=kind)
        color = texture(tree, image)
        tree.links.new(mapped, color.node.inputs["Vector"])
        return color

    square(build)
    assert_as_cycles()


def test_the_named_uv_map_is_used(square, picture):
    image = picture()

    def build(tree):
        color = texture(tree, image)
        tree.links.new(node(tree, "ShaderNodeUVMap", uv_map="turned"), color.node.inputs["Vector"])
        return color

    plane = square(build)
    layer = plane.data.uv_layers.new(name="turned")
    layer.uv.foreach_set("vector", np.array([1, 0, 1, 1, 0, 1, 0, 0], np.float32))
    assert_as_cycles()


def test_groups_reroutes_and_muted_nodes_are_followed(square, picture):
    image = picture()
    group = bpy.data.node_groups.new("group", "ShaderNodeTree")
    group.interface.new_socket("in", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("out", in_out="OUTPUT", socket_type="NodeSocketColor")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    group.links.new(node(group, "ShaderNodeGamma", links={0: start.outputs[0]}, values={1: 1.5}), end.inputs[0])

    # The sockets of a group node appear with its tree.
    def build(tree):
        holder = tree.nodes.new("ShaderNodeGroup")
        holder.node_tree = group
        muted = node(tree, "ShaderNodeInvert", links={"Color": texture(tree, image)})
        muted.node.mute = True
        tree.links.new(node(tree, "NodeReroute", links={0: muted}), holder.inputs[0])
        return holder.outputs[0]

    square(build)
    assert_as_cycles()


def test_a_missing_image_is_magenta_and_listed(square):
    image = bpy.data.images.new("lost", SIZE, SIZE)
    image.source, image.filepath = "FILE", "//lost.png"
    square(lambda tree: texture(tree, image))
    snapshot = assert_as_cycles(expect_findings=True)
    assert "lost" in snapshot.findings[0].problem


def test_what_is_not_evaluated_is_listed_by_material_and_node(square):
    square(lambda tree: node(tree, "ShaderNodeTexNoise"))
    findings = extract_scene().findings
    assert [finding.subject for finding in findings] == ["material 'graph', node 'Noise Texture'"]
