# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a stroke's point goes: the surface under the mouse, drawn to vertices of lights and to features of meshes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ...core.scene import Float64
from .draw_surfaces import SurfaceHit, hits_along
from .draw_view import View

SNAP_PIXELS = 12.0
DEPTH_IN_RADII = 20.0
"""A light's vertex may lie so many snapping radii off the surface: lights under hollow surfaces lie deep."""
ON_FACE = 1e-3


@dataclass(frozen=True)
class Place:
    """A point of a stroke. location: (3,) world, m. normal: (3,) unit, towards the eye. pixel: (2,) in the region.
    ring: (k, 3) corners of the face under it, none where they are not known. what: it was drawn to, "" for nothing.
    """

    location: Float64
    normal: Float64
    pixel: Float64
    ring: Float64
    what: str = ""


def place_under(
    scene: Any, depsgraph: Any, view: View, pixel: Float64, light_vertices: Float64, snap: bool
) -> Place | None:
    """What a click at `pixel` means, None where no surface shows. light_vertices: (n, 3) world."""
    origin, direction, length = view.ray(pixel)
    hit = next(hits_along(scene, depsgraph, origin, direction, length), None)
    if hit is None:
        return None
    ring = _ring(hit, depsgraph)
    normal = hit.normal if hit.normal @ direction <= 0.0 else -hit.normal
    location, what = _snapped(view, pixel, hit.location, ring, light_vertices) if snap else (hit.location, "")
    return Place(location, normal, pixel, ring, what)


def nearest_edge(view: View, pixel: Float64, edges: Float64, within: float) -> Float64 | None:
    """(2, 3): of (n, 2, 3) edges the one that shows nearest to the pixel, within so many pixels."""
    if not len(edges):
        return None
    starts, ends = view.pixels(edges[:, 0]), view.pixels(edges[:, 1])
    ways = ends - starts
    squared = (ways**2).sum(axis=1)
    shares = np.clip(np.einsum("ij,ij->i", pixel - starts, ways) / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    distances = np.linalg.norm(starts + shares[:, None] * ways - pixel, axis=1)
    distances = np.where(np.isnan(distances), np.inf, distances)
    best = int(np.argmin(distances))
    return edges[best] if distances[best] <= within else None


def _snapped(view: View, pixel: Float64, location: Float64, ring: Float64, lights: Float64) -> tuple[Float64, str]:
    radius = SNAP_PIXELS * view.metres_per_pixel(location)
    near = lights[((lights - location) ** 2).sum(axis=1) < (DEPTH_IN_RADII * radius) ** 2]
    for points, what in ((near, "light vertex"), (ring, "vertex")):
        found = _closest(view, pixel, points)
        if found is not None:
            return found, what
    if len(ring):
        found = _closest(view, pixel, _feet(location, ring))
        if found is not None:
            return found, "edge"
    return location, ""


def _closest(view: View, pixel: Float64, points: Float64) -> Float64 | None:
    """Of (n, 3) points the one that shows nearest to the pixel, within SNAP_PIXELS."""
    if not len(points):
        return None
    distances = np.linalg.norm(view.pixels(points) - pixel, axis=1)
    if np.isnan(distances).all():
        return None
    best = int(np.nanargmin(distances))
    return points[best] if distances[best] <= SNAP_PIXELS else None


def _feet(point: Float64, ring: Float64) -> Float64:
    """(k, 3): the nearest point of each edge of a polygon."""
    ways = np.roll(ring, -1, axis=0) - ring
    squared = (ways**2).sum(axis=1)
    shares = np.einsum("ij,ij->i", point - ring, ways) / np.where(squared > 0.0, squared, 1.0)
    feet: Float64 = ring + np.clip(shares, 0.0, 1.0)[:, None] * ways
    return feet


def _ring(hit: SurfaceHit, depsgraph: Any) -> Float64:
    """(k, 3) world corners of the face that was hit; (0, 3) where Blender does not tell the mesh."""
    nothing = np.zeros((0, 3))
    original = bpy.data.objects.get(hit.key)
    if original is None or original.type != "MESH":
        return nothing
    mesh = original.evaluated_get(depsgraph).data
    if hit.face >= len(mesh.polygons):
        return nothing
    corners = np.array([mesh.vertices[vertex].co for vertex in mesh.polygons[hit.face].vertices], np.float64)
    ring: Float64 = corners @ hit.matrix[:3, :3].T + hit.matrix[:3, 3]
    middle = ring.mean(axis=0)
    # Of instances that geometry nodes make, Blender names the owner: its own faces are elsewhere.
    size = float(np.ptp(ring, axis=0).max())
    off = abs(float((hit.location - middle) @ hit.normal))
    return ring if off <= ON_FACE * size and np.linalg.norm(hit.location - middle) <= 2.0 * size else nothing
