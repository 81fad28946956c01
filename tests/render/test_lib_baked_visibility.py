# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions of lib/baked_visibility.glsl against core/baked_visibility.py."""

from __future__ import annotations

import numpy as np

from tests.render.shader_functions import evaluate
from vlm_addon.core.baked_visibility import GRAZING, WEIGHT_STEPS, sample_numbers
from vlm_addon.render.device import Device
from vlm_addon.render.passes.bake_visibility import BAKED_DEFINES

PATH = "lib/baked_visibility.glsl"


def ask(device: Device, expression: str, inputs: dict[str, np.ndarray], components: int = 1) -> np.ndarray:
    return evaluate(device, PATH, expression, inputs, components, defines=BAKED_DEFINES)


def test_an_entry_is_taken_apart(device: Device) -> None:
    rows = np.array([0, 1, 77, (1 << 20) - 1])
    corners, ways = np.array([0, 3, 5, 7]), np.array([0, 5, 2, 3])
    entries = (rows << 6 | corners << 3 | ways).astype(np.int32)
    assert (ask(device, "float(baked_row(uint(entry)))", {"entry": entries}) == rows).all()
    fraction = np.random.default_rng(0).random((4, 3))
    near = ask(device, "baked_nearness(uint(entry), fraction)", {"entry": entries, "fraction": fraction})
    bits = corners[:, None] >> np.arange(3) & 1
    assert np.allclose(near, np.where(bits == 1, fraction, 1.0 - fraction).prod(axis=1), atol=1e-6)
    normals = np.array([[0.6, 0.8, 0.0], [0.0, 0.6, -0.8], [0.6, 0.8, 0.0], [0.6, 0.8, 0.0]])
    facing = ask(device, "baked_facing(uint(entry), normal)", {"entry": entries, "normal": normals})
    assert np.allclose(facing, [0.36, 0.64, 0.64, 0.0], atol=1e-6)


def test_weights_of_all_neighbours_and_ways_add_up_to_one(device: Device) -> None:
    generator = np.random.default_rng(1)
    normals = generator.normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inputs = {"fraction": generator.random((50, 3)), "normal": normals}
    total = np.zeros(50)
    for corner in range(8):
        for way in range(6):
            entry = f"{corner << 3 | way}u"
            total += ask(device, f"baked_nearness({entry}, fraction) * baked_facing({entry}, normal)", inputs)
    assert np.allclose(total, 1.0, atol=1e-5)


def test_rows_and_weights_come_back_from_a_word(device: Device) -> None:
    rows = np.array([0, 1, 77, 12345, (1 << 20) - 1], np.int32)
    weights = np.array([1.0, 0.5, 0.25, 1.0 / WEIGHT_STEPS, 0.2])
    inputs = {"from": rows, "weight": weights}
    word = "uvec4(packed_baked_row(uint(from), weight))"
    assert (ask(device, f"float(rows_of_packed({word}).y)", inputs) == rows).all()
    assert (ask(device, f"weights_of_packed({word}).z", inputs) == np.rint(weights * WEIGHT_STEPS)).all()
    assert ask(device, "float(packed_baked_row(5u, weight))", {"weight": np.array([1e-5])})[0] == 0.0


def test_a_byte_for_each_light_of_a_word(device: Device) -> None:
    lights = np.arange(8, dtype=np.int32)
    found = ask(device, "bytes_of_words(uvec4(0xff017f00u), uint(light))", {"light": lights}, 4)
    assert (found == np.array([0.0, 127.0, 1.0, 255.0] * 2)[:, None]).all()


def test_samples_are_those_of_the_oracle(device: Device) -> None:
    generator = np.random.default_rng(2)
    rows, points, counts = (generator.integers(0, most, 200).astype(np.int32) for most in (1 << 20, 32, 257))
    inputs = {"from": rows, "point": points, "count": counts + 1}
    found = ask(device, "float(baked_sample(uint(from), uint(point), uint(count)))", inputs)
    assert (found == sample_numbers(rows.astype(np.int64), points, counts + 1)).all()


def test_surfaces_in_one_plane_do_not_face_each_other(device: Device) -> None:
    up, down = [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]
    cases = [
        ([3.0, 0.0, 1.0], up, down, True),
        ([3.0, 0.0, -1.0], up, down, False),
        ([3.0, 0.0, 1.0], up, up, False),
        ([3.0, 0.0, 3.0 * 0.9 * GRAZING], up, down, False),
        ([3.0, 0.0, 3.0 * 1.1 * GRAZING], up, down, True),
        ([0.0, 0.0, 0.9 * GRAZING], up, down, False),
    ]
    way, normal, other, expected = (np.array(column) for column in zip(*cases, strict=True))
    inputs = {"way": way, "normal": normal, "other": other}
    assert ((ask(device, "float(surfaces_face(way, normal, other))", inputs) > 0.5) == expected).all()
