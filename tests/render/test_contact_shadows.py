# SPDX-License-Identifier: GPL-3.0-or-later
"""A wall that stands on a floor: its shadow begins where they touch, at any scale, for every kind of lamp."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.test_shadow_map import FLOOR, LAMPS, RESOLUTION, SCALES, box, floor_points, lit, mesh, scaled, up
from vlm_addon.core.scene import Light
from vlm_addon.render.device import Device
from vlm_addon.render.local_space import LocalSpace

# All shine from +x over a wall of 1 m at x = 0.
BESIDE = {"x_axis": (0.8, 0.0, -0.6), "y_axis": (0.0, 1.0, 0.0), "z_axis": (0.6, 0.0, 0.8)}
CONTACT_LAMPS = {
    "sun": LAMPS["sun"],
    "soft sun": replace(LAMPS["sun"], angle=0.01),
    "point": replace(LAMPS["point"], position=(2.0, 0.2, 2.0)),
    "soft point": replace(LAMPS["point"], position=(2.0, 0.2, 2.0), radius=0.05),
    "spot": replace(LAMPS["spot"], position=(2.0, 0.2, 2.0), spot_angle=2.0, **BESIDE),
    "area": replace(LAMPS["area"], position=(2.0, 0.2, 2.0), **BESIDE),
}
# Of each map, on the floor around the wall's foot, m: 2 tan(45°) x 3 m of depth over the resolution where they are
# cubes, twice for lamps with maps of half the size; over the cosine to the floor.
TEXELS = {
    "sun": 9.0 / (2 * RESOLUTION) / 0.8,
    "soft sun": 9.0 / RESOLUTION / 0.8,
    "point": 6.0 / RESOLUTION / 0.65,
    "soft point": 12.0 / RESOLUTION / 0.65,
    "spot": 2 * 1.56 * 3.0 / (2 * RESOLUTION) / 0.65,
    "area": 12.0 / RESOLUTION / 0.65,
}
WALLS = {"thin": 1e-3, "thick": 0.1}


def wall(thickness: float) -> list[list[list[float]]]:
    return box([-thickness, -2.0, 0.0], [0.0, 2.0, 1.0])


def resized(light: Light, scale: float) -> Light:
    return replace(scaled(light, scale), radius=light.radius * scale)


def row(x: np.ndarray) -> np.ndarray:
    return np.stack([x, np.full(len(x), 0.1), np.zeros(len(x))], axis=1)


def kept_elsewhere(scale: float) -> LocalSpace:
    """A space at one end of the scene, in which points are asked for while the map is drawn in its own."""
    return LocalSpace(scale * np.array([2.9, -2.7, 0.1]), 0.0037 * scale)


@pytest.mark.parametrize("is_kept", [False, True], ids=["same space", "kept map"])
@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("thickness", list(WALLS))
@pytest.mark.parametrize("name", list(CONTACT_LAMPS))
def test_shadow_touches_its_wall_and_does_not_leak(
    device: Device, name: str, thickness: str, scale: float, is_kept: bool
) -> None:
    """Dark from one texel behind the lit foot on, under the wall too; lit from one texel before it on."""
    texel = TEXELS[name]
    behind, before = np.linspace(-0.6, -texel, 300), np.linspace(texel, 0.8, 300)
    scene = [mesh(FLOOR + wall(WALLS[thickness]), scale)]
    eye = kept_elsewhere(scale) if is_kept else None
    light = resized(CONTACT_LAMPS[name], scale)
    share = lit(device, scene, light, scale * row(np.concatenate([behind, before])), up(600), eye=eye)
    np.testing.assert_allclose(share[:300], 0.0, atol=1e-6)
    np.testing.assert_allclose(share[300:], 1.0, rtol=1e-3)


@pytest.mark.parametrize("name", list(CONTACT_LAMPS))
def test_radiosities_do_not_depend_on_the_scale(device: Device, name: str) -> None:
    """Points all over the floor, at the shadow's edges too, but for two in a thousand: a texel's centre may lie on the
    edge to the last bit."""
    points = floor_points(1000, 1.0)

    def at(scale: float) -> np.ndarray:
        scene = [mesh(FLOOR + wall(0.1), scale)]
        return lit(device, scene, resized(CONTACT_LAMPS[name], scale), scale * points, up(len(points)))

    ordinary = at(1.0)
    assert 0.05 < (ordinary < 0.5).mean() < 0.95
    for scale in SCALES:
        differs = np.abs(at(scale) - ordinary) > 1e-4
        assert differs.mean() <= 2e-3
