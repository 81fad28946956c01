# SPDX-License-Identifier: GPL-3.0-or-later
"""`lib/gbuffer.glsl`: what is packed comes back from its own place."""

from __future__ import annotations

import numpy as np
import pytest

from tests.render.shader_functions import evaluate
from vlm_addon.render.device import Device

FILE = "lib/gbuffer.glsl"
UNPACKED = "unpack_surface(position, shading, geometric, base, emission, ivec4(a, b, c, d))"


def values(*row: float) -> np.ndarray:
    return np.array([row], np.float32)


PACKED = {
    "position": values(1, 2, 3, 4),
    "shading": values(5, 6, 7, 8),
    "geometric": values(9, 10, 11, 12),
    "base": values(13, 14, 15, 16),
    "emission": values(17, 18, 1e6, 20),
    **{name: np.array([value], np.int32) for name, value in zip("abcd", (21, -1, 2**24 + 1, 1), strict=True)},
}
VECTORS = {
    "position": (1, 2, 3),
    "shading_normal": (5, 6, 7),
    "geometric_normal": (9, 10, 11),
    "base_color": (13, 14, 15),
    "emission": (17, 18, 1e6),
}
NUMBERS = {"depth": 4, "roughness": 8, "metallic": 12, "specular_ior_level": 16, "ior": 20}
IDS = {"material": 21, "tag_id": -1, "face_id": 2**24 + 1, "model": 1}


def test_every_field_comes_from_its_own_channel(device: Device) -> None:
    for name, expected in VECTORS.items():
        assert evaluate(device, FILE, f"{UNPACKED}.{name}", PACKED, 3).tolist() == [list(expected)], name
    for name, number in NUMBERS.items():
        assert evaluate(device, FILE, f"{UNPACKED}.{name}", PACKED).tolist() == [number], name
    for name, number in IDS.items():
        # Ids are whole 32 bits: float32 would lose the last.
        same = evaluate(device, FILE, f"{UNPACKED}.{name} == {number} ? 1.0 : 0.0", PACKED)
        assert same.tolist() == [1.0], name


def test_only_unit_normals_show_geometry(device: Device) -> None:
    random = np.random.default_rng(3).normal(size=(1000, 3))
    unit = random / np.linalg.norm(random, axis=1, keepdims=True)
    assert evaluate(device, FILE, "shows_geometry(n) ? 1.0 : 0.0", {"n": unit}).all()
    nothing = np.array([[0, 0, 0], [-0.0, 0, 0], [1e-30, 0, 0]])
    assert not evaluate(device, FILE, "shows_geometry(n) ? 1.0 : 0.0", {"n": nothing}).any()


@pytest.mark.parametrize(("near", "far"), [(0.002, 2048.0), (0.1, 1000.0), (1e-6, 1e6), (1.0, 1.001)])
def test_balanced_depth_grows_from_0_to_1(device: Device, near: float, far: float) -> None:
    distances = np.geomspace(near, far, 4001).astype(np.float32).astype(float)
    inverse = (1.0 / distances).astype(np.float32)
    limits = {"near": np.full(4001, near), "far": np.full(4001, far)}
    found = evaluate(device, FILE, "balanced_depth(v, near, far)", {"v": inverse} | limits).astype(float)
    middle = np.sqrt(near * far)
    expected = (distances - near) / (distances + middle) * (far + middle) / (far - near)
    np.testing.assert_allclose(found, expected, atol=4 * 2.0**-24 * far / (far - near))
    assert (np.diff(found) >= 0.0).all()
    assert found[0] == pytest.approx(0.0, abs=1e-6 * far / (far - near))
    assert found[-1] == pytest.approx(1.0, abs=1e-6 * far / (far - near))
