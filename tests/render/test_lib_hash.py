# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/hash.glsl` against the same arithmetic in numpy, and against what uniform numbers must do."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.render.device import Device

FILE = "lib/hash.glsl"
MASK = 0xFFFFFFFF
EDGES = [0, 1, 2, 255, 256, 2**24 - 1, 2**24, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1]


def words(count: int = 2000) -> np.ndarray:
    random = np.random.default_rng(4).integers(0, 2**32, count, dtype=np.uint64)
    return np.concatenate([np.array(EDGES, np.uint64), random])


def as_int(values: np.ndarray) -> np.ndarray:
    return values.astype(np.uint32).view(np.int32)


def pcg(value: int) -> int:
    """Jarzynski and Olano 2020, "pcg", in Python's integers."""
    state = (value * 747796405 + 2891336453) & MASK
    word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) & MASK
    return (word >> 22) ^ word


def test_pcg_hash_is_the_published_one(device: Device) -> None:
    values = words()
    halves = evaluate(
        device,
        FILE,
        "vec2(float(pcg_hash(uint(x)) >> 16u), float(pcg_hash(uint(x)) & 65535u))",
        {"x": as_int(values)},
        2,
    )
    found = halves[:, 0].astype(np.uint64) * 65536 + halves[:, 1].astype(np.uint64)
    assert found.tolist() == [pcg(int(value)) for value in values]


def test_unit_float_takes_24_bits_and_never_reaches_one(device: Device) -> None:
    values = words()
    found = evaluate(device, FILE, "unit_float(uint(x))", {"x": as_int(values)})
    assert (found == (values >> 8).astype(np.float64) / 2**24).all()
    assert found.max() < 1.0


def spread(device: Device, pixel: np.ndarray, surface: np.ndarray, sample: np.ndarray) -> np.ndarray:
    inputs = {"x": pixel[:, 0], "y": pixel[:, 1], "face": surface, "turn": sample}
    columns = {name: values.astype(np.int32) for name, values in inputs.items()}
    return evaluate(device, FILE, "spread_random(uvec2(uint(x), uint(y)), uint(face), uint(turn))", columns)


@pytest.mark.parametrize("samples", [1, 2, 7, 64, 4096])
def test_samples_of_a_pixel_are_evenly_spread(device: Device, samples: int) -> None:
    """Golden ratio: the largest of the gaps between n numbers on the circle is below 2.62 / n."""
    pixel = np.tile([[13, 2047]], (samples, 1))
    found = spread(device, pixel, np.full(samples, 5), np.arange(samples))
    assert ((found >= 0.0) & (found < 1.0)).all()
    ordered = np.sort(found.astype(float))
    gaps = np.diff(np.append(ordered, ordered[0] + 1.0))
    assert gaps.max() <= 2.62 / samples + 2**-24


@pytest.mark.parametrize("axis", ["pixel", "surface"])
def test_neighbours_are_independent(device: Device, axis: str) -> None:
    y, x = np.divmod(np.arange(64 * 64), 64)
    fixed = np.zeros(64 * 64)
    pixel = np.stack([x, y], axis=1) if axis == "pixel" else np.zeros((64 * 64, 2))
    surface = fixed if axis == "pixel" else np.arange(64 * 64)
    found = spread(device, pixel, surface, fixed).astype(float).reshape(64, 64)
    assert found.mean() == pytest.approx(0.5, abs=4 / np.sqrt(12 * 4096))
    counts = np.histogram(found, 16, (0, 1))[0]
    # 99.99th percentile of chi square with 15 degrees of freedom.
    assert ((counts - 256.0) ** 2 / 256.0).sum() < 44.3
    for other in (np.roll(found, 1, 0), np.roll(found, 1, 1)):
        assert abs(np.corrcoef(found.ravel(), other.ravel())[0, 1]) < 4 / 64
