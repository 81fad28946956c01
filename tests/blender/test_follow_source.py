# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes follow what they stand for: armatures, shape keys, parents, and surfaces that only Blender can move."""

import math

import bpy
import numpy as np
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring, checking
from vlm_addon.blender.baking import bake_state
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.following import animation
from vlm_addon.blender.following.follow_source import RIG, SURFACE, follow_sources, stop_following
from vlm_addon.blender.following.surface_transfer import evaluated_surface
from vlm_addon.blender.interface.properties import ensure_scene_settings
from vlm_addon.blender.light_meshes import sources
from vlm_addon.blender.write_back import write_light_mesh
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh
from vlm_addon.core.progress import silent

INSET = 0.02


def light_mesh_of(positions, triangles, name="VLM", sources=()):
    """The object of a light mesh of these triangles, each of a colour of its own."""
    count = len(triangles)
    shades = np.linspace(0.1, 1.0, count)[:, None].repeat(3, axis=1)
    samples = SourceSamples(
        np.zeros((count, 3)), np.zeros((count, 3), np.float32), np.ones(count, np.float32), np.arange(count + 1)
    )
    lights = VirtualLightMesh(
        vertices=np.asarray(positions, np.float64),
        triangles=np.asarray(triangles, np.int32),
        colour=shades.astype(np.float32),
        emission=np.zeros((count, 3), np.float32),
        strength=np.ones(count, np.float32),
        tag_ids=np.zeros(count, np.int32),
        dynamic=np.zeros(count, bool),
        samples=samples,
    )
    return write_light_mesh(lights, name, [source.name for source in sources])


def lights_behind(source, name="VLM", inset=INSET):
    """A light for each triangle of the evaluated surface, moved behind it along the triangle's normal."""
    surface = evaluated_surface([source], bpy.context.evaluated_depsgraph_get())
    corners = surface.positions[surface.triangles] - inset * surface.normals[:, None]
    return light_mesh_of(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), name, [source])


def place(thing):
    """(v, 3): where the vertices of an object are in the world, evaluated."""
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    matrix = np.array(evaluated.matrix_world)
    local = np.array([vertex.co for vertex in evaluated.data.vertices])
    return local @ matrix[:3, :3].T + matrix[:3, 3]


def middles(thing):
    """(t, 3): middles of triangles of a light mesh whose triangles share no vertex."""
    return place(thing).reshape(-1, 3, 3).mean(axis=1)


def surface_middles(source):
    surface = evaluated_surface([source], bpy.context.evaluated_depsgraph_get())
    return surface.positions[surface.triangles].mean(axis=1)


def depths(lights, source):
    """(t,): how far the middle of each light lies behind the plane of the triangle that it was made for."""
    normals = evaluated_surface([source], bpy.context.evaluated_depsgraph_get()).normals
    return np.einsum("ij,ij->i", surface_middles(source) - middles(lights), normals)


def state(thing):
    """What a refusal must leave as it is."""
    return (
        [tuple(vertex.co) for vertex in thing.data.vertices],
        thing.parent,
        [modifier.name for modifier in thing.modifiers],
        dict(thing.items()).keys(),
        sorted(each.name for each in bpy.data.objects),
        len(bpy.data.meshes),
    )


@pytest.fixture
def make_sheet(make_mesh):
    """make_sheet(name, cells): a square of edge 2 in z = 0 of cells x cells quads, facing +z."""

    def make(name="Sheet", cells=4):
        steps = np.linspace(-1.0, 1.0, cells + 1)
        vertices = [(x, y, 0.0) for y in steps for x in steps]
        row = cells + 1
        faces = [
            (i + j * row, i + 1 + j * row, i + 1 + (j + 1) * row, i + (j + 1) * row)
            for j in range(cells)
            for i in range(cells)
        ]
        return make_mesh(name, vertices, faces)

    return make


@pytest.fixture
def bent_sheet(make_sheet):
    """A sheet whose right half an armature bends up by 45 degrees and twists by as much until frame 21."""
    sheet = make_sheet(cells=8)
    armature = bpy.data.armatures.new("rig")
    rig = bpy.data.objects.new("rig", armature)
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, head, tail in (("still", (-1, 0, 0), (0, 0, 0)), ("bent", (0, 0, 0), (1, 0, 0))):
        bone = armature.edit_bones.new(name)
        bone.head, bone.tail = head, tail
    bpy.ops.object.mode_set(mode="OBJECT")
    groups = {name: sheet.vertex_groups.new(name=name) for name in ("still", "bent")}
    for vertex in sheet.data.vertices:
        share = min(max(vertex.co.x + 0.5, 0.0), 1.0)
        groups["bent"].add([vertex.index], share, "REPLACE")
        groups["still"].add([vertex.index], 1.0 - share, "REPLACE")
    modifier = sheet.modifiers.new("Armature", "ARMATURE")
    modifier.object = rig
    bone = rig.pose.bones["bent"]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (21, math.radians(45.0))):
        bone.rotation_euler.z = angle
        bone.rotation_euler.x = angle
        bone.keyframe_insert("rotation_euler", frame=frame)
    return sheet


def test_nothing_moves_at_the_frame_at_which_it_is_bound(bent_sheet, scene):
    scene.frame_set(15)
    lights = lights_behind(bent_sheet)
    before = place(lights)
    (done,) = follow_sources(lights, bpy.context)
    assert (done.way, done.note) == (RIG, "")
    assert np.abs(place(lights) - before).max() < 1e-5


def test_lights_bound_in_any_pose_stay_behind_a_skinned_surface_in_every_pose(bent_sheet, scene):
    scene.frame_set(15)
    lights = lights_behind(bent_sheet)
    follow_sources(lights, bpy.context)
    for frame in (1, 8, 21):
        scene.frame_set(frame)
        off = np.abs(depths(lights, bent_sheet) - INSET)
        # Skinning shears the space beside a bend, and with it the few lights there.
        assert np.median(off) < 0.05 * INSET, frame
        assert off.max() < 0.5 * INSET, frame


def test_extraction_reads_the_moved_lights_as_dynamic_ones(bent_sheet, scene):
    scene.frame_set(1)
    lights = lights_behind(bent_sheet)
    follow_sources(lights, bpy.context)
    scene.frame_set(21)
    found = extract().light_mesh
    assert found.dynamic.all()
    assert np.abs(found.vertices - place(lights)).max() < 1e-6


def test_an_armature_that_preserves_volume_is_matched_too(bent_sheet, scene):
    bent_sheet.modifiers["Armature"].use_deform_preserve_volume = True
    scene.frame_set(21)
    lights = lights_behind(bent_sheet)
    before = place(lights)
    follow_sources(lights, bpy.context)
    assert lights.modifiers[0].use_deform_preserve_volume
    assert np.abs(place(lights) - before).max() < 1e-5


@pytest.mark.parametrize(
    ("order", "way"), [(["MIRROR", "SUBSURF", "ARMATURE"], RIG), (["ARMATURE", "MIRROR"], SURFACE)]
)
def test_what_modifiers_make_of_a_source_is_followed_too(bent_sheet, scene, order, way):
    for kind in order:
        if kind != "ARMATURE":
            bent_sheet.modifiers.new(kind, kind)
    for kind in order[:-1]:
        if kind != "ARMATURE":
            bent_sheet.modifiers.move(bent_sheet.modifiers.find(kind), order.index(kind))
    mirror = bent_sheet.modifiers["MIRROR"]
    mirror.use_axis = (False, True, False)
    mirror.mirror_object = bpy.data.objects["rig"]
    bpy.data.objects["rig"].location.y = -1.0
    scene.frame_set(3)
    lights = lights_behind(bent_sheet)
    (done,) = follow_sources(lights, bpy.context)
    assert (done.way, done.note) == (way, "")
    scene.frame_set(8)
    off = np.abs(depths(lights, bent_sheet) - INSET)
    assert np.median(off) < 0.05 * INSET
    assert off.max() < 0.5 * INSET


def test_shape_keys_move_the_lights_with_the_surface(make_sheet, scene):
    sheet = make_sheet()
    sheet.shape_key_add(name="Basis")
    for name, axis, amount in (("Rise", 2, 0.5), ("Lean", 0, 0.3)):
        key = sheet.shape_key_add(name=name)
        for point in key.data:
            point.co[axis] += amount * (1.0 + point.co.x)
    keys = sheet.data.shape_keys.key_blocks
    keys["Lean"].relative_key = keys["Rise"]
    for frame, value in ((1, 0.25), (11, 1.0)):
        keys["Rise"].value = keys["Lean"].value = value
        keys["Rise"].keyframe_insert("value", frame=frame)
        keys["Lean"].keyframe_insert("value", frame=frame)
    scene.frame_set(1)
    lights = lights_behind(sheet)
    before = middles(lights) - surface_middles(sheet)
    (done,) = follow_sources(lights, bpy.context)
    assert done.way == RIG
    assert np.abs(middles(lights) - surface_middles(sheet) - before).max() < 1e-5
    scene.frame_set(11)
    moved = middles(lights) - surface_middles(sheet)
    # A light takes the displacement of the surface's point nearest to it, which lies INSET behind the slope.
    assert np.abs(moved - before).max() < 0.5 * INSET
    assert np.linalg.norm(surface_middles(sheet) - surface_middles(sheet)[0], axis=1).max() > 1.0
    assert lights["vlm_dynamic"]


def test_a_light_mesh_moves_with_an_animated_object(make_cube, scene):
    cube = make_cube()
    for frame, x in ((1, 0.0), (11, 5.0)):
        cube.location.x = x
        cube.rotation_euler.z = x
        cube.keyframe_insert("location", frame=frame)
        cube.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(4)
    lights = lights_behind(cube)
    follow_sources(lights, bpy.context)
    scene.frame_set(11)
    assert np.abs(np.linalg.norm(middles(lights) - surface_middles(cube), axis=1) - INSET).max() < 1e-5
    assert lights["vlm_dynamic"]


def test_what_stands_still_is_followed_but_not_dynamic(make_cube):
    cube = make_cube()
    lights = lights_behind(cube)
    follow_sources(lights, bpy.context)
    cube.location.y = 3.0
    bpy.context.view_layer.update()
    assert np.abs(middles(lights)[:, 1].mean() - 3.0) < 1e-5
    assert not lights["vlm_dynamic"]


@pytest.mark.parametrize("mirrored_first", [False, True])
def test_lights_of_a_mirrored_object_go_on_facing_as_they_did(make_cube, mirrored_first):
    cube = make_cube()
    cube.scale = (-1.0, 1.0, 2.0)
    bpy.context.view_layer.update()
    lights = lights_behind(cube)
    if mirrored_first:
        follow_sources(lights, bpy.context)
    before = extract().light_mesh
    follow_sources(lights, bpy.context)
    after = extract().light_mesh
    assert np.abs(after.area_vectors - before.area_vectors).max() < 1e-5
    assert np.array_equal(after.colour, before.colour)


def test_each_source_that_moves_gets_a_light_mesh_of_its_own(make_cube, make_sheet, scene):
    moving, other = make_cube("Moving"), make_cube("Other")
    floor = make_sheet("Floor")
    floor.location.z = -3.0
    other.location.x = 4.0
    for cube in (moving, other):
        for frame, height in ((1, 0.0), (11, 2.0)):
            cube.location.z = height * (1 if cube is moving else 2)
            cube.keyframe_insert("location", index=2, frame=frame)
    scene.frame_set(1)
    surface = evaluated_surface([moving, other, floor], bpy.context.evaluated_depsgraph_get())
    corners = surface.positions[surface.triangles] - INSET * surface.normals[:, None]
    lights = light_mesh_of(
        corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), "VLM", [moving, other, floor]
    )
    before = extract().light_mesh
    done = follow_sources(lights, bpy.context)
    assert [(entry.light_mesh, entry.source) for entry in done] == [("VLM Moving", "Moving"), ("VLM Other", "Other")]
    assert lights["vlm_sources"] == "Floor"
    assert [len(bpy.data.objects[name].data.polygons) for name in ("VLM", "VLM Moving", "VLM Other")] == [32, 12, 12]
    after = extract().light_mesh
    assert np.allclose(np.sort(after.colour, axis=0), np.sort(before.colour, axis=0))
    assert (after.dynamic.sum(), len(after)) == (24, 56)
    scene.frame_set(11)
    for name, source in (("VLM Moving", moving), ("VLM Other", other), ("VLM", floor)):
        apart = np.linalg.norm(middles(bpy.data.objects[name]) - surface_middles(source), axis=1)
        assert np.abs(apart - INSET).max() < 1e-5, name


def test_a_light_mesh_that_shares_its_mesh_keeps_the_lights_of_all_sources(make_cube, scene):
    for name, x in (("A", 0.0), ("B", 5.0)):
        cube = make_cube(name)
        cube.location.x = x
        cube.keyframe_insert("location", frame=1)
    sources = [bpy.data.objects[name] for name in "AB"]
    surface = evaluated_surface(sources, bpy.context.evaluated_depsgraph_get())
    lights = light_mesh_of(surface.positions, surface.triangles, "VLM", sources)
    twin = lights.copy()
    scene.collection.objects.link(twin)
    before = place(twin)
    assert len(follow_sources(lights, bpy.context)) == 2
    assert len(twin.data.polygons) == 24
    assert np.array_equal(place(twin), before)


def test_the_light_mesh_named_after_a_source_keeps_its_lights(make_cube, scene):
    for name, x in (("A", 0.0), ("B", 5.0)):
        cube = make_cube(name)
        cube.location.x = x
        cube.keyframe_insert("location", frame=1)
    surface = evaluated_surface([bpy.data.objects[n] for n in "AB"], bpy.context.evaluated_depsgraph_get())
    sources = [bpy.data.objects[name] for name in "AB"]
    lights = light_mesh_of(surface.positions, surface.triangles, "VLM A", sources)
    assert {(e.light_mesh, e.source) for e in follow_sources(lights, bpy.context)} == {("VLM A", "A"), ("VLM B", "B")}


def test_a_surface_that_no_copied_rig_can_move_is_bound_to(make_sheet, scene):
    sheet = make_sheet(cells=8)
    wave = sheet.modifiers.new("Wave", "WAVE")
    wave.height, wave.width, wave.speed = 0.2, 0.8, 0.1
    for frame, x in ((1, 0.0), (21, 4.0)):
        sheet.location.x = x
        sheet.keyframe_insert("location", frame=frame)
    scene.frame_set(8)
    lights = lights_behind(sheet, inset=0.01)
    (done,) = follow_sources(lights, bpy.context)
    assert (done.way, done.note) == (SURFACE, "")
    for frame in (8, 13, 20):
        scene.frame_set(frame)
        assert np.abs(np.linalg.norm(middles(lights) - surface_middles(sheet), axis=1) - 0.01).max() < 2e-3, frame


def test_where_the_surface_cannot_be_bound_to_it_follows_as_a_rigid_body_and_says_so(make_mesh, scene):
    # Three faces at one edge: Surface Deform refuses them.
    fan = [(0, 0, 0), (0, 1, 0), (1, 0, 0), (-1, 0, 0), (0, 0, 1)]
    leaves = make_mesh("Leaves", fan, [(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    leaves.modifiers.new("Wave", "WAVE")
    lights = lights_behind(leaves)
    (done,) = follow_sources(lights, bpy.context)
    assert done.way == RIG
    assert "cannot bind" in done.note
    assert lights.parent == leaves
    assert not lights.modifiers


def test_freeing_keeps_shape_and_place_and_takes_away_all_that_following_made(bent_sheet, scene):
    scene.frame_set(5)
    lights = lights_behind(bent_sheet)
    follow_sources(lights, bpy.context)
    scene.frame_set(18)
    before = place(lights)
    assert stop_following(lights, bpy.context)
    assert np.abs(place(lights) - before).max() < 1e-6
    assert (lights.parent, len(lights.modifiers), len(lights.vertex_groups), lights.data.shape_keys) == (
        None,
        0,
        0,
        None,
    )
    assert not lights["vlm_dynamic"]
    assert not stop_following(lights, bpy.context)


def test_following_twice_is_following_once(bent_sheet, scene):
    scene.frame_set(5)
    lights = lights_behind(bent_sheet)
    follow_sources(lights, bpy.context)
    scene.frame_set(20)
    once = place(lights)
    scene.frame_set(5)
    follow_sources(lights, bpy.context)
    scene.frame_set(20)
    assert np.abs(place(lights) - once).max() < 1e-5
    assert [modifier.name for modifier in lights.modifiers] == ["Follow: Armature"]
    assert sorted(group.name for group in lights.vertex_groups) == ["bent", "still"]


def test_the_artists_own_modifiers_come_after_and_stay_as_they_are(bent_sheet, scene):
    lights = lights_behind(bent_sheet)
    own = lights.modifiers.new("Mine", "DISPLACE")
    own.strength, own.mid_level = 0.5, 0.0
    before = place(lights)
    follow_sources(lights, bpy.context)
    assert [modifier.name for modifier in lights.modifiers] == ["Follow: Armature", "Mine"]
    assert own.show_viewport
    assert np.abs(place(lights) - before).max() < 1e-5


def test_a_copy_that_shares_the_mesh_stays_where_it_is(bent_sheet, scene):
    scene.frame_set(15)
    lights = lights_behind(bent_sheet)
    copy = lights.copy()
    scene.collection.objects.link(copy)
    before = place(copy)
    follow_sources(lights, bpy.context)
    assert np.array_equal(place(copy), before)


def test_a_selected_object_is_followed_in_place_of_what_it_was_made_from(make_cube):
    cube, other = make_cube("Cube"), make_cube("Other")
    lights = lights_behind(cube)
    bpy.ops.object.select_all(action="DESELECT")
    for thing in (lights, other):
        thing.select_set(True)
    assert animation.follow_problem(bpy.context) is None
    animation.follow(bpy.context)
    assert lights.parent == other
    assert lights["vlm_sources"] == "Other"


def test_a_light_mesh_that_is_made_anew_follows_again_with_its_new_shape(bent_sheet, scene):
    ensure_scene_settings()
    scene.frame_set(5)
    bpy.ops.object.select_all(action="DESELECT")
    bent_sheet.select_set(True)
    bpy.context.view_layer.objects.active = bent_sheet
    make = authoring.from_selection(bpy.context, BakeSettings(target_triangles=30))
    authoring.write(make(silent))
    lights = bpy.data.objects["VLM Sheet"]
    follow_sources(lights, bpy.context)
    scene.frame_set(14)
    again = authoring.from_selection(bpy.context, BakeSettings(target_triangles=60))(silent)
    assert authoring.write(again).endswith("it follows Sheet again")
    assert np.abs(np.sort(place(lights), axis=0) - np.sort(again.bake.light_mesh.vertices, axis=0)).max() < 1e-5
    assert [modifier.name for modifier in lights.modifiers] == ["Follow: Armature"]
    scene.frame_set(20)
    assert np.abs(np.sort(place(lights), axis=0) - np.sort(again.bake.light_mesh.vertices, axis=0)).max() > 0.05


def test_made_anew_from_more_objects_it_follows_nothing_and_says_so(bent_sheet, make_cube, scene):
    ensure_scene_settings()
    cube = make_cube()
    lights = lights_behind(bent_sheet)
    follow_sources(lights, bpy.context)
    lights.name = "VLM Cube"
    bpy.ops.object.select_all(action="DESELECT")
    for thing in (bent_sheet, cube):
        thing.select_set(True)
    bpy.context.view_layer.objects.active = cube
    said = authoring.write(authoring.from_selection(bpy.context, BakeSettings(target_triangles=30))(silent))
    assert "follows nothing any more" in said
    assert (lights.parent, len(lights.modifiers)) == (None, 0)


def test_a_light_mesh_that_stands_still_while_its_source_moves_is_found(bent_sheet, make_cube, scene):
    lights = lights_behind(bent_sheet)
    lights_behind(make_cube(), "VLM Cube")
    (finding,) = animation.left_behind(scene)
    assert "'Sheet', which it was made from, moves" in str(finding)
    follow_sources(lights, bpy.context)
    assert animation.left_behind(scene) == []


@pytest.mark.parametrize(
    ("break_it", "remedy"),
    [
        (lambda lights, cube: lights.pop("vlm_sources"), "select the object that it should follow"),
        (lambda lights, cube: cube.hide_set(True), "show it while"),
        (lambda lights, cube: lights.hide_set(True), "show it in the viewport"),
        (lambda lights, cube: setattr(cube, "scale", (0, 0, 0)), "give it a scale"),
        (lambda lights, cube: setattr(cube, "parent", lights), "clear its parent"),
    ],
)
def test_what_cannot_be_followed_is_refused_and_nothing_is_changed(make_cube, break_it, remedy):
    cube = make_cube()
    lights = lights_behind(cube)
    break_it(lights, cube)
    bpy.context.view_layer.update()
    before = state(lights)
    with pytest.raises(InvalidInput, match=remedy):
        follow_sources(lights, bpy.context)
    assert state(lights) == before


def test_several_sources_that_stand_still_are_refused(make_cube):
    cubes = [make_cube("A"), make_cube("B")]
    surface = evaluated_surface(cubes, bpy.context.evaluated_depsgraph_get())
    lights = light_mesh_of(surface.positions, surface.triangles, "VLM", cubes)
    with pytest.raises(InvalidInput, match="none of its 2 sources moves"):
        follow_sources(lights, bpy.context)


def test_a_light_mesh_without_lights_of_what_moves_is_refused(make_cube, scene):
    moving, still = make_cube("Moving"), make_cube("Still")
    moving.location.x = 9.0
    for frame, height in ((1, 0.0), (11, 2.0)):
        moving.location.z = height
        moving.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    surface = evaluated_surface([still], bpy.context.evaluated_depsgraph_get())
    lights = light_mesh_of(surface.positions, surface.triangles, "VLM", [moving, still])
    before = state(lights)
    with pytest.raises(InvalidInput, match="none of its lights stands for 'Moving', which moves"):
        follow_sources(lights, bpy.context)
    assert state(lights) == before


def test_a_new_light_mesh_of_the_dancer_dances_as_close_to_her_as_it_was_made(sample_folder, scene):
    bpy.ops.wm.open_mainfile(filepath=str(sample_folder / "dancer.blend"))
    ensure_scene_settings()
    context, scene = bpy.context, bpy.context.scene
    bpy.data.objects.remove(bpy.data.objects["Dancer light mesh"])
    scene.frame_set(17)
    bpy.ops.object.select_all(action="DESELECT")
    for name in ("Dancer", "Skirt"):
        bpy.data.objects[name].select_set(True)
    made = authoring.from_selection(context, BakeSettings(target_triangles=400))(silent)
    authoring.write(made)
    follow_sources(bpy.data.objects[made.name], context)
    followers = {thing.parent.name: thing for thing in scene.objects if "vlm_schema" in thing and thing.parent}
    assert set(followers) >= {"Dancer", "Skirt"}

    def apart(name):
        surface = evaluated_surface([bpy.data.objects[name]], context.evaluated_depsgraph_get())
        from vlm_addon.blender.following.surface_transfer import nearest

        return nearest(surface, place(followers[name]), np.zeros((len(followers[name].data.vertices), 3))).distances

    bound = {name: apart(name).mean() for name in ("Dancer", "Skirt")}
    for frame in (1, 30, 50):
        scene.frame_set(frame)
        for name, distance in bound.items():
            assert apart(name).mean() == pytest.approx(distance, rel=0.05), (name, frame)


@pytest.mark.usefixtures("watched_bakes")
def test_following_keeps_a_light_mesh_up_to_date_with_what_moves_and_is_renamed(make_cube, scene):
    """Of two sources the one that moves gets lights of its own, and neither asks to be made again."""
    still, moving = make_cube("Still"), make_cube("Moving")
    moving.location.x = 5.0
    bpy.context.view_layer.update()
    authoring.write(authoring.from_scene(bpy.context, BakeSettings())(silent))
    thing = bpy.data.objects["VLM"]
    still.name = "Renamed"
    moving.keyframe_insert("location", frame=1)
    moving.location.x = 6.0
    moving.keyframe_insert("location", frame=10)
    scene.frame_set(1)
    thing.select_set(True)
    still.select_set(False)
    moving.select_set(False)
    animation.follow(bpy.context)
    assert [each.name for each in sources(bpy.data.objects["VLM Moving"], scene)] == ["Moving"]
    assert [each.name for each in sources(thing, scene)] == ["Renamed"]
    assert checking.check(bpy.context)(silent).findings == ()
    assert bake_state.compare(bpy.context) == ()
    scene.frame_set(5)
    assert checking.check(bpy.context)(silent).findings == ()
