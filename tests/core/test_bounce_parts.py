# SPDX-License-Identifier: GPL-3.0-or-later
"""Which surfaces and lights are chosen, and what is left of a scene without what they bounce."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.light_meshes import random_lights
from tests.render.rooms import box_room, mesh_lights
from vlm_addon.core.array_codec import content_hash
from vlm_addon.core.bounce_parts import DYNAMIC, TAGGED, Choice, reflected, tag_spans, without_bounce
from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.light_mesh import VirtualLightMesh, join, require_valid
from vlm_addon.core.scene import DIFFUSE, Material


@pytest.mark.parametrize(
    ("text", "spans"),
    [("", ()), ("3", ((3, 3),)), (" 3, 5-8 ,9 ", ((3, 3), (5, 8), (9, 9))), ("2 - 4,", ((2, 4),))],
)
def test_tag_ids_are_read_as_people_write_them(text: str, spans: tuple[tuple[int, int], ...]) -> None:
    assert tag_spans(text) == spans


@pytest.mark.parametrize("text", ["0", "8-5", "three", "-1", "1.5", "1;2", "99999999999"])
def test_what_is_no_tag_id_is_named(text: str) -> None:
    with pytest.raises(InvalidInput, match="tag id") as caught:
        tag_spans(f"4, {text}")
    assert repr(text) in str(caught.value)


def test_tagged_triangles_are_black_and_as_opaque_as_they_were() -> None:
    room = box_room()
    curtain = Material("curtain", alpha=0.25, alpha_texture=1, alpha_channel=2, emission=(3.0, 0.0, 0.0), metallic=1.0)
    wall = room.meshes[2]
    half = replace(
        wall,
        tag_ids=np.array([0, 7], np.int32),
        material_indices=np.array([0, 4], np.int32),
        reflectance=np.full((2, 3), 0.5, np.float32),
        emission=np.full((2, 3), 2.0, np.float32),
    )
    meshes = (*room.meshes[:2], half, *room.meshes[3:])
    scene = replace(room, meshes=meshes, materials=(*room.materials, curtain))
    found = without_bounce(scene, Choice(TAGGED, ((6, 7),)))
    assert found.meshes[:2] == meshes[:2]
    assert found.materials[:5] == scene.materials
    got = found.meshes[2]
    assert got.reflectance.tolist() == [[0.5] * 3, [0.0] * 3]
    assert got.emission.tolist() == [[2.0] * 3, [0.0] * 3]
    black = found.materials[got.material_indices[1]]
    assert got.material_indices[0] == 0
    assert (black.model, black.base_color, black.emission) == (DIFFUSE, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert (black.alpha, black.alpha_texture, black.alpha_channel) == (0.25, 1, 2)
    assert half.reflectance.min() > 0.0  # the scene that was given is as before


def test_objects_that_move_are_chosen_whole() -> None:
    room = box_room()
    moving = replace(room.meshes[3], dynamic=True)
    scene = replace(room, meshes=(*room.meshes[:3], moving, *room.meshes[4:]))
    found = without_bounce(scene, Choice(DYNAMIC))
    changed = [index for index, mesh in enumerate(found.meshes) if mesh is not scene.meshes[index]]
    assert changed == [3]
    assert {found.materials[slot].base_color for slot in found.meshes[3].material_indices} == {(0.0, 0.0, 0.0)}


@pytest.mark.parametrize("choice", [Choice(DYNAMIC), Choice(TAGGED), Choice(TAGGED, ((90, 99),))])
def test_where_nothing_is_chosen_the_scene_is_as_it_was(choice: Choice) -> None:
    room = box_room()
    assert without_bounce(room, choice) is room


def rows_of(light_mesh: VirtualLightMesh) -> list[str]:
    """A hash of each light with all that belongs to it, whatever else is in the mesh."""
    samples, corners = light_mesh.samples, light_mesh.corners
    hashes = []
    for row in range(len(light_mesh)):
        part = slice(*samples.offsets[row : row + 2])
        own = [getattr(light_mesh, name)[row] for name in ("colour", "emission", "strength", "tag_ids", "dynamic")]
        points = [samples.positions[part], samples.normals[part], samples.weights[part]]
        hashes.append(content_hash([corners[row], *own, *points]))
    return hashes


def test_a_subset_holds_its_lights_with_all_that_is_theirs() -> None:
    whole = join([random_lights(1), random_lights(2)])
    counts = np.random.default_rng(0).integers(0, 4, len(whole))
    total = int(counts.sum())
    rng = np.random.default_rng(1)
    samples = replace(
        whole.samples,
        positions=rng.normal(size=(total, 3)),
        normals=rng.normal(size=(total, 3)).astype(np.float32),
        weights=rng.uniform(size=total).astype(np.float32),
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
    )
    whole = replace(whole, samples=samples, tag_ids=np.arange(len(whole), dtype=np.int32))
    chosen = rng.uniform(size=len(whole)) < 0.4
    parts = [whole.subset(chosen), whole.subset(~chosen)]
    rows = rows_of(whole)
    for part, mask in zip(parts, (chosen, ~chosen), strict=True):
        require_valid(part)
        assert rows_of(part) == [rows[row] for row in np.flatnonzero(mask)]
        assert len(part.vertices) == len(np.unique(whole.triangles[mask]))
    assert len(whole.subset(np.zeros(len(whole), bool))) == 0


def test_what_surfaces_and_their_lights_reflect_is_their_area_times_what_they_reflect() -> None:
    room = box_room()
    meshes = tuple(replace(mesh, reflectance=np.tile(np.float32([0.2, 0.4, 0.9]), (2, 1))) for mesh in room.meshes)
    scene = replace(room, meshes=(*meshes[:-1], replace(meshes[-1], tag_ids=np.array([5, 6], np.int32))))
    lights = mesh_lights(scene.meshes, colour=0.25)
    found = reflected(scene, lights, Choice(TAGGED, ((6, 6),)))
    assert (found.names, found.triangles, found.all_triangles, found.lights) == (("glow",), 1, 12, 1)
    assert found.of_surfaces == pytest.approx(0.18 * 0.5)
    assert found.of_lights == pytest.approx(0.18 * 0.25)
