# SPDX-License-Identifier: GPL-3.0-or-later
"""The levels of an octree as boxes over a dimmed picture, for people to look at (seed 004, figure of the octree)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ..core.scene import Float32, Float64
from ..core.voxel_octree import BRICK_LEVELS, Int64
from .local_space import LocalSpace
from .passes.accumulate import read_image
from .passes.gbuffer import GBuffer
from .point_picture import DIMMED, palette
from .scene_octree import SceneOctree
from .view import View

# Of the depth of a surface: how far behind it an edge still shows that lies in it.
_BEHIND = 1e-3
# Of a corner's place along an axis, up to the most voxels there are.
_CORNER_BITS = 11


def octree_images(
    octree: SceneOctree,
    view: View,
    gbuffer: GBuffer,
    space: LocalSpace,
    levels: Sequence[int] | None = None,
    through_surfaces: bool = False,
) -> dict[str, Float32]:
    """`octree_level_N` for each of `levels`: (h, w, 3) linear, row 0 at the top, edges of the cells of 2^N along each
    axis that hold a surface, in one colour for each level.

    levels: all from 1 to the bricks and the voxels if None. through_surfaces: also what is behind the surfaces of
    `gbuffer`, which is of `view`. Reads the octree and the G-buffer back from the device.
    """
    depth = octree.frame.depth
    chosen = (*range(1, depth - BRICK_LEVELS + 1), depth) if levels is None else levels
    surface = read_image(gbuffer.position)[..., 3]
    background = DIMMED * read_image(gbuffer.base_color)[..., :3]
    surface_depth = np.where(through_surfaces | (surface == 0.0), np.inf, surface * (1.0 + _BEHIND))
    colors = palette(np.arange(depth + 1))
    trees = [tree.read() for tree in octree.trees]
    images = {}
    for level in chosen:
        starts, ends = cell_edges(np.concatenate([tree.cells(level) for tree in trees]))
        near, far = (space.local_points(octree.frame.points(end * 2.0 ** (depth - level))) for end in (starts, ends))
        shown = edge_pixels(view, near, far, surface_depth)
        images[f"octree_level_{level}"] = np.where(shown[..., None], colors[level], background).astype(np.float32)
    return images


def cell_edges(cells: Int64) -> tuple[Int64, Int64]:
    """(e, 3) ends of the edges of (n, 3) cells of side 1, those that cells share once."""
    found = []
    for axis in range(3):
        across = np.roll(np.array([(0, u, v) for u in (0, 1) for v in (0, 1)]), axis, axis=1)
        # In one number each: several times as fast as rows.
        words = (cells[:, None] + across) @ (1, 1 << _CORNER_BITS, 1 << 2 * _CORNER_BITS)
        shifts = _CORNER_BITS * np.arange(3)
        starts = np.unique(words)[:, None] >> shifts & ((1 << _CORNER_BITS) - 1)
        found.append(np.stack([starts, starts + np.eye(3, dtype=np.int64)[axis]]))
    starts, ends = np.concatenate(found, axis=1)
    return starts, ends


def edge_pixels(view: View, starts: Float64, ends: Float64, surface_depth: Float64) -> npt.NDArray[np.bool_]:
    """(h, w) which pixels show a line between (e, 3) points, m from the local origin, that is nearer than the (h, w)
    `surface_depth`, row 0 at the top."""
    height, width = surface_depth.shape
    clip = [points @ view.clip_from_local[:, :3].T + view.clip_from_local[:, 3] for points in (starts, ends)]
    first, last = _shares_inside(*clip)
    rows = np.flatnonzero(first <= last)
    way = clip[1][rows] - clip[0][rows]
    a, b = (clip[0][rows] + share[rows, None] * way for share in (first, last))
    places = [(0.5 + 0.5 * end[:, :2] / end[:, 3:]) * (width, height) for end in (a, b)]
    counts = np.ceil(np.abs(places[1] - places[0]).max(axis=1)).astype(np.int64) + 1
    line = np.repeat(np.arange(len(rows)), counts)
    step = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (step / np.maximum(counts - 1, 1)[line])[:, None]
    place = places[0][line] + share * (places[1] - places[0])[line]
    columns, lines = np.clip(np.floor(place).astype(np.int64), 0, (width - 1, height - 1)).T
    image_rows = height - 1 - lines
    # Along a line of the picture, 1 / w is linear, and so is anything linear in space over w.
    ends_depth = [_depths(view, starts[rows] + part[rows, None] * (ends - starts)[rows]) for part in (first, last)]
    over_w = [(1.0 / end[:, 3:])[line] for end in (a, b)]
    mixed_w = over_w[0] + share * (over_w[1] - over_w[0])
    near, far = (values[line, None] * weight for values, weight in zip(ends_depth, over_w, strict=True))
    depth = ((near + share * (far - near)) / mixed_w)[:, 0]
    shown = np.zeros((height, width), bool)
    visible = depth <= surface_depth[image_rows, columns]
    shown[image_rows[visible], columns[visible]] = True
    return shown


def _depths(view: View, points: Float64) -> Float64:
    return np.asarray((view.position - points) @ view.backward)


def _shares_inside(start: Float64, end: Float64) -> tuple[Float64, Float64]:
    """(n,) first and last share of the ways between (n, 4) clip coordinates that the picture shows; first > last for
    those that it does not."""
    first, last = np.zeros(len(start)), np.ones(len(start))
    for plane in ((1, 0, 0, 1), (-1, 0, 0, 1), (0, 1, 0, 1), (0, -1, 0, 1), (0, 0, 1, 1), (0, 0, -1, 1)):
        inside = [end_ @ np.array(plane, float) for end_ in (start, end)]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = inside[0] / (inside[0] - inside[1])
        enters, leaves = (inside[0] < 0.0) & (inside[1] >= 0.0), (inside[0] >= 0.0) & (inside[1] < 0.0)
        first = np.where(enters, np.maximum(first, share), first)
        last = np.where(leaves, np.minimum(last, share), last)
        last = np.where((inside[0] < 0.0) & (inside[1] < 0.0), -1.0, last)
    return first, last
