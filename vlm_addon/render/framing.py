# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages between Blender's process and the renderer's: length-prefixed JSON on a pipe, arrays in a mapped file."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..core.errors import DeviceError

PROTOCOL_VERSION = 2
MAX_MESSAGE_BYTES = 1 << 28
ALIGNMENT_BYTES = 64
_LENGTH = struct.Struct("<I")


def write_message(stream: IO[bytes], message: dict[str, Any]) -> None:
    """Sends one message. Raises OSError where the other side is gone."""
    payload = json.dumps(message).encode()
    stream.write(_LENGTH.pack(len(payload)) + payload)
    stream.flush()


def read_message(stream: IO[bytes]) -> dict[str, Any] | None:
    """The next message, or None where the other side closed the pipe. Raises DeviceError for what is no message."""
    prefix = stream.read(_LENGTH.size)
    if not prefix:
        return None
    if len(prefix) == _LENGTH.size:
        (length,) = _LENGTH.unpack(prefix)
        if length <= MAX_MESSAGE_BYTES:
            payload = stream.read(length)
            if len(payload) == length:
                return _decoded(payload)
    raise DeviceError("the render process sent a broken message; render again")


def _decoded(payload: bytes) -> dict[str, Any]:
    try:
        message = json.loads(payload)
    except ValueError as error:
        raise DeviceError(f"the render process sent a broken message ({error}); render again") from error
    if not isinstance(message, dict):
        raise DeviceError("the render process sent a message of unknown form; render again")
    return message


def store_arrays(path: Path, arrays: Sequence[np.ndarray]) -> list[dict[str, Any]]:
    """Writes arrays into one file; returns where each lies: offset in bytes, dtype and shape."""
    blocks: list[dict[str, Any]] = []
    with path.open("wb") as file:
        for array in arrays:
            file.write(bytes(-file.tell() % ALIGNMENT_BYTES))
            blocks.append({"offset": file.tell(), "dtype": array.dtype.str, "shape": list(array.shape)})
            file.write(np.ascontiguousarray(array).data)
    return blocks


def map_arrays(path: Path, blocks: Sequence[dict[str, Any]]) -> list[np.ndarray]:
    """The arrays of `store_arrays`, read-only views of the mapped file. Raises DeviceError where one exceeds it."""
    size = path.stat().st_size
    data = np.memmap(path, np.uint8, "r") if size else np.zeros(0, np.uint8)
    return [_view(data, block) for block in blocks]


def _view(data: np.ndarray, block: dict[str, Any]) -> np.ndarray:
    dtype, shape, offset = np.dtype(block["dtype"]), tuple(block["shape"]), int(block["offset"])
    end = offset + dtype.itemsize * int(np.prod(shape, dtype=np.int64))
    if offset < 0 or min(shape, default=0) < 0 or end > len(data):
        raise DeviceError(f"an array of {end - offset} bytes exceeds the mapped file of {len(data)}; render again")
    return data[offset:end].view(dtype).reshape(shape)
