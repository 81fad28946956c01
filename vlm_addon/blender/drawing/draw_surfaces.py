# SPDX-License-Identifier: GPL-3.0-or-later
"""The visible surfaces under the mouse and under drawn lights, by rays through Blender's own trees.

Light meshes and what is disabled in renders are passed. Instances and linked objects are met like all others; nothing
is changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mathutils import Vector

from ...core.scene import Float64
from ..names import is_light_mesh

MOST_PASSED = 16
"""Surfaces that one ray passes before it gives up."""

STEP_SHARE = 1e-6
"""How far beyond a surface, as a share of the ray's way and of its coordinates, a ray goes on; float32 has 6e-8."""

FACING_COSINE = 0.2
"""Cosine between two normals from which surfaces face alike."""


@dataclass(frozen=True)
class SurfaceHit:
    """Where a ray met a visible surface.

    location: (3,) float64, m, world. normal: (3,) unit, of the triangle's front. distance: m along the ray. key: name
    of the object and path of its library, by which `bpy.data.objects` finds it. face: of its evaluated mesh. matrix:
    (4, 4) float64 that places it, which for an instance is not the object's own.
    """

    location: Float64
    normal: Float64
    distance: float
    key: tuple[str, str | None]
    face: int
    matrix: Float64


def hits_along(scene: Any, depsgraph: Any, origin: Float64, direction: Float64, reach: float) -> Iterator[SurfaceHit]:
    """The visible surfaces that a ray meets, from near to far; direction: (3,) unit; reach: m."""
    for met in _met(scene, depsgraph, origin, direction, reach):
        yield _hit(met)


def surface_under(
    scene: Any, depsgraph: Any, point: Float64, normal: Float64, reach: float, sign: float = 1.0
) -> SurfaceHit | None:
    """The surface nearest to `point` on the line along `normal`, within `reach` of it, that faces as `normal` does.

    sign: -1 for one that faces the other way. None where there is none.
    """
    best, least = None, np.inf
    front = Vector(sign * normal)
    for met in _met(scene, depsgraph, point + reach * normal, -normal, 2.0 * reach):
        gap = abs(met.distance - reach)
        if gap > least:
            break
        if met.normal.dot(front) > FACING_COSINE:
            best, least = met, gap
    return None if best is None else _hit(best)


class _Met(NamedTuple):
    """What Blender says of a hit; conversion to arrays takes longer than the ray."""

    distance: float
    location: Any
    normal: Any
    face: int
    thing: Any
    matrix: Any


def _met(scene: Any, depsgraph: Any, origin: Float64, direction: Float64, reach: float) -> Iterator[_Met]:
    travelled = 0.0
    start, way = Vector(origin), Vector(direction)
    here = start
    for _ in range(MOST_PASSED):
        found, location, normal, face, thing, matrix = scene.ray_cast(depsgraph, here, way, distance=reach - travelled)
        if not found:
            return
        travelled = max((location - start).dot(way), travelled)
        if not (is_light_mesh(thing) or thing.hide_render):
            yield _Met(travelled, location, normal, face, thing, matrix)
        travelled += STEP_SHARE * max(travelled, max(map(abs, location)), 1.0)
        if travelled >= reach:
            return
        here = Vector(origin + travelled * direction)


def _hit(met: _Met) -> SurfaceHit:
    normal = np.array(met.normal, np.float64)
    length = float(np.linalg.norm(normal))
    return SurfaceHit(
        location=np.array(met.location, np.float64),
        normal=normal / length if length > 0.0 else normal,
        distance=met.distance,
        key=_key(met.thing),
        face=met.face,
        matrix=np.array(met.matrix, np.float64),
    )


def _key(thing: Any) -> tuple[str, str | None]:
    library = thing.original.library if thing.is_evaluated else thing.library
    return thing.name, None if library is None else library.filepath
