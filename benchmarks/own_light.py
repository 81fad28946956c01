# SPDX-License-Identifier: GPL-3.0-or-later
"""Own light of light meshes as they are made, after the check's fix, and with automatic tags.

`./dev bench own_light [name …] [--lights n …]`: share of the light at 10,000 points of the surface that comes from the
light which stands for the point (core/own_light.py), for sample scenes and the shared models, these alone and in a room
(then at points of the model). `of all` counts 1 W/m² of direct light, too. `left` is what automatic tags leave of the
light of objects on their other parts; `links` are pairs of tags for faces that several lights stand for.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.simplify import load_model
from benchmarks.support import MODELS, SAMPLE_BLENDS, open_sample
from vlm_addon.core.finding_kinds import IN_FRONT, THIN
from vlm_addon.core.own_light import OwnLight, own_light, region_points
from vlm_addon.core.own_tags import tagged_regions
from vlm_addon.core.repair import fix
from vlm_addon.core.scene import Float64, Mesh
from vlm_addon.core.simplify import CreatedLightMesh, SimplifySettings, create_light_mesh
from vlm_addon.core.validate import check_light_mesh
from vlm_addon.terminal import table

BUDGETS = (50, 200, 1000, 5000)
ROOM_SIZES = 2.0
HEADER = ("surface", "lights", "own light", "of all", "after fix", "tagged: own", "left", "links")


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--lights", nargs="+", type=int, default=BUDGETS)
    options = parser.parse_args()
    rows = []
    for name, meshes, chosen in _surfaces(options.names):
        for budget in options.lights:
            rows.append(_row(name, meshes, chosen, budget))
            print(" ".join(rows[-1]), flush=True)
    print(table(HEADER, rows))


def _surfaces(names: Sequence[str]) -> Iterator[tuple[str, Sequence[Mesh], Sequence[int] | None]]:
    """(name, meshes, the meshes on which points lie)."""
    paths = sorted(MODELS.glob("*.obj"))
    if not paths:
        print("no shared models beside the checkout: left out")
    for path in paths:
        if not names or path.stem in names:
            model = load_model(path)
            yield f"{path.stem} alone", [model], None
            yield f"{path.stem} in a room", [model, _room(model)], [0]
    for path in sorted(SAMPLE_BLENDS.glob("*.blend")):
        if not names or path.stem in names:
            yield path.stem, open_sample(path.stem).snapshot.meshes, None


def _room(model: Mesh) -> Mesh:
    """A closed box around the model, facing inwards, 12 triangles."""
    low, high = model.bounds()
    unit = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    positions = 0.5 * (low + high) + 0.5 * ROOM_SIZES * (high - low).max() * unit
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)
    first, second, third = positions[triangles[0]]
    if np.cross(second - first, third - first) @ (positions.mean(axis=0) - first) < 0:
        triangles = triangles[:, ::-1].copy()
    part = model.subset(np.arange(len(model.triangles)) < len(triangles))
    return replace(part, name="room", positions=positions, triangles=triangles)


def _row(name: str, meshes: Sequence[Mesh], chosen: Sequence[int] | None, budget: int) -> tuple[str, ...]:
    created = create_light_mesh(meshes, SimplifySettings(budget))
    made = _measured(created, meshes, chosen)
    light_mesh = created.light_mesh
    for kind in (IN_FRONT, THIN):
        found = [finding for finding in check_light_mesh(light_mesh, meshes) if finding.kind == kind]
        if found:
            repair = fix(IN_FRONT, light_mesh, meshes, found[0].lights, created.light_of_triangle)
            light_mesh = replace(repair.applied(light_mesh), tag_ids=light_mesh.tag_ids, links=light_mesh.links)
    fixed = _measured(replace(created, light_mesh=light_mesh), meshes, chosen)
    rows = np.arange(len(light_mesh))
    tags, parts, links = tagged_regions(created.light_mesh, meshes, rows, created.light_of_triangle)
    tagged_meshes = [replace(mesh, tag_ids=part) for mesh, part in zip(meshes, parts, strict=True)]
    with_tags = replace(created, light_mesh=replace(created.light_mesh, tag_ids=tags, links=links))
    tagged = _measured(with_tags, tagged_meshes, chosen)
    return (
        name,
        f"{len(light_mesh):,}",
        f"{made.share:.3%}",
        f"{made.share_of_arriving:.3%}",
        f"{fixed.share:.3%}",
        f"{tagged.own:.3g}",
        f"{tagged.kept_on_itself:.2%}",
        f"{len(links):,}",
    )


def _measured(created: CreatedLightMesh, meshes: Sequence[Mesh], chosen: Sequence[int] | None) -> OwnLight:
    points = region_points(meshes, created.light_of_triangle, chosen=chosen)
    return own_light(created.light_mesh, _mesh_of_light(created, meshes), points)


def _mesh_of_light(created: CreatedLightMesh, meshes: Sequence[Mesh]) -> np.ndarray:
    """(n,) the mesh with most of the area of each light's region."""
    areas = np.zeros((len(meshes), len(created.light_mesh)))
    for row, (mesh, lights) in enumerate(zip(meshes, created.light_of_triangle, strict=True)):
        held = lights >= 0
        np.add.at(areas[row], lights[held], _areas(mesh)[held])
    return areas.argmax(axis=0)


def _areas(mesh: Mesh) -> Float64:
    corners = mesh.positions[mesh.triangles]
    areas: Float64 = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return areas


if __name__ == "__main__":
    main()
