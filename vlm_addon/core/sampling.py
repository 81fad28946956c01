# SPDX-License-Identifier: GPL-3.0-or-later
"""Points on the source surface of each virtual light, where phase one measures irradiance (house.md, Definitions).

A light's samples are a lattice of equal weights: one coordinate runs through the area of its source triangles
in spatial order, so every part of the region gets its share to within one sample; the other spreads the points
across a triangle. Normals are the geometric normals of the source triangles, because with them the sum of area times
irradiance is the flux that the surface truly receives, and no sample looks behind its own triangle.
"""

from __future__ import annotations

import numpy as np

from .corner_arrays import middles
from .light_mesh import SourceSamples
from .mesh_topology import Int64, Rows, sorted_with_order
from .morton import BITS_PER_AXIS, morton_codes
from .scene import Float64

MINIMUM_SAMPLES = 4
MAXIMUM_SAMPLES = 256
GOLDEN_RATIO = 0.6180339887498949


def sample_counts(areas: Float64, samples_per_light: int) -> Int64:
    """(n,) int64: samples of each light, in proportion to area: `samples_per_light` at the median area.

    At least MINIMUM_SAMPLES and at most MAXIMUM_SAMPLES (or samples_per_light where that lies outside of the two).
    """
    positive = areas[areas > 0]
    if not len(positive):
        return np.full(len(areas), min(MINIMUM_SAMPLES, samples_per_light), np.int64)
    wanted = np.ceil(samples_per_light * areas / np.median(positive) - 1e-9)
    low, high = min(MINIMUM_SAMPLES, samples_per_light), max(MAXIMUM_SAMPLES, samples_per_light)
    return np.clip(wanted, low, high).astype(np.int64)


def square_to_triangle(x: Float64, y: Float64) -> Float64:
    """(n, 3) barycentric coordinates of points of the unit square; keeps area, bends little (Heitz 2019)."""
    above = y > x
    u = np.where(above, 0.5 * x, x - 0.5 * y)
    v = np.where(above, y - 0.5 * x, 0.5 * y)
    return np.stack([u, v, 1.0 - u - v], axis=-1)


def unit_square_points(index: Int64, counts: Int64, group: Int64) -> tuple[Float64, Float64]:
    """(x, y), each (n,) in [0, 1): point `index` of the `counts` points of a group.

    A rank-1 lattice: x = (i + 1/2) / n, y = i times the golden ratio, so that any run of points is even too, shifted
    from group to group by the same ratio (Cranley and Patterson 1976).
    """
    return (index + 0.5) / counts, (GOLDEN_RATIO * (index + group + 0.5)) % 1.0


def sample_regions(corners: Float64, regions: Rows, counts: Int64) -> SourceSamples:
    """`counts` stratified points on the region of each light.

    corners: (t, 3, 3) source triangles, m. regions: the source triangles of each light. counts: (n,) at least 1. A
    light without a region, or with one of zero area, gets its samples spread over the triangles it has, or none.
    """
    member, owner = _spatial_order(corners, regions)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_area = np.linalg.norm(normal, axis=1)
    weight = double_area[member]
    total = np.bincount(owner, weights=weight, minlength=len(counts))
    weight = np.where(total[owner] > 0, weight, 1.0)
    counts = np.where(regions.lengths > 0, counts, 0)
    cumulative = np.concatenate([[0.0], np.cumsum(weight)])
    base = cumulative[regions.starts]
    light = np.repeat(np.arange(len(counts)), counts)
    index = np.arange(len(light)) - np.repeat(np.cumsum(counts) - counts, counts)
    along, across = unit_square_points(index, counts[light], light)
    at = base[light] + along * (base[light + 1] - base[light])
    slot = np.searchsorted(cumulative, at, side="right") - 1
    slot = np.clip(slot, regions.starts[light], regions.starts[light + 1] - 1)
    x = np.clip((at - cumulative[slot]) / np.maximum(weight[slot], np.finfo(float).tiny), 0.0, 1.0)
    triangle = member[slot]
    positions = np.einsum("ik,ikj->ij", square_to_triangle(x, across), corners[triangle])
    unit = normal[triangle] / np.maximum(double_area[triangle], np.finfo(float).tiny)[:, None]
    return SourceSamples(
        positions=positions,
        normals=unit.astype(np.float32),
        weights=(1.0 / counts[light]).astype(np.float32),
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
    )


def _spatial_order(corners: Float64, regions: Rows) -> tuple[Int64, Int64]:
    """Members of the regions, each region along the Z-order curve, and the light of each member."""
    owner = np.repeat(np.arange(len(regions.starts) - 1), regions.lengths)
    along = sorted_with_order(morton_codes(middles(corners)), 1 << 3 * BITS_PER_AXIS)[1]
    rank = np.empty(len(along), np.int64)
    rank[along] = np.arange(len(along))
    bits = len(along).bit_length()
    # Light and place on the curve in one number.
    packed = np.sort((owner << bits) | rank[regions.values])
    return along[packed & ((1 << bits) - 1)], owner
