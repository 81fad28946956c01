# SPDX-License-Identifier: GPL-3.0-or-later
"""The only owner of OpenGL: opens a context without a window, checks it, times passes, renders frames."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any

from ..core.errors import DeviceError
from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress, silent
from ..core.scene import SceneSnapshot
from .frame_types import Frame, RenderSettings
from .kept import Kept
from .light_structures import LightStructures
from .shader_library import ShaderLibrary

if TYPE_CHECKING:
    import moderngl

    from ..core.baked_visibility import BakedVisibility

REQUIRED_VERSION = 430
SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swr", "swiftshader", "software", "lavapipe", "gdi generic")
FENCE, QUERY = "fence and wall clock", "timer queries"
INSTALL_HINT = "install a driver with OpenGL 4.3, on Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri"


class Device:
    """A context manager that owns one OpenGL context; all calls must come from the thread that made it."""

    def __init__(self) -> None:
        """Opens the context. Raises DeviceError that names what was tried and what to install."""
        self.context = _open_context()
        # Dead wrappers are released in `current`, where this context is bound: never while another one is.
        self.context.gc_mode = "context_gc"
        self._thread = threading.get_ident()
        self._closed = False
        self.name: str = self.context.info["GL_RENDERER"]
        self.is_software = any(word in self.name.lower() for word in SOFTWARE_RENDERERS)
        self.shaders = ShaderLibrary(self.context)
        self.forget()
        # moderngl never deletes a query, so frames share them.
        self._queries: list[Any] = []

    def forget(self) -> None:
        """Lets go of all that was kept over frames: the next frame is as that of a device that has seen nothing."""
        self.kept = Kept()
        self.light_structures = LightStructures(self.kept, on_device=not self.is_software)

    def __enter__(self) -> Device:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Releases the context and all that lives in it; a second call does nothing."""
        if self._closed:
            return
        with self.current():
            del self.shaders, self.light_structures, self.kept
        self._closed = True
        self.context.release()

    @contextmanager
    def current(self) -> Iterator[moderngl.Context]:
        """Binds the context for a block of GL calls and releases afterwards what the block let go of."""
        import moderngl

        if self._closed:
            raise DeviceError("the OpenGL device is closed; open a new one")
        if threading.get_ident() != self._thread:
            raise DeviceError("the OpenGL device belongs to another thread; use it where it was opened")
        with self.context:
            try:
                yield self.context
            except moderngl.Error as error:
                raise DeviceError(f"OpenGL failed on {self.name}: {error}") from error
            finally:
                self.context.gc()

    def render(
        self,
        snapshot: SceneSnapshot,
        light_mesh: VirtualLightMesh | None,
        settings: RenderSettings,
        progress: Progress = silent,
    ) -> Frame:
        """The picture of `snapshot` lit by its lamps and by `light_mesh`.

        Raises InvalidInput for what cannot be rendered, Cancelled when `progress` says so, DeviceError when OpenGL
        fails.
        """
        from .frame import render_frame

        with self.current():
            return render_frame(self, snapshot, light_mesh, settings, progress)

    def bake_visibility(
        self,
        snapshot: SceneSnapshot,
        light_mesh: VirtualLightMesh,
        cells: int,
        points: int,
        progress: Progress = silent,
    ) -> BakedVisibility:
        """What the surfaces of `snapshot` see of the lights: core.baked_visibility. cells: along the longest axis.
        points: of a row, from which rays are cast.

        Raises InvalidInput for another number of cells or where shares take too much memory, Cancelled when `progress`
        says so, DeviceError when OpenGL fails.
        """
        from .scene_visibility import baked_visibility

        with self.current() as context:
            return baked_visibility(context, self.shaders, self.kept, snapshot, light_mesh, cells, points, progress)

    def timer(self) -> PassTimer:
        """A timer of passes that suits this device; valid until the next one is made."""
        return PassTimer(self.context, self.is_software, self._queries)


class PassTimer:
    """Milliseconds per pass, summed over calls of the same name, in order of first use. Passes do not nest.

    Timer queries count a small part of a software renderer's work, so there a fence and the wall clock are used.
    """

    def __init__(self, context: moderngl.Context, is_software: bool, queries: list[Any]) -> None:
        """queries: those to use first; new ones are added to it."""
        self._context = context
        self._is_software = is_software
        self._milliseconds: dict[str, float] = {}
        self._queries = queries
        self._measured: list[str] = []
        self._read = 0

    @property
    def kind(self) -> str:
        """How milliseconds are taken."""
        return FENCE if self._is_software else QUERY

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Adds the GPU time of the block to pass `name`."""
        self._milliseconds.setdefault(name, 0.0)
        if not self._is_software:
            if len(self._measured) == len(self._queries):
                self._queries.append(self._context.query(time=True))
            with self._queries[len(self._measured)]:
                yield
            self._measured.append(name)
            return
        self._context.finish()
        start = time.perf_counter()
        yield
        self._context.finish()
        self._milliseconds[name] += 1e3 * (time.perf_counter() - start)

    def timings(self) -> list[tuple[str, float]]:
        """(pass name, milliseconds) of all that was measured; waits for the GPU."""
        for index in range(self._read, len(self._measured)):
            self._milliseconds[self._measured[index]] += 1e-6 * self._queries[index].elapsed
        self._read = len(self._measured)
        return list(self._milliseconds.items())


def _open_context() -> moderngl.Context:
    try:
        import moderngl
    except ImportError as error:
        raise DeviceError(f"moderngl cannot be imported ({error}); install the package moderngl") from None
    failures = []
    for backend in _backends():
        settings: dict[str, Any] = {"backend": backend} if backend else {}
        try:
            context = moderngl.create_standalone_context(require=REQUIRED_VERSION, **settings)
        # glcontext and moderngl raise plain Exception, ValueError or OSError, by platform and by backend
        except Exception as error:  # noqa: BLE001
            failures.append(f"{backend or 'default'}: {str(error).strip().partition(chr(10))[0]}")
            continue
        return context
    raise DeviceError(f"no OpenGL 4.3 device; tried {'; '.join(failures)}; {INSTALL_HINT}")


def _backends() -> tuple[str, ...]:
    if not sys.platform.startswith("linux"):
        return ("",)
    headless = not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return ("egl", "") if headless else ("", "egl")
