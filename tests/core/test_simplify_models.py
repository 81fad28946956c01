# SPDX-License-Identifier: GPL-3.0-or-later
"""Scanned and modelled shapes, where the folder of shared models lies beside the checkout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.core.surface_shapes import areas_of, mesh_of
from vlm_addon.core.finding_kinds import IN_FRONT, THIN, TWO_SIDED
from vlm_addon.core.light_marks import LightHistory, creation_marks
from vlm_addon.core.scene import Mesh
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.core.validate import check_light_mesh

MODELS = Path(__file__).resolve().parents[3] / "shared" / "models"
NAMES = ("fandisk", "spot", "stanford-bunny", "suzanne", "teapot")


def load(name: str) -> Mesh:
    path = MODELS / f"{name}.obj"
    if not path.exists():
        pytest.skip(f"../shared/models/{name}.obj is not beside the checkout")
    trimesh = pytest.importorskip("trimesh")
    loaded = trimesh.load(path, process=False)
    return mesh_of(loaded.vertices, loaded.faces, name=name, reflectance=[0.8, 0.5, 0.2])


@pytest.mark.parametrize("target", [100, 500, 2000])
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("whole_regions", [True, False])
def test_count_power_shells_and_placement(name: str, target: int, whole_regions: bool) -> None:
    mesh = load(name)
    created = create_light_mesh([mesh], SimplifySettings(target), whole_regions=whole_regions)
    report, light_mesh = created.report, created.light_mesh
    if len(mesh.triangles) > target:
        assert 0.96 * target <= len(light_mesh) <= target
    power = areas_of(mesh.positions, mesh.triangles) @ mesh.reflectance.astype(float)
    np.testing.assert_allclose(light_mesh.reflected_power, power, rtol=0.01)
    assert report.closed_shells_after == report.closed_shells_before
    assert report.shells_dropped == 0
    if whole_regions:
        assert report.share_in_front < (0.08 if target == 100 else 0.02)
    history = LightHistory(creation_marks(light_mesh))
    findings = check_light_mesh(light_mesh, [mesh], history=history)
    assert [f for f in findings if f.kind not in (IN_FRONT, THIN, TWO_SIDED)] == []
