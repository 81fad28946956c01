# SPDX-License-Identifier: GPL-3.0-or-later
"""A closed convex room with one point lamp in the centre: nothing occludes, so the truth is known."""

from __future__ import annotations

from . import blend
from .shapes import Shape, patch

SIZE = (4.0, 3.0, 2.5)
LAMP_POWER_W = 45.0
LIGHT_INSET = 0.001
LIGHT_SPLIT = (2, 2)  # quads per wall: 6 x 4 x 2 = 48 lights

REFLECTANCES: dict[str, blend.Rgb] = {
    "Floor": (0.45, 0.38, 0.30),
    "Ceiling": (0.70, 0.70, 0.70),
    "South wall": (0.60, 0.58, 0.52),
    "North wall": (0.50, 0.55, 0.62),
    "West wall": (0.65, 0.32, 0.30),
    "East wall": (0.32, 0.55, 0.35),
}


def walls(split: tuple[int, int], inset: float) -> dict[str, Shape]:
    """The six walls facing inwards, around the origin, each of columns x rows quads, moved out by inset (m)."""
    width, depth, height = SIZE
    x, y, z = width / 2, depth / 2, height / 2
    along_x, along_y, along_z = (width, 0, 0), (0, depth, 0), (0, 0, height)
    return {
        "Floor": patch((-x, -y, -z - inset), along_x, along_y, *split),
        "Ceiling": patch((-x, -y, z + inset), along_y, along_x, *split),
        "South wall": patch((-x, -y - inset, -z), along_z, along_x, *split),
        "North wall": patch((-x, y + inset, -z), along_x, along_z, *split),
        "West wall": patch((-x - inset, -y, -z), along_y, along_z, *split),
        "East wall": patch((x + inset, -y, -z), along_z, along_y, *split),
    }


def build() -> None:
    """Fills the current file with the scene."""
    scene = blend.empty_scene("empty_room", 640, 480)
    for name, wall in walls((1, 1), 0.0).items():
        blend.add_mesh(scene, name, wall, blend.diffuse(name, REFLECTANCES[name]))
    lamp = blend.add_lamp(scene, "Lamp", "POINT", LAMP_POWER_W, (0.0, 0.0, 0.0))
    lamp.data.shadow_soft_size = 0.0
    blend.add_camera(scene, (-1.8, -1.0, 0.55), (0.55, 0.45, -0.18), lens_mm=17.0)
    lights = walls(LIGHT_SPLIT, LIGHT_INSET)
    patches = [blend.LightPatch(wall, REFLECTANCES[name]) for name, wall in lights.items()]
    blend.add_light_mesh(scene, "Room light mesh", patches)
