# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks by which it is known later which lights were made together: these stand for different parts of a surface."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from .light_mesh import VirtualLightMesh
from .mesh_topology import Bool
from .scene import Int32

UNMARKED = 0
"""The mark of lights that nothing is known of, as those that are drawn."""
NUMBER_BITS = 20
CREATIONS = (1 << (31 - NUMBER_BITS)) - 1


@dataclass(frozen=True)
class LightHistory:
    """What is known of how lights were made. marks: (n,) int32, see `creation_marks`. stands_for: (light meshes,
    visible meshes) bool, whether the one may stand for the other, where that is known. light_mesh_of: (n,) int, the
    light mesh that each light is of, where it is needed."""

    marks: Int32
    stands_for: Bool | None = None
    light_mesh_of: npt.NDArray[np.integer[Any]] = field(default_factory=lambda: np.zeros(0, np.int32))


def creation_marks(light_mesh: VirtualLightMesh) -> Int32:
    """(n,) int32, never UNMARKED: the lower NUMBER_BITS number the lights, the others say when they were made (by their
    shape: two creations in 2,047 look like one)."""
    creation = 1 + zlib.crc32(np.ascontiguousarray(light_mesh.vertices).tobytes()) % CREATIONS
    number = np.arange(len(light_mesh), dtype=np.int64) & ((1 << NUMBER_BITS) - 1)
    return ((creation << NUMBER_BITS) | number).astype(np.int32)


def made_together(one: Int32, other: Int32) -> Bool:
    """Whether lights of these marks are two of one creation; copies of one light are not."""
    marked = (one != UNMARKED) & (other != UNMARKED)
    return np.asarray(marked & (one != other) & (one >> NUMBER_BITS == other >> NUMBER_BITS))
