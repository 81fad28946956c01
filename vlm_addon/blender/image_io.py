# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures to files: EXR in linear Rec.709, PNG as the scene's view transform or our local operator shows them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..core.errors import InvalidInput, VlmError
from ..core.exr import image_of, read_exr, write_exr
from ..core.scene import Float32
from ..core.whole_file import atomic_output
from .extraction.color_space import convert, rec709_to_working
from .extraction.temporary import present, restored

EXR, PNG = ".exr", ".png"
LOCAL_VIEW = "local"
"""In place of a view transform's name: the renderer's own tone mapping (`render/passes/tonemap.py`)."""


def write_image(path: Path | str, image: Float32, *, view: str | None = None, scene: Any = None) -> None:
    """Writes a picture in the format of the path's suffix: `.exr` or `.png`. It appears whole or not at all.

    image: (h, w, 1, 3 or 4) float32, linear Rec.709, row 0 at the top, alpha premultiplied. view: for PNG, the name of
    a view transform instead of the scene's. Raises InvalidInput for another suffix, shape or view, or a path that
    cannot be written.
    """
    path = Path(path)
    if image.ndim != 3 or image.shape[2] not in (1, 3, 4) or not image.size:
        raise InvalidInput(f"image of shape {image.shape}", "it is not a picture", "give (height, width, 1, 3 or 4)")
    suffix = require_format(path)
    with atomic_output(path) as temporary:
        if suffix == EXR:
            write_exr(temporary, image)
        else:
            _write_png(temporary, image, view, scene or bpy.context.scene)


def write_display(path: Path | str, image: Float32) -> None:
    """Writes a PNG of what a display shows, whatever the scene's view settings say. It appears whole or not at all.

    image: (h, w, 4) float32, display-linear Rec.709 in [0, 1], row 0 at the top, alpha premultiplied. Raises
    InvalidInput for a path that cannot be written.
    """
    path = Path(path)
    alpha = image[..., 3:]
    straight = np.clip(image[..., :3] / np.where(alpha > 0.0, alpha, 1.0), 0.0, 1.0)
    encoded = np.where(straight <= 0.0031308, 12.92 * straight, 1.055 * straight ** (1.0 / 2.4) - 0.055)
    height, width = image.shape[:2]
    # A picture of bytes is stored as it is.
    datablock = bpy.data.images.new("vlm temporary", width, height, alpha=True)
    try:
        rgba = np.concatenate([encoded, alpha], axis=2)[::-1]
        datablock.pixels.foreach_set(np.ascontiguousarray(rgba, np.float32).ravel())
        datablock.file_format = "PNG"
        with atomic_output(path) as temporary, _one_sentence(path):
            datablock.save(filepath=str(temporary))
    finally:
        bpy.data.images.remove(datablock)


def require_format(path: Path | str) -> str:
    """The suffix of a picture's path in lower case. Raises InvalidInput unless it is one that can be written."""
    suffix = Path(path).suffix.lower()
    if suffix not in (EXR, PNG):
        problem = f"pictures of type {suffix or 'none'} are not written"
        raise InvalidInput(str(path), problem, f"end the name in {EXR} or {PNG}")
    return suffix


def read_image(path: Path | str) -> Float32:
    """(h, w, c) float32 of an EXR that `write_image` wrote, row 0 at the top."""
    channels = read_exr(Path(path))
    names = "Y" if "Y" in channels else "RGBA" if "A" in channels else "RGB"
    return image_of(channels, names=names)


def require_view(view: str, scene: Any = None) -> None:
    """Raises InvalidInput unless the scene's display has a view transform of that name, or it is LOCAL_VIEW."""
    if view == LOCAL_VIEW:
        return
    try:
        with _view(scene or bpy.context.scene, view):
            pass
    except InvalidInput as error:
        raise InvalidInput(error.subject, error.problem, f"{error.remedy}, or {LOCAL_VIEW}") from None


def view_transforms(scene: Any = None) -> list[str]:
    """Names of the view transforms that the scene's display offers."""
    settings = (scene or bpy.context.scene).view_settings
    try:
        # The names depend on the display; an assignment that fails lists those of this one.
        settings.view_transform = ""
    except TypeError as error:
        return re.findall(r"'([^']+)'", str(error).partition("not found in")[2])
    return []


def _write_png(path: Path, image: Float32, view: str | None, scene: Any) -> None:
    with ExitStack() as stack:
        if view is not None:
            stack.enter_context(_view(scene, view))
        stack.enter_context(_png_settings(scene, image.shape[2]))
        datablock = stack.enter_context(_image_datablock(image))
        stack.enter_context(_one_sentence(path))
        datablock.save_render(str(path), scene=scene)


@contextmanager
def _one_sentence(path: Path) -> Iterator[None]:
    """What Blender says where it cannot write, as our error."""
    try:
        yield
    except RuntimeError as error:
        raise VlmError(f"{path}: Blender could not write it ({' '.join(str(error).split())})") from error


@contextmanager
def _view(scene: Any, view: str) -> Iterator[None]:
    settings = scene.view_settings
    # A look belongs to its view transform.
    kept = (settings.view_transform, settings.look)
    try:
        try:
            settings.view_transform = view
        except TypeError:
            names = ", ".join(view_transforms(scene))
            subject = f"view transform {view!r}"
            raise InvalidInput(subject, "there is none of that name", f"use one of: {names}") from None
        settings.look = "None"
        yield
    finally:
        settings.view_transform, settings.look = kept


@contextmanager
def _png_settings(scene: Any, channels: int) -> Iterator[None]:
    settings = scene.render.image_settings
    # Restored from the last to the first: a file format is offered only with its media type.
    names = ("compression", "color_depth", "color_mode", "file_format", "media_type", "color_management")
    with ExitStack() as stack:
        stack.enter_context(restored(scene.render, dither_intensity=0.0))
        stack.enter_context(restored(settings, **present(settings, names)))
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format = "PNG"
        settings.color_mode = "RGBA" if channels == 4 else "RGB"
        settings.color_depth = "8"
        settings.color_management = "FOLLOW_SCENE"
        yield


@contextmanager
def _image_datablock(image: Float32) -> Iterator[Any]:
    height, width, channels = image.shape
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., : max(channels, 3)] = image
    rgba[..., :3] = convert(rgba[..., :3], rec709_to_working())
    datablock = bpy.data.images.new("vlm temporary", width, height, alpha=True, float_buffer=True)
    try:
        datablock.alpha_mode = "PREMUL"
        datablock.pixels.foreach_set(np.ascontiguousarray(rgba[::-1]).ravel())
        yield datablock
    finally:
        bpy.data.images.remove(datablock)
