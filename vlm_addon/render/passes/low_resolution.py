# SPDX-License-Identifier: GPL-3.0-or-later
"""A gather at low resolution, done again at full resolution where that does not do (seed 001, 3.5 and 4).

For any technique whose gather finds something for each pixel of a G-buffer (RGBA32F: irradiance, say). It keeps its
gather as it is, derives its settings from LowResolutionSettings, makes one LowResolutionGather a frame and hands it a
function instead of calling its gather with the frame's G-buffer:

    low = LowResolutionGather(scene.context, scene.shaders, width, height, chosen)
    irradiance = low.render(frame.gbuffer, frame.view, lambda picked: my_gather(picked.gbuffer))

The function is called at most twice, with G-buffers that hold some of the frame's pixels: first every second pixel in
both directions, then those that look unlike their neighbours there, packed. It returns a texture of that G-buffer's
size; the next call may overwrite it. Sizes differ from call to call: `SizedPasses` keeps a pass for each. Texels
without a surface look as everywhere. What depends on the pixel's place in the picture, such as a rotating pattern,
reads it from `picked.pixel`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from ...core.scene import Float32
from ...core.settings import OWN, setting
from ..buffer_pool import BufferPool
from ..fullscreen import FullscreenPass
from ..gpu_layout import CONSTANTS
from ..prefix_sum import PrefixSum
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .accumulate import read_image
from .gbuffer import GBuffer
from .phase_two import IrradianceImage

if TYPE_CHECKING:
    import moderngl

GROUP_SIDE = 8
"""Of the squares of neighbours that packed pixels come in, pixels."""
COUNT_BINDING, SHOWN_BINDING, LIST_BINDING = 0, 1, 2
EMPTY, FILLED, REDONE = 0, 1, 2
"""Marks of pixels without a surface, of those that the low resolution does for, and of the others."""
FIRST_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
DEFINES = {
    "GROUP_SIDE": GROUP_SIDE,
    "COUNT_BINDING": COUNT_BINDING,
    "SHOWN_BINDING": SHOWN_BINDING,
    "LIST_BINDING": LIST_BINDING,
    "MARK_EMPTY": EMPTY,
    "MARK_FILLED": FILLED,
    "MARK_REDONE": REDONE,
    "MARK_UNIT": FIRST_UNIT,
    "LOW_POSITION_UNIT": FIRST_UNIT,
    "LOW_NORMAL_UNIT": FIRST_UNIT + 1,
    "LOW_RESULT_UNIT": FIRST_UNIT + 2,
    "PICKED_PIXEL_UNIT": FIRST_UNIT,
    "PICKED_RESULT_UNIT": FIRST_UNIT + 1,
}
P = TypeVar("P")


@dataclass(frozen=True)
class LowResolutionSettings:
    """Where a gather at low resolution will do."""

    low_resolution: int = setting(
        2,
        "pixels",
        1,
        8,
        "Gather at every so many pixels in both directions and interpolate where the surface is even; 1: at all",
        source="001, 4: one of four pixels",
    )
    normal_threshold: float = setting(
        0.2,
        "share",
        0.0,
        3.0,
        "Difference of unit normals, of their length, from which on a pixel is gathered alone; 0: all are, 3: none",
        source="001, 3.5: discontinuity threshold",
    )
    position_threshold: float = setting(
        0.02,
        "picture widths",
        0.0,
        1e6,
        "Distance to the neighbors from which on a pixel is gathered on its own, of what the picture shows across at "
        "its depth; 0: all are",
        source="001, 3.5: discontinuity threshold",
    )
    value_threshold: float = setting(
        0.1,
        "share",
        0.0,
        2.0,
        "Difference between the neighbors' results, of the largest of them, above which a pixel is gathered on its "
        "own, as beside a light; 2: none is for that",
        source=OWN,
    )


@dataclass(frozen=True)
class PickedPixels:
    """Some pixels of a picture. gbuffer: what they show. pixel: RG32I, which they are, row 0 at the bottom; undefined
    where the G-buffer shows no surface."""

    gbuffer: GBuffer
    pixel: moderngl.Texture


Gather = Callable[[PickedPixels], "moderngl.Texture"]
"""Finds RGBA32F of the G-buffer's size for its pixels."""


class SizedPasses(Generic[P]):
    """Passes of the same kind for pictures of several sizes."""

    def __init__(self, make: Callable[[int, int], P]) -> None:
        """make: the pass for a width and height."""
        self._make = make
        self._passes: dict[tuple[int, int], P] = {}

    def of(self, gbuffer: GBuffer) -> P:
        """The pass for the size of `gbuffer`."""
        if gbuffer.size not in self._passes:
            self._passes[gbuffer.size] = self._make(*gbuffer.size)
        return self._passes[gbuffer.size]


class _PickedTextures:
    """Textures that pixels are picked into, by drawing into `framebuffer`."""

    def __init__(self, context: moderngl.Context, width: int, height: int) -> None:
        names = [field.name for field in fields(GBuffer)]
        kinds = {name: "i4" if name == "ids" else "f4" for name in names}
        images = {name: context.texture((width, height), 4, dtype=kind) for name, kind in kinds.items()}
        self.picked = PickedPixels(GBuffer(**images), context.texture((width, height), 2, dtype="i4"))
        self.framebuffer = context.framebuffer([*images.values(), self.picked.pixel])
        self.groups = -(-width // GROUP_SIDE), -(-height // GROUP_SIDE)


class LowResolutionGather:
    """Gathers at few pixels, and at more where these do not tell enough.

    shown, redone: pixels so far that showed a surface, and those of them that were gathered at full resolution.
    """

    def __init__(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        width: int,
        height: int,
        settings: LowResolutionSettings,
        keep_low: bool = False,
    ) -> None:
        """keep_low: whether `images` also has the low-resolution result, which has to be read meanwhile."""
        self._context = context
        self._settings = settings
        self._keep_low = keep_low
        self._low: Float32 | None = None
        self.shown = self.redone = 0
        self._everything = settings.low_resolution == 1 or not (
            settings.normal_threshold > 0.0 and settings.position_threshold > 0.0
        )
        self._size = width, height
        self._result = IrradianceImage(context, width, height)
        self._marks = context.texture((width, height), 1, dtype="u1")
        self._filled = context.framebuffer([self._result.texture, self._marks])
        self._groups = -(-width // GROUP_SIDE), -(-height // GROUP_SIDE)
        group_count = self._groups[0] * self._groups[1]
        # One value more than there are groups: there the prefix sum leaves the sum of all.
        self._counts = context.buffer(reserve=4 * (group_count + 1))
        self._shown = context.buffer(reserve=4)
        self._list = context.buffer(reserve=8 * GROUP_SIDE**2 * group_count)
        factor = settings.low_resolution
        self._small = _PickedTextures(context, *(-(-(side - 1) // factor) + 1 for side in (width, height)))
        self._packed: dict[int, _PickedTextures] = {}
        self._prefix_sum = PrefixSum(context, shaders, BufferPool(context))
        defines = {**DEFINES, "FACTOR": factor}
        self._pick = {
            shrinks: FullscreenPass(
                context, shaders, "passes/low_resolution_pick.frag", {**defines, "SHRINKS": shrinks}
            )
            for shrinks in (False, True)
        }
        self._blend = FullscreenPass(context, shaders, "passes/low_resolution_blend.frag", defines)
        self._count = shaders.compute("passes/low_resolution_count.comp", defines)
        self._make_list = shaders.compute("passes/low_resolution_list.comp", defines)
        self._scatter = shaders.compute("passes/low_resolution_scatter.comp", defines)

    def render(self, gbuffer: GBuffer, view: View, gather: Gather) -> moderngl.Texture:
        """What `gather` finds, for each pixel of `gbuffer`; RGBA32F, 0 where no surface shows.

        gbuffer: of the picture's size. view: that it was drawn through. The next call overwrites the texture.
        """
        if self._everything:
            return gather(PickedPixels(gbuffer, self._all_pixels()))
        small = self._shrunk(gbuffer)
        low = gather(small.picked)
        if self._keep_low:
            self._low = read_image(low)
        self._blended(gbuffer, view, small, low)
        count = self._counted()
        if count:
            packed = self._packed_pixels(gbuffer, count)
            self._scattered(packed, count, gather(packed.picked))
        return self._result.texture

    def counters(self) -> dict[str, float]:
        """Share of the pixels so far that show a surface for which the low resolution did."""
        return {"low_resolution_share": 1.0 - self.redone / self.shown if self.shown else 0.0}

    def images(self) -> dict[str, Float32]:
        """Of the last picture, (h, w, c), row 0 at the top: `discontinuity`, 1 where gathered at full resolution; and,
        with keep_low, `low_resolution`, what was found at low resolution, each value as large as what it stands for."""
        width, height = self._size
        if self._everything:
            return {"discontinuity": np.ones((height, width, 1), np.float32)}
        marks = np.frombuffer(self._marks.read(alignment=1), np.uint8).reshape(height, width, 1)[::-1]
        found = {"discontinuity": (marks == REDONE).astype(np.float32)}
        if self._low is not None:
            factor = self._settings.low_resolution
            # Rows were counted from the bottom, where the first texel is.
            rows, columns = (
                np.minimum((np.arange(side) + factor // 2) // factor, low - 1)
                for side, low in zip((height, width), self._low.shape[:2], strict=True)
            )
            found["low_resolution"] = np.ascontiguousarray(self._low[::-1][rows[::-1]][:, columns, :3])
        return found

    def _all_pixels(self) -> moderngl.Texture:
        width, height = self._size
        places = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.int32)
        return self._context.texture(self._size, 2, places.tobytes(), dtype="i4")

    def _shrunk(self, gbuffer: GBuffer) -> _PickedTextures:
        gbuffer.bind()
        self._pick[True].draw(self._small.framebuffer)
        return self._small

    def _blended(self, gbuffer: GBuffer, view: View, small: _PickedTextures, low: moderngl.Texture) -> None:
        """Fills in what the low resolution does for and marks the rest."""
        gbuffer.bind()
        picked = small.picked.gbuffer
        for unit, texture in enumerate((picked.position, picked.shading_normal, low), FIRST_UNIT):
            texture.use(unit)
        at_0, per_depth = view.picture_width(self._size[0])
        settings = self._settings
        uniforms = {"normal_threshold": settings.normal_threshold, "position_threshold": settings.position_threshold}
        uniforms["value_threshold"] = settings.value_threshold
        set_uniforms(self._blend.program, {**uniforms, "width_at_0": at_0, "width_per_depth": per_depth})
        self._blend.draw(self._filled)

    def _counted(self) -> int:
        """How many pixels are to be gathered again; leaves for each group how many are in the groups before it."""
        self._marks.use(FIRST_UNIT)
        self._counts.bind_to_storage_buffer(COUNT_BINDING)
        self._shown.orphan()
        self._shown.write(bytes(4))
        self._shown.bind_to_storage_buffer(SHOWN_BINDING)
        self._count.run(*self._groups)
        self._context.memory_barrier()
        self._prefix_sum.run(self._counts, self._counts.size // 4)
        count = int(np.frombuffer(self._counts.read(), np.uint32)[-1])
        self.redone += count
        self.shown += int(np.frombuffer(self._shown.read(), np.uint32)[0])
        return count

    def _packed_pixels(self, gbuffer: GBuffer, count: int) -> _PickedTextures:
        """The marked pixels, in as many rows of squares as a power of two: few sizes, so few sets of textures."""
        columns = self._groups[0]
        rows = 1 << (-(-count // (GROUP_SIDE**2 * columns)) - 1).bit_length()
        if rows not in self._packed:
            self._packed[rows] = _PickedTextures(self._context, GROUP_SIDE * columns, GROUP_SIDE * rows)
        packed = self._packed[rows]
        self._marks.use(FIRST_UNIT)
        self._counts.bind_to_storage_buffer(COUNT_BINDING)
        self._list.bind_to_storage_buffer(LIST_BINDING)
        self._make_list.run(*self._groups)
        self._context.memory_barrier()
        gbuffer.bind()
        set_uniforms(self._pick[False].program, {"count": count})
        self._pick[False].draw(packed.framebuffer)
        return packed

    def _scattered(self, packed: _PickedTextures, count: int, found: moderngl.Texture) -> None:
        packed.picked.pixel.use(FIRST_UNIT)
        found.use(FIRST_UNIT + 1)
        self._result.texture.bind_to_image(0, read=False, write=True)
        set_uniforms(self._scatter, {"count": count})
        self._scatter.run(*packed.groups)
        self._context.memory_barrier()
