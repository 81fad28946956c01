# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes with mirrors, and in float64 where their reflections are: rays against every triangle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.render.closed_rooms import inward_box
from tests.render.rooms import camera_at, quad
from vlm_addon.core.scene import DIFFUSE, Camera, Float32, Float64, Material, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.local_space import LocalSpace, make_local_space
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBuffer, GBufferPass
from vlm_addon.render.passes.screen_reflection import ReflectionSettings, ScreenReflectionPass
from vlm_addon.render.view import CENTRED, View, make_view

SIZE = (96, 72)
MIRROR, MATT = 0, 1
MATERIALS = (
    Material("mirror", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.0),
    Material("matt", DIFFUSE, (0.5, 0.5, 0.5)),
)


def mirror_scene(*meshes: Mesh, camera: Camera | None = None, mirror: Material = MATERIALS[0]) -> SceneSnapshot:
    """A mirror on the floor, a wall behind it, and `meshes`; by default a block on the floor and a slanted board."""
    floor = quad((-3, -3, 0), (6, 0, 0), (0, 5, 0), material=MIRROR, name="floor")
    wall = quad((-3, 2, 0), (6, 0, 0), (0, 0, 4), material=MATT, name="wall")
    if not meshes:
        block = inward_box((-0.9, -0.2, 0.0), (-0.2, 0.5, 0.9), [MATT] * 6, outward=True)
        meshes = (*block, quad((0.5, 0.2, 0.1), (1.0, 0.6, 0.0), (0.0, 0.5, 1.1), material=MATT, name="board"))
    camera = camera or camera_at((0.2, -4.0, 1.6), (0.0, 0.3, 0.6), lens=30.0)
    return SceneSnapshot("mirror", (floor, wall, *meshes), (mirror, MATERIALS[1]), camera=camera)


@dataclass(frozen=True)
class Reflected:
    """Of a picture, row 0 at the top. image: of ScreenReflectionPass. hits: likewise, distances in m. position, normal:
    of the surfaces, in world space, m. material: index, -1 where nothing shows."""

    image: Float32
    hits: Float32
    position: Float64
    normal: Float64
    material: np.ndarray
    view: View
    space: LocalSpace

    @property
    def confidence(self) -> Float32:
        """(h, w) in [0, 1]."""
        return self.image[..., 3]


def upload(context: object, image: np.ndarray) -> object:
    """An RGBA32F texture of (h, w, 4), row 0 at the top."""
    height, width = image.shape[:2]
    rows = np.ascontiguousarray(image[::-1], np.float32).tobytes()
    return context.texture((width, height), 4, rows, dtype="f4")  # type: ignore[attr-defined]


def reflected(
    device: Device,
    snapshot: SceneSnapshot,
    settings: ReflectionSettings | None = None,
    lit: Float32 | None = None,
    size: tuple[int, int] = SIZE,
    jitter: tuple[float, float] = CENTRED,
    sample_index: int = 0,
) -> Reflected:
    """One picture. lit: (h, w, 4), by default 1 everywhere."""
    assert snapshot.camera is not None
    space = make_local_space(snapshot)
    local = space.scene(snapshot)
    assert local.camera is not None
    lit = np.ones((size[1], size[0], 4), np.float32) if lit is None else lit
    with device.current() as context:
        geometry = GpuGeometry(context, local, np.zeros(3))
        view = make_view(local.camera, *size, geometry.origin, jitter)
        gbuffer = GBufferPass(context, device.shaders, *size).render(geometry, view, sample_index)
        reflection = ScreenReflectionPass(context, device.shaders, *size, settings or ReflectionSettings())
        image = read_image(reflection.render(gbuffer, view, upload(context, lit), sample_index))  # type: ignore[arg-type]
        hits = read_image(reflection.hits)
        position, normal, material = _surfaces(gbuffer, space)
    hits[..., 2] *= space.unit
    return Reflected(image, hits, position, normal, material, view, space)


def _surfaces(gbuffer: GBuffer, space: LocalSpace) -> tuple[Float64, Float64, np.ndarray]:
    position, normal, ids = (read_image(image) for image in (gbuffer.position, gbuffer.shading_normal, gbuffer.ids))
    shown = np.any(normal[..., :3] != 0.0, axis=2)
    return space.world_points(position[..., :3]), normal[..., :3].astype(float), np.where(shown, ids[..., 0], -1)


def first_hits(snapshot: SceneSnapshot, origins: Float64, directions: Float64, least: float = 1e-6) -> Float64:
    """(n,) distance along unit directions to the nearest triangle of either side, inf for none."""
    nearest = np.full(len(origins), np.inf)
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in snapshot.meshes])
    for a, b, c in corners:
        across = np.cross(directions, c - a)
        determinant = across @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", origins - a, across) / determinant
            other = np.cross(origins - a, b - a)
            v = np.einsum("ij,ij->i", directions, other) / determinant
            t = other @ (c - a) / determinant
            inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > least)
        nearest = np.where(inside & (t < nearest), t, nearest)
    return nearest


BROKEN = (np.nan, np.inf, -np.inf, -1.0, 1e38, 0.0)


def broken(values: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """float32 `values` with a hundredth of them replaced by what they should never be."""
    spoiled = np.where(random.random(values.shape) < 0.01, random.choice(BROKEN, values.shape), values)
    return spoiled.astype(np.float32)


def broken_gbuffer(context: object, position: Float64, normal: Float64, random: np.random.Generator) -> GBuffer:
    """Smooth metal of (h, w, 3) positions and normals, 900 deep, every texture broken here and there."""

    def with_alpha(values: Float64, alpha: float | np.ndarray) -> object:
        image = np.concatenate([values, np.broadcast_to(alpha, (*values.shape[:2], 1))], axis=2)
        return upload(context, broken(image, random))

    ones = np.ones_like(position)
    textures = [
        with_alpha(position, 900.0),
        with_alpha(normal, random.uniform(0.0, 0.4, (*position.shape[:2], 1))),
        with_alpha(normal, 1.0),
        with_alpha(ones, 0.5),
        with_alpha(0.0 * ones, 1.5),
    ]
    height, width = position.shape[:2]
    ids = np.ones((height, width, 4), np.int32).tobytes()
    return GBuffer(*textures, context.texture((width, height), 4, ids, dtype="i4"))  # type: ignore[arg-type, attr-defined]


@dataclass(frozen=True)
class Truth:
    """Of (n,) mirror rays. place: pixels from the lower left corner of where they hit something; on_screen: whether
    the picture shows that. distance: m, inf for nothing."""

    place: Float64
    on_screen: np.ndarray
    distance: Float64


def mirror_truth(snapshot: SceneSnapshot, found: Reflected, pixels: np.ndarray) -> Truth:
    """Where the mirror rays of `pixels`, a mask, go. Their directions come from the pictured place and normal."""
    assert snapshot.camera is not None
    matrix = snapshot.camera.matrix_world
    origins, normals = found.position[pixels], found.normal[pixels]
    eye, backward = matrix[:3, 3], matrix[:3, 2]
    to_eye = np.tile(backward, (len(origins), 1)) if found.view.is_orthographic else eye - origins
    to_eye /= np.linalg.norm(to_eye, axis=1, keepdims=True)
    directions = 2.0 * np.einsum("ij,ij->i", normals, to_eye)[:, None] * normals - to_eye
    distance = first_hits(snapshot, origins, directions, 1e-4)
    met = np.where(np.isfinite(distance), distance, 1.0)[:, None] * directions + origins
    height, width = pixels.shape
    local = np.concatenate([found.space.local_points(met), np.ones((len(met), 1))], axis=1)
    clip = local @ found.view.clip_from_local.T
    place = (clip[:, :2] / clip[:, 3:] * 0.5 + 0.5) * (width, height)
    inside = (clip[:, 3] > 0.0) & (place > 0.0).all(axis=1) & (place < (width, height)).all(axis=1)
    back = np.tile(backward, (len(met), 1)) if found.view.is_orthographic else eye - met
    away = np.linalg.norm(back, axis=1) if not found.view.is_orthographic else np.full(len(met), np.inf)
    seen = first_hits(snapshot, met, back / np.linalg.norm(back, axis=1, keepdims=True), 1e-4) >= away - 1e-4
    # The eye sees the side that the ray comes to: what is hit from behind shows its other side.
    return Truth(place, np.isfinite(distance) & inside & seen & _same_side(snapshot, met, directions, back), distance)


def _same_side(snapshot: SceneSnapshot, points: Float64, directions: Float64, to_eye: Float64) -> np.ndarray:
    """Whether the ray comes to the side of the nearest plane that the eye is on."""
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in snapshot.meshes])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    offset = points[:, None] - middles
    off_plane = np.abs(np.einsum("nmk,mk->nm", offset, normals))
    off_plane[np.linalg.norm(offset, axis=2) > reach] = np.inf
    normal = normals[off_plane.argmin(axis=1)]
    against = np.einsum("ij,ij->i", normal, directions) * np.einsum("ij,ij->i", normal, to_eye)
    return against < 0.0
