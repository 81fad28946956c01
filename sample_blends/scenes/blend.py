# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender objects of the sample scenes: meshes, materials, lamps, cameras, light meshes. Same calls in 4.2 to 5.x."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import mathutils
import numpy as np
import numpy.typing as npt

from .shapes import Shape, join, shape, triangles_of

Rgb = tuple[float, float, float]
LIGHT_MESH_COLLECTION = "Virtual Light Meshes"
LIGHT_MESH_SCHEMA = 1


def empty_scene(name: str, width: int, height: int, view_transform: str = "Standard") -> Any:
    """A scene without objects and with a black world, set up for Cycles; everything else in memory is dropped."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.name = name
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = view_transform
    scene.cycles.samples = 256
    scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_indirect = 0.0
    scene.world = bpy.data.worlds.new("World")
    set_world(scene, (0.0, 0.0, 0.0), 0.0)
    return scene


def set_world(scene: Any, color: Rgb, strength: float) -> None:
    """A uniform background; radiance = color x strength, W/(m² sr)."""
    scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength


def collection(scene: Any, name: str) -> Any:
    """The collection of that name under the scene, made if missing."""
    found = bpy.data.collections.get(name)
    if found is None:
        found = bpy.data.collections.new(name)
        scene.collection.children.link(found)
    return found


def _new_material(name: str) -> tuple[Any, Any]:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.node_tree.nodes.clear()
    return material, material.node_tree


def _finish(material: Any, shader: Any, color: Rgb) -> Any:
    tree = material.node_tree
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    output.location = (300, 0)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    material.diffuse_color = (*color, 1.0)
    return material


def diffuse(name: str, color: Rgb) -> Any:
    """A Diffuse BSDF of one reflectance, linear Rec.709."""
    material, tree = _new_material(name)
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*color, 1.0)
    return _finish(material, shader, color)


@dataclass(frozen=True)
class Emission:
    """What a surface sends out by itself: radiance = color x strength, W/(m² sr)."""

    color: Rgb
    strength: float


def principled(
    name: str,
    color: Rgb,
    roughness: float = 0.5,
    metallic: float = 0.0,
    image: Any = None,
    emission: Emission | None = None,
) -> Any:
    """A Principled BSDF; `image` (its pixels already the base colour) replaces `color`."""
    material, tree = _new_material(name)
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Metallic"].default_value = metallic
    if image is not None:
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        texture.location = (-320, 0)
        tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    if emission is not None:
        shader.inputs["Emission Color"].default_value = (*emission.color, 1.0)
        shader.inputs["Emission Strength"].default_value = emission.strength
    return _finish(material, shader, color)


def packed_image(name: str, pixels: npt.NDArray[np.uint8]) -> Any:
    """An sRGB image stored inside the file as PNG. pixels: (h, w, 3), row 0 at the bottom."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=False)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels.astype(np.float32) / 255.0
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
    return image


def mesh_data(name: str, source: Shape, materials: Sequence[Any] = ()) -> Any:
    """A Blender mesh of a shape, with one UV layer where the shape has UVs."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(source.vertices.tolist(), [], [list(face) for face in source.faces])
    for material in materials:
        mesh.materials.append(material)
    if len(materials) > 1:
        mesh.polygons.foreach_set("material_index", np.array(source.materials, np.int32))
    if source.uvs is not None:
        layer = mesh.uv_layers.new(name="UVMap")
        layer.uv.foreach_set("vector", source.uvs.astype(np.float32).ravel())
    mesh.polygons.foreach_set("use_smooth", np.full(len(source.faces), source.smooth))
    mesh.update()
    return mesh


def add_object(scene: Any, name: str, data: Any, into: Any = None) -> Any:
    """An object of some data, linked into a collection (the scene's own by default)."""
    added = bpy.data.objects.new(name, data)
    (into or scene.collection).objects.link(added)
    return added


def add_mesh(scene: Any, name: str, source: Shape, *materials: Any, into: Any = None) -> Any:
    """A mesh object of a shape."""
    return add_object(scene, name, mesh_data(name, source, materials), into)


def look_at(thing: Any, position: Sequence[float], target: Sequence[float]) -> None:
    """Places an object so that its -z points from position to target, its y as far up as can be."""
    direction = mathutils.Vector(target) - mathutils.Vector(position)
    thing.location = position
    thing.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()


def add_camera(
    scene: Any,
    position: Sequence[float],
    target: Sequence[float],
    lens_mm: float = 35.0,
    sensor_mm: float = 36.0,
    name: str = "Camera",
    clip: tuple[float, float] = (0.05, 200.0),
) -> Any:
    """A perspective camera; the first one added becomes the scene's."""
    data = bpy.data.cameras.new(name)
    data.lens, data.sensor_width = lens_mm, sensor_mm
    data.clip_start, data.clip_end = clip
    camera = add_object(scene, name, data)
    look_at(camera, position, target)
    if scene.camera is None:
        scene.camera = camera
    return camera


def add_lamp(
    scene: Any,
    name: str,
    kind: str,
    power: float,
    position: Sequence[float],
    target: Sequence[float] | None = None,
    color: Rgb = (1.0, 1.0, 1.0),
) -> Any:
    """A lamp of Blender's kind POINT, SPOT, SUN or AREA; power in W (SUN: W/m²). Returns the object."""
    data = bpy.data.lights.new(name, kind)
    data.energy, data.color = power, color
    lamp = add_object(scene, name, data)
    lamp.location = position
    if target is not None:
        look_at(lamp, position, target)
    return lamp


def add_spot(
    scene: Any,
    name: str,
    power: float,
    position: Sequence[float],
    target: Sequence[float],
    full_angle_degrees: float,
    blend: float = 0.15,
    radius: float = 0.0,
    color: Rgb = (1.0, 1.0, 1.0),
) -> Any:
    """A spot lamp of that full cone angle."""
    lamp = add_lamp(scene, name, "SPOT", power, position, target, color)
    lamp.data.spot_size = math.radians(full_angle_degrees)
    lamp.data.spot_blend = blend
    lamp.data.shadow_soft_size = radius
    return lamp


@dataclass(frozen=True)
class LightPatch:
    """Hand-drawn virtual lights: triangles of one colour and tag.

    color: diffuse reflectance of the surface they stand for. tag: 0 for none. area_scale: area of that surface over
    the lights' own.
    """

    lights: Shape
    color: Rgb
    tag: int = 0
    area_scale: float = 1.0


def add_light_mesh(scene: Any, name: str, patches: Sequence[LightPatch]) -> Any:
    """A virtual light mesh stored as docs/architecture.md says; one face per light."""
    parts = [shape(patch.lights.vertices, triangles_of(patch.lights).tolist()) for patch in patches]
    counts = [len(part.faces) for part in parts]
    mesh = mesh_data(name, join(parts))
    colors = np.repeat([(*patch.color, 1.0) for patch in patches], counts, axis=0)
    black = np.tile((0.0, 0.0, 0.0, 1.0), (sum(counts), 1))
    for attribute, kind, key, values in (
        ("vlm_color", "FLOAT_COLOR", "color", colors),
        ("vlm_emission", "FLOAT_COLOR", "color", black),
        ("vlm_tag", "INT", "value", np.repeat([patch.tag for patch in patches], counts)),
        ("vlm_area_scale", "FLOAT", "value", np.repeat([patch.area_scale for patch in patches], counts)),
    ):
        dtype = np.int32 if kind == "INT" else np.float32
        mesh.attributes.new(attribute, kind, "FACE").data.foreach_set(key, values.astype(dtype).ravel())
    added = add_object(scene, name, mesh, collection(scene, LIGHT_MESH_COLLECTION))
    added["vlm_schema"] = LIGHT_MESH_SCHEMA
    added["vlm_strength"] = 1.0
    added["vlm_hue"] = [1.0, 1.0, 1.0]
    added["vlm_dynamic"] = False
    added.display_type = "WIRE"
    added.hide_render = True
    return added


def save(path: str) -> None:
    """Writes the compressed .blend without a backup of an older one."""
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=path, compress=True, check_existing=False)
