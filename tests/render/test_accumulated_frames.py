# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects of whole frames, accumulated over frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import box_room, camera_at, quad
from vlm_addon.core.scene import SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings

WIDTH, HEIGHT = 48, 36
OCCLUSION = {
    "ambient_occlusion": "on",
    "ambient_occlusion.directions": 1,
    "ambient_occlusion.blur": "false",
    "ambient_occlusion.radius": 0.2,
}
GATHER = {"samples": 8, "resolution": 32, "low_resolution": 1}
FRAMES = 12


def settings(samples: int, accumulates: bool) -> RenderSettings:
    effects = {**OCCLUSION, "temporal_accumulation": "on" if accumulates else "off"}
    return RenderSettings(WIDTH, HEIGHT, "rsm_gather", GATHER, samples, shadow_samples=4, effects=effects, buffers=True)


def scene(index: int, kind: str) -> SceneSnapshot:
    """The room with a card; picture `index` of a camera or a card that moves by a third of a pixel or more."""
    step = 0.02 * index
    card = quad((0.6 + (step if kind == "object" else 0.0), 1.2, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 0.9), name="card")
    eye = step if kind == "camera" else 0.0
    camera = camera_at((1.0 + eye, -3.0, 1.0), (1.0 + eye, 1.0, 1.0), lens=35.0)
    room = box_room()
    return replace(room, meshes=(*room.meshes, card), camera=camera)


def last_frame(kind: str, samples: int, accumulates: bool, frames: int) -> Frame:
    with Device() as device:
        for index in range(FRAMES - frames, FRAMES):
            frame = device.render(scene(index, kind), None, settings(samples, accumulates))
    return frame


@pytest.mark.parametrize("kind", ["camera", "object"])
def test_noise_of_occlusion_goes_down_over_frames(kind: str) -> None:
    """Frames of one picture against many pictures of the last one."""
    with Device() as device:
        many = [
            device.render(scene(FRAMES - 1, kind), None, settings(1, accumulates=True)).images["ambient_occlusion"]
            for _ in range(48)
        ]
    alone = last_frame(kind, 1, accumulates=False, frames=1).images["ambient_occlusion"]
    followed = last_frame(kind, 1, accumulates=True, frames=FRAMES).images["ambient_occlusion"]
    noise, rest = (np.abs(image - many[-1]).mean() for image in (alone, followed))
    assert noise > 0.05
    assert rest < 0.4 * noise


@pytest.mark.parametrize("samples", [1, 4])
def test_a_first_frame_is_that_without_accumulation_to_the_bit(samples: int) -> None:
    plain = last_frame("rest", samples, accumulates=False, frames=1)
    first = last_frame("rest", samples, accumulates=True, frames=1)
    assert set(first.images) - set(plain.images) == {"ambient_occlusion_history_age", "motion"}
    for name, image in plain.images.items():
        np.testing.assert_array_equal(first.images[name], image, err_msg=name)
