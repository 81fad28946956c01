# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes for tests of the Blender bridge. Every test starts from a file without objects."""

from contextlib import ExitStack
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

import numpy as np  # noqa: E402


@pytest.fixture(autouse=True)
def _empty_file():
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.fixture
def make_mesh():
    """make_mesh(name, vertices, faces, **links): a mesh object linked to the scene."""

    def make(name, vertices, faces, collection=None, material=None):
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([tuple(map(float, v)) for v in vertices], [], faces)
        if material is not None:
            mesh.materials.append(material)
        blender_object = bpy.data.objects.new(name, mesh)
        (collection or bpy.context.scene.collection).objects.link(blender_object)
        return blender_object

    return make


@pytest.fixture
def make_cube(make_mesh):
    """make_cube(name): a cube of edge 2 around the origin, faces outward."""

    def make(name="Cube", **links):
        corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return make_mesh(name, corners, faces, **links)

    return make


@pytest.fixture
def make_plane(make_mesh):
    """make_plane(name, size): a square of that edge in z = 0, facing +z, with a UV map over [0, 1]."""

    def make(name="Plane", size=2.0, **links):
        h = size / 2
        blender_object = make_mesh(name, [(-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)], [(0, 1, 2, 3)], **links)
        layer = blender_object.data.uv_layers.new(name="UVMap")
        layer.uv.foreach_set("vector", np.array([0, 0, 1, 0, 1, 1, 0, 1], np.float32))
        return blender_object

    return make


@pytest.fixture
def make_light():
    """make_light(kind, energy, location): a lamp linked to the scene."""

    def make(kind="POINT", energy=100.0, location=(0.0, 0.0, 0.0), name="Lamp"):
        lamp = bpy.data.lights.new(name, kind)
        lamp.energy = energy
        blender_object = bpy.data.objects.new(name, lamp)
        blender_object.location = location
        bpy.context.scene.collection.objects.link(blender_object)
        return blender_object

    return make


@pytest.fixture
def make_camera():
    """make_camera(location, rotation): a camera that is the scene's."""

    def make(location=(0.0, 0.0, 5.0), rotation=(0.0, 0.0, 0.0), name="Camera"):
        blender_object = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        blender_object.location = location
        blender_object.rotation_euler = rotation
        bpy.context.scene.collection.objects.link(blender_object)
        bpy.context.scene.camera = blender_object
        return blender_object

    return make


@pytest.fixture
def make_material():
    """make_material(name, node_type): a material with one shader node and its output; returns (material, node)."""

    def make(name="Material", node_type="ShaderNodeBsdfPrincipled"):
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0):
            material.use_nodes = True
        nodes = material.node_tree.nodes
        nodes.clear()
        output = nodes.new("ShaderNodeOutputMaterial")
        shader = nodes.new(node_type)
        material.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
        return material, shader

    return make


@pytest.fixture
def cube_lights(make_cube):
    """The light mesh of a cube of edge 2, active: twelve lights just inside, each half of a side."""
    # only tests that ask for it import the package: those of the installed extension must not
    from vlm_addon.bake import BakeSettings
    from vlm_addon.blender import authoring
    from vlm_addon.blender.interface.properties import ensure_scene_settings
    from vlm_addon.core.progress import silent

    ensure_scene_settings()
    make_cube()
    bpy.context.view_layer.update()
    authoring.write(authoring.from_scene(bpy.context, BakeSettings())(silent))
    thing = bpy.data.objects["VLM"]
    bpy.context.view_layer.objects.active = thing
    return thing


@pytest.fixture
def watched_bakes(_empty_file):
    """Scene settings and the handlers that say whether what is baked may be out of date."""
    from vlm_addon.blender.baking import bake_state
    from vlm_addon.blender.interface.properties import register_scene_settings

    with ExitStack() as undo:
        if not hasattr(bpy.types.Scene, "vlm"):
            register_scene_settings(undo)
        bake_state.register(undo)
        yield


@pytest.fixture
def scene():
    """The scene of the file."""
    return bpy.context.scene


@pytest.fixture
def file_state():
    """file_state(): what a test compares to know that nothing of the file was left changed."""

    def state():
        scene = bpy.context.scene
        settings = {}
        for owner in (scene.render, scene.render.image_settings, scene.cycles, scene.view_settings):
            for prop in owner.bl_rna.properties:
                value = getattr(owner, prop.identifier, None)
                if isinstance(value, bool | int | float | str):
                    settings[f"{owner.bl_rna.identifier}.{prop.identifier}"] = value
        data = {
            name: sorted(item.name for item in getattr(bpy.data, name))
            for name in ("objects", "meshes", "materials", "images", "cameras", "scenes", "collections")
        }
        data["images"] = [name for name in data["images"] if name not in ("Render Result", "Viewer Node")]
        layers = [(layer.name, layer.use, layer.use_pass_diffuse_direct) for layer in scene.view_layers]
        hidden = [(item.name, item.hide_render, item.hide_viewport) for item in bpy.data.objects]
        return settings, data, layers, hidden, scene.camera.name if scene.camera else None

    return state


@pytest.fixture
def sample_folder():
    """The folder of committed sample scenes."""
    return Path(__file__).resolve().parents[2] / "sample_blends"


@pytest.fixture
def reads(monkeypatch):
    """Names of the materials that are read, as they are read, while changes are listened for."""
    from vlm_addon.blender.extraction import kept_materials

    seen = []
    table = kept_materials.MaterialTable
    read = table._surface

    def counted(self, material):
        seen.append(material.name)
        return read(self, material)

    monkeypatch.setattr(table, "_surface", counted)
    with ExitStack() as undo:
        kept_materials.register(undo)
        yield seen
