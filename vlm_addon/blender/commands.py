# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands of the command line on light meshes: open, extract, work, write."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict

import bpy

from ..bake import Bake, BakeSettings, bake
from ..core.errors import InvalidInput
from ..core.light_grid_export import SUFFIX as FIXED_SIZE_SUFFIX
from ..core.light_grid_export import save_fixed_size_lists
from ..core.light_grid_file import save_light_grid
from ..core.scene import Finding, SceneSnapshot
from ..core.settings import from_mapping
from ..light_grid_bake import GridBake, bake_light_grid
from ..terminal import TerminalProgress
from .authoring import from_snapshot, write
from .baking.visibility_bake import bake_visibility, require_room_for_visibility
from .checking import findings_of
from .command_support import opened_scene, print_findings, require_apart, scene_report, write_json
from .extraction.extract import ExtractOptions
from .extraction.light_mesh_io import Extraction, extract_light_mesh
from .interface.availability import light_mesh_objects
from .light_grid_options import keep_options, scene_grid_settings
from .light_history import light_history
from .names import NAME, SOURCES_PROPERTY
from .scene_file import save_blend


def bake_command(arguments: Namespace) -> None:
    """`bake`: writes the scene with its light mesh and a report."""
    outputs = [path for path in (arguments.save, arguments.json, arguments.light_grid) if path is not None]
    if not outputs:
        remedy = "name --save OUT.blend, --light-grid OUT.vlmgrid or --json REPORT.json"
        raise InvalidInput("bake", "nothing would be written", remedy)
    settings = _bake_settings(arguments.triangles, arguments.split)
    require_apart(arguments.scene, outputs)
    require_room_for_visibility(arguments)
    opened, found = opened_scene(arguments)
    keep_options(bpy.context.scene, arguments)
    drawn = _drawn_by_hand()
    anew = not drawn and (found.light_mesh is None or settings is not None)
    _require_visible_light_meshes(found)
    made = _made_anew(found.snapshot, settings or BakeSettings()) if anew else _kept(found)
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
    print_findings(findings)
    print(_bake_summary(made))
    if grid is not None:
        print(grid.summary())
    about_grid = {"light_grid": grid.report() if grid is not None else None}
    if visibility is not None:
        print(visibility.summary())
        about_grid["visibility"] = visibility.report()
    about_findings = {"findings": [str(finding) for finding in findings]}
    write_json(arguments.json, scene_report(opened) | made.report() | about_grid | about_findings)


def _made_anew(snapshot: SceneSnapshot, settings: BakeSettings) -> Bake:
    """One new light mesh in place of all that the scene has, written as Create from Scene writes it."""
    made = from_snapshot(bpy.context, snapshot, settings)(TerminalProgress())
    for other in light_mesh_objects(bpy.context.scene):
        if other.name != NAME:
            bpy.data.objects.remove(other)
    write(made)
    return made.bake


def _kept(found: Extraction) -> Bake:
    """The lights that the scene has, checked."""
    history = light_history(bpy.context.scene, found)
    return bake(found.snapshot, found.light_mesh, None, TerminalProgress(), history=history)


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


def check_command(arguments: Namespace) -> int:
    """`check`: prints what is wrong with the light mesh; returns how many findings there are.

    It looks for what the sidebar's Check does. What extraction approximates is printed and reported as notes, which do
    not count.
    """
    require_apart(arguments.scene, [arguments.json] if arguments.json is not None else [])
    opened, found = opened_scene(arguments, broken_values=True)
    light_count = len(found.light_mesh) if found.light_mesh is not None else 0
    findings = findings_of(bpy.context.scene, found)(TerminalProgress())
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
    write_json(arguments.json, scene_report(opened) | report)
    return len(findings)
