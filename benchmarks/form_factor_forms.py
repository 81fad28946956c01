# SPDX-License-Identifier: GPL-3.0-or-later
"""The forms that are compared: ours from `gpu_shaders/lib`, the rivals from `benchmarks/rivals`, all called alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.render.shader_functions import evaluate
from vlm_addon.core.scene import Float32, Float64
from vlm_addon.render.device import Device

_ROWS_PER_CALL = 1 << 18
_ARGUMENTS = "p, n, v0, v1, v2, area_vector, bounding_radius"


@dataclass(frozen=True)
class Form:
    """A GLSL function with the parameters of `triangle_form_factor`; path from `gpu_shaders/`."""

    name: str
    path: str
    function: str


OURS, RATIONAL_FIT = "ours", "rational fit"
FORMS = (
    Form(OURS, "lib/form_factor.glsl", "triangle_form_factor"),
    Form(RATIONAL_FIT, "../benchmarks/rivals/rational_fit.glsl", "rational_fit_form_factor"),
    Form("printed formula", "../benchmarks/rivals/printed.glsl", "printed_form_factor"),
    Form("clipless sphere", "../benchmarks/rivals/clipless_sphere.glsl", "clipless_sphere_form_factor"),
)


def stored_with(triangles: Float64) -> tuple[Float64, Float64]:
    """Vector areas (n, 3), m², and bounding radii (n,), m: what a virtual light is stored with."""
    sides = triangles[:, 1:] - triangles[:, :1]
    centroids = triangles.mean(axis=1, keepdims=True)
    radii = np.sqrt(((triangles - centroids) ** 2).sum(axis=2).max(axis=1))
    return 0.5 * np.cross(sides[:, 0], sides[:, 1]), radii


def evaluate_forms(device: Device, points: Float64, normals: Float64, triangles: Float64) -> Float32:
    """(n, len(FORMS)) form factors of n points (n, 3) with unit normals (n, 3) under triangles (n, 3, 3)."""
    calls = ", ".join(f"{form.function}({_ARGUMENTS})" for form in FORMS)
    results = []
    for start in range(0, len(points), _ROWS_PER_CALL):
        rows = slice(start, start + _ROWS_PER_CALL)
        area_vectors, radii = stored_with(triangles[rows])
        inputs = {"p": points[rows], "n": normals[rows]}
        inputs |= {f"v{i}": triangles[rows, i] for i in range(3)}
        inputs |= {"area_vector": area_vectors, "bounding_radius": radii}
        paths = [form.path for form in FORMS]
        results.append(evaluate(device, paths, f"vec{len(FORMS)}({calls})", inputs, len(FORMS)))
    return np.concatenate(results)
