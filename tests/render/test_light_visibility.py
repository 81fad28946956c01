# SPDX-License-Identifier: GPL-3.0-or-later
"""Visibility in frames of the technique vlm: what is seen stays as it is, and what is said about it is true."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from tests.render.closed_rooms import inward_box
from tests.render.occluded_room import corners_of, room, wall_lights
from tests.render.rooms import camera_at, lights_from_triangles, quad, split
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.scene import DIFFUSE, POINT, Light, Material, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings

MODES = [{"lights": "all"}, {"lights": "tolerance", "tolerance": 0.05}, {"lights": "range", "range": 30.0}]
MODE_NAMES = ["all", "tolerance", "range"]


def lit(snapshot: SceneSnapshot) -> SceneSnapshot:
    """With a camera in a corner, white walls and a lamp that is off the middle."""
    materials = (Material("white", DIFFUSE, (0.7, 0.7, 0.7)),)
    lamp = Light("lamp", POINT, (30.0, 30.0, 30.0), (0.5, 0.4, 0.7))
    camera = camera_at((-0.9, -0.9, 0.6), (0.4, 0.3, -0.4), lens=18.0)
    return replace(snapshot, materials=materials, lights=(lamp,), camera=camera)


def rendered(
    device: Device,
    snapshot: SceneSnapshot,
    light_mesh: VirtualLightMesh,
    samples: int = 1,
    effects: Mapping[str, str] = MappingProxyType({}),
    **settings: Any,
) -> Frame:
    wanted = RenderSettings(32, 24, "vlm", settings, samples, 128, 1, buffers=True, effects=dict(effects))
    return device.render(snapshot, light_mesh, wanted)


def wall_light_mesh() -> VirtualLightMesh:
    """768 lights: more than are always summed one by one."""
    return replace(wall_lights(3), colour=np.full((768, 3), 0.7, np.float32), emission=np.zeros((768, 3), np.float32))


@pytest.mark.parametrize("mode", MODES, ids=MODE_NAMES)
def test_where_all_is_visible_nothing_changes_to_the_bit(device: Device, mode: dict[str, Any]) -> None:
    snapshot, lights = lit(room(False)), wall_light_mesh()
    without = rendered(device, snapshot, lights, **mode)
    skipped = rendered(device, snapshot, lights, visibility="octree", **mode)
    cast = rendered(device, snapshot, lights, effects={"light_visibility": "on"}, visibility="octree", **mode)
    assert cast.counters["visibility_rays"] > 0.9 * 4 * 32 * 24
    assert "visibility_rays" not in skipped.counters
    assert any(text.startswith("no visibility rays are cast: nothing can occlude") for text in skipped.reasons)
    assert any(text.startswith("visibility rays are cast: switched on, though nothing can") for text in cast.reasons)
    assert without.images["indirect"].max() > 0.0
    for name in ("irradiance", "indirect", "combined"):
        np.testing.assert_array_equal(skipped.images[name], without.images[name])
        np.testing.assert_array_equal(cast.images[name], without.images[name])
    assert (cast.images["vlm_visibility"] == 1.0).all()


@pytest.mark.parametrize("mode", MODES, ids=MODE_NAMES)
def test_something_in_the_way_takes_light_and_never_adds_any(device: Device, mode: dict[str, Any]) -> None:
    snapshot, lights = lit(room()), wall_light_mesh()
    without = rendered(device, snapshot, lights, **mode)
    seen = rendered(device, snapshot, lights, visibility="octree", **mode)
    off, on = without.images["irradiance"], seen.images["irradiance"]
    assert (on <= off).all()
    assert 0.6 < on.mean() / off.mean() < 0.97
    share = seen.images["vlm_visibility"]
    np.testing.assert_array_equal(on, off * share)
    assert 0.0 < seen.counters["visibility_rays_blocked"] < seen.counters["visibility_rays"]
    assert any("visibility rays are cast: 'quad' has" in text for text in seen.reasons)
    # The filter takes out what differs between neighbours.
    raw = seen.images["vlm_visibility_unfiltered"]
    assert np.abs(np.diff(share, axis=1)).mean() < 0.5 * np.abs(np.diff(raw, axis=1)).mean()


def test_samples_of_a_frame_use_other_rays_and_a_frame_always_the_same(device: Device) -> None:
    snapshot, lights = lit(room()), wall_light_mesh()
    one, again, two = (rendered(device, snapshot, lights, samples=n, visibility="octree") for n in (1, 1, 2))
    np.testing.assert_array_equal(one.images["combined"], again.images["combined"])
    assert (one.images["vlm_visibility_unfiltered"] != two.images["vlm_visibility_unfiltered"]).any()


def test_what_moves_occludes_where_it_is(device: Device) -> None:
    """A plate before one wall, then out of the way, as something dynamic beside a tree that is kept."""
    lights = wall_light_mesh()
    rays, built = [], []
    for height in (-0.1, -0.999):
        plate = replace(quad((-0.8, -0.8, height), (1.6, 0, 0), (0, 1.6, 0), name="plate"), dynamic=True)
        snapshot = lit(SceneSnapshot("room", (*room(False).meshes, plate)))
        rays.append(rendered(device, snapshot, lights, visibility="octree").counters)
        built.append(device.kept.built["static_octree"])
    assert built[0] == built[1]
    assert rays[0]["visibility_rays_blocked"] > 2.0 * rays[1]["visibility_rays_blocked"]


@pytest.mark.parametrize("thickness", [0.0, 0.002, 0.3], ids=["sheet", "thin", "thick"])
@pytest.mark.parametrize("mode", MODES, ids=MODE_NAMES)
def test_a_closed_room_beside_a_lit_one_stays_black(device: Device, mode: dict[str, Any], thickness: float) -> None:
    lit_room = inward_box([thickness, -1, -1], [2, 1, 1], [0] * 6)
    dark_room = inward_box([-2, -1, -1], [0, 1, 1], [0] * 6)
    meshes = [*lit_room, *dark_room]
    lights = lights_from_triangles(split(corners_of(meshes), 2), emission=0.0, colour=0.7)
    scene = lit(SceneSnapshot("two rooms", tuple(meshes)))
    lamp = replace(scene.lights[0], position=(1.2, 0.2, 0.3))
    views = {
        "dark": camera_at((-1.9, -0.9, 0.6), (-0.1, 0.3, -0.4), lens=18.0),
        "lit": camera_at((1.9, -0.9, 0.6), (0.3, 0.3, -0.4), lens=18.0),
    }
    mean, most, leaks = {}, {}, {}
    for name, camera in views.items():
        snapshot = replace(scene, lights=(lamp,), camera=camera)
        image = rendered(device, snapshot, lights, 2, visibility="octree", **mode).images["indirect"]
        mean[name], most[name] = image.mean(), image.max()
        leaks[name] = rendered(device, snapshot, lights, 1, **mode).images["indirect"].mean()
    # Without visibility the wall hides nothing.
    assert leaks["dark"] > 0.05 * leaks["lit"]
    assert most["dark"] <= 1e-3 * mean["lit"]


@pytest.mark.parametrize("stop_at", ["phase two", "pick lights", "visibility"])
def test_stop_is_heard_while_rays_are_cast(device: Device, stop_at: str) -> None:
    labels: list[str] = []

    def watch(fraction: float, label: str) -> bool:
        labels.append(label)
        return label != stop_at

    settings = RenderSettings(16, 12, "vlm", {"visibility": "octree"}, 1, 32, 1)
    with pytest.raises(Cancelled):
        device.render(lit(room()), wall_light_mesh(), settings, watch)
    assert labels[-1] == stop_at
    assert labels.count(stop_at) == 1
