# SPDX-License-Identifier: GPL-3.0-or-later
"""Means over pictures of any pass: right where nothing changes, and soon right where something does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.picture_sequence import HEIGHT, WIDTH, Found, PictureSequence, looking_down_y, moved
from tests.render.rooms import box_room, camera_at, quad
from vlm_addon.core.scene import ORTHOGRAPHIC, Camera, Float32, Float64, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.passes.accumulate import jitter_offsets

LONG = {"history": 1000}
ROOM_FACES = sum(len(mesh.triangles) for mesh in box_room().meshes)
BEHIND = 1.0
"""m: y of the wall behind the card."""


@pytest.fixture
def sequence(device: Device) -> PictureSequence:
    return PictureSequence(device)


def noise(seed: int) -> Float64:
    """Of each pixel's own, in [0, 1), four channels."""
    return np.random.default_rng(seed).random((HEIGHT, WIDTH, 4))


def given(values: np.ndarray) -> Found:
    return lambda places, faces: values


def constant(value: float) -> Found:
    return lambda places, faces: np.full(faces.shape, value)


def smooth(places: Float64, faces: np.ndarray) -> Float64:
    """From 0.5 to 1.5 over metres."""
    values: Float64 = 1.0 + 0.5 * np.sin(places)
    return values


def wall() -> Mesh:
    return quad((-4.0, BEHIND, -4.0), (9.0, 0.0, 0.0), (0.0, 0.0, 9.0), name="wall")


def card(x: float, y: float = BEHIND - 0.1, size: float = 0.2) -> Mesh:
    return quad((x, y, 0.6), (size, 0.0, 0.0), (0.0, 0.0, 0.8), name="card")


def before_wall(*meshes: Mesh) -> SceneSnapshot:
    return replace(box_room(), meshes=(wall(), *meshes), camera=looking_down_y())


WALL_FACES = 2


def inside(faces: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Pixels whose neighbours all show the same quad."""
    quads = np.pad(np.where(shown, faces // 2, -1), 1, constant_values=-2)
    same = shown.copy()
    for y in range(3):
        for x in range(3):
            same &= quads[y : y + HEIGHT, x : x + WIDTH] == quads[1:-1, 1:-1]
    return same


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_a_scene_that_stands_still_goes_to_the_mean_of_all_pictures(sequence: PictureSequence, channels: int) -> None:
    """The camera rests, each picture looks elsewhere in its pixels: to rounding, without any blur. Pixels of edges have
    a mean of their surface as well, from beside them where the picture before saw the other one."""
    jitter = jitter_offsets(16)
    values = [noise(index)[..., :channels] for index in range(16)]
    for index in range(16):
        picture = sequence.picture(box_room(), given(values[index]), jitter=tuple(jitter[index]), **LONG)
    inner = inside(picture.faces, picture.shown)
    assert inner.sum() > 0.35 * picture.shown.sum()
    assert (picture.age[inner] == 16.0).all()
    mean = np.mean(values, axis=0)
    np.testing.assert_allclose(picture.mean[inner][:, :channels], mean[inner], atol=3e-6)
    edges = picture.shown & ~inner
    assert (picture.age[edges] >= 8.0).mean() > 0.8
    # What passes say of pixels without surface is theirs.
    last = values[-1].astype(np.float32)
    np.testing.assert_array_equal(picture.mean[~picture.shown][:, :channels], last[~picture.shown])


def test_the_pictures_of_a_frame_average_to_the_mean_of_all(sequence: PictureSequence) -> None:
    """Of this frame's and of those before. The pictures of a first frame show what they found, to the bit."""
    values = [noise(index) for index in range(8)]
    shown = []
    for index in range(8):
        picture = sequence.picture(box_room(), given(values[index]), sample_index=index % 4, **LONG)
        shown.append(picture.mean)
    for index in range(4):
        np.testing.assert_array_equal(shown[index][picture.shown], values[index].astype(np.float32)[picture.shown])
    np.testing.assert_allclose(
        np.mean(shown[4:], axis=0)[picture.shown], np.mean(values, axis=0)[picture.shown], atol=3e-6
    )


def test_the_mean_counts_no_more_pictures_than_it_is_told(sequence: PictureSequence) -> None:
    for _ in range(6):
        sequence.picture(box_room(), constant(1.0), history=4)
    picture = sequence.picture(box_room(), constant(0.0), history=4)
    np.testing.assert_allclose(picture.mean[picture.shown][:, 0], 0.8, rtol=1e-5)


def test_the_same_pictures_give_the_same_bits(device: Device) -> None:
    def last() -> np.ndarray:
        sequence = PictureSequence(device)
        for index in range(4):
            scene = before_wall(card(0.3 + 0.1 * index))
            camera = looking_down_y((1.0 + 0.03 * index, -3.0, 1.0))
            picture = sequence.picture(scene, given(noise(index)), camera=camera)
        return picture.mean

    np.testing.assert_array_equal(last(), last())


CUTS: dict[str, Camera] = {
    "another corner": camera_at((0.2, 0.5, 0.5), (1.9, 1.9, 0.3), lens=35.0),
    "from above": camera_at((1.0, 0.9, 1.9), (1.0, 0.9, 0.0), lens=35.0),
    "mirrored": camera_at((0.1, -3.0, 1.0), (3.0, 1.0, 1.0), lens=35.0),
    "close-up": looking_down_y(lens=80.0),
    "another kind": looking_down_y(kind=ORTHOGRAPHIC, ortho_scale=0.7),
}


@pytest.mark.parametrize("name", CUTS)
def test_a_camera_that_jumps_takes_nothing_over(sequence: PictureSequence, name: str) -> None:
    """Though it stays in the room, so that many of the places have been seen before."""
    for _ in range(5):
        sequence.picture(box_room(), constant(7.0))
    values = noise(1)
    picture = sequence.picture(box_room(), given(values), camera=CUTS[name])
    assert picture.shown.mean() > 0.3
    np.testing.assert_array_equal(picture.mean[picture.shown], values.astype(np.float32)[picture.shown])
    assert (picture.age[picture.shown] == 1.0).all()


def test_another_key_takes_nothing_over(sequence: PictureSequence) -> None:
    sequence.picture(box_room(), constant(7.0))
    picture = sequence.picture(box_room(), constant(1.0), key="other")
    assert (picture.mean[picture.shown][:, 0] == 1.0).all()


@pytest.mark.parametrize(
    "values", [{}, {"kind": ORTHOGRAPHIC, "ortho_scale": 3.0}], ids=["perspective", "orthographic"]
)
@pytest.mark.parametrize("place", [(1.15, -3.0, 1.05), (1.0, -2.7, 1.0), (0.8, -3.3, 1.1)])
def test_a_camera_that_moves_on_is_no_cut(
    sequence: PictureSequence, place: tuple[float, float, float], values: dict[str, object]
) -> None:
    """The second picture finds nothing, so that all it shows is half of what the first one found at the same places."""
    first = sequence.picture(box_room(), smooth, camera=looking_down_y(**values))
    steps = np.linalg.norm(np.diff(first.places, axis=1), axis=2)[first.shown[:, 1:] & first.shown[:, :-1]]
    picture = sequence.picture(box_room(), constant(0.0), camera=looking_down_y(place, **values))
    known = picture.age == 2.0
    assert known.sum() > 0.8 * picture.shown.sum()
    error = np.abs(2.0 * picture.mean[..., :3] - smooth(picture.places, picture.faces))[known]
    assert np.percentile(error, 99) < 0.5 * np.percentile(steps, 95)
    assert error.mean() < 0.01


def test_what_is_seen_of_a_moving_object_moves_with_it(sequence: PictureSequence) -> None:
    """A pattern on a card that turns and slides: the second picture finds nothing and shows half of the pattern where
    the card is now. Without motion the card has no history or the wall's."""

    def pattern(places: Float64, faces: np.ndarray) -> Float64:
        on_card = faces >= WALL_FACES
        return np.where(on_card, 2.0 + np.sin(9.0 * places[..., 0]) * np.cos(7.0 * places[..., 2]), 0.5)

    start = card(0.5, 0.0, 0.9)
    middle = start.positions.mean(axis=0)
    c, s = np.cos(0.35), np.sin(0.35)
    turn = np.array(
        [
            [c, -0.6 * s, 0.8 * s],
            [0.6 * s, 0.36 * c + 0.64, 0.48 * (1 - c)],
            [-0.8 * s, 0.48 * (1 - c), 0.64 * c + 0.36],
        ]
    )
    shift = np.array([0.2, 0.05, -0.1])
    turned = moved(start, (start.positions - middle) @ turn.T + middle + shift)
    sequence.picture(before_wall(start), pattern, clamp=0.0)
    picture = sequence.picture(before_wall(turned), constant(0.0), clamp=0.0)
    on_card = picture.faces >= WALL_FACES
    known = on_card & (picture.age == 2.0)
    assert known.sum() > 0.9 * on_card.sum() > 100
    came_from = (picture.places - middle - shift) @ turn + middle
    error = np.abs(2.0 * picture.mean[..., 0] - pattern(came_from, picture.faces))[known]
    # Between pixels of 0.06 m the pattern bends by 0.04.
    assert error.mean() < 0.03
    uncovered = inside(picture.faces, picture.shown) & ~on_card & (picture.age == 1.0)
    assert uncovered.sum() > 10
    assert not picture.mean[uncovered][:, 0].any()


@pytest.mark.parametrize("kind", ["even", "coarse"])
def test_what_has_gone_leaves_no_ghost(sequence: PictureSequence, kind: str) -> None:
    """A card before the wall darkens it and jumps aside. Of the step that this is on the wall, noise of a third of it
    may hide a tenth for four pictures and a twentieth for ten; noise of coin tosses, a sixth and a tenth."""
    random = np.random.default_rng(0)
    leftover = []
    for index in range(20):
        x = 0.5 if index < 8 else 1.2

        def found(places: Float64, faces: np.ndarray, x: float = x) -> Float64:
            dark = np.abs(places[..., 0] - x - 0.2) < 0.4
            light = np.where(dark, 0.2, 0.8)
            toss = random.random(faces.shape)
            return light + 0.35 * (2.0 * toss - 1.0) if kind == "even" else 1.0 * (toss < light)

        picture = sequence.picture(before_wall(card(x)), found)
        gone = (picture.faces < WALL_FACES) & (np.abs(picture.places[..., 0] - 0.6) < 0.2)
        assert gone.sum() > 60
        leftover.append((0.8 - picture.mean[..., 0][gone].mean()) / 0.6)
    assert leftover[7] > 0.95
    four, ten = leftover[11], np.abs(leftover[17:])
    assert four < (0.1 if kind == "even" else 1.0 / 6.0)
    assert ten.max() < (0.05 if kind == "even" else 0.1)


def test_nothing_is_held_to_its_neighbours_where_nothing_changes(sequence: PictureSequence) -> None:
    """One bright picture in all: a mean that knows no changes keeps its share of it, one that does drops it."""
    for key, share in (("", 1.0 / 6.0), ("other", 0.0)):
        for index in range(6):
            scene_key = key if index == 1 else ""
            picture = sequence.picture(box_room(), constant(6.0 if index == 0 else 0.0), scene_key=scene_key, key=key)
        np.testing.assert_allclose(picture.mean[inside(picture.faces, picture.shown)][:, 0], 6.0 * share, atol=1e-5)


def test_rare_events_still_count_where_something_changes(sequence: PictureSequence) -> None:
    """Most neighbourhoods see none of them in a picture: if these decided alone, there would never have been any."""
    chance, means = 0.02, []
    for index in range(30):
        values = 10.0 * (noise(index)[..., 0] < chance)
        picture = sequence.picture(box_room(), given(values), scene_key=str(index))
        means.append(picture.mean[..., 0][picture.shown].mean())
    # Of neighbourhoods alone comes 15 % of it.
    assert abs(np.mean(means[10:]) / (10.0 * chance) - 1.0) < 0.1


def test_changes_limit_the_history_and_it_grows_again(sequence: PictureSequence) -> None:
    ages = []
    for index in range(24):
        picture = sequence.picture(box_room(), scene_key="" if index < 12 else "moved", changing_history=5)
        ages.append(np.median(picture.age[picture.shown]))
    assert ages[11] == 12.0
    assert ages[12:17] == [6.0] * 5
    assert ages[17:20] == [7.0, 8.0, 9.0]


@pytest.mark.parametrize("follows_eye", [False, True])
def test_what_follows_the_eye_changes_with_it(sequence: PictureSequence, follows_eye: bool) -> None:
    """Jitter is no move. Seen from the side, a place has no history of what follows the eye."""
    for index in range(12):
        jitter = tuple(jitter_offsets(12)[index])
        sequence.picture(box_room(), follows_eye=follows_eye, jitter=jitter)
    rested = sequence.picture(box_room(), follows_eye=follows_eye)
    assert np.median(rested.age[rested.shown]) == 13.0
    went = sequence.picture(box_room(), follows_eye=follows_eye, camera=looking_down_y((1.1, -3.0, 1.0)))
    assert np.median(went.age[went.shown]) == (9.0 if follows_eye else 14.0)
    aside = camera_at((2.6, -2.6, 1.0), (1.1, 1.4, 1.0), lens=35.0)
    far = sequence.picture(box_room(), follows_eye=follows_eye, camera=aside, cut_share=0.0)
    assert (far.age[far.shown] > 1.0).mean() > 0.6 or follows_eye
    assert (far.age[far.shown] == 1.0).all() or not follows_eye


@pytest.mark.parametrize(("roughness", "age"), [(0.0, 1.0), (0.05, 1.0), (0.175, 5.0), (0.3, 9.0), (1.0, 9.0)])
def test_mirrors_have_no_noise_and_are_not_averaged_while_they_change(
    sequence: PictureSequence, roughness: float, age: float
) -> None:
    """Once nothing changes, they are, as all else."""
    materials = tuple(replace(material, roughness=roughness) for material in box_room().materials)
    room = replace(box_room(), materials=materials)
    for _ in range(12):
        rested = sequence.picture(room, constant(1.0), follows_eye=True)
    assert np.median(rested.age[rested.shown]) == 12.0
    for index in range(9):
        changing = sequence.picture(room, constant(1.0), follows_eye=True, scene_key=str(index))
    assert np.median(changing.age[changing.shown]) == pytest.approx(age, abs=1e-4)


def test_an_owner_that_missed_a_move_begins_anew(sequence: PictureSequence) -> None:
    """Motion leads to the picture before, not to the one that the owner saw last. Pictures in which nothing moved may
    be missed."""
    for x, age in ((0.3, 1.0), (0.3, 3.0), (0.5, 1.0)):
        sequence.picture(before_wall(card(x)), owner="other")
        picture = sequence.picture(before_wall(card(x)))
        assert np.median(picture.age[picture.shown]) == (1.0 if age == 1.0 else 2.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38, -5.0])
def test_what_is_no_value_is_never_shown(sequence: PictureSequence, value: float) -> None:
    broken = noise(3)[..., 0] < 0.3

    def found(places: Float64, faces: np.ndarray) -> Float64:
        return np.where(broken, value, 2.0)

    for scene_key in ("", "", "changed", "changed"):
        picture = sequence.picture(box_room(), found, scene_key=scene_key)
        assert np.isfinite(picture.mean).all()
        assert (picture.mean >= 0.0).all()
        sound = picture.shown & ~broken
        if value != -5.0:
            np.testing.assert_allclose(picture.mean[sound][:, 0], 2.0, rtol=1e-6)
    # Found again where it was broken.
    picture = sequence.picture(box_room(), constant(2.0), scene_key="changed")
    if value != -5.0:
        np.testing.assert_allclose(picture.mean[picture.shown][:, 0], 2.0, rtol=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e30])
def test_surfaces_that_are_nowhere_give_numbers(sequence: PictureSequence, value: float) -> None:
    """Places and normals that are no numbers, in one of four pixels; a mesh that moves, and changes all the while."""

    def broken(image: Float32) -> Float32:
        return np.where(np.random.default_rng(1).random((HEIGHT, WIDTH, 1)) < 0.25, np.float32(value), image)

    for index in range(5):
        scene = before_wall(card(0.3 + 0.05 * index))
        surfaces = broken if index in (1, 2, 4) else None
        values = noise(index)
        picture = sequence.picture(scene, given(values), surfaces=surfaces, follows_eye=True)
        assert np.isfinite(picture.mean).all()
        assert (picture.mean >= 0.0).all()
        assert picture.mean.max() <= 1.0 + 1e-6


def test_owners_and_sizes_have_histories_of_their_own(device: Device) -> None:
    sequence = PictureSequence(device)
    sequence.picture(box_room(), constant(5.0), owner="one")
    other = sequence.picture(box_room(), constant(1.0), owner="two")
    assert (other.mean[other.shown][:, 0] == 1.0).all()
    larger = PictureSequence(device, (WIDTH + 8, HEIGHT))
    larger.kept = sequence.kept
    resized = larger.picture(box_room(), constant(2.0), owner="one")
    assert (resized.mean[resized.shown][:, 0] == 2.0).all()


def test_without_motion_surfaces_are_taken_to_stand_still(sequence: PictureSequence) -> None:
    """For what belongs to places."""
    sequence.picture(before_wall(), smooth, with_motion=False)
    slid = replace(wall(), positions=wall().positions + np.array([0.7, 0.0, 0.0]))
    scene = replace(before_wall(), meshes=(slid,))
    picture = sequence.picture(scene, constant(0.0), with_motion=False)
    np.testing.assert_allclose(2.0 * picture.mean[..., :3], smooth(picture.places, picture.faces), rtol=1e-3)
