# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance by clusters, pixel by pixel, against core.light_cut and against the sum over all lights."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.form_factor_cases import room
from tests.render.pixels import Pixels, radiosity_rows, random_lights
from tests.render.rooms import lights_from_triangles
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.light_clusters import light_clusters
from vlm_addon.core.light_cut import cut_irradiance
from vlm_addon.core.light_grid import LitTree
from vlm_addon.core.light_mesh import VirtualLightMesh, empty_light_mesh
from vlm_addon.core.light_tree import build_light_tree
from vlm_addon.core.progress import Progress, silent
from vlm_addon.core.scene import Float32, Float64
from vlm_addon.render.device import Device
from vlm_addon.render.light_forest import GpuLightForest, make_forest
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes import tile_walk
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.phase_two import PhaseTwoPass
from vlm_addon.render.passes.phase_two_clustered import ClusteredPhaseTwoPass
from vlm_addon.render.virtual_lights import GpuVirtualLights

HERE = LocalSpace(np.zeros(3), 1.0)


def lit_trees(lights: VirtualLightMesh, radiosity: Float32, tolerance: float) -> list[LitTree]:
    """Of the static and of the dynamic lights, where there are any."""
    chosen = [part for part in (~lights.dynamic, lights.dynamic) if part.any()]
    trees = [build_light_tree(lights, part) for part in chosen]
    return [LitTree(tree, light_clusters(tree, lights, radiosity.astype(float), tolerance)) for tree in trees]


def clustered(
    device: Device,
    pixels: Pixels,
    lights: VirtualLightMesh,
    radiosity: Float32,
    tolerance: float = 0.02,
    progress: Progress = silent,
) -> Float32:
    """(h, w, 3) of the pass, row 0 at the top."""
    height, width = pixels.shown.shape
    forest = make_forest(lit_trees(lights, radiosity, tolerance), HERE, len(lights))
    with device.current() as context:
        render = ClusteredPhaseTwoPass(context, device.shaders, width, height)
        records = GpuVirtualLights(context, lights, np.zeros(3))
        buffer = context.buffer(radiosity_rows(radiosity))
        gpu_forest = GpuLightForest(context, forest)
        return read_image(render.render(pixels.gbuffer(device), records, buffer, gpu_forest, progress))[..., :3]


def full(device: Device, pixels: Pixels, lights: VirtualLightMesh, radiosity: Float32) -> Float32:
    """(h, w, 3) of the sum over all lights."""
    height, width = pixels.shown.shape
    with device.current() as context:
        records = GpuVirtualLights(context, lights, np.zeros(3))
        buffer = context.buffer(radiosity_rows(radiosity))
        render = PhaseTwoPass(context, device.shaders, width, height)
        return read_image(render.render(pixels.gbuffer(device), records, buffer, silent))[..., :3]


def cut(pixels: Pixels, lights: VirtualLightMesh, radiosity: Float32, tolerance: float = 0.02) -> Float64:
    """(h, w, 3) by the processor in float64."""
    positions, normals = pixels.flat()
    total = np.zeros((len(positions), 3))
    for lit in lit_trees(lights, radiosity, tolerance):
        tags = pixels.tag_ids.reshape(-1)
        values = radiosity.astype(float)
        total += cut_irradiance(lit.tree, lit.clusters, lights, values, positions, normals, tags).irradiance
    return np.where(pixels.shown[..., None], total.reshape(*pixels.shown.shape, 3), 0.0)


def box_lights(per_edge: int, generator: np.random.Generator) -> VirtualLightMesh:
    """12 per_edge² lights on the walls of the box from 0 to 1, facing inwards, a little behind the walls."""
    corners = room(per_edge)
    lights = lights_from_triangles(0.5 + 1.02 * (corners - 0.5))
    lights.dynamic[:] = False
    return lights


def floor_pixels(size: tuple[int, int] = (48, 40)) -> Pixels:
    """The floor of the box from 0 to 1, as a camera over it sees it."""
    pixels = Pixels(np.random.default_rng(0), size)
    x, y = np.meshgrid(np.linspace(0.01, 0.99, size[0]), np.linspace(0.01, 0.99, size[1]))
    pixels.positions = np.stack([x, y, np.zeros_like(x)], axis=2).astype(np.float32)
    pixels.normals[...] = (0.0, 0.0, 1.0)
    pixels.shown[...] = True
    pixels.tag_ids[...] = 0
    return pixels


def room_pixels(generator: np.random.Generator, size: tuple[int, int] = (32, 32)) -> Pixels:
    """Points anywhere in the box from 0 to 1, facing anywhere."""
    pixels = Pixels(generator, size)
    pixels.positions = generator.uniform(0.0, 1.0, pixels.positions.shape).astype(np.float32)
    return pixels


def wall_pixels(generator: np.random.Generator, size: tuple[int, int] = (48, 48)) -> Pixels:
    """Points anywhere on the six walls of the box, facing inwards."""
    pixels = room_pixels(generator, size)
    axis = generator.integers(0, 3, pixels.shown.shape)[..., None]
    side = generator.integers(0, 2, pixels.shown.shape)[..., None]
    np.put_along_axis(pixels.positions, axis, side.astype(np.float32), axis=2)
    pixels.normals[...] = 0.0
    np.put_along_axis(pixels.normals, axis, (1 - 2 * side).astype(np.float32), axis=2)
    return pixels


@pytest.mark.parametrize("tolerance", [0.01, 0.1])
@pytest.mark.parametrize("where", [floor_pixels, lambda: room_pixels(np.random.default_rng(1))], ids=["floor", "all"])
def test_every_pixel_gets_what_the_processor_computes(
    device: Device, where: Callable[[], Pixels], tolerance: float
) -> None:
    generator = np.random.default_rng(2)
    lights, pixels = box_lights(14, generator), where()
    lights.tag_ids[:] = generator.integers(0, 3, len(lights))
    lights.dynamic[:] = generator.random(len(lights)) < 0.2
    radiosity = generator.uniform(0.0, 2.0, (len(lights), 3)).astype(np.float32)
    found = clustered(device, pixels, lights, radiosity, tolerance)
    exact = cut(pixels, lights, radiosity, tolerance)
    np.testing.assert_allclose(found, exact, rtol=2e-4, atol=1e-4 * exact.mean())
    # Clusters do take part.
    assert np.abs(exact - full(device, pixels, lights, radiosity)).max() > 1e-3 * exact.mean()


@pytest.mark.parametrize("tolerance", [0.01, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("lighting", ["smooth", "spot"])
def test_errors_stay_within_the_tolerance(device: Device, lighting: str, tolerance: float) -> None:
    generator = np.random.default_rng(3)
    lights = box_lights(16, generator)
    centres = lights.corners.mean(axis=1)
    radiosity = np.repeat(1.0 + 0.5 * np.sin(7.0 * centres.sum(axis=1, keepdims=True)), 3, axis=1)
    if lighting == "spot":
        lit = np.linalg.norm(centres - (0.0, 0.6, 0.4), axis=1) < 0.25
        radiosity = np.where(lit[:, None], radiosity, 0.0)
    radiosity = radiosity.astype(np.float32)
    for pixels in (floor_pixels(), wall_pixels(generator)):
        exact = full(device, pixels, lights, radiosity)[pixels.shown].sum(axis=1)
        found = clustered(device, pixels, lights, radiosity, tolerance)[pixels.shown].sum(axis=1)
        errors = np.abs(found - exact) / np.maximum(exact, 0.1 * exact.mean())
        assert np.quantile(errors, 0.95) <= tolerance
        assert np.quantile(errors, 0.999) <= 3.0 * tolerance


def test_own_tags_give_exactly_nothing_to_own_surfaces(device: Device) -> None:
    generator = np.random.default_rng(4)
    lights, pixels = box_lights(12, generator), floor_pixels()
    lights.tag_ids[:] = 3
    pixels.tag_ids[:, ::2] = 3
    pixels.tag_ids[:, 1::2] = 2
    found = clustered(device, pixels, lights, np.ones((len(lights), 3), np.float32), 0.1)
    assert (found[:, ::2] == 0.0).all()
    assert (found[:, 1::2] > 0.5).all()


def test_clusters_of_many_lights_fill_the_hemisphere(device: Device) -> None:
    """43,200 lights of radiosity 1 around every pixel."""
    generator = np.random.default_rng(5)
    pixels, lights = room_pixels(generator, (4, 4)), box_lights(60, generator)
    found = clustered(device, pixels, lights, np.ones((len(lights), 3), np.float32))[pixels.shown]
    assert found == pytest.approx(1.0, abs=0.03)


def test_the_same_input_gives_the_same_bits(device: Device) -> None:
    generator = np.random.default_rng(6)
    lights, pixels = box_lights(14, generator), room_pixels(generator)
    radiosity = generator.uniform(0.0, 2.0, (len(lights), 3)).astype(np.float32)
    first = clustered(device, pixels, lights, radiosity)
    assert (first == clustered(device, pixels, lights, radiosity)).all()


def test_lists_in_many_parts_give_the_same(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts of some tiles, and single tiles that have more entries than a part is to have."""
    generator = np.random.default_rng(7)
    lights, pixels = box_lights(14, generator), room_pixels(generator, (70, 50))
    radiosity = generator.uniform(0.0, 2.0, (len(lights), 3)).astype(np.float32)
    whole = clustered(device, pixels, lights, radiosity)
    parts: list[float] = []
    for most in (5000, 50):
        monkeypatch.setattr(tile_walk, "MAX_ENTRIES", most)
        split = clustered(device, pixels, lights, radiosity, progress=lambda f, label: parts.append(f) is None)
        assert (split == whole).all()
    assert len(parts) > 50
    assert parts[-1] == 1.0


def test_the_walk_can_be_cancelled(device: Device) -> None:
    generator = np.random.default_rng(8)
    lights, pixels = box_lights(8, generator), room_pixels(generator)
    calls: list[float] = []

    def third_time(fraction: float, label: str) -> bool:
        calls.append(fraction)
        return len(calls) < 3

    with pytest.raises(Cancelled):
        clustered(device, pixels, lights, np.ones((len(lights), 3), np.float32), progress=third_time)
    assert len(calls) == 3


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_few_lights(device: Device, count: int) -> None:
    generator = np.random.default_rng(9)
    lights = random_lights(generator, count, 0.3) if count else empty_light_mesh()
    pixels, radiosity = Pixels(generator), np.ones((count, 3), np.float32)
    found, exact = clustered(device, pixels, lights, radiosity), cut(pixels, lights, radiosity)
    assert found == pytest.approx(exact, rel=2e-4, abs=1e-6)


def test_dark_lights_give_nothing(device: Device) -> None:
    generator = np.random.default_rng(10)
    lights, pixels = box_lights(8, generator), room_pixels(generator)
    dark = np.zeros((len(lights), 3), np.float32)
    assert (clustered(device, pixels, lights, dark) == 0.0).all()
    # One that glows among them.
    dark[5] = (1.0, 2.0, 3.0)
    found, exact = clustered(device, pixels, lights, dark), cut(pixels, lights, dark)
    assert exact.max() > 0.0
    assert found == pytest.approx(exact, rel=2e-4, abs=1e-7)


def test_pixels_without_surface_and_pictures_of_nothing_stay_dark(device: Device) -> None:
    generator = np.random.default_rng(11)
    lights, pixels = box_lights(8, generator), room_pixels(generator)
    radiosity = np.ones((len(lights), 3), np.float32)
    found = clustered(device, pixels, lights, radiosity)
    assert (found[~pixels.shown] == 0.0).all()
    assert (found[pixels.shown].max(axis=0) > 0.0).all()
    pixels.shown[...] = False
    assert (clustered(device, pixels, lights, radiosity) == 0.0).all()


def test_points_within_a_heap_of_lights_stay_finite_and_bounded(device: Device) -> None:
    """The camera in the middle of a cluster, with points on its lights and at its centroid."""
    generator = np.random.default_rng(12)
    lights = random_lights(generator, 600, 0.05, spread=0.3)
    pixels = Pixels(generator, (32, 32))
    pixels.positions = (0.3 * pixels.positions).astype(np.float32)
    touched = lights.corners.mean(axis=1).astype(np.float32)
    pixels.positions[:16, :16] = touched[: 16 * 16].reshape(16, 16, 3)
    pixels.positions[16, :] = touched.mean(axis=0)
    radiosity = np.ones((600, 3), np.float32)
    found = clustered(device, pixels, lights, radiosity, 0.1)
    assert np.isfinite(found).all()
    assert (found <= 1.1 * full(device, pixels, lights, radiosity).max()).all()


def test_a_million_watts_are_a_million_times_one(device: Device) -> None:
    generator = np.random.default_rng(13)
    lights, pixels = box_lights(10, generator), room_pixels(generator)
    radiosity = generator.uniform(0.5, 1.0, (len(lights), 3)).astype(np.float32)
    bright = np.float32(1e6) * radiosity
    found, exact = clustered(device, pixels, lights, bright), cut(pixels, lights, bright)
    assert found == pytest.approx(exact, rel=2e-4, abs=10.0)
    # Rounding may choose other windows, which changes no more than a tolerance allows.
    assert found == pytest.approx(1e6 * clustered(device, pixels, lights, radiosity), rel=0.02)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_millimetres_and_kilometres(device: Device, scale: float) -> None:
    generator = np.random.default_rng(14)
    lights, pixels = box_lights(10, generator), room_pixels(generator)
    radiosity = generator.uniform(0.5, 1.0, (len(lights), 3)).astype(np.float32)
    pixels.positions = (scale * pixels.positions.astype(float)).astype(np.float32)
    lights.vertices[:] *= scale
    exact = cut(pixels, lights, radiosity)
    assert clustered(device, pixels, lights, radiosity) == pytest.approx(exact, rel=2e-4, abs=1e-4)


def test_lights_without_area_among_others_change_nothing(device: Device) -> None:
    generator = np.random.default_rng(15)
    lights, pixels = box_lights(8, generator), room_pixels(generator)
    lights.vertices.reshape(-1, 3, 3)[::7] = lights.vertices.reshape(-1, 3, 3)[::7, :1]
    radiosity = np.ones((len(lights), 3), np.float32)
    found = clustered(device, pixels, lights, radiosity)
    assert np.isfinite(found).all()
    assert found == pytest.approx(cut(pixels, lights, radiosity), rel=1e-3, abs=1e-4)


def test_lights_all_in_one_place(device: Device) -> None:
    """5,000 times the same light: no cell tells them apart."""
    generator = np.random.default_rng(16)
    one = random_lights(generator, 1, 0.3)
    lights = lights_from_triangles(np.repeat(one.corners, 5000, axis=0))
    pixels, radiosity = Pixels(generator, (20, 20)), np.full((5000, 3), 1e-3, np.float32)
    found = clustered(device, pixels, lights, radiosity)
    assert found == pytest.approx(cut(pixels, lights, radiosity), rel=1e-3, abs=1e-4)


def test_more_clusters_than_a_dispatch_holds(device: Device) -> None:
    """6,000 tags of two lights each: as many clusters without a parent, in every tile's list."""
    generator = np.random.default_rng(17)
    centres = np.repeat(generator.uniform((-1.0, -1.0, 19.0), (1.0, 1.0, 21.0), (6000, 3)), 2, axis=0)[:, None]
    corners = centres + generator.normal(0.0, 0.02, (12_000, 3, 3))
    lights = lights_from_triangles(corners, tag_ids=np.repeat(np.arange(1, 6001), 2))
    pixels, radiosity = Pixels(generator, (6, 6)), np.ones((12_000, 3), np.float32)
    pixels.normals[..., 2] = np.abs(pixels.normals[..., 2])
    found, exact = clustered(device, pixels, lights, radiosity), cut(pixels, lights, radiosity)
    assert found == pytest.approx(exact, rel=1e-3, abs=1e-4 * exact.max())
