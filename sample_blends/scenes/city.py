# SPDX-License-Identifier: GPL-3.0-or-later
"""A toy city at dusk of up to 4 million triangles and hundreds of lamps, after the diorama of seed 003.

A percentage chooses how much of it is built: blocks are filled one after the other from the middle outwards, so that
a smaller city is the heart of a larger one. Everything is a linked copy of a few meshes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from . import blend, city_parts
from .shapes import Shape, join, moved, patch

FULL_TRIANGLES = 4_000_000
BLOCK_X, BLOCK_Y, STREET = 47.0, 35.0, 11.0
PAVEMENT_HEIGHT = 0.15
RINGS = 6  # blocks in each direction from the middle, at most

PLANS = tuple(
    city_parts.Building(bays_x, bays_y, floors, seed)
    for seed, (bays_x, bays_y, floors) in enumerate(
        ((4, 4, 5), (4, 4, 8), (4, 4, 11), (4, 4, 15), (4, 4, 6), (4, 4, 9), (4, 4, 4), (4, 4, 17)), start=1
    )
)
WALL_COLORS = (
    (0.42, 0.20, 0.13), (0.55, 0.47, 0.36), (0.50, 0.50, 0.48), (0.34, 0.36, 0.40),
    (0.58, 0.40, 0.24), (0.46, 0.30, 0.22), (0.60, 0.56, 0.46), (0.36, 0.42, 0.46),
)  # fmt: skip
CAR_COLORS = ((0.55, 0.04, 0.03), (0.04, 0.10, 0.35), (0.70, 0.70, 0.70), (0.03, 0.03, 0.035), (0.60, 0.42, 0.05))

SUN_IRRADIANCE, SUN_FROM = 2.4, (-6.0, -3.5, 3.4)
LAMP_POWER_W, LAMP_DEGREES = 480.0, 145.0


@dataclass(frozen=True)
class Place:
    """One thing of the city: which mesh, where, turned by how much about z."""

    kind: str
    x: float
    y: float
    turn: float


def block_order() -> list[tuple[int, int]]:
    """Blocks from the middle outwards."""
    cells = [(i, j) for i in range(-RINGS, RINGS + 1) for j in range(-RINGS, RINGS + 1)]
    return sorted(cells, key=lambda cell: (math.hypot(cell[0] * 1.25, cell[1]), math.atan2(cell[1], cell[0])))


def things_in_block(number: int, column: int, row: int) -> Iterator[Place]:
    """What stands on one block and at its kerbs; block 0, in the middle, is a square with trees."""
    x, y = column * (BLOCK_X + STREET), row * (BLOCK_Y + STREET)
    yield Place("pavement", x, y, 0.0)
    for index in range(6):
        place_x, place_y = x + (index % 3 - 1) * 13.4, y + (index // 3 - 0.5) * 14.5
        if number == 0:
            yield from (
                Place(f"tree {(index + k) % 3}", place_x + 4 * math.cos(k * 1.7), place_y + 4 * math.sin(k * 1.7), k)
                for k in range(4)
            )
        else:
            choice = int(len(PLANS) * city_parts.chance(94, 8 * number + index))
            yield Place(f"building {choice}", place_x, place_y, index * math.pi / 2)
    kerb_x, kerb_y = BLOCK_X / 2 - 0.9, BLOCK_Y / 2 - 0.9
    for index, along in enumerate((-0.75, -0.25, 0.25, 0.75)):
        for side in (-1, 1):
            turn = 0.0 if side < 0 else math.pi
            yield Place("lamp", x + along * kerb_x, y + side * kerb_y, turn)
            yield Place(
                f"tree {(index + number) % 3}", x + (along + 0.25) * kerb_x * 0.93, y + side * (kerb_y - 0.3), index
            )
    for index in range(12):
        if city_parts.chance(91, 16 * number + index) < 0.72:
            side = -1 if index < 6 else 1
            kind = int(len(CAR_COLORS) * city_parts.chance(92, 16 * number + index))
            along = (index % 6 - 2.5) * 6.3 + city_parts.chance(93, 16 * number + index)
            yield Place(f"car {kind}", x + along, y + side * (BLOCK_Y / 2 + 1.25), 0.0 if side < 0 else math.pi)


def planned(triangles: dict[str, int], target: int) -> list[Place]:
    """Things in building order whose triangles come as close to the target as whole things can without passing it."""
    left, places = target, []
    for number, (column, row) in enumerate(block_order()):
        for place in things_in_block(number, column, row):
            if triangles[place.kind] <= left:
                left -= triangles[place.kind]
                places.append(place)
        if left < triangles["lamp"]:
            break
    return places


def shapes_of_things() -> dict[str, Shape]:
    """Every mesh of the city by the kind named in Place."""
    shapes = {f"building {index}": city_parts.building(plan) for index, plan in enumerate(PLANS)}
    shapes |= {f"tree {index}": city_parts.tree(index) for index in range(3)}
    shapes |= {f"car {index}": city_parts.car() for index in range(len(CAR_COLORS))}
    pavement = city_parts.kerbed_block(BLOCK_X, BLOCK_Y, PAVEMENT_HEIGHT)
    return shapes | {"lamp": city_parts.street_lamp(), "pavement": pavement}


def materials_of_things() -> dict[str, list[Any]]:
    """Materials of each mesh, in the order of its slots."""
    glass = blend.principled("Window", (0.04, 0.05, 0.06), roughness=0.15)
    lit = blend.principled("Lit window", (0.1, 0.09, 0.07), emission=blend.Emission((1.0, 0.66, 0.30), 2.5))
    trim, roof = blend.diffuse("Trim", (0.52, 0.50, 0.46)), blend.diffuse("Roof", (0.16, 0.15, 0.15))
    metal = blend.principled("Lamp post", (0.06, 0.07, 0.07), roughness=0.4)
    glow = blend.principled("Lamp glass", (0.8, 0.8, 0.8), emission=blend.Emission((1.0, 0.74, 0.40), 12.0))
    bark, leaves = blend.diffuse("Bark", (0.12, 0.08, 0.05)), blend.diffuse("Leaves", (0.09, 0.20, 0.05))
    tyre = blend.diffuse("Tyre", (0.02, 0.02, 0.02))
    slots = {
        f"building {index}": [blend.diffuse(f"Wall {index}", color), glass, trim, lit, roof]
        for index, color in enumerate(WALL_COLORS)
    }
    slots |= {f"tree {index}": [bark, leaves] for index in range(3)}
    slots |= {
        f"car {index}": [blend.principled(f"Paint {index}", color, roughness=0.25), glass, tyre]
        for index, color in enumerate(CAR_COLORS)
    }
    return slots | {"lamp": [metal, glow], "pavement": [blend.diffuse("Pavement", (0.34, 0.33, 0.31))]}


def ground(places: Sequence[Place]) -> tuple[Shape, float]:
    """The asphalt under all pavements with a border as wide as a street, and half its longer side."""
    pavements = [place for place in places if place.kind == "pavement"]
    half_x = max(abs(place.x) for place in pavements) + BLOCK_X / 2 + STREET
    half_y = max(abs(place.y) for place in pavements) + BLOCK_Y / 2 + STREET
    asphalt = patch((-half_x, -half_y, 0), (2 * half_x, 0, 0), (0, 2 * half_y, 0))
    skirts = [
        patch((-half_x, -half_y, -2), (2 * half_x, 0, 0), (0, 0, 2)),
        patch((half_x, half_y, -2), (-2 * half_x, 0, 0), (0, 0, 2)),
        patch((half_x, -half_y, -2), (0, 2 * half_y, 0), (0, 0, 2)),
        patch((-half_x, half_y, -2), (0, -2 * half_y, 0), (0, 0, 2)),
    ]
    return join([asphalt, *skirts]), max(half_x, half_y)


def road_marks(places: Sequence[Place]) -> Shape:
    """Dashes along the streets south of each block, two centimetres above the asphalt."""
    dashes = [
        patch((place.x + along * 6.0 - 1.5, place.y - (BLOCK_Y + STREET) / 2 - 0.07, 0.02), (3.0, 0, 0), (0, 0.14, 0))
        for place in places
        if place.kind == "pavement"
        for along in range(-3, 4)
    ]
    return join([moved(dash, (0, 0, 0)) for dash in dashes])


def build(percent: float = 100.0) -> None:
    """Fills the current file with that share of the city."""
    scene = blend.empty_scene("city", 1280, 720, "AgX")
    scene.view_settings.exposure = 0.8
    shapes, slots = shapes_of_things(), materials_of_things()
    target = round(FULL_TRIANGLES * percent / 100)
    places = planned({kind: source.triangle_count for kind, source in shapes.items()}, target)
    used = {place.kind for place in places}
    data = {kind: blend.mesh_data(kind.capitalize(), shapes[kind], slots[kind]) for kind in sorted(used)}
    light = None
    for index, place in enumerate(places):
        height = 0.0 if place.kind.startswith(("pavement", "car")) else PAVEMENT_HEIGHT
        thing = blend.add_object(scene, f"{place.kind.capitalize()} #{index}", data[place.kind])
        thing.location, thing.rotation_euler = (place.x, place.y, height), (0, 0, place.turn)
        if place.kind == "lamp":
            side = -1.25 * math.cos(place.turn)
            at = (place.x, place.y + side, height + 4.85)
            if light is None:
                lamp = blend.add_spot(
                    scene, f"Street light #{index}", LAMP_POWER_W, at, (at[0], at[1], 0), LAMP_DEGREES
                )
                lamp.data.color, light = (1.0, 0.74, 0.42), lamp.data
                lamp.data.shadow_soft_size, lamp.data.spot_blend = 0.1, 0.4
            else:
                blend.look_at(blend.add_object(scene, f"Street light #{index}", light), at, (at[0], at[1], 0))
    base, half = ground(places)
    blend.add_mesh(scene, "Asphalt", base, blend.diffuse("Asphalt", (0.085, 0.085, 0.09)))
    blend.add_mesh(scene, "Road marks", road_marks(places), blend.diffuse("Road paint", (0.6, 0.6, 0.56)))
    sun = blend.add_lamp(scene, "Sun", "SUN", SUN_IRRADIANCE, SUN_FROM, (0, 0, 0), (1.0, 0.70, 0.48))
    sun.data.angle = math.radians(1.0)
    blend.add_camera(
        scene, (1.25 * half, -2.0 * half, 1.35 * half + 30), (0.0, -0.05 * half, 8.0), 36.0, clip=(0.5, 8 * half)
    )
    blend.add_camera(
        scene,
        (-0.46 * BLOCK_X, -(BLOCK_Y + STREET) / 2 - 1.0, 2.0),
        (BLOCK_X, -BLOCK_Y / 2, 3.5),
        24.0,
        name="Street camera",
    )
