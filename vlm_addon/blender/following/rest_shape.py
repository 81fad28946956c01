# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape at rest from which modifiers and shape keys make a given shape: Newton's method, Blender evaluates.

A light mesh is made for the frame that is shown; what moves it starts from a rest pose. Modifiers that deform move each
vertex by itself, so three more evaluations give every vertex's 3 x 3 derivative, whatever the modifiers are. Skinning
is linear in the vertex, and one step solves it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.scene import Float64
from ..extraction.mesh_arrays import read

STEPS = 6
PROBE_SHARE = 1e-2
"""Step of the finite differences, share of the diagonal."""
ROUNDING_SHARE = 1e-6
"""Share of the diagonal that counts as met: some units in the last place of float32."""


def set_shape(thing: Any, positions: Float64) -> None:
    """Move the vertices to `positions`, (v, 3) in the object's space; shape keys keep how far they move each vertex."""
    keys = thing.data.shape_keys
    if keys is not None:
        basis = _key_positions(keys.reference_key)
        for block in keys.key_blocks:
            moved = positions + (_key_positions(block) - basis)
            block.data.foreach_set("co", np.ascontiguousarray(moved, np.float32).ravel())
    thing.data.vertices.foreach_set("co", np.ascontiguousarray(positions, np.float32).ravel())
    thing.data.update()


def shape(thing: Any) -> Float64:
    """(v, 3) float64: vertices of the object as stored (its basis)."""
    return read(thing.data.vertices, "co", np.float32, 3).reshape(-1, 3).astype(np.float64)


def evaluated_shape(thing: Any, context: Any) -> Float64:
    """(v, 3) float64: vertices of the object as its modifiers and shape keys move them, in its own space."""
    evaluated = thing.evaluated_get(context.evaluated_depsgraph_get())
    return read(evaluated.data.vertices, "co", np.float32, 3).reshape(-1, 3).astype(np.float64)


def find_rest(thing: Any, wanted: Float64, context: Any) -> float:
    """Set the shape at rest from which the object takes the shape `wanted`, (v, 3) in its space, at this frame.

    Returns how far the farthest vertex is off it (m in that space). Where modifiers do nothing it is float32 rounding.
    """
    diagonal = float(np.linalg.norm(np.ptp(wanted, axis=0))) or 1.0
    rest = wanted.copy()
    best, off = rest, np.inf
    for _ in range(STEPS):
        set_shape(thing, rest)
        error = wanted - evaluated_shape(thing, context)
        farthest = float(np.linalg.norm(error, axis=1).max(initial=0.0))
        if farthest < off:
            best, off = rest, farthest
        if farthest <= ROUNDING_SHARE * diagonal:
            break
        rest = rest + _solve(_derivative(thing, rest, wanted - error, PROBE_SHARE * diagonal, context), error)
    set_shape(thing, best)
    return off


def _derivative(thing: Any, rest: Float64, moved: Float64, probe: float, context: Any) -> Float64:
    """(v, 3, 3): how the evaluated vertices follow those at rest."""
    columns = []
    for axis in range(3):
        set_shape(thing, rest + probe * np.eye(3)[axis])
        columns.append((evaluated_shape(thing, context) - moved) / probe)
    return np.stack(columns, axis=2)


def _solve(matrices: Float64, vectors: Float64) -> Float64:
    """Least-squares solutions (v, 3), also where a matrix (v, 3, 3) flattens space."""
    return np.asarray(np.einsum("vij,vj->vi", np.linalg.pinv(matrices), vectors))


def _key_positions(block: Any) -> Float64:
    return read(block.data, "co", np.float32, 3).reshape(-1, 3).astype(np.float64)
