# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer's process as the extension uses it: started at the first picture, kept, ended on unregister."""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from typing import TypeVar

from ..core.baked_visibility import BakedVisibility
from ..core.errors import DeviceError, VlmError
from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress
from ..core.scene import SceneSnapshot
from ..render.client import RenderProcess
from ..render.frame_types import Frame, RenderSettings
from .support import render_log

T = TypeVar("T")

CHILD_MODULES = ("numpy", "moderngl", "glcontext")


class KeptRenderProcess:
    """A renderer process that lives between pictures; pictures asked for at the same time wait for each other."""

    def __init__(self) -> None:
        self._process: RenderProcess | None = None
        self._lock = Lock()

    def render(
        self,
        snapshot: SceneSnapshot,
        light_mesh: VirtualLightMesh | None,
        settings: RenderSettings,
        progress: Progress,
    ) -> Frame:
        """One picture. Raises VlmError; after a DeviceError the next picture starts a new process."""
        start = time.perf_counter()
        frame = self._with_process(lambda process: process.render(snapshot, light_mesh, settings, progress))
        seconds = time.perf_counter() - start
        picture = f"{settings.width} x {settings.height}, {settings.samples} samples, {settings.technique}"
        render_log.note(f"{picture}: {seconds:.2f} s on {frame.device}")
        return frame

    def bake_visibility(
        self, snapshot: SceneSnapshot, light_mesh: VirtualLightMesh, cells: int, points: int, progress: Progress
    ) -> BakedVisibility:
        """As Device.bake_visibility. Raises VlmError."""
        return self._with_process(
            lambda process: process.bake_visibility(snapshot, light_mesh, cells, points, progress)
        )

    def _with_process(self, work: Callable[[RenderProcess], T]) -> T:
        with self._lock:
            try:
                if self._process is None:
                    render_log.shorten()
                    render_log.note(f"renderer starts in {_python()}")
                    self._process = RenderProcess(_python(), search_paths(), render_log.writable_path())
                return work(self._process)
            except DeviceError as error:
                render_log.note_error(error)
                self._close()
                raise
            except VlmError as error:
                render_log.note_error(error)
                raise

    def close(self) -> None:
        """End the process, if there is one."""
        with self._lock:
            self._close()

    def _close(self) -> None:
        if self._process is not None:
            self._process.close()
            self._process = None


def search_paths() -> list[Path]:
    """Folders that the child's isolated Python imports from: ours and those of the modules it needs.

    Raises VlmError where a module is missing.
    """
    folders = [Path(__file__).resolve().parents[2]]
    for name in CHILD_MODULES:
        spec = importlib.util.find_spec(name)
        if spec is None or spec.origin is None:
            raise VlmError(f"renderer: the Python module {name} is missing; reinstall the extension")
        parent = Path(spec.origin).parent
        folders.append(parent.parent if spec.submodule_search_locations is not None else parent)
    return list(dict.fromkeys(folders))


def _python() -> Path:
    if not sys.executable:
        raise VlmError("renderer: Blender's Python was not found; use an official build of Blender")
    return Path(sys.executable)


KEPT = KeptRenderProcess()
"""Render engines come and go with every picture, so the process they share belongs to this module."""
