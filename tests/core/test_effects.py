# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of a frame: each rule both ways, the sentence that names what decided, and what an artist may force."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.render.rooms import lights_from_triangles, quad
from vlm_addon.core.effect_rules import RULES
from vlm_addon.core.effects import (
    AUTO,
    OFF,
    ON,
    REUSE,
    RUN,
    SKIP,
    Decision,
    EffectPlan,
    parse_choices,
    plan_effects,
    plan_from_tree,
    structure_decisions,
)
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.occluders import Occlusion
from vlm_addon.core.scene import AREA, Light, SceneSnapshot
from vlm_addon.core.scene_facts import (
    NO_SPECULAR,
    OWN_SPECULAR,
    LampFacts,
    LightMeshFacts,
    SceneFacts,
    ScreenFacts,
    TechniqueFacts,
    gather_facts,
)

BLOCKED = Occlusion(True, "'Box' has other surfaces on both sides")
OPEN = Occlusion(False, "nothing can occlude anything: each of the 12 triangles has the whole scene on one side")
VLM = TechniqueFacts("vlm", has_reflecting_lights=True, gains_by_occlusion=True)
LAMPS = LampFacts(("Key", "Fill"), (), (), (), ("Key", "Fill"))
NO_LAMPS = LampFacts((), (), (), ())
SCREEN = ScreenFacts(1000, 800, 250, np.zeros(3), np.ones(3))
FACTS = SceneFacts(
    scene="hall",
    triangles=12,
    lamps=LAMPS,
    is_lit_by_world=True,
    glowing=("neon",),
    glossy=("chrome",),
    layered=("chrome",),
    tagged_surface=True,
    light_mesh=LightMeshFacts(lights=44, reflecting=40, glowing=2, tagged=3),
    occlusion=BLOCKED,
    lamp_occlusion=BLOCKED,
    technique=VLM,
    screen=SCREEN,
    samples=16,
)
"""A scene that calls for nearly everything."""
DARK: dict[str, Any] = {
    "lamps": NO_LAMPS,
    "is_lit_by_world": False,
    "glowing": (),
    "light_mesh": LightMeshFacts(44, 40, 0, 3),
}
UNLIT = replace(FACTS, **DARK)

CALLED_FOR = {
    "world_lights": (FACTS, "the world sends light"),
    "direct_light": (FACTS, "'Key', 'Fill' shine on what the picture shows"),
    "shadows": (FACTS, "'Box'"),
    "layered_materials": (FACTS, "'chrome' has layers"),
    "direct_specular": (FACTS, "'chrome' has a specular layer, on 25 % of the picture"),
    "indirect_light": (FACTS, "2 of 44 virtual lights shine by themselves"),
    "light_tags": (FACTS, "3 virtual lights have a tag"),
    "light_visibility": (replace(FACTS, technique=replace(VLM, asks_visibility=True)), "'Box'"),
    "ambient_occlusion": (FACTS, "'Box'"),
    "screen_reflection": (FACTS, "'chrome' has a specular layer, on 25 % of the picture"),
    "light_mesh_reflection": (FACTS, "'chrome'"),
    "map_reflection": (replace(FACTS, technique=TechniqueFacts("rsm_gather")), "'Key', 'Fill' may light"),
}
"""Facts by effect for which it runs, and what the reason names."""

NOT_CALLED_FOR = [
    ("world_lights", {"is_lit_by_world": False}, "the world is black"),
    ("world_lights", {"triangles": 0}, "'hall' has no visible surface"),
    ("direct_light", {"lamps": LampFacts((), ("Off",), (), ()), "is_lit_by_world": False}, "'Off' has no power"),
    ("direct_light", {"lamps": LampFacts((), (), ("Spot",), ()), "is_lit_by_world": False}, "'Spot' shines past"),
    (
        "direct_light",
        {"lamps": LampFacts(("Spot",), (), (), ("Spot",)), "is_lit_by_world": False},
        "'Spot' lights nothing that the picture shows",
    ),
    ("direct_light", {"screen": replace(SCREEN, shown=0)}, "none of 1,000 pixels"),
    ("shadows", {"lamp_occlusion": OPEN}, "12 triangles"),
    ("shadows", DARK, "nothing shines"),
    ("layered_materials", {"layered": ()}, "every material is Diffuse"),
    ("direct_specular", {"glossy": ()}, "no material"),
    ("direct_specular", {"screen": replace(SCREEN, glossy=0)}, "none of 1,000 pixels"),
    ("direct_specular", {"lamps": NO_LAMPS, "is_lit_by_world": False}, "no direct light"),
    ("indirect_light", DARK, "nothing shines"),
    ("indirect_light", {"technique": TechniqueFacts("direct", has_indirect=False)}, "'direct' has direct light only"),
    ("indirect_light", {"light_mesh": LightMeshFacts(44, 0, 0, 0)}, "none of the 44 virtual lights"),
    (
        "indirect_light",
        {"lamps": NO_LAMPS, "is_lit_by_world": False, "light_mesh": LightMeshFacts(44, 40, 0, 0)},
        "neither lamp nor world lights the 44",
    ),
    (
        "indirect_light",
        {
            "lamps": LampFacts(("Key",), (), (), ()),
            "is_lit_by_world": False,
            "light_mesh": LightMeshFacts(44, 40, 0, 0),
        },
        "neither lamp nor world lights the 44",
    ),
    ("light_tags", {"light_mesh": LightMeshFacts(44, 40, 2, 0)}, "none of the 44 virtual lights has a tag"),
    ("light_tags", {"tagged_surface": False}, "no surface has a tag"),
    ("light_tags", {"technique": TechniqueFacts("rsm_gather")}, "no virtual lights"),
    ("light_visibility", {}, "'vlm' is not asked"),
    ("light_visibility", {"technique": replace(VLM, asks_visibility=True), "occlusion": OPEN}, "12 triangles"),
    ("light_visibility", {"technique": replace(VLM, asks_visibility=True), **DARK}, "no indirect light"),
    ("ambient_occlusion", {"technique": replace(VLM, knows_visibility=True)}, "'vlm' knows by itself"),
    ("ambient_occlusion", {"technique": replace(VLM, gains_by_occlusion=False)}, "farther from the truth"),
    ("ambient_occlusion", {"occlusion": OPEN}, "12 triangles"),
    ("ambient_occlusion", DARK, "no indirect light"),
    ("ambient_occlusion", {"technique": TechniqueFacts("direct", has_indirect=False)}, "'direct'"),
    ("screen_reflection", {"glossy": ()}, "no material"),
    ("screen_reflection", {"screen": replace(SCREEN, glossy=0)}, "none of 1,000 pixels"),
    ("screen_reflection", {"technique": replace(VLM, specular=OWN_SPECULAR)}, "'vlm' has its own"),
    ("screen_reflection", {"technique": replace(VLM, specular=NO_SPECULAR)}, "direct light only"),
    ("screen_reflection", DARK, "nothing shines"),
    ("light_mesh_reflection", {"technique": TechniqueFacts("rsm_gather")}, "'rsm_gather' has no polygons"),
    ("light_mesh_reflection", {"glossy": ()}, "no material"),
    ("light_mesh_reflection", {"light_mesh": LightMeshFacts(44, 0, 0, 0)}, "no virtual light shines"),
    ("map_reflection", {}, "the light mesh shows"),
    ("map_reflection", {"technique": TechniqueFacts("rsm_gather"), "glossy": ()}, "no material"),
    (
        "map_reflection",
        {"technique": TechniqueFacts("rsm_gather"), "lamps": NO_LAMPS, "is_lit_by_world": False},
        "no lamp shines",
    ),
]


@pytest.mark.parametrize("name", CALLED_FOR)
def test_it_runs_where_it_is_called_for(name: str) -> None:
    facts, named = CALLED_FOR[name]
    decision = plan_effects(facts)[name]
    assert (decision.action, decision.is_forced) == (RUN, False)
    assert named in decision.reason


@pytest.mark.parametrize(("name", "changes", "named"), NOT_CALLED_FOR)
def test_it_is_left_out_where_it_is_not(name: str, changes: dict[str, Any], named: str) -> None:
    decision = plan_effects(replace(FACTS, **changes))[name]
    assert (decision.action, decision.is_forced) == (SKIP, False)
    assert named in decision.reason


def test_accumulation_runs_only_where_it_is_switched_on() -> None:
    assert plan_effects(FACTS)["temporal_accumulation"].action == SKIP
    decision = plan_effects(FACTS, {"temporal_accumulation": ON})["temporal_accumulation"]
    assert (decision.action, decision.is_forced) == (RUN, True)
    assert "screen reflection" in decision.reason
    calm = replace(FACTS, glossy=(), occlusion=OPEN)
    assert "though no effect of the frame is noisy" in str(
        plan_effects(calm, {"temporal_accumulation": ON})["temporal_accumulation"]
    )


def test_every_rule_is_tested_both_ways() -> None:
    names = {rule.name for rule in RULES}
    assert names == set(CALLED_FOR) | {"temporal_accumulation"}
    assert names == {name for name, _, _ in NOT_CALLED_FOR} | {"temporal_accumulation"}


@pytest.mark.parametrize(
    "name", ["world_lights", "direct_light", "shadows", "direct_specular", "ambient_occlusion", "screen_reflection"]
)
def test_what_is_switched_on_runs_and_says_that_nothing_calls_for_it(name: str) -> None:
    decision = plan_effects(UNLIT, {name: ON})[name]
    assert (decision.action, decision.is_forced) == (RUN, True)
    assert "switched on, though" in decision.reason


@pytest.mark.parametrize("name", CALLED_FOR)
def test_what_is_switched_off_does_not_run(name: str) -> None:
    decision = plan_effects(CALLED_FOR[name][0], {name: OFF})[name]
    assert (decision.action, decision.is_forced) == (SKIP, True)
    assert "switched off, though" in decision.reason


def test_what_is_impossible_does_not_run_for_anybody() -> None:
    facts = replace(FACTS, technique=TechniqueFacts("rsm_gather"))
    decision = plan_effects(facts, {"light_mesh_reflection": ON})["light_mesh_reflection"]
    assert decision.action == SKIP
    assert "has no polygons" in decision.reason


def test_without_economy_what_is_neutral_runs_and_what_is_not_wanted_idles() -> None:
    dull = replace(FACTS, glossy=(), lamp_occlusion=OPEN, occlusion=OPEN)
    plan = plan_effects(dull, economical=False)
    assert all(plan.runs(name) for name in ("shadows", "direct_specular", "screen_reflection"))
    for name in ("ambient_occlusion", "map_reflection"):
        assert plan.computes(name)
        assert not plan.runs(name)
    assert plan["light_visibility"].action == SKIP
    assert not plan_effects(dull, {"shadows": OFF}, economical=False).runs("shadows")


def test_a_frame_runs_what_one_of_its_pictures_runs() -> None:
    without = plan_effects(replace(FACTS, screen=replace(SCREEN, glossy=0)))
    with_gloss = plan_effects(FACTS)
    for merged in (without.merged(with_gloss), with_gloss.merged(without)):
        assert merged["screen_reflection"] == with_gloss["screen_reflection"]
        assert merged["direct_light"] == with_gloss["direct_light"]


def test_choices_and_settings_are_told_apart() -> None:
    choices, settings = parse_choices({"shadows": OFF, "ambient_occlusion.radius": "0.1", "ambient_occlusion": AUTO})
    assert choices == {"shadows": OFF, "ambient_occlusion": AUTO}
    assert settings == {"ambient_occlusion": {"radius": "0.1"}}


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"glow": ON}, "'glow'"),
        ({"shadows": "maybe"}, "'maybe'"),
        ({"glow.size": 1.0}, "'glow'"),
        ({"shadows": True}, "True"),
    ],
)
def test_an_unknown_effect_or_choice_is_refused(values: dict[str, Any], named: str) -> None:
    with pytest.raises(InvalidInput, match=named):
        parse_choices(values)


def test_structures_say_what_was_made_and_what_was_used_again() -> None:
    made, again = structure_decisions({"shadow maps": (2, 3), "octree": (0, 1)})[::-1]
    assert (made.action, again.action) == (RUN, REUSE)
    assert "2 made" in made.reason
    assert "3 used again" in made.reason
    assert "1 used again" in again.reason


def test_a_plan_survives_being_sent() -> None:
    plan = replace(plan_effects(FACTS), structures=(Decision("a", "A", REUSE, "why"),))
    tree = {part: [vars(decision) for decision in getattr(plan, part)] for part in ("effects", "structures")}
    assert plan_from_tree(tree) == plan
    assert plan_from_tree({"effects": [], "structures": []}) == EffectPlan()


def test_a_lamp_that_shines_on_virtual_lights_alone_is_light() -> None:
    """Lights drawn by hand need not stand for a surface: phase one then measures on themselves."""
    card = lights_from_triangles([[(0.0, 0.0, 3.0), (0.0, 1.0, 3.0), (1.0, 0.0, 3.0)]], emission=0.0, colour=0.5)
    floor = quad((-1.0, -1.0, 0.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    upwards = Light("up", AREA, (20.0,) * 3, (0.0, 0.0, 1.5), y_axis=(0.0, -1.0, 0.0), z_axis=(0.0, 0.0, -1.0))
    scene = SceneSnapshot("card", (floor,), lights=(upwards,))
    for snapshot, named in (
        (scene, ("up",)),
        (replace(scene, lights=(replace(upwards, position=(0.0, 0.0, 4.0)),)), ()),
    ):
        facts = gather_facts(snapshot, card, VLM, OPEN, OPEN, 1)
        assert facts.lamps.on_lights == named
        plan = plan_effects(facts)
        assert plan.runs("indirect_light") == bool(named)
        assert not plan.runs("direct_light")
        assert "'up' shines past every surface" in plan["direct_light"].reason


def test_where_the_virtual_lights_are_switched_off_maps_show_what_the_camera_does_not_see() -> None:
    for off in ("indirect_light", "light_mesh_reflection"):
        plan = plan_effects(FACTS, {off: OFF})
        assert not plan.runs("light_mesh_reflection")
        assert plan.runs("map_reflection")
    assert "does not run" in plan_effects(FACTS, {"indirect_light": OFF})["light_mesh_reflection"].reason
