# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of a frame: which effects run, which are left out, and why, in a sentence each.

An effect is left out where its own output is provably neutral, so the picture with the plan is the picture without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from .effect_rules import IMPOSSIBLE, NEUTRAL, NOT_WANTED, RULES, Before, Rule, Verdict
from .errors import InvalidInput
from .scene_facts import SceneFacts

AUTO, ON, OFF = "auto", "on", "off"
CHOICES = (AUTO, ON, OFF)
RUN, REUSE, SKIP, IDLE = "run", "reuse", "skip", "idle"


@dataclass(frozen=True)
class Decision:
    """Of one effect or structure. action: RUN, REUSE (what an earlier frame made), SKIP, or IDLE: it runs, but what it
    finds is not wanted (only where nothing is to be left out). is_forced: by the artist,
    not by what the scene calls for."""

    name: str
    label: str
    action: str
    reason: str
    is_forced: bool = False

    def __str__(self) -> str:
        forced = " (forced)" if self.is_forced else ""
        return f"{self.label}: {self.action}{forced}, {self.reason}"


@dataclass(frozen=True)
class EffectPlan:
    """What a frame does. effects: by RULES, in the order of the frame. structures: what is kept over frames."""

    effects: tuple[Decision, ...] = ()
    structures: tuple[Decision, ...] = ()

    def __getitem__(self, name: str) -> Decision:
        return next(decision for decision in self.effects if decision.name == name)

    def runs(self, name: str) -> bool:
        """Whether the effect of that name runs."""
        return self[name].action == RUN

    def computes(self, name: str) -> bool:
        """Whether its passes run, though maybe for nothing."""
        return self[name].action in (RUN, IDLE)

    def merged(self, other: EffectPlan) -> EffectPlan:
        """Of two pictures of a frame: an effect runs where it runs in one of them."""
        pairs = zip(self.effects, other.effects, strict=True)
        return replace(self, effects=tuple(b if a.action != RUN and b.action == RUN else a for a, b in pairs))


def plan_from_tree(tree: Mapping[str, Any]) -> EffectPlan:
    """The plan whose `array_codec.flatten` gave `tree`."""
    return EffectPlan(*(tuple(Decision(**item) for item in tree[part]) for part in ("effects", "structures")))


def plan_effects(facts: SceneFacts, choices: Mapping[str, str] | None = None, *, economical: bool = True) -> EffectPlan:
    """What a scene calls for.

    choices: AUTO, ON or OFF by name of effect; its own default where not named. economical: leave out what is neutral
    or not wanted; otherwise everything enabled runs. Raises InvalidInput for an unknown effect or choice.
    """
    choices = {} if choices is None else choices
    for name, choice in choices.items():
        _require_known(name, choice)
    decisions: list[Decision] = []
    running: set[str] = set()
    enabled: set[str] = set()
    for rule in RULES:
        verdict = rule.judge(facts, Before(running, enabled))
        decision = _decided(rule, verdict, choices.get(rule.name, rule.default), economical)
        decisions.append(decision)
        if decision.action == RUN:
            running.add(rule.name)
        if decision.action == RUN or (verdict.kind == NEUTRAL and choices.get(rule.name) != OFF):
            enabled.add(rule.name)
    return EffectPlan(tuple(decisions))


def _decided(rule: Rule, verdict: Verdict, choice: str, economical: bool) -> Decision:
    def decision(action: str, reason: str, is_forced: bool = False) -> Decision:
        return Decision(rule.name, rule.label, action, reason, is_forced)

    is_needed = verdict.kind not in (NEUTRAL, NOT_WANTED, IMPOSSIBLE)
    if choice == OFF:
        is_default = rule.default == OFF
        text = "off unless it is switched on" if is_default else f"switched off, though {verdict.reason}"
        return decision(SKIP, text if is_needed or is_default else verdict.reason, is_needed and not is_default)
    if verdict.kind == IMPOSSIBLE:
        return decision(SKIP, verdict.reason)
    if choice == ON and not is_needed:
        return decision(RUN, f"switched on, though {verdict.reason}", True)
    if choice == ON and rule.default == OFF:
        return decision(RUN, f"switched on: {verdict.reason}", True)
    if is_needed:
        return decision(RUN, verdict.reason)
    if not economical:
        action = RUN if verdict.kind == NEUTRAL else IDLE
        return decision(action, f"nothing is left out, though {verdict.reason}", True)
    return decision(SKIP, verdict.reason)


def parse_choices(values: Mapping[str, Any]) -> tuple[dict[str, str], dict[str, dict[str, Any]]]:
    """Choices by effect, and settings by effect, of values by "EFFECT" or "EFFECT.SETTING".

    Raises InvalidInput for an unknown effect or choice; the settings are not looked at.
    """
    choices: dict[str, str] = {}
    settings: dict[str, dict[str, Any]] = {}
    for key, value in values.items():
        name, dot, setting = key.partition(".")
        if dot:
            _require_known(name, AUTO)
            settings.setdefault(name, {})[setting] = value
        else:
            _require_known(name, value)
            choices[name] = value
    return choices, settings


def _require_known(name: str, choice: Any) -> None:
    names = [rule.name for rule in RULES]
    if name not in names:
        raise InvalidInput(f"effect {name!r}", "no such effect", f"use one of: {', '.join(names)}")
    if choice not in CHOICES:
        raise InvalidInput(f"effect {name!r}", f"{choice!r} is not a choice", f"use one of: {', '.join(CHOICES)}")


def structure_decisions(events: Mapping[str, tuple[int, int]]) -> tuple[Decision, ...]:
    """Of what is kept over frames. events: by kind, how many a frame made and how many it used again."""
    found = []
    for kind, (built, reused) in sorted(events.items()):
        label = kind.replace("_", " ").capitalize()
        text = f"{built} made: what they depend on is new or has changed" if built else "nothing has changed for them"
        reason = f"{text}; {reused} used again" if reused else text
        found.append(Decision(kind, label, RUN if built else REUSE, reason))
    return tuple(found)
