# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands of the command line that render, and that say what there is to render with."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import bpy

from ..core.effects import SKIP
from ..core.errors import InvalidInput
from ..core.progress import Progress
from ..core.scene import Finding
from ..core.settings import describe, from_mapping
from ..render.frame_effects import checked_effects
from ..render.frame_types import Frame, RenderSettings, require_in_range
from ..render.technique import technique_by_name, technique_list
from ..terminal import TerminalProgress, table
from .command_support import opened_scene, print_findings, require_apart, scene_report, write_json
from .engine import picture_size
from .extraction.extract import require_camera, require_lights, require_surfaces
from .extraction.light_mesh_io import Extraction
from .image_io import LOCAL_VIEW, PNG, require_format, require_view, write_display, write_image
from .interface.properties import effect_values, technique_settings
from .render_process import KEPT
from .scene_file import require_writable


def render_command(arguments: Namespace) -> None:
    """`render`: writes one picture, its buffers and a report."""
    is_local = require_format(arguments.out) == PNG and arguments.view == LOCAL_VIEW
    require_apart(arguments.scene, [path for path in (arguments.out, arguments.json) if path is not None])
    settings = _asked_settings(arguments, arguments.technique)
    settings = replace(
        settings,
        samples=arguments.samples,
        shadow_samples=arguments.shadow_samples,
        buffers=arguments.buffers is not None,
        display=is_local,
        economical=not arguments.everything,
        world_lights=RenderSettings.world_lights if arguments.world_lights is None else arguments.world_lights,
    )
    require_in_range(settings)
    if arguments.buffers is not None:
        _make_folder(arguments.buffers)
    opened, found = opened_scene(arguments)
    settings = with_scene_settings(settings, arguments.size)
    if arguments.world_lights is None:
        settings = replace(settings, world_lights=bpy.context.scene.vlm.world_lights)
    require_camera(found.snapshot)
    require_surfaces(found.snapshot)
    require_lights(found.snapshot)
    if arguments.view is not None:
        require_view(arguments.view)
    frame = _rendered(found, settings, TerminalProgress())
    if arguments.buffers is not None:
        for name, image in frame.images.items():
            write_image(arguments.buffers / f"{name}.exr", image)
    if is_local:
        write_display(arguments.out, frame.images["display"])
    else:
        write_image(arguments.out, frame.images["combined"], view=arguments.view)
    print_findings((*frame.findings, *found.snapshot.findings))
    for reason in frame.reasons:
        print(f"pass: {reason}")
    for decision in frame.plan.effects:
        if decision.action == SKIP or decision.is_forced:
            print(f"effect: {decision}")
    print(_timing_table(frame))
    write_json(arguments.json, scene_report(opened) | _frame_report(frame, settings, found.snapshot.findings))


def effects_command(arguments: Namespace) -> None:
    """`effects`: prints which effects a frame of the scene runs, and why."""
    require_apart(arguments.scene, [arguments.json] if arguments.json is not None else [])
    if arguments.technique is not None:
        _asked_settings(arguments, arguments.technique)
    opened, found = opened_scene(arguments)
    technique = arguments.technique or bpy.context.scene.vlm.technique
    settings = with_scene_settings(_asked_settings(arguments, technique), arguments.size)
    require_camera(found.snapshot)
    frame = _rendered(found, replace(settings, samples=1, plan_only=True), TerminalProgress())
    decisions = frame.plan.effects
    print(f"{technique}, {settings.width} x {settings.height} pixels")
    for decision in decisions:
        print(f"{decision.name:<24}{decision.action:<6}{'(forced) ' if decision.is_forced else ''}{decision.reason}")
    report = {
        "technique": technique,
        "size": [settings.width, settings.height],
        "effects": list(map(asdict, decisions)),
    }
    write_json(arguments.json, scene_report(opened) | report)


def _asked_settings(arguments: Namespace, technique: str) -> RenderSettings:
    """What the command line says of a frame, of a size that is not known yet. Raises InvalidInput."""
    chosen = _setting_texts(arguments.set, "--set")
    from_mapping(technique_by_name(technique).settings, chosen, f"technique {technique!r}")
    effects = checked_effects(_setting_texts(arguments.effect, "--effect"))
    width, height = arguments.size or (1, 1)
    return RenderSettings(width, height, technique, chosen, effects=effects)


def with_scene_settings(settings: RenderSettings, size: tuple[int, int] | None) -> RenderSettings:
    """`settings` with what the current scene says of all that they do not."""
    scene = bpy.context.scene
    kept = technique_settings(scene, settings.technique)
    technique_type = technique_by_name(settings.technique)
    values = {**kept, **settings.technique_settings}
    chosen: Any = from_mapping(technique_type.settings, values, f"technique {settings.technique!r}")
    effects = {**effect_values(scene), **settings.effects}
    width, height = size or picture_size(scene)
    return replace(settings, width=width, height=height, technique_settings=asdict(chosen), effects=effects)


def _setting_texts(pairs: Sequence[str], option: str) -> dict[str, str]:
    texts = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not (name and equals):
            raise InvalidInput(f"{option} {pair!r}", "it is not KEY=VALUE", f"write it as in {option} NAME=1")
        texts[name] = value
    return texts


def _rendered(found: Extraction, settings: RenderSettings, progress: Progress) -> Frame:
    try:
        return KEPT.render(found.snapshot, found.light_mesh, settings, progress)
    finally:
        KEPT.close()


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InvalidInput(str(folder), f"it cannot be made ({error.strerror})", "give another folder") from error


def _timing_table(frame: Frame) -> str:
    total = sum(ms for _, ms in frame.timings)
    rows = [(name, f"{ms:.1f}") for name, ms in frame.timings]
    return table((f"pass ({frame.device}, {frame.timer})", "ms"), [*rows, ("all passes", f"{total:.1f}")])


def _frame_report(frame: Frame, settings: RenderSettings, findings: tuple[Finding, ...]) -> dict[str, Any]:
    return {
        "settings": asdict(settings),
        "device": frame.device,
        "timer": frame.timer,
        "milliseconds": [list(entry) for entry in frame.timings],
        "counters": frame.counters,
        "reasons": list(frame.reasons),
        "plan": asdict(frame.plan),
        "findings": [str(finding) for finding in (*frame.findings, *findings)],
    }


def techniques_command(arguments: Namespace) -> None:
    """`techniques`: prints each technique with its settings, defaults, units and sources."""
    listed = []
    for technique in technique_list():
        print(f"{technique.name}: {technique.description}\n  known bias: {technique.known_bias()}")
        settings = list(describe(technique.settings))
        for setting in settings:
            print(f"  {setting.name}={setting.default}  ({setting.span}) {setting.text} [{setting.source}]")
        listed.append(
            {
                "name": technique.name,
                "label": technique.label,
                "description": technique.description,
                "known_bias": technique.known_bias(),
                "needs_light_mesh": technique.needs_light_mesh,
                "settings": [asdict(setting) | {"type": setting.type.__name__} for setting in settings],
            }
        )
    if arguments.json is not None:
        require_writable(arguments.json)
    write_json(arguments.json, {"techniques": listed})
