# SPDX-License-Identifier: GPL-3.0-or-later
"""More and smaller virtual lights, for where one light per triangle of the surface is too coarse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .errors import InvalidInput
from .light_mesh import SourceSamples, VirtualLightMesh
from .mesh_topology import Int64
from .sampling import sample_counts, square_to_triangle, unit_square_points
from .scene import Float64

# Below this cosine between a light and its source surface a point is not moved along the light's normal.
STEEPEST_COSINE = 0.1
# What black lights count as, so that they are halved at last.
LEAST_BRIGHTNESS = 1e-3


def subdivide_light_mesh(
    light_mesh: VirtualLightMesh, target: int, samples_per_light: int = 16, even_power: float = 0.0
) -> VirtualLightMesh:
    """`light_mesh` with its largest lights halved at their longest edge until there are `target` lights.

    even_power: what is large: from 0, the area, to 1, the power that a light sends out under unit irradiance (emitters
    count as white at their mean).

    Lights are independent, so an edge may be halved on one side only. Colour, emission, strength, tag and motion are
    those of the parent, so power is unchanged. Each half is sampled anew: points of the half, moved along its normal
    onto the tangent plane of the parent's nearest sample. A mesh that has `target` lights or more is returned as it
    is. Raises InvalidInput for a target or sample count below 1.
    """
    if target < 1 or samples_per_light < 1:
        raise InvalidInput("subdivision", f"{target} lights, {samples_per_light} samples", "ask for at least 1 of each")
    if not len(light_mesh) or len(light_mesh) >= target:
        return light_mesh
    corners, parent = _halved(light_mesh.corners, _brightness(light_mesh) ** even_power, target)
    vertices, triangles = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return replace(
        light_mesh,
        vertices=vertices,
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        colour=light_mesh.colour[parent],
        emission=light_mesh.emission[parent],
        strength=light_mesh.strength[parent],
        tag_ids=light_mesh.tag_ids[parent],
        dynamic=light_mesh.dynamic[parent],
        samples=_resampled(corners, parent, light_mesh.samples, samples_per_light),
    )


def _brightness(light_mesh: VirtualLightMesh) -> Float64:
    """(n,) of each light, more than 0."""
    emission = light_mesh.emission.mean(axis=1, dtype=np.float64)
    shining = emission > 0
    mean = float(emission[shining].mean()) if shining.any() else 1.0
    brightness = light_mesh.colour.mean(axis=1, dtype=np.float64) + np.minimum(emission / mean, 1.0)
    return np.maximum(light_mesh.strength * brightness, LEAST_BRIGHTNESS)


def _halved(corners: Float64, brightness: Float64, target: int) -> tuple[Float64, Int64]:
    """(corners of `target` triangles, parent of each); in rounds that halve all within a factor two of the largest,
    by area times the brightness of the parent."""
    parent = np.arange(len(corners))
    while len(corners) < target:
        doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        doubled *= brightness[parent]
        order = np.argsort(-doubled, kind="stable")
        large = int((doubled > 0.5 * doubled.max()).sum())
        chosen = order[: max(1, min(large, target - len(corners)))]
        first, second = _halves(corners[chosen])
        corners = corners.copy()
        corners[chosen] = first
        corners, parent = np.concatenate([corners, second]), np.concatenate([parent, parent[chosen]])
    order = np.argsort(parent, kind="stable")
    return corners[order], parent[order]


def _halves(corners: Float64) -> tuple[Float64, Float64]:
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    turn = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(corners, turn[:, :, None], axis=1)
    a, b, c = np.moveaxis(turned, 1, 0)
    middle = 0.5 * (a + b)
    return np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)


def _resampled(corners: Float64, parent: Int64, samples: SourceSamples, samples_per_light: int) -> SourceSamples:
    area_vector = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(area_vector, axis=1)
    unit = area_vector / np.where(doubled > 0, doubled, 1.0)[:, None]
    counts = sample_counts(0.5 * doubled, samples_per_light)
    light = np.repeat(np.arange(len(corners)), counts)
    offsets = np.concatenate([[0], np.cumsum(counts)])
    index = np.arange(len(light)) - offsets[light]
    x, y = unit_square_points(index, counts[light], light)
    points = np.einsum("ik,ikj->ij", square_to_triangle(x, y), corners[light])
    normals = unit[light].copy()
    for row in range(len(corners)):
        own = slice(offsets[row], offsets[row + 1])
        source = slice(*samples.offsets[parent[row] : parent[row] + 2])
        if source.stop > source.start:
            points[own], normals[own] = _onto_source(
                points[own], unit[row], samples.positions[source], samples.normals[source].astype(np.float64)
            )
    weights = (1.0 / counts[light]).astype(np.float32)
    return SourceSamples(points, normals.astype(np.float32), weights, offsets.astype(np.int32))


def _onto_source(points: Float64, along: Float64, positions: Float64, normals: Float64) -> tuple[Float64, Float64]:
    """`points` moved along the direction `along` onto the plane of the nearest sample, and that sample's normal."""
    distance = np.linalg.norm(points[:, None] - positions, axis=2)
    nearest = distance.argmin(axis=1)
    normal = normals[nearest]
    cosine = normal @ along
    height = np.einsum("ij,ij->i", positions[nearest] - points, normal)
    steep = cosine < STEEPEST_COSINE
    move = np.where(steep, (positions[nearest] - points) @ along, height / np.where(steep, 1.0, cosine))
    return points + move[:, None] * along, normal
