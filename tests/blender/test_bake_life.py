# SPDX-License-Identifier: GPL-3.0-or-later
"""Where baked data lives, when it is out of date, and that nothing an artist does during a bake does harm."""

from pathlib import Path

import bpy
import pytest

from vlm_addon.bake import BakeSettings
from vlm_addon.blender import authoring
from vlm_addon.blender.baking import bake_grid, bake_state, bake_store
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_grid_file import load_light_grid
from vlm_addon.core.progress import silent

FEW = BakeSettings(target_triangles=20)


pytestmark = pytest.mark.usefixtures("watched_bakes")


@pytest.fixture
def room(make_cube):
    """A file with a cube on a larger one, both of which made a light mesh."""
    floor, _ = make_cube("Floor"), make_cube("Box")
    floor.scale = (4.0, 4.0, 0.1)
    floor.location.z = -1.2
    bpy.context.view_layer.update()
    select("Floor", "Box")
    authoring.write(authoring.from_selection(bpy.context, FEW)(silent))
    return bpy.context.scene


def select(*names):
    for thing in bpy.data.objects:
        thing.select_set(thing.name in names)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[0]]


def bake():
    path, _ = bake_grid.write(bpy.context, bake_grid.from_scene(bpy.context)(silent))
    return path


def save(path, **options):
    bpy.ops.wm.save_as_mainfile(filepath=str(path), **options)


def state():
    return bake_state.badge(bpy.context).state


def changes():
    return bake_state.compare(bpy.context)


def test_a_saved_file_keeps_its_bake_beside_it(room, tmp_path):
    save(tmp_path / "room.blend")
    assert bake() == tmp_path / "room.vlm" / "Scene.vlmgrid"
    grid = load_light_grid(tmp_path / "room.vlm" / "Scene.vlmgrid", extract().light_mesh)
    assert grid.light_count == len(extract().light_mesh)


def test_a_file_that_was_never_saved_keeps_its_bake_until_it_is_and_takes_it_along(room, tmp_path):
    unsaved = bake()
    assert Path(bpy.app.tempdir) in unsaved.parents
    save(tmp_path / "room.blend")
    assert not unsaved.exists()
    assert bake_store.stored_key(room) is not None
    assert changes() == ()


def test_a_bake_that_cannot_be_written_beside_the_first_save_is_kept_told_and_taken_along_by_the_next(room, tmp_path):
    unsaved = bake()
    (tmp_path / "full.vlm").write_text("in the way")
    save(tmp_path / "full.blend")
    assert unsaved.is_file()
    assert (state(), bake_state.badge(bpy.context).text) == (bake_state.OLD, bake_state.NOT_TAKEN_ALONG)
    save(tmp_path / "room.blend")
    assert not unsaved.exists()
    assert bake_store.grid_path(room).is_file()
    assert changes() == ()
    assert state() == bake_state.CURRENT


def test_baking_again_ends_what_is_said_of_a_bake_that_could_not_be_written(room, tmp_path):
    bake()
    (tmp_path / "room.vlm").write_text("in the way")
    save(tmp_path / "room.blend")
    (tmp_path / "room.vlm").unlink()
    bake()
    assert changes() == ()
    assert state() == bake_state.CURRENT


def test_saving_under_another_name_takes_the_bake_along(room, tmp_path):
    save(tmp_path / "one.blend")
    bake()
    save(tmp_path / "two.blend")
    assert bake_store.grid_path(room) == tmp_path / "two.vlm" / "Scene.vlmgrid"
    assert changes() == ()
    assert sorted(path.name for path in (tmp_path / "one.vlm").iterdir()) == ["Scene.json", "Scene.vlmgrid"]


def test_a_copy_saved_elsewhere_gets_none_and_the_file_keeps_its_own(room, tmp_path):
    save(tmp_path / "one.blend")
    bake()
    save(tmp_path / "copy.blend", copy=True)
    assert not (tmp_path / "copy.vlm").exists()
    assert changes() == ()


def test_another_file_has_nothing_of_the_one_before_that_was_never_saved(room):
    unsaved = bake()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert not unsaved.exists()
    assert state() == bake_state.NONE


def test_scenes_of_any_name_have_files_of_their_own(room, tmp_path):
    save(tmp_path / "room.blend")
    names = ["a/b", "..", "a:b*?", "Zimmer ä"]
    paths = []
    for name in names:
        room.name = name
        paths.append(bake())
    assert len(set(paths)) == len(names)
    assert {path.parent for path in paths} == {tmp_path / "room.vlm"}


def test_a_linked_scene_is_read_beside_its_library_and_never_written(room, tmp_path):
    save(tmp_path / "library.blend")
    baked = bake()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.scenes = ["Scene"]
    (linked,) = wanted.scenes
    assert bake_store.grid_path(linked) == baked
    assert bake_store.stored_key(linked) is not None
    for change in (lambda: bake_store.clear(linked), lambda: bake_store.store(linked, None, None)):
        with pytest.raises(InvalidInput, match="bake in that file"):
            change()
    assert baked.is_file()


def test_a_folder_that_cannot_be_made_is_told(room, tmp_path):
    save(tmp_path / "room.blend")
    (tmp_path / "room.vlm").write_text("in the way")
    with pytest.raises(InvalidInput, match="cannot be made"):
        bake()


def test_clearing_removes_the_files_and_the_folder_and_leaves_the_lights(room, tmp_path):
    save(tmp_path / "room.blend")
    bake()
    assert bake_store.clear(room) > 0
    assert not (tmp_path / "room.vlm").exists()
    assert bake_grid.clear_problem(bpy.context) is not None
    assert extract().light_mesh is not None


def test_clearing_one_scene_leaves_the_others(room, tmp_path):
    save(tmp_path / "room.blend")
    bake()
    (tmp_path / "room.vlm" / "Other.vlmgrid").write_text("another scene's")
    bake_store.clear(room)
    assert [path.name for path in (tmp_path / "room.vlm").iterdir()] == ["Other.vlmgrid"]


def test_a_grid_whose_bake_was_interrupted_does_not_count(room, tmp_path):
    save(tmp_path / "room.blend")
    bake().with_suffix(".json").unlink()
    assert bake_store.stored_key(room) is None
    assert bake_state.badge(bpy.context).text == bake_state.NOT_BAKED_TO_END
    assert changes() == ("light grid: it was not baked to its end",)
    assert state() == bake_state.OLD
    bake_grid.clear(bpy.context)
    assert changes() == ()
    assert state() == bake_state.CURRENT


@pytest.mark.parametrize("missing", [bake_store.GRID_SUFFIX, bake_store.KEY_SUFFIX])
def test_what_an_interrupted_bake_left_can_be_cleared(room, tmp_path, missing):
    save(tmp_path / "room.blend")
    path = bake()
    path.with_suffix(missing).unlink()
    assert bake_grid.clear_problem(bpy.context) is None
    bake_grid.clear(bpy.context)
    assert not path.parent.exists()
    assert bake_grid.clear_problem(bpy.context) is not None


def test_a_broken_key_is_told(room, tmp_path):
    save(tmp_path / "room.blend")
    bake().with_suffix(".json").write_text("{")
    with pytest.raises(InvalidInput, match="clear the bake"):
        changes()


def test_the_badge_goes_from_nothing_to_unknown_to_up_to_date(make_cube, tmp_path):
    assert state() == bake_state.NONE
    make_cube("Box")
    select("Box")
    authoring.write(authoring.from_selection(bpy.context, FEW)(silent))
    assert state() == bake_state.UNKNOWN
    assert changes() == ()
    assert state() == bake_state.CURRENT


def test_a_saved_and_loaded_file_is_unknown_until_it_is_compared_and_then_up_to_date(room, tmp_path):
    save(tmp_path / "room.blend")
    bake()
    save(tmp_path / "room.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "room.blend"))
    assert state() == bake_state.UNKNOWN
    assert changes() == ()
    assert state() == bake_state.CURRENT


def move(thing):
    thing.location.x += 0.5


def edit(thing):
    thing.data.vertices[0].co.z += 0.5
    thing.data.update()


def recolor(thing):
    material = bpy.data.materials.new("new")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.1, 0.2, 0.9, 1.0)
    thing.data.materials.append(material)


def textured(thing, image):
    recolor(thing)
    tree = bpy.data.materials["new"].node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    tree.links.new(texture.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    bpy.context.view_layer.update()


def delete(thing):
    bpy.data.objects.remove(thing)


@pytest.mark.parametrize(
    ("change", "told"), [(move, "changed"), (edit, "changed"), (recolor, "changed"), (delete, "is gone")]
)
def test_what_changes_a_source_is_suspected_at_once_and_found_when_asked(room, change, told):
    bake()
    assert changes() == ()
    change(bpy.data.objects["Box"])
    bpy.context.view_layer.update()
    assert state() == bake_state.UNKNOWN
    assert changes() == (f"VLM Floor: 'Box' {told}", f"light grid: 'Box' {told}")
    assert state() == bake_state.OLD


def test_what_no_light_is_made_from_is_not_suspected(room, make_light, make_camera):
    lamp, camera = make_light(), make_camera()
    bake()
    changes()
    lamp.data.energy, camera.location.x = 5.0, 3.0
    room.render.resolution_x = 64
    bpy.data.objects["Box"].select_set(False)
    bpy.context.view_layer.update()
    assert state() == bake_state.CURRENT


def test_moving_back_is_up_to_date_again(room):
    bake()
    box = bpy.data.objects["Box"]
    move(box)
    bpy.context.view_layer.update()
    assert changes()
    box.location.x -= 0.5
    bpy.context.view_layer.update()
    assert changes() == ()


def test_lights_moved_by_hand_outdate_the_grid_and_not_themselves(room):
    bake()
    lights = bpy.data.objects["VLM Floor"]
    lights.data.vertices[0].co.z -= 0.01
    lights.data.update()
    assert changes() == ("light grid: the places or tags of virtual lights changed",)


def test_lights_in_another_colour_outdate_nothing(room):
    bake()
    lights = bpy.data.objects["VLM Floor"]
    lights["vlm_strength"], lights["vlm_hue"] = 3.0, (1.0, 0.0, 0.0)
    lights.data.attributes["vlm_color"].data[0].color = (0.0, 5.0, 0.0, 1.0)
    assert changes() == ()


def test_settings_of_the_grid_outdate_it(room):
    bake()
    room.vlm.vlm_settings.tolerance = 0.01
    assert changes() == ("light grid: the light grid's settings changed",)
    room.vlm.vlm_settings.lights = "all"
    assert changes() == ("light grid: the scene uses none any more",)


@pytest.mark.parametrize("change", ["links", "settings", "hidden", "excluded"])
def test_what_blender_tells_no_change_of_is_noticed(room, change):
    bake()
    changes()
    assert state() == bake_state.CURRENT
    if change == "links":
        bpy.data.objects["VLM Floor"]["vlm_links"] = [1, 2]
    elif change == "settings":
        room.vlm.vlm_settings.tolerance = 0.01
    elif change == "hidden":
        bpy.data.objects["Box"].hide_render = True
    else:
        apart = bpy.data.collections.new("Apart")
        room.collection.children.link(apart)
        apart.objects.link(bpy.data.objects["Box"])
        room.collection.objects.unlink(bpy.data.objects["Box"])
        bpy.context.view_layer.update()
        changes()
        bpy.context.view_layer.layer_collection.children["Apart"].exclude = True
        bpy.context.view_layer.update()
    assert state() == bake_state.UNKNOWN


def test_a_painted_picture_of_a_source_is_suspected(make_cube):
    picture = bpy.data.images.new("Painted", 4, 4)
    textured(make_cube("Box"), picture)
    select("Box")
    authoring.write(authoring.from_selection(bpy.context, FEW)(silent))
    assert changes() == ()
    assert state() == bake_state.CURRENT
    picture.pixels[:] = [1.0] * 64
    picture.update_tag()
    bpy.context.view_layer.update()
    assert state() == bake_state.UNKNOWN
    assert changes() == ("VLM Box: 'Box' changed",)


def test_what_is_animated_is_up_to_date_in_every_frame(room):
    box = bpy.data.objects["Box"]
    for frame, x in ((1, 0.0), (11, 2.0)):
        box.location.x = x
        box.keyframe_insert("location", index=0, frame=frame)
    room.frame_set(1)
    assert changes() == ("VLM Floor: 'Box' changed",)
    select("Floor", "Box")
    authoring.write(authoring.from_selection(bpy.context, FEW)(silent))
    bake()
    room.frame_set(9)
    assert changes() == ()


def test_objects_whose_names_hold_slashes_are_told_apart(make_cube):
    make_cube("Wall/Left"), make_cube("Wall/Right")
    select("Wall/Left", "Wall/Right")
    authoring.write(authoring.from_selection(bpy.context, FEW)(silent))
    assert changes() == ()
    move(bpy.data.objects["Wall/Right"])
    bpy.context.view_layer.update()
    assert changes() == ("VLM Wall/Left: 'Wall/Right' changed",)


def test_comparing_marks_nothing_as_changed(room):
    bake()
    changes()
    bpy.context.view_layer.update()
    assert state() == bake_state.CURRENT


def during_bake(what):
    """Make lights of the boxes, with `what` happening before they are written; the sentence, or the refusal."""
    select("Floor", "Box")
    made = authoring.from_selection(bpy.context, FEW)(silent)
    what()
    try:
        return authoring.write(made)
    except InvalidInput as error:
        return str(error)


def whole_file():
    """The light mesh is read without an error, and no mesh is without a user."""
    extract()
    return all(mesh.users for mesh in bpy.data.meshes)


def test_deleting_the_light_mesh_during_its_bake_makes_it_again(room):
    assert "Made" in during_bake(lambda: bpy.data.objects.remove(bpy.data.objects["VLM Floor"]))
    bpy.data.orphans_purge()
    assert whole_file()


def test_deleting_a_source_during_a_bake_keeps_its_lights_and_says_that_they_are_old(room):
    assert "Made" in during_bake(lambda: delete(bpy.data.objects["Box"]))
    assert changes() == ("VLM Floor: 'Box' is gone",)


def test_deleting_the_scene_during_a_bake_is_told(room):
    other = bpy.data.scenes.new("other")

    def remove():
        for window in bpy.context.window_manager.windows:
            window.scene = other
        bpy.data.scenes.remove(room)

    assert "it is gone" in during_bake(remove)
    assert whole_file()


def test_editing_the_light_mesh_during_its_bake_keeps_the_edit_and_is_told(room):
    def enter():
        select("VLM Floor")
        bpy.ops.object.mode_set(mode="EDIT")

    before = len(bpy.data.objects["VLM Floor"].data.polygons)
    assert "it is being edited" in during_bake(enter)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(bpy.data.objects["VLM Floor"].data.polygons) == before
    assert whole_file()


def test_undo_during_a_bake_does_no_harm(room):
    bpy.ops.ed.undo_push(message="before")
    bpy.data.objects["Box"].location.x = 3.0
    bpy.ops.ed.undo_push(message="moved")
    assert "Made" in during_bake(bpy.ops.ed.undo)
    assert whole_file()
    assert changes() == ("VLM Floor: 'Box' changed",)


def test_saving_elsewhere_during_a_bake_of_the_grid_writes_it_there(room, tmp_path):
    save(tmp_path / "one.blend")
    baked = bake_grid.from_scene(bpy.context)(silent)
    save(tmp_path / "two.blend")
    path, _ = bake_grid.write(bpy.context, baked)
    assert path.parent == tmp_path / "two.vlm"
    assert changes() == ()


def test_renaming_the_scene_during_a_bake_of_the_grid_is_told_and_nothing_is_written(room, tmp_path):
    save(tmp_path / "room.blend")
    baked = bake_grid.from_scene(bpy.context)(silent)
    room.name = "renamed"
    with pytest.raises(InvalidInput, match="it is gone"):
        bake_grid.write(bpy.context, baked)
    assert not (tmp_path / "room.vlm").exists()


def test_a_scene_without_a_light_grid_is_refused(room):
    room.vlm.vlm_settings.lights = "all"
    with pytest.raises(InvalidInput, match="sums all lights"):
        bake_grid.from_scene(bpy.context)
