# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that were made together do not count twice, however they lie; copies and others do."""

import numpy as np

from tests.core.surface_shapes import grid, icosphere, mesh_of
from vlm_addon.core.light_marks import UNMARKED, creation_marks, made_together
from vlm_addon.core.light_mesh import join
from vlm_addon.core.light_overlaps import covered_twice
from vlm_addon.core.simplify import SimplifySettings, create_light_mesh

WALL = create_light_mesh([mesh_of(*grid(4, 4), reflectance=0.5)], SimplifySettings(100)).light_mesh
BALL = [mesh_of(*icosphere(3))]


def test_marks_tell_lights_apart_and_creations():
    one, other = creation_marks(WALL), creation_marks(create_light_mesh(BALL, SimplifySettings(50)).light_mesh)
    assert len(np.unique(one)) == len(WALL)
    assert (one != UNMARKED).all()
    assert made_together(one[:1], one[1:]).all()
    assert not made_together(one, one).any()
    assert not made_together(one[:, None], other[None]).any()
    assert not made_together(one, np.full_like(one, UNMARKED)).any()


def test_two_creations_of_one_surface_count_twice_where_one_alone_does_not():
    few, many = (create_light_mesh(BALL, SimplifySettings(count)).light_mesh for count in (100, 300))
    marks = np.concatenate([creation_marks(few), creation_marks(many)])
    found = covered_twice(join([few, many]), marks=marks)
    assert max(found[: len(few)].mean(), found[len(few) :].mean()) > 0.5
    assert not covered_twice(few, marks=creation_marks(few)).any()


def test_copies_of_lights_count_twice():
    marks = creation_marks(WALL)
    found = covered_twice(join([WALL, WALL.subset(np.arange(len(WALL)) < 3)]), marks=np.append(marks, marks[:3]))
    assert np.flatnonzero(found).tolist() == list(range(len(WALL), len(WALL) + 3))


def test_lights_of_one_creation_may_lie_on_each_other():
    """As few lights of many small bodies do."""
    both = join([WALL, WALL])
    marks = creation_marks(both)
    assert covered_twice(both).any()
    assert not covered_twice(both, marks=marks).any()
