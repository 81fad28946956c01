# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance that chosen surface points gather from the reflective shadow maps of a scene."""

from __future__ import annotations

import numpy as np

from vlm_addon.core.progress import silent
from vlm_addon.core.scene import Float64, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.local_space import LocalSpace
from vlm_addon.render.passes.gbuffer import GBuffer
from vlm_addon.render.passes.low_resolution import PickedPixels
from vlm_addon.render.passes.rsm import LampReflections
from vlm_addon.render.passes.rsm_gather import UNBIASED, RsmGatherPass, Sampling, sample_taps

WORLD_SPACE = LocalSpace(np.zeros(3), 1.0)
COLUMNS = 64
"""Points come in multiples of this many: one a pixel, so many in a row."""


def picture_of(device: Device, points: Float64, normals: Float64) -> GBuffer:
    """One surface point a pixel, COLUMNS of them in a row; within `device.current()`."""

    def upload(values: np.ndarray, kind: str) -> object:
        image = np.zeros((len(values) // COLUMNS, COLUMNS, 4), kind)
        image[..., : values.shape[1]] = values.reshape(*image.shape[:2], -1)
        size = image.shape[1::-1]
        return device.context.texture(size, 4, image.tobytes(), dtype="i4" if kind == "<i4" else "f4")

    position, normal = upload(points, "<f4"), upload(normals, "<f4")
    ids = upload(np.zeros((len(points), 1)), "<i4")
    return GBuffer(position, normal, normal, position, position, ids)  # type: ignore[arg-type]


def gathered(
    device: Device,
    room: SceneSnapshot,
    points: Float64,
    normals: Float64,
    samples: int,
    weight: str = UNBIASED,
    radius: float = 1.0,
    pictures: int = 1,
) -> Float64:
    """(p, 4): irradiance, and what bounds took off, of one picture."""
    with device.current() as context:
        maps = LampReflections(context, device.shaders, device.kept, room, 128, 4)
        gather = RsmGatherPass(context, device.shaders, COLUMNS, len(points) // COLUMNS)
        gbuffer = picture_of(device, points, normals)
        picked = PickedPixels(gbuffer, context.texture(gbuffer.size, 2, dtype="i4"))
        sampling = Sampling(sample_taps(samples, 0, weight), pictures, radius)
        found = gather.render(picked, WORLD_SPACE, maps.maps(), len(maps), sampling, silent)
        return np.frombuffer(found.read(), np.float32).reshape(-1, 4).astype(float)
