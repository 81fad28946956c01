# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer's process: reads scenes from its standard input, renders, answers; ends when the input closes.

Messages in: `render` (scene, settings, where its arrays lie), `bake_visibility` (the same), `cancel`. Messages out:
`hello`, `progress`, `frame`, `visibility`, `error`. Arrays lie in files of a folder that the parent owns.
"""

from __future__ import annotations

import os
import queue
import sys
import threading
import traceback
from pathlib import Path
from typing import Any, BinaryIO

from ..core.array_codec import flatten, unflatten
from ..core.errors import Cancelled, DeviceError, InvalidInput, VlmError
from ..core.light_mesh import VirtualLightMesh, empty_light_mesh
from ..core.scene import SceneSnapshot
from ..core.scene_codec import light_mesh_from_tree, snapshot_from_tree
from .device import Device
from .frame_types import RenderSettings
from .framing import PROTOCOL_VERSION, map_arrays, read_message, store_arrays, write_message


def main(folder: str) -> None:
    """Serves until the input closes."""
    answers = _private_output()
    try:
        device = Device()
    except VlmError as error:
        write_message(answers, _error_message(error))
        return
    with device:
        write_message(answers, {"type": "hello", "version": PROTOCOL_VERSION, "device": device.name})
        server = _Server(device, Path(folder), answers)
        while True:
            server.answer(server.requests.get())


def _private_output() -> BinaryIO:
    """Standard output as this process's own pipe; what libraries print goes to standard error instead."""
    private = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return private


class _Server:
    def __init__(self, device: Device, folder: Path, answers: BinaryIO) -> None:
        self.requests: queue.Queue[dict[str, Any]] = queue.Queue()
        self._device = device
        self._folder = folder
        self._answers = answers
        self._cancelled = threading.Event()
        self._number = 0
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        """Takes messages while a picture is being rendered; without a parent there is nobody to render for."""
        while True:
            try:
                message = read_message(sys.stdin.buffer)
            except DeviceError as error:
                print(error, file=sys.stderr, flush=True)
                os._exit(1)
            if message is None:
                os._exit(0)
            if message["type"] == "cancel":
                self._cancelled.set()
            else:
                self._cancelled.clear()
                self.requests.put(message)

    def answer(self, request: dict[str, Any]) -> None:
        """Renders one picture, or bakes, and sends it, or the error in its place."""
        self._number = request["number"]
        work = self._bake_visibility if request["type"] == "bake_visibility" else self._render
        try:
            self._send(work(request))
        except VlmError as error:
            self._send(_error_message(error))
        except Exception as error:  # noqa: BLE001  a bug in one picture must not end the process silently
            traceback.print_exc()
            failure = VlmError(f"renderer: {type(error).__name__}: {error}; please report it with the log")
            self._send(_error_message(failure))

    def _send(self, message: dict[str, Any]) -> None:
        write_message(self._answers, {**message, "number": self._number})

    def _scene(self, request: dict[str, Any]) -> tuple[SceneSnapshot, VirtualLightMesh | None]:
        arrays = map_arrays(self._folder / request["file"], request["arrays"])
        tree = unflatten(request["scene"], arrays)
        lights = tree["light_mesh"]
        return snapshot_from_tree(tree["snapshot"]), light_mesh_from_tree(lights) if lights is not None else None

    def _render(self, request: dict[str, Any]) -> dict[str, Any]:
        settings = RenderSettings(**request["settings"])
        return self._answer("frame", self._device.render(*self._scene(request), settings, self._progress))

    def _bake_visibility(self, request: dict[str, Any]) -> dict[str, Any]:
        snapshot, lights = self._scene(request)
        lights = empty_light_mesh() if lights is None else lights
        return self._answer(
            "visibility", self._device.bake_visibility(snapshot, lights, **request["settings"], progress=self._progress)
        )

    def _answer(self, kind: str, value: Any) -> dict[str, Any]:
        answer, arrays = flatten(value)
        file = f"{kind}-{self._number}.bin"
        return {"type": kind, kind: answer, "file": file, "arrays": store_arrays(self._folder / file, arrays)}

    def _progress(self, fraction: float, label: str) -> bool:
        self._send({"type": "progress", "fraction": fraction, "label": label})
        return not self._cancelled.is_set()


def _error_message(error: VlmError) -> dict[str, Any]:
    parts: list[str] = [str(error)]
    if isinstance(error, InvalidInput):
        parts = [error.subject, error.problem, error.remedy]
    elif isinstance(error, Cancelled):
        parts = [error.label]
    return {"type": "error", "kind": type(error).__name__, "parts": parts}
