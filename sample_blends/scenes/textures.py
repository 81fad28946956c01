# SPDX-License-Identifier: GPL-3.0-or-later
"""Small images for the sample scenes, from integer arithmetic only, so that every machine makes the same bytes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[np.uint8]


def lattice(x: npt.NDArray[np.int64], y: npt.NDArray[np.int64], seed: int) -> npt.NDArray[np.int64]:
    """A value from 0 to 255 for each pair of integers, without visible order."""
    mixed = (x * 374761393 + y * 668265263 + seed * 974634541) & 0xFFFFFFFF
    mixed = ((mixed ^ (mixed >> 13)) * 1274126177) & 0xFFFFFFFF
    return (mixed ^ (mixed >> 16)) & 0xFF


def noise(size: int, cells: int, seed: int) -> npt.NDArray[np.int64]:
    """(size, size) values from 0 to 255: lattice values blended over cells x cells squares; repeats at its borders."""
    step = size // cells
    y, x = np.mgrid[0:size, 0:size]
    cx, cy, fx, fy = x // step, y // step, x % step, y % step
    corners = [[lattice((cx + i) % cells, (cy + j) % cells, seed) for i in (0, 1)] for j in (0, 1)]
    low = corners[0][0] * (step - fx) + corners[0][1] * fx
    high = corners[1][0] * (step - fx) + corners[1][1] * fx
    return (low * (step - fy) + high * fy) // (step * step)


def _tinted(shade: npt.NDArray[np.int64], colors: npt.NDArray[np.int64]) -> Pixels:
    """sRGB colours (h, w, 3) darkened or lightened by a shade around 128."""
    return np.clip(colors * (192 + shade[..., None] // 2) // 256, 0, 255).astype(np.uint8)


def floor_tiles(size: int = 256) -> Pixels:
    """Four marble tiles, light and dark in turn, with a diamond in each and narrow joints."""
    y, x = np.mgrid[0:size, 0:size]
    half = size // 2
    tile = (x // half + y // half) % 2
    u, v = np.abs(x % half - half // 2), np.abs(y % half - half // 2)
    diamond = u + v < half // 3
    joint = (u >= half // 2 - 1) | (v >= half // 2 - 1)
    light, dark, grout = np.array((208, 196, 172)), np.array((142, 98, 78)), np.array((120, 112, 100))
    colors = np.where((tile ^ diamond)[..., None] == 1, dark, light)
    colors = np.where(joint[..., None], grout, colors)
    shade = (2 * noise(size, 8, 1) + noise(size, 32, 2) + lattice(x, y, 3) // 4) // 3
    return _tinted(shade, colors)


def brick_courses(size: int = 256) -> Pixels:
    """Eight courses of pale ashlar blocks in running bond."""
    y, x = np.mgrid[0:size, 0:size]
    course = y // (size // 8)
    shifted = (x + (course % 2) * (size // 8)) % size
    block = shifted // (size // 4)
    joint = (y % (size // 8) < 2) | (shifted % (size // 4) < 2)
    tone = lattice(block, course, 7) // 6
    colors = np.array((190, 170, 136)) + tone[..., None] - 20
    colors = np.where(joint[..., None], np.array((138, 122, 98)), colors)
    return _tinted((noise(size, 16, 5) + noise(size, 64, 6)) // 2, colors)
