# SPDX-License-Identifier: GPL-3.0-or-later
"""The dance: a slow turn on one foot as a function of the phase of its loop. No bpy.

Rotations turn about the character's axes at rest (x to her left, y to her back, z up), within the parent bone's frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .figure import SKELETON, SKIRT_CHAINS, SKIRT_FLARE, skirt_azimuth
from .shapes import Points
from .skinned import Skeleton, other_side

PIVOT = "foot.L"
"""The bone whose tail stays where it is."""

TOE_HEIGHT = 0.0025
"""How far the pivot is above the ground, m: the tip of the shoe, which stands on its lower rim."""


@dataclass(frozen=True)
class Pose:
    """Rotation (3, 3) of every bone by name, and how far the first one is moved (3,), m."""

    rotations: dict[str, Points]
    root_offset: Points


def about(axis: str, degrees: float) -> Points:
    """(3, 3) rotation about a coordinate axis, counter-clockwise seen from the axis's tip."""
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix, angle = np.eye(3), math.radians(degrees)
    matrix[first, first] = matrix[second, second] = math.cos(angle)
    matrix[first, second], matrix[second, first] = -math.sin(angle), math.sin(angle)
    return matrix


def bone_tails(skeleton: Skeleton, rotations: dict[str, Points]) -> dict[str, Points]:
    """Where the tails of all bones come to be while the first bone's head stays, (3,) each, m."""
    turns: dict[str, Points] = {}
    heads: dict[str, Points] = {}
    tails: dict[str, Points] = {}
    at_rest = {bone.name: np.array(bone.head) for bone in skeleton}
    for bone in skeleton:
        parent = bone.parent
        turns[bone.name] = turns.get(parent, np.eye(3)) @ rotations.get(bone.name, np.eye(3))
        heads[bone.name] = (
            heads[parent] + turns[parent] @ (at_rest[bone.name] - at_rest[parent]) if parent else at_rest[bone.name]
        )
        tails[bone.name] = heads[bone.name] + turns[bone.name] @ np.subtract(bone.tail, bone.head)
    return tails


def trunk(turn: float) -> dict[str, Points]:
    """Hips, spine and head at `turn`, radians of the loop; the whole figure goes once around."""
    facing = math.degrees(turn) + 14.0 * math.sin(turn)
    return {
        "hips": about("z", facing) @ about("x", 3.0 + 2.0 * math.sin(2 * turn)),
        "spine": about("z", 8.0 * math.sin(turn + 0.6)) @ about("y", 5.0 * math.sin(turn)) @ about("x", -2.0),
        "chest": about("z", 8.0 * math.sin(turn + 0.9)) @ about("y", 6.0 * math.sin(turn + 0.3)) @ about("x", -5.0),
        "neck": about("z", -10.0 * math.sin(turn + 1.0)) @ about("x", 3.0),
        "head": about("z", -14.0 * math.sin(turn + 1.2)) @ about("y", -5.0 * math.sin(turn)) @ about("x", -4.0),
    }


def legs(turn: float) -> dict[str, Points]:
    """The left foot bears her, its knee giving way twice a turn; the right leg folds to the knee and unfolds."""
    give = 9.0 + 7.0 * math.cos(2 * turn)
    fold = 0.5 - 0.5 * math.cos(turn)
    return {
        "thigh.L": about("y", 5.5) @ about("x", -give),
        "shin.L": about("x", 2 * give),
        "foot.L": about("x", 42.0 - give),
        "thigh.R": about("z", -52.0 + 14.0 * fold) @ about("x", -(48.0 + 22.0 * fold)),
        "shin.R": about("x", 104.0 - 76.0 * fold),
        "foot.R": about("x", 46.0),
    }


def left_arm(turn: float) -> dict[str, Points]:
    """An arm that rises from the side to over the head and comes back down; the hand trails."""
    lift = 0.5 - 0.5 * math.cos(turn)
    return {
        "upper_arm.L": about("z", -26.0 + 10.0 * math.sin(turn)) @ about("y", -(22.0 + 84.0 * lift)),
        "forearm.L": about("z", -24.0 + 10.0 * lift) @ about("y", -(8.0 + 34.0 * lift)),
        "hand.L": about("y", 18.0 * math.sin(turn + 0.5) - 6.0) @ about("z", -8.0),
    }


def right_arm(turn: float) -> dict[str, Points]:
    """The mirror image of the left one, a third of a loop behind."""
    mirror = np.diag([-1.0, 1.0, 1.0])
    return {other_side(name): mirror @ rotation @ mirror for name, rotation in left_arm(turn - 2.1).items()}


def skirt_swing(turn: float, raised_thigh: Points) -> dict[str, Points]:
    """The skirt flares with the turn, ripples, and lies on the raised thigh (unit direction in the hips' frame)."""
    thigh_angle = math.degrees(math.acos(-raised_thigh[2]))
    thigh_azimuth = math.atan2(raised_thigh[1], raised_thigh[0])
    rotations = {}
    for chain in range(SKIRT_CHAINS):
        azimuth = skirt_azimuth(chain)
        flare = 47.0 + 5.0 * math.sin(turn + 0.5) + 5.0 * math.sin(2 * azimuth - 2 * turn)
        away = math.remainder(azimuth - thigh_azimuth, 2.0 * math.pi)
        lifted = (thigh_angle + 12.0) * math.exp(-((away / 0.95) ** 2))
        # The larger of both, rounded where they meet.
        angle = math.log(math.exp(flare / 8.0) + math.exp(lifted / 8.0)) * 8.0
        droop = 0.45 * max(angle - flare, 0.0) + 5.0 * math.cos(2 * azimuth - 2 * turn)
        for name, degrees in (("upper", angle - math.degrees(SKIRT_FLARE)), ("lower", -droop)):
            facing = about("z", math.degrees(azimuth))
            rotations[f"skirt_{name}_{chain:02d}"] = facing @ about("y", -degrees) @ facing.T
    return rotations


def pose(phase: float) -> Pose:
    """The pose at `phase`, loops since the first frame."""
    turn = 2.0 * math.pi * phase
    rotations = {**trunk(turn), **legs(turn), **left_arm(turn), **right_arm(turn)}
    rotations |= skirt_swing(turn, rotations["thigh.R"] @ np.array([0.0, 0.0, -1.0]))
    offset = np.array([0.0, 0.0, TOE_HEIGHT]) - bone_tails(SKELETON, rotations)[PIVOT]
    return Pose(rotations, offset)
