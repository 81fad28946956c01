# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of glossy surface points, and the integral of their BRDF over lights by brute force."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.fit_ltc import mirrored, mirrored_density
from tests.render.pixels import Pixels, radiosity_rows
from tests.render.rooms import camera_at
from vlm_addon.core.brdf import principled_brdf
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.progress import Progress, silent
from vlm_addon.core.scene import Camera, Float32, Float64
from vlm_addon.render.device import Device
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBuffer
from vlm_addon.render.passes.light_mesh_reflection import LightMeshReflectionPass
from vlm_addon.render.view import make_view
from vlm_addon.render.virtual_lights import GpuVirtualLights

if TYPE_CHECKING:
    import moderngl

MODELS = {"DIFFUSE": 0, "PRINCIPLED": 1}
CAMERA = camera_at((0.4, -0.3, 3.0), (0.0, 0.0, 0.0))


class GlossyPixels(Pixels):
    """Random points on the eye's side of their surfaces, with a material each. metallic is 0, on a black base, or 1, so
    that there is no diffuse reflection to be told apart."""

    def __init__(
        self, generator: np.random.Generator, size: tuple[int, int], roughness: float | None = None, metallic: int = 1
    ) -> None:
        super().__init__(generator, size)
        shape = self.shown.shape
        self.camera: Camera = CAMERA
        self.normals *= np.sign((self.normals * self.to_eye()).sum(-1, keepdims=True)).astype(np.float32)
        chosen = generator.uniform(0.0, 1.0, shape) if roughness is None else np.full(shape, roughness)
        self.roughness = chosen.astype(np.float32)
        self.metallic = np.full(shape, metallic, np.float32)
        self.color = (metallic * generator.uniform(0.0, 1.0, (*shape, 3))).astype(np.float32)
        self.ior, self.level = 1.5, 0.5
        self.model = "PRINCIPLED"

    def to_eye(self) -> Float64:
        """(h, w, 3) unit."""
        away = self.camera.matrix_world[:3, 3] - self.positions.astype(float)
        return np.asarray(away / np.linalg.norm(away, axis=-1, keepdims=True))

    def gbuffer(self, device: Device) -> GBuffer:
        """Textures of these pixels; within `device.current()`."""
        plain = super().gbuffer(device)
        height, width = self.shown.shape

        def upload(vector: np.ndarray, scalar: np.ndarray) -> moderngl.Texture:
            image = np.concatenate([vector, np.broadcast_to(scalar, self.shown.shape)[..., None]], axis=2)
            image = np.where(self.shown[..., None], image, 0).astype(np.float32)
            return device.context.texture((width, height), 4, image[::-1].tobytes(), dtype="f4")

        ids = np.zeros((height, width, 4), np.int32)
        ids[..., 1], ids[..., 3] = self.tag_ids, MODELS[self.model]
        zero = np.zeros_like(self.positions)
        return replace(
            plain,
            shading_normal=upload(self.normals, self.roughness),
            geometric_normal=upload(self.normals, self.metallic),
            base_color=upload(self.color, np.asarray(self.level)),
            emission=upload(zero, np.asarray(self.ior)),
            ids=device.context.texture((width, height), 4, ids[::-1].tobytes(), dtype="i4"),
        )


def reflection(
    device: Device, pixels: GlossyPixels, lights: VirtualLightMesh, radiosity: Float32, progress: Progress = silent
) -> Float32:
    """(h, w, 4) of the pass, row 0 at the top."""
    height, width = pixels.shown.shape
    with device.current() as context:
        buffer = context.buffer(radiosity_rows(radiosity))
        records = GpuVirtualLights(context, lights, np.zeros(3))
        view = make_view(pixels.camera, width, height, np.zeros(3))
        made = LightMeshReflectionPass(context, device.shaders, width, height)
        return read_image(made.render(pixels.gbuffer(device), view, records, buffer, progress))


def subdivided(side: int) -> Float64:
    """(side², 3) barycentric coordinates of the middles of a triangle's equal parts."""
    rows, columns = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    upright, turned = rows + columns < side, rows + columns < side - 1
    parts = [np.stack([rows[m] + s, columns[m] + s], 1) / side for m, s in ((upright, 1 / 3), (turned, 2 / 3))]
    both = np.concatenate(parts)
    return np.concatenate([1.0 - both.sum(1, keepdims=True), both], axis=1)


def brute_force(pixels: GlossyPixels, lights: VirtualLightMesh, radiosity: Float32, side: int) -> Float64:
    """(h, w, 3): the sum over side² parts of each light of BRDF times cosines over squared distance, in float64."""
    weights = subdivided(side)
    eyes, result = pixels.to_eye(), np.zeros((*pixels.shown.shape, 3))
    for row, column in zip(*np.nonzero(pixels.shown), strict=True):
        normal = pixels.normals[row, column].astype(float)
        normal /= np.linalg.norm(normal)
        to_part = weights @ lights.corners.astype(float) - pixels.positions[row, column].astype(float)
        squared = (to_part * to_part).sum(-1)
        directions = to_part / np.sqrt(squared)[..., None]
        facing = np.maximum(-np.einsum("lk,lpk->lp", lights.area_vectors, directions), 0.0) / len(weights)
        brdf = principled_brdf(
            normal, directions, eyes[row, column], pixels.color[row, column].astype(float),
            pixels.metallic[row, column], pixels.roughness[row, column], pixels.ior, pixels.level,
        )  # fmt: skip
        cosines = np.maximum(directions @ normal, 0.0)
        shares = np.einsum("lpc,lp->lc", brdf, cosines * facing / squared)
        tag = pixels.tag_ids[row, column]
        shares[(lights.tag_ids == tag) & (lights.tag_ids != 0)] = 0.0
        result[row, column] = (shares * radiosity.astype(float)).sum(0) / np.pi
    return result


def lobe_samples(pixels: GlossyPixels, lights: VirtualLightMesh, radiosity: Float32, side: int = 128) -> Float64:
    """(h, w, 3): the mean over side² directions of each pixel's lobe of what it meets, in float64. For lights that are
    large beside the lobe, of no tag, and one behind another nowhere."""
    u, v = (grid.ravel() for grid in np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2, indexing="ij"))
    disk = np.stack([np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v), np.sqrt(1.0 - u)], axis=1)
    eyes, result = pixels.to_eye(), np.zeros((*pixels.shown.shape, 3))
    for row, column in zip(*np.nonzero(pixels.shown), strict=True):
        normal, eye = pixels.normals[row, column].astype(float), eyes[row, column]
        roughness, cosine = float(pixels.roughness[row, column]), float(normal @ eye)
        local = mirrored(disk, cosine, roughness**2)
        local = local[local[:, 2] > 0.0]
        tangent = eye - cosine * normal
        tangent /= np.linalg.norm(tangent)
        directions = local @ np.array([tangent, np.cross(normal, tangent), normal])
        brdf = principled_brdf(
            normal, directions, eye, pixels.color[row, column].astype(float),
            pixels.metallic[row, column], roughness, pixels.ior, pixels.level,
        )  # fmt: skip
        weights = local[:, 2:] * brdf / mirrored_density(local, cosine, roughness**2)[:, None] / side**2
        for corners, radiance in zip(lights.corners - pixels.positions[row, column], radiosity / np.pi, strict=True):
            edges = [np.cross(corners[k], corners[(k + 1) % 3]) for k in range(3)]
            inside = np.all([directions @ edge < 0.0 for edge in edges], axis=0)
            result[row, column] += weights[inside].sum(axis=0) * radiance
    return result
