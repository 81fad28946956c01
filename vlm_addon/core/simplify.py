# SPDX-License-Identifier: GPL-3.0-or-later
"""A virtual light mesh made from the visible surface by simplification (seed 002, section 3.7, subtractive creation).

weld and group (source_surface) -> leave out shells beyond the budget -> rough reduction (bulk_reduction) -> fine
collapse (edge_collapse) -> regions -> placement behind the surface -> colour, emission and strength -> source samples.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .counting import counted, counted_verb
from .errors import InvalidInput
from .hide_lights import HiddenLights, hide_lights
from .kept_lights import kept_regions
from .light_mesh import VirtualLightMesh, empty_light_mesh, join
from .mesh_topology import Bool, Int64, Rows, closed_shells, rows_by_key, sum_by
from .placement import share_in_front
from .progress import Progress, silent, step
from .reduce_surface import ReducedSurface, reduce_surface
from .regions import Regions, assign_regions
from .sampling import sample_counts, sample_regions
from .scene import Finding, Float64, Int32, Mesh
from .settings import setting
from .source_surface import SourceSurface, join_surface, part_of
from .subdivide import subdivide_light_mesh

__all__ = [
    "CreatedLightMesh",
    "SimplifyReport",
    "SimplifySettings",
    "create_light_mesh",
    "subdivide_light_mesh",
]

# A light may be at most this many times brighter or dimmer than its region; what is cut goes to all lights evenly.
STRENGTH_LIMIT = 64.0


@dataclass(frozen=True)
class SimplifySettings:
    """How a light mesh is made from the visible surface."""

    target_triangles: int = setting(
        1000,
        "count",
        1,
        10_000_000,
        "Virtual lights to make; surfaces with fewer triangles keep all",
        source="002, 3.7",
    )
    samples_per_light: int = setting(
        16, "count", 1, 1024, "Points at which the light on a region of median area is measured; larger ones get more"
    )


@dataclass(frozen=True)
class SimplifyReport:
    """What was done. milliseconds: (step, ms) in order. Powers: (3,) m² under unit irradiance (reflected) or W
    (emitted), linear Rec.709. share_in_front: share of the source area that lies behind the plane of its own light.
    shells_dropped: shells too weak for the budget, whose power neighbours took over. limited_lights: lights that a
    thin body kept in front of their surface. unlit_area: m² of the surface painted to have no lights, which is in none
    of the powers. kept_lights: lights that were there and stay; powers are of the others and their surface."""

    source_triangles: int
    degenerate_triangles: int
    lights: int
    milliseconds: tuple[tuple[str, float], ...]
    reflected_power_before: tuple[float, float, float]
    reflected_power_after: tuple[float, float, float]
    emitted_power_before: tuple[float, float, float]
    emitted_power_after: tuple[float, float, float]
    shells: int
    shells_dropped: int
    closed_shells_before: int
    closed_shells_after: int
    share_in_front: float
    limited_lights: int
    unlit_area: float
    kept_lights: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class CreatedLightMesh:
    """light_of_triangle: for each mesh given, (its triangles,) int32, the light whose region holds each triangle, -1
    for a triangle that welds to a line or is to have no light. Lights that were kept come first."""

    light_mesh: VirtualLightMesh
    light_of_triangle: tuple[Int32, ...]
    report: SimplifyReport


class _Clock:
    """Progress and milliseconds of the steps."""

    def __init__(self, progress: Progress) -> None:
        self.progress = progress
        self.done: list[tuple[str, float]] = []
        self.started = time.perf_counter()
        self.label = ""

    def start(self, fraction: float, label: str) -> None:
        """Ends the step before, starts the next. Raises Cancelled."""
        self.stop()
        step(self.progress, fraction, label)
        self.label, self.started = label, time.perf_counter()

    def stop(self) -> None:
        """Ends the step under way."""
        if self.label:
            self.done.append((self.label, 1000.0 * (time.perf_counter() - self.started)))
        self.label = ""


def create_light_mesh(
    meshes: Sequence[Mesh],
    settings: SimplifySettings = SimplifySettings(),
    progress: Progress = silent,
    keep: VirtualLightMesh | None = None,
    whole_regions: bool = False,
) -> CreatedLightMesh:
    """Virtual lights that stand for the surface of `meshes`, at most settings.target_triangles of them.

    Reflected and emitted power are those of the source. Borders between materials, tags and meshes survive, closed
    shells stay closed, and every source triangle belongs to the region of exactly one light. Without any surface the
    light mesh is empty and a finding says so. keep: lights that stay as they are, bit for bit, and count; the surface
    that they stand for gets no others. whole_regions: whether lights stand behind all of their regions, or only as far
    as they would shine on them, which costs less accuracy. Raises InvalidInput for a target below 1, fewer lights than
    are kept, or values that are not finite (naming the mesh), and Cancelled.
    """
    if settings.target_triangles < 1 or settings.samples_per_light < 1:
        problem = f"{settings.target_triangles} lights with {settings.samples_per_light} samples"
        raise InvalidInput("simplification", problem, "ask for at least 1 of each")
    clock = _Clock(progress)
    clock.start(0.0, "weld")
    surface = join_surface(meshes, lambda share: step(progress, 0.1 * share, "weld"))
    every, kept = surface, keep if keep is not None else empty_light_mesh()
    held = kept_regions(kept, surface.corners, surface.normals)
    if len(kept):
        surface = part_of(surface, held < 0)
    target = settings.target_triangles - len(kept)
    if target < 1 and len(surface.triangles):
        problem = f"{len(kept)} locked lights leave none of {settings.target_triangles} for the rest of the surface"
        raise InvalidInput("simplification", problem, "ask for more lights or unlock some")
    clock.start(0.1, "simplify")
    lights = reduce_surface(surface, target, lambda share: step(progress, 0.1 + 0.5 * share, "simplify"))
    if not len(lights.triangles):
        clock.stop()
        return _nothing(meshes, every, kept, held, clock)
    clock.start(0.6, "regions")
    regions = assign_regions(surface, lights, lambda share: step(progress, 0.6 + 0.1 * share, "regions"))
    clock.start(0.7, "place")
    placing = lambda share: step(progress, 0.7 + 0.2 * share, "place")  # noqa: E731
    hidden = hide_lights(surface, lights, regions, whole_regions, placing)
    regions = replace(regions, light=hidden.light)
    own = _region_rows(regions, ~regions.adopted, len(lights.triangles))
    clock.start(0.9, "sample")
    placed = replace(lights, triangles=hidden.triangles)
    light_mesh = _coloured(surface, placed, regions, hidden.positions, settings)
    clock.start(0.95, "check")
    in_front = share_in_front(light_mesh.corners, own, surface.corners)
    clock.stop()
    report = _report(surface, lights, light_mesh, regions, hidden, in_front, clock)
    report = replace(report, kept_lights=len(kept))
    step(progress, 1.0, "done")
    of_triangle = held.copy()
    of_triangle[held < 0] = regions.light + len(kept)
    both = join([kept, light_mesh]) if len(kept) else light_mesh
    return CreatedLightMesh(both, _by_mesh(meshes, every, of_triangle), report)


def _nothing(
    meshes: Sequence[Mesh], surface: SourceSurface, kept: VirtualLightMesh, held: Int64, clock: _Clock
) -> CreatedLightMesh:
    """The lights that are kept alone."""
    findings = _unlit(surface.unlit_area)
    if not len(kept) and not findings:
        findings = (Finding("scene", "no surface with any area was given", "add a mesh with faces"),)
    zero = (0.0, 0.0, 0.0)
    report = SimplifyReport(
        source_triangles=surface.triangle_count,
        degenerate_triangles=surface.degenerate_count,
        lights=0,
        milliseconds=tuple(clock.done),
        reflected_power_before=zero,
        reflected_power_after=zero,
        emitted_power_before=zero,
        emitted_power_after=zero,
        shells=0,
        shells_dropped=0,
        closed_shells_before=0,
        closed_shells_after=0,
        share_in_front=0.0,
        limited_lights=0,
        unlit_area=surface.unlit_area,
        kept_lights=len(kept),
        findings=findings,
    )
    return CreatedLightMesh(kept, _by_mesh(meshes, surface, held), report)


def _region_rows(regions: Regions, chosen: Bool, light_count: int) -> Rows:
    """The chosen source triangles of each light."""
    rows = np.flatnonzero(chosen)
    return rows_by_key(regions.light[rows], light_count, rows)


def _by_mesh(meshes: Sequence[Mesh], surface: SourceSurface, light: Int64) -> tuple[Int32, ...]:
    whole = np.full(surface.triangle_count, -1, np.int32)
    whole[surface.original] = light
    return tuple(np.split(whole, np.cumsum([len(mesh.triangles) for mesh in meshes])[:-1])) if len(meshes) else ()


def _coloured(
    surface: SourceSurface,
    lights: ReducedSurface,
    regions: Regions,
    positions: Float64,
    settings: SimplifySettings,
) -> VirtualLightMesh:
    """The light mesh: area-weighted means over each region, and strengths that keep the power of the source.

    A light is as much stronger as its region is larger than itself, so each keeps its own power; where that would
    exceed STRENGTH_LIMIT, all lights together make up for what is cut.
    """
    count = len(lights.triangles)
    corners = positions[lights.triangles]
    region_area = sum_by(regions.light, surface.areas, count)
    colour = _region_mean(regions.light, surface.reflectance, surface.areas, region_area)
    emission = _region_mean(regions.light, surface.emission, surface.areas, region_area)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    strength = np.clip(region_area / area, 0.0, STRENGTH_LIMIT)
    strength *= _ratio((surface.areas @ surface.reflectance).sum(), ((area * strength) @ colour).sum())
    emission *= _ratio((surface.areas @ surface.emission).sum(), ((area * strength) @ emission).sum())
    continued = lights.source_triangle
    every = _region_rows(regions, np.ones(len(regions.light), bool), count)
    return VirtualLightMesh(
        vertices=positions,
        triangles=lights.triangles.astype(np.int32),
        colour=colour.astype(np.float32),
        emission=emission.astype(np.float32),
        strength=strength.astype(np.float32),
        tag_ids=surface.tag[continued].astype(np.int32),
        dynamic=surface.dynamic[continued],
        samples=sample_regions(surface.corners, every, sample_counts(region_area, settings.samples_per_light)),
    )


def _region_mean(light: Int64, values: Float64, areas: Float64, region_area: Float64) -> Float64:
    sums = [sum_by(light, values[:, channel] * areas, len(region_area)) for channel in range(3)]
    return np.stack(sums, axis=1) / np.where(region_area > 0, region_area, 1.0)[:, None]


def _ratio(wanted: float, found: float) -> float:
    return wanted / found if found > 0 else 1.0


def _report(
    surface: SourceSurface,
    lights: ReducedSurface,
    light_mesh: VirtualLightMesh,
    regions: Regions,
    hidden: HiddenLights,
    in_front: float,
    clock: _Clock,
) -> SimplifyReport:
    powers = light_mesh.areas * light_mesh.strength
    shell_of_light = surface.shell[lights.source_triangle]
    shells = len(surface.closed)
    present = np.bincount(shell_of_light, minlength=shells) > 0
    part, part_closed = closed_shells(lights.triangles, len(lights.positions))
    opened = np.bincount(shell_of_light, weights=~part_closed[part], minlength=shells) > 0
    still_closed = int((surface.closed & present & ~opened).sum())
    dropped = int((np.bincount(surface.shell, weights=surface.areas, minlength=shells) > 0).sum() - present.sum())
    report = SimplifyReport(
        source_triangles=surface.triangle_count,
        degenerate_triangles=surface.degenerate_count,
        lights=len(light_mesh),
        milliseconds=tuple(clock.done),
        reflected_power_before=_triple(surface.areas @ surface.reflectance),
        reflected_power_after=_triple(light_mesh.reflected_power),
        emitted_power_before=_triple(surface.areas @ surface.emission),
        emitted_power_after=_triple(powers @ light_mesh.emission.astype(np.float64)),
        shells=shells,
        shells_dropped=dropped,
        closed_shells_before=int((surface.closed & present).sum()),
        closed_shells_after=still_closed,
        share_in_front=in_front,
        limited_lights=int(hidden.limited.sum()),
        unlit_area=surface.unlit_area,
        kept_lights=0,
        findings=(),
    )
    return replace(report, findings=_findings(report, lights, hidden))


def _triple(values: Float64) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _findings(report: SimplifyReport, lights: ReducedSurface, hidden: HiddenLights) -> tuple[Finding, ...]:
    found = list(_unlit(report.unlit_area))
    if report.shells_dropped:
        problem = f"of {counted(report.shells, 'separate piece')}, {report.shells_dropped} got no light"
        found.append(Finding("light mesh", problem, "their power went to lights nearby; ask for more lights"))
    if lights.merged_borders:
        problem = (
            counted_verb(report.lights, "light", "is", "are")
            + " too few for the borders of materials, tags and objects"
        )
        found.append(Finding("light mesh", problem, "colors were averaged across some; ask for more lights"))
    if report.closed_shells_after < report.closed_shells_before:
        problem = counted_verb(
            report.closed_shells_before - report.closed_shells_after, "closed piece", "is open now", "are open now"
        )
        found.append(Finding("light mesh", problem, "ask for more lights"))
    if report.limited_lights:
        first, depth = int(np.argmax(hidden.limited)), float(hidden.depth[hidden.limited].max())
        problem = (
            f"{counted(report.limited_lights, 'light')} (first: {first}) cannot be placed behind the surface because "
            f"the body is too thin: up to {depth:.3g} m in front of it"
        )
        found.append(Finding("light mesh", problem, "give these parts and their lights a common tag, or more lights"))
    return tuple(found)


def _unlit(area: float) -> tuple[Finding, ...]:
    """What is to be known of surfaces that are painted to have no lights."""
    if not area > 0.0:
        return ()
    problem = f"{area:.3g} m² are painted to have no lights"
    return (Finding("light mesh", problem, "nothing bounces off them; paint less of the vertex group to change that"),)
