# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer as a child process: what Blender and the command line call instead of OpenGL.

A driver that crashes or hangs ends the child, never Blender. Arrays go through mapped files in a temporary folder
that this side owns and removes.
"""

from __future__ import annotations

import contextlib
import json
import queue
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import numpy as np

from ..core.array_codec import flatten, unflatten
from ..core.baked_visibility import BakedVisibility
from ..core.effects import plan_from_tree
from ..core.errors import Cancelled, DeviceError, InvalidInput, ShaderError, VlmError
from ..core.light_grid_file import visibility_from_tree
from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress, silent
from ..core.scene import Finding, SceneSnapshot
from .frame_types import Frame, RenderSettings
from .framing import PROTOCOL_VERSION, map_arrays, read_message, store_arrays, write_message

BOOTSTRAP = (
    "import json, sys; sys.path[:0] = json.loads(sys.argv[1]); "
    "from vlm_addon.render.server import main; main(sys.argv[2])"
)
ERROR_KINDS = {kind.__name__: kind for kind in (VlmError, InvalidInput, Cancelled, DeviceError, ShaderError)}
# How long the child may say nothing before it counts as hung. The first use of a shader compiles it.
SILENCE_LIMIT_S = 300.0
# How often a waiting caller is asked whether to go on.
POLL_S = 0.1
SHUTDOWN_S = 3.0

T = TypeVar("T")


class RenderProcess:
    """A renderer in a process of its own; a context manager. One picture at a time."""

    def __init__(self, executable: Path | str, search_paths: Sequence[Path | str], log: Path | None = None) -> None:
        """Starts the child. search_paths: folders that hold vlm_addon, numpy, moderngl and glcontext. log: a file that
        takes, after what it holds, what the child and its driver write; by default a temporary one.

        Raises DeviceError where there is no Python to start.
        """
        if not executable:
            raise DeviceError("the renderer needs a Python to run in, and sys.executable names none")
        self._folder = Path(tempfile.mkdtemp(prefix="vlm_render_"))
        self._silence_limit_s = SILENCE_LIMIT_S
        self._greeted = False
        self._number = 0
        paths = json.dumps([str(path) for path in search_paths])
        command = [str(executable), "-I", "-c", BOOTSTRAP, paths, str(self._folder)]
        self._log_path = log if log is not None else self._folder / "log.txt"
        self._log = self._log_path.open("ab")
        self._log_start = self._log.tell()
        try:
            self._child = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._log,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError as error:
            self._remove_files()
            raise DeviceError(f"the renderer could not be started ({error}); check {executable}") from error
        self._messages: queue.Queue[dict[str, Any] | VlmError | None] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> RenderProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def process_id(self) -> int:
        """Of the child."""
        return self._child.pid

    def render(
        self,
        snapshot: SceneSnapshot,
        light_mesh: VirtualLightMesh | None,
        settings: RenderSettings,
        progress: Progress = silent,
    ) -> Frame:
        """The picture that `Device.render` of the child gives, with the same errors.

        Raises DeviceError where the child ends, hangs or sends what it should not; then this object is closed.
        """
        return self._asked("render", snapshot, light_mesh, asdict(settings), progress, self._frame)

    def bake_visibility(
        self,
        snapshot: SceneSnapshot,
        light_mesh: VirtualLightMesh,
        cells: int,
        points: int,
        progress: Progress = silent,
    ) -> BakedVisibility:
        """What `Device.bake_visibility` of the child gives, with the same errors and those of `render`."""
        settings = {"cells": cells, "points": points}
        return self._asked("bake_visibility", snapshot, light_mesh, settings, progress, self._visibility)

    def _asked(
        self,
        kind: str,
        snapshot: SceneSnapshot,
        light_mesh: VirtualLightMesh | None,
        settings: dict[str, Any],
        progress: Progress,
        answer: Callable[[Progress], T],
    ) -> T:
        try:
            if not self._greeted:
                self._greet(progress)
            self._number += 1
            self._remove_arrays()
            self._send(kind, snapshot, light_mesh, settings)
            return answer(progress)
        except DeviceError:
            self.close()
            raise
        finally:
            self._remove_arrays()

    def close(self) -> None:
        """Ends the child and removes the files; a second call does nothing."""
        for stream in (self._child.stdin, self._child.stdout):
            if stream is not None and not (stream is self._child.stdout and self._reader.is_alive()):
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self._child.wait(SHUTDOWN_S)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()
        self._reader.join(SHUTDOWN_S)
        self._remove_files()

    def _remove_arrays(self) -> None:
        """Removes what earlier pictures left; where the child still maps a file (Windows), a later call will."""
        for path in self._folder.glob("*.bin"):
            with contextlib.suppress(OSError):
                path.unlink()

    def _remove_files(self) -> None:
        self._log.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _read(self) -> None:
        """Messages of the child, then None."""
        assert self._child.stdout is not None
        try:
            while (message := read_message(self._child.stdout)) is not None:
                self._messages.put(message)
        except DeviceError as error:
            self._messages.put(error)
        except (OSError, ValueError):
            pass
        self._messages.put(None)

    def _greet(self, progress: Progress) -> None:
        hello = self._next(progress)
        if hello.get("type") != "hello" or hello.get("version") != PROTOCOL_VERSION:
            raise DeviceError("the render process is of another version; restart Blender")
        self._greeted = True

    def _send(
        self, kind: str, snapshot: SceneSnapshot, light_mesh: VirtualLightMesh | None, settings: dict[str, Any]
    ) -> None:
        scene, arrays = flatten({"snapshot": snapshot, "light_mesh": light_mesh})
        file = f"scene-{self._number}.bin"
        request = {
            "type": kind,
            "number": self._number,
            "scene": scene,
            "file": file,
            "arrays": store_arrays(self._folder / file, arrays),
            "settings": settings,
        }
        self._write(request)

    def _write(self, message: dict[str, Any]) -> None:
        assert self._child.stdin is not None
        try:
            write_message(self._child.stdin, message)
        except OSError:
            raise self._ended() from None

    def _answer(self, kind: str, progress: Progress) -> Any:
        """The tree of the child's answer."""
        answer = self._next(progress)
        if answer.get("type") != kind:
            raise DeviceError(f"the render process answered {answer.get('type')!r} instead of a {kind}; render again")
        arrays = [np.array(array) for array in map_arrays(self._folder / answer["file"], answer["arrays"])]
        return unflatten(answer[kind], arrays)

    def _visibility(self, progress: Progress) -> BakedVisibility:
        return visibility_from_tree(self._answer("visibility", progress))

    def _frame(self, progress: Progress) -> Frame:
        tree = self._answer("frame", progress)
        return Frame(
            images=tree["images"],
            timings=[(name, milliseconds) for name, milliseconds in tree["timings"]],
            counters=tree["counters"],
            device=tree["device"],
            timer=tree["timer"],
            findings=tuple(Finding(**finding) for finding in tree["findings"]),
            reasons=tuple(tree["reasons"]),
            plan=plan_from_tree(tree["plan"]),
        )

    def _next(self, progress: Progress) -> dict[str, Any]:
        """The child's next message about this picture that is no progress. Raises what it reports, or DeviceError."""
        try:
            return self._next_while(progress)
        except VlmError:
            raise
        except BaseException:
            # `progress` raised: nobody waits for this picture any more.
            if self._greeted:
                self._write({"type": "cancel"})
            raise

    def _next_while(self, progress: Progress) -> dict[str, Any]:
        fraction, label, silence_s, asked_to_cancel = 0.0, "start renderer", 0.0, False
        while True:
            try:
                message = self._messages.get(timeout=POLL_S)
            except queue.Empty:
                silence_s += POLL_S
                if silence_s > self._silence_limit_s:
                    self._child.kill()
                    raise DeviceError(f"the renderer said nothing for {silence_s:.0f} s and was ended") from None
            else:
                silence_s = 0.0
                if message is None:
                    raise self._ended()
                if isinstance(message, VlmError):
                    raise message
                if message.get("number", self._number) != self._number:
                    continue
                if message["type"] == "error":
                    raise ERROR_KINDS.get(message["kind"], VlmError)(*message["parts"])
                if message["type"] != "progress":
                    return message
                fraction, label = message["fraction"], message["label"]
            if not progress(fraction, label) and self._greeted and not asked_to_cancel:
                asked_to_cancel = True
                self._write({"type": "cancel"})

    def _ended(self) -> DeviceError:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._child.wait(SHUTDOWN_S)
        self._log.flush()
        with self._log_path.open("rb") as log:
            log.seek(self._log_start)
            lines = log.read().decode(errors="replace").strip().splitlines()
        last = f"; its last words: {lines[-1]}" if lines else ""
        return DeviceError(f"the render process ended with code {self._child.returncode}{last}; render again")
