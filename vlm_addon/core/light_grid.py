# SPDX-License-Identifier: GPL-3.0-or-later
"""The light grid in range mode: for each cell, the lights whose active hemisphere reaches it (seed 002, chapter 4).

Lists depend on where lights are, not on how bright: relighting leaves a grid as it is. Static and dynamic lights go
into grids of their own. Tags are no matter of the grid either: whoever shades with a candidate leaves it out where
the surface has its tag.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import LARGEST, HalfBalls, make_half_balls, on_steps, overlaps
from .array_codec import content_hash
from .cell_limit import Occupancy, limited
from .cell_lists import MAX_CELLS_PER_AXIS, CellLists, build_cell_lists, expand, gather, lists_from_counts
from .errors import InvalidInput
from .light_mesh import VirtualLightMesh, require_valid
from .progress import Progress, silent
from .scene import Float32, Float64
from .settings import setting

Bounds = tuple[npt.ArrayLike, npt.ArrayLike]
OUTSIDE = -1

# A flat scene still gets cells of some thickness: this share of its largest extent.
_LEAST_EXTENT = 1e-2


@dataclass(frozen=True)
class GridSettings:
    """Settings of a light grid in range mode."""

    grid: int = setting(
        50, "cells", 1, MAX_CELLS_PER_AXIS, "Cells along each side of the scene's box", source="002, 4.1"
    )
    range: float = setting(
        4.0, "radii", 0.0, 1e6, "How far a light reaches, in distances of its farthest corner", source="002, 4.2"
    )
    max_lights: int = setting(
        0, "lights", 0, 1_000_000, "Most lights a cell holds; 0 for as many as reach it", source="002, 4.1"
    )


@dataclass(frozen=True)
class GridFrame:
    """Where a grid lies. middle: (3,) float64, m. unit: m, a power of two. edges: (3, n + 1) float32, faces of cells.

    A point p of the world is (p - middle) / unit in the frame, where the grid is within -1/2 to 1/2.
    """

    middle: Float64
    unit: float
    edges: Float32

    @property
    def cells_per_axis(self) -> int:
        """n of the n x n x n cells."""
        return self.edges.shape[1] - 1

    def local(self, points: Float64) -> Float64:
        """(p, 3) points of the world in the frame."""
        return np.asarray((points - self.middle) / self.unit)

    def cells(self, points: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """(p,) int64 index of the cell that holds each of (p, 3) points, OUTSIDE for those outside all cells.

        A point on a face between cells is in the upper one. Raises InvalidInput for points that are not finite.
        """
        local = self.local(_finite_points(points)).astype(np.float32)
        inside = ((local >= self.edges[:, 0]) & (local <= self.edges[:, -1])).all(axis=1)
        per_axis = self.cells_per_axis
        i, j, k = (
            np.minimum(np.searchsorted(edges, local[:, axis], "right") - 1, per_axis - 1)
            for axis, edges in enumerate(self.edges)
        )
        return np.where(inside, (k * per_axis + j) * per_axis + i, OUTSIDE)


def make_frame(bounds: Bounds, cells_per_axis: int) -> GridFrame:
    """The frame of a grid over `bounds`, lower and upper corner in m; a flat box gets some thickness.

    Raises InvalidInput for bounds that are not finite or empty.
    """
    low, high = (np.asarray(corner, np.float64) for corner in bounds)
    if low.shape != (3,) or high.shape != (3,) or not np.isfinite(low + high).all() or (low > high).any():
        raise InvalidInput("light grid bounds", f"{low} to {high}", "give the lower and upper corner of the scene")
    largest = float((high - low).max())
    extents = np.maximum(high - low, _LEAST_EXTENT * largest) if largest > 0.0 else np.ones(3)
    unit = 2.0 ** float(np.ceil(np.log2(extents.max())))
    steps = np.linspace(-0.5, 0.5, cells_per_axis + 1)
    edges = on_steps(steps * (extents / unit)[:, None]).astype(np.float32)
    return GridFrame(0.5 * low + 0.5 * high, unit, edges)


@dataclass(frozen=True)
class LightShapes:
    """What the grid knows of the lights, in its frame.

    half_balls: active hemispheres. areas, radii: (n,) float64; a radius is that of a light's farthest corner.
    """

    half_balls: HalfBalls
    areas: Float64
    radii: Float64


def light_shapes(
    light_mesh: VirtualLightMesh,
    frame: GridFrame,
    range_in_radii: float,
    chosen: npt.NDArray[np.bool_] | None = None,
) -> LightShapes:
    """Active hemispheres of the lights of `chosen` (all if None); the others and lights without area have none.

    The half ball about the centroid on the emitting side, of range x the distance of the farthest corner (seed 002,
    4.2). Raises InvalidInput for a light that is too far away to tell apart from others at all.
    """
    corners = light_mesh.corners
    centroids = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centroids[:, None], axis=2).max(axis=1, initial=0.0) / frame.unit
    centres = frame.local(centroids)
    distances = np.abs(centres).max(axis=1, initial=0.0)
    if (distances > LARGEST).any():
        problem = f"lies {distances.max():.0e} times the grid's size away from it"
        raise InvalidInput(f"light {int(distances.argmax())}", problem, "give bounds that hold the scene")
    areas = light_mesh.areas
    emits = areas > 0.0
    if chosen is not None:
        emits &= chosen
    normals = light_mesh.area_vectors / np.where(areas > 0.0, areas, 1.0)[:, None]
    reaches = np.where(emits, np.minimum(range_in_radii * radii, LARGEST), -1.0)
    return LightShapes(make_half_balls(centres, normals, reaches), areas / frame.unit**2, radii)


@dataclass(frozen=True)
class LightGrid:
    """Candidate lights of each cell of a uniform grid, immutable.

    light_hash: of the corners of the light mesh that it was baked from. half_balls: the lights' active hemispheres in
    the frame.
    """

    settings: GridSettings
    frame: GridFrame
    half_balls: HalfBalls
    lists: CellLists
    occupancy: Occupancy
    light_hash: str

    @classmethod
    def bake(
        cls,
        light_mesh: VirtualLightMesh,
        bounds: Bounds,
        settings: GridSettings | None = None,
        progress: Progress = silent,
        chosen: npt.NDArray[np.bool_] | None = None,
    ) -> LightGrid:
        """The grid over `bounds` (lower and upper corner, m), with the lights of `chosen` (all if None).

        Light ids are rows of `light_mesh`, whatever is chosen. Raises InvalidInput for lights or bounds that cannot be
        used, Cancelled when `progress` says so.
        """
        settings = settings or GridSettings()
        require_valid(light_mesh)
        frame = make_frame(bounds, settings.grid)
        shapes = light_shapes(light_mesh, frame, settings.range, chosen)
        lists = build_cell_lists(shapes.half_balls, frame.edges, progress)
        return cls.from_lists(light_mesh, settings, frame, shapes, lists)

    @classmethod
    def from_lists(
        cls,
        light_mesh: VirtualLightMesh,
        settings: GridSettings,
        frame: GridFrame,
        shapes: LightShapes,
        lists: CellLists,
    ) -> LightGrid:
        """The grid of lists of any length, wherever they were built, cut to `settings.max_lights`."""
        lists, occupancy = limited(
            lists, shapes.half_balls, frame.edges, shapes.areas, shapes.radii, settings.max_lights
        )
        return cls(settings, frame, shapes.half_balls, lists, occupancy, light_hash(light_mesh))

    @property
    def light_count(self) -> int:
        """Lights of the light mesh, and the id of the light that emits nothing in `fixed_size_lists`."""
        return len(self.half_balls)

    @property
    def nbytes(self) -> int:
        """Bytes of the lists and of the active hemispheres."""
        half_balls = self.half_balls
        parts = (half_balls.centres, half_balls.normals, half_balls.inverse_normals, half_balls.radii_squared)
        return self.lists.nbytes + self.frame.edges.nbytes + sum(part.nbytes for part in parts)

    def candidates(self, points: npt.ArrayLike) -> tuple[npt.NDArray[Any], npt.NDArray[np.uint32]]:
        """Offsets (p + 1,) and light ids: candidates of point i are ids[offsets[i] : offsets[i + 1]], ascending.

        points: (p, 3), m. A point of the grid gets the list of its cell. A point outside gets the lights whose active
        hemisphere holds it, as a cell about it would (all of them, whatever max_lights): the lists of cells say
        nothing about it, and no light may end at the grid's face. That tests every light for every such point, so bake
        over bounds that hold what is shaded. Raises InvalidInput for points that are not finite.
        """
        points = _finite_points(points)
        cells = self.frame.cells(points)
        outside = np.flatnonzero(cells == OUTSIDE)
        inside_lists = gather(self.lists, np.where(cells == OUTSIDE, 0, cells))
        if not len(outside):
            return inside_lists.offsets, inside_lists.light_ids
        found = [self._lights_at(point) for point in self.frame.local(points[outside])]
        counts = inside_lists.counts
        counts[outside] = 0
        kept = inside_lists.light_ids[expand(inside_lists.offsets[:-1].astype(np.int64), counts)]
        owners = np.repeat(np.arange(len(points)), counts)
        owners = np.concatenate((owners, np.repeat(outside, [len(ids) for ids in found])))
        ids = np.concatenate((kept, *found))[np.argsort(owners, kind="stable")]
        merged = lists_from_counts(np.bincount(owners, minlength=len(points)), ids)
        return merged.offsets, merged.light_ids

    def _lights_at(self, local_point: Float64) -> npt.NDArray[np.uint32]:
        place = on_steps(local_point).astype(np.float32)[:, None]
        return np.flatnonzero(overlaps(self.half_balls, place, place)).astype(np.uint32)

    def fixed_size_lists(self) -> npt.NDArray[np.uint32]:
        """(cells, k) uint32, k = max_lights or what the fullest cell holds: the thesis's layout (seed 002, 4.1).

        Empty slots name light `light_count`, one past the last: whoever uploads the lights appends one that emits
        nothing.
        """
        counts = self.lists.counts
        width = self.settings.max_lights or int(counts.max(initial=0))
        result = np.full((len(counts), width), self.light_count, np.uint32)
        result[np.arange(width) < counts[:, None]] = self.lists.light_ids
        return result

    def require_made_of(self, light_mesh: VirtualLightMesh) -> None:
        """Raises InvalidInput unless the grid was baked from lights of these very shapes."""
        if light_hash(light_mesh) != self.light_hash:
            problem = f"it was baked from {self.light_count:,} other lights or other shapes of them"
            raise InvalidInput("light grid", problem, "bake it again")


def light_hash(light_mesh: VirtualLightMesh) -> str:
    """Hash of the lights' corners: all that lists depend on."""
    return content_hash(light_mesh.corners)


def _finite_points(points: npt.ArrayLike) -> Float64:
    array = np.asarray(points, np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidInput("light grid points", f"shape {array.shape}", "give (p, 3)")
    if not np.isfinite(array).all():
        raise InvalidInput("light grid points", "not all are finite", "remove NaN and infinity")
    return array
