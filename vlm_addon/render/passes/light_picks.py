# SPDX-License-Identifier: GPL-3.0-or-later
"""Some virtual lights for each pixel, picked in proportion to what they give there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...core.errors import DeviceError
from ..shader_library import set_uniforms

if TYPE_CHECKING:
    import moderngl

MOST_PICKS = 16
"""For each pixel of a picture: walks hold them in registers."""
PICK_BINDING = 7
MET_IMAGE = 1
PICK_DEFINES: dict[str, int | float | str] = {
    "PICK_BINDING": PICK_BINDING,
    "MET_IMAGE": MET_IMAGE,
    "PICKED_CLUSTER": "0x80000000u",
    "NO_PICK": "0xffffffffu",
}
"""What passes/light_sum.glsl needs in every form."""


class LightPicks:
    """Picks of a picture. buffer: a word for each, for PICK_BINDING: the row of a light or, with the highest bit, of a
    cluster, or all bits; four times as many for each pixel, row by row from the bottom, as there are groups. met: R32F,
    0 where there is no pick."""

    def __init__(self, context: moderngl.Context, width: int, height: int, count: int) -> None:
        """count: for each pixel, up to MOST_PICKS. Raises DeviceError where a block does not hold them."""
        self.count = count
        self.groups = -(-count // 4)
        self.sample_index = 0
        size = 16 * self.groups * width * height
        limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        if size > limit:
            needs, holds = (f"{1e-6 * bytes_:,.0f} MB" for bytes_ in (size, limit))
            raise DeviceError(f"visibility rays need a block of {needs}, the device holds {holds}; ask for fewer rays")
        self.buffer = context.buffer(reserve=size)
        self.met = context.texture((width, height), 1, dtype="f4")
        self._target = context.framebuffer([self.met])

    @property
    def defines(self) -> dict[str, int | bool]:
        """Of the walks' shaders that pick."""
        return {"PICKS": True, "PICK_GROUPS": self.groups}

    def begin(self, shader: moderngl.ComputeShader, irradiance: moderngl.Texture) -> None:
        """Forgets all picks and binds them. irradiance: of all that `shader` is going to meet."""
        self._target.clear()
        self.bind(shader, irradiance)

    def bind(self, shader: moderngl.ComputeShader, irradiance: moderngl.Texture) -> None:
        """As `begin`, for a shader that goes on."""
        irradiance.bind_to_image(0, write=False)
        self.bind_read(shader)

    def bind_read(self, shader: moderngl.ComputeShader) -> None:
        """For a shader that goes through the picks."""
        self.met.bind_to_image(MET_IMAGE)
        self.buffer.bind_to_storage_buffer(PICK_BINDING)
        set_uniforms(shader, {"pick_count": self.count, "sample_index": self.sample_index})

    def per_dispatch(self, most: int) -> int:
        """How many lights a dispatch may meet where it may meet `most` without picking: a light takes a round for each
        of four pixels and one more, and a pick group's one more for each pixel."""
        return 5 * most // (5 + 4 * self.groups)
