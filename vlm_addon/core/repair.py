# SPDX-License-Identifier: GPL-3.0-or-later
"""A repair for each kind of fault that the check finds (validate.py), as arrays that whoever stores the lights writes.

Every repair keeps to the lights that it is given and leaves the rest as it is. Lights are moved behind their surface
and never through its back; where a body is too thin for that, lights and surface get tags (seed 002, section 3.4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from . import finding_kinds as kinds
from .counting import counted
from .errors import InvalidInput
from .light_mesh import VirtualLightMesh
from .light_regions import facing, pushing_regions
from .mesh_topology import Bool, Int64, Rows, only_rows, rows_by_key
from .nearest_lights import pair_nearest
from .own_shares import own_shares
from .own_tags import tagged_regions
from .placement import STEEPEST_COSINE, insets, intrusions, place_behind
from .plates import find_plates, plates_behind
from .scene import UNTAGGED, Float32, Float64, Int32, Mesh
from .triangle_tree import build_tree
from .validate import NOTICEABLE_DEPTH, check_light_mesh

# The most of the light that arrives that a surface can send back.
BRIGHTEST = 1.0
# Points of each region at which its own light tells whether a move has made it worse.
JUDGED_POINTS = 32
# A push moves vertices by a share of their lights' size; lights that stand far in front take several.
MOST_PUSHES = 8


def _no_rows() -> Int64:
    return np.zeros(0, np.int64)


@dataclass(frozen=True)
class Repair:
    """What to change; None, or no rows, where something stays as it is.

    vertices: (v, 3) float64, m, all of the light mesh. flipped: lights to turn over. deleted: lights to take away.
    tag_ids: (n,) int32, of all lights. triangle_tags: for each mesh, (its triangles,) int32, of all its triangles.
    links: (k, 2) int32, of the light mesh, all of them. colour, emission: (n, 3) float32. strength: (n,) float32, all
    of the light mesh. sentence: what was done, for the artist.
    """

    sentence: str
    vertices: Float64 | None = None
    flipped: Int64 = field(default_factory=_no_rows)
    deleted: Int64 = field(default_factory=_no_rows)
    tag_ids: Int32 | None = None
    triangle_tags: tuple[Int32, ...] | None = None
    links: Int32 | None = None
    colour: Float32 | None = None
    emission: Float32 | None = None
    strength: Float32 | None = None

    def applied(self, light_mesh: VirtualLightMesh) -> VirtualLightMesh:
        """`light_mesh` with the changes to its lights; samples stay where they are."""
        triangles = light_mesh.triangles.copy()
        triangles[self.flipped] = triangles[self.flipped][:, ::-1]
        given = {
            name: getattr(self, name)
            for name in ("vertices", "tag_ids", "links", "colour", "emission", "strength")
            if getattr(self, name) is not None
        }
        changed = replace(light_mesh, triangles=triangles, **given)
        if not len(self.deleted):
            return changed
        kept = np.ones(len(light_mesh), bool)
        kept[self.deleted] = False
        return changed.subset(kept)

    def applied_to(self, meshes: Sequence[Mesh]) -> tuple[Mesh, ...]:
        """The visible surface with the tags that it gets."""
        if self.triangle_tags is None:
            return tuple(meshes)
        return tuple(replace(mesh, tag_ids=tags) for mesh, tags in zip(meshes, self.triangle_tags, strict=True))


@dataclass(frozen=True)
class _Work:
    """What a repair is made from. regions: the nearest light of each triangle of each mesh."""

    light_mesh: VirtualLightMesh
    meshes: Sequence[Mesh]
    chosen: Bool
    light_of_triangle: tuple[Int32, ...] | None
    face_of_triangle: Sequence[npt.ArrayLike] | None
    polygon_of_light: npt.ArrayLike | None

    @property
    def rows(self) -> Int64:
        return np.flatnonzero(self.chosen)

    def regions(self) -> tuple[Int32, ...]:
        """The light of each triangle of each mesh."""
        if self.light_of_triangle is not None:
            return self.light_of_triangle
        return pair_nearest(self.light_mesh, self.meshes)

    def polygons(self) -> Int64:
        """(n,) the polygon of each light."""
        if self.polygon_of_light is None:
            return np.arange(len(self.light_mesh))
        return np.asarray(self.polygon_of_light, np.int64)

    def tagged(self, rows: Int64) -> tuple[Int32, tuple[Int32, ...], Int32]:
        """Tags of lights and triangles, and links, with which the regions of `rows` leave out their lights."""
        return tagged_regions(self.light_mesh, self.meshes, rows, self.regions(), self.face_of_triangle)


def can_fix(kind: str) -> bool:
    """Whether there is a repair for findings of this kind."""
    return kind in _REPAIRS


def fix(
    kind: str,
    light_mesh: VirtualLightMesh,
    meshes: Sequence[Mesh],
    rows: npt.ArrayLike,
    light_of_triangle: tuple[Int32, ...] | None = None,
    face_of_triangle: Sequence[npt.ArrayLike] | None = None,
    polygon_of_light: npt.ArrayLike | None = None,
) -> Repair:
    """The repair of a finding of `kind` (finding_kinds.py) on the lights `rows`.

    meshes: the visible surface. light_of_triangle: for each of them, the light of each triangle; by default the
    nearest. face_of_triangle: for each of them, (its triangles,) the face that each triangle is part of, since one face
    carries one tag; every triangle by itself by default. polygon_of_light: (n,) a number of the polygon that each light
    is part of, which stays flat where it moves; every light by itself by default. Raises InvalidInput for a kind that
    has no repair, or rows that there are not.
    """
    if kind not in _REPAIRS:
        raise InvalidInput(f"finding {kind!r}", "there is no repair for it", "select the lights and mend them by hand")
    found = np.unique(np.asarray(rows, np.int64))
    if len(found) and not 0 <= found[0] <= found[-1] < len(light_mesh):
        problem = f"row {found[-1] if found[-1] >= len(light_mesh) else found[0]} of {len(light_mesh)} lights"
        raise InvalidInput(f"finding {kind!r}", problem, "check the light mesh again")
    chosen = np.zeros(len(light_mesh), bool)
    chosen[found] = True
    return _REPAIRS[kind](_Work(light_mesh, meshes, chosen, light_of_triangle, face_of_triangle, polygon_of_light))


def _flipped(work: _Work) -> Repair:
    return Repair(f"Turned {_lights(len(work.rows))} over", flipped=work.rows)


def _deleted(work: _Work) -> Repair:
    return Repair(f"Deleted {_lights(len(work.rows))}", deleted=work.rows)


def _finite(work: _Work) -> Repair:
    """Values that are not finite become 0 (strength 1); lights with such a vertex have no place and go."""
    mesh = work.light_mesh
    lost = work.chosen & ~np.isfinite(mesh.corners).all(axis=(1, 2))
    chosen = work.chosen & ~lost
    colour, emission = (_where(chosen, values, 0.0) for values in (mesh.colour, mesh.emission))
    sentence = f"Cleared the broken values of {_lights(int(chosen.sum()))}"
    if lost.any():
        sentence += f", deleted {_lights(int(lost.sum()))} with a broken vertex"
    strength = _where(chosen, mesh.strength, 1.0)
    return Repair(sentence, deleted=np.flatnonzero(lost), colour=colour, emission=emission, strength=strength)


def _where(chosen: Bool, values: Float32, instead: float) -> Float32:
    broken = chosen.reshape(-1, *[1] * (values.ndim - 1)) & ~np.isfinite(values)
    return np.where(broken, np.float32(instead), values)


def _not_negative(work: _Work) -> Repair:
    mesh = work.light_mesh
    raised = [values.copy() for values in (mesh.colour, mesh.emission, mesh.strength)]
    for values in raised:
        values[work.chosen] = np.maximum(values[work.chosen], 0.0)
    sentence = f"Raised the negative values of {_lights(len(work.rows))} to 0"
    return Repair(sentence, colour=raised[0], emission=raised[1], strength=raised[2])


def _dimmed(work: _Work) -> Repair:
    """Colours above 1 are scaled down whole, so that their hue stays."""
    colour = work.light_mesh.colour.copy()
    most = colour[work.chosen].max(axis=1, initial=0.0)
    colour[work.chosen] *= (BRIGHTEST / np.maximum(most, BRIGHTEST))[:, None]
    return Repair(f"Dimmed {_lights(len(work.rows))} to a reflectance of {BRIGHTEST:g} at most", colour=colour)


def _untagged(work: _Work) -> Repair:
    tags = np.where(work.chosen, UNTAGGED, work.light_mesh.tag_ids).astype(np.int32)
    return Repair(f"Cleared the tags of {_lights(len(work.rows))}", tag_ids=tags)


def _tagged(work: _Work) -> Repair:
    tags, triangle_tags, links = work.tagged(work.rows)
    sentence = f"Tagged {_lights(len(work.rows))} and the surface that they stand for"
    return Repair(sentence, tag_ids=tags, triangle_tags=triangle_tags, links=links)


def _behind(work: _Work) -> Repair:
    """Moved behind the surface; strength keeps the power where areas change. What is too thin gets tags."""
    mesh = work.light_mesh
    corners = _source_corners(work.meshes)
    nearest = only_rows(_rows_of(work.regions(), len(mesh)), work.chosen)
    # Only what the chosen lights stand for pushes: the others stay, but for the vertices that they share.
    corners, pushing = pushing_regions(mesh, nearest, corners, build_tree(corners))
    pushing = only_rows(pushing, work.chosen)
    vertices = _moved_behind(work, pushing, corners)
    moved = replace(mesh, vertices=vertices)
    strength = (mesh.strength * _area_ratios(mesh.areas, moved.areas, work.polygons())).astype(np.float32)
    count = int(work.chosen[(vertices[mesh.triangles] != mesh.corners).any(axis=(1, 2))].sum())
    repair = Repair(f"Moved {_lights(count)} behind the surface", vertices=vertices, strength=strength)
    left = work.chosen & _still_in_front(moved, pushing, corners)
    if not left.any():
        return repair
    tags, triangle_tags, links = work.tagged(np.flatnonzero(left))
    sentence = f"{repair.sentence}; tagged {_lights(int(left.sum()))} for which the body is too thin"
    return replace(repair, sentence=sentence, tag_ids=tags, triangle_tags=triangle_tags, links=links)


def _moved_behind(work: _Work, pushing: Rows, corners: Float64) -> Float64:
    """(v, 3) m: polygons of several lights go back as a whole, single triangles as in creation, until none can."""
    mesh = work.light_mesh
    triangles = mesh.triangles.astype(np.int64)
    plates = find_plates(mesh.vertices, triangles, work.polygons())
    in_plate = plates.of_light >= 0
    whole = only_rows(pushing, in_plate)
    vertices, held = plates_behind(mesh.vertices, triangles, plates, whole, corners, build_tree(corners))
    single = only_rows(pushing, ~in_plate)
    for _ in range(MOST_PUSHES):
        pushed = _pushed(vertices, triangles, single, corners)
        pushed[held] = vertices[held]
        if (pushed == vertices).all():
            break
        vertices = pushed
    return vertices


def _pushed(vertices: Float64, triangles: Int64, pushing: Rows, corners: Float64) -> Float64:
    """(v, 3) m: one push, without what makes own light worse."""
    placed = place_behind(vertices, triangles, pushing, corners)
    before, after = (
        own_shares(positions[triangles], pushing, corners, JUDGED_POINTS) for positions in (vertices, placed.positions)
    )
    if not (after > before).any():
        return placed.positions
    # A light may stand in front of a part of its region that it does not shine on, and do so where it is pushed.
    return place_behind(vertices, triangles, only_rows(pushing, after <= before), corners).positions


def _area_ratios(before: Float64, after: Float64, polygons: Int64) -> Float64:
    """(n,) factor that makes up for the area that the polygon of each light has lost."""
    number = np.unique(polygons, return_inverse=True)[1]
    whole = [np.bincount(number, weights=areas)[number] for areas in (before, after)]
    return np.divide(whole[0], whole[1], out=np.ones(len(number)), where=whole[1] > 0.0)


def _still_in_front(light_mesh: VirtualLightMesh, regions: Rows, corners: Float64) -> Bool:
    """(n,) lights in front of what pushes them, or that the check would find in front of their samples."""
    lights = light_mesh.corners
    noticeable = np.maximum(NOTICEABLE_DEPTH * np.sqrt(light_mesh.areas), insets(lights))
    found: Bool = intrusions(lights, facing(corners, regions, lights, STEEPEST_COSINE), corners) > noticeable
    for finding in check_light_mesh(light_mesh):
        if finding.kind == kinds.IN_FRONT:
            found[list(finding.lights)] = True
    return found


def _source_corners(meshes: Sequence[Mesh]) -> Float64:
    filled = [mesh.positions[mesh.triangles] for mesh in meshes if len(mesh.triangles)]
    return np.concatenate(filled) if filled else np.zeros((0, 3, 3))


def _rows_of(light_of_triangle: tuple[Int32, ...], count: int) -> Rows:
    lights = np.concatenate([*light_of_triangle, np.zeros(0, np.int32)]).astype(np.int64)
    held = np.flatnonzero(lights >= 0)
    return rows_by_key(lights[held], count, held)


def _lights(count: int) -> str:
    return counted(count, "light")


_REPAIRS: dict[str, Callable[[_Work], Repair]] = {
    kinds.NOT_FINITE: _finite,
    kinds.NEGATIVE: _not_negative,
    kinds.DEGENERATE: _deleted,
    kinds.NON_MANIFOLD: _flipped,
    kinds.INSIDE_OUT: _flipped,
    kinds.IN_FRONT: _behind,
    kinds.THIN: _tagged,
    kinds.TWO_SIDED: _tagged,
    kinds.OVERLAPPING: _deleted,
    kinds.BRIGHT: _dimmed,
    kinds.LOST_TAG: _untagged,
}
