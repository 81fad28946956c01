# SPDX-License-Identifier: GPL-3.0-or-later
"""The sums of a frame as pictures for people and files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..core.scene import Camera, Finding, Float32
from .frame_types import RenderSettings
from .geometry import GpuGeometry
from .local_space import LocalSpace
from .passes.accumulate import read_image
from .passes.gbuffer import GBufferPass
from .passes.tonemap import ToneMapPass
from .view import make_view

if TYPE_CHECKING:
    from .device import Device

NO_SURFACE = -1


def finished_images(sums: dict[str, Float32]) -> tuple[dict[str, Float32], list[Finding]]:
    """The pictures with every value finite and at least 0, and what had to be changed for that."""
    images, findings = {}, []
    for name, values in sums.items():
        values = values if name == "combined" else values[..., :3]
        broken = ~np.isfinite(values).all(axis=2)
        if broken.any():
            problem = f"{int(broken.sum())} pixels were not finite"
            findings.append(Finding(f"image {name!r}", problem, "set to 0; look for broken values in the materials"))
        clean = np.where(broken[..., None], 0.0, np.maximum(values, 0.0))
        images[name] = np.ascontiguousarray(clean, np.float32)
    return images, findings


def display_image(device: Device, image: Float32) -> Float32:
    """RGBA, display-linear, of a picture of linear RGBA."""
    height, width = image.shape[:2]
    picture = device.context.texture((width, height), 4, np.ascontiguousarray(image[::-1]).tobytes(), dtype="f4")
    return read_image(ToneMapPass(device.context, device.shaders, width, height).render(picture))


def surface_images(
    gbuffer_pass: GBufferPass, geometry: GpuGeometry, camera: Camera, settings: RenderSettings, space: LocalSpace
) -> dict[str, Float32]:
    """What shows at the pixels' centres: world positions in m, normals, base colour, depth in m, ids."""
    gbuffer = gbuffer_pass.render(geometry, make_view(camera, settings.width, settings.height, geometry.origin), 0)
    position, normal, base_color, ids = (
        read_image(texture) for texture in (gbuffer.position, gbuffer.shading_normal, gbuffer.base_color, gbuffer.ids)
    )
    shown = np.any(normal[..., :3] != 0.0, axis=2, keepdims=True)
    images = {
        "position": np.where(shown, space.world_points(position[..., :3]), 0.0),
        "normal": normal[..., :3],
        "albedo": base_color[..., :3],
        "depth": position[..., 3:] * space.unit,
    }
    for channel, name in enumerate(("material_id", "tag_id", "face_id")):
        images[name] = np.where(shown, ids[..., channel : channel + 1], NO_SURFACE)
    return {name: np.ascontiguousarray(image, np.float32) for name, image in images.items()}
