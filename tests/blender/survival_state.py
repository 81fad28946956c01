# SPDX-License-Identifier: GPL-3.0-or-later
"""What the survival campaign looks at after each step: the file's content by key, and what must hold of it."""

import hashlib
from collections import defaultdict

import bmesh
import bpy
import numpy as np

SOURCES = "survival_sources"
"""Custom property of each light mesh: the marks of the objects that it was made from, one a line; each of these
objects carries its mark as a custom property, and so do its copies."""
STAMPED = "survival_stamped"
"""Custom property of each light mesh: what it said of its sources when they were marked."""
MARK = "survival_mark"
NO_MARK = "-"
ORIGIN = "survival_origin"
"""Custom property of each visible object of a start scene: a name of its own that all its copies share."""
ORIGINS = "survival_origins"
"""Custom property of each light mesh: the origins of its sources, one a line."""
FACE_TYPES = {
    "vlm_color": "FLOAT_COLOR",
    "vlm_emission": "FLOAT_COLOR",
    "vlm_tag": "INT",
    "vlm_area_scale": "FLOAT",
    "vlm_lock": "INT",
    "vlm_mark": "INT",
}
FIELDS = {"FLOAT_COLOR": "color", "BYTE_COLOR": "color", "FLOAT_VECTOR": "vector", "FLOAT2": "vector"}
SIZES = {"FLOAT_COLOR": 4, "BYTE_COLOR": 4, "FLOAT_VECTOR": 3, "FLOAT2": 2, "INT32_2D": 2, "INT16_2D": 2}
NUMBERS = {"INT": np.int32, "INT8": np.int32, "BOOLEAN": np.bool_, "INT32_2D": np.int32, "INT16_2D": np.int32}
LINKED = "linked from"
MODE = "mode of"
NOT_CONTENT = (".select", ".uv_select", ".vs.", ".es.", ".pn.")
IDS = ("objects", "meshes", "materials", "collections", "scenes", "armatures", "lights", "images", "actions", "texts")


def content():
    """The file as {key: bytes or text}: objects, meshes with every attribute, materials, scenes; no selection."""
    found = {}
    for thing in bpy.data.objects:
        found[f"object {_name(thing)}"] = _object(thing)
        found[f"{MODE} {_name(thing)}"] = thing.mode
    edited = {thing.data.name_full: thing for thing in bpy.data.objects if thing.mode == "EDIT" and _is_mesh(thing)}
    for mesh in bpy.data.meshes:
        found.update(_mesh(mesh, edited.get(mesh.name_full)))
    for material in bpy.data.materials:
        found[f"material {_name(material)}"] = material_digest(material)
    for scene in bpy.data.scenes:
        findings = [item.text for item in scene.vlm.findings]
        found[f"scene {_name(scene)}"] = repr((sorted(_name(each) for each in scene.objects), findings))
    return found


def difference(one, other):
    """Keys of two contents that differ."""
    return sorted(key for key in one.keys() | other.keys() if one.get(key) != other.get(key))


def linked(contents):
    """What is linked of a content."""
    return {key: value for key, value in contents.items() if LINKED in key}


def undoable(contents):
    """What Blender's undo brings back of a content: what was linked stays loaded, paint modes are left."""
    return {key: value for key, value in contents.items() if LINKED not in key and not key.startswith(MODE)}


def _name(block):
    return f"{block.name!r}{f' {LINKED} {block.library.filepath}' if block.library else ''}"


def _is_mesh(thing):
    return thing.type == "MESH"


def _object(thing):
    properties = sorted((key, _plain(thing[key])) for key in thing.keys())  # noqa: SIM118 (not a dict)
    groups = [group.name for group in thing.vertex_groups]
    modifiers = [(each.name, each.type) for each in thing.modifiers]
    parent = thing.parent.name if thing.parent else None
    matrix = [tuple(row) for row in thing.matrix_basis]
    data = thing.data.name if thing.data else None
    homes = sorted(each.name for each in thing.users_collection)
    slots = [slot.material.name if slot.material else None for slot in thing.material_slots]
    shown = (thing.hide_render, thing.display_type)
    return repr((thing.type, data, properties, groups, modifiers, parent, matrix, homes, slots, shown))


def _plain(value):
    return list(value) if hasattr(value, "__len__") and not isinstance(value, str | bytes) else value


def _mesh(mesh, edited):
    """Content of one mesh; one in edit mode is read as it would be left."""
    key = f"mesh {_name(mesh)}"
    read = _left(edited) if edited is not None else mesh
    try:
        found = {f"{key} size": repr((len(read.vertices), len(read.edges), len(read.polygons), len(read.loops)))}
        for attribute in read.attributes:
            if not attribute.name.startswith(NOT_CONTENT):
                found[f"{key} {attribute.name}"] = (attribute.domain, attribute.data_type, _bytes(attribute))
        weights = [(group.group, group.weight) for vertex in read.vertices for group in vertex.groups]
        found[f"{key} weights"] = hashlib.sha1(repr(weights).encode()).hexdigest()
        loops = np.empty(len(read.loops), np.int32)
        read.loops.foreach_get("vertex_index", loops)
        found[f"{key} corners"] = loops.tobytes()
    finally:
        if read is not mesh:
            bpy.data.meshes.remove(read)
    keys = mesh.shape_keys
    blocks = [(block.name, [tuple(point.co) for point in block.data]) for block in keys.key_blocks] if keys else []
    found[f"{key} shapes"] = hashlib.sha1(repr(blocks).encode()).hexdigest()
    return found


def _left(thing):
    copy = bpy.data.meshes.new("survival copy")
    edited = bmesh.from_edit_mesh(thing.data).copy()
    edited.to_mesh(copy)
    edited.free()
    return copy


def _bytes(attribute):
    kind = attribute.data_type
    if kind not in SIZES and kind not in NUMBERS and kind != "FLOAT":
        return b""
    values = np.empty(len(attribute.data) * SIZES.get(kind, 1), NUMBERS.get(kind, np.float32))
    attribute.data.foreach_get(FIELDS.get(kind, "value"), values)
    return values.tobytes()


def material_digest(material):
    """All values and links of a material's nodes."""
    tree = material.node_tree
    parts = [repr(tuple(material.diffuse_color))]
    for node in tree.nodes if tree else ():
        values = [_plain(each.default_value) for each in node.inputs if hasattr(each, "default_value")]
        parts.append(f"{node.name} {node.bl_idname} {values!r}")
    for link in tree.links if tree else ():
        ends = (link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier)
        parts.append(repr(ends))
    return hashlib.sha1("\n".join(parts).encode()).hexdigest()


def unused():
    """Names of the data-blocks that nothing uses; Blender's own place for rendered pictures is none of them."""
    found = {
        f"{kind} {_name(each)}"
        for kind in IDS
        for each in getattr(bpy.data, kind)
        if not each.users and not each.library
    }
    return found - {"images 'Render Result'"}


def is_light_mesh(thing):
    """Whether an object is a light mesh, by the table in docs/architecture.md."""
    return thing.type == "MESH" and "vlm_schema" in thing


def marks_of(thing):
    """The marks of a light mesh's sources."""
    return [mark for mark in str(thing.get(SOURCES, "")).split("\n") if mark]


def mark_sources(numbers, changed):
    """Mark the sources of light meshes that are new or made anew, with `numbers`; returns how many were.

    changed: keys of the content that the last step changed. Made anew is what has other sources by name, or other
    ones by id and another mesh: ids alone change where copies are told apart.
    """
    marked = 0
    for scene in bpy.data.scenes:
        for thing in scene.objects:
            if is_light_mesh(thing) and "vlm_sources" in thing and not thing.library and not thing.override_library:
                marked += _mark(thing, scene, numbers, changed)
    return marked


def _mark(thing, scene, numbers, changed):
    names, ids = thing["vlm_sources"], str(list(thing.get("vlm_source_ids", ())))
    known_names, _, known_ids = str(thing.get(STAMPED, "")).rpartition("\n")
    same_mesh = not any(key.startswith(f"mesh {_name(thing.data)} ") for key in changed)
    if STAMPED in thing and known_names == names and (known_ids == ids or same_mesh):
        return False
    objects = [scene.objects.get(name) for name in thing["vlm_sources"].split("\n")]
    marks = [NO_MARK if each is None or each.library else f"{MARK} {next(numbers)}" for each in objects]
    for mark, each in zip(marks, objects, strict=True):
        if mark != NO_MARK:
            each[mark] = True
    thing[SOURCES], thing[STAMPED] = "\n".join(marks), f"{names}\n{ids}"
    thing[ORIGINS] = "\n".join(NO_MARK if each is None else str(each.get(ORIGIN, NO_MARK)) for each in objects)
    return True


def faults(light_meshes_module):
    """What does not hold of the file, as sentences."""
    found = []
    for scene in bpy.data.scenes:
        for thing in scene.objects:
            if is_light_mesh(thing):
                found += _light_mesh_faults(thing, scene, light_meshes_module)
    for mesh in bpy.data.meshes:
        found += _attribute_faults(mesh)
    return found


def _light_mesh_faults(thing, scene, light_meshes_module):
    found = []
    resolved = light_meshes_module.sources(thing, scene)
    ids = [*thing.get("vlm_source_ids", ()), *len(resolved) * [0]]
    origins = str(thing.get(ORIGINS, "")).split("\n")
    for mark, source, number, origin in zip(marks_of(thing), resolved, ids, origins, strict=False):
        there = [each for each in scene.objects if mark in each and not is_light_mesh(each)]
        same = [each for each in there if each.get("vlm_id", 0) in (0, number)]
        if source is None and same:
            found.append(f"{thing.name!r} does not find its source {same[0].name!r}")
        elif source is not None and there and source not in there and not _is_copy(source, there, number):
            found.append(f"{thing.name!r} takes {source.name!r} for its source {there[0].name!r}")
        elif source is not None and not there and NO_MARK not in (mark, origin) and _is_other(source, origin):
            found.append(f"{thing.name!r} takes {source.name!r} for a source that is gone")
    return found


def _is_copy(source, there, number):
    """Whether an object shares its id with the right ones, as appended and duplicated copies do: its name decides."""
    return source.get("vlm_id") == number and any(each.get("vlm_id") == number for each in there)


def _is_other(source, origin):
    """Whether an object is no copy of the one that is gone, nor one without an id that has its name."""
    return source.get(ORIGIN) != origin and "vlm_id" in source


def _attribute_faults(mesh):
    found = []
    for attribute in mesh.attributes if not mesh.is_editmode else ():
        wanted = FACE_TYPES.get(attribute.name)
        if wanted is None:
            if attribute.name.startswith("vlm_"):
                found.append(f"mesh {mesh.name!r} has an attribute {attribute.name!r} that no table names")
            continue
        if (attribute.domain, attribute.data_type) != ("FACE", wanted):
            found.append(f"{attribute.name} of {mesh.name!r} is {attribute.data_type} on {attribute.domain}")
        elif len(attribute.data) != len(mesh.polygons):
            found.append(f"{attribute.name} of {mesh.name!r} has {len(attribute.data)} values")
        elif attribute.name in ("vlm_color", "vlm_emission", "vlm_area_scale"):
            values = np.frombuffer(_bytes(attribute), np.float32)
            if not (np.isfinite(values).all() and (values >= 0.0).all()):
                found.append(f"{attribute.name} of {mesh.name!r} has a value that no light can have")
    return found


def shared_tags():
    """Tag ids that light meshes of unrelated sources share, as {id: names}: none of them may be there after a repair.

    Related are light meshes with a source in common, directly or through others that carry the id.
    """
    carriers = defaultdict(list)
    for thing in bpy.data.objects:
        if is_light_mesh(thing) and thing.data is not None and not thing.data.is_editmode and _origins(thing):
            attribute = thing.data.attributes.get("vlm_tag")
            tags = np.frombuffer(_bytes(attribute), np.int32) if attribute else ()
            for tag in {int(each) for each in tags} - {0}:
                carriers[tag].append(thing)
    return {
        tag: sorted(thing.name for thing in things)
        for tag, things in carriers.items()
        if len(_families([_origins(thing) for thing in things])) > 1
    }


def _origins(thing):
    """The origins of a light mesh's sources."""
    return {origin for origin in str(thing.get(ORIGINS, "")).split("\n") if origin and origin != NO_MARK}


def _families(groups):
    """Sets joined wherever they share a member."""
    families = []
    for group in groups:
        met = [family for family in families if family & group]
        families = [family for family in families if not family & group] + [group.union(*met)]
    return families
