# SPDX-License-Identifier: GPL-3.0-or-later
"""Where surfaces were: against the motion that moved them, in float64."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.picture_sequence import WIDTH, PictureSequence, looking_down_y, moved
from tests.render.rooms import box_room, quad
from vlm_addon.core.scene import ORTHOGRAPHIC, Camera, Float64, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.mesh_motion import MeshMove, MeshPlaces
from vlm_addon.render.passes.motion import move_buffers

MIDDLE = np.array([1.0, 0.8, 1.0])


def grid(side: int = 5, name: str = "sheet") -> Mesh:
    """A sheet of 1 m at MIDDLE that faces the camera, of 2 x side x side triangles."""
    steps = np.linspace(-0.5, 0.5, side + 1)
    x, z = np.meshgrid(steps, steps, indexing="ij")
    positions = MIDDLE + np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    b, c, d = a + side + 1, a + side + 2, a + 1
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)
    count = len(triangles)
    template = quad((0, 0, 0), (1, 0, 0), (0, 0, 1), name=name)
    return moved(
        replace(
            template,
            triangles=triangles,
            corner_uvs=np.zeros((count, 3, 2), np.float32),
            material_indices=np.zeros(count, np.int32),
            tag_ids=np.zeros(count, np.int32),
            reflectance=np.zeros((count, 3), np.float32),
            emission=np.zeros((count, 3), np.float32),
        ),
        positions,
    )


def room_with(*meshes: Mesh) -> SceneSnapshot:
    """The room, then the meshes, so that theirs are the last faces; the camera sees them from before."""
    return replace(box_room(), meshes=(*box_room().meshes, *meshes), camera=looking_down_y())


ROOM_FACES = sum(len(mesh.triangles) for mesh in box_room().meshes)


def turn_about_y(angle: float) -> Float64:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def turn_about_z(angle: float) -> Float64:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def carried(places: Float64, faces: np.ndarray, now: Mesh, before: Mesh) -> Float64:
    """Where points of triangles `faces` of `now` are on `before`: by shares of areas, float64."""
    corners, then = now.positions[now.triangles[faces]], before.positions[before.triangles[faces]]
    u, v, p = (
        corners[..., 1, :] - corners[..., 0, :],
        corners[..., 2, :] - corners[..., 0, :],
        places - corners[..., 0, :],
    )
    normal = np.cross(u, v)
    area = (normal * normal).sum(axis=-1)
    share_v = (np.cross(u, p) * normal).sum(axis=-1) / area
    share_u = (np.cross(p, v) * normal).sum(axis=-1) / area
    shares = np.stack([1.0 - share_u - share_v, share_u, share_v], axis=-1)
    return (shares[..., None] * then).sum(axis=-2)


def pixel_size(places: Float64, chosen: np.ndarray) -> float:
    """m, from one pixel to the next along a row, median."""
    both = chosen[:, 1:] & chosen[:, :-1]
    return float(np.median(np.linalg.norm(np.diff(places, axis=1), axis=2)[both]))


def assert_found(before: Float64, wanted: Float64, pixel: float) -> None:
    """float32 of a scene of 1024 units, 2e-7 of some 3 m; rasterisers know corners to 1/256 of a pixel, so a pixel of
    an edge may lie that far outside of its triangle, and goes with the edge."""
    error = np.linalg.norm(before - wanted, axis=1)
    assert np.percentile(error, 95) < 2e-6
    assert error.max() < pixel / 64.0


@pytest.mark.parametrize("kind", ["PERSPECTIVE", ORTHOGRAPHIC])
@pytest.mark.parametrize("turn", [turn_about_y(0.3), turn_about_z(0.6), turn_about_y(3.0)], ids=["y", "z", "half"])
def test_a_turning_mesh_leads_back_to_where_it_was(device: Device, turn: Float64, kind: str) -> None:
    """The camera and the local space move as well. Places of what stands still are the G-buffer's, to the bit."""
    first, second = PictureSequence(device), grid()
    shift = np.array([0.2, -0.3, 0.1])
    turned = moved(second, (second.positions - MIDDLE) @ turn.T + MIDDLE + shift)
    first.picture(room_with(second), camera=looking_down_y(kind=kind, ortho_scale=3.0))
    picture = first.picture(room_with(turned), camera=looking_down_y((1.3, -2.4, 1.1), kind=kind, ortho_scale=3.0))
    on_sheet = picture.shown & (picture.faces >= ROOM_FACES)
    assert on_sheet.sum() > 100
    assert picture.before is not None
    assert picture.known is not None
    assert (picture.known == picture.shown).all()
    wanted = (picture.places[on_sheet] - MIDDLE - shift) @ turn + MIDDLE
    assert_found(picture.before[on_sheet], wanted, pixel_size(picture.places, on_sheet))
    still = picture.shown & ~on_sheet
    np.testing.assert_array_equal(picture.before[still], picture.places[still])
    np.testing.assert_allclose(picture.normal_before[on_sheet], picture.normals[on_sheet] @ turn, atol=2e-3)
    np.testing.assert_allclose(picture.plane_before[on_sheet], picture.normals[on_sheet] @ turn, atol=2e-3)


@pytest.mark.parametrize("amount", [0.01, 0.15])
def test_a_deforming_mesh_leads_back_to_where_its_triangles_were(device: Device, amount: float) -> None:
    """Every vertex moves on its own."""
    sequence, flat = PictureSequence(device), grid()
    random = np.random.default_rng(3)
    one, other = (moved(flat, flat.positions + amount * random.uniform(-1, 1, flat.positions.shape)) for _ in range(2))
    sequence.picture(room_with(one))
    picture = sequence.picture(room_with(other))
    on_sheet = picture.shown & (picture.faces >= ROOM_FACES)
    assert picture.before is not None
    wanted = carried(picture.places[on_sheet], picture.faces[on_sheet] - ROOM_FACES, other, one)
    assert_found(picture.before[on_sheet], wanted, pixel_size(picture.places, on_sheet))


@pytest.mark.parametrize("kind", ["PERSPECTIVE", ORTHOGRAPHIC])
def test_vectors_lead_to_where_the_picture_before_saw_it(device: Device, kind: str) -> None:
    """Camera and sheet move; jitter is no motion. Pixels of a camera by hand."""
    sequence, sheet = PictureSequence(device), grid()
    turn = turn_about_y(0.2)
    turned = moved(sheet, (sheet.positions - MIDDLE) @ turn.T + MIDDLE)
    first = looking_down_y(kind=kind, ortho_scale=3.0)
    sequence.picture(room_with(sheet), camera=first, jitter=(0.3, -0.4))
    second = looking_down_y((1.1, -2.9, 1.05), kind=kind, ortho_scale=3.0)
    picture = sequence.picture(room_with(turned), camera=second, jitter=(-0.2, 0.1))

    def pixels(points: Float64, camera: Camera) -> Float64:
        right, up, backward, eye = (camera.matrix_world[:3, i] for i in range(4))
        away = points - eye
        depth = 1.0 if kind == ORTHOGRAPHIC else -(away @ backward)[..., None]
        scale = WIDTH / (3.0 if kind == ORTHOGRAPHIC else 36.0 / 35.0)
        return np.stack([away @ right, away @ up], axis=-1) / depth * scale

    on_sheet = picture.shown & (picture.faces >= ROOM_FACES)
    came_from = np.where(on_sheet[..., None], (picture.places - MIDDLE) @ turn + MIDDLE, picture.places)
    wanted = pixels(came_from, first) - pixels(picture.places, second)
    inside = picture.shown & (picture.vectors != 0.0).all(axis=2)
    assert inside.sum() > 0.9 * picture.shown.sum()
    np.testing.assert_allclose(picture.vectors[inside], wanted[inside], atol=0.02)


def test_scenes_of_any_size_and_place(device: Device) -> None:
    """A hundred kilometres away and a thousand times as large."""
    far = np.array([1e5, -2e5, 3e4])
    scale = 1e3

    def there(scene: SceneSnapshot) -> SceneSnapshot:
        meshes = tuple(replace(mesh, positions=mesh.positions * scale + far) for mesh in scene.meshes)
        assert scene.camera is not None
        matrix = scene.camera.matrix_world.copy()
        matrix[:3, 3] = matrix[:3, 3] * scale + far
        return replace(
            scene, meshes=meshes, camera=replace(scene.camera, matrix_world=matrix, clip_start=50.0, clip_end=1e5)
        )

    turn, sequence, sheet = turn_about_y(0.4), PictureSequence(device), grid()
    turned = moved(sheet, (sheet.positions - MIDDLE) @ turn.T + MIDDLE)
    sequence.picture(there(room_with(sheet)))
    picture = sequence.picture(there(room_with(turned)))
    on_sheet = picture.shown & (picture.faces >= ROOM_FACES)
    middle = MIDDLE * scale + far
    assert picture.before is not None
    np.testing.assert_allclose(picture.before[on_sheet], (picture.places[on_sheet] - middle) @ turn + middle, atol=2e-3)


def test_what_is_new_or_has_other_triangles_was_nowhere(device: Device) -> None:
    sheet = grid()
    other = replace(sheet, triangles=sheet.triangles[::-1].copy())
    for first, second in (((), (sheet,)), ((sheet,), (other,)), ((sheet,), (grid(4),)), ((sheet,), (grid(name="x"),))):
        sequence = PictureSequence(device)
        sequence.picture(room_with(*first))
        picture = sequence.picture(room_with(*second))
        on_sheet = picture.shown & (picture.faces >= ROOM_FACES)
        assert on_sheet.sum() > 100
        assert picture.known is not None
        assert not picture.known[on_sheet].any()
        assert picture.known[picture.shown & ~on_sheet].all()
        assert picture.motion.changed


def test_a_scene_that_stands_still_has_no_motion(device: Device) -> None:
    sequence = PictureSequence(device)
    first = sequence.picture(room_with(grid()))
    # Other arrays of the same content; another camera.
    second = sequence.picture(room_with(grid()), camera=looking_down_y((0.4, -2.0, 1.0)))
    assert first.before is None
    assert second.before is None
    assert not second.motion.changed


def test_copies_of_one_name_are_told_by_their_order(device: Device) -> None:
    sequence, sheet = PictureSequence(device), grid(2)
    left, right = (moved(sheet, 0.6 * (sheet.positions - MIDDLE) + MIDDLE + [x, 0.0, 0.0]) for x in (-0.4, 0.4))
    sequence.picture(room_with(left, right))
    step = np.array([0.0, 0.1, 0.0])
    picture = sequence.picture(room_with(left, moved(right, right.positions - step)))
    on_right = picture.shown & (picture.faces >= ROOM_FACES + 8)
    on_left = picture.shown & (picture.faces >= ROOM_FACES) & ~on_right
    assert min(on_left.sum(), on_right.sum()) > 50
    assert picture.before is not None
    np.testing.assert_array_equal(picture.before[on_left], picture.places[on_left])
    np.testing.assert_allclose(picture.before[on_right], picture.places[on_right] + step, atol=1e-6)


def test_meshes_that_exceed_a_buffer_have_no_earlier_place() -> None:
    space = LocalSpace(np.zeros(3), 1.0)
    moves = [MeshMove(grid(side), first, grid(side).positions + 1.0) for side, first in ((2, 0), (9, 8), (2, 170))]
    records, vertices, corners = move_buffers(moves, space, 32 * 20)
    assert records.tolist() == [[0, 8, 0, 0], [8, 170, -1, 0], [170, 178, 24, 0]]
    assert len(vertices) == 18
    assert corners.max() == 17
    np.testing.assert_allclose(vertices[:, 1, :3], 1.0)


def test_pictures_say_since_when_their_motion_holds() -> None:
    places, still, shifted = MeshPlaces(), room_with(grid()), room_with(moved(grid(), grid().positions + 0.1))
    assert places.advance(still).picture == 1
    rested = places.rest()
    assert (rested.picture, rested.changed) == (2, False)
    third = places.advance(shifted)
    # Places lead back to picture 2 and no further: not to a history of picture 1, though nothing moved between.
    assert (third.picture, third.since, third.changed, len(third.moves)) == (3, 2, True, 1)
    assert (places.rest().since, places.advance(shifted).since) == (3, 3)
    gone = places.advance(box_room())
    assert (gone.changed, gone.moves) == (True, ())


def test_snapshots_need_not_live_on() -> None:
    """Arrays from another process are views of a file that is written anew for each frame."""
    places, sheet = MeshPlaces(), grid()
    positions = sheet.positions.copy()
    places.advance(room_with(replace(sheet, positions=positions)))
    positions += 5.0
    (move,) = places.advance(room_with(replace(sheet, positions=positions))).moves
    assert move.before is not None
    np.testing.assert_array_equal(move.before, sheet.positions)
