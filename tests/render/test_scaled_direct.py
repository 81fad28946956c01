# SPDX-License-Identifier: GPL-3.0-or-later
"""Scaled direct light is a sum of pictures that the technique `direct` gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.closed_rooms import empty_room, inward_box
from vlm_addon.core.scene import AREA, POINT, PRINCIPLED, SPOT, SUN, Light, Material, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings

LAMPS = {
    "point": Light("l", POINT, (45.0, 30.0, 20.0), (0.4, 0.3, 0.9)),
    "soft spot": Light("l", SPOT, (45.0, 30.0, 20.0), (0.3, 0.2, 1.1), radius=0.2, spot_angle=2.6),
    "area": Light("l", AREA, (20.0, 40.0, 20.0), (0.0, 0.0, 1.2), size_x=1.0, size_y=0.8),
    "sun": Light("l", SUN, (2.0, 2.0, 3.0), (0.0, 0.0, 0.0), angle=0.2),
}


def room(light: Light) -> SceneSnapshot:
    """The empty room, glossy, with a block in it, without its ceiling."""
    empty = empty_room([light])
    materials = tuple(replace(material, model=PRINCIPLED, roughness=0.4) for material in empty.materials)
    block = inward_box((0.4, -0.1, -1.25), (1.0, 0.6, -0.3), [0] * 6, outward=True)
    return replace(empty, meshes=(*empty.meshes[:5], *block), materials=materials)


def rendered(device: Device, scene: SceneSnapshot, technique: str, samples: int = 2, **settings: object) -> Frame:
    return device.render(scene, None, RenderSettings(32, 24, technique, settings, samples, 128, 4))


@pytest.mark.parametrize("multiplier", [1.0, 1.3, 2.0])
@pytest.mark.parametrize("name", LAMPS)
def test_it_is_equation_5_2(device: Device, name: str, multiplier: float) -> None:
    """Half of the direct light with shadows, and the multiplier less a half of it without; highlights too."""
    scene = room(LAMPS[name])
    unshadowed = room(replace(LAMPS[name], casts_shadow=False))
    scaled = rendered(device, scene, "scaled_direct", multiplier=multiplier)
    with_shadow, without = (rendered(device, each, "direct").images["direct"] for each in (scene, unshadowed))
    assert np.abs(with_shadow - without).max() > 0.01
    expected = 0.5 * with_shadow + (multiplier - 0.5) * without
    np.testing.assert_allclose(scaled.images["combined"][..., :3], expected, rtol=2e-3, atol=2e-3 * expected.max())
    np.testing.assert_array_equal(scaled.images["direct"], with_shadow)
    assert (scaled.images["indirect"] >= 0.0).all()


def test_without_lamps_nothing_is_scaled(device: Device) -> None:
    dark = replace(room(LAMPS["point"]), lights=())
    assert rendered(device, dark, "scaled_direct").images["combined"][..., :3].max() == 0.0


def test_the_worlds_light_is_left_out_of_what_knows_no_shadow(device: Device) -> None:
    closed = replace(empty_room([]), world_radiance=(2.0, 2.0, 2.0))
    frame = rendered(device, closed, "scaled_direct", samples=1)
    assert frame.images["indirect"].max() == 0.0
    assert "the world's light is not scaled" in frame.reasons[0]


def test_a_lamp_inside_a_block_lights_the_room_through_it(device: Device) -> None:
    """The technique's known bias: half of its light knows no shadow."""
    scene = room(replace(LAMPS["point"], position=(0.7, 0.25, -0.8)))
    scaled = rendered(device, scene, "scaled_direct")
    assert rendered(device, scene, "direct").images["direct"].max() < 1e-3
    assert scaled.images["indirect"].max() > 0.1
    assert np.isfinite(scaled.images["combined"]).all()


def test_glossy_highlights_are_added_beside_the_irradiance(device: Device) -> None:
    black = Material("black", PRINCIPLED, (0.0, 0.0, 0.0), roughness=0.3)
    scene = replace(room(LAMPS["point"]), materials=(black,) * 6)
    scaled = rendered(device, scene, "scaled_direct", multiplier=2.0)
    assert scaled.images["indirect"].max() == 0.0
    assert scaled.images["combined"][..., :3].max() > 1.4 * scaled.images["direct"].max() > 0.0
