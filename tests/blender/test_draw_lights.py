# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights drawn onto visible surfaces: behind them, in their colour, with their tag, in every kind of scene."""

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

from vlm_addon.blender.drawing import draw_lights
from vlm_addon.blender.drawing.draw_points import repeated
from vlm_addon.blender.drawing.draw_shapes import rectangle
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.light_faces import read_faces
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.tag_pairs import FIRST_AUTOMATIC

UP = np.array([[0.0, 0.0, 1.0]])
SQUARE = np.array([(-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0)])


def draw(points, normals=UP, **options):
    """One polygon; returns the light mesh that got it."""
    draw_lights.draw(bpy.context, np.asarray(points, float), [list(range(len(points)))], normals, 0.0, **options)
    return bpy.context.object


def world_corners(thing):
    """(n, 3, 3) of the triangles of a light mesh, world."""
    mesh = thing.data
    mesh.calc_loop_triangles()
    matrix = np.array(thing.matrix_world)
    corners = [[mesh.vertices[v].co for v in triangle.vertices] for triangle in mesh.loop_triangles]
    return np.array(corners, float) @ matrix[:3, :3].T + matrix[:3, 3]


def highest_over_surface(thing, surface, samples=40):
    """How far any point of any light stands in front of `surface` (an untransformed mesh object), straight up from it.

    By rays of an own tree from many random points of each light along its normal to the nearest surface.
    """
    mesh = surface.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    tree = BVHTree.FromPolygons([v.co for v in mesh.vertices], [tuple(p.vertices) for p in mesh.polygons])
    generator = np.random.default_rng(5)
    worst = -np.inf
    for corners in world_corners(thing):
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normal /= np.linalg.norm(normal)
        for weights in generator.dirichlet(np.ones(3), samples):
            point = weights @ corners
            for sign in (1.0, -1.0):
                place, _, _, distance = tree.ray_cast(Vector(point), Vector(sign * normal), 1.0)
                if place is not None:
                    worst = max(worst, -sign * distance)
                    break
    return worst


@pytest.fixture
def red_plane(make_plane, make_material):
    """A red square of 4 m in z = 0 with tag 7."""
    material, shader = make_material()
    shader.inputs["Base Color"].default_value = (0.6, 0.1, 0.05, 1.0)
    plane = make_plane(size=4.0, material=material)
    plane["vlm_tag"] = 7
    return plane


def test_a_light_has_colour_and_tag_of_the_surface_and_lies_just_behind_it(red_plane):
    made = draw(SQUARE)
    (mesh,) = extract_scene().meshes
    assert np.allclose(read_faces(made, "vlm_color")[0, :3], mesh.reflectance[0], rtol=1e-6)
    assert read_faces(made, "vlm_tag").tolist() == [7]
    heights = world_corners(made)[..., 2]
    assert heights.max() < 0.0
    assert heights.min() > -2e-3
    assert np.allclose(np.sort(world_corners(made)[..., :2].reshape(-1, 2), axis=0)[[0, -1]], [[-0.5] * 2, [0.5] * 2])


def test_it_is_a_light_mesh_as_the_table_says_and_knows_its_source(red_plane):
    made = draw(SQUARE)
    assert (made["vlm_schema"], made.hide_render, made["vlm_sources"]) == (2, True, "Plane")
    kinds = {a.name: (a.data_type, a.domain) for a in made.data.attributes if a.name.startswith("vlm_")}
    assert kinds["vlm_color"] == ("FLOAT_COLOR", "FACE")
    assert kinds["vlm_tag"] == ("INT", "FACE")
    assert [collection.name for collection in made.users_collection] == ["Virtual Light Meshes"]


def test_phase_one_finds_the_surface_in_front_of_a_drawn_light(red_plane):
    draw(SQUARE)
    found = extract()
    assert not [finding for finding in found.snapshot.findings if "no visible surface" in str(finding)]
    assert np.abs(found.light_mesh.samples.positions[:, 2]).max() < 1e-6


def test_the_emission_of_the_surface_is_taken_along(make_plane, make_material):
    material, shader = make_material(node_type="ShaderNodeEmission")
    shader.inputs["Color"].default_value = (1.0, 0.5, 0.25, 1.0)
    shader.inputs["Strength"].default_value = 3.0
    make_plane(size=4.0, material=material)
    made = draw(SQUARE)
    assert np.allclose(read_faces(made, "vlm_emission")[0, :3], np.pi * 3.0 * np.array([1.0, 0.5, 0.25]), rtol=1e-5)


def test_a_texture_is_averaged_over_what_the_light_covers(make_plane, make_material):
    image = bpy.data.images.new("stripes", 64, 64, float_buffer=True)
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = np.linspace(0.0, 1.0, 64, dtype=np.float32)[None, :, None]
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels.ravel())
    material, shader = make_material(node_type="ShaderNodeBsdfDiffuse")
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.links.new(node.outputs[0], shader.inputs["Color"])
    make_plane(size=4.0, material=material)
    # From u = 0.5 to 0.75 of a ramp over the 64 middles of texels.
    made = draw(SQUARE + np.array([0.5, 0.0, 0.0]))
    assert read_faces(made, "vlm_color")[0, :3] == pytest.approx((0.625 * 64 - 0.5) / 63, abs=2e-3)


def test_the_tag_of_a_face_wins_over_that_of_its_object(red_plane):
    red_plane.data.attributes.new("vlm_tag", "INT", "FACE").data[0].value = 12
    assert read_faces(draw(SQUARE), "vlm_tag").tolist() == [12]


def test_an_id_that_pairing_gave_a_face_stays_with_the_lights_that_were_paired(red_plane):
    red_plane.data.attributes.new("vlm_tag", "INT", "FACE").data[0].value = FIRST_AUTOMATIC
    assert read_faces(draw(SQUARE), "vlm_tag").tolist() == [7]


def test_an_id_that_pairing_gave_an_object_stays_with_the_lights_that_were_paired(red_plane):
    red_plane["vlm_tag"] = FIRST_AUTOMATIC
    assert read_faces(draw(SQUARE), "vlm_tag").tolist() == [0]


@pytest.mark.parametrize("hollow", [True, False])
def test_on_curved_surfaces_no_light_stands_in_front(hollow):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=2.0, segments=48, ring_count=24)
    ball = bpy.context.object
    if hollow:
        ball.data.flip_normals()
    side = -1.0 if hollow else 1.0
    angles = [(0.5, 0.1), (0.6, 1.5), (0.7, 2.9), (0.4, 4.2), (0.6, 5.3)]
    points = 2.0 * np.array([[np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)] for t, p in angles])
    made = draw(points, side * UP)
    assert len(made.data.polygons) == 3, "a polygon that is not flat becomes triangles"
    assert highest_over_surface(made, ball) < 0.0
    turned = [float(np.cross(c[1] - c[0], c[2] - c[0])[2]) * side for c in world_corners(made)]
    assert min(turned) > 0.0


def test_a_grid_in_a_hollow_lies_behind_it():
    bpy.ops.mesh.primitive_uv_sphere_add(radius=2.0, segments=96, ring_count=48)
    ball = bpy.context.object
    ball.data.flip_normals()
    points, rings = rectangle(
        np.array([-1.0, -1.0, -1.5]), np.array([1.0, 1.0, -1.5]), UP[0], np.array([1.0, 0.0, 0.0]), 4, 4
    )
    points *= 2.0 / np.linalg.norm(points, axis=1, keepdims=True)
    draw_lights.draw(bpy.context, points, rings, repeated(UP[0], 16), 0.0)
    made = bpy.context.object
    assert len(made.data.polygons) == 32
    assert highest_over_surface(made, ball) < 0.0


def test_rectangles_of_a_grid_share_their_vertices(red_plane):
    points, rings = rectangle(SQUARE[0], SQUARE[2], UP[0], np.zeros(3), 3, 2)
    draw_lights.draw(bpy.context, points, rings, repeated(UP[0], 6), 0.0)
    made = bpy.context.object
    assert (len(made.data.polygons), len(made.data.vertices)) == (6, 12)
    assert world_corners(made)[..., 2].max() < 0.0


def test_a_point_at_a_vertex_of_a_light_is_that_vertex(red_plane):
    made = draw(SQUARE)
    corners = [tuple(made.matrix_world @ v.co) for v in made.data.vertices]
    right = sorted(corners)[2:]
    draw([right[0], (1.5, -0.5, 0.0), (1.5, 0.5, 0.0), right[1]])
    assert len(made.data.vertices) == 6
    assert world_corners(made)[..., 2].max() < 0.0


def test_the_same_light_twice_is_refused(red_plane):
    made = draw(SQUARE)
    corners = np.array([made.matrix_world @ made.data.vertices[i].co for i in made.data.polygons[0].vertices])
    with pytest.raises(InvalidInput, match="there is a light"):
        draw(corners)
    assert len(made.data.polygons) == 1


def test_a_thin_body_is_not_passed_and_that_is_said(make_mesh):
    # A shell of 1 mm, bent so that a light between its rims would have to go back 20 cm.
    rims = [(-1.0, 0.2), (0.0, 0.0), (1.0, 0.2)]
    vertices = [(x, y, z - depth) for depth in (0.0, 0.001) for x, z in rims for y in (-1.0, 1.0)]
    upper = [(0, 2, 3, 1), (2, 4, 5, 3)]
    lower = [tuple(6 + corner for corner in face[::-1]) for face in upper]
    make_mesh("Shell", vertices, upper + lower)
    points = np.array([(-0.9, -0.5, 0.18), (0.9, -0.5, 0.18), (0.9, 0.5, 0.18), (-0.9, 0.5, 0.18)])
    said = draw_lights.draw(bpy.context, points, [[0, 1, 2, 3]], UP, 0.0)
    assert "still in front" in said
    assert world_corners(bpy.context.object)[..., 2].min() > 0.18 - 0.001


def test_beside_all_surfaces_it_is_grey_and_that_is_said():
    said = draw_lights.draw(bpy.context, SQUARE, [[0, 1, 2, 3]], UP, 0.0)
    assert "without a surface" in said
    assert np.allclose(read_faces(bpy.context.object, "vlm_color")[0], [0.8, 0.8, 0.8, 1.0])


def test_on_the_back_of_a_surface_it_lies_in_front_of_the_front_and_that_is_said(red_plane):
    said = draw_lights.draw(bpy.context, SQUARE, [[0, 1, 2, 3]], -UP, 0.0)
    assert "back of the surface" in said
    assert world_corners(bpy.context.object)[..., 2].min() > 0.0


def test_light_meshes_and_what_renders_hide_are_no_surfaces(red_plane, make_plane):
    draw(SQUARE)
    over = make_plane("Over", 4.0)
    over.location.z = 0.01
    over.hide_render = True
    bpy.context.view_layer.update()
    second = draw(SQUARE + np.array([1.0, 1.0, 0.0]), target="VLM Drawn")
    assert read_faces(second, "vlm_tag").tolist() == [7, 7]


def test_on_instances_of_a_collection(red_plane):
    collection = bpy.data.collections.new("Instanced")
    bpy.context.scene.collection.children.link(collection)
    bpy.context.scene.collection.objects.unlink(red_plane)
    collection.objects.link(red_plane)
    bpy.context.view_layer.layer_collection.children["Instanced"].exclude = True
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    empty.location = (10.0, 0.0, 3.0)
    bpy.context.scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    made = draw(SQUARE + np.array([10.0, 0.0, 3.0]))
    (mesh,) = extract_scene().meshes
    assert np.allclose(read_faces(made, "vlm_color")[0, :3], mesh.reflectance[0], rtol=1e-6)
    assert read_faces(made, "vlm_tag").tolist() == [7]
    del red_plane["vlm_tag"]
    empty["vlm_tag"] = 8
    draw(SQUARE + np.array([11.0, 0.0, 3.0]))
    assert read_faces(made, "vlm_tag").tolist() == [7, 8]


def test_on_instances_that_geometry_nodes_make(make_plane, make_material):
    material, shader = make_material()
    shader.inputs["Base Color"].default_value = (0.1, 0.5, 0.2, 1.0)
    owner = make_plane("Owner", 1.0)
    tree = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    points, copies, grid, paint, out = (
        tree.nodes.new(kind)
        for kind in (
            "GeometryNodeMeshLine",
            "GeometryNodeInstanceOnPoints",
            "GeometryNodeMeshGrid",
            "GeometryNodeSetMaterial",
            "NodeGroupOutput",
        )
    )
    points.inputs["Count"].default_value = 2
    points.inputs["Offset"].default_value = (20.0, 0.0, 0.0)
    grid.inputs["Size X"].default_value = grid.inputs["Size Y"].default_value = 4.0
    paint.inputs["Material"].default_value = material
    for source, target in (
        (grid.outputs["Mesh"], paint.inputs["Geometry"]),
        (paint.outputs[0], copies.inputs["Instance"]),
    ):
        tree.links.new(source, target)
    tree.links.new(points.outputs[0], copies.inputs["Points"])
    tree.links.new(copies.outputs[0], out.inputs[0])
    owner.modifiers.new("Scatter", "NODES").node_group = tree
    owner["vlm_tag"] = 5
    bpy.context.view_layer.update()
    made = draw(SQUARE + np.array([20.0, 0.0, 0.0]))
    mesh = extract_scene().meshes[-1]
    assert np.allclose(read_faces(made, "vlm_color")[0, :3], mesh.reflectance[0], rtol=1e-6)
    assert read_faces(made, "vlm_color")[0, 1] > 0.3, "the green of the instances"
    assert read_faces(made, "vlm_tag").tolist() == [5]


def test_on_linked_scenery_nothing_of_it_changes(red_plane, tmp_path):
    path = str(tmp_path / "scenery.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Plane"]
    linked = bpy.data.objects["Plane"]
    bpy.context.scene.collection.objects.link(linked)
    bpy.context.view_layer.update()
    before = dict(linked.items())
    made = draw(SQUARE)
    assert read_faces(made, "vlm_tag").tolist() == [7]
    assert dict(linked.items()) == before
    assert linked.library is not None


def test_a_linked_light_mesh_is_refused(red_plane, tmp_path):
    draw(SQUARE)
    path = str(tmp_path / "lights.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["VLM Drawn"]
    bpy.context.scene.collection.objects.link(bpy.data.objects["VLM Drawn"])
    with pytest.raises(InvalidInput, match="linked"):
        draw(SQUARE, target="VLM Drawn")


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (-2.0, 0.5, 1.0)])
def test_a_moved_or_mirrored_light_mesh_takes_lights_where_they_were_drawn(red_plane, mode, scale):
    made = draw(SQUARE - [1.0, 0.0, 0.0])
    made.matrix_world = Matrix.LocRotScale((3.0, 1.0, 2.0), Matrix.Rotation(0.7, 3, "X"), scale)
    bpy.context.view_layer.update()
    bpy.ops.object.mode_set(mode=mode)
    draw(SQUARE)
    bpy.ops.object.mode_set(mode="OBJECT")
    new = world_corners(made)[2:]
    assert np.abs(new[..., 2]).max() < 2e-3
    lights = extract().light_mesh
    assert (lights.area_vectors[2:, 2] > 0.2).all()


def test_edit_mode_and_object_mode_make_the_same(red_plane):
    made = []
    for mode in ("OBJECT", "EDIT"):
        thing = draw(SQUARE - [1.0, 0.0, 0.0], target="")
        bpy.ops.object.mode_set(mode=mode)
        draw(SQUARE)
        bpy.ops.object.mode_set(mode="OBJECT")
        values = [read_faces(thing, name) for name in ("vlm_color", "vlm_emission", "vlm_tag", "vlm_lock")]
        made.append([world_corners(thing), read_faces(thing, "vlm_area_scale"), *values])
        bpy.context.view_layer.objects.active = None
    for first, second in zip(*made, strict=True):
        assert np.array_equal(first, second)


def test_in_edit_mode_the_new_lights_are_the_selected_ones(red_plane):
    thing = draw(SQUARE - [1.0, 0.0, 0.0])
    bpy.ops.object.mode_set(mode="EDIT")
    draw(SQUARE)
    assert [face.select for face in bmesh.from_edit_mesh(thing.data).faces] == [False, True]


@pytest.mark.parametrize(
    ("points", "message"),
    [(SQUARE[:1].repeat(3, axis=0), "no area"), (np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0.0)]), "no area")],
)
def test_what_has_no_area_is_refused_and_nothing_is_made(red_plane, points, message):
    with pytest.raises(InvalidInput, match=message):
        draw(points)
    assert "VLM Drawn" not in bpy.data.objects
    assert "Virtual Light Meshes" not in bpy.data.collections


def test_a_target_that_is_no_light_mesh_is_refused(red_plane):
    with pytest.raises(InvalidInput, match="no light mesh"):
        draw(SQUARE, target="Plane")


def test_in_edit_mode_another_light_mesh_is_refused(red_plane):
    first = draw(SQUARE)
    bpy.context.view_layer.objects.active = None
    draw(SQUARE + np.array([1.0, 0.0, 0.0]))
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(InvalidInput, match="not the one in edit mode"):
        draw(SQUARE - np.array([1.0, 0.0, 0.0]), target=first.name)
    assert len(first.data.polygons) == 1
