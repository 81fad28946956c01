# SPDX-License-Identifier: GPL-3.0-or-later
"""The plain room of seed 000: 36 triangles, a lamp high in a corner; and the same with one and with ten tea pots.

The seed counts 36, 6,565 and 65,542 triangles with a famous teapot; this pot of our own has 6,532, so that the three
rooms hold 36, 6,568 and 65,356.
"""

from __future__ import annotations

import math

from . import blend
from .shapes import Shape, box, moved, room_walls, turned
from .vessels import tea_pot

ROOM = (5.0, 5.0, 3.2)  # across, deep, high
WHITE, RED, GREEN, OCHRE = (0.72, 0.70, 0.66), (0.58, 0.09, 0.07), (0.10, 0.42, 0.13), (0.62, 0.45, 0.18)
POT = (0.28, 0.36, 0.58)

LAMP_POWER_W = 330.0
LAMP_DEGREES = 150.0
LAMP_AT, LAMP_TARGET = (-2.1, 0.45, 2.95), (0.5, 3.2, 0.4)

POT_RADIUS = 0.26
LARGE_BLOCK_HEIGHT = 1.1
# Where pots stand (x, y, z) and the angle their spouts point at, degrees; the first one alone in the room with one.
POTS = (
    (0.95, 3.35, LARGE_BLOCK_HEIGHT, 205),
    (-0.85, 2.15, 0.6, 330),
    (-1.75, 2.55, 0.0, 20),
    (0.1, 2.0, 0.0, 300),
    (0.75, 2.45, 0.0, 160),
    (1.85, 2.55, 0.0, 240),
    (2.0, 3.6, 0.0, 75),
    (-0.25, 3.0, 0.0, 110),
    (-1.95, 3.3, 0.0, 350),
    (-0.6, 4.3, 0.0, 265),
)


def blocks() -> dict[str, Shape]:
    """Two blocks, turned against the walls, their bottoms on the floor."""
    large = turned(box((-0.5, -0.45, 0), (0.5, 0.45, LARGE_BLOCK_HEIGHT)), math.radians(-18))
    small = turned(box((-0.4, -0.4, 0), (0.4, 0.4, 0.6)), math.radians(24))
    return {"Large block": moved(large, (0.95, 3.35, 0)), "Small block": moved(small, (-0.85, 2.15, 0))}


def build(pots: int = 0) -> None:
    """Fills the current file with the room and the first `pots` pots."""
    scene = blend.empty_scene("lightwave_room", 1280, 720)
    white = blend.diffuse("White", WHITE)
    colors = {
        "Red wall": blend.diffuse("Red", RED),
        "Green wall": blend.diffuse("Green", GREEN),
        "Small block": blend.diffuse("Ochre", OCHRE),
    }
    for name, part in (room_walls(ROOM, "Red wall", "Green wall") | blocks()).items():
        blend.add_mesh(scene, name, part, colors.get(name, white))
    if pots:
        data = blend.mesh_data("Tea pot", tea_pot(POT_RADIUS), [blend.principled("Glaze", POT, roughness=0.35)])
        for index, (x, y, z, degrees) in enumerate(POTS[:pots], start=1):
            pot = blend.add_object(scene, f"Tea pot {index}", data)
            pot.location, pot.rotation_euler = (x, y, z), (0, 0, math.radians(degrees))
    lamp = blend.add_spot(scene, "Lamp", LAMP_POWER_W, LAMP_AT, LAMP_TARGET, LAMP_DEGREES, 0.3, 0.03)
    lamp.data.color = (1.0, 0.95, 0.86)
    blend.add_camera(scene, (0.25, 0.08, 1.85), (0.0, 3.4, 1.0), lens_mm=19.0)
