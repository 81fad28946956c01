# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the manual is: the extension's page if its manifest names one, else the text that is installed with it."""

from __future__ import annotations

from typing import Any

import bpy

from .licences import ROOT, manifest

MANUALS = ("docs/authoring.md", "README.md")
"""Files of the extension, the first that is there is opened."""


def manual() -> str:
    """Address or path of the manual."""
    website = manifest().get("website")
    if website:
        return str(website)
    return str(next(ROOT / name for name in MANUALS if (ROOT / name).is_file()))


def open_manual(context: Any) -> str:
    """Show the manual in the program that the system has for it, where there is a window; returns where it is."""
    where = manual()
    if context.window is not None and not bpy.app.background:
        if where.startswith("http"):
            bpy.ops.wm.url_open(url=where)
        else:
            bpy.ops.wm.path_open(filepath=where)
    return where
