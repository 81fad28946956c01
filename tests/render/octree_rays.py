# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments through an octree on the device."""

from __future__ import annotations

import numpy as np

from tests.render.shader_functions import evaluate
from vlm_addon.render.growing_buffer import GrowingBuffer
from vlm_addon.render.passes.voxelize import VoxelizePass

PATH = "lib/octree.glsl"
EXACT_PATH = "lib/octree_triangles.glsl"
BINDING, TRIANGLE_BINDING = 2, 3
DEFINES = {"OCTREE_BINDING": BINDING}
EXACT_DEFINES = {**DEFINES, "OCTREE_TRIANGLE_BINDING": TRIANGLE_BINDING}


def build(device, places, depth):
    """The octree of triangles in voxel coordinates, bound as long as the first of what is returned lives; and the same
    on the host."""
    with device.current() as context:
        tree = VoxelizePass(context, device.shaders).build(places, depth, GrowingBuffer(context, "octree"))
        tree.buffer.bind_to_storage_buffer(BINDING)
        return tree, tree.read()


def build_exact(device, shapes, depth, reflectance=None):
    """The octrees of one or two arrays of triangles with the triangles of their bricks, bound as long as what is
    returned lives; trees, lists and the two buffers."""
    with device.current() as context:
        builder, built = VoxelizePass(context, device.shaders), []
        for shape in shapes:
            colours = np.zeros((len(shape), 3), np.float32) if reflectance is None else reflectance[len(built)]
            targets = (GrowingBuffer(context, name) for name in ("octree", "triangles"))
            built.append(builder.build_with_lists(shape, colours, depth, *targets))
        trees, lists = zip(*built, strict=True)
        buffers = (
            builder.join(trees, GrowingBuffer(context, "octree")),
            builder.join_lists(lists, GrowingBuffer(context, "triangles")),
        )
        for binding, buffer in zip((BINDING, TRIANGLE_BINDING), buffers, strict=True):
            buffer.bind_to_storage_buffer(binding)
        return trees, lists, buffers


def ask_exact(device, expression, inputs, components=1, preamble=""):
    """`expression` of lib/octree_triangles.glsl for each row, with the octree and the triangles that are bound."""
    return evaluate(device, EXACT_PATH, expression, inputs, components, preamble, EXACT_DEFINES)


def bind(device, buffer):
    with device.current():
        buffer.bind_to_storage_buffer(BINDING)


def ask(device, expression, inputs, components=1, preamble=""):
    """`expression` of lib/octree.glsl for each row, with the octree that is bound."""
    return evaluate(device, PATH, expression, inputs, components, preamble, DEFINES)


def clear_on_device(device, starts, ends, at_once=1 << 17):
    """(n,) whether segments in voxel coordinates, float32, meet no occupied voxel."""
    parts = [
        ask(device, "float(octree_clear(a, b))", {"a": starts[i : i + at_once], "b": ends[i : i + at_once]}) > 0.5
        for i in range(0, len(starts), at_once)
    ]
    return np.concatenate(parts)
