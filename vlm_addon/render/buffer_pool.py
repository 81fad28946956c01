# SPDX-License-Identifier: GPL-3.0-or-later
"""Buffers that are used again: wrappers that are let go of are only released at the end of a frame."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import DeviceError

if TYPE_CHECKING:
    import moderngl

_LEAST_BYTES = 256


class BufferPool:
    """Lends buffers whose sizes are powers of two, or what the device's blocks hold at most."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        self._free: dict[int, list[moderngl.Buffer]] = {}
        self.nbytes = 0

    @contextmanager
    def take(self, size: int) -> Iterator[moderngl.Buffer]:
        """A buffer of at least `size` bytes of any content. Raises DeviceError where the device holds no such block."""
        if size > self._limit:
            needs, holds = (f"{1e-6 * bytes_:,.0f} MB" for bytes_ in (size, self._limit))
            raise DeviceError(f"lists of lights need a block of {needs}, the device holds {holds}; bake fewer lights")
        capacity = min(1 << (max(size, _LEAST_BYTES) - 1).bit_length(), self._limit)
        free = self._free.setdefault(capacity, [])
        if free:
            buffer = free.pop()
        else:
            buffer = self._context.buffer(reserve=capacity)
            self.nbytes += capacity
        try:
            yield buffer
        finally:
            free.append(buffer)

    @contextmanager
    def uploaded(self, values: np.ndarray) -> Iterator[moderngl.Buffer]:
        """A buffer that begins with the bytes of `values`."""
        with self.take(values.nbytes) as buffer:
            if values.nbytes:
                # New storage: llvmpipe (Mesa 22) lets a write overtake work that still reads the old one.
                buffer.orphan()
                buffer.write(values.tobytes())
            yield buffer
