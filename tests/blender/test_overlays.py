# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays: what they would draw of lights and tagged surfaces, and that off they leave nothing behind."""

from contextlib import ExitStack
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.blender.overlays import overlay_drawing, overlays
from vlm_addon.blender.overlays.overlay_drawing import OverlayDrawing
from vlm_addon.blender.overlays.overlay_shapes import (
    COLOR,
    EMISSION,
    TAGS,
    depths_below,
    fill_shape,
    finding_shapes,
    half_ball_shape,
    side_shapes,
    tagged_surface_shapes,
    world_faces,
)
from vlm_addon.core.display_colors import hdr_colors, tag_colors
from vlm_addon.core.grid_samples import grid_view
from vlm_addon.core.light_grid import RANGE, GridSettings, LightGrid

HANDLERS = ("depsgraph_update_post", "undo_post", "redo_post", "load_post")


@pytest.fixture
def make_lights(make_mesh):
    """make_lights(**attributes): a light mesh of a square and a triangle, mirrored and moved, with FACE attributes."""

    def make(**attributes):
        corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (3, 0, 0), (2, 1, 1)]
        thing = make_mesh("lights", corners, [(0, 1, 2, 3), (4, 5, 6)])
        thing["vlm_schema"] = 2
        thing.location, thing.scale = (1.0, 2.0, 3.0), (-1.0, 2.0, 1.0)
        for name, values in attributes.items():
            values = np.asarray(values)
            kind = "FLOAT_COLOR" if values.ndim == 2 else "INT"
            attribute = thing.data.attributes.new(name, kind, "FACE")
            dtype = np.float32 if kind == "FLOAT_COLOR" else np.int32
            attribute.data.foreach_set("color" if values.ndim == 2 else "value", values.astype(dtype).ravel())
        bpy.context.view_layer.update()
        return thing

    return make


@pytest.fixture
def registered():
    """The overlays alone, added and taken out again."""
    with ExitStack() as undo:
        overlays.register(undo)
        yield bpy.context.window_manager.vlm_overlay


def handler_counts():
    return {name: len(getattr(bpy.app.handlers, name)) for name in HANDLERS}


def faces_of(thing):
    return world_faces(thing, bpy.context.evaluated_depsgraph_get())


def test_lights_have_their_colours_times_hue_and_strength(make_lights):
    colors = [[0.5, 0.25, 0.0, 1.0], [0.1, 7.5, 0.2, 1.0]]
    thing = make_lights(vlm_color=colors, vlm_emission=[[3, 0, 0, 1], [0, 0, 0, 1]], vlm_tag=[0, 7])
    thing["vlm_strength"], thing["vlm_hue"] = 2.0, (1.0, 0.5, 1.0)
    faces = faces_of(thing)
    assert len(faces.corners) == 3
    shown = fill_shape(thing, faces, COLOR, 0.5)
    expected = hdr_colors(np.array([[1.0, 0.25, 0.0], [0.2, 7.5, 0.4]]))
    assert shown.colors[[0, 6], :3] == pytest.approx(expected, abs=1e-6)
    assert (shown.colors[:, 3] == 0.5).all()
    glow = fill_shape(thing, faces, EMISSION, 0.5).colors
    assert glow[0, :3] == pytest.approx(hdr_colors(np.array([[6.0, 0.0, 0.0]]))[0], abs=1e-6)
    assert (glow[6, :3] == 0.0).all()
    tagged = fill_shape(thing, faces, TAGS, 0.5).colors
    assert tagged[6, :3] == pytest.approx(tag_colors(np.array([7], np.int32))[0], abs=1e-6)
    assert np.ptp(tagged[0, :3]) == 0.0, "lights without a tag are gray"


def test_normals_lead_to_the_shining_side_of_mirrored_objects_too(make_lights):
    thing = make_lights()
    faces = faces_of(thing)
    a, b, c = faces.corners[0]
    assert np.cross(b - a, c - a)[2] > 0.0
    rims, normals = side_shapes(faces)
    assert len(rims.positions) == 2 * (4 + 3)
    start, end = normals.positions[:2]
    assert (end - start)[:2] == pytest.approx(0.0, abs=1e-6)
    assert end[2] > start[2]


def test_edit_mode_shows_what_object_mode_shows(make_lights):
    thing = make_lights(vlm_color=[[0.5, 0.25, 0.0, 1.0], [0.1, 7.5, 0.2, 1.0]])
    faces = faces_of(thing)
    before = fill_shape(thing, faces, COLOR, 1.0)
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    edited = faces_of(thing)
    after = fill_shape(thing, edited, COLOR, 1.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    for number in (0, 1):
        own = [found.corners[found.faces == number].reshape(-1, 3) for found in (faces, edited)]
        assert np.unique(own[0], axis=0) == pytest.approx(np.unique(own[1], axis=0))
        area = [found.areas[number] for found in (faces, edited)]
        assert area[0] == pytest.approx(area[1])
    assert (before.colors == after.colors).all()


def test_what_was_found_is_marked_until_the_mesh_is_another(make_lights):
    thing = make_lights()
    mark = SimpleNamespace(owner="lights", faces="1", face_count=2)
    findings = [SimpleNamespace(marks=[mark])]
    scene = SimpleNamespace(vlm=SimpleNamespace(findings=findings), objects=bpy.context.scene.objects)
    faces = faces_of(thing)
    filled, rims = finding_shapes(scene, thing, faces, 0.5)
    assert filled.positions.reshape(-1, 3, 3) == pytest.approx(faces.corners[faces.faces == 1])
    assert len(rims.positions) == 6
    mark.face_count = 5
    filled, rims = finding_shapes(scene, thing, faces, 0.5)
    assert len(filled.positions) == len(rims.positions) == 0


def test_half_balls_are_of_chosen_lights_as_the_grid_has_them(make_lights):
    thing = make_lights()
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    faces = faces_of(thing)
    shape = half_ball_shape(thing, faces, 2.0)
    own = faces.corners[2]
    centre = own.mean(axis=0)
    radius = 2.0 * np.linalg.norm(own - centre, axis=1).max()
    last = shape.positions[-1]
    assert np.linalg.norm(last - centre) == pytest.approx(radius, rel=1e-5)


def test_tagged_faces_of_visible_objects_show_after_modifiers_and_in_instances(make_plane, make_lights):
    make_lights(vlm_tag=[5, 5])
    plane = make_plane("plane")
    plane["vlm_tag"] = 9
    plane.modifiers.new("more", "ARRAY").count = 3
    make_plane("bare")
    faces = make_plane("faces")
    faces.data.attributes.new("vlm_tag", "INT", "FACE").data.foreach_set("value", np.array([4], np.int32))
    hidden = make_plane("hidden")
    hidden["vlm_tag"] = 11
    hidden.hide_set(True)
    bpy.context.view_layer.update()
    shapes = list(tagged_surface_shapes(bpy.context.evaluated_depsgraph_get(), 0.5))
    found = {tuple(np.round(shape.colors[0, :3], 5)): len(shape.positions) // 3 for shape in shapes}
    nine, four = (tuple(np.round(color.astype(np.float32), 5)) for color in tag_colors(np.array([9, 4], np.int32)))
    assert found == {nine: 6, four: 2}


def test_off_there_is_no_handler(registered, make_lights):
    make_lights()
    before = handler_counts()
    registered.show = True
    assert handler_counts() == {**{name: count + 1 for name, count in before.items()}, "load_post": before["load_post"]}
    registered.show = True
    registered.show = False
    assert handler_counts() == before


def test_unregistering_while_shown_takes_everything_out():
    before = handler_counts()
    with ExitStack() as undo:
        overlays.register(undo)
        bpy.context.window_manager.vlm_overlay.show = True
    assert handler_counts() == before
    assert not hasattr(bpy.types.WindowManager, "vlm_overlay")


def test_another_file_keeps_the_handlers_in_step(registered):
    registered.show = True
    bpy.ops.wm.read_factory_settings(use_empty=True)
    shown = bpy.context.window_manager.vlm_overlay.show
    assert (overlays._depsgraph_changed in bpy.app.handlers.depsgraph_update_post) == shown


def test_a_grid_that_is_shown_again_is_drawn_anew(make_lights, registered, monkeypatch):
    """Also where its cells have the address that those before had: here they all have one."""
    make_lights()
    context, drawing, drawn = bpy.context, OverlayDrawing(), []
    monkeypatch.setattr(overlay_drawing, "id", lambda _: 1, raising=False)
    monkeypatch.setattr(overlay_drawing, "cell_shapes", lambda *rest: drawn.append(rest) or [])
    lights = extract().light_mesh
    bounds = lights.vertices.min(axis=0), lights.vertices.max(axis=0)
    view = grid_view(LightGrid.bake(lights, bounds, GridSettings(mode=RANGE, grid=4)), lights, bounds)
    for _ in range(2):
        drawing.set_grid(context.scene, view)
        for _ in range(2):
            drawing._grid_part(context.scene, SimpleNamespace(grid_place="CURSOR", opacity=0.7))
    assert len(drawn) == 2


def test_only_what_changed_is_made_anew(make_lights, make_plane):
    """Keys of kept shapes follow changes of their own object, and of surfaces for those of tags."""
    lights, plane = make_lights(), make_plane()
    drawing = OverlayDrawing()
    key = drawing._surface_key(bpy.context.scene)
    drawing.touch(lights)
    assert drawing._surface_key(bpy.context.scene) == key
    drawing.touch(plane)
    assert drawing._surface_key(bpy.context.scene) != key
    key = drawing._surface_key(bpy.context.scene)
    plane["vlm_tag"] = 3
    assert drawing._surface_key(bpy.context.scene) != key


def test_lights_come_as_much_nearer_as_they_lie_below_their_surface(make_mesh, make_plane):
    """A square 0.03 m below a plane, one 0.05 m above it that is turned over, and one with nothing near."""
    make_plane(size=20.0)
    squares = [[(x, y, z) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))] for z in (-0.03, 0.05, 5.0)]
    corners = [(x + 2 * row, y, z) for row, square in enumerate(squares) for x, y, z in square]
    thing = make_mesh("lights", corners, [(0, 1, 2, 3), (7, 6, 5, 4), (8, 9, 10, 11)])
    thing["vlm_schema"] = 2
    bpy.context.view_layer.update()
    faces = faces_of(thing)
    depths = depths_below(bpy.context.scene, bpy.context.evaluated_depsgraph_get(), faces)
    for face, depth in enumerate((0.03, 0.05, 0.0)):
        assert depths[faces.faces == face] == pytest.approx(depth, abs=1e-6)
    assert fill_shape(thing, faces, COLOR, 1.0, depths).nearer.reshape(-1, 3)[:, 0] == pytest.approx(depths, abs=1e-6)


def test_a_light_under_a_bulge_comes_out_in_its_middle(make_mesh, make_plane):
    """The surface is a pyramid 0.2 m high over a square, the light its base."""
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 0.2)]
    make_mesh("bulge", corners, [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)])
    thing = make_mesh("lights", corners[:3], [(0, 1, 2)])
    thing["vlm_schema"] = 2
    bpy.context.view_layer.update()
    (depth,) = depths_below(bpy.context.scene, bpy.context.evaluated_depsgraph_get(), faces_of(thing))
    assert depth == pytest.approx(0.2 * (1.0 - 1.0 / 3.0), rel=1e-4), "over the middle of the light"


def test_depths_are_looked_for_again_where_lights_moved_and_not_where_their_colours_changed(make_lights, monkeypatch):
    thing = make_lights(vlm_color=[[0.5, 0.25, 0.0, 1.0], [0.1, 7.5, 0.2, 1.0]])
    asked = []
    monkeypatch.setattr(overlay_drawing, "depths_below", lambda *rest: asked.append(rest) or np.zeros(3))
    drawing = OverlayDrawing()

    def look():
        drawing._depths_below(thing, bpy.context.scene, None, faces_of(thing))
        return len(asked)

    assert [look(), look()] == [1, 1]
    thing.data.attributes["vlm_color"].data[0].color = (1.0, 1.0, 1.0, 1.0)
    assert look() == 1
    thing.location.x += 1.0
    bpy.context.view_layer.update()
    assert look() == 2
