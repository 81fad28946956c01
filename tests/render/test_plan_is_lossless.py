# SPDX-License-Identifier: GPL-3.0-or-later
"""What the plan leaves out, and what it uses again, does not show: random scenes with all that is enabled, and without
what their plans leave out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.random_scenes import Shot, random_scene
from vlm_addon.core import effects
from vlm_addon.core.effect_rules import NEUTRAL, Before, Verdict
from vlm_addon.core.effects import RUN, SKIP
from vlm_addon.core.scene import Float64
from vlm_addon.core.scene_facts import SceneFacts
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings

SCENES = 30
SHORT = 10
ONE_STEP = 1.0 / 255.0
QUICK = RenderSettings(40, 30, samples=2, shadow_resolution=128, shadow_samples=4, world_lights=8)


def difference(planned: Frame, everything: Frame) -> float:
    """The greatest one of a pixel as displays show it, in [0, 1], exposed so that its brightest hundredth is white."""
    images = [frame.images["combined"][..., :3].astype(np.float64) for frame in (planned, everything)]
    scale = max(float(np.quantile(images[1], 0.99)), 1e-6)
    first, second = (_encoded(np.clip(image / scale, 0.0, 1.0)) for image in images)
    return float(np.abs(first - second).max())


def _encoded(linear: Float64) -> Float64:
    """sRGB."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)


def both(device: Device, shot: Shot, settings: RenderSettings) -> tuple[Frame, Frame]:
    """With the plan, and with everything."""
    return tuple(  # type: ignore[return-value]
        device.render(shot.snapshot, shot.light_mesh, replace(settings, economical=economical))
        for economical in (True, False)
    )


@pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=[] if seed < SHORT else [pytest.mark.full]) for seed in range(SCENES)]
)
def test_the_picture_is_that_of_everything_enabled(device: Device, seed: int) -> None:
    scene = random_scene(seed)
    settings = replace(QUICK, technique=scene.technique, technique_settings=scene.settings)
    for shot in scene.shots:
        planned, everything = both(device, shot, settings)
        skipped = [each.name for each in planned.plan.effects if each.action == SKIP]
        assert difference(planned, everything) <= ONE_STEP, f"after {shot.changed}, without {skipped}"
        for decision in planned.plan.effects:
            assert decision.action == SKIP or everything.plan.runs(decision.name)


def test_random_scenes_call_for_everything_and_for_nothing(device: Device) -> None:
    """The comparison would mean nothing if no plan left anything out, or if one always did."""
    run: set[str] = set()
    skipped: set[str] = set()
    again: set[str] = set()
    for seed in range(SHORT):
        scene = random_scene(seed)
        settings = replace(QUICK, technique=scene.technique, technique_settings=scene.settings)
        for shot in scene.shots:
            plan = device.render(shot.snapshot, shot.light_mesh, settings).plan
            run |= {each.name for each in plan.effects if each.action == RUN}
            skipped |= {each.name for each in plan.effects if each.action == SKIP}
            again |= {each.name for each in plan.structures if each.action != RUN}
    assert run >= {"world_lights", "direct_light", "shadows", "direct_specular", "indirect_light", "ambient_occlusion"}
    assert run >= {"screen_reflection", "light_mesh_reflection", "map_reflection", "light_tags", "light_visibility"}
    assert skipped >= run - {"indirect_light"}
    assert len(again) >= 3


@pytest.mark.parametrize("name", ["direct_light", "shadows", "direct_specular", "screen_reflection", "indirect_light"])
def test_a_wrong_rule_shows(device: Device, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(facts: SceneFacts, before: Before) -> Verdict:
        return Verdict(NEUTRAL, "a wrong rule says so")

    rules = tuple(replace(rule, judge=wrong) if rule.name == name else rule for rule in effects.RULES)
    monkeypatch.setattr(effects, "RULES", rules)
    differences = []
    for seed in range(SHORT):
        scene = random_scene(seed)
        settings = replace(QUICK, technique=scene.technique, technique_settings=scene.settings)
        planned, everything = both(device, scene.shots[0], settings)
        assert planned.plan[name].reason == "a wrong rule says so"
        differences.append(difference(planned, everything))
    assert max(differences) > 4.0 * ONE_STEP
