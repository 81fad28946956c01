# SPDX-License-Identifier: GPL-3.0-or-later
"""`blender --command vlm …`: the same command line as `python -m vlm_addon`, run by Blender."""

from __future__ import annotations

from typing import Any

import bpy

COMMAND = "vlm"


def run(arguments: list[str]) -> int:
    """Run one command; returns its exit code."""
    from .. import cli

    return cli.main(arguments)


def register() -> Any:
    """Add the command to Blender; returns the handle that `unregister` needs."""
    return bpy.utils.register_cli_command(COMMAND, run)


def unregister(handle: Any) -> None:
    """Take the command out again."""
    bpy.utils.unregister_cli_command(handle)
