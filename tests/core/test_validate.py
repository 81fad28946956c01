# SPDX-License-Identifier: GPL-3.0-or-later
"""check_light_mesh: each fault alone gives its own finding, a sound mesh none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.core.surface_shapes import grid, icosphere, mesh_of, sheet
from vlm_addon.core import finding_kinds as kinds
from vlm_addon.core.light_links import make_links
from vlm_addon.core.light_mesh import SourceSamples, VirtualLightMesh, empty_light_mesh, join
from vlm_addon.core.repair import fix
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
@pytest.mark.parametrize(
    ("name", "spoken"), [("colour", "a color"), ("emission", "an emission"), ("strength", "a strength")]
)
def test_value_that_is_not_finite_names_the_first_light(name: str, spoken: str, bad: float) -> None:
    assert f"1 light has {spoken} that is not finite (first: light 3" in only_problem(changed(name, 3, bad))


def test_vertex_that_is_not_finite() -> None:
    assert "a vertex that is not finite" in only_problem(changed("vertices", int(WALL.triangles[5, 0]), np.nan))


@pytest.mark.parametrize(("name", "spoken"), [("colour", "color"), ("emission", "emission"), ("strength", "strength")])
def test_negative_value(name: str, spoken: str) -> None:
    assert f"a negative {spoken} (first: light 2" in only_problem(changed(name, 2, -0.25))


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


def faults(light_mesh: VirtualLightMesh, meshes: list | None = None) -> dict[str, tuple[int, ...]]:
    return {finding.kind: finding.lights for finding in check_light_mesh(light_mesh, meshes or ())}


def test_findings_name_their_kind_and_lights() -> None:
    assert faults(changed("colour", 3, np.nan)) == {kinds.NOT_FINITE: (3,)}
    assert faults(changed("emission", 2, -1.0)) == {kinds.NEGATIVE: (2,)}
    assert faults(changed("colour", 5, 1.5)) == {kinds.BRIGHT: (5,)}
    assert faults(replace(WALL, vertices=WALL.vertices + np.array([0, 0, 0.05]))) == {kinds.IN_FRONT: tuple(range(32))}


@pytest.mark.parametrize("turned", [(4,), (0, 9, 17)])
def test_light_that_faces_against_its_neighbours_is_the_one_that_is_told(turned: tuple[int, ...]) -> None:
    triangles = WALL.triangles.copy()
    triangles[list(turned)] = triangles[list(turned)][:, ::-1]
    assert faults(replace(WALL, triangles=triangles))[kinds.NON_MANIFOLD] == turned


def test_without_samples_the_fewer_face_against_the_others() -> None:
    triangles = WALL.triangles.copy()
    triangles[4] = triangles[4, ::-1]
    none = np.zeros(len(WALL) + 1, np.int32)
    samples = SourceSamples(WALL.samples.positions[:0], WALL.samples.normals[:0], WALL.samples.weights[:0], none)
    found = faults(replace(WALL, triangles=triangles, samples=samples))
    assert found[kinds.NON_MANIFOLD] == (4,)


def test_second_light_mesh_of_the_same_surface_counts_twice() -> None:
    ball = [mesh_of(*icosphere(4))]
    once = create_light_mesh(ball, SimplifySettings(200)).light_mesh
    found = faults(join([once, once]), ball)
    second = set(range(len(once), 2 * len(once)))
    assert set(found[kinds.OVERLAPPING]) <= second
    assert len(found[kinds.OVERLAPPING]) > 0.95 * len(second)


def test_lights_drawn_over_a_part_are_the_ones_that_count_twice() -> None:
    patch = WALL.subset(np.arange(len(WALL)) < 3)
    assert faults(join([WALL, patch])) == {kinds.OVERLAPPING: tuple(range(len(WALL), len(WALL) + 3))}


def test_lights_of_surfaces_that_lie_close_do_not_count_twice() -> None:
    top, triangles = grid(4, 4)
    both = [mesh_of(top, triangles), mesh_of(0.5 * top + np.array([0.2, 0.2, 0.01]), triangles)]
    light_mesh = create_light_mesh(both, SimplifySettings(100)).light_mesh
    assert kinds.OVERLAPPING not in faults(light_mesh, both)


def bent_shell() -> list:
    top, triangles = sheet(lambda x, y: 0.2 * np.sin(np.pi * x) * np.sin(np.pi * y), 16, 16)
    return [mesh_of(top, triangles), mesh_of(top - np.array([0, 0, 2e-3]), triangles[:, ::-1])]


def test_thin_body_is_told_apart_from_what_can_be_moved_and_tags_excuse_it() -> None:
    shell = bent_shell()
    created = create_light_mesh(shell, SimplifySettings(16))
    found = faults(created.light_mesh, shell)
    assert len(found[kinds.THIN]) > 4
    repair = fix(kinds.THIN, created.light_mesh, shell, np.arange(len(created.light_mesh)))
    after = faults(repair.applied(created.light_mesh), list(repair.applied_to(shell)))
    assert kinds.THIN not in after


def test_sheet_in_the_open_is_told_until_it_has_tags() -> None:
    positions, triangles = grid(4, 4)
    scene = [mesh_of(positions, triangles), mesh_of(4.0 * positions - np.array([1.5, 1.5, 1.0]), triangles)]
    created = create_light_mesh(scene, SimplifySettings(100))
    found = faults(created.light_mesh, scene)
    assert set(found[kinds.TWO_SIDED]) == set(created.light_of_triangle[0].tolist())
    rows = np.array(found[kinds.TWO_SIDED])
    repair = fix(kinds.TWO_SIDED, created.light_mesh, scene, rows, created.light_of_triangle)
    assert faults(repair.applied(created.light_mesh), list(repair.applied_to(scene))) == {}


def test_a_tag_that_a_link_uses_is_not_lost() -> None:
    tagged = changed("tag_ids", 6, 42)
    surface = mesh_of(*grid(1, 1), tags=7)
    assert faults(tagged, [surface]) == {kinds.LOST_TAG: (6,)}
    assert faults(replace(tagged, links=make_links([[42, 7]])), [surface]) == {}


def test_many_bad_lights_give_one_line() -> None:
    light_mesh = create_light_mesh([mesh_of(*grid(60, 60))], SimplifySettings(10_000)).light_mesh
    assert "7,200 lights have a negative color" in only_problem(replace(light_mesh, colour=light_mesh.colour - 1))
