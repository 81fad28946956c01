# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists by compute shaders: bit for bit those of the processor."""

from __future__ import annotations

import numpy as np
import pytest

from tests.light_meshes import random_lights
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.array_codec import content_hash
from vlm_addon.core.block_lists import build_block_lists
from vlm_addon.core.errors import Cancelled, DeviceError
from vlm_addon.core.grid_frame import make_frame
from vlm_addon.core.light_mesh import empty_light_mesh
from vlm_addon.core.range_grid import light_shapes
from vlm_addon.render.passes import light_grid
from vlm_addon.render.passes.light_grid import LightGridPass, upload

BOX = ((-2.0, -2.0, -1.0), (2.0, 3.0, 1.0))


@pytest.fixture(scope="module")
def build(device):
    """The lists of a light mesh by the device and by the processor."""
    with device.current() as context:
        built = LightGridPass(context, device.shaders)

    def lists(lights, cells, reach, bounds=BOX):
        frame = make_frame(bounds, cells)
        half_balls = light_shapes(lights, frame, reach).half_balls
        with device.current():
            return built.build(half_balls, frame.edges).read(), build_block_lists(half_balls, frame.edges)

    return lists


def assert_same(both):
    found, expected = both
    assert np.array_equal(found.offsets, expected.offsets)
    assert np.array_equal(found.light_ids, expected.light_ids)
    assert np.array_equal(found.masks, expected.masks)
    assert content_hash(found) == content_hash(expected)
    return found


@pytest.mark.parametrize("seed", range(50))
def test_the_same_lists_as_the_processor(build, seed):
    rng = np.random.default_rng(seed)
    lights = random_lights(seed)
    low = lights.vertices.min(axis=0) + rng.uniform(-0.5, 0.5, 3)
    bounds = (low, low + rng.uniform(0.1, 4.0, 3))
    for cells in rng.permutation(np.arange(1, 13))[:3]:
        assert_same(build(lights, int(cells), float(rng.uniform(0.5, 8.0)), bounds))


@pytest.mark.parametrize("cells", [17, 33, 70])
def test_grids_of_more_levels(build, cells):
    assert len(assert_same(build(random_lights(99, 400), cells, 1.5)).light_ids)


@pytest.mark.parametrize("cells", [1, 2, 5])
def test_long_lists_are_looked_through_in_parts(build, cells):
    found = assert_same(build(random_lights(98, 1000), cells, 6.0))
    assert found.block_counts.max() > 2 * light_grid.LEAST_LIGHTS_PER_PART


def test_lists_of_more_lights_than_a_loop_may_run(build):
    # 70,000 times the same light: cells look through lists of all of them.
    corners = np.tile(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]), (70_000, 1, 1))
    assert assert_same(build(lights_from_triangles(corners), 2, 1e5)).cell_counts().tolist() == [70_000] * 8


def test_masks_that_take_many_rounds_of_a_loop(build):
    """1,000 discs that cross a block askew: every cell that their planes cut is in doubt."""
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(1000, 3, 3)) * 0.3 + [-1.0, -1.0, -0.5]
    found = assert_same(build(lights_from_triangles(corners), 8, 1.0))
    assert found.block_counts.max() > 900


def test_parts_are_short_enough_however_many_blocks():
    for most in (light_grid.MOST_LIGHTS_PER_PART, light_grid.MOST_MASKS_PER_PART):
        for blocks in (1, 1000, 10**6):
            for longest in (0, 100, 65_535, 10**6):
                parts = light_grid._parts(blocks, longest, most)
                assert parts >= 1
                assert -(-longest // parts) <= most


def test_no_lights_and_no_entries(build):
    assert assert_same(build(empty_light_mesh(), 3, 4.0)).offsets.tolist() == [0, 0]
    assert assert_same(build(empty_light_mesh(), 40, 4.0)).light_ids.tolist() == []
    far = ((90.0, 90.0, 90.0), (91.0, 91.0, 91.0))
    assert assert_same(build(random_lights(0), 6, 1.0, far)).offsets.tolist() == [0] * 9


def test_lists_that_no_block_of_the_device_holds_are_refused(device, monkeypatch):
    frame = make_frame(BOX, 9)
    with device.current() as context:
        built = LightGridPass(context, device.shaders)
        monkeypatch.setattr(built, "_block_limit", 400)
        with pytest.raises(DeviceError, match="use a smaller grid"):
            built.build(light_shapes(random_lights(1), frame, 4.0).half_balls, frame.edges)


@pytest.mark.parametrize("count", [0, 40])
def test_uploaded_lists_come_back(device, count):
    frame = make_frame(BOX, 9)
    lists = build_block_lists(light_shapes(random_lights(1, count), frame, 4.0).half_balls, frame.edges)
    with device.current() as context:
        assert content_hash(upload(context, lists).read()) == content_hash(lists)


def test_can_be_cancelled(device, monkeypatch):
    monkeypatch.setattr(light_grid, "INVOCATIONS_PER_DISPATCH", 64)
    frame = make_frame(BOX, 33)
    seen = []

    def stop(fraction, label):
        seen.append(fraction)
        return len(seen) < 5

    with device.current() as context, pytest.raises(Cancelled):
        LightGridPass(context, device.shaders).build(
            light_shapes(random_lights(1), frame, 4.0).half_balls, frame.edges, stop
        )
    assert len(seen) == 5
