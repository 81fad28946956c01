# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked visibility of a scene: made once on the device, kept until something that shows or a light moves."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..core.baked_visibility import (
    CELL_COUNTS,
    MOST_ROWS,
    BakedVisibility,
    bake_hash,
    cluster_shares,
    make_baked,
    stored_bytes,
    visibility_frame,
)
from ..core.errors import InvalidInput
from ..core.light_grid import LitTree
from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress
from ..core.scene import SceneSnapshot
from ..core.visibility_cells import SIDE, VisibilityCells, make_cells
from ..core.visibility_rows import VisibilityRows, make_rows
from ..core.voxel_fit import MOST_IN_A_VOXEL
from .kept import Kept
from .passes.bake_visibility import BakeVisibilityPass
from .passes.baked_pixels import GpuBakedVisibility
from .scene_octree import SceneOctree, needed_resolution, scene_octree
from .shader_library import ShaderLibrary

if TYPE_CHECKING:
    import moderngl

MOST_BYTES = 1 << 28
"""Of a scene's shares."""
KIND = "baked_visibility"
CLUSTER_KIND = "baked_clusters"


def scene_visibility(
    context: moderngl.Context,
    shaders: ShaderLibrary,
    kept: Kept,
    world: SceneSnapshot,
    light_mesh: VirtualLightMesh,
    cells: int,
    points: int,
    progress: Progress,
) -> GpuBakedVisibility:
    """`baked_visibility` on the device; made where none of these very surfaces, lights and numbers is kept."""

    def bake() -> GpuBakedVisibility:
        baked = baked_visibility(context, shaders, kept, world, light_mesh, cells, points, progress)
        return GpuBakedVisibility(context, baked)

    return kept.get(KIND, bake_hash(world, light_mesh, cells, points), bake)


def baked_visibility(
    context: moderngl.Context,
    shaders: ShaderLibrary,
    kept: Kept,
    world: SceneSnapshot,
    light_mesh: VirtualLightMesh,
    cells: int,
    points: int,
    progress: Progress,
) -> BakedVisibility:
    """What the surfaces of `world` see of `light_mesh`, both in world space.

    cells: along the longest axis, fewer where so many take more than MOST_BYTES or the device's blocks hold. points: of
    a row. Raises InvalidInput where even the fewest cells take more, or for another number of cells; Cancelled when
    `progress` says so; DeviceError when OpenGL fails.
    """
    limit = min(MOST_BYTES, int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]))
    render = BakeVisibilityPass(context, shaders)
    octree, air, rows = _fitting_rows(context, shaders, kept, world, render, len(light_mesh), cells, points, limit)
    shares = render.bake(rows, light_mesh.samples, octree, progress)
    made_of = bake_hash(world, light_mesh, octree.frame.resolution // SIDE, points)
    return make_baked(octree.frame, air, rows, shares, made_of)


def _fitting_rows(
    context: moderngl.Context,
    shaders: ShaderLibrary,
    kept: Kept,
    world: SceneSnapshot,
    render: BakeVisibilityPass,
    light_count: int,
    cells: int,
    points: int,
    limit: int,
) -> tuple[SceneOctree, VisibilityCells, VisibilityRows]:
    """The finest cells, from `cells` on, whose shares take at most `limit` bytes. Raises InvalidInput if none does."""
    visibility_frame(world, cells)
    needed = 0
    for number in sorted((count for count in CELL_COUNTS if count <= cells), reverse=True):
        octree = scene_octree(context, shaders, kept, world, number * SIDE)
        voxels = np.concatenate([np.zeros((0, 3), np.int64), *(tree.read().voxels() for tree in octree.trees)])
        air = make_cells(voxels, octree.frame.resolution)
        rows = make_rows(world, octree.frame, air, points, partial(render.are_open, octree=octree))
        needed = stored_bytes(len(rows), light_count)
        if needed <= limit and len(rows) <= MOST_ROWS:
            return octree, air, rows
    problem = f"{light_count:,} lights seen from {len(rows):,} rows take {1e-6 * needed:,.0f} MB"
    remedy = f"bake fewer lights: {1e-6 * limit:,.0f} MB are the limit"
    raise InvalidInput("baked visibility", problem, remedy)


def coarser_text(baked: BakedVisibility, cells: int) -> str:
    """Why there are fewer than the `cells` asked for; "" if there are as many."""
    if baked.cells_per_axis == cells:
        return ""
    return (
        f"visibility is baked with {baked.cells_per_axis} cells along the longest axis in place of {cells}: "
        f"more would take over {1e-6 * MOST_BYTES:,.0f} MB, or over what the device's blocks hold"
    )


def dense_text(kept: Kept, world: SceneSnapshot, baked: BakedVisibility) -> str:
    """Why visibility is poor where meshes are dense in a wide scene; "" if they are not."""
    frame = baked.frame
    if needed_resolution(kept, world, frame.resolution) == frame.resolution:
        return ""
    size = SIDE * frame.voxel_size
    return (
        f"visibility is baked for cells of {size:.3g} m, in whose voxels over {MOST_IN_A_VOXEL} triangles lie: too "
        "coarse for these, and rays that ask so many may count as blocked; give more visibility_cells or hide what is "
        "far away"
    )


def forest_shares(
    kept: Kept, visibility: GpuBakedVisibility, trees: list[LitTree], light_mesh: VirtualLightMesh, trees_key: str
) -> moderngl.Buffer:
    """Rows of bytes of the clusters of all `trees`, one tree after the other. trees_key: which trees these are."""

    def make() -> moderngl.Buffer:
        shares, areas = visibility.baked.shares, light_mesh.areas
        parts = [np.zeros((len(shares), 0), np.uint8), *(cluster_shares(lit.tree, shares, areas) for lit in trees)]
        return visibility.share_buffer(np.concatenate(parts, axis=1))

    return kept.get(CLUSTER_KIND, f"{visibility.baked.made_of} {trees_key}", make)
