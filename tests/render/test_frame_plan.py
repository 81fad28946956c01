# SPDX-License-Identifier: GPL-3.0-or-later
"""What plans make frames do: passes that are left out, lamps that light nothing seen, effects forced on and off."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.render.closed_rooms import empty_room, inward_box
from tests.render.rooms import camera_at, mesh_lights, quad
from vlm_addon.core.effects import REUSE, RUN, SKIP
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.scene import AREA, DIFFUSE, POINT, PRINCIPLED, SPOT, Light, Material, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.local_space import make_local_space
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.passes.screen_census import ScreenCensusPass
from vlm_addon.render.view import make_view

LAMP = Light("Lamp", POINT, (30.0, 30.0, 30.0), (0.0, 0.0, 0.5))
SMALL = RenderSettings(24, 18, "vlm", {"lights": "all"}, samples=2, shadow_resolution=64, shadow_samples=2)
NEEDED = {"plan", "geometry", "G-buffer", "accumulate", "read back"}
"""Passes of a frame that shows a scene without light."""


def glossy_room(**look: Any) -> SceneSnapshot:
    """A dull room with a glossy floor."""
    materials = (Material("dull", DIFFUSE), Material("polished", PRINCIPLED, **look))
    meshes = tuple(inward_box((-2, -2, -1), (2, 2, 1), [0, 0, 0, 0, 1, 0]))
    camera = camera_at((-1.7, -1.6, 0.5), (0.6, 0.5, -0.4), lens=20.0)
    return SceneSnapshot("glossy room", meshes, materials, lights=(LAMP,), camera=camera)


def rendered(device: Device, snapshot: SceneSnapshot, **changes: Any) -> Frame:
    return device.render(snapshot, mesh_lights(snapshot.meshes, colour=0.5, emission=0.0), replace(SMALL, **changes))


def passes(frame: Frame) -> set[str]:
    return {name for name, _ in frame.timings}


@pytest.mark.parametrize("technique", ["vlm", "rsm_gather", "direct", "many_light", "lightwave"])
def test_without_any_light_there_is_no_pass_but_what_shows_the_surface(device: Device, technique: str) -> None:
    dark = empty_room([replace(LAMP, power=(0.0, 0.0, 0.0))])
    frame = rendered(device, dark, technique=technique, technique_settings={})
    assert passes(frame) <= NEEDED
    assert {each.action for each in frame.plan.effects} == {SKIP}
    assert frame.images["combined"][..., :3].max() == 0.0
    assert (frame.images["combined"][..., 3] == 1.0).all()


def test_a_dark_scene_with_glossy_surfaces_is_not_even_counted(device: Device) -> None:
    frame = rendered(device, replace(glossy_room(), lights=()))
    assert passes(frame) <= NEEDED


def test_a_lamp_that_reaches_virtual_lights_alone_lights_the_scene(device: Device) -> None:
    card = quad((-1.0, -1.0, 3.0), (0.0, 2.0, 0.0), (2.0, 0.0, 0.0))
    floor = quad((-2.0, -2.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    upwards = Light("up", AREA, (20.0,) * 3, (0.0, 0.0, 1.5), y_axis=(0.0, -1.0, 0.0), z_axis=(0.0, 0.0, -1.0))
    camera = camera_at((0.0, -4.0, 2.0), (0.0, 0.0, 0.0), lens=20.0)
    scene = SceneSnapshot("card", (floor,), (Material("dull", DIFFUSE),), lights=(upwards,), camera=camera)
    lights = mesh_lights((card,), colour=0.8, emission=0.0)
    planned, everything = (device.render(scene, lights, replace(SMALL, economical=each)) for each in (True, False))
    assert planned.images["combined"][..., :3].max() > 0.01
    np.testing.assert_allclose(planned.images["combined"], everything.images["combined"], atol=1e-6)


def test_negative_light_is_refused(device: Device) -> None:
    with pytest.raises(InvalidInput, match=r"'Lamp'.*-20"):
        rendered(device, empty_room([replace(LAMP, power=(30.0, -20.0, 30.0))]))


def test_with_light_there_are_more(device: Device) -> None:
    frame = rendered(device, empty_room([LAMP]))
    assert passes(frame) >= {"direct light", "phase one", "phase two"}
    assert frame.images["combined"][..., :3].min() > 0.0


def test_where_no_pixel_is_glossy_nothing_is_reflected(device: Device) -> None:
    room = glossy_room(roughness=0.1)
    frame = rendered(device, room)
    assert frame.plan.runs("screen_reflection")
    assert "'polished'" in frame.plan["screen_reflection"].reason
    assert "screen reflection" in passes(frame)
    upwards = replace(room, camera=camera_at((-1.0, -1.0, 0.0), (0.0, 0.0, 1.0), lens=40.0))
    frame = rendered(device, upwards)
    assert frame.plan["screen_reflection"].reason.startswith("none of 432 pixels")
    assert "screen reflection" not in passes(frame)


def test_the_share_of_glossy_pixels_is_that_of_the_picture(device: Device) -> None:
    room = glossy_room()
    frame = rendered(device, room, samples=1, buffers=True)
    share = float((frame.images["material_id"] == 1).mean())
    assert 0.1 < share < 0.9
    assert f"on {100.0 * share:.3g} % of the picture" in frame.plan["screen_reflection"].reason


def test_a_spot_beside_the_picture_is_left_out_of_direct_light(device: Device) -> None:
    behind = Light("Behind", SPOT, (50.0,) * 3, (-1.9, -1.9, 0.9), spot_angle=0.4)
    room = replace(empty_room([behind]), camera=camera_at((0.0, 0.0, 0.0), (2.0, 1.5, 0.0), lens=50.0))
    frame = rendered(device, room)
    assert frame.plan["direct_light"].action == SKIP
    assert "'Behind'" in frame.plan["direct_light"].reason
    assert frame.plan.runs("indirect_light")
    assert frame.images["direct"].max() == 0.0
    turned = replace(room, camera=camera_at((0.0, 0.0, 0.0), (-1.9, -1.4, -1.2), lens=20.0))
    assert rendered(device, turned).plan.runs("direct_light")


def test_a_forced_effect_runs_and_is_marked(device: Device) -> None:
    frame = rendered(device, empty_room([LAMP]), effects={"ambient_occlusion": "on"}, buffers=True)
    decision = frame.plan["ambient_occlusion"]
    assert (decision.action, decision.is_forced) == (RUN, True)
    assert frame.images["ambient_occlusion"].min() < 1.0
    plain = rendered(device, empty_room([LAMP]))
    assert (frame.images["indirect"] <= plain.images["indirect"] + 1e-6).all()
    assert frame.images["indirect"].mean() < 0.99 * plain.images["indirect"].mean()


@pytest.mark.parametrize("name", ["direct_light", "indirect_light", "direct_specular", "screen_reflection"])
def test_an_effect_that_is_switched_off_is_missing(device: Device, name: str) -> None:
    room = glossy_room(roughness=0.2)
    whole, without = rendered(device, room), rendered(device, room, effects={name: "off"})
    decision = without.plan[name]
    assert (decision.action, decision.is_forced) == (SKIP, True)
    assert without.images["combined"].mean() < whole.images["combined"].mean()


@pytest.mark.parametrize(
    ("effects", "named"),
    [
        ({"fog": "on"}, "'fog'"),
        ({"shadows": "often"}, "'often'"),
        ({"shadows.size": 1}, "shadows"),
        ({"ambient_occlusion.radius": -1.0}, "-1.0"),
        ({"ambient_occlusion.rays": 1}, "'rays'"),
    ],
)
def test_what_effects_do_not_have_is_refused(device: Device, effects: dict[str, Any], named: str) -> None:
    with pytest.raises(InvalidInput, match=named):
        rendered(device, empty_room([LAMP]), effects=effects)


def test_a_plan_alone_has_no_picture_and_the_same_decisions(device: Device) -> None:
    room = glossy_room()
    alone, frame = rendered(device, room, samples=1, plan_only=True), rendered(device, room, samples=1)
    assert alone.images == {}
    assert alone.plan.effects == frame.plan.effects


def test_a_still_scene_reuses_all_that_is_kept() -> None:
    with Device() as own:
        first, second = (rendered(own, glossy_room()) for _ in range(2))
        assert {each.action for each in first.plan.structures} == {RUN}
        assert {each.action for each in second.plan.structures} == {REUSE}
        np.testing.assert_array_equal(first.images["combined"], second.images["combined"])
        own.forget()
        third = rendered(own, glossy_room())
        assert {each.action for each in third.plan.structures} == {RUN}


def test_accumulation_brings_reflections_nearer_to_their_mean() -> None:
    room = glossy_room(roughness=0.4, metallic=1.0)
    with Device() as own:
        truth = rendered(own, room, samples=64, buffers=True).images["specular"]
        wanted: dict[str, Any] = {"samples": 1, "buffers": True, "effects": {"temporal_accumulation": "on"}}
        found = [rendered(own, room, **wanted).images["specular"] for _ in range(16)]
    errors = [float(np.sqrt(((image - truth) ** 2).mean())) for image in found]
    assert errors[-1] < 0.6 * errors[0]


def test_no_light_of_a_lamp_that_was_dimmed_is_left_in_reflections() -> None:
    room = glossy_room(roughness=0.4, metallic=1.0)
    dim = replace(room, lights=(replace(LAMP, power=(0.3, 0.3, 0.3)),))
    wanted: dict[str, Any] = {"samples": 1, "buffers": True, "effects": {"temporal_accumulation": "on"}}
    with Device() as own:
        for _ in range(6):
            rendered(own, room, **wanted)
        after = rendered(own, dim, **wanted).images["specular"]
        truth = rendered(own, dim, samples=64, buffers=True).images["specular"]
    assert after.mean() == pytest.approx(truth.mean(), rel=0.25)
    assert after.max() < 6.0 * truth.max()


def test_the_census_counts_what_the_gbuffer_holds(device: Device) -> None:
    sheet = quad((-0.5, -0.25, 0.0), (1.0, 0.0, 0.0), (0.0, 0.5, 0.0), material=1)
    materials = (Material("dull", DIFFUSE), Material("chrome", PRINCIPLED, metallic=1.0))
    floor = quad((-5.0, -5.0, -1.0), (5.0, 0.0, 0.0), (0.0, 10.0, 0.0))
    world = SceneSnapshot("sheet", (floor, sheet), materials, camera=camera_at((0.0, 0.0, 2.0), (0.0, 0.0, 0.0)))
    space = make_local_space(world)
    local = space.scene(world)
    assert local.camera is not None
    with device.current() as context:
        geometry = GpuGeometry(context, local, np.zeros(3))
        gbuffer = GBufferPass(context, device.shaders, 37, 29).render(
            geometry, make_view(local.camera, 37, 29, geometry.origin), 0
        )
        found = ScreenCensusPass(context, device.shaders).render(gbuffer, space)
        position = np.frombuffer(gbuffer.position.read(), np.float32).reshape(-1, 4)
        ids = np.frombuffer(gbuffer.ids.read(), np.int32).reshape(-1, 4)
        shown = np.frombuffer(gbuffer.geometric_normal.read(), np.float32).reshape(-1, 4)[:, :3].any(axis=1)
    assert (found.pixels, found.shown) == (37 * 29, shown.sum())
    assert found.glossy == (ids[shown, 0] == 1).sum()
    assert 0 < found.glossy < found.shown < found.pixels
    places = space.world_points(position[shown, :3])
    np.testing.assert_allclose(found.low, places.min(axis=0), atol=1e-9)
    np.testing.assert_allclose(found.high, places.max(axis=0), atol=1e-9)
