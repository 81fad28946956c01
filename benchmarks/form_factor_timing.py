# SPDX-License-Identifier: GPL-3.0-or-later
"""Nanoseconds per point and light of each form: many points sum the same lights in one loop, as phase two does."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import moderngl
import numpy as np

from benchmarks.form_factor_forms import FORMS, RATIONAL_FIT, Form, stored_with
from tests.render.rooms import split
from vlm_addon.core.scene import Float64
from vlm_addon.render.device import Device
from vlm_addon.render.gpu_layout import VIRTUAL_LIGHT

TILE_POINTS = 64
TILES = 32
# Each invocation reads a light once for so many points, or reading would cost more than the forms do.
HELD_POINTS = 4
GROUP_SIZE = 64
ROUNDS = 151
EMPTY_LOOP = "empty loop"
ROOM_M = np.array([6.0, 4.0, 3.0])
# (boxes around all points, times that each of their twelve triangles is split in four), then small lamps. Together
# with random normals a third of the pairs is cut by the horizon.
BOXES = ((7, 0), (2, 1))
LAMPS = 76
LAMP_SIZES_M = (0.02, 0.5)

_POINT_BINDING, _LIGHT_BINDING, _SUM_BINDING = 0, 1, 2
_SHADER = """
#include "gpu_layout/VirtualLight"
{include}
layout(local_size_x = {size}) in;
layout(std430, binding = {points}) readonly buffer Points {{ vec4 points[]; }};
layout(std430, binding = {lights}) readonly buffer Lights {{ VirtualLight lights[]; }};
layout(std430, binding = {sums}) writeonly buffer Sums {{ float sums[]; }};
uniform int light_count;
void main() {{
    uint first = {held}u * gl_GlobalInvocationID.x;
    vec3 held_points[{held}], held_normals[{held}];
    float held_sums[{held}];
    for (uint i = 0u; i < {held}u; ++i) {{
        held_points[i] = points[2u * (first + i)].xyz;
        held_normals[i] = points[2u * (first + i) + 1u].xyz;
        held_sums[i] = 0.0;
    }}
    for (int k = 0; k < light_count; ++k) {{
        VirtualLight light = lights[k];
        for (uint i = 0u; i < {held}u; ++i) {{
            vec3 p = held_points[i], n = held_normals[i];
            held_sums[i] += {call};
        }}
    }}
    for (uint i = 0u; i < {held}u; ++i) {{
        sums[first + i] = held_sums[i];
    }}
}}
"""
_CALL = "{}(p, n, light.v0, light.v1, light.v2, light.area_vector, light.bounding_radius)"
_EMPTY_CALL = "dot(light.v0 + light.v1 + light.v2 + light.area_vector, n) + light.bounding_radius"


@dataclass(frozen=True)
class Workload:
    """Points (p, 3) in tiles of TILE_POINTS neighbours, unit normals (p, 3) and lights (q, 3, 3), metres.

    clipped, hidden: shares of the pairs that the horizon cuts and that send nothing. nearest, farthest: 5th and 95th
    percentile of the distance in bounding radii.
    """

    points: Float64
    normals: Float64
    lights: Float64
    clipped: float
    hidden: float
    nearest: float
    farthest: float


@dataclass(frozen=True)
class Cost:
    """Nanoseconds per point and light.

    median, low, high: median and quartiles over the rounds, the loop included. net: median without what the empty loop
    of the same round took; ratio: of that to the reference form's, both of the same round, with its quartiles.
    """

    median: float
    low: float
    high: float
    net: float
    ratio: float
    ratio_low: float
    ratio_high: float


def room(random: np.random.Generator, tiles: int = TILES) -> Workload:
    """Tiles of points anywhere in a room with random normals, among its walls and lamps."""
    centres = random.uniform(0.1, 0.9, (tiles, 3)) * ROOM_M
    normals = np.repeat(_unit(random.normal(size=(tiles, 3))), TILE_POINTS, axis=0)
    offsets = random.uniform(-0.05, 0.05, (tiles * TILE_POINTS, 3))
    offsets -= normals * (offsets * normals).sum(axis=1, keepdims=True)
    points = np.repeat(centres, TILE_POINTS, axis=0) + offsets
    boxes = [split(_box(random.uniform(0.1, 2.0), ROOM_M), times) for count, times in BOXES for _ in range(count)]
    smallest, largest = np.log(LAMP_SIZES_M)
    size = np.exp(random.uniform(smallest, largest, (LAMPS, 1, 1)))
    lamps = random.uniform(0.0, 1.0, (LAMPS, 1, 3)) * ROOM_M + size * _unit(random.normal(size=(LAMPS, 3, 3)))
    lights = random.permutation(np.concatenate([*boxes, lamps]))
    return _described(points, normals, lights)


def _described(points: Float64, normals: Float64, lights: Float64) -> Workload:
    area_vectors, radii = stored_with(lights)
    heights = np.einsum("pc,qkc->pqk", normals, lights) - (normals * points).sum(axis=1)[:, None, None]
    in_front = np.einsum("qc,pqc->pq", area_vectors, points[:, None] - lights[None, :, 0]) > 0.0
    above = (heights > 0.0).sum(axis=2)
    shown = in_front & (above > 0)
    distances = np.linalg.norm(points[:, None] - lights.mean(axis=1), axis=2) / radii
    nearest, farthest = (float(distance) for distance in np.quantile(distances, (0.05, 0.95)))
    clipped, hidden = float((shown & (above < 3)).mean()), float((~shown).mean())
    return Workload(points, normals, lights, clipped, hidden, nearest, farthest)


def shuffled(workload: Workload, random: np.random.Generator) -> Workload:
    """The same points in an order in which neighbours have nothing in common."""
    order = random.permutation(len(workload.points))
    return replace(workload, points=workload.points[order], normals=workload.normals[order])


def measure(device: Device, workload: Workload, forms: Sequence[Form] = FORMS, rounds: int = ROUNDS) -> dict[str, Cost]:
    """Cost of each form by name, and of EMPTY_LOOP; the forms take turns, so that a busy machine burdens all alike.

    On a software renderer processor time of all threads, elsewhere wall clock. Ratios are to RATIONAL_FIT.
    """
    clock = time.process_time if device.is_software else time.perf_counter
    includes = {form.name: (f'#include "{form.path}"', _CALL.format(form.function)) for form in forms}
    seconds: dict[str, list[float]] = {}
    with device.current() as context:
        buffers = _upload(context, workload)
        shaders = {name: _shader(device, *text) for name, text in {EMPTY_LOOP: ("", _EMPTY_CALL), **includes}.items()}
        for _ in range(rounds + 1):
            for name, shader in shaders.items():
                shader["light_count"] = len(workload.lights)
                context.finish()
                start = clock()
                shader.run(len(workload.points) // (HELD_POINTS * GROUP_SIZE))
                context.finish()
                seconds.setdefault(name, []).append(clock() - start)
        del buffers
    pairs = len(workload.points) * len(workload.lights)
    # The first round compiles.
    nanoseconds = {name: 1e9 * np.array(values[1:]) / pairs for name, values in seconds.items()}
    empty, reference = nanoseconds[EMPTY_LOOP], nanoseconds[RATIONAL_FIT]
    return {name: _cost(values, empty, reference) for name, values in nanoseconds.items()}


def _cost(nanoseconds: Float64, empty: Float64, reference: Float64) -> Cost:
    low, median, high = (float(value) for value in np.quantile(nanoseconds, (0.25, 0.5, 0.75)))
    ratios = (nanoseconds - empty) / (reference - empty)
    ratio_low, ratio, ratio_high = (float(value) for value in np.quantile(ratios, (0.25, 0.5, 0.75)))
    return Cost(median, low, high, float(np.median(nanoseconds - empty)), ratio, ratio_low, ratio_high)


def _shader(device: Device, include: str, call: str) -> moderngl.ComputeShader:
    bindings = {"points": _POINT_BINDING, "lights": _LIGHT_BINDING, "sums": _SUM_BINDING}
    text = _SHADER.format(include=include, call=call, size=GROUP_SIZE, held=HELD_POINTS, **bindings)
    return device.shaders.compute_from_text(text, "form factor timing")


def _upload(context: moderngl.Context, workload: Workload) -> list[moderngl.Buffer]:
    points = np.zeros((len(workload.points), 2, 4), np.float32)
    points[:, 0, :3], points[:, 1, :3] = workload.points, workload.normals
    lights = VIRTUAL_LIGHT.zeros(len(workload.lights))
    for i in range(3):
        lights[f"v{i}"] = workload.lights[:, i]
    lights["area_vector"], lights["bounding_radius"] = stored_with(workload.lights)
    buffers = [context.buffer(array.tobytes()) for array in (points, lights)]
    buffers.append(context.buffer(reserve=4 * len(points)))
    for binding, buffer in zip((_POINT_BINDING, _LIGHT_BINDING, _SUM_BINDING), buffers, strict=True):
        buffer.bind_to_storage_buffer(binding)
    return buffers


def _unit(vectors: Float64) -> Float64:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _box(margin: float, size: Float64) -> Float64:
    """(12, 3, 3): the sides, facing inwards, of a box from -margin to size + margin."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (size + 2.0 * margin) - margin
    quads = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    triangles = corners[np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])]
    outward = (stored_with(triangles)[0] * (triangles.mean(axis=1) - 0.5 * size)).sum(axis=1) > 0.0
    return np.where(outward[:, None, None], triangles[:, ::-1], triangles)
