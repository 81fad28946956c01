# SPDX-License-Identifier: GPL-3.0-or-later
"""Large surfaces are reduced block by block, so that a cancellation is heard between two blocks."""

from __future__ import annotations

import numpy as np
import pytest

from tests.core.surface_shapes import icosphere, mesh_of, open_edges
from vlm_addon.core import bulk_reduction
from vlm_addon.core.bulk_reduction import reduce_groups
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh

POSITIONS, TRIANGLES = icosphere(5)
ONE_GROUP = np.zeros(len(TRIANGLES), np.int64)


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bulk_reduction, "LARGEST_RUN", 3000)


def test_blocks_fit_together_again() -> None:
    seen: list[float] = []
    found = reduce_groups(POSITIONS, TRIANGLES, ONE_GROUP, np.ones(len(TRIANGLES)), 4000, seen.append)
    assert open_edges(found.positions, found.triangles) == 0
    assert 3900 <= len(found.triangles) < 8000
    assert len(seen) == -(-len(TRIANGLES) // 3000)
    assert seen == sorted(seen)


def test_light_mesh_of_many_blocks_is_closed_and_of_the_right_power() -> None:
    light_mesh = create_light_mesh([mesh_of(POSITIONS, TRIANGLES)], SimplifySettings(300)).light_mesh
    assert open_edges(light_mesh.vertices, light_mesh.triangles) == 0
    assert 290 <= len(light_mesh) <= 300
    assert np.linalg.norm(light_mesh.vertices, axis=1).min() > 0.85


def test_a_cancellation_is_heard_between_blocks() -> None:
    asked: list[float] = []

    def stop(share: float) -> None:
        asked.append(share)
        if len(asked) == 2:
            raise Cancelled("rough")

    with pytest.raises(Cancelled):
        reduce_groups(POSITIONS, TRIANGLES, ONE_GROUP, np.ones(len(TRIANGLES)), 4000, stop)
