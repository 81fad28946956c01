# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists by compute shaders: bit for bit those of the processor."""

from __future__ import annotations

import numpy as np
import pytest

from tests.light_meshes import random_lights
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.cell_lists import build_cell_lists
from vlm_addon.core.errors import Cancelled, DeviceError
from vlm_addon.core.light_grid import GridSettings, LightGrid, light_shapes, make_frame
from vlm_addon.core.light_mesh import empty_light_mesh
from vlm_addon.render.passes import light_grid
from vlm_addon.render.passes.light_grid import LightGridPass

BOX = ((-2.0, -2.0, -1.0), (2.0, 3.0, 1.0))


@pytest.fixture(scope="module")
def build(device):
    """The lists of a light mesh by the device."""
    with device.current() as context:
        built = LightGridPass(context, device.shaders)

    def lists(lights, cells, reach, bounds=BOX):
        frame = make_frame(bounds, cells)
        with device.current():
            return built.build(light_shapes(lights, frame, reach).half_balls, frame.edges).read()

    return lists


def assert_same(found, expected):
    assert np.array_equal(found.offsets, expected.offsets)
    assert np.array_equal(found.light_ids, expected.light_ids)


@pytest.mark.parametrize("seed", range(50))
def test_the_same_lists_as_the_processor(build, seed):
    rng = np.random.default_rng(seed)
    lights = random_lights(seed)
    low = lights.vertices.min(axis=0) + rng.uniform(-0.5, 0.5, 3)
    bounds = (low, low + rng.uniform(0.1, 4.0, 3))
    for cells in rng.permutation(np.arange(1, 13))[:3]:
        reach = float(rng.uniform(0.5, 8.0))
        grid = LightGrid.bake(lights, bounds, GridSettings(int(cells), reach))
        assert_same(build(lights, int(cells), reach, bounds), grid.lists)


@pytest.mark.parametrize("cells", [17, 33, 70])
def test_grids_of_more_levels(build, cells):
    lights = random_lights(99, 400)
    expected = LightGrid.bake(lights, BOX, GridSettings(cells, 1.5)).lists
    assert len(expected.light_ids)
    assert_same(build(lights, cells, 1.5), expected)


@pytest.mark.parametrize("cells", [1, 2, 5])
def test_long_lists_are_looked_through_in_parts(build, cells):
    lights = random_lights(98, 1000)
    expected = LightGrid.bake(lights, BOX, GridSettings(cells, 6.0)).lists
    assert expected.counts.max() > 2 * light_grid.LEAST_LIGHTS_PER_PART
    assert_same(build(lights, cells, 6.0), expected)


def test_lists_of_more_lights_than_a_loop_may_run(build):
    # 70,000 times the same light: cells look through lists of all of them.
    corners = np.tile(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]), (70_000, 1, 1))
    assert set(build(lights_from_triangles(corners), 2, 1e5).counts) == {70_000}


def test_parts_are_short_enough_however_many_blocks():
    for blocks in (1, 1000, 10**6):
        for longest in (0, 100, 65_535, 10**6):
            parts = light_grid._parts(blocks, longest)
            assert parts >= 1
            assert -(-longest // parts) <= light_grid.MOST_LIGHTS_PER_PART


def test_no_lights_and_no_entries(build):
    assert build(empty_light_mesh(), 3, 4.0).offsets.tolist() == [0] * 28
    assert build(empty_light_mesh(), 40, 4.0).light_ids.tolist() == []
    far = ((90.0, 90.0, 90.0), (91.0, 91.0, 91.0))
    assert build(random_lights(0), 6, 1.0, far).offsets.tolist() == [0] * 217


def test_lists_longer_than_a_block_come_in_pieces(device, monkeypatch):
    frame = make_frame(BOX, 9)
    half_balls = light_shapes(random_lights(1), frame, 4.0).half_balls
    expected = build_cell_lists(half_balls, frame.edges)
    with device.current() as context:
        built = LightGridPass(context, device.shaders)
        monkeypatch.setattr(built, "_block_limit", 4000)
        assert len(expected.light_ids) > 1000
        assert_same(built.build_lists(half_balls, frame.edges), expected)
        none = half_balls.take(slice(0))
        assert built.build_lists(none, frame.edges).offsets.tolist() == [0] * 730
        with pytest.raises(DeviceError, match="use a smaller grid"):
            built.build(half_balls, frame.edges)


def test_can_be_cancelled(device, monkeypatch):
    monkeypatch.setattr(light_grid, "INVOCATIONS_PER_DISPATCH", 64)
    frame = make_frame(BOX, 9)
    seen = []

    def stop(fraction, label):
        seen.append(fraction)
        return len(seen) < 5

    with device.current() as context, pytest.raises(Cancelled):
        LightGridPass(context, device.shaders).build(
            light_shapes(random_lights(1), frame, 4.0).half_balls, frame.edges, stop
        )
    assert len(seen) == 5


@pytest.mark.parametrize("count", [1, 63, 64, 65, 4096, 4097, 300_000])
def test_sums_of_all_before(device, count):
    values = np.random.default_rng(count).integers(0, 50, count).astype(np.uint32)
    with device.current() as context:
        built = LightGridPass(context, device.shaders)
        buffer = context.buffer(values.tobytes())
        built._sum_up(buffer, count)
        found = np.frombuffer(buffer.read(), np.uint32)
    assert np.array_equal(found, np.concatenate(([0], np.cumsum(values[:-1]))))
