# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong, or may surprise, in a virtual light mesh: one finding per kind, with count, first light and remedy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from .light_mesh import VirtualLightMesh
from .mesh_topology import Bool, Int64
from .placement import insets
from .scene import Finding, Float64, Mesh

Rows = npt.NDArray[Any]

SUBJECT = "light mesh"
# Triangles thinner than this (4 sqrt(3) area / sum of squared sides; 1 for equilateral) count as degenerate.
LEAST_QUALITY = 1e-6
# Depth in front of the source surface that counts, as a share of the size (square root of the area) of the light.
NOTICEABLE_DEPTH = 1e-3
NOTICEABLE_SHARE = 0.01
# Mean cosine between a light and its source samples below which it counts as inside out: a light that stands for a
# small knob may well have a mean about zero, a flipped one has nearly -1.
INSIDE_OUT_COSINE = -0.3


def check_light_mesh(light_mesh: VirtualLightMesh, meshes: Sequence[Mesh] = ()) -> tuple[Finding, ...]:
    """Findings on `light_mesh`, the gravest first; none for a sound one.

    meshes: the visible surface, for tags that lights and surface should share. Reflectance is judged by colour alone;
    the strength that makes up for lost area is expected to exceed 1.
    """
    if not len(light_mesh):
        return (Finding(SUBJECT, "it has no lights", "create it from a selection, or draw lights"),)
    broken = _broken(light_mesh)
    if broken:
        return tuple(broken)
    found = [*_degenerate(light_mesh), *_source_findings(light_mesh), *_bright(light_mesh), *_tags(light_mesh, meshes)]
    return tuple(found)


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
        _append(found, ~np.isfinite(rows).all(axis=1), rows, f"a {name} that is not finite", "repair or delete them")
    for name in ("colour", "emission", "strength"):
        negative = (values[name] < 0).any(axis=1)
        _append(found, negative, values[name], f"a negative {name}", "use values of at least 0")
    samples = light_mesh.samples
    finite = np.isfinite(samples.positions).all(axis=1) & np.isfinite(samples.normals).all(axis=1)
    if not (finite & np.isfinite(samples.weights)).all():
        problem = f"{int((~finite).sum())} source samples are not finite"
        found.append(Finding(SUBJECT, problem, "repair the visible surface and create the lights again"))
    return found


def _append(found: list[Finding], bad: Bool, values: Rows, problem: str, remedy: str) -> None:
    if bad.any():
        first = int(np.argmax(bad))
        shown = np.array2string(np.asarray(values[first]), precision=4, separator=", ")
        lights = "1 light has" if bad.sum() == 1 else f"{int(bad.sum())} lights have"
        found.append(Finding(SUBJECT, f"{lights} {problem} (first: light {first}, {shown})", remedy))


def _degenerate(light_mesh: VirtualLightMesh) -> list[Finding]:
    corners = light_mesh.corners
    sides = np.roll(corners, -1, axis=1) - corners
    squares = np.einsum("ijk,ijk->i", sides, sides)
    quality = 4 * np.sqrt(3.0) * light_mesh.areas / np.where(squares > 0, squares, 1.0)
    found: list[Finding] = []
    _append(found, quality <= LEAST_QUALITY, light_mesh.areas, "no area, in m²", "delete them or merge their vertices")
    return found


def _bright(light_mesh: VirtualLightMesh) -> list[Finding]:
    found: list[Finding] = []
    # float32 means of a white surface may end one rounding step above 1.
    bright = (light_mesh.colour > 1.0 + 1e-6).any(axis=1)
    problem = "a reflectance above 1: more light leaves than arrives, which is not physical but allowed"
    _append(found, bright, light_mesh.colour, problem, "lower the colour if this is not meant")
    return found


def _source_findings(light_mesh: VirtualLightMesh) -> list[Finding]:
    samples = light_mesh.samples
    counts = np.diff(samples.offsets)
    found: list[Finding] = []
    unsampled = (counts == 0) & (light_mesh.colour.max(axis=1) > 0)
    problem, remedy = "no source samples, so no light reaches them", "move them closer behind a visible surface"
    _append(found, unsampled, counts, problem, remedy)
    owner = np.repeat(np.arange(len(light_mesh)), counts)
    area = light_mesh.areas
    normal = light_mesh.area_vectors / np.where(area > 0, area, 1.0)[:, None]
    weight = samples.weights.astype(np.float64)
    facing = np.bincount(owner, weights=weight * (samples.normals * normal[owner]).sum(axis=1), minlength=len(area))
    reversed_ = (counts > 0) & (area > 0) & (facing < INSIDE_OUT_COSINE)
    problem = "their front away from the surface they stand for (mean cosine)"
    _append(found, reversed_, facing, problem, "flip their normals")
    found.extend(_in_front(light_mesh, owner, normal, weight, reversed_))
    return found


def _in_front(
    light_mesh: VirtualLightMesh, owner: Int64, normal: Float64, weight: Float64, ignored: Bool
) -> list[Finding]:
    """Lights whose plane stands in front of their own surface (seed 002, section 3.4, figure 3.5)."""
    corners = light_mesh.corners
    offset = light_mesh.samples.positions - corners[owner, 0]
    depth = -np.einsum("ij,ij->i", offset, normal[owner])
    noticeable = np.maximum(NOTICEABLE_DEPTH * np.sqrt(light_mesh.areas), insets(corners))
    behind = depth > noticeable[owner]
    share = np.bincount(owner, weights=weight * behind, minlength=len(light_mesh))
    bad = (share > NOTICEABLE_SHARE) & ~ignored
    if not bad.any():
        return []
    deepest = float(depth[behind & bad[owner]].max())
    lights = "1 light stands" if bad.sum() == 1 else f"{int(bad.sum())} lights stand"
    problem = (
        f"{lights} in front of the surface (first: light {int(np.argmax(bad))}, {share[np.argmax(bad)]:.0%} of it; "
        f"deepest {deepest:.3g} m)"
    )
    return [Finding(SUBJECT, problem, "move them behind it, or give both a common tag where the body is thin")]


def _tags(light_mesh: VirtualLightMesh, meshes: Sequence[Mesh]) -> list[Finding]:
    known = np.unique(np.concatenate([mesh.tag_ids for mesh in meshes])) if meshes else np.zeros(0, np.int32)
    lost = (light_mesh.tag_ids != 0) & ~np.isin(light_mesh.tag_ids, known)
    found: list[Finding] = []
    if meshes:
        problem = "a tag that no visible surface carries, so it has no effect"
        _append(found, lost, light_mesh.tag_ids, problem, "tag the surface alike, or clear the tag")
    return found
