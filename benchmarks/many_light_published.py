# SPDX-License-Identifier: GPL-3.0-or-later
"""Table 5.1 of seed 004, and the scenes that stand for its scenes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import bpy

from benchmarks.support import SAMPLE_BLENDS, open_sample, quiet
from vlm_addon.blender.extraction.light_mesh_io import extract
from vlm_addon.core.scene import SceneSnapshot

LIGHTS = (512, 1024, 2048)
TILES = 16
"""4 x 4, as published and by default."""
PUBLISHED_STAGES = {
    "octree": "voxelise and build",
    "reflective shadow maps": "reflective shadow maps",
    "virtual point lights": "VPL generation",
    "direct light": "direct light",
    "indirect light": "indirect light",
}
"""Our passes, and the rows of table 5.1."""
DANCER = ("Dancer armature", "Dancer", "Skirt")
DANCER_PLACE = (-1.0, 1.2, 0.0)
"""m, where neither the block nor the sphere is within reach of her arms."""


@dataclass(frozen=True)
class Published:
    """A scene of table 5.1. stages: ms at each of LIGHTS, by pass."""

    scene: str
    size: tuple[int, int]
    resolution: int
    stages: Mapping[str, tuple[float, float, float]]
    opened: Callable[[], SceneSnapshot]


def cornell_box_with_dancer() -> SceneSnapshot:
    """The sample scene with the figure of another one in it, in Blender and extracted."""
    with quiet():
        open_sample("cornell_box")
        with bpy.data.libraries.load(str(SAMPLE_BLENDS / "dancer.blend")) as (_, target):
            target.objects = list(DANCER)
        for added in target.objects:
            bpy.context.scene.collection.objects.link(added)
        bpy.data.objects[DANCER[0]].location = DANCER_PLACE
        bpy.context.scene.frame_set(1)
        return extract().snapshot


def atrium() -> SceneSnapshot:
    """The sample scene."""
    return open_sample("atrium").snapshot


PUBLISHED = {
    "cornell_box": Published(
        "cornell_box with dancer",
        (768, 768),
        128,
        {
            "octree": (0.57, 0.57, 0.58),
            "reflective shadow maps": (0.46, 0.46, 0.46),
            "virtual point lights": (0.02, 0.02, 0.02),
            "direct light": (0.17, 0.17, 0.18),
            "indirect light": (16.0, 33.0, 69.0),
        },
        cornell_box_with_dancer,
    ),
    "atrium": Published(
        "atrium",
        (1280, 720),
        256,
        {
            "octree": (4.65, 4.65, 4.65),
            "reflective shadow maps": (0.61, 0.62, 0.62),
            "virtual point lights": (0.02, 0.02, 0.02),
            "direct light": (0.31, 0.31, 0.31),
            "indirect light": (19.5, 36.2, 73.0),
        },
        atrium,
    ),
}
"""A GeForce Titan X; a Cornell box with a dragon and an elephant under two spot lamps (150,000 triangles), and Crytek's
Sponza under one (180,000)."""
