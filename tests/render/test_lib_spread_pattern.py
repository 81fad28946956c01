# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/spread_pattern.glsl` against the same arithmetic in numpy."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.spread_pattern import bayer_rank, spread_pattern
from vlm_addon.render.device import Device

FILE = "lib/spread_pattern.glsl"


def columns(pixels: np.ndarray) -> dict[str, np.ndarray]:
    return {"x": pixels[:, 0].astype(np.int32), "y": pixels[:, 1].astype(np.int32)}


def test_ranks_are_those_of_the_processor(device: Device) -> None:
    pixels = np.random.default_rng(0).integers(0, 5000, (200, 2)).astype(np.uint32)
    found = evaluate(device, FILE, "float(bayer_rank(uvec2(uint(x), uint(y))))", columns(pixels))
    assert (found == bayer_rank(pixels)).all()


@pytest.mark.parametrize("index", [0, 3, 15])
@pytest.mark.parametrize("sample", [0, 1, 4095])
def test_numbers_are_those_of_the_processor(device: Device, index: int, sample: int) -> None:
    pixels = np.random.default_rng(1).integers(0, 5000, (200, 2)).astype(np.uint32)
    expression = f"spread_pattern(uvec2(uint(x), uint(y)), {index}u, {sample}u)"
    assert (evaluate(device, FILE, expression, columns(pixels), 2) == spread_pattern(pixels, index, sample)).all()
