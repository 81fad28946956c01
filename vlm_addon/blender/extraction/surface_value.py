# SPDX-License-Identifier: GPL-3.0-or-later
"""What a shading socket gives over a surface: a constant, or an image (perhaps changed texel by texel)."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

import numpy as np

from ...core.scene import Float32
from . import node_operations

IDENTITY_UV = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True)
class UvSource:
    """Where texture coordinates come from: a UV map ("" for the one active for rendering), then a 2 x 3 matrix."""

    uv_map: str = ""
    matrix: tuple[float, float, float, float, float, float] = IDENTITY_UV


@dataclass(frozen=True)
class Sampling:
    """How an image is looked up."""

    uv: UvSource
    repeat: bool
    linear_filter: bool


@dataclass(frozen=True)
class SurfaceValue:
    """A colour, or a number where `channel` is set.

    data: (4,) or (h, w, 4) float32, linear Rec.709 or raw. key: equal for equal data. sampling: None for a constant.
    attribute: colour attribute that multiplies the data, if any. channel: which of the four components holds a number.
    """

    data: Float32
    key: Hashable
    sampling: Sampling | None = None
    attribute: str | None = None
    channel: int | None = None

    @property
    def is_textured(self) -> bool:
        """Whether the value comes from an image."""
        return self.sampling is not None

    @property
    def mean(self) -> Float32:
        """(4,) float32: the value averaged over the image."""
        return self.data.reshape(-1, 4).mean(axis=0, dtype=np.float64).astype(np.float32)

    @property
    def number(self) -> float:
        """The average as one number."""
        return float(as_number(self).mean[self.channel or 0])


def constant_color(color: Float32) -> SurfaceValue:
    """A constant (3,) or (4,) colour."""
    rgba = np.ones(4, np.float32)
    rgba[: len(color)] = color
    return SurfaceValue(rgba, ("constant", *rgba.tolist()))


def constant_number(number: float) -> SurfaceValue:
    """A constant number."""
    return SurfaceValue(np.full(4, number, np.float32), ("number", float(number)), channel=0)


def as_number(value: SurfaceValue) -> SurfaceValue:
    """A colour as the number that Blender reads from it, its luminance; numbers as they are."""
    if value.channel is not None:
        return value
    rgb = value.data[..., :3]
    if np.array_equal(rgb[..., 0], rgb[..., 1]) and np.array_equal(rgb[..., 1], rgb[..., 2]):
        return replace(value, channel=0)
    grey = np.repeat(node_operations.luminance(value.data), 4, axis=-1)
    return replace(value, data=grey, key=("luminance", value.key), channel=0)


def as_color(value: SurfaceValue) -> SurfaceValue:
    """A number as a grey; colours as they are."""
    if value.channel is None:
        return value
    grey = np.repeat(value.data[..., value.channel, None], 4, axis=-1)
    return replace(value, data=grey, key=("grey", value.channel, value.key), channel=None)


def combine(
    name: Hashable,
    function: Callable[..., Float32],
    values: list[SurfaceValue],
    report: Callable[[str, str], None],
    multiplies: bool = False,
) -> SurfaceValue:
    """`function` of the data of several values, each (4,) or (h, w, 4), numbers as greys.

    The images must share size and sampling; one that does not is averaged, and reported. An attribute passes through a
    multiplication and is left out, with a report, elsewhere.
    """
    colors = [as_color(value) for value in values]
    textured = next((value for value in colors if value.is_textured), None)
    arrays, attributes = [], []
    for value in colors:
        fits = textured is None or not value.is_textured or _fits(value, textured)
        if not fits:
            report("images of different size or mapping are combined", "the second is replaced by its mean")
        arrays.append(value.data if fits else value.mean)
        if value.attribute is not None:
            attributes.append(value.attribute)
    passes = multiplies and len(attributes) == 1
    if attributes and not passes:
        report(f"color attribute {attributes[0]!r} goes through a node", "read as white there")
    return SurfaceValue(
        data=np.asarray(function(*arrays), np.float32),
        key=(name, *(value.key for value in colors)),
        sampling=textured.sampling if textured is not None else None,
        attribute=attributes[0] if passes else None,
    )


def _fits(a: SurfaceValue, b: SurfaceValue) -> bool:
    return a.sampling == b.sampling and a.data.shape == b.data.shape
