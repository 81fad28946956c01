# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures over the virtual lights, kept over frames: static and dynamic lights apart, the latest of each.

They are made in world space from geometry alone, so neither a lamp nor the camera makes one anew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..core.active_hemisphere import HalfBalls
from ..core.array_codec import content_hash
from ..core.cell_limit import Occupancy
from ..core.grid_frame import Bounds, GridFrame, make_frame
from ..core.light_clusters import light_clusters
from ..core.light_grid import RANGE, STATIC, TOLERANCE, LitTree, chosen_lights, lights_hash
from ..core.light_mesh import VirtualLightMesh
from ..core.light_scale import PROBES, mean_irradiance
from ..core.light_tree import LightTree, build_light_tree
from ..core.progress import Progress
from ..core.range_grid import RangeGrid, RangeSettings, light_shapes
from ..core.scene import Float32, SceneSnapshot
from ..core.surface_points import SurfacePoints, random_surface_points
from ..core.window_factor import window_factor
from .kept import Kept
from .passes.light_grid import GpuBlockLists, LightGridPass, half_ball_records, upload
from .passes.phase_two_range import GpuRangeGrid
from .shader_library import ShaderLibrary

if TYPE_CHECKING:
    import moderngl

Bools = npt.NDArray[np.bool_]


LIT_TREES = "lit trees"


@dataclass(frozen=True)
class SceneTrees:
    """The trees of a scene's lights. window_factor: by which their windows are enlarged. key: of all they depend on."""

    trees: tuple[LitTree, ...]
    window_factor: float
    key: str


class LightStructures:
    """A device's structures."""

    def __init__(self, kept: Kept, on_device: bool) -> None:
        """on_device: grids are faster made by shaders than by numpy, which software renderers are not."""
        self._kept = kept
        self._on_device = on_device

    def kept_in(self, kept: Kept) -> LightStructures:
        """Structures of other lights beside these, kept in another place."""
        return LightStructures(kept, self._on_device)

    def trees(
        self, snapshot: SceneSnapshot, light_mesh: VirtualLightMesh, radiosity: Float32, tolerance: float
    ) -> SceneTrees:
        """Trees of the static and of the dynamic lights, without those of no lights, with what they send out.

        snapshot, light_mesh: in world space. radiosity: (n, 3) W/m².
        """
        digests = self._kept.digests
        surfaces = digests.of([[mesh.positions, mesh.triangles, mesh.tag_ids] for mesh in snapshot.meshes])
        shape = [light_mesh.vertices, light_mesh.triangles, light_mesh.tag_ids, light_mesh.links, light_mesh.dynamic]
        key = digests.of(surfaces, shape, radiosity, tolerance)

        def make() -> SceneTrees:
            probes = self._kept.get("probes", surfaces, lambda: random_surface_points(snapshot.meshes, PROBES))
            return self._relit(light_mesh, radiosity, tolerance, probes, key)

        return self._kept.get(LIT_TREES, key, make)

    def _relit(
        self, light_mesh: VirtualLightMesh, radiosity: Float32, tolerance: float, probes: SurfacePoints, key: str
    ) -> SceneTrees:
        """The trees, those kept whose shape is as it was. probes: where their errors are judged."""
        values = radiosity.astype(np.float64)
        shapes: dict[str, str] = {}
        trees: dict[str, LightTree] = {}
        for kind, chosen in chosen_lights(light_mesh).items():
            if chosen.any():
                shapes[kind] = lights_hash(light_mesh, chosen, TOLERANCE)
                build = partial(build_light_tree, light_mesh, chosen)
                trees[kind] = self._kept.get(f"{kind}_tree", shapes[kind], build)
        judged_at = (probes.positions, probes.normals, probes.tag_ids)
        state = content_hash([*shapes.values(), radiosity, light_mesh.links, *judged_at])
        inputs = list(trees.values()), light_mesh, values
        mean = self._kept.get("scale", state, lambda: mean_irradiance(*inputs, probes))
        judge = partial(window_factor, *inputs, tolerance, mean, probes)
        factor = self._kept.get("window_factor", content_hash([state, tolerance]), judge)
        result = []
        for kind, tree in trees.items():

            def relight(tree: LightTree = tree) -> LitTree:
                return LitTree(tree, light_clusters(tree, light_mesh, values, tolerance, mean, factor))

            state = content_hash([shapes[kind], radiosity[chosen_lights(light_mesh)[kind]], tolerance, mean, factor])
            result.append(self._kept.get(f"{kind}_clusters", state, relight))
        return SceneTrees(tuple(result), factor, key)

    def range_grids(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        snapshot: SceneSnapshot,
        light_mesh: VirtualLightMesh,
        settings: RangeSettings,
        progress: Progress,
    ) -> list[GpuRangeGrid]:
        """Grids of the static and of the dynamic lights, without those of no lights; all in world space.

        The static grid lies over the surfaces that do not move, so that one that does leaves it as it is. Raises
        Cancelled, and DeviceError where the device's blocks are too small.
        """
        result = []
        for kind, chosen in chosen_lights(light_mesh).items():
            if not chosen.any():
                continue
            bounds = _bounds(snapshot, kind == STATIC)
            key = f"{lights_hash(light_mesh, chosen, RANGE)} {content_hash([list(bounds), settings])}"

            def build(chosen: Bools = chosen, bounds: Bounds = bounds) -> GpuRangeGrid:
                if self._on_device:
                    return _grid_on_device(context, shaders, light_mesh, bounds, settings, chosen, progress)
                grid = RangeGrid.bake(light_mesh, bounds, settings, progress, chosen)
                return gpu_grid(context, grid.frame, grid.half_balls, upload(context, grid.lists), grid.occupancy)

            result.append(self._kept.get(f"{kind}_grid", key, build))
        return result


def _bounds(snapshot: SceneSnapshot, only_static: bool) -> Bounds:
    """Of the surfaces that do not move, if there are any; else of all."""
    return (_static(snapshot) if only_static else snapshot).bounds()


def _static(snapshot: SceneSnapshot) -> SceneSnapshot:
    """With the surfaces that do not move, if there are any; else with all."""
    static = tuple(mesh for mesh in snapshot.meshes if not mesh.dynamic and len(mesh.positions))
    return replace(snapshot, meshes=static) if static else snapshot


def _grid_on_device(
    context: moderngl.Context,
    shaders: ShaderLibrary,
    light_mesh: VirtualLightMesh,
    bounds: Bounds,
    settings: RangeSettings,
    chosen: Bools,
    progress: Progress,
) -> GpuRangeGrid:
    frame = make_frame(bounds, settings.grid)
    shapes = light_shapes(light_mesh, frame, settings.range, chosen)
    lists = LightGridPass(context, shaders).build(shapes.half_balls, frame.edges, progress)
    occupancy = None
    if settings.max_lights:
        grid = RangeGrid.from_lists(settings, frame, shapes, lists.read(), progress)
        lists, occupancy = upload(context, grid.lists), grid.occupancy
    return gpu_grid(context, frame, shapes.half_balls, lists, occupancy)


def gpu_grid(
    context: moderngl.Context,
    frame: GridFrame,
    half_balls: HalfBalls,
    lists: GpuBlockLists,
    occupancy: Occupancy | None = None,
) -> GpuRangeGrid:
    """A grid whose lists are on the device already; occupancy: as in GpuRangeGrid."""
    offsets = np.frombuffer(lists.offsets.read(), np.uint32).astype(np.int64)
    records = context.buffer(half_ball_records(half_balls).tobytes())
    return GpuRangeGrid(frame, lists, records, int(np.diff(offsets).max(initial=0)), occupancy)
