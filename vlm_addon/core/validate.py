# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong, or may surprise, in a virtual light mesh: one finding per kind, with count, first light and remedy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from . import finding_kinds as kinds
from .counting import counted_verb
from .light_links import leaves_out
from .light_marks import LightHistory
from .light_mesh import VirtualLightMesh
from .light_overlaps import badly_joined, covered_twice
from .mesh_topology import Bool, Int64, normals_and_areas, rows_by_key, sum_by
from .nearest_lights import light_of_triangles
from .own_shares import ALLOWED, seen_factors
from .placement import insets
from .progress import Report, between
from .scene import Finding, Float64, Int32, Mesh
from .thin_surface import open_triangles, thin_against, two_sided
from .triangle_tree import TriangleTree, build_tree

Rows = npt.NDArray[Any]

SUBJECT = "light mesh"
SPOKEN = {"vertex": "a vertex", "strength": "a strength", "colour": "a color", "emission": "an emission"}
# Triangles thinner than this (4 sqrt(3) area / sum of squared sides; 1 for equilateral) count as degenerate.
LEAST_QUALITY = 1e-6
# Depth in front of the source surface that counts, as a share of the size (square root of the area) of the light.
NOTICEABLE_DEPTH = 1e-3
NOTICEABLE_SHARE = 0.01
# A light floats in front of its surface if the part nearest to it is further away than this share of the relief.
RELIEF = 0.5
# Triangles of each region at which the thickness of the body is looked for, or up to twice as many.
THICKNESS_PLACES = 24
# Mean cosine between a light and its source samples below which it counts as inside out: a light that stands for a
# small knob may well have a mean about zero, a flipped one has nearly -1.
INSIDE_OUT_COSINE = -0.3
# Share of the work that is done when the nearest lights are known, and when the joints are.
NEAREST_TIME, JOINTS_TIME = 0.45, 0.7


def check_light_mesh(
    light_mesh: VirtualLightMesh,
    meshes: Sequence[Mesh] = (),
    report: Report = lambda share: None,
    light_of_triangle: Sequence[Int32] | None = None,
    history: LightHistory | None = None,
) -> tuple[Finding, ...]:
    """Findings on `light_mesh`, the gravest first; none for a sound one. Their kinds are those of finding_kinds.py.

    meshes: the visible surface, for what lights and surface should share: tags, and whether a body is too thin for its
    lights. Reflectance is judged by colour alone; the strength that makes up for lost area is expected to exceed 1.
    report: called with the share of the work that is done, may raise. light_of_triangle: for each mesh the light of
    each of its triangles, -1 for none, where that is known; the nearest lights by default. history: how the lights were
    made, where that is known.
    """
    if not len(light_mesh):
        return (Finding(SUBJECT, "it has no lights", "create it from a selection, or draw lights", kinds.EMPTY),)
    broken = _broken(light_mesh)
    if broken:
        return tuple(broken)
    surface = _surface(light_mesh, meshes, light_of_triangle, history, between(report, 0.0, NEAREST_TIME))
    report(NEAREST_TIME)
    marks = None if history is None else history.marks
    found = [*_degenerate(light_mesh), *_joints(light_mesh, marks, between(report, NEAREST_TIME, JOINTS_TIME))]
    found += _source_findings(light_mesh, surface, between(report, JOINTS_TIME, 1.0))
    report(1.0)
    return (*found, *_bright(light_mesh), *_lost_tags(light_mesh, meshes))


@dataclass(frozen=True)
class _Surface:
    """The visible surface, each triangle with its light, -1 for none. corners: (t, 3, 3). left_out: (t,) bool, whether
    tags or links leave out that light or it stands for something else. is_open: (t,) bool, of a shell with a border."""

    light_mesh: VirtualLightMesh
    corners: Float64
    lights: Int64
    left_out: Bool
    is_open: Bool

    def excused(self) -> Bool:
        """(n,) lights that their whole region leaves out."""
        return self._share(self.left_out, self.lights >= 0) >= 1.0 - NOTICEABLE_SHARE

    def thin(self, chosen: Bool, report: Report) -> Bool:
        """(n,) those of the chosen lights whose body is too thin for them, by some triangles of each."""
        asked = self._some(chosen)
        lights = np.where(asked, self.lights, -1)
        thin = thin_against(self.light_mesh.corners, lights, self.corners, self.tree, report)
        return self._share(thin, asked) > NOTICEABLE_SHARE

    def two_sided(self, report: Report) -> Bool:
        """(n,) lights that stand for sheets seen from both sides."""
        lights = np.where(self.left_out, -1, self.lights)
        if not (self.is_open & (lights >= 0)).any():
            return np.zeros(len(self.light_mesh), bool)
        seen = two_sided(lights, self.corners, self.is_open, self.tree, report)
        return self._share(seen, self.lights >= 0) > NOTICEABLE_SHARE

    @cached_property
    def tree(self) -> TriangleTree:
        """Of all triangles."""
        return build_tree(self.corners)

    @cached_property
    def areas(self) -> Float64:
        """(t,) m²."""
        return normals_and_areas(self.corners)[1]

    def _some(self, chosen: Bool) -> Bool:
        """(t,) up to THICKNESS_PLACES triangles of the region of each chosen light, evenly by row."""
        rows = np.flatnonzero((self.lights >= 0) & chosen[self.lights] & ~self.left_out)
        regions = rows_by_key(self.lights[rows], len(chosen), rows)
        owner = np.repeat(np.arange(len(chosen)), regions.lengths)
        place = np.arange(len(owner)) - regions.starts[owner]
        step = np.maximum(regions.lengths[owner] // THICKNESS_PLACES, 1)
        some = np.zeros(len(self.lights), bool)
        some[regions.values[place % step == 0]] = True
        return some

    def _share(self, chosen: Bool, among: Bool) -> Float64:
        """(n,) share by area of the chosen triangles among some of each region."""
        rows = np.flatnonzero(among & (self.lights >= 0))
        lights, areas = self.lights[rows], self.areas[rows]
        whole, part = (sum_by(lights, each, len(self.light_mesh)) for each in (areas, areas * chosen[rows]))
        share: Float64 = part / np.maximum(whole, np.finfo(float).tiny)
        return share


def _surface(
    light_mesh: VirtualLightMesh,
    meshes: Sequence[Mesh],
    light_of_triangle: Sequence[Int32] | None,
    history: LightHistory | None,
    report: Report,
) -> _Surface:
    filled = [mesh for mesh in meshes if len(mesh.triangles)]
    if not filled:
        none = np.zeros(0, bool)
        return _Surface(light_mesh, np.zeros((0, 3, 3)), np.zeros(0, np.int64), none, none)
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in filled])
    if light_of_triangle is None:
        lights = light_of_triangles(light_mesh.corners, corners, report).astype(np.int64)
    else:
        lights = np.concatenate(light_of_triangle).astype(np.int64)
    tags = np.concatenate([mesh.tag_ids for mesh in filled])
    left_out = (lights >= 0) & leaves_out(light_mesh.links, light_mesh.tag_ids[lights], tags)
    if history is not None and history.stands_for is not None:
        mesh_of = np.repeat(np.arange(len(meshes)), [len(mesh.triangles) for mesh in meshes])
        left_out |= (lights >= 0) & ~history.stands_for[history.light_mesh_of[lights], mesh_of]
    return _Surface(light_mesh, corners, lights, left_out, open_triangles(filled))


def _broken(light_mesh: VirtualLightMesh) -> list[Finding]:
    """Values with which nothing else can be judged."""
    found: list[Finding] = []
    values: dict[str, Rows] = {
        "vertex": light_mesh.corners.reshape(len(light_mesh), -1),
        "strength": light_mesh.strength[:, None],
        "colour": light_mesh.colour,
        "emission": light_mesh.emission,
    }
    for name, rows in values.items():
        bad = ~np.isfinite(rows).all(axis=1)
        _append(found, bad, rows, f"{SPOKEN[name]} that is not finite", "repair or delete them", kinds.NOT_FINITE)
    for name in ("colour", "emission", "strength"):
        bad = (values[name] < 0).any(axis=1)
        negative = f"a negative {SPOKEN[name].partition(' ')[2]}"
        _append(found, bad, values[name], negative, "use values of at least 0", kinds.NEGATIVE)
    samples = light_mesh.samples
    finite = np.isfinite(samples.positions).all(axis=1) & np.isfinite(samples.normals).all(axis=1)
    finite &= np.isfinite(samples.weights)
    if not finite.all():
        problem = f"{int((~finite).sum())} source samples are not finite"
        owner = np.repeat(np.arange(len(light_mesh)), np.diff(samples.offsets))
        remedy = "repair the visible surface and create the lights again"
        found.append(Finding(SUBJECT, problem, remedy, kinds.BAD_SAMPLES, _rows(np.unique(owner[~finite]))))
    return found


def _append(found: list[Finding], bad: Bool, values: Rows, problem: str, remedy: str, kind: str) -> None:
    if bad.any():
        first = int(np.argmax(bad))
        shown = np.array2string(np.asarray(values[first]), precision=4, separator=", ")
        problem = f"{_lights(bad, 'has', 'have')} {problem} (first: light {first}, {shown})"
        found.append(Finding(SUBJECT, problem, remedy, kind, _rows(np.flatnonzero(bad))))


def _rows(lights: Rows) -> tuple[int, ...]:
    return tuple(int(light) for light in lights)


def _degenerate(light_mesh: VirtualLightMesh) -> list[Finding]:
    corners = light_mesh.corners
    sides = np.roll(corners, -1, axis=1) - corners
    squares = np.einsum("ijk,ijk->i", sides, sides)
    quality = 4 * np.sqrt(3.0) * light_mesh.areas / np.where(squares > 0, squares, 1.0)
    found: list[Finding] = []
    remedy = "delete them or merge their vertices"
    _append(found, quality <= LEAST_QUALITY, light_mesh.areas, "no area, in m²", remedy, kinds.DEGENERATE)
    return found


def _joints(light_mesh: VirtualLightMesh, marks: Int32 | None, report: Report) -> list[Finding]:
    """Neighbours that face against each other, and lights that lie on others."""
    found: list[Finding] = []
    crossed = badly_joined(light_mesh)
    if crossed.any():
        problem = (
            f"{_lights(crossed, 'faces', 'face')} against the lights beside (first: light {int(np.argmax(crossed))})"
        )
        remedy = "flip them, so that all of a surface shine to one side"
        found.append(Finding(SUBJECT, problem, remedy, kinds.NON_MANIFOLD, _rows(np.flatnonzero(crossed))))
    twice = covered_twice(light_mesh, report, marks)
    if twice.any():
        lights, count = _lights(twice, "lies", "lie"), "counts" if twice.sum() == 1 else "count"
        problem = f"{lights} on others that face alike and {count} twice (first: light {int(np.argmax(twice))})"
        found.append(Finding(SUBJECT, problem, "delete them", kinds.OVERLAPPING, _rows(np.flatnonzero(twice))))
    return found


def _bright(light_mesh: VirtualLightMesh) -> list[Finding]:
    found: list[Finding] = []
    # float32 means of a white surface may end one rounding step above 1.
    bright = (light_mesh.colour > 1.0 + 1e-6).any(axis=1)
    problem = "a reflectance above 1: more light leaves than arrives, which is not physical but allowed"
    _append(found, bright, light_mesh.colour, problem, "lower the color if this is not meant", kinds.BRIGHT)
    return found


def _source_findings(light_mesh: VirtualLightMesh, surface: _Surface, report: Report) -> list[Finding]:
    samples = light_mesh.samples
    counts = np.diff(samples.offsets)
    found: list[Finding] = []
    unsampled = (counts == 0) & (light_mesh.colour.max(axis=1) > 0)
    problem, remedy = "no source samples, so no light reaches them", "move them closer behind a visible surface"
    _append(found, unsampled, counts, problem, remedy, kinds.UNSAMPLED)
    owner = np.repeat(np.arange(len(light_mesh)), counts)
    area = light_mesh.areas
    normal = light_mesh.area_vectors / np.where(area > 0, area, 1.0)[:, None]
    weight = samples.weights.astype(np.float64)
    facing = sum_by(owner, weight * (samples.normals * normal[owner]).sum(axis=1), len(area))
    reversed_ = (counts > 0) & (area > 0) & (facing < INSIDE_OUT_COSINE)
    problem = "their front away from the surface they stand for (mean cosine)"
    _append(found, reversed_, facing, problem, "flip their normals", kinds.INSIDE_OUT)
    share, depth, matters = _in_front(light_mesh, normal)
    share = np.where(reversed_, 0.0, share)
    found.extend(_depth_findings(share, depth, matters, surface, report))
    return found


def _in_front(light_mesh: VirtualLightMesh, normal: Float64) -> tuple[Float64, Float64, Bool]:
    """((n,) share of the surface of each light that lies behind its plane, (n,) m, how far; seed 002, figure 3.5, and
    (n,) whether it matters: creation leaves a light within the relief of its surface if it shines on none of that)."""
    samples, corners = light_mesh.samples, light_mesh.corners
    owner = np.repeat(np.arange(len(light_mesh)), np.diff(samples.offsets))
    offset = samples.positions - corners[owner, 0]
    depth = -np.einsum("ij,ij->i", offset, normal[owner])
    noticeable = np.maximum(NOTICEABLE_DEPTH * np.sqrt(light_mesh.areas), insets(corners))
    behind = depth > noticeable[owner]
    share = sum_by(owner, samples.weights.astype(np.float64) * behind, len(light_mesh))
    deepest, nearest = np.zeros(len(light_mesh)), np.full(len(light_mesh), np.inf)
    np.maximum.at(deepest, owner, depth)
    np.minimum.at(nearest, owner, depth)
    floats = nearest > np.maximum(noticeable, RELIEF * (deepest - nearest))
    return share, deepest, floats | (_own_light(light_mesh, owner) > ALLOWED)


def _own_light(light_mesh: VirtualLightMesh, owner: Int64) -> Float64:
    """(n,) mean share of its radiosity that the source samples of each light receive from it, rows of `owner`."""
    samples = light_mesh.samples
    normals = samples.normals.astype(np.float64)
    factors = seen_factors(samples.positions, normals, light_mesh.corners, owner) * light_mesh.strength[owner]
    return sum_by(owner, samples.weights * factors, len(light_mesh))


def _depth_findings(share: Float64, depth: Float64, matters: Bool, surface: _Surface, report: Report) -> list[Finding]:
    """What stands in front, apart where the body is too thin to move it (figure 3.7) or has no inside (figure 3.6)."""
    stands = (share > NOTICEABLE_SHARE) & ~surface.excused()
    thin = stands & surface.thin(stands, between(report, 0.0, 0.5))
    seen = surface.two_sided(between(report, 0.5, 1.0))
    found = []
    movable = stands & ~thin & matters
    remedy = "move them behind it, or give both a common tag where the body is thin"
    if movable.any():
        problem = f"{_stand(movable)} in front of the surface {_worst(movable, share, depth)}"
        found.append(Finding(SUBJECT, problem, remedy, kinds.IN_FRONT, _rows(np.flatnonzero(movable))))
    remedy = "give them and their surface a common tag, or use more lights there"
    if thin.any():
        problem = f"{_stand(thin)} in front of a body that is too thin to hide behind {_worst(thin, share, depth)}"
        found.append(Finding(SUBJECT, problem, remedy, kinds.THIN, _rows(np.flatnonzero(thin))))
    if seen.any():
        problem = f"{_stand(seen)} for a sheet that is seen from behind, too (first: light {int(np.argmax(seen))})"
        found.append(Finding(SUBJECT, problem, remedy, kinds.TWO_SIDED, _rows(np.flatnonzero(seen))))
    return found


def _lights(chosen: Bool, one: str, more: str) -> str:
    return counted_verb(int(chosen.sum()), "light", one, more)


def _stand(chosen: Bool) -> str:
    return _lights(chosen, "stands", "stand")


def _worst(chosen: Bool, share: Float64, depth: Float64) -> str:
    first = int(np.argmax(chosen))
    return f"(first: light {first}, {share[first]:.0%} of it; deepest {depth[chosen].max():.3g} m)"


def _lost_tags(light_mesh: VirtualLightMesh, meshes: Sequence[Mesh]) -> list[Finding]:
    known: Int32 = np.unique(np.concatenate([mesh.tag_ids for mesh in meshes])) if meshes else np.zeros(0, np.int32)
    linked = np.isin(light_mesh.tag_ids, light_mesh.links[np.isin(light_mesh.links[:, 1], known), 0])
    lost = (light_mesh.tag_ids != 0) & ~np.isin(light_mesh.tag_ids, known) & ~linked
    found: list[Finding] = []
    if meshes:
        problem, remedy = (
            "a tag that no visible surface carries, so it has no effect",
            "tag the surface alike, or clear it",
        )
        _append(found, lost, light_mesh.tag_ids, problem, remedy, kinds.LOST_TAG)
    return found
