# SPDX-License-Identifier: GPL-3.0-or-later
"""The Virtual Light Mesh: triangles that stand for the light that the real surface bounces (seed 002, chapter 3)."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .light_links import make_links, no_links, require_links
from .scene import Float32, Float64, Int32


@dataclass(frozen=True)
class SourceSamples:
    """Points on the visible surface where phase one measures irradiance, grouped by virtual light.

    positions: (s, 3) float64. normals: (s, 3) float32 unit. weights: (s,) float32, summing to 1 over each light.
    offsets: (n + 1,) int32; the samples of light i are offsets[i]:offsets[i + 1].
    """

    positions: Float64
    normals: Float32
    weights: Float32
    offsets: Int32


@dataclass(frozen=True)
class VirtualLightMesh:
    """Virtual lights as arrays of one row per triangle, world space.

    vertices: (v, 3) float64, m. triangles: (n, 3) int32, emitting on their counter-clockwise side. colour: (n, 3)
    float32, diffuse reflectance times the artist's multiplier, non-negative, any size. emission: (n, 3) float32,
    W/m². strength: (n,) float32, makes up for area lost in simplifying and insetting. tag_ids: (n,) int32, 0 for
    none. dynamic: (n,) bool. samples: where phase one measures. links: (k, 2) int32, sorted pairs (light tag, receiver
    tag) as `light_links.make_links` gives them: lights of the first id leave out surfaces of the second, too.

    Radiosity of a light: strength * (emission + colour * irradiance).
    """

    vertices: Float64
    triangles: Int32
    colour: Float32
    emission: Float32
    strength: Float32
    tag_ids: Int32
    dynamic: npt.NDArray[np.bool_]
    samples: SourceSamples
    links: Int32 = field(default_factory=no_links)

    def __len__(self) -> int:
        return len(self.triangles)

    @property
    def corners(self) -> Float64:
        """(n, 3, 3) float64: the three corners of each light, m."""
        return self.vertices[self.triangles]

    @property
    def area_vectors(self) -> Float64:
        """(n, 3) float64: area times unit normal of each light, m²."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return 0.5 * np.cross(b - a, c - a)

    @property
    def areas(self) -> Float64:
        """(n,) float64, m²."""
        return np.linalg.norm(self.area_vectors, axis=1)

    @property
    def reflected_power(self) -> Float64:
        """(3,) float64: sum of area x reflectance x strength, m²: the power sent out under a unit irradiance."""
        return (self.areas * self.strength) @ self.colour.astype(np.float64)

    @property
    def nominal_radiosity(self) -> Float64:
        """(n, 3) float64 W/m²: of lights on which 1 W/m² of each channel falls."""
        return np.asarray(self.strength[:, None] * (self.emission + self.colour), np.float64)

    def subset(self, chosen: npt.NDArray[np.bool_]) -> VirtualLightMesh:
        """The lights of `chosen`, (n,) bool, in order, with the vertices and samples that are theirs."""
        used, corners = np.unique(self.triangles[chosen], return_inverse=True)
        counts = np.diff(self.samples.offsets)
        sampled = np.repeat(chosen, counts)
        samples = SourceSamples(
            positions=self.samples.positions[sampled],
            normals=self.samples.normals[sampled],
            weights=self.samples.weights[sampled],
            offsets=np.concatenate([[0], np.cumsum(counts[chosen])]).astype(np.int32),
        )
        rows = {name: getattr(self, name)[chosen] for name in ("colour", "emission", "strength", "tag_ids", "dynamic")}
        triangles = corners.reshape(-1, 3).astype(np.int32)
        return VirtualLightMesh(
            vertices=self.vertices[used], triangles=triangles, samples=samples, links=self.links, **rows
        )


def empty_light_mesh() -> VirtualLightMesh:
    """A light mesh without lights."""
    samples = SourceSamples(
        np.zeros((0, 3)), np.zeros((0, 3), np.float32), np.zeros(0, np.float32), np.zeros(1, np.int32)
    )
    return VirtualLightMesh(
        vertices=np.zeros((0, 3)),
        triangles=np.zeros((0, 3), np.int32),
        colour=np.zeros((0, 3), np.float32),
        emission=np.zeros((0, 3), np.float32),
        strength=np.zeros(0, np.float32),
        tag_ids=np.zeros(0, np.int32),
        dynamic=np.zeros(0, bool),
        samples=samples,
    )


def join(light_meshes: list[VirtualLightMesh]) -> VirtualLightMesh:
    """All lights of several meshes as one, in order; each link holds for all of them."""
    parts = [part for part in light_meshes if len(part)]
    if not parts:
        return empty_light_mesh()
    vertex_starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    sample_starts = np.cumsum([0] + [len(part.samples.positions) for part in parts])
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("vertices", "colour", "emission", "strength", "tag_ids", "dynamic")
    }
    triangles = [part.triangles + start for part, start in zip(parts, vertex_starts, strict=True)]
    offsets = [part.samples.offsets[:-1] + start for part, start in zip(parts, sample_starts[:-1], strict=True)]
    samples = SourceSamples(
        positions=np.concatenate([part.samples.positions for part in parts]),
        normals=np.concatenate([part.samples.normals for part in parts]),
        weights=np.concatenate([part.samples.weights for part in parts]),
        offsets=np.concatenate([*offsets, sample_starts[-1:]]).astype(np.int32),
    )
    links = make_links(np.concatenate([part.links for part in parts]))
    return VirtualLightMesh(
        triangles=np.concatenate(triangles).astype(np.int32), samples=samples, links=links, **joined
    )


def require_valid(light_mesh: VirtualLightMesh) -> None:
    """Raises InvalidInput where an array is not finite, negative where it may not be, or of the wrong length."""
    count = len(light_mesh)
    for field_ in fields(light_mesh):
        values = getattr(light_mesh, field_.name)
        if field_.name in ("vertices", "samples", "links"):
            continue
        if len(values) != count:
            problem = f"{len(values)} rows for {count} lights"
            raise InvalidInput(f"light mesh {field_.name}", problem, "give one row per light")
    known = (light_mesh.triangles >= 0) & (light_mesh.triangles < len(light_mesh.vertices))
    if not known.all():
        row = int(np.argmin(known.all(axis=1)))
        problem = f"corners {light_mesh.triangles[row]} of {len(light_mesh.vertices)} vertices"
        raise InvalidInput(f"light {row}", problem, "give indices of vertices that there are")
    for name in ("vertices", "colour", "emission", "strength"):
        values = getattr(light_mesh, name)
        if not np.isfinite(values).all():
            row = int(np.argwhere(~np.isfinite(values))[0][0])
            raise InvalidInput(f"light mesh {name} row {row}", f"{values[row]} is not finite", "delete or repair it")
    for name in ("colour", "emission", "strength"):
        values = getattr(light_mesh, name)
        if (values < 0).any():
            row = int(np.argwhere(values < 0)[0][0])
            raise InvalidInput(f"light {row} {name}", f"{values[row]} is negative", "use values of at least 0")
    if len(light_mesh.samples.offsets) != count + 1:
        problem = f"{len(light_mesh.samples.offsets) - 1} groups for {count} lights"
        raise InvalidInput("light mesh samples", problem, "sample every light")
    require_links(light_mesh.links)
