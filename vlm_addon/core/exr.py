# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenEXR files of 32-bit float scan lines: written uncompressed or ZIP, read in those and in 16-bit float.

OpenEXR File Layout and Technical Introduction (openexr.com): single part, scan lines, top line first.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InvalidInput
from .scene import Float32

MAGIC = 20000630
VERSION = 2
TILED_OR_DEEP_OR_PARTS = 0x1A00
LONG_NAMES = 0x400
LINES_PER_BLOCK = {0: 1, 2: 1, 3: 16}
"""Scan lines of one block by compression: none, ZIP of one line, ZIP of sixteen."""
ZIP = 3
PIXEL_TYPES: dict[int, np.dtype[Any]] = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
FLOAT = 2


def write_exr(path: Path, image: Float32) -> None:
    """Writes (h, w, c) float32 with c = 1, 3 or 4, row 0 at the top, as channels Y, RGB or RGBA, ZIP compressed."""
    names = {1: "Y", 3: "RGB", 4: "RGBA"}[image.shape[2]]
    write_channels(path, {name: image[..., i] for i, name in enumerate(names)})


def write_channels(path: Path, channels: Mapping[str, Float32]) -> None:
    """Writes one (h, w) float32 array per channel name, row 0 at the top, ZIP compressed."""
    names = sorted(channels)
    height, width = channels[names[0]].shape
    # Within a block the samples lie line by line, in a line channel by channel.
    lines = np.stack([np.asarray(channels[name], "<f4") for name in names], axis=1)
    header = _header(names, width, height)
    blocks = []
    for top in range(0, height, LINES_PER_BLOCK[ZIP]):
        raw = lines[top : top + LINES_PER_BLOCK[ZIP]].tobytes()
        packed = zlib.compress(_shuffle(raw), 4)
        packed = packed if len(packed) < len(raw) else raw
        blocks.append(struct.pack("<ii", top, len(packed)) + packed)
    starts = len(header) + 8 * len(blocks) + np.concatenate([[0], np.cumsum([len(block) for block in blocks])[:-1]])
    with path.open("wb") as file:
        file.write(header + starts.astype("<u8").tobytes())
        file.writelines(blocks)


def _header(names: list[str], width: int, height: int) -> bytes:
    def attribute(name: str, kind: str, value: bytes) -> bytes:
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    channel_list = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", FLOAT, 0, 1, 1) for name in names) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    flags = LONG_NAMES if any(len(name) > 31 for name in names) else 0
    return (
        struct.pack("<ii", MAGIC, VERSION | flags)
        + attribute("channels", "chlist", channel_list)
        + attribute("compression", "compression", bytes([ZIP]))
        + attribute("dataWindow", "box2i", window)
        + attribute("displayWindow", "box2i", window)
        + attribute("lineOrder", "lineOrder", b"\0")
        + attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0))
        + attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0))
        + attribute("screenWindowWidth", "float", struct.pack("<f", 1.0))
        + b"\0"
    )


def read_exr(path: Path) -> dict[str, Float32]:
    """One (h, w) float32 array per channel name, row 0 at the top.

    Raises InvalidInput for a file that is no EXR, is cut short, or is stored in another way.
    """
    data = path.read_bytes()
    try:
        return _decode(data, str(path))
    except (struct.error, zlib.error, IndexError, ValueError) as error:
        raise InvalidInput(str(path), f"it is not a whole EXR file ({error})", "write it again") from error


def image_of(channels: Mapping[str, Float32], prefix: str = "", names: str = "RGB") -> Float32:
    """(h, w, c): the channels `prefix` + each letter of `names`, stacked. Raises InvalidInput where one is missing."""
    missing = [prefix + name for name in names if prefix + name not in channels]
    if missing:
        raise InvalidInput("EXR file", f"it has no channel {missing[0]}", f"it has: {', '.join(sorted(channels))}")
    return np.stack([channels[prefix + name] for name in names], axis=-1)


def _decode(data: bytes, name: str) -> dict[str, Float32]:
    magic, version = struct.unpack_from("<ii", data)
    if magic != MAGIC:
        raise InvalidInput(name, "it is not an EXR file", "give an EXR file")
    attributes, offset = _attributes(data, 8)
    compression = attributes["compression"][0]
    if version & TILED_OR_DEEP_OR_PARTS or compression not in LINES_PER_BLOCK:
        raise InvalidInput(name, "it is tiled, deep, in parts, or not ZIP compressed", "save scan lines with ZIP")
    channels = list(_channels(attributes["channels"]))
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    images = {key: np.empty((height, width), np.float32) for key, _ in channels}
    line_bytes = sum(kind.itemsize for _, kind in channels) * width
    per_block = LINES_PER_BLOCK[compression]
    blocks = -(-height // per_block)
    for start in np.frombuffer(data, "<u8", blocks, offset).tolist():
        line, size = struct.unpack_from("<ii", data, start)
        rows = min(per_block, height - (line - top))
        raw = data[start + 8 : start + 8 + size]
        if compression and size < rows * line_bytes:
            raw = _unshuffle(zlib.decompress(raw))
        _fill(images, channels, raw, line - top, rows, width)
    return images


def _fill(
    images: dict[str, Float32], channels: list[tuple[str, np.dtype[Any]]], raw: bytes, first: int, rows: int, width: int
) -> None:
    position = 0
    for row in range(first, first + rows):
        for key, kind in channels:
            images[key][row] = np.frombuffer(raw, kind, width, position)
            position += kind.itemsize * width


def _attributes(data: bytes, offset: int) -> tuple[dict[str, bytes], int]:
    attributes = {}
    while data[offset]:
        name, offset = _text(data, offset)
        _, offset = _text(data, offset)
        (size,) = struct.unpack_from("<i", data, offset)
        attributes[name] = data[offset + 4 : offset + 4 + size]
        offset += 4 + size
    return attributes, offset + 1


def _channels(packed: bytes) -> Iterator[tuple[str, np.dtype[Any]]]:
    offset = 0
    while packed[offset]:
        name, offset = _text(packed, offset)
        (kind,) = struct.unpack_from("<i", packed, offset)
        yield name, PIXEL_TYPES[kind]
        offset += 16


def _text(data: bytes, offset: int) -> tuple[str, int]:
    end = data.index(b"\0", offset)
    return data[offset:end].decode(), end + 1


def _shuffle(raw: bytes) -> bytes:
    """EXR's preparation for ZIP: even bytes, then odd bytes, each as the difference to the byte before, plus 128."""
    stored = np.frombuffer(raw, np.uint8)
    halves = np.concatenate([stored[0::2], stored[1::2]])
    halves[1:] = halves[1:] - halves[:-1] + np.uint8(128)
    return halves.tobytes()


def _unshuffle(stored: bytes) -> bytes:
    differences = np.frombuffer(stored, np.uint8).astype(np.int64)
    differences[1:] -= 128
    halves = np.cumsum(differences).astype(np.uint8)
    raw = np.empty_like(halves)
    middle = (len(raw) + 1) // 2
    raw[0::2], raw[1::2] = halves[:middle], halves[middle:]
    return raw.tobytes()
