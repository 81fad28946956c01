# SPDX-License-Identifier: GPL-3.0-or-later
"""What the arrays of a light grid are like: their types, their shapes, and what their indices may point at.

A file whose checksum holds may still be another program's: nothing that reads a grid has to look twice at an index.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .errors import InvalidInput
from .light_grid import LightGrid, LitTree, chosen_lights
from .light_mesh import VirtualLightMesh
from .light_tree import ROOT, LightTree
from .range_grid import RangeGrid

# Names of fields by dtype and shape; the same word is the same length throughout a structure.
_COMMON = {
    "<f8 2 3": ("bounds",),
    "<f8 probes 3": ("probes.positions", "probes.normals"),
    "<i4 probes": ("probes.tag_ids",),
}
_TREE = {
    "<i4 lights": ("tree.light_parent",),
    "<i4 clusters": ("tree.parent", "tree.depth", "tree.level", "tree.tag_ids"),
    "<i4 members": ("tree.light_order",),
    "<i4 clusters+1": ("tree.light_offsets", "tree.child_offsets"),
    "<f8 3": ("tree.cell_origin",),
    "<f8 clusters 2 3": ("tree.plane_axes", "clusters.axes"),
    "<f8 clusters": (
        *("tree.shapes.area", "tree.shapes.radius", "tree.shapes.plane"),
        *("clusters.power", "clusters.window", "clusters.least_squared"),
    ),
    "<f8 clusters 3": (
        *("tree.shapes.centroid", "tree.shapes.low", "tree.shapes.high", "tree.shapes.axis"),
        *("clusters.mean", "clusters.flux", "clusters.colour"),
    ),
    "<f8 clusters 2": ("tree.shapes.cone",),
    "<f8 clusters 3 3": ("clusters.normal_spread",),
}
_CELLS = {
    "<f8 3": ("frame.middle",),
    "<f4 3 cells+1": ("frame.edges",),
    "<f4 3 lights": ("half_balls.centres", "half_balls.normals", "half_balls.inverse_normals"),
    "<f4 lights": ("half_balls.radii_squared",),
    "<u4 blocks+1": ("lists.offsets",),
    "<u4 pairs": ("lists.light_ids",),
    "<u8 pairs": ("lists.masks",),
    "<u4 overflowing": ("occupancy.overflowing_cells",),
    "<u4 lights": ("occupancy.cells_dropped_from",),
}


def require_sound(grid: LightGrid, light_mesh: VirtualLightMesh) -> None:
    """Raises InvalidInput where arrays do not fit each other or the light mesh."""
    _require_shapes(grid, _COMMON, {}, "")
    _require(grid.light_count == len(light_mesh), "light_count")
    _require(1.0 <= grid.window_factor < math.inf, "window_factor")
    parts = (grid.static, grid.dynamic)
    for (name, chosen), part in zip(chosen_lights(light_mesh).items(), parts, strict=True):
        _require((part is not None) == chosen.any(), name)
        if isinstance(part, RangeGrid):
            _require(part.settings == grid.settings.of_range, f"{name}.settings")
            lists = part.lists
            lengths = {"lights": len(light_mesh), "cells": lists.cells_per_axis, "blocks": lists.blocks_per_axis**3}
            _require_shapes(part, _CELLS, lengths, f"{name}.")
            _require_cells(part, name)
        elif part is not None:
            _require_shapes(part, _TREE, {"lights": len(light_mesh)}, f"{name}.")
            _require(np.array_equal(part.tree.light_parent != ROOT, chosen), f"{name}.tree.light_parent")
            _require_links(part, name)


def _require_shapes(part: Any, layout: dict[str, tuple[str, ...]], lengths: dict[str, int], owner: str) -> None:
    """lengths: what words stand for; the first array with another word says what that one stands for."""
    for form, names in layout.items():
        dtype, *words = form.split()
        for name in names:
            array = _value(part, name)
            _require(isinstance(array, np.ndarray), owner + name)
            _require(array.dtype == np.dtype(dtype) and array.ndim == len(words), owner + name)
            for word, length in zip(words, array.shape, strict=True):
                key, _, more = word.partition("+")
                wanted = int(key) if key.isdigit() else lengths.setdefault(key, length - int(more or 0))
                _require(length == wanted + int(more or 0), owner + name)


def _value(part: Any, name: str) -> Any:
    for step in name.split("."):
        part = getattr(part, step)
    return part


def _require_cells(grid: RangeGrid, owner: str) -> None:
    lists, frame = grid.lists, grid.frame
    _require(grid.settings.grid == lists.cells_per_axis, f"{owner}.lists.cells_per_axis")
    _require(0.0 < frame.unit < np.inf and (np.diff(frame.edges) > 0.0).all(), f"{owner}.frame")
    _require_offsets(lists.offsets, len(lists.light_ids), f"{owner}.lists.offsets")
    _require((lists.light_ids < grid.light_count).all(), f"{owner}.lists.light_ids")


def _require_links(lit: LitTree, owner: str) -> None:
    """Each light and cluster is where its parent's offsets say, and parents come later: no walk goes in circles."""
    tree, rows = lit.tree, np.arange(len(lit.tree))
    inner = np.flatnonzero(tree.parent != ROOT)
    _require((inner == rows[: len(inner)]).all() and (tree.parent[inner] > inner).all(), f"{owner}.tree.parent")
    _require((tree.parent < len(tree)).all(), f"{owner}.tree.parent")
    _require_members(tree, owner)
    _require_offsets(tree.child_offsets, len(inner), f"{owner}.tree.child_offsets")
    of_children = np.repeat(rows, np.diff(tree.child_offsets))
    _require(np.array_equal(of_children, tree.parent[inner]), f"{owner}.tree.child_offsets")
    depth = np.zeros(len(tree), np.int64)
    depth[inner] = tree.depth[tree.parent[inner]] + 1
    _require(np.array_equal(depth, tree.depth) and (np.diff(depth) <= 0).all(), f"{owner}.tree.depth")


def _require_members(tree: LightTree, owner: str) -> None:
    inside = np.flatnonzero(tree.light_parent != ROOT)
    _require(np.array_equal(np.sort(tree.light_order), inside), f"{owner}.tree.light_order")
    _require_offsets(tree.light_offsets, len(inside), f"{owner}.tree.light_offsets")
    of_lights = np.repeat(np.arange(len(tree)), np.diff(tree.light_offsets))
    _require(np.array_equal(of_lights, tree.light_parent[tree.light_order]), f"{owner}.tree.light_offsets")


def _require_offsets(offsets: Any, total: int, name: str) -> None:
    signed = offsets.astype(np.int64)
    _require(signed[0] == 0 and signed[-1] == total and (np.diff(signed) >= 0).all(), name)


def _require(fits: Any, name: str) -> None:
    if not fits:
        raise InvalidInput("light grid", f"its {name} does not fit the rest", "bake the grid again")
