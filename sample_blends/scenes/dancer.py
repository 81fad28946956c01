# SPDX-License-Identifier: GPL-3.0-or-later
"""A skinned dancer turning on one foot under two spot lights, in a loop, with virtual lights that dance along.

The light mesh of the room stands still; hers is bound to the same armature by coarse versions of her own parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from . import blend, rig
from .dance import pose
from .figure import COARSE, FINE, SKELETON, SKIRT, body_parts, skirt
from .shapes import Shape, area_m2, patch, prism
from .skinned import Part, joined

FRAMES = 60
KEY_STEP = 3
ROOM = (5.0, 4.6, 3.0)  # across, deep, high; the origin is in the middle of the floor
PODIUM_RADIUS, PODIUM_HEIGHT = 0.85, 0.12
PODIUM_TAG = SKIRT + 1
LIGHT_INSET = 0.002

COLORS: dict[str, blend.Rgb] = {
    "skin": (0.62, 0.36, 0.25),
    "hair": (0.045, 0.022, 0.012),
    "leotard": (0.58, 0.035, 0.075),
    "tights": (0.70, 0.60, 0.56),
    "shoes": (0.58, 0.035, 0.075),
    "skirt": (0.80, 0.42, 0.04),
}
WALL, FLOOR, PODIUM = (0.72, 0.70, 0.66), (0.42, 0.25, 0.13), (0.45, 0.44, 0.46)
BLUE_WALL, GREEN_WALL = (0.10, 0.20, 0.55), (0.12, 0.42, 0.20)
SKIRT_RESOLUTION, SKIRT_LIGHTS = (72, 8), (12, 3)  # columns, rows

SURFACES: dict[str, blend.Rgb] = {
    "Floor": FLOOR,
    "Ceiling": WALL,
    "Far wall": WALL,
    "Near wall": WALL,
    "Blue wall": BLUE_WALL,
    "Green wall": GREEN_WALL,
}


def walls(split: tuple[int, int], inset: float) -> dict[str, Shape]:
    """The six walls facing inwards, each of columns x rows quads, moved out by inset (m)."""
    width, depth, height = ROOM
    x, y, z = (width, 0, 0), (0, depth, 0), (0, 0, height)
    left, right, near, far = -width / 2, width / 2, -depth / 2, depth / 2
    return {
        "Floor": patch((left, near, -inset), x, y, *split),
        "Ceiling": patch((left, near, height + inset), y, x, *split),
        "Far wall": patch((left, far + inset, 0), x, z, *split),
        "Near wall": patch((left, near - inset, 0), z, x, *split),
        "Blue wall": patch((left - inset, near, 0), y, z, *split),
        "Green wall": patch((right + inset, near, 0), z, y, *split),
    }


def podium(corners: int, inset: float = 0.0) -> Shape:
    """The round step that she stands on, its top and side moved inwards by inset (m)."""
    angle = np.arange(corners) * (2 * np.pi / corners)
    outline = (PODIUM_RADIUS - inset) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return prism(outline, 0.0, PODIUM_HEIGHT - inset)


def add_room(scene: Any) -> None:
    """Walls and podium."""
    for name, wall in walls((1, 1), 0.0).items():
        blend.add_mesh(scene, name, wall, blend.diffuse(name, SURFACES[name]))
    step = blend.add_mesh(scene, "Podium", podium(64), blend.diffuse("Podium", PODIUM))
    step["vlm_tag"] = PODIUM_TAG


def add_part_object(scene: Any, name: str, parts: Sequence[Part], armature: Any) -> None:
    """One mesh object of several parts that the armature moves; every face has its part's tag."""
    keys = list(dict.fromkeys(part.material for part in parts))
    surface, weights, tags = joined(parts, keys)
    materials = [blend.diffuse(key.capitalize(), COLORS[key]) for key in keys]
    added = blend.add_mesh(scene, name, surface, *materials)
    attribute = added.data.attributes.new("vlm_tag", "INT", "FACE")
    attribute.data.foreach_set("value", np.array(tags, np.int32))
    rig.bind(added, armature, SKELETON, weights)


def dancer_lights(visible: Sequence[Part]) -> tuple[list[blend.LightPatch], np.ndarray]:
    """The dancer's lights and their weights: coarse parts inside the visible ones, with their area made up."""
    coarse = [*body_parts(COARSE, LIGHT_INSET), skirt(*SKIRT_LIGHTS, pleat_depth=0.0, inset=LIGHT_INSET)]
    areas = {part.name: area_m2(part.surface) for part in visible}
    patches = [
        blend.LightPatch(part.surface, COLORS[part.material], part.tag, areas[part.name] / area_m2(part.surface))
        for part in coarse
    ]
    return patches, np.concatenate([part.weights for part in coarse])


def room_lights() -> list[blend.LightPatch]:
    """The lights of walls, floor and podium; floor and podium are finer, for there the spots shine."""
    surfaces = walls((2, 2), LIGHT_INSET) | {"Floor": walls((5, 5), LIGHT_INSET)["Floor"]}
    patches = [blend.LightPatch(surface, SURFACES[name]) for name, surface in surfaces.items()]
    step = podium(12, LIGHT_INSET)
    top_and_side = replace(step, faces=step.faces[1:], materials=step.materials[1:])
    visible = podium(64)
    scale = area_m2(replace(visible, faces=visible.faces[1:])) / area_m2(top_and_side)
    return [*patches, blend.LightPatch(top_and_side, PODIUM, PODIUM_TAG, scale)]


def build() -> None:
    """Fills the current file with the scene."""
    scene = blend.empty_scene("dancer", 640, 640)
    scene.frame_start, scene.frame_end = 1, FRAMES
    scene.render.fps = 24
    add_room(scene)

    armature = rig.add_armature(scene, "Dancer armature", SKELETON)
    armature.location = (0.0, 0.0, PODIUM_HEIGHT)
    body, cloth = body_parts(FINE), skirt(*SKIRT_RESOLUTION)
    add_part_object(scene, "Dancer", body, armature)
    add_part_object(scene, "Skirt", [cloth], armature)
    # One key beyond each end gives the curves the same slope where the loop closes.
    frames = range(1 - KEY_STEP, 1 + FRAMES + KEY_STEP + 1, KEY_STEP)
    rig.add_keys(armature, SKELETON, [(frame, pose((frame - 1) / FRAMES)) for frame in frames])

    blend.add_light_mesh(scene, "Room light mesh", room_lights())
    patches, weights = dancer_lights([*body, cloth])
    lights = blend.add_light_mesh(scene, "Dancer light mesh", patches)
    lights["vlm_dynamic"] = True
    rig.bind(lights, armature, SKELETON, weights)

    warm, cool = (1.0, 0.80, 0.58), (0.66, 0.80, 1.0)
    blend.add_spot(scene, "Warm spot", 520.0, (-1.9, -1.9, 2.8), (0.1, 0.1, 0.75), 48.0, 0.3, 0.04, warm)
    blend.add_spot(scene, "Cool spot", 420.0, (2.1, -1.3, 2.8), (-0.1, 0.1, 0.85), 44.0, 0.3, 0.04, cool)
    blend.add_camera(scene, (0.0, -2.25, 1.35), (0.0, 0.0, 1.08), lens_mm=29.0)
    scene.frame_set(1)
