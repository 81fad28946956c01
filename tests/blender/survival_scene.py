# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension loaded from the checkout, and the scenes in which the survival campaign begins."""

import importlib.util
import sys
from pathlib import Path

import bpy
from survival_state import ORIGIN

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "vlm_extension"
NAMES = ("Wall", "Würfel", "名前", "Cube.001", "a b", "very long " + 50 * "n", "VLM", "Virtual Light Meshes")
COLORS = {"grey": (0.7, 0.7, 0.7, 1.0), "red": (0.8, 0.05, 0.05, 1.0), "blue": (0.05, 0.1, 0.8, 1.0)}
STARTS = ("room", "models", "figure")


def load_extension():
    """The extension's root package, as Blender would load it, registered."""
    spec = importlib.util.spec_from_file_location(PACKAGE, ROOT / "__init__.py", submodule_search_locations=[str(ROOT)])
    module = importlib.util.module_from_spec(spec)
    sys.modules[PACKAGE] = module
    spec.loader.exec_module(module)
    module.register()
    return module


def build_start(name, path):
    """Write the start scene `name` to `path`."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.vlm.samples = 1
    _room()
    _lamp_and_camera(scene)
    {"room": lambda: None, "models": _models, "figure": _figure}[name]()
    for number, thing in enumerate(each for each in bpy.data.objects if each.type == "MESH"):
        thing[ORIGIN] = f"{name} {number}"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def _room():
    bpy.ops.mesh.primitive_cube_add(size=6.0)
    walls = bpy.context.object
    walls.name = "Room"
    walls.data.flip_normals()
    for name, color in COLORS.items():
        walls.data.materials.append(_material(name, color))
    for polygon in walls.data.polygons:
        polygon.material_index = polygon.index % len(COLORS)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(1.0, 1.0, -2.0))
    bpy.context.object.data.materials.append(bpy.data.materials["red"])


def _models():
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, location=(-1.0, 0.0, -1.0))
    bpy.context.object.modifiers.new("Subdivision", "SUBSURF").levels = 1
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=3, y_subdivisions=3, size=2.0, location=(1.0, -1.0, 0.5))
    bpy.context.object.name = "Sheet"
    copies = bpy.data.collections.new("Instanced")
    cone = bpy.data.objects.new("Cone", bpy.data.meshes["Grid"].copy())
    copies.objects.link(cone)
    instances = bpy.data.objects.new("Instances", None)
    instances.instance_type, instances.instance_collection = "COLLECTION", copies
    instances.location = (0.0, 2.0, 0.0)
    bpy.context.scene.collection.objects.link(instances)


def _figure():
    bpy.ops.object.armature_add(location=(0.0, 0.0, -2.0))
    armature = bpy.context.object
    bpy.ops.mesh.primitive_cylinder_add(vertices=8, depth=2.0, radius=0.3, location=(0.0, 0.0, -1.5))
    body = bpy.context.object
    body.name = "Body"
    body.vertex_groups.new(name="Bone").add(range(len(body.data.vertices)), 1.0, "REPLACE")
    body.modifiers.new("Armature", "ARMATURE").object = armature
    body.shape_key_add(name="Basis")
    key = body.shape_key_add(name="Taller")
    for point in key.data:
        point.co.z *= 1.5
    key.value = 0.0
    key.keyframe_insert("value", frame=1)
    key.value = 1.0
    key.keyframe_insert("value", frame=10)


def _material(name, color):
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color
    return material


def _lamp_and_camera(scene):
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.data.energy, lamp.location = 200.0, (0.0, 0.0, 2.0)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -2.8, 0.0), (1.57, 0.0, 0.0)
    for thing in (lamp, camera):
        scene.collection.objects.link(thing)
    scene.camera = camera
