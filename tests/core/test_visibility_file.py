# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked visibility beside a light grid in its file."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.core.visible_room import block_room, host_bake, surface_lights
from vlm_addon.core.array_codec import content_hash, flatten
from vlm_addon.core.baked_visibility import BakedVisibility, bake_hash
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_grid import GridSettings, LightGrid
from vlm_addon.core.light_grid_file import (
    MAGIC,
    VERSION,
    WITH_VISIBILITY,
    load_baked_visibility,
    load_light_grid,
    save_light_grid,
)

ROOM = block_room()
LIGHTS = surface_lights(ROOM, 0)


@pytest.fixture(scope="module")
def grid() -> LightGrid:
    return LightGrid.bake(LIGHTS, ROOM.bounds(), GridSettings(tolerance=0.3))


@pytest.fixture(scope="module")
def baked() -> BakedVisibility:
    return replace(host_bake(ROOM, LIGHTS), made_of=bake_hash(ROOM, LIGHTS, 4, 4))


@pytest.fixture
def path(grid: LightGrid, baked: BakedVisibility, tmp_path: Path) -> Path:
    save_light_grid(grid, tmp_path / "both.vlmgrid", baked)
    return tmp_path / "both.vlmgrid"


def test_both_come_back(path: Path, grid: LightGrid, baked: BakedVisibility) -> None:
    loaded = load_baked_visibility(path, LIGHTS)
    assert loaded is not None
    assert content_hash(loaded) == content_hash(baked)
    assert content_hash(load_light_grid(path, LIGHTS)) == content_hash(grid)
    loaded.require_made_of(ROOM, LIGHTS)
    points, up = np.array([[0.5, 0.5, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    assert (loaded.at(points, up) == baked.at(points, up)).all()


def test_a_file_of_a_grid_alone_holds_none_and_is_of_the_version_before(grid: LightGrid, tmp_path: Path) -> None:
    save_light_grid(grid, tmp_path / "grid.vlmgrid")
    assert (tmp_path / "grid.vlmgrid").read_bytes()[8:12] == VERSION.to_bytes(4, "little")
    assert load_baked_visibility(tmp_path / "grid.vlmgrid", LIGHTS) is None


def test_what_has_moved_is_said(path: Path) -> None:
    loaded = load_baked_visibility(path, LIGHTS)
    assert loaded is not None
    moved = replace(ROOM, meshes=tuple(replace(mesh, positions=mesh.positions * 1.1) for mesh in ROOM.meshes))
    with pytest.raises(InvalidInput, match="other surfaces"):
        loaded.require_made_of(moved, LIGHTS)


@pytest.mark.parametrize("at", [20, 60, 300, -1000, -3])
def test_a_damaged_file_is_refused(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 0x10
    path.write_bytes(bytes(data))
    with pytest.raises(InvalidInput, match=r"damaged|bytes"):
        load_baked_visibility(path, LIGHTS)


def test_a_file_that_is_cut_short_is_refused(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InvalidInput, match="bytes"):
        load_baked_visibility(path, LIGHTS)


def test_visibility_that_does_not_fit_the_lights_is_refused(
    grid: LightGrid, baked: BakedVisibility, tmp_path: Path
) -> None:
    wrong = replace(baked, shares=baked.shares[:, 1:])
    save_light_grid(grid, tmp_path / "wrong.vlmgrid", wrong)
    with pytest.raises(InvalidInput, match="shares do not fit") as caught:
        load_light_grid(tmp_path / "wrong.vlmgrid", LIGHTS)
    assert caught.value.subject == str(tmp_path / "wrong.vlmgrid")


def test_a_field_too_few_or_of_another_type_is_refused(path: Path) -> None:
    data = path.read_bytes()
    for old, new in ((b'"points"', b'"pounds"'), (b'"points": 4', b'"points": "')):
        body = data[52:].replace(old, new, 1)
        digest = hashlib.sha256(MAGIC + WITH_VISIBILITY.to_bytes(4, "little") + body).digest()
        path.write_bytes(data[:20] + digest + body)
        with pytest.raises(InvalidInput):
            load_baked_visibility(path, LIGHTS)


def test_the_layout_is_that_of_the_version(baked: BakedVisibility) -> None:
    """Whoever changes a class that is written raises WITH_VISIBILITY and states the new layout here."""

    def leaves(tree: object, name: str = "") -> list[str]:
        if not isinstance(tree, dict) or "$array" in tree:
            return [name]
        return [leaf for key, value in tree.items() for leaf in leaves(value, f"{name}.{key}")]

    names = sorted(leaves(flatten(baked)[0]))
    assert (WITH_VISIBILITY, names) == (
        4,
        [
            *(".cells.component", ".cells.component_count", ".cells.first_zone", ".cells.label_start", ".cells.labels"),
            *(".cells.per_axis", ".frame.depth", ".frame.low", ".frame.voxel_size"),
            *(".lists.entries", ".lists.offsets", ".made_of", ".points", ".shares", ".ways"),
        ],
    )
