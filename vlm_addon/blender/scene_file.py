# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening .blend files for the command line, and saving them."""

from __future__ import annotations

import gzip
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..core.errors import InvalidInput, VlmError
from ..core.whole_file import atomic_output

GZIP_MAGIC = b"\x1f\x8b"
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
HEADER_BYTES = 17

# BLENDER-v502 (before 5.0) or BLENDER17-01v0502: pointer size or header length, then byte order, then version.
HEADER = re.compile(rb"BLENDER(?:[-_][vV](\d{3})|\d\d-\d\dv(\d{4}))")


@dataclass(frozen=True)
class OpenedScene:
    """What the command line works on, by name, and what the file had selected when it was opened."""

    path: Path
    scene: str
    view_layer: str
    frame: int
    camera: str | None
    original: tuple[str, str, int, str | None]


def open_scene(
    path: Path | str,
    frame: int | None = None,
    scene: str | None = None,
    view_layer: str | None = None,
    camera: str | None = None,
) -> OpenedScene:
    """Opens a .blend file and makes the scene, view layer, camera and frame current; None keeps the file's own.

    Raises InvalidInput, one sentence each, for a file that is missing, no .blend, cut short or written by a newer
    Blender, and for names that are not in it.
    """
    path = Path(path).absolute()
    _require_blend(path)
    _load(path)
    chosen = _named(bpy.data.scenes, scene, "scene", path.name) if scene else bpy.context.scene
    before_scene = bpy.context.scene.name
    bpy.context.window.scene = chosen
    before_layer, before_camera = bpy.context.view_layer.name, _camera_name(chosen)
    if view_layer:
        bpy.context.window.view_layer = _named(chosen.view_layers, view_layer, "view layer", f"scene {chosen.name!r}")
    if camera:
        cameras = [item for item in chosen.objects if item.type == "CAMERA"]
        names = {item.name: item for item in cameras}
        chosen.camera = _named(names, camera, "camera", f"scene {chosen.name!r}")
    original = (before_scene, before_layer, chosen.frame_current, before_camera)
    if frame is not None:
        chosen.frame_set(frame)
    return OpenedScene(
        path=path,
        scene=chosen.name,
        view_layer=bpy.context.view_layer.name,
        frame=chosen.frame_current,
        camera=_camera_name(chosen),
        original=original,
    )


def _camera_name(scene: Any) -> str | None:
    return scene.camera.name if scene.camera is not None else None


def _named(collection: Any, name: str, kind: str, owner: str) -> Any:
    found = collection.get(name)
    if found is None:
        names = ", ".join(collection.keys()) or "none, it has none"
        raise InvalidInput(f"{kind} {name!r}", f"{owner} has no {kind} of that name", f"use one of: {names}")
    return found


def _require_blend(path: Path) -> None:
    """Raises InvalidInput unless the first bytes are those of a .blend that this Blender can read."""
    subject = str(path)
    if path.is_dir():
        raise InvalidInput(subject, "it is a folder", "give a .blend file")
    if not path.exists():
        raise InvalidInput(subject, "there is no such file", "give the path of a .blend file")
    try:
        header = _header(path)
    except (OSError, EOFError) as error:
        raise InvalidInput(subject, f"it cannot be read ({error})", "give a .blend file that can be read") from error
    if header is None:
        # Zstandard: Blender unpacks it, and `_load` reports what it says.
        return
    match = HEADER.match(header)
    if match is None:
        raise InvalidInput(subject, "it is not a .blend file", "give a .blend file")
    version = int(match[1] or match[2])
    if version // 100 > bpy.app.version[0]:
        raise _from_the_future(subject, version)


def _from_the_future(subject: str, version: int) -> InvalidInput:
    major, minor = divmod(version, 100)
    problem = f"it was saved by Blender {major}.{minor}, this is {bpy.app.version_string}"
    return InvalidInput(subject, problem, f"use Blender {major}.{minor} or later")


def _header(path: Path) -> bytes | None:
    """The first bytes of the file, unpacked; None where only Blender can unpack them."""
    with path.open("rb") as file:
        start = file.read(HEADER_BYTES)
    if start.startswith(ZSTD_MAGIC):
        return None
    if start.startswith(GZIP_MAGIC):
        with gzip.open(path) as packed:
            return packed.read(HEADER_BYTES)
    return start


def _load(path: Path) -> None:
    subject = str(path)
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    except RuntimeError as error:
        # Blender puts the reason last, after the path.
        reason = " ".join(str(error).split()).rpartition("': ")[2]
        remedy = "give a whole .blend file"
        raise InvalidInput(subject, f"Blender cannot open it ({reason})", remedy) from error
    if bpy.data.version[0] > bpy.app.version[0]:
        raise _from_the_future(subject, bpy.data.version[0] * 100 + bpy.data.version[1])


def save_blend(path: Path | str, opened: OpenedScene | None = None) -> None:
    """Saves the open file as `path`, which appears by rename; the open file keeps its own path.

    opened: the scene, view layer, frame and camera that were chosen for this run are set back to the file's own before
    saving. Raises InvalidInput where nothing can be written there.
    """
    if opened is not None:
        _restore(opened)
    with atomic_output(path) as temporary:
        # Over a file that is there, Blender would leave a backup beside it.
        temporary.unlink()
        try:
            bpy.ops.wm.save_as_mainfile(filepath=str(temporary), copy=True, check_existing=False, relative_remap=True)
        except RuntimeError as error:
            raise VlmError(f"{path}: Blender could not save it ({' '.join(str(error).split())})") from error


def _restore(opened: OpenedScene) -> None:
    scene_name, layer_name, frame, camera = opened.original
    scene = bpy.data.scenes[opened.scene]
    if scene.frame_current != frame:
        scene.frame_set(frame)
    scene.camera = None if camera is None else bpy.data.objects[camera]
    bpy.context.window.view_layer = scene.view_layers[layer_name]
    bpy.context.window.scene = bpy.data.scenes[scene_name]


def require_writable(path: Path | str) -> Path:
    """`path` as a Path. Raises InvalidInput where no file can be written there, before any work is done."""
    path = Path(path)
    subject = str(path)
    try:
        is_folder, has_folder = path.is_dir(), path.absolute().parent.is_dir()
    except (OSError, ValueError) as error:
        raise InvalidInput(subject[:80], f"no file can have this name ({error})"[:120], "give a shorter one") from error
    if is_folder:
        raise InvalidInput(subject, "it is a folder", "give the name of a file")
    if not has_folder:
        raise InvalidInput(subject, "its folder does not exist", "make the folder or give another path")
    with atomic_output(path, keep=False):
        pass
    return path
