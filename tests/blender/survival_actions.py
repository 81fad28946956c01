# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists do with Blender itself between our operators: each action takes its own random numbers.

A refusal of Blender (RuntimeError of a poll) is Blender's; every action leaves exactly one undo step or none.
"""

import bmesh
import bpy
from survival_scene import NAMES
from survival_state import is_light_mesh

MOST_FACES = 600
MOST_OBJECTS = 24
NO_STEP = {"undo", "redo", "save", "reload"}
"""Actions that add no undo step of their own."""


def meshes(light=None):
    """Mesh objects of the view layer; only light meshes (True) or only others (False)."""
    things = [thing for thing in bpy.context.view_layer.objects if thing.type == "MESH"]
    return [thing for thing in things if light is None or is_light_mesh(thing) == light]


def to_object_mode():
    """Leave edit mode, whatever is in it."""
    if bpy.context.mode != "OBJECT" and bpy.context.object is not None:
        bpy.ops.object.mode_set(mode="OBJECT")


def choose(things):
    """Make exactly these objects the selection, the first one active; in object mode."""
    to_object_mode()
    for each in bpy.context.view_layer.objects:
        each.select_set(False)
    for thing in things:
        thing.select_set(True)
    if things:
        bpy.context.view_layer.objects.active = things[0]


def some(random, things, most=3):
    """A few of `things` in random order."""
    return random.sample(things, min(len(things), random.randint(1, most))) if things else []


def edit(thing, random, everything=False):
    """Enter edit mode on an object with some faces selected."""
    choose([thing])
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.context.tool_settings.mesh_select_mode = (False, False, True)
    edited = bmesh.from_edit_mesh(thing.data)
    for face in edited.faces:
        face.select_set(everything or random.random() < 0.5)
    edited.select_flush_mode()
    bmesh.update_edit_mesh(thing.data)


def _edit_something(random):
    things = [thing for thing in meshes() if len(thing.data.polygons) and not thing.library]
    lights = [thing for thing in things if is_light_mesh(thing)]
    pool = lights if lights and random.random() < 0.7 else things
    if pool:
        edit(random.choice(pool), random)


def _in_edit_mode(random):
    if bpy.context.mode != "EDIT_MESH":
        _edit_something(random)
    return bpy.context.mode == "EDIT_MESH"


def _edit_action(operator, grows=False, **parameters):
    def act(random):
        if _in_edit_mode(random) and not (grows and _faces_in_edit() > MOST_FACES):
            operator()(**{key: value(random) if callable(value) else value for key, value in parameters.items()})

    return act


def _faces_in_edit():
    return len(bmesh.from_edit_mesh(bpy.context.object.data).faces)


def _translation(random):
    return tuple(random.uniform(-0.3, 0.3) for _ in range(3))


def enter_edit_mode(random):
    _edit_something(random)


def leave_edit_mode(random):
    to_object_mode()


def select(random):
    """Any selection: of visible objects, light meshes or both."""
    light = random.choice((True, True, False, None))
    choose(some(random, [thing for thing in meshes(light) if thing.visible_get()]))


def duplicate(random):
    if len(bpy.data.objects) < MOST_OBJECTS:
        choose(some(random, meshes()))
        bpy.ops.object.duplicate(linked=random.random() < 0.3)


def delete(random):
    choose(some(random, meshes(random.choice((True, False))), 1))
    bpy.ops.object.delete(use_global=random.random() < 0.2)


def remove_by_script(random):
    to_object_mode()
    things = meshes()
    if len(things) > 3:
        bpy.data.objects.remove(random.choice(things))


def join(random):
    choose(some(random, [thing for thing in meshes(random.choice((True, False, None))) if not thing.library]))
    bpy.ops.object.join()


def separate(random):
    if _in_edit_mode(random) and len(bpy.data.objects) < MOST_OBJECTS:
        bpy.ops.mesh.separate(type=random.choice(("SELECTED", "LOOSE")))


def rename(random):
    things = meshes()
    if things:
        thing = random.choice(things)
        if not thing.library:
            thing.name = random.choice(NAMES)
            thing.data.name = random.choice(NAMES)


def swap_names(random):
    things = [thing for thing in meshes(False) if not thing.library]
    if len(things) > 1:
        one, other = random.sample(things, 2)
        names = one.name, other.name
        one.name = "swap"
        other.name = names[0]
        one.name = names[1]


def move(random):
    for thing in some(random, meshes()):
        if not thing.library:
            thing.location = tuple(random.uniform(-1.0, 1.0) for _ in range(3))
            thing.scale = random.choice(((1.0, 1.0, 1.0), (1.5, 1.0, 0.5), (-1.0, 1.0, 1.0)))


def apply_transform(random):
    choose(some(random, meshes()))
    bpy.ops.object.transform_apply()


def parent(random):
    choose(some(random, meshes()))
    bpy.ops.object.parent_set(type="OBJECT", keep_transform=True)


def add_modifier(random):
    things = [thing for thing in meshes() if not thing.library and len(thing.modifiers) < 2]
    if things:
        thing = random.choice(things)
        kind = random.choice(("TRIANGULATE", "MIRROR", "DECIMATE", "SOLIDIFY", "BEVEL"))
        if len(thing.data.polygons) < MOST_FACES // 4:
            thing.modifiers.new(kind.title(), kind)


def apply_modifier(random):
    things = [thing for thing in meshes() if len(thing.modifiers)]
    if things:
        choose([random.choice(things)])
        bpy.ops.object.modifier_apply(modifier=bpy.context.object.modifiers[0].name)


def make_single_user(random):
    choose(some(random, meshes()))
    bpy.ops.object.make_single_user(object=True, obdata=True)


def hide(random):
    for thing in some(random, meshes(), 1):
        thing.hide_set(random.random() < 0.5)


def to_another_collection(random):
    things = [thing for thing in meshes() if not thing.library]
    if things:
        choose([random.choice(things)])
        collection = bpy.data.collections.new(random.choice(NAMES))
        bpy.context.scene.collection.children.link(collection)
        collection.objects.link(bpy.context.object)


def new_scene(random):
    if len(bpy.data.scenes) < 3:
        to_object_mode()
        bpy.ops.scene.new(type=random.choice(("EMPTY", "LINK_COPY", "FULL_COPY")))


def other_scene(random):
    to_object_mode()
    bpy.context.window.scene = random.choice(list(bpy.data.scenes))


def change_material(random):
    material = random.choice(list(bpy.data.materials))
    if not material.library and material.node_tree:
        sockets = [each for node in material.node_tree.nodes for each in node.inputs if each.name == "Base Color"]
        for socket in sockets[:1]:
            socket.default_value = (*(random.random() for _ in range(3)), 1.0)


def change_frame(random):
    bpy.context.scene.frame_set(random.randint(1, 10))


def purge(random):
    to_object_mode()
    bpy.ops.outliner.orphans_purge(do_recursive=True)


def remove_an_attribute(random):
    to_object_mode()
    things = [thing for thing in meshes(True) if not thing.library]
    if things:
        mesh = random.choice(things).data
        named = [attribute.name for attribute in mesh.attributes if attribute.name.startswith("vlm_")]
        if named:
            mesh.attributes.remove(mesh.attributes[random.choice(named)])


def append(random, library):
    """Objects of an earlier save, copied into this file once more."""
    _from_library(random, library, link=False)


def link(random, library):
    """Objects of an earlier save as linked data."""
    _from_library(random, library, link=True)


def _from_library(random, library, link):
    if len(bpy.data.objects) > MOST_OBJECTS or not library.exists():
        return
    to_object_mode()
    with bpy.data.libraries.load(str(library), link=link) as (there, wanted):
        wanted.objects = random.sample(list(there.objects), min(3, len(there.objects)))
    for thing in wanted.objects:
        if thing is not None and thing.name not in bpy.context.scene.collection.objects:
            bpy.context.scene.collection.objects.link(thing)


def override(random):
    """A library override of a linked object."""
    things = [thing for thing in bpy.context.view_layer.objects if thing.library is not None]
    if things:
        to_object_mode()
        random.choice(things).override_create(remap_local_usages=True)


def make_local(random):
    things = [thing for thing in bpy.context.view_layer.objects if thing.library is not None]
    if things:
        choose(some(random, things))
        bpy.ops.object.make_local(type="SELECT_OBDATA")


ACTIONS = {
    "enter edit mode": enter_edit_mode,
    "leave edit mode": leave_edit_mode,
    "select": select,
    "subdivide": _edit_action(lambda: bpy.ops.mesh.subdivide, grows=True),
    "delete faces": _edit_action(lambda: bpy.ops.mesh.delete, type="FACE"),
    "delete only faces": _edit_action(lambda: bpy.ops.mesh.delete, type="ONLY_FACE"),
    "move faces": _edit_action(lambda: bpy.ops.transform.translate, value=_translation),
    "duplicate faces": _edit_action(lambda: bpy.ops.mesh.duplicate, grows=True),
    "extrude": _edit_action(lambda: bpy.ops.mesh.extrude_region, grows=True),
    "flip": _edit_action(lambda: bpy.ops.mesh.flip_normals),
    "join faces": _edit_action(lambda: bpy.ops.mesh.dissolve_faces),
    "merge corners": _edit_action(lambda: bpy.ops.mesh.remove_doubles, threshold=lambda r: r.choice((1e-4, 0.5))),
    "triangulate": _edit_action(lambda: bpy.ops.mesh.quads_convert_to_tris, grows=True),
    "make quads": _edit_action(lambda: bpy.ops.mesh.tris_convert_to_quads),
    "split": _edit_action(lambda: bpy.ops.mesh.edge_split),
    "inset": _edit_action(lambda: bpy.ops.mesh.inset, grows=True, thickness=0.05),
    "hide faces": _edit_action(lambda: bpy.ops.mesh.hide),
    "duplicate": duplicate,
    "delete": delete,
    "remove by script": remove_by_script,
    "join": join,
    "separate": separate,
    "rename": rename,
    "swap names": swap_names,
    "move": move,
    "apply transform": apply_transform,
    "parent": parent,
    "add modifier": add_modifier,
    "apply modifier": apply_modifier,
    "make single user": make_single_user,
    "hide": hide,
    "to another collection": to_another_collection,
    "new scene": new_scene,
    "other scene": other_scene,
    "change material": change_material,
    "change frame": change_frame,
    "purge": purge,
    "remove an attribute": remove_an_attribute,
    "override": override,
    "make local": make_local,
}
FILE_ACTIONS = {"append": append, "link": link}
