# SPDX-License-Identifier: GPL-3.0-or-later
"""The committed sample scenes: complete, small, and what their code builds."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

import mathutils  # noqa: E402

from vlm_addon.blender.extraction.extract import extract_scene  # noqa: E402
from vlm_addon.blender.extraction.light_mesh_io import extract  # noqa: E402
from vlm_addon.core.array_codec import content_hash  # noqa: E402
from vlm_addon.core.scene import DIFFUSE  # noqa: E402

FOLDER = Path(__file__).resolve().parents[2] / "sample_blends"
MAX_BYTES = 2_000_000

# Triangles in a render, from the sources that the scenes stand in for, and by how much each may be off.
TRIANGLES = {
    "cornell_box": (5144, 0.0),
    "empty_room": (12, 0.0),
    "monkey_box": (69451 + 12, 0.01),
    "atrium": (262209, 0.02),
    "lightwave_room": (36, 0.0),
    "lightwave_room_1": (6565, 0.01),
    "lightwave_room_10": (65542, 0.01),
    "dancer": (5000, 0.5),
    "hard_cases": (14293, 0.0),
}


def opened(path):
    """The scene of a file, extracted as for a render."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return extract_scene()


@pytest.fixture(scope="module")
def fresh_folder(tmp_path_factory):
    """All committed scenes built anew by the Blender that runs the tests."""
    folder = tmp_path_factory.mktemp("fresh")
    command = [sys.executable, str(FOLDER / "build.py"), "all", "--out", str(folder)]
    built = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert built.returncode == 0, built.stderr[-2000:]
    return folder


def test_every_listed_scene_is_committed_and_no_other():
    found = {path.stem for path in FOLDER.glob("*.blend")}
    assert set(TRIANGLES) <= found
    assert {name for name in found if not name.startswith("city") and not name.endswith("bunny_box")} == set(TRIANGLES)


@pytest.mark.parametrize("name", TRIANGLES)
def test_file_is_small_and_saved_by_the_oldest_supported_blender(name):
    path = FOLDER / f"{name}.blend"
    assert path.stat().st_size < MAX_BYTES
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert tuple(bpy.data.version[:2]) == (4, 2)


@pytest.mark.parametrize("name", TRIANGLES)
def test_scene_has_camera_lights_materials_and_its_triangles(name):
    snapshot = opened(FOLDER / f"{name}.blend")
    assert snapshot.camera is not None
    assert snapshot.lights
    assert all(max(light.power) > 0 for light in snapshot.lights)
    assert all(
        thing.data.materials for thing in bpy.context.scene.objects if thing.type == "MESH" and not thing.hide_render
    )
    expected, tolerance = TRIANGLES[name]
    assert snapshot.triangle_count == pytest.approx(expected, rel=tolerance, abs=0)


@pytest.mark.parametrize("name", TRIANGLES)
def test_every_point_is_finite_and_nothing_had_to_be_left_out(name):
    snapshot = opened(FOLDER / f"{name}.blend")
    for mesh in snapshot.meshes:
        assert np.isfinite(mesh.positions).all(), mesh.name
        assert ((mesh.reflectance >= 0) & (mesh.reflectance <= 1)).all(), mesh.name
    assert not snapshot.findings, [str(finding) for finding in snapshot.findings]


@pytest.mark.parametrize("name", TRIANGLES)
def test_committed_file_equals_a_fresh_build(name, fresh_folder):
    committed = opened(FOLDER / f"{name}.blend")
    fresh = opened(fresh_folder / f"{name}.blend")
    assert [mesh.name for mesh in committed.meshes] == [mesh.name for mesh in fresh.meshes]
    assert content_hash(committed.camera) == content_hash(fresh.camera)
    assert content_hash(committed.lights) == content_hash(fresh.lights)
    differing = [
        old.name
        for old, new in zip(committed.meshes, fresh.meshes, strict=True)
        if content_hash(old) != content_hash(new)
    ]
    assert not differing
    assert content_hash(committed) == content_hash(fresh)


@pytest.mark.parametrize("name", ["cornell_box", "empty_room", "hard_cases"])
def test_drawn_light_mesh_equals_a_fresh_build(name, fresh_folder):
    light_meshes = []
    for folder in (FOLDER, fresh_folder):
        bpy.ops.wm.open_mainfile(filepath=str(folder / f"{name}.blend"))
        light_meshes.append(extract().light_mesh)
    assert content_hash(light_meshes[0]) == content_hash(light_meshes[1])


def test_cornell_light_mesh_is_stored_as_documented():
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "cornell_box.blend"))
    (drawn,) = bpy.data.collections["Virtual Light Meshes"].objects
    assert drawn["vlm_schema"] == 1
    assert drawn.hide_render
    assert drawn.display_type == "WIRE"
    assert len(drawn.data.polygons) == 44
    assert {len(polygon.vertices) for polygon in drawn.data.polygons} == {3}
    stored = {
        item.name: (item.domain, item.data_type) for item in drawn.data.attributes if item.name.startswith("vlm_")
    }
    assert stored == {
        "vlm_color": ("FACE", "FLOAT_COLOR"),
        "vlm_emission": ("FACE", "FLOAT_COLOR"),
        "vlm_tag": ("FACE", "INT"),
        "vlm_area_scale": ("FACE", "FLOAT"),
    }


@pytest.mark.parametrize(("name", "lights"), [("cornell_box", 44), ("empty_room", 48)])
def test_drawn_lights_lie_behind_the_surfaces_and_reflect_as_much(name, lights):
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / f"{name}.blend"))
    both = extract()
    light_mesh, meshes = both.light_mesh, both.snapshot.meshes
    assert len(light_mesh) == lights
    # The lamp's panel is covered by the ceiling's lights; the block's bottom lies on the floor.
    power = sum(
        area @ mesh.reflectance.astype(float)
        for mesh in meshes
        if mesh.name != "Lamp panel"
        for area in [_areas(mesh) * ~(_on_floor(mesh) & (mesh.name == "Tall block"))]
    )
    np.testing.assert_allclose(light_mesh.reflected_power, power, rtol=0.01)

    centres, normals = light_mesh.corners.mean(axis=1), light_mesh.area_vectors
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for centre, normal in zip(centres, normals, strict=True):
        distance = _distance_to_visible(depsgraph, centre, normal)
        assert 0 < distance < 0.5, (centre, normal)


def _areas(mesh):
    """(t,) areas of a mesh's triangles, m²."""
    a, b, c = np.moveaxis(mesh.positions[mesh.triangles], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def _on_floor(mesh):
    """(t,) whether a triangle lies in the plane z = 0."""
    return (mesh.positions[mesh.triangles][..., 2] == 0).all(axis=1)


def _distance_to_visible(depsgraph, origin, direction):
    """Metres along a ray to the nearest surface that is not a light mesh; infinite for none."""
    origin, direction = mathutils.Vector(origin.tolist()), mathutils.Vector(direction.tolist())
    nearest = math.inf
    for thing in bpy.context.scene.objects:
        if thing.type != "MESH" or thing.hide_render:
            continue
        inverse = thing.matrix_world.inverted()
        hit, place, _, _ = thing.evaluated_get(depsgraph).ray_cast(inverse @ origin, inverse.to_3x3() @ direction)
        if hit:
            nearest = min(nearest, (thing.matrix_world @ place - origin).length)
    return nearest


def test_cornell_box_has_the_published_measures():
    snapshot = opened(FOLDER / "cornell_box.blend")
    room = np.concatenate(
        [mesh.positions for mesh in snapshot.meshes if "wall" in mesh.name.lower() or "Floor" in mesh.name]
    )
    np.testing.assert_allclose(np.ptp(room, axis=0), (5.496, 5.592, 5.488), atol=1e-5)
    (lamp,) = snapshot.lights
    assert (lamp.size_x, lamp.size_y) == pytest.approx((1.30, 1.05))
    assert {snapshot.materials[i].model for mesh in snapshot.meshes for i in mesh.material_indices} == {DIFFUSE}


def test_empty_room_is_closed_convex_and_lit_from_its_middle():
    snapshot = opened(FOLDER / "empty_room.blend")
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in snapshot.meshes])
    solid_angle_weights = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = -np.einsum("ij,ij->i", corners[:, 0], solid_angle_weights).sum() / 6
    low, high = snapshot.bounds()
    assert volume == pytest.approx(float(np.prod(high - low)), rel=1e-6)
    (lamp,) = snapshot.lights
    assert lamp.position == pytest.approx(tuple((low + high) / 2), abs=1e-6)
    assert lamp.radius == 0


def test_hard_cases_has_ten_named_cameras():
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "hard_cases.blend"))
    names = [thing.name for thing in bpy.context.scene.objects if thing.type == "CAMERA"]
    assert len(names) == 10
    assert all(name.startswith("Camera ") for name in names)


def test_hard_cases_has_virtual_lights_at_every_station():
    """Of every size, mirrored and squashed, in the very plane of what they stand for, and without area."""
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "hard_cases.blend"))
    drawn = bpy.data.collections["Virtual Light Meshes"].objects
    names = {thing.name.removesuffix(" lights") for thing in drawn}
    stations = {"Floor", "Tower", "Props", "Walls", "Slivers", "Cloth", "Cloth facing away", "Shells"}
    corners = {"Corner 0", "Corner 1", "Corner 2", "Corner 3", "Sheared corner"}
    assert names == stations | corners
    assert any(thing.matrix_world.determinant() < 0 for thing in drawn)
    light_mesh = extract().light_mesh
    assert 500 < len(light_mesh) < 2000
    assert (light_mesh.areas == 0).any()
    assert light_mesh.areas[light_mesh.areas > 0].min() < 1e-6
    assert light_mesh.areas.max() > 1e4


@pytest.mark.parametrize("percent", [0.1, 1.0, pytest.param(100.0, marks=pytest.mark.full)])
def test_city_grows_to_the_share_asked_for(percent, tmp_path):
    command = [sys.executable, str(FOLDER / "build.py"), "city", "--percent", str(percent), "--out", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    snapshot = opened(tmp_path / "city.blend")
    assert snapshot.triangle_count == pytest.approx(4_000_000 * percent / 100, rel=0.05)


def test_any_mesh_can_float_in_the_box(tmp_path):
    corners = "v 0 0 0\nv 9 0 0\nv 0 3 0\nv 0 0 3\n"
    (tmp_path / "tetrahedron.obj").write_text(corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    command = [sys.executable, str(FOLDER / "build.py"), "monkey_box", "--mesh", str(tmp_path / "tetrahedron.obj")]
    subprocess.run([*command, "--out", str(tmp_path)], check=True, capture_output=True, timeout=120)
    snapshot = opened(tmp_path / "tetrahedron_box.blend")
    floater = next(mesh for mesh in snapshot.meshes if mesh.name == "tetrahedron")
    assert len(floater.triangles) == 4
    assert np.ptp(floater.positions, axis=0).max() == pytest.approx(1.5, rel=1e-6)


@pytest.mark.parametrize(
    "arguments", [["no_such_scene"], ["city", "--percent", "0"], ["monkey_box", "--mesh", "no.obj"]]
)
def test_bad_arguments_end_with_a_sentence(arguments, tmp_path):
    command = [sys.executable, str(FOLDER / "build.py"), *arguments, "--out", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode != 0
    assert "Traceback" not in ended.stderr
    assert not list(tmp_path.iterdir())
