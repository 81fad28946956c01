# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes made from the shared models and the atrium: count, time, power, closed shells, placement.

`./dev bench simplify` prints one row for each surface and target; what is not there is left out with a line that
says so. Times are wall-clock milliseconds of one run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.support import MODELS, SAMPLE_BLENDS, open_sample
from vlm_addon.core.scene import Mesh
from vlm_addon.core.simplify import SimplifyReport, SimplifySettings, create_light_mesh
from vlm_addon.terminal import table

MODEL_TARGETS = (100, 500, 2000)
SCENE = "atrium"
SCENE_TARGETS = (1000, 10_000, 100_000)
HEADER = ("surface", "triangles", "target", "lights", "reduce ms", "all ms", "power error", "closed shells")
HEADER += ("left out", "in front", "too thin")


def main() -> None:
    """Prints the table."""
    rows = []
    for name, meshes, targets in _surfaces():
        for target in targets:
            rows.append(_row(name, target, create_light_mesh(meshes, SimplifySettings(target)).report))
    print(table(HEADER, rows))


def _surfaces() -> Iterator[tuple[str, Sequence[Mesh], Sequence[int]]]:
    paths = sorted(MODELS.glob("*.obj"))
    if not paths:
        print("no shared models beside the checkout: left out")
    for path in paths:
        yield path.stem, [load_model(path)], MODEL_TARGETS
    if (SAMPLE_BLENDS / f"{SCENE}.blend").exists():
        yield SCENE, open_sample(SCENE).snapshot.meshes, SCENE_TARGETS
    else:
        print(f"no {SCENE}.blend in {SAMPLE_BLENDS.name}: left out")


def load_model(path: Path) -> Mesh:
    """The triangles of an OBJ file as one object of reflectance 0.8, without normals or UVs."""
    import trimesh

    loaded = trimesh.load(path, process=False)
    count = len(loaded.faces)
    return Mesh(
        name=path.stem,
        positions=np.asarray(loaded.vertices, np.float64),
        triangles=np.asarray(loaded.faces, np.int32),
        corner_normals=np.zeros((count, 3, 3), np.float32),
        corner_uvs=np.zeros((count, 3, 2), np.float32),
        corner_colors=np.zeros((0, 3, 3), np.float32),
        material_indices=np.zeros(count, np.int32),
        tag_ids=np.zeros(count, np.int32),
        reflectance=np.full((count, 3), 0.8, np.float32),
        emission=np.zeros((count, 3), np.float32),
    )


def _row(name: str, target: int, report: SimplifyReport) -> tuple[str, ...]:
    before, after = sum(report.reflected_power_before), sum(report.reflected_power_after)
    milliseconds = dict(report.milliseconds)
    return (
        name,
        f"{report.source_triangles:,}",
        f"{target:,}",
        f"{report.lights:,}",
        f"{milliseconds['simplify']:,.0f}",
        f"{sum(milliseconds.values()):,.0f}",
        f"{abs(after / before - 1):.4%}",
        f"{report.closed_shells_before} -> {report.closed_shells_after}",
        f"{report.shells_dropped} of {report.shells}",
        f"{report.share_in_front:.2%}",
        f"{report.limited_lights:,}",
    )


if __name__ == "__main__":
    main()
