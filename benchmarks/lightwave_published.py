# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows and figures of seed 000's tables 5.1 to 5.15, measured there on a GeForce GTX 465 with an Athlon 64 X2 5200+."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

FULL = (1280, 720)
QUARTER = (640, 360)


@dataclass(frozen=True)
class Row:
    """One row of a table: what is rendered how, and what the seed says of it (None where it says nothing).

    size: pixels at full size. pots: in the room. similar: percent, to the first row of the table's scene.
    """

    label: str
    settings: Mapping[str, object] = field(default_factory=dict)
    technique: str = "lightwave"
    size: tuple[int, int] = FULL
    pots: int = 0
    fps: float | None = None
    similar: float | None = None
    rank: float | None = None


DEFAULT = Row("default: 6,485 lights, 20 maps", fps=55, similar=100.0)
NO_SHADOWS = {"shadows": "none"}
DIRECT = Row("direct light only", {}, "direct", fps=681, similar=84.426)
UNSHADOWED = Row("no indirect shadows", NO_SHADOWS, fps=161, similar=98.563)


def _steps(count: int, **settings: object) -> dict[str, object]:
    return {"shadows": "integrated", "steps": count, **settings}


ANGLES = tuple(
    Row(f"{angle} degrees, {lights:,} lights", {"angle": float(angle)}, fps=fps, similar=similar)
    for angle, lights, fps, similar in (
        (5, 6485, 55, 100.0),
        (10, 1625, 65, 97.945),
        (30, 185, 84, 97.956),
        (45, 85, 95, 95.440),
        (90, 25, 100, 92.676),
    )
)
SHELLS = tuple(
    Row(f"{shells} on a ray, {lights:,} lights", {"shells": shells}, fps=fps, similar=similar)
    for shells, lights, fps, similar in (
        (5, 6485, 55, 100.0),
        (4, 5188, 56, 92.973),
        (3, 3891, 61, 93.458),
        (2, 2594, 62, 90.318),
        (1, 1297, 78, 91.591),
        (6, 7782, 52, 96.509),
    )
)
SIZES = tuple(
    Row(f"{width} x {height}", size=(width, height), fps=fps, similar=similar)
    for width, height, fps, similar in (
        (1280, 720, 55, 100.0),
        (1120, 630, 82, 99.547),
        (960, 540, 104, 99.541),
        (800, 450, 119, 99.418),
        (640, 360, 133, 99.483),
        (1440, 810, 42, 99.741),
    )
)
MAPS = (
    *(
        Row(f"{maps} maps", {"maps": maps}, fps=fps, similar=similar)
        for maps, fps, similar in (
            (20, 55, 100.0),
            (15, 87, 99.475),
            (10, 106, 98.853),
            (5, 128, 93.611),
            (1, 157, 90.897),
        )
    ),
    Row("0 maps", NO_SHADOWS, fps=161, similar=98.563),
)
REDUCTIONS = (
    DEFAULT,
    DIRECT,
    UNSHADOWED,
    *(
        Row(f"scaled direct light, {multiplier} times", {"multiplier": multiplier}, "scaled_direct", fps=681, similar=s)
        for multiplier, s in ((1.1, 88.217), (1.2, 90.675), (1.3, 91.847), (1.4, 91.393), (1.5, 90.161))
    ),
)
COMPARISON = (
    DEFAULT,
    Row("scaled direct light, 1.3 times", {"multiplier": 1.3}, "scaled_direct", fps=681, similar=91.847, rank=76.7816),
    Row("no indirect shadows", NO_SHADOWS, fps=161, similar=98.563, rank=73.7648),
    Row("15 maps", {"maps": 15}, fps=87, similar=99.475, rank=60.9524),
    Row("10 maps", {"maps": 10}, fps=106, similar=98.853, rank=44.4638),
    Row("direct light only", {}, "direct", fps=681, similar=84.426, rank=40.1952),
    Row("30 degrees", {"angle": 30.0}, fps=84, similar=97.956, rank=14.1879),
    Row("1 on a ray", {"shells": 1}, fps=78, similar=91.591, rank=2.7352),
    Row("640 x 360", size=QUARTER, fps=133, similar=99.483, rank=150.8704),
)
INTEGRATED = tuple(
    Row(f"{steps} steps, {shadows} shadows", _steps(steps), fps=fps)
    for steps, shadows, fps in ((2, 40, 81), (4, 60, 60), (6, 80, 48), (10, 120, 34))
)
INTEGRATED_SMALL = tuple(
    Row(f"640 x 360, {steps} steps", _steps(steps), size=QUARTER, fps=fps)
    for steps, fps in ((2, 137), (6, 107), (10, 89))
)
INTEGRATED_FEW = tuple(
    Row(f"185 lights, {steps} steps", _steps(steps, angle=30.0), fps=fps)
    for steps, fps in ((2, 150), (6, 65), (10, 42))
)
METHODS: tuple[tuple[str, Mapping[str, object], str, tuple[int, int]], ...] = (
    ("default", {}, "lightwave", FULL),
    ("no indirect shadows", NO_SHADOWS, "lightwave", FULL),
    ("15 maps", {"maps": 15}, "lightwave", FULL),
    ("10 maps", {"maps": 10}, "lightwave", FULL),
    ("direct light only", {}, "direct", FULL),
    ("30 degrees", {"angle": 30.0}, "lightwave", FULL),
    ("1 on a ray", {"shells": 1}, "lightwave", FULL),
    ("640 x 360", {}, "lightwave", QUARTER),
)
COMPLEXITY_ACCURATE = tuple(
    Row(f"{triangles:,} triangles, {label}", settings, technique, size, pots, fps)
    for pots, triangles, rates in (
        (1, 6568, (15, 43, 20, 25, 502, 70, 44, 18)),
        (10, 65356, (1, 5, 2, 3, 173, 26, 8, 1)),
    )
    for (label, settings, technique, size), fps in zip(METHODS, rates, strict=True)
)
INTEGRATED_METHODS = tuple(
    (f"{steps} steps, {width} x {height}, {lights:,} lights", _steps(steps, angle=angle), (width, height))
    for (width, height), angle, lights in ((FULL, 5.0, 6485), (FULL, 30.0, 185), (QUARTER, 5.0, 6485))
    for steps in (2, 6, 10)
)
COMPLEXITY_INTEGRATED = tuple(
    Row(f"{triangles:,} triangles, {label}", settings, "lightwave", size, pots, fps)
    for pots, triangles, rates in (
        (1, 6568, (28, 23, 20, 137, 63, 42, 31, 30, 29)),
        (10, 65356, (3, 3, 3, 58, 39, 30, 3, 3, 3)),
    )
    for (label, settings, size), fps in zip(INTEGRATED_METHODS, rates, strict=True)
)
TABLES: Mapping[str, tuple[Row, ...]] = {
    "5.1 and 5.5: angle between rays": ANGLES,
    "5.2 and 5.6: lights on a ray": SHELLS,
    "5.3 and 5.7: size of the picture": SIZES,
    "5.4 and 5.8: indirect shadow maps": MAPS,
    "5.9: alternatives": REDUCTIONS,
    "5.10: final comparison": COMPARISON,
    "5.11: integrated shadows": INTEGRATED,
    "5.12: integrated shadows, small picture": INTEGRATED_SMALL,
    "5.13: integrated shadows, few lights": INTEGRATED_FEW,
    "5.14: triangles, accurate shadows": COMPLEXITY_ACCURATE,
    "5.15: triangles, integrated shadows": COMPLEXITY_INTEGRATED,
}
