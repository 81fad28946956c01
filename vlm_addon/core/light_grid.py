# SPDX-License-Identifier: GPL-3.0-or-later
"""The light grid: which lights of a light mesh light a point, baked once and asked often.

Range mode is the thesis's grid of cells (`range_grid`). Tolerance mode is a tree of clusters without any cell
(`light_tree`, `light_clusters`, `light_cut`). Static and dynamic lights are in structures of their own, so that moving
the dynamic ones rebuilds nothing static.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from .array_codec import content_hash
from .cell_limit import overflow_text
from .errors import InvalidInput
from .grid_frame import Bounds, as_numbers, finite_bounds, finite_points
from .light_clusters import LightClusters, light_clusters
from .light_cut import light_cut
from .light_grid_levels import grid_levels, tree_levels
from .light_mesh import VirtualLightMesh, require_valid
from .light_scale import mean_irradiance
from .light_tree import LightTree, build_light_tree
from .light_tree_error import expected_error
from .progress import Progress, silent, step
from .range_grid import RangeGrid, RangeSettings
from .scene import Float64
from .settings import OWN, setting
from .surface_points import NO_POINTS, SurfacePoints, require_points
from .window_factor import window_factor

TOLERANCE, RANGE = "tolerance", "range"
STATIC, DYNAMIC = "static", "dynamic"
FEW_LIGHTS = 400
"""Renderers sum up to so many lights one by one: that costs about what clusters do, measured up to 160 in a box and 600
in the atrium."""

Bools = npt.NDArray[np.bool_]
Int64 = npt.NDArray[np.int64]
Structure = RangeGrid | LightTree


@dataclass(frozen=True)
class GridSettings(RangeSettings):
    """Settings of a light grid; those of RangeSettings count in range mode only, `tolerance` in the other."""

    mode: str = setting(
        TOLERANCE, "", None, None, "Far lights together, or lists of near lights", choices=(TOLERANCE, RANGE)
    )
    tolerance: float = setting(
        0.02, "share", 1e-4, 1.0, "How far irradiance may be from the sum over all lights", source=OWN
    )

    @property
    def of_range(self) -> RangeSettings:
        """Those that count in range mode."""
        return RangeSettings(self.grid, self.range, self.max_lights)


@dataclass(frozen=True)
class LitTree:
    """A light tree, and what its clusters send out."""

    tree: LightTree
    clusters: LightClusters

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return self.tree.nbytes + self.clusters.nbytes


@dataclass(frozen=True)
class Candidates:
    """What lights each of p points: light_ids[light_offsets[i] : light_offsets[i + 1]] one by one, clusters likewise.

    light_ids: (m,) uint32 rows of the light mesh, ascending for each point; light_weights: (m,) in (0, 1]. clusters:
    (k,) clusters of the static tree, then of the dynamic one (from len(static.tree) on); in range mode there are none,
    and all weights are 1.
    """

    light_offsets: Int64
    light_ids: npt.NDArray[np.uint32]
    light_weights: Float64
    cluster_offsets: Int64
    clusters: npt.NDArray[np.uint32]
    cluster_weights: Float64


@dataclass(frozen=True)
class LightGrid:
    """What was baked of a light mesh, immutable.

    bounds: (2, 3) m, what the grid of range mode covers. probes: points of what is lit: their mean irradiance is the
    scale of a tolerance. window_factor: how much larger windows are than the error model says (`window_factor`).
    static, dynamic: of the lights that stand and that move; None where there are none. static_hash, dynamic_hash: of
    all that they depend on in the light mesh.
    """

    settings: GridSettings
    bounds: Float64
    probes: SurfacePoints
    window_factor: float
    light_count: int
    static: RangeGrid | LitTree | None
    dynamic: RangeGrid | LitTree | None
    static_hash: str
    dynamic_hash: str

    @classmethod
    def bake(
        cls,
        light_mesh: VirtualLightMesh,
        bounds: Bounds,
        settings: GridSettings | None = None,
        progress: Progress = silent,
        probes: SurfacePoints = NO_POINTS,
    ) -> LightGrid:
        """The grid of a light mesh over `bounds` (lower and upper corner, m). probes: points of what is lit.

        Without probes a tolerance is a share of what a closed room would receive whose walls are the lights: their
        power over their area. That is too much, and the grid errs by more than the tolerance, where most light meets no
        surface; `surface_points.random_surface_points` makes probes of a scene's meshes.

        In tolerance mode its clusters are lit by its nominal radiosity until `relit`. Raises InvalidInput for lights,
        settings, bounds or probes that cannot be used, Cancelled when `progress` says so.
        """
        settings = GridSettings() if settings is None else settings
        if not isinstance(settings, GridSettings):
            problem = f"they are of type {type(settings).__name__}"
            raise InvalidInput("settings of the light grid", problem, "give a GridSettings")
        empty = cls(settings, finite_bounds(bounds), require_points(probes), 1.0, 0, None, None, "", "")
        return empty.moved(light_mesh, progress)

    def moved(self, light_mesh: VirtualLightMesh, progress: Progress = silent) -> LightGrid:
        """The grid of the lights as they are now; a structure of which nothing has changed is kept. As `bake`."""
        require_valid(light_mesh)
        old = ((self.static, self.static_hash), (self.dynamic, self.dynamic_hash))
        made: list[Structure | None] = []
        hashes = []
        for (structure, old_hash), chosen in zip(old, chosen_lights(light_mesh).values(), strict=True):
            hashes.append(lights_hash(light_mesh, chosen, self.settings.mode))
            kept = hashes[-1] == old_hash
            made.append(_unlit(structure) if kept else self._built(light_mesh, chosen, progress))
        grid = replace(self, light_count=len(light_mesh), static_hash=hashes[0], dynamic_hash=hashes[1])
        return grid._lit(made, light_mesh, light_mesh.nominal_radiosity)

    def _built(self, light_mesh: VirtualLightMesh, chosen: Bools, progress: Progress) -> Structure | None:
        if not chosen.any():
            return None
        if self.settings.mode == RANGE:
            return RangeGrid.bake(
                light_mesh, (self.bounds[0], self.bounds[1]), self.settings.of_range, progress, chosen
            )
        step(progress, 0.0, "light tree")
        return build_light_tree(light_mesh, chosen)

    def relit(self, light_mesh: VirtualLightMesh, radiosity: npt.ArrayLike) -> LightGrid:
        """The grid under other light; radiosity: (n, 3) W/m². In range mode the same, in the other the same trees.

        Raises InvalidInput where the radiosity cannot be used, or the light mesh is not the one that was baked.
        """
        if len(light_mesh) != self.light_count:
            problem = f"it has {len(light_mesh):,} lights, the light grid was baked from {self.light_count:,}"
            raise InvalidInput("light mesh", problem, "relight with the light mesh that was baked, or bake again")
        self.require_made_of(light_mesh)
        values = usable_radiosity(light_mesh, radiosity)
        return self._lit([_unlit(self.static), _unlit(self.dynamic)], light_mesh, values)

    def _lit(self, parts: list[Structure | None], light_mesh: VirtualLightMesh, radiosity: Float64) -> LightGrid:
        """With the static and the dynamic part, trees lit."""
        trees = [part for part in parts if isinstance(part, LightTree)]
        mean = mean_irradiance(trees, light_mesh, radiosity, self.probes)
        tolerance = self.settings.tolerance
        factor = window_factor(trees, light_mesh, radiosity, tolerance, mean, self.probes)
        static, dynamic = (
            LitTree(part, light_clusters(part, light_mesh, radiosity, tolerance, mean, factor))
            if isinstance(part, LightTree)
            else part
            for part in parts
        )
        return replace(self, window_factor=factor, static=static, dynamic=dynamic)

    @property
    def structures(self) -> list[tuple[str, RangeGrid | LitTree]]:
        """(STATIC or DYNAMIC, structure) of those that hold lights."""
        both = ((STATIC, self.static), (DYNAMIC, self.dynamic))
        return [(name, structure) for name, structure in both if structure is not None]

    @property
    def nbytes(self) -> int:
        """Bytes of all structures."""
        return sum(structure.nbytes for _, structure in self.structures)

    @property
    def occupancy(self) -> dict[str, list[dict[str, Any]]]:
        """How full each level of each structure is, JSON-able: of a range grid its cells and blocks, of a tree its
        levels, finest first. places: cells, blocks or clusters; entries: lights and clusters in all of them."""
        return {
            name: tree_levels(structure.tree) if isinstance(structure, LitTree) else grid_levels(structure)
            for name, structure in self.structures
        }

    @property
    def overflow(self) -> str:
        """How many cells have no room for all their lights, and how many lights they leave out; "" if none does."""
        full = [part.occupancy for _, part in self.structures if isinstance(part, RangeGrid)]
        return overflow_text(full, self.settings.max_lights)

    def candidates(self, points: npt.ArrayLike) -> Candidates:
        """What lights (p, 3) points, m. Raises InvalidInput for another shape or points that are not finite.

        Tags are not looked at: whoever shades leaves out what `light_links.leaves_out` says.
        """
        array = finite_points(points)
        lights, clusters = [_Pairs.none()], [_Pairs.none()]
        first_cluster = 0
        for _, structure in self.structures:
            if isinstance(structure, RangeGrid):
                offsets, ids = structure.candidates(array)
                owners = np.repeat(np.arange(len(array)), np.diff(offsets))
                lights.append(_Pairs(owners, ids.astype(np.int64), np.ones(len(ids))))
                continue
            cut = light_cut(structure.tree, structure.clusters.window, array)
            lights.append(_Pairs(cut.light_points, cut.lights, cut.light_weights))
            clusters.append(_Pairs(cut.cluster_points, cut.clusters + first_cluster, cut.cluster_weights))
            first_cluster += len(structure.tree)
        return Candidates(*_by_point(lights, len(array)), *_by_point(clusters, len(array)))

    def expected_error(self, points: npt.ArrayLike) -> Float64:
        """(p,) W/m², sum over the channels: about how far the irradiance at (p, 3) points may be off, for display.

        See `light_tree_error.expected_error`. Raises InvalidInput for points as `candidates`, and in range mode: what a
        cell's list leaves out is not known from what it holds.
        """
        array = finite_points(points)
        if self.settings.mode == RANGE:
            remedy = "measure its error with light_grid_error.grid_error"
            raise InvalidInput("light grid", "one with a range cannot estimate what it leaves out", remedy)
        squared = np.zeros(len(array))
        for _, structure in self.structures:
            if isinstance(structure, LitTree):
                squared += expected_error(structure.tree, structure.clusters, array) ** 2
        return np.sqrt(squared)

    def require_made_of(self, light_mesh: VirtualLightMesh) -> None:
        """Raises InvalidInput unless the grid was baked from these very lights."""
        hashes = [lights_hash(light_mesh, chosen, self.settings.mode) for chosen in chosen_lights(light_mesh).values()]
        if hashes != [self.static_hash, self.dynamic_hash]:
            problem = f"it was baked from {self.light_count:,} other lights or other shapes of them"
            raise InvalidInput("light grid", problem, "bake it again")


def _unlit(part: RangeGrid | LitTree | None) -> Structure | None:
    return part.tree if isinstance(part, LitTree) else part


def usable_radiosity(light_mesh: VirtualLightMesh, radiosity: npt.ArrayLike) -> Float64:
    """(n, 3) float64. Raises InvalidInput for another shape, or a light's that is not finite or negative."""
    values = as_numbers(radiosity, "radiosity of light grid", "give one row of three per light, W/m²")
    if values.shape != (len(light_mesh), 3):
        problem = f"shape {values.shape} for {len(light_mesh):,} lights"
        raise InvalidInput("radiosity of light grid", problem, "give one row of three per light")
    for usable, problem in ((np.isfinite(values), "is not finite"), (values >= 0.0, "is negative")):
        if not usable.all():
            row = int(np.argmin(usable.all(axis=1)))
            raise InvalidInput(
                f"radiosity of light {row}", f"{values[row]} {problem}", "give finite values of at least 0"
            )
    return values


def chosen_lights(light_mesh: VirtualLightMesh) -> dict[str, Bools]:
    """(n,) bool by STATIC and DYNAMIC: the lights of each kind."""
    return {STATIC: ~light_mesh.dynamic, DYNAMIC: light_mesh.dynamic}


def lights_hash(light_mesh: VirtualLightMesh, chosen: Bools, mode: str) -> str:
    """Hash of all that a structure of the lights of `chosen` depends on: rows and shapes, for a tree tags as well."""
    rows = np.flatnonzero(chosen)
    tags = light_mesh.tag_ids[rows] if mode == TOLERANCE else None
    return content_hash([len(light_mesh), rows, light_mesh.corners[rows], tags])


@dataclass(frozen=True)
class _Pairs:
    """Points and what lights them: owners, ids and weights (m,)."""

    owners: npt.NDArray[Any]
    ids: npt.NDArray[Any]
    weights: Float64

    @classmethod
    def none(cls) -> _Pairs:
        return cls(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))


def _by_point(parts: list[_Pairs], point_count: int) -> tuple[Int64, npt.NDArray[np.uint32], Float64]:
    """Offsets (points + 1,), ids in rising order for each point, and weights."""
    owners, ids, weights = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("owners", "ids", "weights")
    )
    order = np.lexsort((ids, owners))
    counts = np.bincount(owners, minlength=point_count)
    return np.concatenate(([0], np.cumsum(counts))), ids[order].astype(np.uint32), weights[order]
