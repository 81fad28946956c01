# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines that show a stroke before it becomes lights."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from ...core.scene import Float64

LINE_PIXELS = 2.0
DRAW_COLOR = (1.0, 0.55, 0.1, 1.0)
ERASE_COLOR = (1.0, 0.1, 0.1, 1.0)
SNAPPED_COLOR = (0.2, 1.0, 0.4, 1.0)

_HANDLES: list[Any] = []
"""Draw handlers of the strokes that go on; Blender keeps no list that could be asked."""


@dataclass
class Preview:
    """lines: world-space ways (n, 3) each. mark: a way drawn where the point was snapped to something. color: of the
    lines, rgba."""

    lines: list[Float64] = field(default_factory=list)
    mark: list[Float64] = field(default_factory=list)
    color: tuple[float, float, float, float] = DRAW_COLOR


def show(preview: Preview) -> Any:
    """Draw `preview` in all 3D views from now on; returns what `hide` takes."""
    handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (preview,), "WINDOW", "POST_VIEW")
    _HANDLES.append(handle)
    return handle


def hide(handle: Any) -> None:
    """Draw it no longer; nothing happens where that was said before."""
    if handle in _HANDLES:
        _HANDLES.remove(handle)
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")


def register(undo: ExitStack) -> None:
    """Where the extension is disabled amid a stroke, its lines go, too."""
    undo.callback(_hide_all)


def _hide_all() -> None:
    for handle in list(_HANDLES):
        hide(handle)


def _draw(preview: Preview) -> None:
    import gpu  # only while drawing: there is none in background

    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("ALPHA")
    for lines, color in ((preview.lines, preview.color), (preview.mark, SNAPPED_COLOR)):
        _draw_lines([line for line in lines if len(line) > 1], color)
    gpu.state.blend_set("NONE")


def _draw_lines(lines: list[Float64], color: tuple[float, float, float, float]) -> None:
    if not lines:
        return
    import gpu

    segments = np.concatenate([np.stack([line[:-1], line[1:]], axis=1).reshape(-1, 3) for line in lines])
    layout = gpu.types.GPUVertFormat()
    layout.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
    vertices = gpu.types.GPUVertBuf(layout, len(segments))
    vertices.attr_fill("pos", segments.astype(np.float32))
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", LINE_PIXELS)
    shader.uniform_float("color", color)
    gpu.types.GPUBatch(type="LINES", buf=vertices).draw(shader)
