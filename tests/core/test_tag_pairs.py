# SPDX-License-Identifier: GPL-3.0-or-later
"""Tags that are added for pairs of lights and faces leave out these, keep what is there and little else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vlm_addon.core import tag_pairs
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_links import leaves_out, no_links
from vlm_addon.core.tag_pairs import TagUse, add_tags, related, unpaired

LIGHTS, FACES, FIRST = 6, 5, 50
PAIRS = st.lists(st.tuples(st.integers(0, LIGHTS - 1), st.integers(0, FACES - 1)), min_size=1, max_size=25)
LIGHT_TAGS = st.lists(st.sampled_from([0, 0, 7, 8, 9]), min_size=LIGHTS, max_size=LIGHTS)
FACE_TAGS = st.lists(st.sampled_from([0, 0, 7, 8, 30]), min_size=FACES, max_size=FACES)
NONE = np.zeros(LIGHTS, np.int32), np.zeros(FACES, np.int32)


def left_out(light_tags, face_tags, links):
    """Every (light, face) of which the face leaves out the light."""
    lights, faces = (each.ravel() for each in np.meshgrid(range(LIGHTS), range(FACES)))
    light_tags, face_tags = np.array(light_tags, np.int32), np.array(face_tags, np.int32)
    out = leaves_out(links, light_tags[lights], face_tags[faces])
    return set(zip(lights[out].tolist(), faces[out].tolist(), strict=True))


@given(PAIRS)
def test_without_tags_before_the_pairs_and_nothing_else_are_left_out(pairs):
    lights, faces = np.array(pairs).T
    found = add_tags(lights, faces, *NONE, no_links(), FIRST)
    assert left_out(found.light_tags, found.face_tags, found.links) == set(pairs)


@given(PAIRS, LIGHT_TAGS, FACE_TAGS)
def test_tags_that_there_are_stay_and_what_was_left_out_still_is(pairs, light_tags, face_tags):
    lights, faces = np.array(pairs).T
    links = np.array([[7, 30]], np.int32)
    found = add_tags(lights, faces, light_tags, face_tags, links, FIRST)
    assert not unpaired(lights, faces, found.light_tags, found.face_tags, found.links).any()
    for before, after in ((light_tags, found.light_tags), (face_tags, found.face_tags)):
        assert [new for old, new in zip(before, after.tolist(), strict=True) if old] == [old for old in before if old]
    assert left_out(light_tags, face_tags, links) <= left_out(found.light_tags, found.face_tags, found.links)


@given(PAIRS, LIGHT_TAGS, FACE_TAGS)
def test_adding_again_adds_nothing(pairs, light_tags, face_tags):
    lights, faces = np.array(pairs).T
    once = add_tags(lights, faces, light_tags, face_tags, no_links(), FIRST)
    again = add_tags(lights, faces, once.light_tags, once.face_tags, once.links, 2 * FIRST)
    for name in ("light_tags", "face_tags", "links"):
        assert np.array_equal(getattr(again, name), getattr(once, name)), name


def test_what_is_in_no_pair_gets_no_tag():
    found = add_tags([2], [3], *NONE, no_links(), FIRST)
    assert found.light_tags.tolist() == [0, 0, FIRST, 0, 0, 0]
    assert found.face_tags.tolist() == [0, 0, 0, FIRST, 0]


def test_lights_take_the_id_that_an_artist_gave_all_their_faces():
    found = add_tags([0, 0, 1], [0, 1, 1], NONE[0], [9, 9, 0, 0, 0], no_links(), FIRST)
    assert found.light_tags.tolist() == [9, 9, 0, 0, 0, 0]
    assert not len(found.links)


def test_where_light_and_face_carry_different_ids_these_are_linked():
    found = add_tags([0], [0], [7, 0, 0, 0, 0, 0], [30, 0, 0, 0, 0], no_links(), FIRST)
    assert found.links.tolist() == [[7, 30]]


def test_uses_of_one_id_are_related_over_others():
    a, b, c, d = (TagUse(5, ("lights", number)) for number in range(4))
    found = related([a, b, c, d], [(a, b), (c, b)])
    assert found[a] == found[b] == found[c] != found[d]


@pytest.mark.parametrize("count", [0, 1])
def test_no_pairs_change_nothing(count):
    light_tags = np.arange(count, dtype=np.int32)
    found = add_tags([], [], light_tags, light_tags, no_links(), FIRST)
    assert found.light_tags.tolist() == found.face_tags.tolist() == light_tags.tolist()
    assert found.links.shape == (0, 2)


def test_too_many_links_are_avoided_by_sharing_tags_within_a_group_and_no_pair_is_lost(monkeypatch):
    pairs = np.array([(light, face) for face in range(FACES) for light in (face, face + 1)])
    exact = add_tags(*pairs.T, *NONE, no_links(), FIRST)
    assert len(exact.links) == 10
    for most, groups in ((9, [0, 0, 0, 0, 0]), (7, [0, 0, 0, 1, 1])):
        monkeypatch.setattr(tag_pairs, "MOST_LINKS", most)
        shared = add_tags(*pairs.T, *NONE, no_links(), FIRST, groups)
        assert len(shared.links) <= most
        assert not unpaired(*pairs.T, shared.light_tags, shared.face_tags, shared.links).any()
        # What is left out besides is of lights of the same group.
        for face in range(FACES):
            lights = {
                pair[0] for pair in left_out(shared.light_tags, shared.face_tags, shared.links) if pair[1] == face
            }
            of_group = {light for light, other in pairs.tolist() if groups[other] == groups[face]}
            assert lights <= of_group
    monkeypatch.setattr(tag_pairs, "MOST_LINKS", 9)
    with pytest.raises(InvalidInput, match="more than 9 links"):
        add_tags(*pairs.T, *NONE, no_links(), FIRST)


def test_too_many_links_between_ids_that_there_are_are_refused(monkeypatch):
    monkeypatch.setattr(tag_pairs, "MOST_LINKS", 1)
    with pytest.raises(InvalidInput, match="2 links between ids that there are"):
        add_tags([0, 1], [0, 1], [7, 8, 0, 0, 0, 0], [30, 31, 0, 0, 0], no_links(), FIRST)
