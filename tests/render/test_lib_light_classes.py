# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/light_classes.glsl`: classes that hold for every point of a group, and forms that agree with the general one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import FLOAT32_ABSOLUTE, single, unit
from tests.render.point_groups import GROUP, PREAMBLE, group_inputs
from tests.render.shader_functions import evaluate
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.render.device import Device

PATH = "lib/light_classes.glsl"
COUNT = 4000
POINTS = 40
NOTHING, FAR, WHOLE, CLIPPED = range(4)
FAR_RADII = 16.0

Array = np.ndarray


def lights(random: np.random.Generator) -> dict[str, Array]:
    """Triangles with what is stored of them, by argument name."""
    size = 10.0 ** random.uniform(-2.0, 0.5, (COUNT, 1, 1))
    corners = single(random.uniform(-3.0, 3.0, (COUNT, 1, 3)) + size * random.normal(size=(COUNT, 3, 3)))
    area_vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    radii = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    return {"a": corners[:, 0], "b": corners[:, 1], "c": corners[:, 2], "v": area_vectors, "r": radii}


def corners_of(stored: dict[str, Array]) -> Array:
    return np.stack([stored[name] for name in "abc"], axis=1)


@pytest.mark.parametrize("spread", [0.0, 0.1, 1.0, 3.0])
@pytest.mark.parametrize("extent", [0.0, 0.05, 1.0])
def test_class_holds_for_every_point_of_the_group(device: Device, extent: float, spread: float) -> None:
    random = np.random.default_rng(int(100 * extent + 10 * spread))
    stored = lights(random)
    points = single(random.uniform(-1, 1, (COUNT, 1, 3)) + extent * random.uniform(-1, 1, (COUNT, POINTS, 3)))
    normals = single(unit(unit(random.normal(size=(COUNT, 1, 3))) + spread * random.normal(size=(COUNT, POINTS, 3))))
    inputs = {**group_inputs(points, normals), **stored}
    call = f"float(light_class({GROUP}, a, b, c, v, r))"
    classes = evaluate(device, PATH, call, inputs, preamble=PREAMBLE).astype(int)
    corners = corners_of(stored)
    heights = np.einsum("npkc,npc->npk", corners[:, None] - points[:, :, None], normals)
    distances = np.linalg.norm(corners.mean(axis=1)[:, None] - points, axis=-1) / stored["r"][:, None]
    slack = 1e-5
    rows = np.repeat(np.arange(COUNT), POINTS)
    factors = paired_form_factor(points.reshape(-1, 3), normals.reshape(-1, 3), corners[rows]).reshape(COUNT, POINTS)
    assert factors[classes == NOTHING].max(initial=0.0) <= slack
    above = np.isin(classes, (FAR, WHOLE))
    assert heights[above].min(initial=0.0) >= -slack
    assert distances[classes == FAR].min(initial=np.inf) >= FAR_RADII * (1.0 - slack)
    # Tight groups are told apart: a classification that calls everything clipped would be right, too.
    if extent == 0.0 and spread == 0.0:
        assert set(classes) == {NOTHING, FAR, WHOLE, CLIPPED}
        assert (factors[np.isin(classes, (FAR, WHOLE))] > 0.0).mean() > 0.99


def single_points(nearest: float, farthest: float) -> tuple[dict[str, Array], Array]:
    """Points at so many radii from lights that are wholly above their horizon, and the oracle's form factors."""
    random = np.random.default_rng(int(nearest))
    stored = lights(random)
    corners = corners_of(stored)
    distances = stored["r"][:, None] * random.uniform(nearest, farthest, (COUNT, 1))
    points = single(corners.mean(axis=1) + distances * unit(random.normal(size=(COUNT, 3))))
    normals = single(unit(corners.mean(axis=1) - points + 0.3 * distances * unit(random.normal(size=(COUNT, 3)))))
    keep = (np.einsum("nkc,nc->nk", corners - points[:, None], normals) > 0.0).all(axis=1)
    assert keep.sum() > COUNT // 10
    inputs = {"p": points, "n": normals, **stored}
    return {name: values[keep] for name, values in inputs.items()}, paired_form_factor(points, normals, corners)[keep]


def test_far_form_factor(device: Device) -> None:
    inputs, exact = single_points(FAR_RADII, 200.0)
    values = evaluate(device, PATH, "far_form_factor(p, n, a, b, c, v)", inputs)
    np.testing.assert_allclose(values, exact, rtol=1e-3, atol=2e-7)
    general = evaluate(device, PATH, "triangle_form_factor(p, n, a, b, c, v, r)", inputs)
    np.testing.assert_allclose(values, general, rtol=1e-3, atol=2e-7)


def test_far_form_factor_a_million_radii_away(device: Device) -> None:
    inputs, exact = single_points(100.0, 1e6)
    values = evaluate(device, PATH, "far_form_factor(p, n, a, b, c, v)", inputs)
    squared = ((inputs["a"] - inputs["p"]) ** 2).sum(axis=1)
    squarely_seen = np.linalg.norm(inputs["v"], axis=1) / (np.pi * squared)
    assert (np.abs(values - exact) <= 1e-4 * exact + 2.0**-21 * squarely_seen).all()


def test_whole_form_factor(device: Device) -> None:
    inputs, exact = single_points(0.5, FAR_RADII)
    values = evaluate(device, PATH, "whole_form_factor(p, n, a, b, c, v, r)", inputs)
    np.testing.assert_allclose(values, exact, rtol=0.0, atol=FLOAT32_ABSOLUTE)
