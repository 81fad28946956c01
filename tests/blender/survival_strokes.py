# SPDX-License-Identifier: GPL-3.0-or-later
"""Strokes for the drawing operators: points on faces that are in the scene, as the operators take them."""

import bmesh
from mathutils import Vector
from survival_actions import meshes

_CORNERS = [Vector((x, y, 0.0)) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
SQUARE = (Vector((0.5, 0.5, 0.0)), _CORNERS, Vector((0.0, 0.0, 1.0)))


def polygon(random):
    """Corners of a part of a visible face, turning as the face does."""
    center, corners, normal = _face(random, light=False)
    return {"points": _text(_toward(center, corners, 0.8)), "normals": _text([normal])}


def rectangle(random):
    """Two opposite corners on a visible face."""
    center, corners, normal = _face(random, light=False)
    ends = _toward(center, [corners[0], corners[len(corners) // 2]], 0.5)
    grid = {"columns": random.randint(1, 3), "rows": random.randint(1, 3)}
    return {"points": _text(ends), "normals": _text([normal]), **grid}


def extrusion(random):
    """An edge on a visible face and a way from there over the face."""
    center, corners, normal = _face(random, light=False)
    edge = _toward(center, corners[:2], 0.5)
    return {"edge": _text(edge), "points": _text(_toward(center, corners[2:3], 0.5)), "normals": _text([normal])}


def erasure(random):
    """A point on a light."""
    center, _, normal = _face(random, light=True)
    return {"points": _text([center]), "normals": _text([normal]), "radius": random.choice((0.001, 0.1))}


def cut(random):
    """A way across a light, from outside to outside."""
    center, corners, normal = _face(random, light=True)
    return {"points": _text(_toward(center, [corners[0], 2 * center - corners[0]], 1.5)), "normals": _text([normal])}


def _face(random, light):
    """(centre, corners, normal) in world space of some face; of a unit square where there is none."""
    things = [thing for thing in meshes(light) if thing.visible_get() and len(thing.data.polygons)]
    things = things or [thing for thing in meshes() if len(thing.data.polygons)]
    if not things:
        return SQUARE
    thing = random.choice(things)
    if thing.mode == "EDIT":
        edited = bmesh.from_edit_mesh(thing.data)
        edited.faces.ensure_lookup_table()
        face = random.choice(list(edited.faces))
        local, normal = [vertex.co.copy() for vertex in face.verts], face.normal.copy()
    else:
        face = random.choice(list(thing.data.polygons))
        local, normal = [thing.data.vertices[index].co.copy() for index in face.vertices], face.normal.copy()
    matrix = thing.matrix_world
    corners = [matrix @ point for point in local]
    center = sum(corners[1:], corners[0]) / len(corners)
    return center, corners, (matrix.to_3x3().inverted_safe().transposed() @ normal).normalized()


def _toward(center, corners, share):
    return [center + share * (corner - center) for corner in corners]


def _text(points):
    return ", ".join(" ".join(repr(float(value)) for value in point) for point in points)


STROKES = {
    "draw_cut": cut,
    "draw_erase": erasure,
    "draw_extrude": extrusion,
    "draw_polygon": polygon,
    "draw_rectangle": rectangle,
}
