# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/form_factor.glsl` for whole triangles, and the oracle on the same float32 numbers."""

from __future__ import annotations

import numpy as np

from tests.form_factor_cases import single, unit
from tests.render.shader_functions import evaluate
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.render.device import Device

PATH = "lib/form_factor.glsl"
COUNT = 2000
PI = np.pi

Array = np.ndarray


def shader(device: Device, points: Array, normals: Array, triangles: Array) -> Array:
    triangles = np.broadcast_to(triangles, (len(points), 3, 3))
    corners = single(triangles)
    area_vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inputs = {"p": points, "n": normals, "a": corners[:, 0], "b": corners[:, 1], "c": corners[:, 2], "v": area_vectors}
    return evaluate(device, PATH, "triangle_form_factor(p, n, a, b, c, v)", inputs)


def oracle(points: Array, normals: Array, triangles: Array) -> Array:
    return paired_form_factor(single(points), single(normals), np.broadcast_to(single(triangles), (len(points), 3, 3)))


def random_case(distance: float) -> tuple[Array, Array, Array]:
    random = np.random.default_rng(int(10 * distance))
    triangles = unit(random.normal(size=(COUNT, 3, 3)))
    points = distance * unit(random.normal(size=(COUNT, 3)))
    return points, unit(random.normal(size=(COUNT, 3))), triangles
