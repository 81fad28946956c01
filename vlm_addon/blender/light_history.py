# SPDX-License-Identifier: GPL-3.0-or-later
"""How the lights of the scene were made, for the check (core/light_marks.py)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.light_marks import LightHistory
from .extraction.light_mesh_io import Extraction
from .light_meshes import readable_sources
from .tagging.source_faces import owners_of


def light_history(scene: Any, found: Extraction) -> LightHistory | None:
    """Which lights of an extraction were made together, and which of its meshes they may stand for: those of the
    objects that their light mesh was made from, or all where none is known, as pairing has it."""
    if found.origins is None:
        return None
    owners = [set(owners_of(mesh.name)) for mesh in found.snapshot.meshes]
    stands_for = np.ones((len(found.origins.objects), len(owners)), bool)
    for row, name in enumerate(found.origins.objects):
        thing = scene.objects.get(name)
        names = {each.name for each in readable_sources(thing, scene) if each is not None} if thing is not None else ()
        if names:
            stands_for[row] = [not names.isdisjoint(each) for each in owners]
    return LightHistory(found.origins.marks, stands_for, found.origins.owner)
