# SPDX-License-Identifier: GPL-3.0-or-later
"""What the toy city is made of: buildings with windows, street lamps, cars, trees. Pure geometry, metres, z up."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from .shapes import Shape, box, grid_faces, icosphere, join, lathe, moved, patch, scaled, shape, turned, with_material
from .textures import lattice

BAY_WIDTH, FLOOR_HEIGHT, SHOP_HEIGHT = 3.0, 3.2, 4.2
REVEAL = 0.22  # how deep windows lie in the wall
WALL, GLASS, TRIM, LIT, ROOF = range(5)
LIT_SHARE = 0.16


@dataclass(frozen=True)
class Building:
    """A block of bays x bays windows per floor over a floor of shops; `seed` chooses which windows are lit."""

    bays_x: int
    bays_y: int
    floors: int
    seed: int

    @property
    def size(self) -> tuple[float, float, float]:
        """Width, depth and height without the roof's parts, m."""
        return self.bays_x * BAY_WIDTH, self.bays_y * BAY_WIDTH, SHOP_HEIGHT + self.floors * FLOOR_HEIGHT


def chance(seed: int, index: int) -> float:
    """A number in [0, 1) that depends on nothing but its arguments."""
    return int(lattice(np.int64(index), np.int64(index * 7 + 3), seed)) / 256


def opening(width: float, height: float, margins: tuple[float, float, float, float]) -> list[Shape]:
    """A wall of that size facing -y with a recessed pane; margins: left, right, below, above."""
    left, right, below, above = margins
    x0, x1, z0, z1 = left, width - right, below, height - above
    wall = [
        patch((0, 0, 0), (width, 0, 0), (0, 0, z0)),
        patch((0, 0, z1), (width, 0, 0), (0, 0, height - z1)),
        patch((0, 0, z0), (x0, 0, 0), (0, 0, z1 - z0)),
        patch((x1, 0, z0), (width - x1, 0, 0), (0, 0, z1 - z0)),
    ]
    reveals = [
        patch((x0, 0, z0), (x1 - x0, 0, 0), (0, REVEAL, 0)),
        patch((x0, REVEAL, z1), (x1 - x0, 0, 0), (0, -REVEAL, 0)),
        patch((x0, 0, z0), (0, REVEAL, 0), (0, 0, z1 - z0)),
        patch((x1, REVEAL, z0), (0, -REVEAL, 0), (0, 0, z1 - z0)),
    ]
    pane = patch((x0, REVEAL, z0), (x1 - x0, 0, 0), (0, 0, z1 - z0))
    return [*wall, *[with_material(part, TRIM) for part in reveals], with_material(pane, GLASS)]


def window() -> Shape:
    """One bay of an upper floor: a window with a sill and glazing bars."""
    margins = (0.75, 0.75, 0.8, 0.5)
    x0, x1, z0, z1 = margins[0], BAY_WIDTH - margins[1], margins[2], FLOOR_HEIGHT - margins[3]
    middle, bar = (x0 + x1) / 2, 0.035
    trims = [
        box((x0 - 0.12, -0.14, z0 - 0.12), (x1 + 0.12, 0.01, z0)),
        box((middle - bar, REVEAL - 0.06, z0), (middle + bar, REVEAL + 0.01, z1)),
        box((x0, REVEAL - 0.06, z0 + 1.2), (x1, REVEAL + 0.01, z0 + 1.2 + 2 * bar)),
    ]
    return join([*opening(BAY_WIDTH, FLOOR_HEIGHT, margins), *[with_material(part, TRIM) for part in trims]])


def shop() -> Shape:
    """One bay of the ground floor: a shop window under an awning."""
    awning = shape(
        [(0.1, 0, 3.5), (BAY_WIDTH - 0.1, 0, 3.5), (BAY_WIDTH - 0.1, -1.0, 3.0), (0.1, -1.0, 3.0)],
        [(0, 3, 2, 1), (0, 1, 2, 3)],
        TRIM,
    )
    return join([*opening(BAY_WIDTH, SHOP_HEIGHT, (0.3, 0.3, 0.5, 0.9)), awning])


def facade(bays: int, floors: int, seed: int) -> Shape:
    """A front facing -y over x from 0 to its width: shops, windows, a band above each floor; some windows lit."""
    parts = [moved(shop(), (bay * BAY_WIDTH, 0, 0)) for bay in range(bays)]
    dark = window()
    lit = replace(dark, materials=tuple(LIT if slot == GLASS else slot for slot in dark.materials))
    for floor, bay in itertools.product(range(floors), range(bays)):
        source = lit if chance(seed, floor * bays + bay) < LIT_SHARE else dark
        parts.append(moved(source, (bay * BAY_WIDTH, 0, SHOP_HEIGHT + floor * FLOOR_HEIGHT)))
    width = bays * BAY_WIDTH
    bands = [SHOP_HEIGHT - 0.15, SHOP_HEIGHT + floors * FLOOR_HEIGHT - 0.1]
    parts += [with_material(box((-0.12, -0.12, z), (width + 0.12, 0.02, z + 0.2)), TRIM) for z in bands]
    return join(parts)


def building(plan: Building) -> Shape:
    """A whole building around x = y = 0, standing on z = 0, with slots WALL, GLASS, TRIM, LIT and ROOF."""
    width, depth, height = plan.size
    sides = []
    for quarter, (bays, along, across) in enumerate(
        (
            (plan.bays_x, width, depth),
            (plan.bays_y, depth, width),
            (plan.bays_x, width, depth),
            (plan.bays_y, depth, width),
        )
    ):
        front = moved(facade(bays, plan.floors, 4 * plan.seed + quarter), (-along / 2, -across / 2, 0))
        sides.append(turned(front, quarter * math.pi / 2))
    half_x, half_y = width / 2, depth / 2
    rim = 0.3
    parapet = [
        box((-half_x, -half_y, height), (half_x, -half_y + rim, height + 0.9)),
        box((-half_x, half_y - rim, height), (half_x, half_y, height + 0.9)),
        box((-half_x, -half_y + rim, height), (-half_x + rim, half_y - rim, height + 0.9)),
        box((half_x - rim, -half_y + rim, height), (half_x, half_y - rim, height + 0.9)),
    ]
    roof = [
        box((-half_x + 0.01, -half_y + 0.01, height - 0.2), (half_x - 0.01, half_y - 0.01, height + 0.05)),
        box((-0.3 * half_x, -0.35 * half_y, height), (0.35 * half_x, 0.1 * half_y, height + 2.6)),
        moved(
            lathe([(0.0, 0.0), (0.9, 0.0), (0.9, 1.8), (0.0, 2.3)], 16, smooth=False),
            (0.5 * half_x, 0.5 * half_y, height),
        ),
    ]
    return join([*sides, *parapet, *[with_material(part, ROOF) for part in roof]])


def street_lamp() -> Shape:
    """A post with an arm over the street (towards -y) and a hood; slots: metal, glowing glass."""
    post = lathe([(0.16, 0.0), (0.16, 0.25), (0.09, 0.35), (0.06, 5.2), (0.0, 5.3)], 12)
    arm = box((-0.03, -1.25, 5.1), (0.03, 0.05, 5.16))
    hood = moved(lathe([(0.26, 0.0), (0.22, 0.1), (0.05, 0.2), (0.0, 0.22)], 12), (0, -1.25, 5.0))
    glass = with_material(moved(lathe([(0.0, -0.08), (0.14, -0.06), (0.2, 0.02)], 12), (0, -1.25, 5.0)), 1)
    return join([post, arm, hood, glass])


CAR_SIDE = (
    (-2.1, 0.45), (-1.35, 0.36), (1.4, 0.36), (2.1, 0.45), (2.12, 0.75), (1.95, 0.9), (1.1, 0.98), (0.55, 1.42),
    (-0.75, 1.46), (-1.45, 1.02), (-2.05, 0.95), (-2.12, 0.7),
)  # fmt: skip


def car() -> Shape:
    """A parked car pointing along +x; slots: paint, glass, tyres."""
    side = np.array(CAR_SIDE)
    k, half = len(side), 0.85
    # The cabin leans in: the higher a point of the outline, the narrower the body.
    lean = 1 - 0.28 * np.clip((side[:, 1] - 0.95) / 0.5, 0, 1)
    rings = [np.c_[side[:, 0], y * half * lean, side[:, 1]] for y in (-1, -0.92, 0.92, 1)]
    rings[0][:, [0, 2]] = rings[0][:, [0, 2]] * 0.97 + (0, 0.022)
    rings[3][:, [0, 2]] = rings[3][:, [0, 2]] * 0.97 + (0, 0.022)
    faces = [
        (s * k + i, s * k + (i + 1) % k, (s + 1) * k + (i + 1) % k, (s + 1) * k + i) for s in range(3) for i in range(k)
    ]
    caps = [tuple(range(k)), tuple(range(3 * k, 4 * k))[::-1]]
    materials = [1 if 6 <= index % k <= 8 and index % k != 7 else 0 for index in range(len(faces))]
    body = shape(np.concatenate(rings), [face[::-1] for face in faces] + caps)
    body = replace(body, materials=(*materials, 0, 0))
    tyre = lathe([(0.0, -0.11), (0.26, -0.11), (0.33, -0.07), (0.33, 0.07), (0.26, 0.11), (0.0, 0.11)], 24)
    tyre = with_material(turned(tyre, math.pi / 2, "x"), 2)
    wheels = [moved(tyre, (x, y, 0.33)) for x, y in itertools.product((-1.3, 1.3), (-0.78, 0.78))]
    return join([body, *wheels])


def tree(seed: int) -> Shape:
    """A street tree of some 6 m: a trunk and lumps of leaves; slots: bark, leaves."""
    trunk = lathe([(0.2, 0.0), (0.13, 0.6), (0.1, 2.6), (0.0, 3.8)], 10)
    lumps = []
    for index in range(5):
        ball = icosphere(1.0, 2)
        wobble = 1 + 0.16 * np.sin(5.1 * ball.vertices @ (1.3, -0.7, 0.9) + seed + 2 * index)
        angle = 2.4 * index + seed
        out = 0.0 if index == 4 else 0.85
        size = 1.25 if index == 4 else 0.8 + 0.35 * chance(seed, index)
        ball = scaled(replace(ball, vertices=ball.vertices * wobble[:, None]), size)
        lumps.append(moved(ball, (out * math.cos(angle), out * math.sin(angle), 4.3 if index == 4 else 3.4)))
    return join([trunk, *[with_material(lump, 1) for lump in lumps]])


def kerbed_block(width: float, depth: float, height: float) -> Shape:
    """A pavement slab with bevelled kerb, its bottom open on the street."""
    rings = [
        [(x * (width / 2 - inset), y * (depth / 2 - inset), z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for inset, z in ((0.0, 0.0), (0.0, height - 0.04), (0.04, height))
    ]
    return shape(np.concatenate(rings), [*grid_faces(4, 2, closed=True), (8, 9, 10, 11)])
