# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer's log: what its process and the driver wrote, when pictures were made and what stopped them.

It outlives Blender, in the extension's own folder, so that there is something to look at after a crash. Where that
cannot be written, or the package runs without being installed, it is in Blender's temporary folder.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

import bpy

from ...core.errors import DeviceError, VlmError

NAME = "renderer.log"
OLDER_SUFFIX = ".old"
MOST_BYTES = 1 << 20
EXTENSION_PARTS = 3
"""Of a module's name that name an installed extension: bl_ext, repository, id."""


def path() -> Path:
    """Where the log is, or would be."""
    package = ".".join(__name__.split(".")[:EXTENSION_PARTS])
    if package.startswith("bl_ext."):
        with suppress(ValueError, OSError):
            return Path(bpy.utils.extension_path_user(package, create=True)) / NAME
    return Path(bpy.app.tempdir) / NAME


def writable_path() -> Path | None:
    """`path`, or None where nothing can be written there."""
    try:
        with path().open("ab"):
            return path()
    except OSError:
        return None


def note(sentence: str) -> None:
    """Add a line with the time. A log that cannot be written stops nothing."""
    with suppress(OSError), path().open("a", encoding="utf-8") as log:
        log.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {sentence}\n")


def note_error(error: VlmError) -> None:
    """Add a line on what stopped a picture: a refusal by its kind alone, since its sentence holds names."""
    told = f": {error}" if isinstance(error, DeviceError) else ""
    note(f"{type(error).__name__}{told}")


def tail(lines: int) -> list[str]:
    """The last lines, none where there is no log."""
    try:
        return path().read_text(encoding="utf-8", errors="replace").splitlines()[-lines:]
    except OSError:
        return []


def shorten() -> None:
    """Put a long log aside, in place of the one put aside before."""
    log = path()
    with suppress(OSError):
        if log.stat().st_size > MOST_BYTES:
            log.replace(log.with_suffix(log.suffix + OLDER_SUFFIX))
