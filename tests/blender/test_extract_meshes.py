# SPDX-License-Identifier: GPL-3.0-or-later
"""What extraction makes of visible geometry: placement, winding, normals, visibility, modifiers, instances."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.extraction.extract import ExtractOptions, extract_scene
from vlm_addon.core.errors import InvalidInput


def only_mesh(**options):
    meshes = extract_scene(ExtractOptions(**options)).meshes
    assert len(meshes) == 1
    return meshes[0]


def face_normals(mesh):
    a, b, c = np.moveaxis(mesh.positions[mesh.triangles], 1, 0)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def volume(mesh):
    a, b, c = np.moveaxis(mesh.positions[mesh.triangles], 1, 0)
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0


def add_node_group(blender_object, build):
    group = bpy.data.node_groups.new("nodes", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    build(group, group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput"))
    blender_object.modifiers.new("nodes", "NODES").node_group = group


def test_a_cube_has_twelve_triangles_around_its_volume(make_cube):
    make_cube()
    mesh = only_mesh()
    assert len(mesh.triangles) == 12
    assert volume(mesh) == pytest.approx(8.0)


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (-2, -1, -0.5), (3, -0.5, -1)])
def test_the_front_stays_in_front_under_any_scale(make_cube, scale):
    blender_object = make_cube()
    blender_object.scale = scale
    blender_object.rotation_euler = (0.3, 0.5, 0.7)
    mesh = only_mesh()
    assert volume(mesh) == pytest.approx(8.0 * abs(np.prod(scale)))
    cosines = np.einsum("ij,ikj->ik", face_normals(mesh), mesh.corner_normals.astype(np.float64))
    assert cosines == pytest.approx(1.0, abs=1e-5)


def test_smooth_normals_follow_a_stretched_sphere(scene):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32)
    bpy.ops.object.shade_smooth()
    bpy.context.object.scale = (2.0, 1.0, 0.5)
    mesh = only_mesh()
    points = mesh.positions[mesh.triangles]
    gradient = points / np.array([4.0, 1.0, 0.25])
    gradient /= np.linalg.norm(gradient, axis=-1, keepdims=True)
    assert np.einsum("tij,tij->ti", gradient, mesh.corner_normals).min() > 0.998


def test_custom_normals_are_kept(make_plane):
    blender_object = make_plane()
    wanted = np.tile(np.array([0.6, 0.0, 0.8]), (4, 1))
    blender_object.data.normals_split_custom_set(wanted.tolist())
    assert only_mesh().corner_normals == pytest.approx(np.broadcast_to(wanted[0], (2, 3, 3)), abs=1e-4)


def test_world_positions_are_computed_in_double_precision(make_mesh):
    offset = np.float64(np.float32(10000.1))
    local = np.float32(0.00012345)
    blender_object = make_mesh("speck", [(local, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    blender_object.location.x = offset
    assert only_mesh().positions[0, 0] == offset + np.float64(local)


def test_modifiers_are_at_render_level_and_as_before_afterwards(make_cube, file_state):
    modifier = make_cube().modifiers.new("subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 1, 3
    before = file_state()
    assert len(only_mesh().triangles) == 2 * 6 * 4**3
    assert file_state() == before
    assert modifier.levels == 1


def test_viewport_levels_on_request(make_cube):
    modifier = make_cube().modifiers.new("subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 1, 3
    assert len(only_mesh(viewport_levels=True).triangles) == 2 * 6 * 4


def test_a_modifier_shown_only_in_renders_counts(make_cube):
    modifier = make_cube().modifiers.new("array", "ARRAY")
    modifier.show_viewport, modifier.show_render = False, True
    assert len(only_mesh().triangles) == 24


def test_everything_is_restored_when_extraction_fails(make_cube, make_mesh, file_state, scene):
    make_cube()
    make_mesh("dots", [(0, 0, 0)], [])
    scene.render.engine = "CYCLES"
    scene.view_layers.new("other")
    before = file_state()
    with pytest.raises(InvalidInput):
        extract_scene()
    assert file_state() == before


def test_hidden_things_are_not_extracted(make_cube, scene):
    make_cube("shown")
    make_cube("hidden object").hide_render = True
    for name in ("hidden collection", "excluded collection"):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        make_cube(name, collection=collection)
    bpy.data.collections["hidden collection"].hide_render = True
    bpy.context.view_layer.layer_collection.children["excluded collection"].exclude = True
    assert only_mesh().name == "shown"


def test_visibility_is_that_of_renders_not_of_the_viewport(make_cube):
    blender_object = make_cube("hidden in the viewport")
    blender_object.hide_viewport = True
    assert only_mesh().name == "hidden in the viewport"


def test_viewport_evaluation_leaves_out_what_renders_hide(make_cube):
    make_cube("shown")
    make_cube("hidden").hide_render = True
    assert only_mesh(viewport_levels=True).name == "shown"


def test_animated_visibility_is_that_of_the_frame(make_cube, scene):
    blender_object = make_cube()
    for frame, hidden in ((1, False), (2, True)):
        blender_object.hide_render = hidden
        blender_object.keyframe_insert("hide_render", frame=frame)
    scene.frame_set(1)
    assert only_mesh().dynamic
    scene.frame_set(2)
    assert not extract_scene().meshes


def test_light_meshes_are_never_geometry(make_cube):
    make_cube("wall")
    lights = make_cube("lights")
    lights["vlm_schema"] = 1
    assert only_mesh().name == "wall"


def test_collection_instances_are_placed(make_cube, scene):
    collection = bpy.data.collections.new("props")
    make_cube("prop", collection=collection)
    for x in (10.0, 20.0):
        instancer = bpy.data.objects.new(f"at {x}", None)
        instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
        instancer.location.x = x
        scene.collection.objects.link(instancer)
    meshes = extract_scene().meshes
    assert [mesh.positions.mean(axis=0)[0] for mesh in meshes] == pytest.approx([10.0, 20.0])
    assert len({mesh.name for mesh in meshes}) == 2


def test_geometry_nodes_give_their_output_and_their_instances(make_cube, make_plane):
    def build(group, start, end):
        points = group.nodes.new("GeometryNodeMeshToPoints")
        cube = group.nodes.new("GeometryNodeMeshCube")
        instances = group.nodes.new("GeometryNodeInstanceOnPoints")
        join = group.nodes.new("GeometryNodeJoinGeometry")
        group.links.new(start.outputs[0], points.inputs["Mesh"])
        group.links.new(points.outputs[0], instances.inputs["Points"])
        group.links.new(cube.outputs[0], instances.inputs["Instance"])
        group.links.new(instances.outputs[0], join.inputs[0])
        group.links.new(start.outputs[0], join.inputs[0])
        group.links.new(join.outputs[0], end.inputs[0])

    add_node_group(make_plane(), build)
    meshes = extract_scene().meshes
    assert sorted(len(mesh.triangles) for mesh in meshes) == [2, 12, 12, 12, 12]
    centres = sorted(mesh.positions.mean(axis=0).round(3).tolist() for mesh in meshes if len(mesh.triangles) == 12)
    assert centres == [[-1, -1, 0], [-1, 1, 0], [1, -1, 0], [1, 1, 0]]


def test_particles_are_instances(make_plane, make_cube):
    make_cube("grain").scale = (0.01, 0.01, 0.01)
    plane = make_plane()
    settings = plane.modifiers.new("particles", "PARTICLE_SYSTEM").particle_system.settings
    settings.type, settings.count, settings.render_type = "HAIR", 7, "OBJECT"
    settings.instance_object = bpy.data.objects["grain"]
    names = [mesh.name for mesh in extract_scene().meshes]
    assert sum(name.startswith("Plane/grain/") for name in names) == 7


def test_curves_texts_and_metaballs_are_surfaces(make_material):
    bpy.ops.curve.primitive_bezier_circle_add()
    bpy.context.object.data.bevel_depth = 0.1
    bpy.context.object.name = "circle"
    bpy.ops.object.text_add()
    bpy.context.object.name = "text"
    bpy.context.object.data.materials.append(make_material("ink", "ShaderNodeBsdfDiffuse")[0])
    bpy.ops.object.metaball_add()
    bpy.context.object.name = "ball"
    snapshot = extract_scene()
    assert sorted(mesh.name for mesh in snapshot.meshes) == ["ball", "circle", "text"]
    assert min(len(mesh.triangles) for mesh in snapshot.meshes) > 20
    text = next(mesh for mesh in snapshot.meshes if mesh.name == "text")
    assert snapshot.materials[text.material_indices[0]].name == "ink"


def test_loose_vertices_and_edges_are_ignored(scene):
    mesh = bpy.data.meshes.new("mixed")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0), (5, 5, 5), (6, 6, 6)], [(3, 4)], [(0, 1, 2)])
    scene.collection.objects.link(bpy.data.objects.new("mixed", mesh))
    assert only_mesh().triangles.tolist() == [[0, 1, 2]]


def test_face_tags_win_over_the_objects_tag(make_cube):
    blender_object = make_cube()
    blender_object["vlm_tag"] = 7
    attribute = blender_object.data.attributes.new("vlm_tag", "INT", "FACE")
    attribute.data.foreach_set("value", np.array([0, 3, 0, 0, 0, 0], np.int32))
    tags = only_mesh().tag_ids
    assert sorted(tags.tolist()) == [3] * 2 + [7] * 10


def test_only_chosen_objects_and_what_they_instance(make_cube, scene):
    make_cube("other")
    collection = bpy.data.collections.new("props")
    make_cube("prop", collection=collection)
    instancer = bpy.data.objects.new("instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
    scene.collection.objects.link(instancer)
    assert only_mesh(objects=frozenset({"instancer"})).name.startswith("instancer/prop")


def animate(blender_object):
    blender_object.location.x = 0.0
    blender_object.keyframe_insert("location", frame=1)


def armature_of(blender_object):
    armature = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    bpy.context.scene.collection.objects.link(armature)
    blender_object.modifiers.new("armature", "ARMATURE").object = armature
    return armature


def parent_of(blender_object):
    parent = bpy.data.objects.new("parent", None)
    bpy.context.scene.collection.objects.link(parent)
    blender_object.parent = parent
    return parent


def drive_shape_key(blender_object):
    blender_object.shape_key_add(name="basis")
    key = blender_object.shape_key_add(name="bent")
    key.driver_add("value").driver.expression = "frame / 100"


@pytest.mark.parametrize(
    ("make", "dynamic"),
    [
        (lambda o: None, False),
        (animate, True),
        (parent_of, False),
        (lambda o: animate(parent_of(o)), True),
        (armature_of, False),
        (lambda o: animate(armature_of(o)), True),
        (drive_shape_key, True),
    ],
    ids=["still", "animated", "still parent", "moving parent", "still rig", "moving rig", "driven shape"],
)
def test_what_moves_is_dynamic(make_cube, make, dynamic):
    make(make_cube())
    assert only_mesh().dynamic is dynamic


BROKEN = {
    "no faces": (lambda make: make("broken", [(0, 0, 0), (1, 0, 0)], []), "no faces"),
    "not a number": (
        lambda make: make("broken", [(float("nan"), 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]),
        "vertex 0 is at .nan",
    ),
    "infinite": (
        lambda make: make("broken", [(0, 0, 0), (float("inf"), 0, 0), (0, 1, 0)], [(0, 1, 2)]),
        "vertex 1 is at .inf",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_meshes_are_named(make_mesh, case):
    build, text = BROKEN[case]
    build(make_mesh)
    with pytest.raises(InvalidInput, match=f"object 'broken': .*{text}"):
        extract_scene()


@pytest.mark.parametrize("scale", [(0, 0, 0), (0, 1, 1), (1, 1, 0)])
def test_a_scale_of_zero_is_named(make_cube, scale):
    make_cube("flat").scale = scale
    with pytest.raises(InvalidInput, match=r"object 'flat': its scale along . is zero"):
        extract_scene()


def test_a_flat_mesh_may_be_scaled_to_nothing_across_itself(make_plane):
    make_plane().scale = (1.0, 1.0, 0.0)
    mesh = only_mesh()
    assert mesh.corner_normals == pytest.approx(np.broadcast_to([0.0, 0.0, 1.0], (2, 3, 3)))


def test_an_empty_mesh_is_a_finding(scene):
    scene.collection.objects.link(bpy.data.objects.new("nothing", bpy.data.meshes.new("nothing")))
    snapshot = extract_scene()
    assert not snapshot.meshes
    assert [finding.subject for finding in snapshot.findings] == ["object 'nothing'"]


def test_what_is_not_simulated_is_listed(make_cube, scene):
    make_cube().visible_shadow = False
    scene.collection.objects.link(bpy.data.objects.new("cloud", bpy.data.volumes.new("cloud")))
    found = {finding.subject: finding.problem for finding in extract_scene().findings}
    assert "visible_shadow" in found["object 'Cube'"]
    assert "VOLUME" in found["object 'cloud'"]


def test_a_render_engine_gets_the_depsgraph_it_has(make_cube, make_camera, scene):
    make_cube().modifiers.new("subdivision", "SUBSURF").render_levels = 3
    make_camera()
    counts = []

    class Engine(bpy.types.RenderEngine):
        bl_idname, bl_label = "VLM_TEST", "test"

        def render(self, depsgraph):
            counts.append(extract_scene(depsgraph=depsgraph).triangle_count)

    bpy.utils.register_class(Engine)
    scene.render.engine = "VLM_TEST"
    bpy.ops.render.render()
    scene.render.engine = "CYCLES"
    bpy.utils.unregister_class(Engine)
    assert counts == [2 * 6 * 4**3]


def test_the_same_scene_gives_the_same_snapshot(make_cube, make_light, make_camera):
    from vlm_addon.core.array_codec import content_hash

    make_cube()
    make_light()
    make_camera()
    assert content_hash(extract_scene()) == content_hash(extract_scene())
