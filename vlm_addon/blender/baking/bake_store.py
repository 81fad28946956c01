# SPDX-License-Identifier: GPL-3.0-or-later
"""Where baked light grids lie on disk, and what goes with them when the .blend is saved elsewhere.

Beside a saved file, in a folder of its name (`room.vlm` for `room.blend`), so that both can be moved together. For a
file that was never saved, in Blender's temporary folder, from where the first save takes it along. A linked scene's is
beside the library and is only read. Light meshes themselves are objects of the .blend.
"""

from __future__ import annotations

import json
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

import bpy

from ...core.bake_key import BakeKey
from ...core.baked_visibility import BakedVisibility
from ...core.errors import InvalidInput
from ...core.light_grid import LightGrid
from ...core.light_grid_file import save_light_grid
from ...core.whole_file import atomic_output

FOLDER_SUFFIX = ".vlm"
GRID_SUFFIX = ".vlmgrid"
KEY_SUFFIX = ".json"
UNSAVED = "unsaved"
SAFE_IN_NAMES = " "


def grid_path(scene: Any) -> Path:
    """Where the light grid of `scene` is or would be."""
    return bake_folder(scene) / (quote(scene.name, safe=SAFE_IN_NAMES) + GRID_SUFFIX)


def bake_folder(scene: Any) -> Path:
    """The folder of baked data for the file that `scene` belongs to; it need not be there."""
    if scene.library is None:
        return folder_beside(bpy.data.filepath)
    return folder_beside(bpy.path.abspath(scene.library.filepath, library=scene.library.parent))


def folder_beside(blend: str) -> Path:
    """The folder of baked data for a .blend; for "", of the file that was never saved."""
    if not blend:
        return Path(bpy.app.tempdir) / (UNSAVED + FOLDER_SUFFIX)
    return Path(blend).with_suffix(FOLDER_SUFFIX)


def require_own(scene: Any) -> None:
    """Raises InvalidInput for a linked scene: its baked data belongs to another file."""
    if scene.library is not None:
        problem = f"it is linked from {scene.library.filepath}"
        raise InvalidInput(f"scene {scene.name!r}", problem, "bake in that file, or make the scene local")


def store(scene: Any, grid: LightGrid, key: BakeKey, visibility: BakedVisibility | None = None) -> Path:
    """Write the light grid of `scene` and what it depends on; returns the grid's file. Raises InvalidInput."""
    require_own(scene)
    path = grid_path(scene)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        remedy = "save the .blend in a folder that can be written"
        raise InvalidInput(str(path.parent), f"it cannot be made ({error.strerror})", remedy) from error
    # A grid without its key is of unknown age and does not count: an end in between leaves nothing wrong behind.
    _remove(path.with_suffix(KEY_SUFFIX))
    save_light_grid(grid, path, visibility)
    with atomic_output(path.with_suffix(KEY_SUFFIX)) as temporary:
        temporary.write_text(json.dumps(key.to_json()), encoding="utf-8")
    return path


def has_grid(scene: Any) -> bool:
    """Whether a light grid of `scene` is stored, with what it depends on."""
    path = grid_path(scene)
    return path.is_file() and path.with_suffix(KEY_SUFFIX).is_file()


def is_interrupted(scene: Any) -> bool:
    """Whether a light grid is stored without what it depends on, or the other way round: it does not count."""
    path = grid_path(scene)
    return path.is_file() != path.with_suffix(KEY_SUFFIX).is_file()


def stored_key(scene: Any) -> BakeKey | None:
    """What the light grid of `scene` was baked from, None where there is none. Raises InvalidInput for a broken one."""
    if not has_grid(scene):
        return None
    told = grid_path(scene).with_suffix(KEY_SUFFIX)
    try:
        tree = json.loads(told.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InvalidInput(str(told), f"it cannot be read ({error})", "clear the bake and bake again") from error
    return BakeKey.from_json(tree, str(told))


def clear(scene: Any) -> int:
    """Remove the light grid of `scene` from disk; returns the bytes that were freed. Raises InvalidInput."""
    require_own(scene)
    path = grid_path(scene)
    files = [each for each in (path, path.with_suffix(KEY_SUFFIX)) if each.is_file()]
    freed = sum(each.stat().st_size for each in files)
    for each in files:
        _remove(each)
    with suppress(OSError):  # other scenes' grids, or files that are not ours, are in it
        path.parent.rmdir()
    return freed


def clear_unsaved() -> None:
    """Remove what a file that was never saved has left: another file is open now."""
    shutil.rmtree(folder_beside(""), ignore_errors=True)


def take_along(before: Path, blend: str) -> tuple[str, ...]:
    """Copy the baked data of the open file's scenes from the folder `before` to that of `blend`, saved just now.

    What was never saved is moved, once all of it has arrived. Returns the names of scenes whose grid could not be
    written: it is where it was. A grid without its key does not count and stays behind.
    """
    after = folder_beside(blend)
    if before == after or not before.is_dir():
        return ()
    left = []
    for scene in bpy.data.scenes:
        path = before / grid_path(scene).name
        whole = path.is_file() and path.with_suffix(KEY_SUFFIX).is_file()
        if scene.library is None and whole and not _copy(path, after):
            left.append(scene.name)
    if before == folder_beside("") and not left:
        clear_unsaved()
    return tuple(left)


def _copy(path: Path, folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for each in (path, path.with_suffix(KEY_SUFFIX)):
            with atomic_output(folder / each.name) as temporary:
                shutil.copyfile(each, temporary)
    except (OSError, InvalidInput):
        return False
    return True


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise InvalidInput(str(path), f"it cannot be removed ({error.strerror})", "close what uses it") from error
