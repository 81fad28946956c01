# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of chosen surface points for the passes of phase two, and the sums that they are to give."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tests.render.rooms import lights_from_triangles
from vlm_addon.core.form_factor import polygon_form_factor
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.scene import Float32, Float64
from vlm_addon.render.device import Device
from vlm_addon.render.passes.gbuffer import GBuffer

if TYPE_CHECKING:
    import moderngl

SIZE = (21, 37)
"""Divides by no size of group."""


class Pixels:
    """Random surface points, one a pixel, row 0 at the top; a fifth of the pixels shows nothing."""

    def __init__(self, generator: np.random.Generator, size: tuple[int, int] = SIZE) -> None:
        shape = (size[1], size[0])
        self.positions = generator.uniform(-1.0, 1.0, (*shape, 3)).astype(np.float32)
        normals = generator.normal(size=(*shape, 3))
        self.normals = (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)
        self.tag_ids = generator.integers(0, 4, shape).astype(np.int32)
        self.shown = generator.random(shape) < 0.8

    def flat(self) -> tuple[Float64, Float64]:
        """Positions and unit normals of all pixels, (p, 3) float64."""
        normals = self.normals.reshape(-1, 3).astype(float)
        return self.positions.reshape(-1, 3).astype(float), normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def gbuffer(self, device: Device) -> GBuffer:
        """Textures of these pixels; within `device.current()`."""
        height, width = self.shown.shape

        def upload(values: np.ndarray) -> moderngl.Texture:
            image = np.zeros((height, width, 4), values.dtype)
            image[..., : values.shape[2]] = np.where(self.shown[..., None], values, 0)
            kind = "i4" if values.dtype == np.int32 else "f4"
            return device.context.texture((width, height), 4, image[::-1].tobytes(), dtype=kind)

        ids = np.stack([np.zeros_like(self.tag_ids), self.tag_ids], axis=2)
        normal, position = upload(self.normals), upload(self.positions)
        return GBuffer(position, normal, normal, position, position, upload(ids))


def radiosity_rows(radiosity: Float32) -> bytes:
    """One vec4 a light, as the passes read it."""
    rows = np.zeros((max(len(radiosity), 1), 4), np.float32)
    rows[: len(radiosity), :3] = radiosity
    return rows.tobytes()


def expected(pixels: Pixels, lights: VirtualLightMesh, radiosity: Float32) -> Float64:
    """(h, w, 3): the sum in float64."""
    positions, normals = pixels.flat()
    factors = polygon_form_factor(positions, normals, lights.corners)
    tags = pixels.tag_ids.reshape(-1, 1)
    factors = np.where((tags == lights.tag_ids) & (lights.tag_ids != 0), 0.0, factors)
    total = (factors @ radiosity.astype(float)).reshape(*pixels.shown.shape, 3)
    return np.where(pixels.shown[..., None], total, 0.0)


def random_lights(generator: np.random.Generator, count: int, size: float, spread: float = 1.5) -> VirtualLightMesh:
    centres = generator.uniform(-spread, spread, (count, 1, 3))
    corners = (centres + generator.normal(0.0, size, (count, 3, 3))).astype(np.float32)
    return lights_from_triangles(corners, tag_ids=generator.integers(0, 4, count))
