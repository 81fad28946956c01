# SPDX-License-Identifier: GPL-3.0-or-later
"""What a stroke needs is read while the mouse rests, so that the stroke finds it; without, it reads by itself."""

from contextlib import ExitStack
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from vlm_addon.blender.drawing import draw_ahead
from vlm_addon.blender.drawing.draw_lights import draw

SQUARE = 0.1 * np.array([(-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0)])
FROM_ABOVE = SimpleNamespace(ray=lambda pixel: (np.array([0.0, 0.0, 5.0]), np.array([0.0, 0.0, -1.0]), 10.0))
PAST_ALL = SimpleNamespace(ray=lambda pixel: (np.array([50.0, 0.0, 5.0]), np.array([0.0, 0.0, -1.0]), 10.0))


@pytest.fixture
def plane(make_plane, make_material):
    material, _ = make_material("Paint", "ShaderNodeBsdfDiffuse")
    plane = make_plane(size=4.0, material=material)
    bpy.context.view_layer.update()
    return plane


def look(view):
    return draw_ahead.look(bpy.context.scene, bpy.context.evaluated_depsgraph_get(), view, np.zeros(2))


def draw_square():
    return draw(bpy.context, SQUARE, [[0, 1, 2, 3]], np.array([[0.0, 0.0, 1.0]]), 0.0)


def test_a_stroke_finds_the_material_that_was_read_ahead(reads, plane):
    for key, slot in look(FROM_ABOVE):
        draw_ahead.read_slot(bpy.context.evaluated_depsgraph_get(), key, slot)
    assert reads == ["Paint"]
    draw_square()
    assert reads == ["Paint"]


def test_a_stroke_before_that_reads_by_itself(reads, plane):
    assert look(FROM_ABOVE) == [((plane.name, None), 0)]
    draw_square()
    assert reads == ["Paint"]


def test_beside_all_surfaces_nothing_is_read(reads, plane):
    assert look(PAST_ALL) == []


def test_what_is_gone_meanwhile_is_left_out(reads, plane):
    ((key, slot),) = look(FROM_ABOVE)
    bpy.data.objects.remove(plane)
    draw_ahead.read_slot(bpy.context.evaluated_depsgraph_get(), key, slot)
    assert reads == []


def test_the_timer_waits_for_the_mouse_and_ends_where_its_view_is_gone(plane):
    with ExitStack() as undo:
        draw_ahead.register(undo)
        draw_ahead.mouse_is_at(SimpleNamespace(area=SimpleNamespace(as_pointer=lambda: 1)), 3.0, 4.0)
        assert bpy.app.timers.is_registered(draw_ahead._tick)
        assert draw_ahead._tick() > 0.0
        draw_ahead._AHEAD.heard -= 1.0
        assert draw_ahead._tick() is None
    assert not bpy.app.timers.is_registered(draw_ahead._tick)
