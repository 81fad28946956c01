# SPDX-License-Identifier: GPL-3.0-or-later
"""A room with a plate in it, points on its surfaces as pixels, and what they get of its lights by brute force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tests.render.closed_rooms import inward_box
from tests.render.pixels import Pixels
from tests.render.rooms import lights_from_triangles, quad, split
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh
from vlm_addon.core.scene import Float32, Float64, Mesh, SceneSnapshot

SIDE = 2.0
_BARYCENTRIC = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6.0


def room(with_plate: bool = True) -> SceneSnapshot:
    """Walls around the middle, and a plate of two sides off it."""
    walls = inward_box([-1, -1, -1], [1, 1, 1], [0] * 6)
    plate = [quad((-0.8, -0.7, -0.1), (1.5, 0, 0), (0, 1.5, 0)), quad((-0.8, -0.7, -0.12), (0, 1.5, 0), (1.5, 0, 0))]
    return SceneSnapshot("room", tuple(walls + plate if with_plate else walls))


def corners_of(meshes: Sequence[Mesh]) -> Float64:
    """(t, 3, 3) of all triangles."""
    return np.concatenate([mesh.positions[mesh.triangles] for mesh in meshes])


def wall_lights(times: int) -> VirtualLightMesh:
    """12 x 4^times lights on the walls, each with four source samples."""
    lights = lights_from_triangles(split(corners_of(room(False).meshes), times))
    count = len(lights)
    positions = np.einsum("sk,nkj->nsj", _BARYCENTRIC, lights.corners).reshape(-1, 3)
    normals = np.repeat(lights.samples.normals, len(_BARYCENTRIC), axis=0)
    weights = np.full(len(positions), 1.0 / len(_BARYCENTRIC), np.float32)
    offsets = (len(_BARYCENTRIC) * np.arange(count + 1)).astype(np.int32)
    return replace(lights, samples=SourceSamples(positions, normals, weights, offsets))


def surface_pixels(snapshot: SceneSnapshot, size: tuple[int, int], seed: int = 0) -> Pixels:
    """Points anywhere on the triangles by area, one a pixel."""
    generator = np.random.default_rng(seed)
    pixels = Pixels(generator, size)
    corners = corners_of(snapshot.meshes)
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(doubled, axis=1)
    rows = generator.choice(len(corners), pixels.shown.size, p=areas / areas.sum())
    shares = generator.dirichlet((1.0, 1.0, 1.0), pixels.shown.size)
    places = np.einsum("pk,pkj->pj", shares, corners[rows])
    pixels.positions = places.reshape(*pixels.shown.shape, 3).astype(np.float32)
    pixels.normals = (doubled[rows] / areas[rows, None]).reshape(pixels.positions.shape).astype(np.float32)
    pixels.shown[...] = True
    pixels.tag_ids[...] = 0
    return pixels


def blocked(corners: Float64, starts: Float64, ends: Float64) -> np.ndarray:
    """(n,) whether a segment meets the inside of a triangle, not at its own ends (Moeller and Trumbore 1997)."""
    found = np.zeros(len(starts), bool)
    way = ends - starts
    for a, b, c in corners:
        p = np.cross(way, c - a)
        determinant = p @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", starts - a, p) / determinant
            q = np.cross(starts - a, b - a)
            v, t = np.einsum("ij,ij->i", way, q) / determinant, q @ (c - a) / determinant
            found |= (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 1e-4) & (t < 1.0 - 1e-4)
    return found


def seen_shares(snapshot: SceneSnapshot, lights: VirtualLightMesh, points: Float64, normals: Float64) -> Float64:
    """(p, n) share of each light that gets to each point: of its samples, each by weight and geometry term."""
    samples, owner = lights.samples, np.repeat(np.arange(len(lights)), np.diff(lights.samples.offsets))
    way = samples.positions[None] - points[:, None]
    squared = (way**2).sum(axis=2)
    cosines = np.maximum(np.einsum("psj,pj->ps", way, normals), 0.0)
    cosines = cosines * np.maximum(-np.einsum("psj,sj->ps", way, samples.normals.astype(float)), 0.0)
    gives = samples.weights * cosines / np.maximum(squared, 1e-18) ** 2
    starts = np.repeat(points, len(owner), axis=0)
    seen = ~blocked(corners_of(snapshot.meshes), starts, np.tile(samples.positions, (len(points), 1)))
    seen = seen.reshape(gives.shape)
    sums = [np.stack([np.bincount(owner, row, len(lights)) for row in rows]) for rows in (gives * seen, gives)]
    return np.asarray(sums[0] / np.maximum(sums[1], 1e-30))


def occluded_sum(
    snapshot: SceneSnapshot, pixels: Pixels, lights: VirtualLightMesh, radiosity: Float32
) -> tuple[Float64, Float64]:
    """(h, w, 3) W/m² that gets to each pixel, and what would if nothing stood in the way."""
    points, normals = pixels.flat()
    factors = polygon_form_factor(points, normals, lights.corners)
    shares = seen_shares(snapshot, lights, points, normals)
    sums = [values @ radiosity.astype(float) for values in (factors * shares, factors)]
    shape = (*pixels.shown.shape, 3)
    return sums[0].reshape(shape), sums[1].reshape(shape)
