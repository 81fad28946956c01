# SPDX-License-Identifier: GPL-3.0-or-later
"""A buffer whose content is made anew for each frame and whose size only ever grows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..core.errors import DeviceError

if TYPE_CHECKING:
    import moderngl


class GrowingBuffer:
    """One buffer that is replaced by a larger one where it is too small, so that a scene that moves needs no more.

    what: its name in messages.
    """

    def __init__(self, context: moderngl.Context, what: str) -> None:
        self._context = context
        self._what = what
        self._buffer: moderngl.Buffer | None = None

    @property
    def nbytes(self) -> int:
        """What it takes on the device."""
        return int(self._buffer.size) if self._buffer is not None else 0

    def of(self, size: int) -> moderngl.Buffer:
        """The buffer, with at least `size` bytes, of any content. Raises DeviceError where the device has no such."""
        require_block(self._context, size, self._what)
        if self._buffer is None or self._buffer.size < size:
            self._buffer = self._context.buffer(reserve=min(1 << (size - 1).bit_length(), _limit(self._context)))
        else:
            # New storage: llvmpipe lets a write overtake work that still reads the old one.
            self._buffer.orphan()
        return self._buffer


def require_block(context: moderngl.Context, size: int, what: str) -> None:
    """Raises DeviceError where the device holds no storage block of `size` bytes."""
    limit = _limit(context)
    if size > limit:
        needs, holds = (f"{1e-6 * bytes_:,.0f} MB" for bytes_ in (size, limit))
        raise DeviceError(f"{what} needs a block of {needs}, the device holds {holds}; use a lower resolution")


def _limit(context: moderngl.Context) -> int:
    return int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
