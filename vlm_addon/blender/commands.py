# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands of the command line on scenes: open, extract, work, write. Each returns plain counts or findings."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import bpy

from ..bake import Bake, BakeSettings, bake
from ..core.errors import InvalidInput
from ..core.light_grid_export import SUFFIX as FIXED_SIZE_SUFFIX
from ..core.light_grid_export import save_fixed_size_lists
from ..core.light_grid_file import save_light_grid
from ..core.progress import Progress
from ..core.scene import Finding, SceneSnapshot
from ..core.settings import describe, from_mapping
from ..core.whole_file import atomic_output
from ..light_grid_bake import GridBake, bake_light_grid, check_lights
from ..render.frame_types import Frame, RenderSettings, require_in_range
from ..render.technique import technique_by_name, technique_list
from ..terminal import TerminalProgress, table
from .authoring import NAME
from .availability import light_mesh_objects
from .extract import ExtractOptions, require_camera, require_lights, require_surfaces
from .image_io import LOCAL_VIEW, PNG, require_format, require_view, write_display, write_image
from .light_grid_options import keep_options, scene_grid_settings
from .light_mesh_io import Extraction, extract, extract_light_mesh
from .names import SOURCES_PROPERTY
from .properties import ensure_scene_settings, technique_settings
from .render_process import KEPT
from .scene_file import OpenedScene, open_scene, require_writable, save_blend
from .visibility_bake import bake_visibility, require_room_for_visibility
from .write_back import write_light_mesh


def bake_command(arguments: Namespace) -> None:
    """`bake`: writes the scene with its light mesh and a report."""
    outputs = [path for path in (arguments.save, arguments.json, arguments.light_grid) if path is not None]
    if not outputs:
        remedy = "name --save OUT.blend, --light-grid OUT.vlmgrid or --json REPORT.json"
        raise InvalidInput("bake", "nothing would be written", remedy)
    settings = _bake_settings(arguments.triangles, arguments.split)
    _require_apart(arguments.scene, outputs)
    require_room_for_visibility(arguments)
    opened, found = _open(arguments)
    keep_options(bpy.context.scene, arguments)
    drawn = _drawn_by_hand()
    anew = not drawn and (found.light_mesh is None or settings is not None)
    _require_visible_light_meshes(found)
    made = bake(found.snapshot, None if anew else found.light_mesh, settings if anew else None, TerminalProgress())
    if anew:
        for other in light_mesh_objects(bpy.context.scene):
            if other.name != NAME:
                bpy.data.objects.remove(other)
        write_light_mesh(made.light_mesh, NAME, [mesh.name for mesh in found.snapshot.meshes])
    findings = made.findings
    if settings is not None and drawn:
        problem = f"the scene has light meshes drawn by hand ({', '.join(drawn)}), so --triangles made no other"
        findings = (
            Finding(f"scene {found.snapshot.name!r}", problem, "delete them from the scene to have one made"),
            *findings,
        )
    grid = _grid(found.snapshot, arguments)
    findings = (*findings, *(grid.findings if grid is not None else ()))
    visibility = bake_visibility(found.snapshot, arguments.viewport_levels) if arguments.visibility else None
    if grid is not None and arguments.light_grid is not None:
        if arguments.light_grid.suffix == FIXED_SIZE_SUFFIX:
            save_fixed_size_lists(grid.grid, arguments.light_grid)
        else:
            save_light_grid(grid.grid, arguments.light_grid, visibility.baked if visibility is not None else None)
    if arguments.save is not None:
        save_blend(arguments.save, opened)
    _print_findings(findings)
    print(_bake_summary(made))
    if grid is not None:
        print(grid.summary())
    about_grid = {"light_grid": grid.report() if grid is not None else None}
    if visibility is not None:
        print(visibility.summary())
        about_grid["visibility"] = visibility.report()
    about_findings = {"findings": [str(finding) for finding in findings]}
    write_json(arguments.json, _scene_report(opened) | made.report() | about_grid | about_findings)


def _grid(snapshot: SceneSnapshot, arguments: Namespace) -> GridBake | None:
    """The light grid that the scene asks for, of its lights as they are stored, judged; None where it asks for none."""
    settings = scene_grid_settings(bpy.context.scene)
    if settings is None:
        if arguments.light_grid is not None:
            problem = "the scene sums all lights, without a light grid"
            raise InvalidInput("--light-grid", problem, "give --tolerance or --range, too")
        return None
    light_mesh = extract_light_mesh(snapshot, ExtractOptions(viewport_levels=arguments.viewport_levels))
    return None if light_mesh is None else bake_light_grid(snapshot, light_mesh, settings, TerminalProgress())


def _bake_settings(triangles: int | None, split: float | None) -> BakeSettings | None:
    if triangles is None:
        if split is not None:
            raise InvalidInput("--split", f"{split} of how many lights is not said", "give --triangles, too")
        return None
    if triangles < 1:
        raise InvalidInput("--triangles", f"{triangles} lights cannot be made", "ask for at least 1")
    values = {"target_triangles": triangles, "split_share": split or 0.0}
    return from_mapping(BakeSettings, values, "bake")


def _require_visible_light_meshes(found: Extraction) -> None:
    """Raises InvalidInput where light meshes are hidden from the view layer: a bake would not see what it replaces."""
    hidden = light_mesh_objects(bpy.context.scene) if found.light_mesh is None else []
    if hidden:
        problem = "it has lights but is excluded from or hidden in this view layer"
        raise InvalidInput(
            f"light mesh {hidden[0].name!r}", problem, "show it, choose another --view-layer or delete it"
        )


def _drawn_by_hand() -> list[str]:
    """Names of the scene's light meshes that were not made by simplification."""
    return [thing.name for thing in light_mesh_objects(bpy.context.scene) if SOURCES_PROPERTY not in thing]


def _bake_summary(made: Bake) -> str:
    if made.creation is None:
        return f"kept the scene's {len(made.light_mesh)} virtual lights"
    seconds = sum(ms for _, ms in made.creation.milliseconds) / 1000.0
    return (
        f"made {len(made.light_mesh)} virtual lights from {made.creation.source_triangles} triangles in {seconds:.2f} s"
    )


def render_command(arguments: Namespace) -> None:
    """`render`: writes one picture, its buffers and a report."""
    settings = _setting_texts(arguments.set)
    technique = technique_by_name(arguments.technique)
    from_mapping(technique.settings, settings, f"technique {technique.name!r}")
    is_local = require_format(arguments.out) == PNG and arguments.view == LOCAL_VIEW
    _require_apart(arguments.scene, [path for path in (arguments.out, arguments.json) if path is not None])
    width, height = arguments.size or (1, 1)
    frame_settings = RenderSettings(
        width,
        height,
        technique=arguments.technique,
        technique_settings=settings,
        samples=arguments.samples,
        shadow_samples=arguments.shadow_samples,
        world_lights=RenderSettings.world_lights if arguments.world_lights is None else arguments.world_lights,
        buffers=arguments.buffers is not None,
        display=is_local,
    )
    require_in_range(frame_settings)
    if arguments.buffers is not None:
        _make_folder(arguments.buffers)
    opened, found = _open(arguments)
    kept = technique_settings(bpy.context.scene, technique.name)
    chosen: Any = from_mapping(technique.settings, kept | settings, f"technique {technique.name!r}")
    frame_settings = replace(frame_settings, technique_settings=asdict(chosen))
    if arguments.world_lights is None:
        frame_settings = replace(frame_settings, world_lights=bpy.context.scene.vlm.world_lights)
    require_camera(found.snapshot)
    require_surfaces(found.snapshot)
    require_lights(found.snapshot)
    if arguments.view is not None:
        require_view(arguments.view)
    if arguments.size is None:
        width, height = _scene_size()
        frame_settings = replace(frame_settings, width=width, height=height)
    frame = _rendered(found, frame_settings, TerminalProgress())
    if arguments.buffers is not None:
        for name, image in frame.images.items():
            write_image(arguments.buffers / f"{name}.exr", image)
    if is_local:
        write_display(arguments.out, frame.images["display"])
    else:
        write_image(arguments.out, frame.images["combined"], view=arguments.view)
    _print_findings((*frame.findings, *found.snapshot.findings))
    for reason in frame.reasons:
        print(f"pass: {reason}")
    print(_timing_table(frame))
    write_json(arguments.json, _scene_report(opened) | _frame_report(frame, frame_settings, found.snapshot.findings))


def _setting_texts(pairs: Sequence[str]) -> dict[str, str]:
    texts = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not (name and equals):
            raise InvalidInput(f"--set {pair!r}", "it is not KEY=VALUE", "write it as in --set NAME=1")
        texts[name] = value
    return texts


def _scene_size() -> tuple[int, int]:
    render = bpy.context.scene.render
    share = render.resolution_percentage / 100.0
    return max(int(render.resolution_x * share), 1), max(int(render.resolution_y * share), 1)


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
        "findings": [str(finding) for finding in (*frame.findings, *findings)],
    }


def check_command(arguments: Namespace) -> int:
    """`check`: prints what is wrong with the light mesh; returns how many findings there are.

    What extraction approximates is printed and reported as notes, which do not count.
    """
    _require_apart(arguments.scene, [arguments.json] if arguments.json is not None else [])
    opened, found = _open(arguments)
    settings = scene_grid_settings(bpy.context.scene)
    findings = check_lights(found.snapshot, found.light_mesh, settings, TerminalProgress())
    light_count = len(found.light_mesh) if found.light_mesh is not None else 0
    for finding in findings:
        print(f"finding: {finding}")
    for note in found.snapshot.findings:
        print(f"note: {note}")
    print(f"{light_count} virtual lights, {len(findings)} findings")
    report = {
        "lights": light_count,
        "findings": [asdict(finding) for finding in findings],
        "notes": [asdict(note) for note in found.snapshot.findings],
    }
    write_json(arguments.json, _scene_report(opened) | report)
    return len(findings)


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


def _open(arguments: Namespace) -> tuple[OpenedScene, Extraction]:
    ensure_scene_settings()
    opened = open_scene(arguments.scene, arguments.frame, arguments.scene_name, arguments.view_layer, arguments.camera)
    return opened, extract(ExtractOptions(viewport_levels=arguments.viewport_levels))


def _require_apart(scene: Path, outputs: Sequence[Path]) -> None:
    """Raises InvalidInput where an output cannot be written, is the scene it is made from or another output."""
    for path in outputs:
        require_writable(path)
        if sum(path.resolve() == other.resolve() for other in outputs) > 1:
            raise InvalidInput(str(path), "two outputs have this name", "give each output its own path")
        if path.exists() and scene.exists() and path.samefile(scene):
            raise InvalidInput(str(path), "it is the scene itself", "give another path; the source is never changed")


def _scene_report(opened: OpenedScene) -> dict[str, Any]:
    return {
        "scene_file": opened.path.name,
        "scene": opened.scene,
        "view_layer": opened.view_layer,
        "frame": opened.frame,
        "camera": opened.camera,
    }


def _print_findings(findings: Sequence[Finding]) -> None:
    for finding in findings:
        print(f"note: {finding}")


def write_json(path: Path | None, report: dict[str, Any]) -> None:
    """Writes a report that appears whole or not at all; nothing without a path."""
    if path is None:
        return
    with atomic_output(path) as temporary:
        temporary.write_text(json.dumps(report, indent=1) + "\n")
