# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of the snapshot, what is approximated in them, and their averages over triangles."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.blender.extraction.triangle_averages import BARYCENTRICS, TextureAverager
from vlm_addon.core.brdf import diffuse_reflectance
from vlm_addon.core.scene import NO_TEXTURE, Texture


def only_material(findings=0):
    snapshot = extract_scene()
    assert len(snapshot.findings) == findings, [str(finding) for finding in snapshot.findings]
    (material,) = snapshot.materials
    return material


def image_of(values, name="image", data=False):
    height, width = values.shape[:2]
    image = bpy.data.images.new(name, width, height, float_buffer=True, is_data=data)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., : values.shape[2]] = values
    image.pixels.foreach_set(rgba.ravel())
    image.pack()
    return image


def link_image(material, image, socket, output="Color"):
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.links.new(node.outputs[output], socket)
    return node


def test_principled_parameters(make_plane, make_material):
    material, shader = make_material()
    values = {
        "Base Color": (0.1, 0.2, 0.3, 1.0),
        "Metallic": 0.25,
        "Roughness": 0.75,
        "IOR": 1.7,
        "Alpha": 0.5,
        "Specular IOR Level": 0.4,
        "Emission Color": (0.5, 0.25, 1.0, 1.0),
        "Emission Strength": 4.0,
    }
    for name, value in values.items():
        shader.inputs[name].default_value = value
    make_plane(material=material)
    found = only_material()
    assert found.model == "PRINCIPLED"
    assert found.base_color == pytest.approx((0.1, 0.2, 0.3))
    numbers = (found.metallic, found.roughness, found.ior, found.alpha, found.specular_ior_level)
    assert numbers == pytest.approx((0.25, 0.75, 1.7, 0.5, 0.4))
    assert found.emission == pytest.approx((2.0, 1.0, 4.0))


def test_no_material_is_cycles_default_grey(make_plane):
    make_plane()
    found = only_material()
    assert (found.model, found.base_color) == ("DIFFUSE", pytest.approx((0.8, 0.8, 0.8)))


def test_an_empty_slot_is_cycles_default_grey(make_plane):
    make_plane().data.materials.append(None)
    assert only_material().base_color == pytest.approx((0.8, 0.8, 0.8))


def test_an_output_without_shader_is_black(make_plane, make_material):
    material, shader = make_material()
    material.node_tree.nodes.remove(shader)
    make_plane(material=material)
    assert only_material().base_color == (0.0, 0.0, 0.0)


def test_slots_are_those_of_the_object_where_it_links_them(make_plane, make_material):
    plane = make_plane(material=make_material("of the mesh")[0])
    plane.material_slots[0].link = "OBJECT"
    plane.material_slots[0].material = make_material("of the object")[0]
    assert only_material().name == "of the object"


def test_each_triangle_has_its_slot(make_cube, make_material):
    cube = make_cube(material=make_material("one")[0])
    cube.data.materials.append(make_material("two")[0])
    cube.data.polygons.foreach_set("material_index", np.array([0, 1, 0, 1, 1, 1], np.int32))
    snapshot = extract_scene()
    names = [snapshot.materials[index].name for index in snapshot.meshes[0].material_indices]
    assert (names.count("one"), names.count("two")) == (4, 8)


def test_the_view_layers_override_wins(make_plane, make_material, scene):
    make_plane(material=make_material("own")[0])
    bpy.context.view_layer.material_override = make_material("override")[0]
    assert only_material().name == "override"


def test_channels_of_one_packed_image(make_plane, make_material):
    material, shader = make_material()
    image = image_of(np.random.default_rng(0).random((4, 4, 3), np.float32), data=True)
    separate = material.node_tree.nodes.new("ShaderNodeSeparateColor")
    link_image(material, image, separate.inputs[0])
    material.node_tree.links.new(separate.outputs["Green"], shader.inputs["Roughness"])
    material.node_tree.links.new(separate.outputs["Blue"], shader.inputs["Metallic"])
    make_plane(material=material)
    snapshot = extract_scene()
    (found,) = snapshot.materials
    assert (found.roughness_channel, found.metallic_channel) == (1, 2)
    assert found.roughness_texture == found.metallic_texture != NO_TEXTURE
    assert len(snapshot.textures) == 1


def test_one_image_in_two_materials_is_one_texture(make_plane, make_material):
    image = image_of(np.full((2, 2, 3), 0.5, np.float32))
    for name in ("a", "b"):
        material, shader = make_material(name)
        link_image(material, image, shader.inputs["Base Color"])
        make_plane(name, material=material)
    assert len(extract_scene().textures) == 1


def test_a_tangent_space_normal_map(make_plane, make_material):
    material, shader = make_material()
    node = material.node_tree.nodes.new("ShaderNodeNormalMap")
    node.inputs["Strength"].default_value = 0.5
    link_image(material, image_of(np.full((2, 2, 3), 0.5, np.float32), data=True), node.inputs["Color"])
    material.node_tree.links.new(node.outputs["Normal"], shader.inputs["Normal"])
    make_plane(material=material)
    snapshot = extract_scene()
    (found,) = snapshot.materials
    assert found.normal_strength == 0.5
    assert snapshot.textures[found.normal_texture].pixels[0, 0, :3] == pytest.approx(0.5)


@pytest.mark.parametrize("domain", ["POINT", "CORNER"])
@pytest.mark.parametrize("data_type", ["FLOAT_COLOR", "BYTE_COLOR"])
def test_colour_attributes_are_linear_at_corners(make_plane, make_material, domain, data_type):
    material, shader = make_material()
    node = material.node_tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "paint"
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    plane = make_plane(material=material)
    attribute = plane.data.color_attributes.new("paint", data_type, domain)
    colors = np.random.default_rng(1).random((4, 4)).astype(np.float32)
    attribute.data.foreach_set("color", colors.ravel())
    snapshot = extract_scene()
    assert snapshot.materials[0].base_color_from_corners
    (mesh,) = snapshot.meshes
    # Points and corners of the square are in the same order.
    assert mesh.corner_colors == pytest.approx(colors[mesh.triangles][..., :3], abs=0.01)


def shader_graph(build):
    """A material whose output is what build(tree, new) returns."""
    material = bpy.data.materials.new("graph")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()

    def new(kind, links=(), **values):
        node = tree.nodes.new(f"ShaderNode{kind}")
        for name, value in values.items():
            node.inputs[name].default_value = value
        for socket, other in links:
            tree.links.new(other.outputs[0], node.inputs[socket])
        return node

    tree.links.new(build(new).outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


RED, GREEN = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0)


def mix(new, share, a, b):
    return new("MixShader", [(1, a), (2, b)], Fac=share)


def test_a_mix_with_transparency_is_alpha(make_plane):
    def build(new):
        return mix(new, 0.3, new("BsdfTransparent"), new("BsdfDiffuse", Color=RED))

    make_plane(material=shader_graph(build))
    found = only_material()
    assert (found.model, found.alpha) == ("DIFFUSE", pytest.approx(0.3))
    assert found.base_color == (1.0, 0.0, 0.0)


def test_transparency_as_second_shader(make_plane):
    def build(new):
        return mix(new, 0.3, new("BsdfDiffuse", Color=RED), new("BsdfTransparent"))

    make_plane(material=shader_graph(build))
    assert only_material().alpha == pytest.approx(0.7)


def test_a_mix_of_diffuse_shaders_is_exact(make_plane):
    def build(new):
        return mix(new, 0.25, new("BsdfDiffuse", Color=RED), new("BsdfDiffuse", Color=GREEN))

    make_plane(material=shader_graph(build))
    assert only_material().base_color == pytest.approx((0.75, 0.25, 0.0))


def test_emission_is_added(make_plane):
    def build(new):
        return new("AddShader", [(0, new("BsdfDiffuse", Color=RED)), (1, new("Emission", Color=GREEN, Strength=2.0))])

    make_plane(material=shader_graph(build))
    found = only_material()
    assert (found.base_color, found.emission) == ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0))


APPROXIMATED = {
    "mix": lambda new: mix(new, 0.5, new("BsdfDiffuse"), new("BsdfPrincipled")),
    "sum": lambda new: new("AddShader", [(0, new("BsdfDiffuse")), (1, new("BsdfDiffuse", Color=RED))]),
    "glossy": lambda new: new("BsdfAnisotropic"),
    "glass": lambda new: new("BsdfGlass"),
    "translucent": lambda new: new("BsdfTranslucent"),
    "subsurface": lambda new: new("SubsurfaceScattering"),
    "sheen": lambda new: new("BsdfSheen"),
    "toon": lambda new: new("BsdfToon"),
    "hair": lambda new: new("BsdfHair"),
    "rough diffuse": lambda new: new("BsdfDiffuse", Roughness=0.5),
    "colored transparency": lambda new: new("BsdfTransparent", Color=RED),
    "bump": lambda new: new("BsdfDiffuse", [("Normal", new("Bump"))]),
    "transmission": lambda new: new("BsdfPrincipled", **{"Transmission Weight": 0.5}),
    "coat": lambda new: new("BsdfPrincipled", **{"Coat Weight": 0.5}),
    "tint": lambda new: new("BsdfPrincipled", **{"Specular Tint": RED}),
}


@pytest.mark.parametrize("case", APPROXIMATED)
def test_what_is_approximated_is_listed_once(make_plane, case):
    make_plane(material=shader_graph(APPROXIMATED[case]))
    snapshot = extract_scene()
    (finding,) = snapshot.findings
    assert finding.subject.startswith("material 'graph', node ")


def test_volume_and_displacement_are_listed(make_plane, make_material):
    material, _ = make_material()
    tree = material.node_tree
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(tree.nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])
    tree.links.new(tree.nodes.new("ShaderNodeDisplacement").outputs[0], output.inputs["Displacement"])
    make_plane(material=material)
    only_material(findings=2)


def test_reflectance_is_that_of_the_shading_model(make_plane, make_material):
    material, shader = make_material()
    shader.inputs["Base Color"].default_value = (0.4, 0.6, 0.8, 1.0)
    shader.inputs["Metallic"].default_value = 0.3
    make_plane(material=material)
    (mesh,) = extract_scene().meshes
    ior = shader.inputs["IOR"].default_value
    expected = diffuse_reflectance((0.4, 0.6, 0.8), 0.3, ior, 0.5, 0.5, "PRINCIPLED")
    assert mesh.reflectance == pytest.approx(np.broadcast_to(expected, (2, 3)), rel=1e-5)


def test_emission_is_pi_times_radiance(make_plane, make_material):
    material, shader = make_material("glow", "ShaderNodeEmission")
    shader.inputs["Color"].default_value = (1.0, 0.5, 0.0, 1.0)
    shader.inputs["Strength"].default_value = 2.0
    make_plane(material=material)
    (mesh,) = extract_scene().meshes
    assert mesh.emission[0] == pytest.approx([2 * np.pi, np.pi, 0.0])


def test_a_triangle_has_the_mean_of_its_part_of_the_texture(make_plane, make_material):
    material, shader = make_material("painted", "ShaderNodeBsdfDiffuse")
    # Left half dark, right half light, over fine noise: large triangles need an average, not a few texels.
    values = np.random.default_rng(2).random((256, 256, 3)).astype(np.float32) * 0.2
    values[:, 128:] += 0.5
    link_image(material, image_of(values), shader.inputs["Color"])
    make_plane(material=material)
    (mesh,) = extract_scene().meshes
    rows, columns = (np.indices((256, 256)) + 0.5) / 256.0
    for uv, reflectance in zip(mesh.corner_uvs, mesh.reflectance, strict=True):
        right = uv.mean(axis=0)[0] > 0.5
        inside = (columns > rows) == right
        assert reflectance == pytest.approx(values[inside].mean(axis=0), rel=0.02)


def test_averages_do_not_miss_thin_stripes():
    """A texture of thin lines, averaged over one large triangle: the mean, whatever the sampling points hit."""
    pixels = np.zeros((512, 512, 4), np.float32)
    pixels[:, ::16] = 1.0
    averager = TextureAverager([Texture("stripes", pixels)])
    uv = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]], np.float32)
    assert averager.sample(0, uv, BARYCENTRICS[4]).mean() == pytest.approx(1.0 / 16.0, rel=0.05)


def test_averages_of_small_triangles_are_local():
    pixels = np.zeros((64, 64, 4), np.float32)
    pixels[:, 32:] = 1.0
    averager = TextureAverager([Texture("halves", pixels)])
    left = np.array([[0.1, 0.1], [0.2, 0.1], [0.1, 0.2]], np.float32)
    sampled = averager.sample(0, np.stack([left, left + np.float32(0.6)]), BARYCENTRICS[4])
    assert sampled[0].max() == 0.0
    assert sampled[1].min() == 1.0


def test_transparent_parts_reflect_in_proportion(make_plane, make_material):
    material, shader = make_material()
    shader.inputs["Alpha"].default_value = 0.25
    shader.inputs["Specular IOR Level"].default_value = 0.0
    make_plane(material=material)
    (mesh,) = extract_scene().meshes
    assert mesh.reflectance == pytest.approx(np.full((2, 3), 0.25 * 0.8), rel=0.01)
