# SPDX-License-Identifier: GPL-3.0-or-later
"""Energy of the reflective shadow maps in the sample scene empty_room: one bounce in a closed form.

What a triangle receives of a point lamp is its intensity times the solid angle it fills. In a closed convex room all
that the walls reflect of it falls on the walls again, whatever their shape.
"""

from pathlib import Path

import bpy
import numpy as np
import pytest

from tests.render.gathering import gathered
from vlm_addon.blender.extraction.extract import extract_scene
from vlm_addon.core.surface_points import random_surface_points
from vlm_addon.render.device import Device

EMPTY_ROOM = Path(__file__).resolve().parents[2] / "sample_blends" / "empty_room.blend"


def solid_angle(corners):
    """Of triangles (t, 3, 3) seen from the origin, sr (Van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    triple = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
    dots = [np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (a, c), (b, c))]
    return 2.0 * np.arctan2(triple, la * lb * lc + dots[0] * lc + dots[1] * lb + dots[2] * la)


def test_mean_irradiance_of_the_walls_is_within_3_percent_of_one_bounce():
    bpy.ops.wm.open_mainfile(filepath=str(EMPTY_ROOM))
    snapshot = extract_scene()
    (lamp,) = snapshot.lights
    reflected, area = np.zeros(3), 0.0
    for mesh in snapshot.meshes:
        corners = mesh.positions[mesh.triangles] - lamp.position
        received = np.array(lamp.power) / (4.0 * np.pi) * solid_angle(corners)[:, None]
        reflected += (mesh.reflectance * received).sum(axis=0)
        edges = corners[:, 1:] - corners[:, :1]
        area += 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum()
    points = random_surface_points(snapshot.meshes, 4096)
    with Device() as device:
        found = gathered(device, snapshot, points.positions, points.normals, 2000)[:, :3].mean(axis=0)
    assert found == pytest.approx(reflected / area, rel=0.03)
