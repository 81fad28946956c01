# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments through an octree on the device."""

from __future__ import annotations

import numpy as np

from tests.render.shader_functions import evaluate
from vlm_addon.render.growing_buffer import GrowingBuffer
from vlm_addon.render.passes.voxelize import VoxelizePass

PATH = "lib/octree.glsl"
BINDING = 2
DEFINES = {"OCTREE_BINDING": BINDING}


def build(device, places, depth):
    """The octree of triangles in voxel coordinates, bound as long as the first of what is returned lives; and the same
    on the host."""
    with device.current() as context:
        tree = VoxelizePass(context, device.shaders).build(places, depth, GrowingBuffer(context, "octree"))
        tree.buffer.bind_to_storage_buffer(BINDING)
        return tree, tree.read()


def bind(device, buffer):
    with device.current():
        buffer.bind_to_storage_buffer(BINDING)


def ask(device, expression, inputs, components=1):
    """`expression` of lib/octree.glsl for each row, with the octree that is bound."""
    return evaluate(device, PATH, expression, inputs, components, defines=DEFINES)


def clear_on_device(device, starts, ends, at_once=1 << 17):
    """(n,) whether segments in voxel coordinates, float32, meet no occupied voxel."""
    parts = [
        ask(device, "float(octree_clear(a, b))", {"a": starts[i : i + at_once], "b": ends[i : i + at_once]}) > 0.5
        for i in range(0, len(starts), at_once)
    ]
    return np.concatenate(parts)
