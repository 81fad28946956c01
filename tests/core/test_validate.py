# SPDX-License-Identifier: GPL-3.0-or-later
"""check_light_mesh: each fault alone gives its own finding, a sound mesh none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.core.surface_shapes import grid, icosphere, mesh_of
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh, empty_light_mesh
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh
from vlm_addon.core.validate import check_light_mesh

WALL = create_light_mesh([mesh_of(*grid(4, 4), reflectance=0.5)], SimplifySettings(100)).light_mesh


def changed(name: str, row: int, value: object) -> VirtualLightMesh:
    values = getattr(WALL, name).copy()
    values[row] = value
    return replace(WALL, **{name: values})


def only_problem(light_mesh: VirtualLightMesh) -> str:
    findings = check_light_mesh(light_mesh)
    assert len(findings) == 1, [str(finding) for finding in findings]
    return findings[0].problem


def test_fresh_light_meshes_are_sound() -> None:
    for meshes, target in (([mesh_of(*grid(8, 8), reflectance=1.0)], 20), ([mesh_of(*icosphere(4))], 300)):
        assert check_light_mesh(create_light_mesh(meshes, SimplifySettings(target)).light_mesh, meshes) == ()


def test_no_lights_says_what_to_do() -> None:
    assert "no lights" in only_problem(empty_light_mesh())


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["colour", "emission", "strength"])
def test_value_that_is_not_finite_names_the_first_light(name: str, bad: float) -> None:
    assert f"1 light has a {name} that is not finite (first: light 3" in only_problem(changed(name, 3, bad))


def test_vertex_that_is_not_finite() -> None:
    assert "a vertex that is not finite" in only_problem(changed("vertices", int(WALL.triangles[5, 0]), np.nan))


@pytest.mark.parametrize("name", ["colour", "emission", "strength"])
def test_negative_value(name: str) -> None:
    assert f"a negative {name} (first: light 2" in only_problem(changed(name, 2, -0.25))


def test_sample_that_is_not_finite() -> None:
    positions = WALL.samples.positions.copy()
    positions[4] = np.nan
    broken = replace(WALL, samples=replace(WALL.samples, positions=positions))
    assert "1 source samples are not finite" in only_problem(broken)


def test_degenerate_light() -> None:
    triangles = WALL.triangles.copy()
    triangles[7] = triangles[7, 0]
    assert "no area" in only_problem(replace(WALL, triangles=triangles))


def test_reflectance_above_one_is_allowed_with_a_warning() -> None:
    assert "reflectance above 1" in only_problem(changed("colour", 0, [0.2, 1.5, 0.2]))


def test_strength_above_one_is_expected() -> None:
    assert check_light_mesh(replace(WALL, strength=WALL.strength * 3)) == ()


def test_light_in_front_of_its_surface_tells_depth_and_share() -> None:
    raised = replace(WALL, vertices=WALL.vertices + np.array([0, 0, 0.05]))
    assert "32 lights stand in front of the surface (first: light 0, 100% of it; deepest 0.05 m)" in only_problem(
        raised
    )


def test_light_far_behind_its_surface_is_no_fault() -> None:
    assert check_light_mesh(replace(WALL, vertices=WALL.vertices - np.array([0, 0, 0.05]))) == ()


def test_inside_out_light() -> None:
    assert "32 lights have their front away" in only_problem(replace(WALL, triangles=WALL.triangles[:, ::-1]))


def test_light_without_samples() -> None:
    samples = WALL.samples
    end = int(samples.offsets[-2])
    offsets = samples.offsets.copy()
    offsets[-1] = end
    cut = SourceSamples(samples.positions[:end], samples.normals[:end], samples.weights[:end], offsets)
    assert "1 light has no source samples" in only_problem(replace(WALL, samples=cut))


def test_tag_that_no_surface_carries() -> None:
    tagged = changed("tag_ids", 6, 42)
    surface = mesh_of(*grid(1, 1), tags=7)
    assert ["a tag that no visible surface carries" in f.problem for f in check_light_mesh(tagged, [surface])] == [True]
    assert check_light_mesh(tagged, [mesh_of(*grid(1, 1), tags=42)]) == ()


def test_many_bad_lights_give_one_line() -> None:
    light_mesh = create_light_mesh([mesh_of(*grid(60, 60))], SimplifySettings(10_000)).light_mesh
    assert "7200 lights have a negative colour" in only_problem(replace(light_mesh, colour=light_mesh.colour - 1))
