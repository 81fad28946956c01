# SPDX-License-Identifier: GPL-3.0-or-later
"""lib/environment.glsl against core/environment.py."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.core.environment import map_places
from vlm_addon.render.device import Device

FILE = "lib/environment.glsl"


def test_places_are_those_of_core(device: Device) -> None:
    directions = np.random.default_rng(0).normal(size=(4000, 3))
    found = evaluate(device, FILE, "environment_place(d)", {"d": directions}, 2)
    difference = np.abs(found - map_places(directions.astype(np.float32)))
    difference[:, 0] = np.minimum(difference[:, 0], 1.0 - difference[:, 0])
    # Drivers' arctangents are off by up to 2e-4: a tenth of a texel of a map of 512 columns.
    assert difference.max() < 1e-4


def test_the_poles_and_the_horizon(device: Device) -> None:
    directions = np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, 1, 0], [0, -2, 0], [0.0, 0.0, 1e-3]], np.float32)
    found = evaluate(device, FILE, "environment_place(d)", {"d": directions}, 2)
    wanted = [[0.5, 1.0], [0.5, 0.0], [0.5, 0.5], [0.25, 0.5], [0.75, 0.5], [0.5, 1.0]]
    assert found == pytest.approx(np.array(wanted), abs=1e-4)
