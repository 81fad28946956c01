# SPDX-License-Identifier: GPL-3.0-or-later
"""A finely subdivided head floating in a closed box under a spotlight: the setting of seed 001 with Blender's monkey.

Three Catmull-Clark levels of the monkey alone give 62,976 triangles; one more edge loop through its longest ring of
quads makes that 69,696, as many as the bunny's 69,451 for all that matters here. Any other mesh can float instead.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bmesh
import bpy
import numpy as np
import numpy.typing as npt

from . import blend
from .shapes import Shape, room_walls, shape

BOX = (4.0, 4.0, 3.0)  # across, deep, high
FLOATER_CENTRE = (0.0, 2.2, 1.3)
FLOATER_EXTENT = 1.5  # the longest side of its bounding box
RENDER_LEVELS, VIEWPORT_LEVELS = 3, 1

WHITE, RED, BLUE = (0.75, 0.75, 0.75), (0.63, 0.10, 0.08), (0.12, 0.22, 0.60)
FLOATER_COLOR = (0.60, 0.55, 0.46)
SPOT_POWER_W, SPOT_DEGREES = 300.0, 62.0


def longest_quad_ring(cage: Any) -> list[Any]:
    """Edges of a bmesh that lie opposite each other across the most quads."""
    remaining, longest = set(cage.edges), []
    for start in cage.edges:
        if start not in remaining:
            continue
        ring, waiting = {start}, [start]
        while waiting:
            edge = waiting.pop()
            for loop in edge.link_loops:
                opposite = loop.link_loop_next.link_loop_next.edge
                if len(loop.face.verts) == 4 and opposite not in ring:
                    ring.add(opposite)
                    waiting.append(opposite)
        remaining -= ring
        if len(ring) > len(longest):
            longest = sorted(ring, key=lambda edge: int(edge.index))
    return longest


def monkey_cage() -> Shape:
    """The coarse monkey with one more edge loop, looking along -y."""
    cage = bmesh.new()
    try:
        bmesh.ops.create_monkey(cage)
        bmesh.ops.subdivide_edges(cage, edges=longest_quad_ring(cage), cuts=1, use_grid_fill=True)
        cage.verts.index_update()
        vertices = [tuple(vertex.co) for vertex in cage.verts]
        faces = [[vertex.index for vertex in face.verts] for face in cage.faces]
    finally:
        cage.free()
    return shape(vertices, faces, smooth=True)


def read_mesh(path: Path) -> Shape:
    """All polygons of an OBJ, PLY or glTF file as one smooth shape, z up. Raises SystemExit for other files."""
    importers = {
        ".obj": bpy.ops.wm.obj_import,
        ".ply": bpy.ops.wm.ply_import,
        ".gltf": bpy.ops.import_scene.gltf,
        ".glb": bpy.ops.import_scene.gltf,
    }
    if path.suffix.lower() not in importers or not path.is_file():
        raise SystemExit(f"{path}: not a readable OBJ, PLY or glTF file; give the path of one")
    present = set(bpy.data.objects)
    importers[path.suffix.lower()](filepath=str(path))
    imported = sorted(set(bpy.data.objects) - present, key=lambda thing: str(thing.name))
    vertices: list[npt.NDArray[np.float64]] = []
    faces: list[list[int]] = []
    for thing in imported:
        if thing.type != "MESH":
            continue
        start = sum(len(part) for part in vertices)
        matrix = np.array(thing.matrix_world)
        local = np.empty(3 * len(thing.data.vertices), np.float32)
        thing.data.vertices.foreach_get("co", local)
        vertices.append(local.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3])
        faces += [[start + index for index in polygon.vertices] for polygon in thing.data.polygons]
    for thing in imported:
        bpy.data.objects.remove(thing)
    if not faces:
        raise SystemExit(f"{path}: no polygons; give a file with a mesh")
    return shape(np.concatenate(vertices), faces, smooth=True)


def fitted(source: Shape) -> Shape:
    """The shape centred on the origin, its longest side FLOATER_EXTENT."""
    low, high = source.vertices.min(axis=0), source.vertices.max(axis=0)
    vertices = (source.vertices - (low + high) / 2) * (FLOATER_EXTENT / (high - low).max())
    return Shape(vertices, source.faces, source.materials, source.uvs, source.smooth)


def add_floater(scene: Any, mesh_path: Path | None) -> None:
    """The monkey with its modifier, or the given mesh as it is."""
    material = blend.diffuse("Floater", FLOATER_COLOR)
    if mesh_path is None:
        floater = blend.add_mesh(scene, "Monkey", fitted(monkey_cage()), material)
        modifier = floater.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels, modifier.render_levels = VIEWPORT_LEVELS, RENDER_LEVELS
    else:
        floater = blend.add_mesh(scene, mesh_path.stem, fitted(read_mesh(mesh_path)), material)
    floater.location = FLOATER_CENTRE


def build(mesh_path: Path | None = None) -> None:
    """Fills the current file with the scene."""
    scene = blend.empty_scene("monkey_box", 640, 480)
    white = blend.diffuse("White", WHITE)
    colors = {"Red wall": blend.diffuse("Red", RED), "Blue wall": blend.diffuse("Blue", BLUE)}
    for name, wall in room_walls(BOX, "Red wall", "Blue wall").items():
        blend.add_mesh(scene, name, wall, colors.get(name, white))
    add_floater(scene, mesh_path)
    blend.add_spot(scene, "Spot", SPOT_POWER_W, (1.2, 0.3, 2.6), (-0.2, 2.35, 1.05), SPOT_DEGREES, 0.25, 0.05)
    blend.add_camera(scene, (0.0, 0.06, 1.5), (0.0, 2.0, 1.42), lens_mm=22.0)
