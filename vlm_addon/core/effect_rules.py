# SPDX-License-Identifier: GPL-3.0-or-later
"""What in a scene calls for each effect, and the sentence that says so."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass

from .scene_facts import NO_SPECULAR, OWN_SPECULAR, SceneFacts

CALLED_FOR, NEUTRAL, NOT_WANTED, IMPOSSIBLE = "called for", "neutral", "not wanted", "impossible"
"""NEUTRAL: it would change nothing, which is known without running it. NOT_WANTED: it would change the picture, but
for the worse: something else does the same already. IMPOSSIBLE: what it needs is not there."""

SINGULAR = {"have": "has"}
MOST_NAMES = 2
"""In a sentence; the others are counted."""


@dataclass(frozen=True)
class Verdict:
    """What a rule finds. reason: a clause that names the object or number that decided."""

    kind: str
    reason: str


@dataclass(frozen=True)
class Before:
    """Names of the effects before one. running: those that run. enabled: those that do or would change nothing."""

    running: Set[str] = frozenset()
    enabled: Set[str] = frozenset()


@dataclass(frozen=True)
class Rule:
    """One effect. default: "auto" (where it is called for) or "off". text: what it does and costs, for tooltips.
    judge: the verdict, of the facts and the effects before it."""

    name: str
    label: str
    default: str
    text: str
    judge: Callable[[SceneFacts, Before], Verdict]


def _listed(names: Sequence[str], verb: str = "") -> str:
    """Names with a verb, if one is given, in its number: what is for one has an s at its end."""
    if verb:
        return f"{_listed(names)} {verb if len(names) > 1 else SINGULAR.get(verb, verb + 's')}"
    shown = ", ".join(repr(name) for name in names[:MOST_NAMES])
    return f"{shown} and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else shown


def _shows_nothing(facts: SceneFacts) -> Verdict | None:
    if not facts.triangles:
        return Verdict(NEUTRAL, f"scene {facts.scene!r} has no visible surface")
    if facts.screen is not None and not facts.screen.shown:
        return Verdict(NEUTRAL, f"none of {facts.screen.pixels:,} pixels shows a surface")
    return None


def _is_dark(facts: SceneFacts) -> Verdict | None:
    if facts.has_light:
        return None
    return Verdict(
        NEUTRAL, "nothing shines: no lamp has power and something before it, the world is black, and no material glows"
    )


def _world_lights(facts: SceneFacts, before: Before) -> Verdict:
    if not facts.is_lit_by_world:
        return Verdict(NEUTRAL, "the world is black")
    return _shows_nothing(facts) or Verdict(CALLED_FOR, "the world sends light")


def _direct_light(facts: SceneFacts, before: Before) -> Verdict:
    lamps = facts.lamps
    if not lamps.shining and not facts.is_lit_by_world:
        if lamps.beside:
            return Verdict(NEUTRAL, f"{_listed(lamps.beside, 'shine')} past every surface")
        dark = f"{_listed(lamps.dark, 'have')} no power" if lamps.dark else f"scene {facts.scene!r} has none"
        return Verdict(NEUTRAL, f"no lamp shines: {dark}")
    nothing = _shows_nothing(facts)
    if nothing is not None:
        return nothing
    seen = [name for name in lamps.shining if name not in lamps.not_on_screen]
    if seen:
        return Verdict(CALLED_FOR, f"{_listed(seen, 'shine')} on what the picture shows")
    if facts.is_lit_by_world:
        return Verdict(CALLED_FOR, "the world sends light")
    return Verdict(NEUTRAL, f"{_listed(lamps.not_on_screen, 'light')} nothing that the picture shows")


def _shadows(facts: SceneFacts, before: Before) -> Verdict:
    dark = _is_dark(facts)
    if dark is not None:
        return dark
    return Verdict(CALLED_FOR if facts.lamp_occlusion.possible else NEUTRAL, facts.lamp_occlusion.reason)


def _glossy(facts: SceneFacts) -> Verdict:
    if not facts.glossy:
        return Verdict(NEUTRAL, "no material has a specular layer")
    names = _listed(facts.glossy, "have")
    if facts.screen is None:
        return Verdict(CALLED_FOR, f"{names} a specular layer")
    if not facts.screen.glossy:
        return Verdict(
            NEUTRAL,
            f"none of {facts.screen.pixels:,} pixels shows a surface with a specular layer ({_listed(facts.glossy)})",
        )
    share = 100.0 * facts.screen.glossy / facts.screen.pixels
    return Verdict(CALLED_FOR, f"{names} a specular layer, on {share:.3g} % of the picture")


def _layered_materials(facts: SceneFacts, before: Before) -> Verdict:
    if not facts.layered:
        return Verdict(NEUTRAL, "every material is Diffuse")
    return Verdict(CALLED_FOR, f"{_listed(facts.layered, 'have')} layers that share the light")


def _direct_specular(facts: SceneFacts, before: Before) -> Verdict:
    if "direct_light" not in before.running:
        return Verdict(NEUTRAL, "there is no direct light")
    return _glossy(facts)


def _indirect_light(facts: SceneFacts, before: Before) -> Verdict:
    name = facts.technique.name
    if not facts.technique.has_indirect:
        return Verdict(IMPOSSIBLE, f"technique {name!r} has direct light only")
    nothing = _shows_nothing(facts) or _is_dark(facts)
    if nothing is not None:
        return nothing
    of_lights_alone = facts.technique.has_reflecting_lights and not facts.technique.bounces_without_lights
    if of_lights_alone and facts.light_mesh is not None:
        return _light_of_light_mesh(facts)
    return Verdict(CALLED_FOR, f"technique {name!r} finds what surfaces reflect of it")


def _light_of_light_mesh(facts: SceneFacts) -> Verdict:
    lights = facts.light_mesh
    assert lights is not None
    if lights.glowing:
        return Verdict(CALLED_FOR, f"{lights.glowing:,} of {lights.lights:,} virtual lights shine by themselves")
    if not facts.lamps.on_lights and not facts.is_lit_by_world:
        return Verdict(NEUTRAL, f"neither lamp nor world lights the {lights.lights:,} virtual lights")
    if not lights.reflecting:
        return Verdict(NEUTRAL, f"none of the {lights.lights:,} virtual lights reflects or shines")
    return Verdict(CALLED_FOR, f"{lights.reflecting:,} virtual lights reflect what lamps and world send")


def _light_tags(facts: SceneFacts, before: Before) -> Verdict:
    if not facts.technique.has_reflecting_lights or facts.light_mesh is None:
        return Verdict(NEUTRAL, "there are no virtual lights with tags")
    if not facts.light_mesh.tagged:
        return Verdict(NEUTRAL, f"none of the {facts.light_mesh.lights:,} virtual lights has a tag")
    if not facts.tagged_surface:
        return Verdict(NEUTRAL, "no surface has a tag")
    which = "of the same" if not facts.light_mesh.links else f"of the same and of {facts.light_mesh.links:,} links"
    return Verdict(CALLED_FOR, f"{facts.light_mesh.tagged:,} virtual lights have a tag and leave out surfaces {which}")


def _light_visibility(facts: SceneFacts, before: Before) -> Verdict:
    if not facts.technique.asks_visibility:
        return Verdict(IMPOSSIBLE, f"technique {facts.technique.name!r} is not asked for it in its settings")
    if "indirect_light" not in before.running:
        return Verdict(NEUTRAL, "there is no indirect light")
    return Verdict(CALLED_FOR if facts.occlusion.possible else NEUTRAL, facts.occlusion.reason)


def _ambient_occlusion(facts: SceneFacts, before: Before) -> Verdict:
    if not facts.technique.has_indirect:
        return Verdict(IMPOSSIBLE, f"technique {facts.technique.name!r} has no indirect light to darken")
    if facts.technique.knows_visibility:
        return Verdict(NOT_WANTED, f"technique {facts.technique.name!r} knows by itself where its light is occluded")
    if not facts.technique.gains_by_occlusion:
        text = f"measured, it takes the indirect light of technique {facts.technique.name!r} farther from the truth"
        return Verdict(NOT_WANTED, text)
    if not facts.occlusion.possible:
        return Verdict(NOT_WANTED, f"no indirect light is occluded: {facts.occlusion.reason}")
    if "indirect_light" not in before.running:
        return Verdict(NEUTRAL, "there is no indirect light")
    return Verdict(CALLED_FOR, f"nothing else tells where indirect light is occluded, and {facts.occlusion.reason}")


def _reflections(facts: SceneFacts) -> Verdict | None:
    """Why no effect need find light in glossy surfaces; None where one must."""
    technique = facts.technique
    if technique.specular == NO_SPECULAR:
        return Verdict(NOT_WANTED, f"technique {technique.name!r} has direct light only")
    if technique.specular == OWN_SPECULAR:
        return Verdict(NOT_WANTED, f"technique {technique.name!r} has its own light in glossy surfaces")
    verdict = _shows_nothing(facts) or _is_dark(facts) or _glossy(facts)
    return None if verdict.kind == CALLED_FOR else verdict


def _screen_reflection(facts: SceneFacts, before: Before) -> Verdict:
    return _reflections(facts) or _glossy(facts)


def _light_mesh_reflection(facts: SceneFacts, before: Before) -> Verdict:
    if not facts.technique.has_reflecting_lights:
        return Verdict(IMPOSSIBLE, f"technique {facts.technique.name!r} has no polygons that shine")
    if "indirect_light" not in before.enabled:
        return Verdict(IMPOSSIBLE, f"technique {facts.technique.name!r}, which lights the virtual lights, does not run")
    if "indirect_light" not in before.running:
        return _reflections(facts) or Verdict(NEUTRAL, "no virtual light shines")
    return _reflections(facts) or _glossy(facts)


def _map_reflection(facts: SceneFacts, before: Before) -> Verdict:
    if "light_mesh_reflection" in before.enabled:
        return Verdict(NOT_WANTED, "the light mesh shows in glossy surfaces what the camera does not see")
    unwanted = _reflections(facts)
    if unwanted is not None:
        return unwanted
    if not facts.lamps.shining and not facts.is_lit_by_world:
        return Verdict(NEUTRAL, "no lamp shines, so there is no reflective shadow map")
    return Verdict(
        CALLED_FOR,
        f"{_listed(facts.lamps.shining) or 'the world'} may light what is seen in {_listed(facts.glossy)} alone",
    )


NOISY = ("screen_reflection", "map_reflection", "ambient_occlusion")


def _temporal_accumulation(facts: SceneFacts, before: Before) -> Verdict:
    noisy = [name for name in NOISY if name in before.running]
    if not noisy:
        return Verdict(NEUTRAL, "no effect of the frame is noisy")
    return Verdict(CALLED_FOR, f"{', '.join(noisy).replace('_', ' ')} are noisy in a frame of {facts.samples} pictures")


RULES = (
    Rule(
        "layered_materials",
        "Layered materials",
        "auto",
        "Layers of Principled materials, in all passes that reflect light",
        _layered_materials,
    ),
    Rule("world_lights", "World lights", "auto", "The world's light as suns with shadows", _world_lights),
    Rule("direct_light", "Direct light", "auto", "Light straight from lamps and world, a pass for each", _direct_light),
    Rule("shadows", "Shadows", "auto", "Maps of what lamps see, for direct light and phase one", _shadows),
    Rule("direct_specular", "Highlights", "auto", "Lamps in glossy surfaces", _direct_specular),
    Rule("indirect_light", "Indirect light", "auto", "What the technique finds", _indirect_light),
    Rule("light_tags", "Tags", "auto", "Virtual lights leave out surfaces of their own tag", _light_tags),
    Rule(
        "light_visibility",
        "Visibility of lights",
        "auto",
        "Rays or baked visibility, as the technique's settings ask",
        _light_visibility,
    ),
    Rule(
        "ambient_occlusion",
        "Ambient occlusion",
        "auto",
        "Darkens indirect light in corners and where things touch, from the depth of the picture",
        _ambient_occlusion,
    ),
    Rule(
        "screen_reflection",
        "Screen reflection",
        "auto",
        "What the picture shows, in glossy surfaces: a ray for each glossy pixel and picture",
        _screen_reflection,
    ),
    Rule(
        "light_mesh_reflection",
        "Light mesh reflection",
        "auto",
        "Virtual lights in glossy surfaces: about as long as phase two where pixels are glossy",
        _light_mesh_reflection,
    ),
    Rule(
        "map_reflection",
        "Map reflection",
        "auto",
        "What lamps see and the camera does not, in glossy surfaces: a ray through each reflective shadow map",
        _map_reflection,
    ),
    Rule(
        "temporal_accumulation",
        "Temporal accumulation",
        "off",
        "Averages noisy effects over frames; a frame then depends on those before it",
        _temporal_accumulation,
    ),
)
"""In the order of the frame."""
