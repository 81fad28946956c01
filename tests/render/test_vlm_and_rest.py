# SPDX-License-Identifier: GPL-3.0-or-later
"""Chosen objects bounce by the light mesh, the rest by another technique: each once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.render.rooms import box_room, camera_at, lights_from_triangles, quad, split
from vlm_addon.core.bounce_parts import DYNAMIC, TAGGED, Choice, without_bounce
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_mesh import VirtualLightMesh
from vlm_addon.core.scene import PRINCIPLED, Float32, Mesh, SceneSnapshot
from vlm_addon.core.scene_facts import OWN_SPECULAR, SPECULAR_BY_EFFECTS
from vlm_addon.core.settings import describe
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.technique import technique_list
from vlm_addon.render.techniques.vlm_and_rest import OTHERS, WITHOUT_SURFACES, VlmAndRest

NAME = VlmAndRest.name
ALL_LIGHTS = {"lights": "all", "vlm_lights": "all"}
FLAG_TAG = 9


def room_with_flag(height: float = 0.4, *, is_dynamic: bool = True) -> SceneSnapshot:
    """The box room without its glowing quad; a red flag on the floor, which moves and is tagged."""
    room = box_room()
    flag = quad((0.4, 0.6, height), (0.9, 0.0, 0.0), (0.0, 0.8, 0.0), material=1, tag_id=FLAG_TAG, name="flag")
    meshes = (*room.meshes[:5], replace(flag, dynamic=is_dynamic))
    filled = tuple(
        replace(mesh, reflectance=np.tile(np.float32(room.materials[mesh.material_indices[0]].base_color), (2, 1)))
        for mesh in meshes
    )
    return replace(room, meshes=filled)


def lights_of(scene: SceneSnapshot, times: int = 1) -> VirtualLightMesh:
    """Each triangle as 4^times lights that reflect what it does."""

    def rows(of_mesh: Callable[[Mesh], np.ndarray]) -> np.ndarray:
        # `split` puts the parts of all triangles one after the other.
        return np.tile(np.concatenate([of_mesh(mesh) for mesh in scene.meshes]), (4**times, 1))

    corners = split(np.concatenate([mesh.positions[mesh.triangles] for mesh in scene.meshes]), times)
    tags = rows(lambda mesh: mesh.tag_ids[:, None])[:, 0]
    lights = lights_from_triangles(corners, emission=0.0, colour=rows(lambda mesh: mesh.reflectance), tag_ids=tags)
    return replace(lights, dynamic=rows(lambda mesh: np.full((2, 1), mesh.dynamic))[:, 0])


def render(
    device: Device,
    scene: SceneSnapshot,
    light_mesh: VirtualLightMesh | None,
    technique: str = NAME,
    pictures: int = 1,
    /,
    **chosen: object,
) -> Frame:
    settings = RenderSettings(
        24, 18, technique, chosen, pictures, shadow_resolution=128, shadow_samples=1, buffers=True
    )
    return device.render(scene, light_mesh, settings)


def irradiance(device: Device, *arguments: object, **chosen: object) -> Float32:
    return render(device, *arguments, **chosen).images["irradiance"]  # type: ignore[arg-type]


def test_the_rest_may_bounce_by_every_other_technique_with_its_own_settings() -> None:
    assert {technique.name for technique in OTHERS} == {found.name for found in technique_list()} - {NAME}
    own = {info.name: info for info in describe(VlmAndRest.settings)}
    for technique in OTHERS:
        for info in describe(technique.settings):
            found = own[f"{technique.name}_{info.name}"]
            assert (found.default, found.choices, found.span) == (info.default, info.choices, info.span)
            controls = ("rest", technique.name)
            if info.only_with is not None:
                controls = (f"{technique.name}_{info.only_with[0]}", info.only_with[1])
            assert found.only_with == controls


def test_settings_of_the_rest_reach_it(device: Device) -> None:
    scene = room_with_flag()
    frame = render(device, scene, lights_of(scene), rest="many_light", many_light_lights=48)
    assert frame.counters["rest_point_lights"] == 48
    assert frame.counters["chosen_virtual_lights"] == 2 * 4


@pytest.mark.parametrize("chosen", [{}, {"chosen": TAGGED, "tags": str(FLAG_TAG)}], ids=["dynamic", "tagged"])
def test_two_parts_of_a_light_mesh_are_the_whole(device: Device, chosen: dict[str, str]) -> None:
    scene = room_with_flag(is_dynamic="chosen" not in chosen)
    lights = lights_of(scene, 2)
    whole = irradiance(device, scene, lights, "vlm", lights="all")
    frame = render(device, scene, lights, rest="vlm", **ALL_LIGHTS, **chosen)
    parts = [frame.images[f"{NAME}_{part}_irradiance"] for part in ("chosen", "rest")]
    assert all(part.max() > 0.02 * whole.max() for part in parts)
    np.testing.assert_allclose(frame.images["irradiance"], whole, rtol=2e-6, atol=1e-6 * whole.max())
    np.testing.assert_array_equal(frame.images["irradiance"], parts[0] + parts[1])


def test_maps_of_a_part_and_of_the_rest_are_those_of_all(device: Device) -> None:
    """Same places in the same maps, so their light adds up to rounding."""
    scene = room_with_flag()
    everything = [mesh if mesh.tag_ids.any() else replace(mesh, tag_ids=mesh.tag_ids + 1) for mesh in scene.meshes]
    scene = replace(scene, meshes=tuple(everything))
    whole = irradiance(device, scene, None, "rsm_gather")
    of_flag, of_rest = (
        irradiance(device, without_bounce(scene, Choice(TAGGED, spans)), None, "rsm_gather")
        for spans in (((1, 1),), ((FLAG_TAG, FLAG_TAG),))
    )
    assert min(of_flag.max(), of_rest.max()) > 0.02 * whole.max()
    np.testing.assert_allclose(of_flag + of_rest, whole, rtol=1e-4, atol=1e-5 * whole.max())


def test_many_lights_of_a_part_and_of_the_rest_are_those_of_all_but_for_noise(device: Device) -> None:
    scene = room_with_flag()
    everything = [mesh if mesh.tag_ids.any() else replace(mesh, tag_ids=mesh.tag_ids + 1) for mesh in scene.meshes]
    scene = replace(scene, meshes=tuple(everything))
    parts = (scene, *(without_bounce(scene, Choice(TAGGED, ((tag, tag),))) for tag in (1, FLAG_TAG)))
    whole, of_flag, of_rest = (
        irradiance(device, part, None, "many_light", 4, lights=1024).mean(axis=(0, 1)) for part in parts
    )
    # Other lights stand for each part: the means differ by up to 1 %.
    assert of_flag[0] > 0.06 * whole[0]
    np.testing.assert_allclose(of_flag + of_rest, whole, rtol=0.015)


@pytest.mark.parametrize("rest", [technique.name for technique in OTHERS if technique.name not in WITHOUT_SURFACES])
def test_it_is_the_light_mesh_of_what_is_chosen_and_the_technique_of_what_is_not(device: Device, rest: str) -> None:
    """The two parts as pictures of their own: of a scene whose flag is black, and by the flag's lights alone."""
    scene = room_with_flag()
    lights = lights_of(scene)
    choice = Choice(DYNAMIC)
    of_flag = irradiance(device, scene, lights.subset(choice.lights(lights)), "vlm")
    others = lights.subset(~choice.lights(lights))
    of_rest = irradiance(device, without_bounce(scene, choice), others, rest)
    found = irradiance(device, scene, lights, rest=rest)
    np.testing.assert_array_equal(found, of_flag + of_rest)
    assert of_flag.max() > 0.0


@pytest.mark.parametrize("rest", ["rsm_gather", "many_light"])
def test_nothing_is_counted_twice_and_nothing_left_out(device: Device, rest: str) -> None:
    """Against the form factors of very many lights for all surfaces: with the wall chosen, which gives a third of the
    light, counted once. In a convex room nothing is hidden."""
    room = room_with_flag()
    wall = replace(room.meshes[4], dynamic=True)
    scene = replace(room, meshes=(*room.meshes[:4], wall))
    lights = lights_of(scene, 4)
    truth = irradiance(device, scene, lights, "vlm", lights="all").mean(axis=(0, 1))
    settings = {"many_light_lights": 1024} if rest == "many_light" else {"rsm_gather_samples": 400}
    frame = render(device, scene, lights, NAME, 4, rest=rest, lights="all", **settings)
    share = frame.images[f"{NAME}_chosen_irradiance"].mean(axis=(0, 1)) / truth
    assert share[1] > 0.2
    np.testing.assert_allclose(frame.images["irradiance"].mean(axis=(0, 1)), truth, rtol=0.04)


def test_what_is_chosen_still_blocks_and_receives_light_of_the_rest(device: Device) -> None:
    # From inside the room, so that the flag's upper side shows.
    scene = replace(room_with_flag(0.7), camera=camera_at((1.0, 0.1, 1.9), (1.0, 1.0, 0.4), lens=18.0))
    lights = lights_of(scene)
    frame = render(device, scene, lights, rest="many_light", many_light_lights=512)
    of_rest = frame.images[f"{NAME}_rest_irradiance"]
    on_flag = frame.images["tag_id"][..., 0] == FLAG_TAG
    assert on_flag.sum() > 10
    assert of_rest[on_flag].mean() > 0.1 * of_rest.mean()
    without = replace(scene, meshes=scene.meshes[:5])
    bare = irradiance(device, without, None, "many_light", lights=512)
    floor = (frame.images["position"][..., 2] < 1e-3) & ~on_flag & (frame.images["depth"][..., 0] > 0.0)
    assert floor.sum() > 10
    assert of_rest[floor].mean() < 0.9 * bare[floor].mean()


def test_where_nothing_is_chosen_it_is_the_other_technique_to_the_bit(device: Device) -> None:
    scene = room_with_flag(is_dynamic=False)
    lights = lights_of(scene)
    frame = render(device, scene, lights, rest="rsm_gather")
    np.testing.assert_array_equal(frame.images["irradiance"], irradiance(device, scene, lights, "rsm_gather"))
    assert any("nothing moves: all bounces by rsm_gather" in reason for reason in frame.reasons)


@pytest.mark.parametrize("rest", ["vlm", "rsm_gather", "direct"])
def test_where_everything_is_chosen_it_is_the_light_mesh_to_the_bit(device: Device, rest: str) -> None:
    scene = room_with_flag()
    scene = replace(scene, meshes=tuple(replace(mesh, dynamic=True) for mesh in scene.meshes))
    lights = lights_of(scene)
    frame = render(device, scene, lights, rest=rest)
    np.testing.assert_array_equal(frame.images["irradiance"], irradiance(device, scene, lights, "vlm"))
    assert any(f"nothing is left for {rest}" in reason for reason in frame.reasons)


def test_a_moving_object_gives_the_picture_of_a_fresh_device_and_leaves_the_rest_as_it_was(device: Device) -> None:
    settings = {"rest": "vlm", "tolerance": 0.05, "vlm_tolerance": 0.05}
    kept = device.kept.part("rest")
    heights = (0.2, 0.5, 0.9)
    pictures, built = [], []
    for height in heights:
        scene = room_with_flag(height)
        pictures.append(irradiance(device, scene, lights_of(scene, 4), **settings))
        built.append((device.kept.built["dynamic_tree"], kept.built["static_tree"]))
    assert [after[0] - built[0][0] for after in built] == [0, 1, 2]
    assert [after[1] - built[0][1] for after in built] == [0, 0, 0]
    assert not np.array_equal(pictures[0], pictures[2])
    for height, picture in zip(heights[1:], pictures[1:], strict=True):
        scene = room_with_flag(height)
        with Device() as fresh:
            np.testing.assert_array_equal(irradiance(fresh, scene, lights_of(scene, 4), **settings), picture)


def test_lights_and_surfaces_that_do_not_go_together_are_told(device: Device) -> None:
    scene = room_with_flag()
    lights = lights_of(scene)

    def told(scene: SceneSnapshot, lights: VirtualLightMesh, **chosen: object) -> str:
        return "\n".join(render(device, scene, lights, **{"rest": "rsm_gather", **chosen}).reasons)

    right = told(scene, lights)
    assert "flag bounces by 8 virtual lights, all else by rsm_gather" in right
    assert "missing" not in right
    assert "twice" not in right
    still = replace(lights, dynamic=np.zeros(len(lights), bool))
    assert "the bounce off flag is missing" in told(scene, still)
    assert "8 virtual lights is counted twice" in told(room_with_flag(is_dynamic=False), lights)
    # There no surface bounces by itself.
    assert "missing" not in told(scene, still, rest="vlm")
    assert "twice" not in told(room_with_flag(is_dynamic=False), lights, rest="vlm")
    assert "light is missing" in told(scene, replace(lights, strength=0.4 * lights.strength))
    assert "light is counted twice" in told(scene, replace(lights, strength=3.0 * lights.strength))
    assert "nothing has one of the tags 3, 4" in told(scene, lights, chosen=TAGGED, tags="3, 4")


@pytest.mark.parametrize("rest", WITHOUT_SURFACES)
def test_light_from_lamps_alone_says_that_it_stands_for_all(device: Device, rest: str) -> None:
    scene = room_with_flag()
    frame = render(device, scene, lights_of(scene), rest=rest)
    assert f"{rest} stands for the bounce of all surfaces, the chosen ones too" in frame.reasons


def test_a_tag_that_is_none_is_refused(device: Device) -> None:
    scene = room_with_flag()
    with pytest.raises(InvalidInput, match="'x' is no tag id"):
        render(device, scene, lights_of(scene), chosen=TAGGED, tags="1, x")


def test_the_whole_light_mesh_shows_in_glossy_surfaces(device: Device) -> None:
    """As with the light mesh alone: what is reflected to the eye is no bounce that could be counted twice."""
    scene = room_with_flag()
    scene = replace(scene, materials=tuple(replace(look, model=PRINCIPLED, roughness=0.4) for look in scene.materials))
    lights = lights_of(scene)
    effects = {"light_mesh_reflection": "on", "screen_reflection": "off", "map_reflection": "off"}
    settings = RenderSettings(24, 18, samples=2, shadow_resolution=128, shadow_samples=1, buffers=True, effects=effects)
    of_mesh = device.render(scene, lights, replace(settings, technique="vlm")).images["specular"]
    both = replace(settings, technique=NAME, technique_settings={"rest": "rsm_gather"})
    assert of_mesh.max() > 0.0
    np.testing.assert_array_equal(device.render(scene, lights, both).images["specular"], of_mesh)


@pytest.mark.parametrize(
    ("chosen", "knows", "asks", "specular"),
    [
        ({"rest": "rsm_gather"}, False, False, SPECULAR_BY_EFFECTS),
        ({"rest": "many_light"}, True, False, SPECULAR_BY_EFFECTS),
        ({"rest": "rsm_gather", "visibility": "octree"}, True, True, SPECULAR_BY_EFFECTS),
        ({"rest": "vlm", "vlm_visibility": "baked"}, True, True, SPECULAR_BY_EFFECTS),
        ({"rest": "lightwave"}, True, False, OWN_SPECULAR),
        ({"rest": "direct"}, False, False, SPECULAR_BY_EFFECTS),
    ],
)
def test_facts_for_the_plan_are_those_of_both_parts(
    chosen: dict[str, str], knows: bool, asks: bool, specular: str
) -> None:
    facts = VlmAndRest.facts(VlmAndRest.settings(**chosen))
    assert (facts.name, facts.has_indirect, facts.has_reflecting_lights) == (NAME, True, True)
    assert (facts.knows_visibility, facts.asks_visibility, facts.specular) == (knows, asks, specular)


@pytest.mark.parametrize("chosen", [{"visibility": "octree"}, {"vlm_visibility": "octree", "rest": "vlm"}])
def test_a_frame_that_leaves_nothing_out_and_keeps_nothing_is_the_same(device: Device, chosen: dict[str, str]) -> None:
    scene = room_with_flag()
    lights = lights_of(scene)
    settings = RenderSettings(24, 18, NAME, {"rest": "rsm_gather", **chosen}, 2, 128, 1)
    planned, whole = (device.render(scene, lights, replace(settings, economical=each)) for each in (True, False))
    for name, image in planned.images.items():
        np.testing.assert_array_equal(image, whole.images[name], err_msg=name)


def test_the_rest_bounces_where_virtual_lights_are_black(device: Device) -> None:
    scene = room_with_flag()
    lights = lights_of(scene)
    black = replace(lights, colour=np.zeros_like(lights.colour))
    of_rest = irradiance(device, without_bounce(scene, Choice(DYNAMIC)), None, "rsm_gather")
    assert of_rest.max() > 0.0
    np.testing.assert_array_equal(irradiance(device, scene, black, rest="rsm_gather"), of_rest)
