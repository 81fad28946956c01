# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of light grids: everything comes back, and nothing but a whole file is read."""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.light_meshes import random_lights
from vlm_addon.core import light_grid_file
from vlm_addon.core.array_codec import content_hash, flatten
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_grid import RANGE, GridSettings, LightGrid
from vlm_addon.core.light_grid_error import grid_error
from vlm_addon.core.light_grid_file import MAGIC, VERSION, WITH_VISIBILITY, load_light_grid, save_light_grid
from vlm_addon.core.surface_points import SurfacePoints

HEADER = struct.Struct("<8sIQ32s")
BOX = ((-2.0, -2.0, -1.0), (2.0, 3.0, 1.0))
SETTINGS = {"range": GridSettings(3, 2.0, 4, RANGE), "tolerance": GridSettings(tolerance=0.3)}
LIGHTS = replace(random_lights(0, 12), dynamic=np.arange(12) < 5)
POINTS = SurfacePoints(
    np.random.default_rng(0).uniform(*BOX, (20, 3)), np.tile([0.0, 0.0, 1.0], (20, 1)), np.zeros(20, np.int32)
)


@pytest.fixture(scope="module", params=SETTINGS)
def grid(request):
    return LightGrid.bake(LIGHTS, BOX, SETTINGS[request.param])


@pytest.fixture(scope="module")
def whole(grid, tmp_path_factory):
    path = tmp_path_factory.mktemp("grids") / "whole.vlmgrid"
    save_light_grid(grid, path)
    return path.read_bytes()


def refused(path, data):
    path.write_bytes(data)
    with pytest.raises(InvalidInput) as caught:
        load_light_grid(path, LIGHTS)
    assert caught.value.subject == str(path)
    assert caught.value.problem
    assert caught.value.remedy
    return caught.value.problem


def test_everything_comes_back(grid, tmp_path):
    save_light_grid(grid, tmp_path / "a.vlmgrid")
    loaded = load_light_grid(tmp_path / "a.vlmgrid", LIGHTS)
    assert content_hash(loaded) == content_hash(grid)
    assert type(loaded.static) is type(grid.static)
    assert type(loaded.dynamic) is type(grid.dynamic)
    assert loaded.settings == grid.settings
    assert loaded.nbytes == grid.nbytes
    assert loaded.occupancy == grid.occupancy
    points = np.random.default_rng(0).uniform(-3.0, 3.0, (50, 3))
    assert content_hash(loaded.candidates(points)) == content_hash(grid.candidates(points))


def test_structures_that_are_none_come_back(tmp_path):
    still = replace(LIGHTS, dynamic=np.zeros(12, bool))
    grid = LightGrid.bake(still, BOX, SETTINGS["range"])
    save_light_grid(grid, tmp_path / "a.vlmgrid")
    loaded = load_light_grid(tmp_path / "a.vlmgrid", still)
    assert loaded.dynamic is None
    assert content_hash(loaded) == content_hash(grid)


def test_files_of_other_lights_are_refused(grid, whole, tmp_path):
    path = tmp_path / "a.vlmgrid"
    path.write_bytes(whole)
    for other in (random_lights(1, 12), replace(LIGHTS, dynamic=~LIGHTS.dynamic)):
        with pytest.raises(InvalidInput, match="12 other lights") as caught:
            load_light_grid(path, other)
        assert caught.value.subject == str(path)


def test_the_layout_is_that_of_the_version():
    """Whoever changes a class that is written raises VERSION and states the new layout here."""
    grids = [LightGrid.bake(LIGHTS, BOX, settings) for settings in SETTINGS.values()]
    layout = sorted({name for grid in grids for name in leaves(flatten(grid)[0])})
    assert (VERSION, hashlib.sha256(" ".join(layout).encode()).hexdigest()[:16]) == (3, "4593c2a8fb12806b")


def leaves(tree, path=""):
    """Dotted names of all fields."""
    if not isinstance(tree, dict) or "$array" in tree:
        return [path]
    return [name for key, value in tree.items() for name in leaves(value, f"{path}.{key}")]


def forged(whole, change):
    """The file with a body that `change` makes of what it says and of its bytes, and a checksum that fits."""
    body = whole[HEADER.size :]
    start = 8 + int.from_bytes(body[:8], "little")
    return with_body(change(json.loads(body[8:start]), body[start:]))


def said(described, arrays):
    """A body."""
    text = json.dumps(described).encode()
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text + arrays


def with_body(body):
    digest = hashlib.sha256(MAGIC + VERSION.to_bytes(4, "little") + body).digest()
    return HEADER.pack(MAGIC, VERSION, len(body), digest) + body


def owner_of(tree, name):
    """The dict that holds the field of a dotted name, and its last word."""
    *owners, last = name.split(".")[1:]
    for owner in owners:
        tree = tree[owner]
    return tree, last


def names_within(tree, path=""):
    """Dotted names of all fields, those that hold fields as well."""
    if not isinstance(tree, dict) or "$array" in tree:
        return []
    return [name for key, value in tree.items() for name in (f"{path}.{key}", *names_within(value, f"{path}.{key}"))]


def said_by(whole):
    return json.loads(whole[HEADER.size + 8 :][: int.from_bytes(whole[HEADER.size :][:8], "little")])


def test_a_forged_body_that_says_the_same_is_read(grid, whole, tmp_path):
    """Else the tests below would see a refusal for another reason."""
    path = tmp_path / "same.vlmgrid"
    path.write_bytes(forged(whole, said))
    assert content_hash(load_light_grid(path, LIGHTS)) == content_hash(grid)


def test_forged_files_with_missing_or_extra_fields_are_refused(whole, tmp_path):
    for name in names_within(said_by(whole)["tree"]):
        for edit in (lambda owner, last: owner.pop(last), lambda owner, last: owner.update({f"{last}_too": 1})):

            def change(described, arrays, name=name, edit=edit):
                edit(*owner_of(described["tree"], name))
                return said(described, arrays)

            refused(tmp_path / "forged.vlmgrid", forged(whole, change))


@pytest.mark.parametrize("value", [None, "x", -1, 2.5, [], {}])
def test_forged_files_with_values_of_another_kind_are_refused(whole, tmp_path, value):
    tree = said_by(whole)["tree"]
    for name in names_within(tree):
        owner, last = owner_of(tree, name)
        if isinstance(owner[last], int | float) and isinstance(value, int | float):
            continue

        def change(described, arrays, name=name):
            owner, last = owner_of(described["tree"], name)
            owner[last] = value
            return said(described, arrays)

        refused(tmp_path / "forged.vlmgrid", forged(whole, change))


@pytest.mark.parametrize(
    "edit",
    [
        lambda entry: entry.update(shape=[1, *entry["shape"]]),
        lambda entry: entry.update(shape=[entry["shape"][0] - 1, *entry["shape"][1:]]),
        lambda entry: entry.update(dtype="<i2" if entry["dtype"] == "<f4" else "<f4"),
        lambda entry: entry.update(dtype="O"),
    ],
    ids=["more axes", "fewer rows", "other type", "objects"],
)
def test_forged_files_with_arrays_of_another_shape_are_refused(whole, tmp_path, edit):
    for index, entry in enumerate(said_by(whole)["arrays"]):
        if 0 in entry["shape"]:
            continue

        def change(described, arrays, index=index):
            edit(described["arrays"][index])
            return said(described, arrays)

        refused(tmp_path / "forged.vlmgrid", forged(whole, change))


@pytest.mark.parametrize(
    "body", [b"", b"short", bytes(8), b"\xff" * 64, said([], b""), said({}, b""), said({"tree": 1, "arrays": []}, b"")]
)
def test_forged_files_that_say_something_else_are_refused(tmp_path, body):
    refused(tmp_path / "forged.vlmgrid", with_body(body))


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_forged_indices_are_refused_or_do_no_harm(whole, tmp_path, data):
    """Whatever stands in the arrays of whole numbers: a grid that is read can be asked and measured."""
    entries = said_by(whole)["arrays"]
    index = data.draw(
        st.sampled_from([i for i, e in enumerate(entries) if e["dtype"][1] in "iu" and 0 not in e["shape"]])
    )
    sizes = [int(np.prod(e["shape"])) * np.dtype(e["dtype"]).itemsize for e in entries]
    start = sum(size + -size % 8 for size in sizes[:index])
    dtype = np.dtype(entries[index]["dtype"])
    place = start + dtype.itemsize * data.draw(st.integers(0, sizes[index] // dtype.itemsize - 1))
    limits = np.iinfo(dtype)
    value = data.draw(st.integers(max(limits.min, -3), 20) | st.integers(limits.min, limits.max))

    def change(described, arrays):
        return said(described, arrays[:place] + np.array([value], dtype).tobytes() + arrays[place + dtype.itemsize :])

    path = tmp_path / "forged.vlmgrid"
    path.write_bytes(forged(whole, change))
    try:
        grid = load_light_grid(path, LIGHTS)
    except InvalidInput:
        return
    found = grid.candidates(POINTS.positions)
    assert len(found.light_offsets) == len(POINTS.positions) + 1
    assert (found.light_ids < 12).all()
    assert grid_error(grid, LIGHTS, np.ones((12, 3)), POINTS).full.any()
    assert grid.occupancy


def test_the_same_grid_gives_the_same_bytes(grid, whole, tmp_path):
    save_light_grid(grid, tmp_path / "a.vlmgrid")
    assert (tmp_path / "a.vlmgrid").read_bytes() == whole


def test_every_truncation_is_refused(whole, tmp_path):
    for length in (*range(256), *range(256, len(whole), 61), len(whole) - 1):
        refused(tmp_path / "cut.vlmgrid", whole[:length])


def test_every_flipped_bit_of_the_header_is_refused(whole, tmp_path):
    for bit in range(8 * 60):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        refused(tmp_path / "flipped.vlmgrid", bytes(data))


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_flipped_bits_and_changed_lengths_are_refused(whole, tmp_path, data):
    changed = bytearray(whole)
    for bit in data.draw(st.sets(st.integers(0, 8 * len(whole) - 1), min_size=1, max_size=4)):
        changed[bit // 8] ^= 1 << bit % 8
    refused(tmp_path / "flipped.vlmgrid", bytes(changed))
    extra = data.draw(st.binary(min_size=1, max_size=20))
    refused(tmp_path / "longer.vlmgrid", whole + extra)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200).filter(lambda data: not data.startswith(MAGIC)))
def test_foreign_files_are_refused(tmp_path, data):
    assert "not a light grid" in refused(tmp_path / "foreign.vlmgrid", data)


def test_other_versions_say_so(whole, tmp_path):
    newer = whole[:8] + (WITH_VISIBILITY + 1).to_bytes(4, "little") + whole[12:]
    assert f"version {WITH_VISIBILITY + 1}" in refused(tmp_path / "newer.vlmgrid", newer)


def test_missing_files_and_folders_are_refused(grid, tmp_path):
    for path in (tmp_path / "none.vlmgrid", tmp_path):
        with pytest.raises(InvalidInput, match="cannot be read"):
            load_light_grid(path, LIGHTS)
    for path in (tmp_path / "none" / "a.vlmgrid", tmp_path):
        with pytest.raises(InvalidInput, match="cannot be written"):
            save_light_grid(grid, path)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(grid, whole, tmp_path, monkeypatch):
    path = tmp_path / "a.vlmgrid"
    path.write_bytes(whole)

    def fail(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(light_grid_file.os, "fsync", fail)
    with pytest.raises(InvalidInput, match="No space left"):
        save_light_grid(grid, path)
    assert path.read_bytes() == whole
    assert [item.name for item in tmp_path.iterdir()] == ["a.vlmgrid"]
