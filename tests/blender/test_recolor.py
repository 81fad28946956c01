# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of materials for lights: of what lies in front of each, textures and corners included; materials stay."""

import hashlib

import bpy
import numpy as np
import pytest

from vlm_addon.blender import recolor
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.blender.light_colors import BOTH, COLOR
from vlm_addon.blender.light_faces import read_faces
from vlm_addon.blender.recolor import OBJECT, POINT, Place
from vlm_addon.blender.source_colors import SourceColors
from vlm_addon.core.errors import Cancelled, InvalidInput
from vlm_addon.core.progress import silent

RED, GREEN = (0.6, 0.1, 0.05), (0.1, 0.7, 0.2)
ORIGIN = (0.0, 0.0, 0.0)


@pytest.fixture
def painted(make_material):
    """painted(color): a diffuse material."""

    def make(color, name="paint"):
        material, shader = make_material(name, "ShaderNodeBsdfDiffuse")
        shader.inputs["Color"].default_value = (*color, 1.0)
        return material

    return make


@pytest.fixture
def lights_below(make_mesh):
    """lights_below(*middles, size): square lights 0.1 below z = 0, facing up; selected."""

    def make(*middles, size=0.5, z=-0.1):
        h = size / 2
        square = [(-h, -h), (h, -h), (h, h), (-h, h)]
        vertices = [(x + dx, y + dy, z) for x, y in middles for dx, dy in square]
        thing = make_mesh("lights", vertices, [tuple(range(4 * i, 4 * i + 4)) for i in range(len(middles))])
        thing["vlm_schema"] = 2
        thing.hide_render = True
        thing.select_set(True)
        return thing

    return make


@pytest.fixture
def striped(make_material):
    """A material whose picture is black for u < 1/2 and of 0.8 in red beyond."""
    image = bpy.data.images.new("stripes", 64, 8, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.zeros((8, 64, 4), np.float32)
    pixels[..., 3] = 1.0
    pixels[:, 32:, 0] = 0.8
    image.pixels.foreach_set(pixels.ravel())
    material, shader = make_material("striped", "ShaderNodeBsdfDiffuse")
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Color"])
    return material


def recolored(things, quantity=BOTH, keep_locked=True):
    work = recolor.from_materials(bpy.context, things, quantity, keep_locked)
    return recolor.write_recolored(bpy.context, work(silent))


def colors(thing, name="vlm_color"):
    return read_faces(thing, name)[:, :3]


def state_of_materials():
    """A hash of every node, socket value and link of every material, and of the pixels of every image."""
    parts = []
    for material in bpy.data.materials:
        for node in material.node_tree.nodes:
            values = [tuple(v) if hasattr(v, "__len__") else v for s in node.inputs if (v := _value(s)) is not None]
            parts.append((material.name, node.name, node.bl_idname, repr(values)))
        links = material.node_tree.links
        parts += [(material.name, link.from_socket.name, link.to_socket.name) for link in links]
    for image in (each for each in bpy.data.images if each.source != "VIEWER"):
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        parts.append((image.name, hashlib.sha256(pixels).hexdigest()))
    for thing in bpy.data.objects:
        parts.append((thing.name, [slot.material and slot.material.name for slot in thing.material_slots]))
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _value(socket):
    return getattr(socket, "default_value", None)


def test_lights_take_the_colour_in_front_of_them_and_materials_stay(make_plane, painted, lights_below):
    left, right = make_plane("left", material=painted(RED)), make_plane("right", material=painted(GREEN))
    left.location.x, right.location.x = -1.0, 1.0
    lights = lights_below((-1, 0), (1, 0), (0, 0))
    before = state_of_materials()
    assert recolored([lights]) == "Recolored 3 virtual lights from materials"
    assert colors(lights)[:2] == pytest.approx(np.array([RED, GREEN]), abs=1e-6)
    # The third lies half in front of each.
    assert colors(lights)[2] == pytest.approx(np.mean([RED, GREEN], axis=0), abs=1e-6)
    assert state_of_materials() == before


def test_a_picture_is_averaged_over_the_region_of_each_light(make_plane, striped, lights_below):
    make_plane(size=4.0, material=striped)
    lights = lights_below((-1, 0), (1, 0), (0, 0), (0.125, 1))
    recolored([lights])
    # Three quarters of the light at (0.125, 1) are in the bright half. 16 points know it to within their spacing.
    assert colors(lights)[:2, 0] == pytest.approx([0.0, 0.8], abs=1e-6)
    assert colors(lights)[2:, 0] == pytest.approx([0.4, 0.6], abs=0.04)


def test_emission_is_looked_up_too_and_only_where_it_is_asked_for(make_plane, make_material, lights_below):
    material, shader = make_material("lamp", "ShaderNodeEmission")
    shader.inputs["Color"].default_value = (1.0, 0.5, 0.25, 1.0)
    shader.inputs["Strength"].default_value = 2.0
    make_plane(material=material)
    lights = lights_below((0, 0))
    recolored([lights], COLOR)
    assert colors(lights, "vlm_emission").tolist() == [[0.0, 0.0, 0.0]]
    recolored([lights])
    assert colors(lights, "vlm_emission")[0] == pytest.approx(2.0 * np.pi * np.array([1.0, 0.5, 0.25]), rel=1e-5)
    assert colors(lights)[0] == pytest.approx(np.zeros(3), abs=1e-6)


def test_lights_without_a_surface_keep_their_colour_and_are_counted(make_plane, painted, lights_below):
    make_plane(material=painted(RED))
    lights = lights_below((0, 0), (50, 0))
    assert "1 virtual light with no visible surface" in recolored([lights])
    assert colors(lights) == pytest.approx(np.array([RED, (1, 1, 1)]), abs=1e-6)


def test_slivers_far_behind_their_surface_find_it(make_plane, painted, lights_below):
    make_plane(material=painted(RED))
    lights = lights_below((0, 0), size=0.1, z=-0.5)
    recolored([lights])
    assert colors(lights)[0] == pytest.approx(RED, abs=1e-6)


def test_locked_lights_keep_their_colour_unless_asked_for(make_plane, painted, lights_below):
    make_plane(material=painted(RED))
    lights = lights_below((0.3, 0), (-0.3, 0))
    lights.data.attributes.new("vlm_lock", "INT", "FACE").data.foreach_set("value", [1, 0])
    assert "1 virtual light locked" in recolored([lights])
    assert colors(lights) == pytest.approx(np.array([(1, 1, 1), RED]), abs=1e-6)
    recolored([lights], keep_locked=False)
    assert colors(lights) == pytest.approx(np.array([RED, RED]), abs=1e-6)
    lights.data.attributes["vlm_lock"].data.foreach_set("value", [1, 1])
    with pytest.raises(InvalidInput, match="locked"):
        recolored([lights])


def test_a_light_mesh_that_changed_meanwhile_is_left_alone(make_plane, painted, lights_below):
    make_plane(material=painted(RED))
    lights = lights_below((0, 0), (0.5, 0))
    found = recolor.from_materials(bpy.context, [lights], BOTH, True)(silent)
    bpy.context.view_layer.objects.active = lights
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")
    with pytest.raises(InvalidInput, match="changed while"):
        recolor.write_recolored(bpy.context, found)
    assert "vlm_color" not in lights.data.attributes


def test_the_work_can_be_cancelled(make_plane, painted, lights_below):
    make_plane(material=painted(RED))
    work = recolor.from_materials(bpy.context, [lights_below((0, 0))], BOTH, True)
    with pytest.raises(Cancelled):
        work(lambda fraction, label: False)


def test_picking_an_object_gives_its_mean_by_area(make_cube, make_plane, painted, lights_below):
    thing = make_plane(size=4.0, material=painted(RED))
    thing.data.materials.append(painted(GREEN))
    lights = lights_below((50, 0))
    assert recolor.pick(bpy.context, [lights], Place(OBJECT, ORIGIN, thing.name, 0.0), COLOR) == 1
    assert colors(lights)[0] == pytest.approx(RED, abs=1e-6)


@pytest.mark.parametrize(("radius", "expected"), [(0.2, 0.8), (0.0, 0.8), (2.5, 0.6)])
def test_picking_a_point_averages_over_the_radius_or_the_size_of_the_lights(
    make_plane, striped, lights_below, radius, expected
):
    make_plane(size=20.0, material=striped)
    lights = lights_below((50, 0))
    recolor.pick(bpy.context, [lights], Place(POINT, (1.0, 0.0, 0.3), "", radius), COLOR)
    # Share of a disc of radius r whose middle is 1 m from the border that lies in the bright half.
    if radius > 1.0:
        cut = radius**2 * np.arccos(1 / radius) - np.sqrt(radius**2 - 1)
        expected = 0.8 * (1.0 - cut / (np.pi * radius**2))
    assert colors(lights)[0, 0] == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("name", ["plane", "red/white"])
def test_picking_on_an_instance_sees_the_instance(make_plane, striped, lights_below, scene, name):
    group = bpy.data.collections.new("group")
    plane = make_plane(size=4.0, material=striped, collection=group)
    plane.name = name
    instance = bpy.data.objects.new("instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", group
    instance.location.x = 100.0
    scene.collection.objects.link(instance)
    lights = lights_below((50, 0), size=0.2)
    bpy.context.view_layer.update()
    recolor.pick(bpy.context, [lights], Place(POINT, (101.0, 0.0, 0.0), plane.name, 0.0), COLOR)
    assert colors(lights)[0, 0] == pytest.approx(0.8, abs=1e-3)


@pytest.mark.parametrize("source", ["nobody", "lights"])
def test_picking_what_is_not_visible_is_refused(make_plane, painted, lights_below, source):
    make_plane(material=painted(RED))
    lights = lights_below((0, 0))
    with pytest.raises(InvalidInput, match="shows no surface"):
        recolor.pick(bpy.context, [lights], Place(OBJECT, ORIGIN, source, 0.0), COLOR)
    assert "vlm_color" not in lights.data.attributes


def test_an_empty_scene_is_refused(lights_below):
    with pytest.raises(InvalidInput, match="surface"):
        recolored([lights_below((0, 0))])


def test_regions_of_a_flat_picture_add_up_to_the_whole(make_plane, striped, lights_below):
    """Lights that tile a plane reflect together what the plane does."""
    make_plane(size=4.0, material=striped)
    places = [(x, y) for x in (-1.75, -1.25, -0.75, -0.25, 0.25, 0.75, 1.25, 1.75) for y in (-1.5, -0.5, 0.5, 1.5)]
    lights = lights_below(*places)
    recolored([lights])
    (mesh,) = extract_scene().meshes
    whole = SourceColors(extract_scene()).of_all().reflectance[0]
    assert mesh.reflectance.mean(axis=0) == pytest.approx(whole, rel=1e-5)
    assert colors(lights).mean(axis=0) == pytest.approx(whole, abs=0.01)
