# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes as read from a scene, and the points of the visible surface that they stand for."""

import bpy
import numpy as np
import pytest

from vlm_addon.blender.extraction.extract import ExtractOptions
from vlm_addon.blender.extraction.light_mesh_io import extract, extract_light_mesh
from vlm_addon.core.errors import InvalidInput


@pytest.fixture
def make_lights(make_mesh):
    """make_lights(vertices, faces, **attributes): a light mesh object with FACE attributes by name."""

    def make(vertices, faces, name="lights", **attributes):
        blender_object = make_mesh(name, vertices, faces)
        blender_object["vlm_schema"] = 1
        blender_object.hide_render = True
        for attribute_name, values in attributes.items():
            values = np.asarray(values)
            kind = "FLOAT_COLOR" if values.ndim == 2 else "INT" if values.dtype.kind == "i" else "FLOAT"
            attribute = blender_object.data.attributes.new(attribute_name, kind, "FACE")
            if values.ndim == 2:
                values = np.column_stack([values, np.ones(len(values))])
            field = "color" if kind == "FLOAT_COLOR" else "value"
            attribute.data.foreach_set(field, np.ascontiguousarray(values, values.dtype).ravel())
        return blender_object

    return make


SQUARE = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]


def square_at(z):
    return [(x, y, z) for x, y, _ in SQUARE]


def test_no_light_mesh_is_none(make_plane):
    make_plane()
    assert extract().light_mesh is None


def test_attributes_become_lights(make_plane, make_lights):
    make_plane()
    lights = make_lights(
        square_at(-0.1),
        [(0, 1, 2), (0, 2, 3)],
        vlm_color=np.array([[0.5, 0.25, 7.5], [1, 1, 1]]),
        vlm_emission=np.array([[0, 0, 0], [3, 2, 1]]),
        vlm_tag=np.array([4, 5]),
        vlm_area_scale=np.array([1.0, 2.0]),
    )
    lights["vlm_strength"] = 3.0
    lights["vlm_hue"] = (1.0, 2.0, 0.5)
    found = extract()
    assert not found.snapshot.findings
    mesh = found.light_mesh
    assert mesh.colour == pytest.approx(np.array([[0.5, 0.5, 3.75], [1, 2, 0.5]]))
    assert mesh.emission == pytest.approx(np.array([[0, 0, 0], [3, 4, 0.5]]))
    assert mesh.strength == pytest.approx([3.0, 6.0])
    assert mesh.tag_ids.tolist() == [4, 5]
    assert not mesh.dynamic.any()


def test_faces_of_more_corners_are_several_lights(make_plane, make_lights):
    make_plane()
    make_lights(square_at(-0.1), [(0, 1, 2, 3)], vlm_color=np.array([[0.3, 0.2, 0.1]]))
    mesh = extract().light_mesh
    assert len(mesh) == 2
    assert mesh.colour == pytest.approx(np.tile([0.3, 0.2, 0.1], (2, 1)))


def test_lights_are_found_by_property_not_by_name(make_plane, make_lights):
    make_plane(name="Virtual Light Mesh")
    make_lights(SQUARE, [(0, 1, 2)], name="anything", vlm_color=np.ones((1, 3)))
    assert len(extract().light_mesh) == 1


def test_lights_of_several_objects_are_joined(make_plane, make_lights):
    make_plane()
    make_lights(square_at(-0.1), [(0, 1, 2)], name="b", vlm_color=np.full((1, 3), 0.5))
    make_lights(square_at(-0.1), [(0, 2, 3)], name="a", vlm_color=np.full((1, 3), 0.25))
    mesh = extract().light_mesh
    assert sorted(mesh.colour[:, 0].tolist()) == [0.25, 0.5]
    assert np.diff(mesh.samples.offsets).min() >= 4


def test_modifiers_of_light_meshes_count_and_nothing_is_left_changed(make_plane, make_lights, file_state):
    make_plane(size=10.0)
    lights = make_lights(square_at(-0.1), [(0, 1, 2, 3)], vlm_color=np.ones((1, 3)))
    modifier = lights.modifiers.new("array", "ARRAY")
    modifier.show_viewport = False
    before = file_state()
    found = extract()
    assert len(found.light_mesh) == 4
    assert len(found.snapshot.meshes) == 1
    assert file_state() == before


def test_a_mirrored_light_mesh_shines_to_the_mirrored_side(make_plane, make_lights):
    make_plane()
    lights = make_lights(square_at(-0.1), [(0, 1, 2)], vlm_color=np.ones((1, 3)))
    lights.scale.x = -1.0
    assert extract().light_mesh.area_vectors[0, 2] > 0.0


def test_a_moving_light_mesh_is_dynamic(make_plane, make_lights):
    make_plane()
    make_lights(SQUARE, [(0, 1, 2)], vlm_color=np.ones((1, 3))).keyframe_insert("location", frame=1)
    assert extract().light_mesh.dynamic.all()


def test_samples_lie_on_the_surface_in_front(make_plane, make_lights):
    make_plane(size=10.0)
    make_lights(square_at(-0.2), [(0, 1, 2), (0, 2, 3)], vlm_color=np.ones((2, 3)))
    mesh = extract().light_mesh
    samples = mesh.samples
    assert np.diff(samples.offsets).tolist() == [16, 16]
    assert samples.positions[:, 2] == pytest.approx(0.0, abs=1e-6)
    assert samples.normals == pytest.approx(np.tile([0.0, 0.0, 1.0], (32, 1)))
    # Each sample is straight in front of its light: the first light has x > y.
    assert (samples.positions[:16, 0] >= samples.positions[:16, 1]).all()
    assert np.add.reduceat(samples.weights, samples.offsets[:-1]) == pytest.approx(1.0)


def test_back_faces_in_between_are_passed(make_plane, make_lights):
    make_plane("far", size=10.0)
    near = make_plane("near, seen from behind", size=10.0)
    near.location.z = -0.1
    near.rotation_euler.x = np.pi
    make_lights(square_at(-0.2), [(0, 1, 2)], vlm_color=np.ones((1, 3)))
    assert extract().light_mesh.samples.positions[:, 2] == pytest.approx(0.0, abs=1e-6)


def test_a_light_in_the_plane_of_its_surface_measures_there(make_plane, make_lights):
    make_plane(size=10.0).location = (1000.0, 0.0, 0.0)
    lights = make_lights(SQUARE, [(0, 1, 2)], vlm_color=np.ones((1, 3)))
    lights.location = (1000.0, 0.0, 0.0)
    found = extract()
    assert not found.snapshot.findings
    assert found.light_mesh.samples.positions[:, 2] == pytest.approx(0.0, abs=1e-6)


def test_a_light_that_sticks_out_in_front_measures_behind_it(make_plane, make_lights):
    make_plane(size=10.0)
    make_lights(square_at(0.1), [(0, 1, 2)], vlm_color=np.ones((1, 3)))
    assert extract().light_mesh.samples.positions[:, 2] == pytest.approx(0.0, abs=1e-6)


def test_points_beyond_the_edge_of_the_surface_are_left_out(make_plane, make_lights):
    make_plane(size=1.0)
    make_lights(square_at(-0.1), [(0, 1, 2), (0, 2, 3)], vlm_color=np.ones((2, 3)))
    samples = extract().light_mesh.samples
    assert np.abs(samples.positions[:, :2]).max() <= 0.5
    assert np.add.reduceat(samples.weights, samples.offsets[:-1]) == pytest.approx(1.0)


def test_a_light_beside_its_surface_takes_the_nearest_point(make_plane, make_lights):
    make_plane(size=2.0)
    lights = make_lights(square_at(-0.1), [(0, 1, 2)], vlm_color=np.ones((1, 3)))
    lights.location.x = 2.05
    samples = extract().light_mesh.samples
    assert len(samples.positions) == 1
    assert samples.positions[0, 0] == pytest.approx(1.0, abs=1e-5)


def test_a_light_without_surface_measures_itself_and_is_listed(make_plane, make_lights):
    make_plane().location.z = 50.0
    make_lights(SQUARE, [(0, 1, 2), (0, 2, 3)], vlm_color=np.ones((2, 3)))
    found = extract()
    assert [finding.subject for finding in found.snapshot.findings] == ["light mesh"]
    assert "2 of 2 lights" in found.snapshot.findings[0].problem
    assert found.light_mesh.samples.positions[:, 2] == pytest.approx(0.0)


def test_a_half_lit_source_is_sampled_in_both_halves(make_plane, make_lights):
    make_plane(size=10.0)
    make_lights(square_at(-0.1), [(0, 1, 2), (0, 2, 3)], vlm_color=np.ones((2, 3)))
    samples = extract(ExtractOptions(samples_per_light=64)).light_mesh.samples
    share = (samples.positions[:, 0] > 0.0).mean()
    assert share == pytest.approx(0.5, abs=0.05)


def test_missing_colours_are_white_and_listed(make_plane, make_lights):
    make_plane()
    make_lights(square_at(-0.1), [(0, 1, 2)])
    found = extract()
    assert (found.light_mesh.colour == 1.0).all()
    assert "vlm_color" in found.snapshot.findings[0].problem


def test_both_ways_of_reading_agree(make_plane, make_lights):
    from vlm_addon.blender.extraction.extract import extract_scene
    from vlm_addon.core.array_codec import content_hash

    make_plane()
    make_lights(square_at(-0.1), [(0, 1, 2)], vlm_color=np.ones((1, 3)))
    found = extract()
    snapshot = extract_scene()
    assert content_hash(snapshot) == content_hash(found.snapshot)
    assert content_hash(extract_light_mesh(snapshot)) == content_hash(found.light_mesh)


def test_a_render_engine_gets_the_light_meshes_that_renders_hide(make_plane, make_lights, make_camera, scene):
    make_plane()
    make_lights(square_at(-0.1), [(0, 1, 2)], vlm_color=np.ones((1, 3)))
    make_camera()
    counts = []

    class Engine(bpy.types.RenderEngine):
        bl_idname, bl_label = "VLM_TEST", "test"

        def render(self, depsgraph):
            found = extract(depsgraph=depsgraph)
            counts.extend([len(found.light_mesh), found.snapshot.triangle_count])

    bpy.utils.register_class(Engine)
    scene.render.engine = "VLM_TEST"
    bpy.ops.render.render()
    scene.render.engine = "CYCLES"
    bpy.utils.unregister_class(Engine)
    assert counts == [1, 2]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda o: o.__setitem__("vlm_schema", 3), "vlm_schema is 3"),
        (lambda o: o.__setitem__("vlm_strength", -1.0), "negative"),
        (lambda o: o.__setitem__("vlm_strength", float("nan")), "not finite"),
    ],
)
def test_light_meshes_that_cannot_be_used_are_named(make_plane, make_lights, change, text):
    make_plane()
    change(make_lights(square_at(-0.1), [(0, 1, 2)], vlm_color=np.ones((1, 3))))
    with pytest.raises(InvalidInput, match=text):
        extract()


def test_lights_lead_back_to_the_faces_they_are_stored_as(make_plane, make_lights):
    make_plane()
    make_lights(square_at(-0.1), [(0, 1, 2), (0, 2, 3)], name="b", vlm_color=np.ones((2, 3)))
    make_lights(square_at(-0.2), [(0, 1, 2, 3)], name="a", vlm_color=np.ones((1, 3)))
    found = extract()
    assert found.origins.faces_by_object(range(len(found.light_mesh))) == {"a": [0], "b": pytest.approx([0, 1])}
    by_height = found.light_mesh.corners[:, 0, 2] < -0.15
    quad = found.origins.faces_by_object(np.flatnonzero(by_height))
    assert by_height.sum() == 2
    assert list(quad) == ["a"]


def test_lights_that_a_modifier_made_lead_back_to_no_face(make_plane, make_lights):
    make_plane()
    made = make_lights(square_at(-0.1), [(0, 1, 2), (0, 2, 3)], vlm_color=np.ones((2, 3)))
    made.modifiers.new("Array", "ARRAY").count = 2
    found = extract()
    assert len(found.light_mesh) == 4
    assert found.origins.faces_by_object(range(4)) == {}


def test_a_light_mesh_without_faces_gives_no_light_and_is_named(make_plane, make_lights):
    make_plane()
    make_lights(square_at(-0.1), [(0, 1, 2)], name="kept", vlm_color=np.ones((1, 3)))
    make_lights(square_at(-0.2), [(0, 1, 2)], name="emptied", vlm_color=np.ones((1, 3))).data.clear_geometry()
    found = extract()
    assert len(found.light_mesh) == 1
    assert "light mesh 'emptied'" in [finding.subject for finding in found.snapshot.findings]
