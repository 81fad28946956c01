# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands of the command line have in common: scenes opened, outputs checked, reports written."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..core.errors import InvalidInput
from ..core.scene import Finding
from ..core.whole_file import atomic_output
from .extraction.extract import ExtractOptions
from .extraction.light_mesh_io import Extraction, extract
from .interface.properties import ensure_scene_settings
from .scene_file import OpenedScene, open_scene, require_writable


def opened_scene(arguments: Namespace, broken_values: bool = False) -> tuple[OpenedScene, Extraction]:
    """The scene that a command was given, and what is in it; broken_values: as for `extract`. Raises InvalidInput."""
    ensure_scene_settings()
    opened = open_scene(arguments.scene, arguments.frame, arguments.scene_name, arguments.view_layer, arguments.camera)
    return opened, extract(ExtractOptions(viewport_levels=arguments.viewport_levels), broken_values=broken_values)


def require_apart(scene: Path, outputs: Sequence[Path]) -> None:
    """Raises InvalidInput where an output cannot be written, is the scene it is made from or another output."""
    for path in outputs:
        require_writable(path)
        if sum(path.resolve() == other.resolve() for other in outputs) > 1:
            raise InvalidInput(str(path), "two outputs have this name", "give each output its own path")
        if path.exists() and scene.exists() and path.samefile(scene):
            raise InvalidInput(str(path), "it is the scene itself", "give another path; the source is never changed")


def scene_report(opened: OpenedScene) -> dict[str, Any]:
    """What a report says of the scene itself."""
    return {
        "scene_file": opened.path.name,
        "scene": opened.scene,
        "view_layer": opened.view_layer,
        "frame": opened.frame,
        "camera": opened.camera,
    }


def print_findings(findings: Sequence[Finding]) -> None:
    """A line each."""
    for finding in findings:
        print(f"note: {finding}")


def write_json(path: Path | None, report: dict[str, Any]) -> None:
    """Writes a report that appears whole or not at all; nothing without a path."""
    if path is None:
        return
    with atomic_output(path) as temporary:
        temporary.write_text(json.dumps(report, indent=1) + "\n")
