# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairing leaves out the pairs and nothing else that was lit, whatever ids artists gave before."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vlm_addon.core import exact_tags
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.exact_tags import Tags, only_received, pair_exactly
from vlm_addon.core.light_links import leaves_out, make_links, no_links
from vlm_addon.core.tag_pairs import FIRST_AUTOMATIC, is_automatic

LIGHTS, FACES = 6, 5
A = FIRST_AUTOMATIC
FIRST = A + 100
"""The first id that no strategy gives."""
PAIRS = st.lists(st.tuples(st.integers(0, LIGHTS - 1), st.integers(0, FACES - 1)), min_size=1, max_size=25)
LIGHT_TAGS = st.lists(st.sampled_from([0, 7, 8, 9, A, A + 1]), min_size=LIGHTS, max_size=LIGHTS)
FACE_TAGS = st.lists(st.sampled_from([0, 7, 8, 30, A, A + 1, A + 2]), min_size=FACES, max_size=FACES)
IDS = st.sampled_from([7, 8, 9, 30, A, A + 1, A + 2])
LINKS = st.lists(st.tuples(IDS, IDS), max_size=6)


def int32(values):
    return np.array(values, np.int32)


def left_out(light_tags, face_tags, links):
    """Every (light, face) of which the face leaves out the light, one by one."""
    allowed = {tuple(link) for link in links.tolist()}
    return {
        (row, face)
        for row, light in enumerate(int32(light_tags).tolist())
        for face, tag in enumerate(int32(face_tags).tolist())
        if (tag != 0 and light == tag) or (light, tag) in allowed
    }


def with_common_ids(pairs, light_tags, face_tags, links):
    """Lights that have no id and whose faces all carry one that an artist gave, and not for being left out, have it."""
    received = {receiver for _, receiver in links.tolist()} - set(light_tags)
    found = list(light_tags)
    for light in range(LIGHTS):
        ids = {face_tags[face] for row, face in pairs if row == light}
        if not light_tags[light] and len(ids) == 1 and 0 < min(ids) < FIRST_AUTOMATIC and not ids & received:
            found[light] = min(ids)
    return found


def made(pairs, light_tags, face_tags, links, paired=None, groups=None):
    known = Tags(int32(light_tags), int32(face_tags), links, no_links() if paired is None else paired)
    return pair_exactly(*np.array(pairs).T, known, FIRST, groups)


@given(PAIRS, LIGHT_TAGS, FACE_TAGS, LINKS)
def test_the_pairs_and_what_was_left_out_before_are_left_out_and_nothing_else(pairs, light_tags, face_tags, links):
    links = make_links(np.array(links, np.int64).reshape(-1, 2))
    before = left_out(with_common_ids(pairs, light_tags, face_tags, links), face_tags, links)
    found = made(pairs, light_tags, face_tags, links)
    assert left_out(found.light_tags, found.face_tags, found.links) == before | set(pairs)


@given(PAIRS, LIGHT_TAGS, FACE_TAGS, LINKS)
def test_without_the_links_of_the_artist_the_pairs_and_the_ids_of_before_stay(pairs, light_tags, face_tags, links):
    """Which links pairing has made can be told from those that it has only handed on."""
    links = make_links(np.array(links, np.int64).reshape(-1, 2))
    common = with_common_ids(pairs, light_tags, face_tags, links)
    added = set(pairs) - left_out(common, face_tags, links)
    found = made(pairs, light_tags, face_tags, links)
    assert {tuple(link) for link in found.paired.tolist()} <= {tuple(link) for link in found.links.tolist()}
    kept = left_out(found.light_tags, found.face_tags, found.paired)
    assert kept == left_out(common, face_tags, no_links()) | added


@given(PAIRS, PAIRS, LIGHT_TAGS, FACE_TAGS, LINKS)
@example([(0, 1)], [(0, 0), (1, 1)], LIGHTS * [0], FACES * [0], [])
def test_pairing_again_adds_nothing_and_pairing_more_just_that(pairs, more, light_tags, face_tags, links):
    links = make_links(np.array(links, np.int64).reshape(-1, 2))
    once = made(pairs, light_tags, face_tags, links)
    again = pair_exactly(*np.array(pairs).T, once, 2 * FIRST)
    for name in ("light_tags", "face_tags", "links", "paired"):
        assert np.array_equal(getattr(again, name), getattr(once, name)), name
    tags = once.light_tags.tolist(), once.face_tags.tolist()
    before = left_out(with_common_ids(more, *tags, once.links), tags[1], once.links)
    both = pair_exactly(*np.array(more).T, once, 2 * FIRST)
    assert left_out(both.light_tags, both.face_tags, both.links) == before | set(more)


def test_a_light_without_an_id_takes_the_one_that_an_artist_gave_to_all_its_faces():
    found = made([(0, 0), (0, 1)], [0] * LIGHTS, [9, 9, 9, 0, 0], no_links())
    assert found.light_tags.tolist() == [9, 0, 0, 0, 0, 0]
    assert not len(found.links)


def test_but_not_one_by_which_the_faces_are_left_out():
    """Leaving out an object gives it an id; its own lights go on lighting its other faces."""
    found = made([(0, 0)], [0, 5, 0, 0, 0, 0], [9, 9, 9, 0, 0], make_links([[5, 9]]))
    out = left_out(found.light_tags, found.face_tags, found.links)
    assert out == {(0, 0), (1, 0), (1, 1), (1, 2)}
    assert only_received(make_links([[5, 9], [5, 6]]), [5, 6]).tolist() == [9]


def test_ids_that_others_carry_count_as_shared():
    """The only light of an id here, where another light mesh has more of it, and a face likewise."""
    known = Tags(int32([A]), int32([A + 1, 0]), elsewhere_lights=int32([A]), elsewhere_faces=int32([A + 1]))
    found = pair_exactly([0, 0], [0, 1], known, FIRST)
    assert found.light_tags.tolist() == [FIRST]
    # Lights elsewhere of the face's id are left out still, and the light where its id was.
    assert {(A + 1, found.face_tags[0]), (FIRST, A)} <= {tuple(link) for link in found.links.tolist()}
    assert not {(A, int(tag)) for tag in found.face_tags} & {tuple(link) for link in found.links.tolist()}


def test_pairing_links_no_ids_of_lights_that_artists_gave():
    found = made([(0, 0), (1, 0)], [7, 8, 0, 0, 0, 0], [30, 0, 0, 0, 0], no_links())
    own = found.links[~np.isin(found.links[:, 1], (7, 8))]
    assert is_automatic(own[:, 0]).all()
    assert found.face_tags[0] == 30, "nothing else carries it"


def test_too_many_links_are_avoided_by_sharing_ids_within_a_group_and_no_pair_is_lost(monkeypatch):
    pairs = [(light, face) for face in range(FACES) for light in (face, face + 1)]
    tags = [0] * LIGHTS, [0] * FACES
    exact = made(pairs, *tags, no_links())
    assert len(exact.links) == 10
    for most, groups in ((9, [0, 0, 0, 0, 0]), (7, [0, 0, 0, 1, 1])):
        monkeypatch.setattr(exact_tags, "MOST_LINKS", most)
        shared = made(pairs, *tags, no_links(), groups=groups)
        assert len(shared.links) <= most
        out = left_out(shared.light_tags, shared.face_tags, shared.links)
        assert set(pairs) <= out
        for light, face in out:
            assert any(groups[other] == groups[face] for row, other in pairs if row == light)
    monkeypatch.setattr(exact_tags, "MOST_LINKS", 9)
    with pytest.raises(InvalidInput, match="more than 9 links"):
        made(pairs, *tags, no_links())


def test_too_many_links_of_shared_ids_are_refused(monkeypatch):
    monkeypatch.setattr(exact_tags, "MOST_LINKS", 5)
    with pytest.raises(InvalidInput, match="2 lights of shared ids"):
        made([(0, 0), (1, 1)], [7, 7, 0, 0, 0, 0], [0] * FACES, make_links([[7, 30], [7, 31]]))


def test_many_lights_of_one_id_keep_their_meaning():
    """A floor of 3,000 lights and faces, left out on another object: each face leaves out its own light besides."""
    count = 3000
    rows = np.arange(count)
    light_tags, face_tags = np.full(count, 7, np.int32), np.append(np.zeros(count, np.int32), np.int32(8))
    known = Tags(light_tags, face_tags, make_links([[7, 8]]))
    found = pair_exactly(rows, rows, known, FIRST)
    out = leaves_out(found.links, found.light_tags[:, None], found.face_tags[None])
    assert out[:, -1].all()
    assert np.array_equal(out[:, :-1], np.eye(count, dtype=bool))
