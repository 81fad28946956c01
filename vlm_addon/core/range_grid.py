# SPDX-License-Identifier: GPL-3.0-or-later
"""The light grid in range mode: for each cell, the lights whose active hemisphere reaches it (seed 002, chapter 4).

Lists depend on where lights are, not on how bright: relighting leaves a grid as it is. Tags are no matter of the grid
either: whoever shades with a candidate leaves it out where the surface has its tag.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .active_hemisphere import LARGEST, HalfBalls, make_half_balls, on_steps, overlaps
from .block_lists import MAX_CELLS_PER_AXIS, BlockLists, build_block_lists
from .cell_limit import Occupancy, limited
from .errors import InvalidInput
from .grid_frame import OUTSIDE, Bounds, GridFrame, finite_points, make_frame
from .light_mesh import VirtualLightMesh, require_valid
from .progress import Progress, silent
from .scene import Float64
from .settings import checked_values, setting

MOST_FIXED_BYTES = 1 << 32
"""Of lists of one size, which are held in memory at once."""


@dataclass(frozen=True)
class RangeSettings:
    """Settings of a light grid in range mode. Raises InvalidInput for what its fields do not allow."""

    grid: int = setting(
        50, "cells", 1, MAX_CELLS_PER_AXIS, "Cells along each side of the scene's box", source="002, 4.1"
    )
    range: float = setting(
        4.0, "radii", 0.0, 1e6, "How far a light reaches, in distances of its farthest corner", source="002, 4.2"
    )
    max_lights: int = setting(
        0, "lights", 0, 1_000_000, "Most lights a cell holds; 0 for as many as reach it", source="002, 4.1"
    )

    def __post_init__(self) -> None:
        for name, value in checked_values(type(self), vars(self), "the light grid").items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class LightShapes:
    """What the grid knows of the lights, in its frame.

    half_balls: active hemispheres. areas: (n,) float64.
    """

    half_balls: HalfBalls
    areas: Float64


def light_shapes(
    light_mesh: VirtualLightMesh,
    frame: GridFrame,
    range_in_radii: float,
    chosen: npt.NDArray[np.bool_] | None = None,
) -> LightShapes:
    """Active hemispheres of the lights of `chosen` (all if None); the others and lights without area have none, and
    nothing depends on where they are.

    The half ball about the centroid on the emitting side, of range x the distance of the farthest corner (seed 002,
    4.2). Raises InvalidInput for a light that is too far away to tell apart from others at all.
    """
    areas = light_mesh.areas if chosen is None else np.where(chosen, light_mesh.areas, 0.0)
    emits = areas > 0.0
    corners = np.where(emits[:, None, None], light_mesh.corners, frame.middle)
    centroids = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centroids[:, None], axis=2).max(axis=1, initial=0.0) / frame.unit
    centres = frame.local(centroids)
    distances = np.abs(centres).max(axis=1, initial=0.0)
    if (distances > LARGEST).any():
        problem = f"lies {distances.max():.0e} times the grid's size away from it"
        raise InvalidInput(f"light {int(distances.argmax())}", problem, "give bounds that hold the scene")
    normals = np.where(emits[:, None], light_mesh.area_vectors, 0.0) / np.where(emits, areas, 1.0)[:, None]
    reaches = np.where(emits, np.minimum(range_in_radii * radii, LARGEST), -1.0)
    return LightShapes(make_half_balls(centres, normals, reaches), areas / frame.unit**2)


@dataclass(frozen=True)
class RangeGrid:
    """Candidate lights of each cell of a uniform grid, immutable.

    half_balls: the lights' active hemispheres in the frame, one of each light of the light mesh.
    """

    settings: RangeSettings
    frame: GridFrame
    half_balls: HalfBalls
    lists: BlockLists
    occupancy: Occupancy

    @classmethod
    def bake(
        cls,
        light_mesh: VirtualLightMesh,
        bounds: Bounds,
        settings: RangeSettings | None = None,
        progress: Progress = silent,
        chosen: npt.NDArray[np.bool_] | None = None,
    ) -> RangeGrid:
        """The grid over `bounds` (lower and upper corner, m), with the lights of `chosen` (all if None).

        Light ids are rows of `light_mesh`, whatever is chosen. Raises InvalidInput for lights or bounds that cannot be
        used, Cancelled when `progress` says so.
        """
        settings = settings or RangeSettings()
        require_valid(light_mesh)
        frame = make_frame(bounds, settings.grid)
        shapes = light_shapes(light_mesh, frame, settings.range, chosen)
        lists = build_block_lists(shapes.half_balls, frame.edges, progress)
        return cls.from_lists(settings, frame, shapes, lists, progress)

    @classmethod
    def from_lists(
        cls,
        settings: RangeSettings,
        frame: GridFrame,
        shapes: LightShapes,
        lists: BlockLists,
        progress: Progress = silent,
    ) -> RangeGrid:
        """The grid of lists of any length, wherever they were built, cut to `settings.max_lights`. Raises Cancelled."""
        lists, occupancy = limited(lists, shapes.half_balls, frame.edges, shapes.areas, settings.max_lights, progress)
        return cls(settings, frame, shapes.half_balls, lists, occupancy)

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
        points = finite_points(points)
        cells = self.frame.cells(points)
        inside, outside = np.flatnonzero(cells != OUTSIDE), np.flatnonzero(cells == OUTSIDE)
        offsets, ids = self.lists.cell_lists(cells[inside])
        found = [self._lights_at(point) for point in self.frame.local(points[outside])]
        counts = np.zeros(len(points), np.int64)
        counts[inside], counts[outside] = np.diff(offsets), [len(lights) for lights in found]
        owners = np.concatenate((np.repeat(inside, counts[inside]), np.repeat(outside, counts[outside])))
        ids = np.concatenate((ids, *found))[np.argsort(owners, kind="stable")]
        return np.concatenate(([0], np.cumsum(counts))), ids

    def _lights_at(self, local_point: Float64) -> npt.NDArray[np.uint32]:
        place = on_steps(local_point).astype(np.float32)[:, None]
        return np.flatnonzero(overlaps(self.half_balls, place, place)).astype(np.uint32)

    def reaching(self, cell: int) -> npt.NDArray[np.bool_]:
        """(n,) whether each light reaches a cell, whether or not its list has room."""
        low, high = self.frame.cell_box(cell)
        return overlaps(self.half_balls, low[:, None], high[:, None])

    def fixed_size_lists(self) -> npt.NDArray[np.uint32]:
        """(cells, k) uint32, k = max_lights or what the fullest cell holds: the thesis's layout (seed 002, 4.1).

        Empty slots name light `light_count`, one past the last: whoever uploads the lights appends one that emits
        nothing. Raises InvalidInput for lists of more than MOST_FIXED_BYTES.
        """
        width = self.settings.max_lights or self.occupancy.fullest
        size = np.dtype(np.uint32).itemsize * self.occupancy.cells * width
        if size > MOST_FIXED_BYTES:
            problem = f"{self.occupancy.cells:,} of {width:,} lights take {1e-9 * size:.1f} GB"
            raise InvalidInput("lists of one size", problem, "set max_lights, or use a smaller grid")
        return self.lists.fixed_size(width, self.light_count)
