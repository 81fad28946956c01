# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of whatever a file may hold. Each leaves its objects selected and returns what creation is called with."""

import math
import tempfile
from pathlib import Path

import bpy
import numpy as np

SCENES = {}


def scene(build):
    """Keep a function that builds a scene, under its name."""
    SCENES[build.__name__] = build
    return build


def linked(thing):
    """`thing` in the scene, selected and active."""
    if thing.name not in bpy.context.scene.collection.objects:
        bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.update()
    for each in bpy.context.view_layer.objects:
        each.select_set(each == thing)
    bpy.context.view_layer.objects.active = thing
    return thing


def grid(**changes):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=3, y_subdivisions=3)
    return changed(bpy.context.object, changes)


def cube(**changes):
    bpy.ops.mesh.primitive_cube_add()
    return changed(bpy.context.object, changes)


def changed(thing, changes):
    for name, value in changes.items():
        setattr(thing, name, value)
    return thing


def shape(vertices, faces, edges=()):
    mesh = bpy.data.meshes.new("Shape")
    mesh.from_pydata(vertices, list(edges), faces)
    return linked(bpy.data.objects.new("Shape", mesh))


def lights(count):
    return {"target_triangles": count}


def simple(name, build, **values):
    SCENES[name] = lambda: (build(), values)[1]


for _budget in (1, 2, 10_000_000):
    simple(f"budget_{_budget}", grid, target_triangles=_budget)
simple("nothing", lambda: None)
simple("nothing_selected", lambda: grid().select_set(False))
simple("hidden_in_viewport", lambda: grid(hide_viewport=True))
simple("hidden_in_renders", lambda: grid(hide_render=True))
simple("camera", lambda: bpy.ops.object.camera_add())
simple("lattice", lambda: bpy.ops.object.add(type="LATTICE"))
simple("edges_alone", lambda: shape([(0, 0, 0), (1, 0, 0)], [], [(0, 1)]))
simple("faces_without_area", lambda: shape([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]))
simple("mirrored", lambda: cube(scale=(-1, 2, 1)))
simple("flattened", lambda: cube(scale=(0, 1, 1)))
simple("huge", lambda: cube(scale=(1e6, 1e6, 1e6)))
simple("tiny", lambda: cube(scale=(1e-6, 1e-6, 1e-6)))
simple("far", lambda: cube(location=(1e6, 0, 0)))
simple("beyond_all", lambda: cube(scale=(1e30, 1e30, 1e30)))
simple("location_that_is_none", lambda: cube(location=(math.nan, 0, 0)))
simple("flat_curve", lambda: bpy.ops.curve.primitive_bezier_circle_add())
simple("text", lambda: bpy.ops.object.text_add(), target_triangles=20)
simple("metaball", lambda: bpy.ops.object.metaball_add(), target_triangles=20)
simple("nurbs", lambda: bpy.ops.surface.primitive_nurbs_surface_sphere_add(), target_triangles=20)


@scene
def soup():
    points = np.random.default_rng(1).normal(size=(90, 3)).tolist()
    shape(points, [(row, row + 1, row + 2) for row in range(0, 87, 3)] + [(0, 1, 5), (0, 1, 6), (0, 1, 7)])
    return lights(12)


@scene
def vertex_that_is_none():
    grid().data.vertices[3].co = (math.nan, 0.0, 0.0)


@scene
def vertex_without_end():
    grid().data.vertices[3].co = (math.inf, 0.0, 0.0)


@scene
def thick_curve():
    bpy.ops.curve.primitive_bezier_circle_add()
    bpy.context.object.data.bevel_depth = 0.1
    bpy.context.object.data.resolution_u = 2
    return lights(20)


@scene
def geometry_node_instances():
    plane, small = grid(), cube()
    tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "NodeGroupOutput", "GeometryNodeInstanceOnPoints", "GeometryNodeObjectInfo")
    given, out, on_points, info = map(tree.nodes.new, kinds)
    info.inputs["Object"].default_value = small
    tree.links.new(given.outputs[0], on_points.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], on_points.inputs["Instance"])
    tree.links.new(on_points.outputs[0], out.inputs[0])
    plane.modifiers.new("Instances", "NODES").node_group = tree
    linked(plane)
    return lights(60)


@scene
def shape_keys():
    thing = grid()
    thing.shape_key_add(name="Basis")
    key = thing.shape_key_add(name="Up")
    key.data[0].co.z, key.value = 1.0, 1.0
    return lights(12)


@scene
def mesh_of_two_objects():
    first = grid()
    second = linked(bpy.data.objects.new("Second", first.data))
    second.location.x = 3.0
    first.select_set(True)
    return lights(12)


@scene
def linked_object():
    thing = grid()
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "library.blend")
        bpy.data.libraries.write(path, {thing})
        bpy.data.objects.remove(thing)
        with bpy.data.libraries.load(path, link=True) as (_, wanted):
            wanted.objects = ["Grid"]
    linked(wanted.objects[0])
    return lights(8)


@scene
def edit_mode():
    grid()
    bpy.ops.object.mode_set(mode="EDIT")


@scene
def sculpt_mode():
    grid()
    bpy.ops.object.mode_set(mode="SCULPT")


@scene
def another_scene():
    grid()
    bpy.context.window.scene = bpy.data.scenes.new("Another")


@scene
def another_view_layer():
    grid()
    bpy.context.window.view_layer = bpy.context.scene.view_layers.new("Another")
    return lights(8)


@scene
def excluded_collection():
    thing, apart = grid(), bpy.data.collections.new("Apart")
    bpy.context.scene.collection.children.link(apart)
    apart.objects.link(thing)
    bpy.context.scene.collection.objects.unlink(thing)
    bpy.context.view_layer.layer_collection.children["Apart"].exclude = True


@scene
def excluded_light_meshes():
    thing = grid()
    bpy.ops.vlm.create_from_selection(target_triangles=8)
    bpy.context.view_layer.layer_collection.children["Virtual Light Meshes"].exclude = True
    linked(thing)
    return lights(8)


@scene
def light_mesh_selected():
    grid()
    bpy.ops.vlm.create_from_selection(target_triangles=8)
    linked(bpy.data.objects["VLM Grid"])


@scene
def painted_to_have_no_lights():
    thing = grid()
    thing.vertex_groups.new(name="VLM None").add(range(len(thing.data.vertices)), 1.0, "REPLACE")


@scene
def more_locked_than_asked_for():
    thing = grid()
    bpy.ops.vlm.create_from_selection(target_triangles=8)
    linked(bpy.data.objects["VLM Grid"])
    bpy.ops.vlm.lock_lights()
    linked(thing)
    return lights(4)
