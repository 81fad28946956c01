# SPDX-License-Identifier: GPL-3.0-or-later
"""Which surfaces lights leave out by links, in every form in which the device sums lights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.glossy_pixels import GlossyPixels
from tests.render.pixels import Pixels, radiosity_rows, random_lights
from tests.render.rooms import box_room, camera_at, mesh_lights
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.light_clusters import light_clusters
from vlm_addon.core.light_cut import cut_irradiance
from vlm_addon.core.light_grid import LitTree
from vlm_addon.core.light_links import leaves_out, make_links
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.light_tree import build_light_tree
from vlm_addon.core.progress import silent
from vlm_addon.core.range_grid import RangeGrid, RangeSettings
from vlm_addon.core.scene import Float32, Float64, Int32
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.render.light_forest import GpuLightForest, make_forest
from vlm_addon.render.light_structures import gpu_grid
from vlm_addon.render.link_table import LIGHT_LINKS, TAG_DEFINES, LinkTable
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.light_grid import upload
from vlm_addon.render.passes.light_mesh_reflection import LightMeshReflectionPass
from vlm_addon.render.passes.phase_two import PhaseTwoPass
from vlm_addon.render.passes.phase_two_clustered import ClusteredPhaseTwoPass
from vlm_addon.render.passes.phase_two_range import RangePhaseTwoPass
from vlm_addon.render.shader_library import ShaderLibrary
from vlm_addon.render.view import make_view
from vlm_addon.render.virtual_lights import GpuVirtualLights

HERE = LocalSpace(np.zeros(3), 1.0)
BOUNDS = (np.full(3, -1.0), np.full(3, 1.0))
LINKS = make_links([(1, 2), (3, 1), (3, 2)])
ASK = """
#include "passes/light_tags.glsl"
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Asked { ivec2 asked[]; };
layout(std430, binding = 1) writeonly buffer Answers { int answers[]; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    answers[i] = int(LEAVES_OUT(asked[i].x, asked[i].y));
}
"""


def answers(device: Device, links: Int32, asked: Int32) -> np.ndarray:
    """(n,) bool of the shader, of (n, 2) pairs of tags; n a multiple of 64."""
    with device.current() as context:
        LinkTable(context, links).bind()
        defines = {**TAG_DEFINES, LIGHT_LINKS: True}
        shader = device.shaders.compute_from_text(ASK, "test", defines)
        context.buffer(np.ascontiguousarray(asked).tobytes()).bind_to_storage_buffer(0)
        found = context.buffer(reserve=4 * len(asked))
        found.bind_to_storage_buffer(1)
        shader.run(len(asked) // 64)
        context.memory_barrier()
        return np.frombuffer(found.read(), np.int32) != 0


@pytest.mark.parametrize("count", [1, 4, 5, 100, 3000, 50_000])
@pytest.mark.parametrize("largest", [300, 2**31 - 1])
def test_the_table_knows_each_link_and_no_other(device: Device, count: int, largest: int) -> None:
    generator = np.random.default_rng(count)
    pairs = generator.integers(1, largest, (count, 2))
    links = make_links(pairs if largest < 2**31 - 1 else pairs * generator.choice([-1, 1], (count, 2)))
    others = np.concatenate([links[:, ::-1], links + np.array([[0, 1]], np.int32), [[0, 0], [5, 5], [0, 7], [7, 0]]])
    asked = np.concatenate([links, others]).astype(np.int32)
    asked = np.resize(asked, (-(-len(asked) // 64) * 64, 2))
    assert (answers(device, links, asked) == leaves_out(links, asked[:, 0], asked[:, 1])).all()


def linked_scene(count: int) -> tuple[Pixels, VirtualLightMesh, Float32]:
    """Pixels and lights of the tags 0 to 3, lights with LINKS, and what these send out."""
    generator = np.random.default_rng(1)
    pixels, lights = Pixels(generator), replace(random_lights(generator, count, 0.1), links=LINKS)
    lights.dynamic[:] = generator.random(count) < 0.3
    return pixels, lights, generator.uniform(0.0, 10.0, (count, 3)).astype(np.float32)


def by_hand(pixels: Pixels, lights: VirtualLightMesh, radiosity: Float32) -> Float64:
    """(h, w, 3): the sum in float64, pair by pair of tags."""
    factors = polygon_form_factor(*pixels.flat(), lights.corners)
    for surface in range(4):
        for light in range(4):
            if (light == surface != 0) or [light, surface] in LINKS.tolist():
                factors[np.ix_(pixels.tag_ids.reshape(-1) == surface, lights.tag_ids == light)] = 0.0
    total = (factors @ radiosity.astype(float)).reshape(*pixels.shown.shape, 3)
    return np.where(pixels.shown[..., None], total, 0.0)


def linking(device: Device) -> ShaderLibrary:
    """The shaders of a frame whose light mesh has links."""
    return device.shaders.with_common({LIGHT_LINKS: True})


def test_the_sum_over_all_lights(device: Device) -> None:
    pixels, lights, radiosity = linked_scene(150)
    height, width = pixels.shown.shape
    with device.current() as context:
        records, buffer = GpuVirtualLights(context, lights, np.zeros(3)), context.buffer(radiosity_rows(radiosity))
        render = PhaseTwoPass(context, linking(device), width, height)
        found = read_image(render.render(pixels.gbuffer(device), records, buffer, silent))[..., :3]
    truth = by_hand(pixels, lights, radiosity)
    assert found == pytest.approx(truth, rel=2e-4, abs=2e-5 * truth.max())


def test_the_sum_over_clusters(device: Device) -> None:
    """As the processor walks them; what links leave out is left out of clusters and of single lights."""
    pixels, lights, radiosity = linked_scene(3000)
    height, width = pixels.shown.shape
    values = radiosity.astype(float)
    trees = [
        LitTree(tree, light_clusters(tree, lights, values, 0.05))
        for tree in (build_light_tree(lights, part) for part in (~lights.dynamic, lights.dynamic))
    ]
    with device.current() as context:
        records, buffer = GpuVirtualLights(context, lights, np.zeros(3)), context.buffer(radiosity_rows(radiosity))
        forest = GpuLightForest(context, make_forest(trees, HERE, len(lights)))
        render = ClusteredPhaseTwoPass(context, linking(device), width, height)
        found = read_image(render.render(pixels.gbuffer(device), records, buffer, forest, silent))[..., :3]
    tags = pixels.tag_ids.reshape(-1)
    parts = [cut_irradiance(lit.tree, lit.clusters, lights, values, *pixels.flat(), tags) for lit in trees]
    truth = sum(part.irradiance for part in parts).reshape(found.shape)
    np.testing.assert_allclose(found[pixels.shown], truth[pixels.shown], rtol=2e-4, atol=1e-4 * truth.mean())
    assert np.abs(truth - by_hand(pixels, lights, radiosity))[pixels.shown].max() > 1e-3 * truth.mean()


def test_the_sum_over_cells(device: Device) -> None:
    pixels, lights, radiosity = linked_scene(150)
    height, width = pixels.shown.shape
    settings = RangeSettings(4, 1e3)
    grids = [RangeGrid.bake(lights, BOUNDS, settings, chosen=part) for part in (~lights.dynamic, lights.dynamic)]
    with device.current() as context:
        records, buffer = GpuVirtualLights(context, lights, np.zeros(3)), context.buffer(radiosity_rows(radiosity))
        lists = [gpu_grid(context, grid.frame, grid.half_balls, upload(context, grid.lists)) for grid in grids]
        render = RangePhaseTwoPass(context, linking(device), width, height)
        image = render.render(pixels.gbuffer(device), records, buffer, lists, HERE, BOUNDS, silent)
        found = read_image(image)[..., :3]
    truth = by_hand(pixels, lights, radiosity)
    assert found == pytest.approx(truth, rel=2e-4, abs=2e-5 * truth.max())


def test_reflections_of_the_light_mesh(device: Device) -> None:
    generator = np.random.default_rng(6)
    pixels = GlossyPixels(generator, (21, 37), 1.0)
    pixels.normals[:], pixels.positions[..., 2] = (0.0, 0.0, 1.0), 0.0
    pixels.camera = camera_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0))
    height, width = pixels.shown.shape
    for tag in range(4):
        lights = replace(random_lights(generator, 1, 0.1), links=LINKS)
        lights.vertices[:] = [[-1.0, -1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]]
        lights.tag_ids[:] = tag
        with device.current() as context:
            records, buffer = GpuVirtualLights(context, lights, np.zeros(3)), context.buffer(bytes(np.ones(4, "f4")))
            view = make_view(pixels.camera, width, height, np.zeros(3))
            render = LightMeshReflectionPass(context, linking(device), width, height)
            found = read_image(render.render(pixels.gbuffer(device), view, records, buffer, silent))[..., 0]
        excluded = leaves_out(LINKS, lights.tag_ids, pixels.tag_ids)
        assert (found[excluded & pixels.shown] == 0.0).all()
        assert (found[~excluded & pixels.shown] > 0.0).all()


@pytest.mark.parametrize("lights", ["all", "tolerance", "range"])
def test_a_frame_leaves_out_what_is_linked_and_forgets_it_again(device: Device, lights: str) -> None:
    """The walls' lights have tag 7, the floor tag 9: linked, the floor gets as much as if they were black."""
    room = box_room()
    floor, *walls = room.meshes
    floor = replace(floor, tag_ids=np.full(2, 9, np.int32))
    room = replace(room, meshes=(floor, *walls))
    mesh = mesh_lights(room.meshes, emission=0.0, colour=0.5)
    is_wall = np.arange(len(mesh)) >= 2
    mesh = replace(mesh, tag_ids=np.where(is_wall, 7, 0).astype(np.int32))
    black = replace(mesh, colour=np.where(is_wall[:, None], 0.0, mesh.colour).astype(np.float32))
    linked = replace(mesh, links=make_links([(7, 9)]))
    settings = RenderSettings(
        width=32, height=24, samples=1, technique="vlm", technique_settings={"lights": lights, "range": 1e3}
    )
    before, with_links, dark, after = (
        device.render(room, each, settings).images["indirect"] for each in (mesh, linked, black, mesh)
    )
    ids = device.render(room, mesh, replace(settings, buffers=True)).images["tag_id"][..., 0]
    on_floor = ids == 9
    assert on_floor.sum() > 50
    assert (before[on_floor].max(axis=-1) > 0.0).all()
    assert with_links[on_floor] == pytest.approx(dark[on_floor], rel=1e-4, abs=1e-6)
    assert (with_links[~on_floor] == before[~on_floor]).all()
    assert (after == before).all()
