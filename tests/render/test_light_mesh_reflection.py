# SPDX-License-Identifier: GPL-3.0-or-later
"""Specular reflection of virtual lights against the integral of the BRDF over them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.form_factor_cases import room
from tests.render.glossy_pixels import GlossyPixels, brute_force, lobe_samples, reflection
from tests.render.pixels import random_lights
from tests.render.rooms import camera_at, lights_from_triangles
from vlm_addon.core.errors import Cancelled
from vlm_addon.core.light_mesh import empty_light_mesh
from vlm_addon.core.scene import ORTHOGRAPHIC, Float64
from vlm_addon.render.device import Device
from vlm_addon.render.passes import phase_two

SIZE = (12, 8)


def relative_rmse(found: Float64, truth: Float64) -> float:
    return float(np.sqrt(((found - truth) ** 2).mean() / (truth**2).mean()))


@pytest.mark.parametrize("metallic", [1, 0], ids=["metal", "dielectric"])
@pytest.mark.parametrize("roughness", [0.3, 0.5, 1.0])
def test_small_lights_are_reflected_by_the_lobe_itself(device: Device, roughness: float, metallic: int) -> None:
    """Far smaller than the lobe and than their distance, of eyes 3 degrees and more over the surface."""
    generator = np.random.default_rng(3)
    pixels, lights = GlossyPixels(generator, SIZE, roughness, metallic), random_lights(generator, 40, 0.01, 2.0)
    pixels.shown &= (pixels.normals * pixels.to_eye()).sum(-1) > 0.05
    away = np.linalg.norm(lights.corners.mean(axis=1) - pixels.positions[..., None, :], axis=-1).min(axis=-1)
    pixels.shown &= away > 0.3
    assert pixels.shown.sum() > 20
    radiosity = generator.uniform(0.0, 10.0, (40, 3)).astype(np.float32)
    truth = brute_force(pixels, lights, radiosity, 3)
    found = reflection(device, pixels, lights, radiosity)[..., :3]
    assert relative_rmse(found, truth) < 0.01


@pytest.mark.parametrize(("roughness", "most"), [(0.1, 0.02), (0.3, 0.08), (0.6, 0.06), (1.0, 0.03)])
def test_a_wall_of_light_over_a_floor(device: Device, roughness: float, most: float) -> None:
    """Two triangles, which the floor meets, seen from 10 to 60 degrees over it: by the fit, horizon and all."""
    pixels = GlossyPixels(np.random.default_rng(11), (10, 8), roughness)
    pixels.shown[:] = True
    x, y = np.meshgrid(np.linspace(-0.8, 0.8, 10), np.linspace(-1.5, 0.8, 8))
    pixels.positions[:] = np.stack([x, y, np.zeros_like(x)], axis=-1)
    pixels.normals[:], pixels.color[:], pixels.tag_ids[:] = (0.0, 0.0, 1.0), 1.0, 0
    pixels.camera = camera_at((0.0, -2.5, 1.2), (0.0, 0.0, 0.0))
    corners = np.array([[-1.0, 1.0, -0.3], [1.0, 1.0, -0.3], [1.0, 1.2, 1.5], [-1.0, 1.2, 1.5]], np.float32)
    lights = lights_from_triangles(corners[[[0, 1, 2], [0, 2, 3]]])
    radiosity = np.array([[1.0, 2.0, 3.0], [3.0, 1.0, 2.0]], np.float32)
    truth = lobe_samples(pixels, lights, radiosity)
    assert relative_rmse(reflection(device, pixels, lights, radiosity)[..., :3], truth) < most


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.7])
def test_how_a_tile_sorts_its_lights_does_not_show(device: Device, roughness: float) -> None:
    """A floor in its order, whose tiles find simple ways for most lights and none for some, against the same points in
    disorder, whose tiles can tell nothing."""
    generator = np.random.default_rng(13)
    side, count = 48, 300
    pixels, lights = GlossyPixels(generator, (side, side), roughness), random_lights(generator, count, 0.05, 1.5)
    lights.vertices[:, 2] += 1.2
    pixels.shown[:], pixels.color[:] = True, 1.0
    x, y = np.meshgrid(np.linspace(-0.8, 0.8, side), np.linspace(-1.2, 1.2, side))
    pixels.positions[:] = np.stack([x, y, np.zeros_like(x)], axis=-1)
    pixels.normals[:], pixels.tag_ids[:] = (0.0, 0.0, 1.0), 0
    pixels.camera = camera_at((0.0, -2.5, 1.2), (0.0, 0.0, 0.0))
    radiosity = generator.uniform(0.0, 10.0, (count, 3)).astype(np.float32)
    ordered = reflection(device, pixels, lights, radiosity).reshape(-1, 4)
    order = generator.permutation(side * side)
    pixels.positions = pixels.positions.reshape(-1, 3)[order].reshape(side, side, 3)
    disordered = np.empty_like(ordered)
    disordered[order] = reflection(device, pixels, lights, radiosity).reshape(-1, 4)
    assert np.abs(ordered - disordered).max() < 2e-3 * ordered.max()
    assert np.abs(ordered - disordered).mean() < 1e-3 * ordered.mean()


@pytest.mark.parametrize("roughness", [0.05, 0.2, 0.5, 1.0])
def test_a_closed_room_of_white_light_is_seen_whole_in_white_metal(device: Device, roughness: float) -> None:
    """All of the lobe ends on lights of radiance 1, however many: what comes back is the gain times the albedo, 1."""
    pixels = GlossyPixels(np.random.default_rng(12), SIZE, roughness)
    pixels.positions[:] = 0.5 + 0.3 * pixels.positions
    pixels.color[:], pixels.tag_ids[:] = 1.0, 0
    pixels.camera = camera_at((0.55, 0.4, 0.9), (0.5, 0.5, 0.1))
    pixels.normals *= np.sign((pixels.normals * pixels.to_eye()).sum(-1, keepdims=True)).astype(np.float32)
    for side, most in ((1, 0.05), (4, 0.1)):
        lights = lights_from_triangles(room(side).astype(np.float32))
        found = reflection(device, pixels, lights, np.full((len(lights), 3), np.pi, np.float32))[pixels.shown, :3]
        assert np.abs(found - 1.0).mean() < most
        assert found.mean() == pytest.approx(1.0, abs=0.03)


def test_surfaces_without_a_specular_layer_and_pixels_without_surface_stay_zero(device: Device) -> None:
    generator = np.random.default_rng(4)
    pixels, lights = GlossyPixels(generator, SIZE), random_lights(generator, 20, 0.5)
    radiosity = np.ones((20, 3), np.float32)
    found = reflection(device, pixels, lights, radiosity)
    assert (found[~pixels.shown] == 0.0).all()
    assert (found[..., 3] == 0.0).all()
    assert (found[pixels.shown][:, :3].max(axis=0) > 0.0).all()
    pixels.model = "DIFFUSE"
    assert (reflection(device, pixels, lights, radiosity) == 0.0).all()


def test_a_layer_of_the_index_of_air_reflects_nothing(device: Device) -> None:
    generator = np.random.default_rng(5)
    pixels, lights = GlossyPixels(generator, SIZE, 0.4, 0), random_lights(generator, 20, 0.5)
    pixels.ior = 1.0
    assert (reflection(device, pixels, lights, np.ones((20, 3), np.float32)) == 0.0).all()


def test_a_tag_leaves_out_its_own_surfaces_and_no_others(device: Device) -> None:
    generator = np.random.default_rng(6)
    pixels = GlossyPixels(generator, SIZE, 1.0)
    pixels.normals[:], pixels.positions[..., 2] = (0.0, 0.0, 1.0), 0.0
    pixels.camera = camera_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0))
    for tag_id in range(3):
        lights = random_lights(generator, 1, 0.1)
        lights.vertices[:] = [[-1.0, -1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]]
        lights.tag_ids[:] = tag_id
        found = reflection(device, pixels, lights, np.ones((1, 3), np.float32))[..., :3].sum(-1)
        excluded = (pixels.tag_ids == tag_id) & (tag_id != 0)
        assert (found[excluded & pixels.shown] == 0.0).all()
        assert (found[~excluded & pixels.shown] > 0.0).all()


@pytest.mark.parametrize("roughness", [0.0, 1e-3, 0.05, 0.5, 1.0])
def test_nothing_is_ever_negative_or_not_a_number(device: Device, roughness: float) -> None:
    """Eyes at every height down to the horizon and below it, lights that touch, cut and hold the point."""
    generator = np.random.default_rng(7)
    pixels = GlossyPixels(generator, (20, 16), roughness)
    pixels.shown[:] = True
    eyes = pixels.to_eye()
    across = np.cross(eyes, [0.3, 0.5, 0.7])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    heights = np.resize([1.0, 0.5, 1e-2, 1e-4, 1e-7, 0.0, -1e-7, -0.5], pixels.shown.shape)[..., None]
    pixels.normals = (heights * eyes + np.sqrt(1.0 - heights**2) * across).astype(np.float32)
    lights = random_lights(generator, 200, 0.5)
    corners = lights.vertices.reshape(-1, 3, 3)
    places = pixels.positions.reshape(-1, 3)
    corners[:20, 0] = places[:20]
    corners[20:40] -= corners[20:40].mean(axis=1, keepdims=True) - places[20:40, None]
    corners[40:50, 2] = corners[40:50, 1]
    corners[50:60] *= 1e4
    found = reflection(device, pixels, lights, np.full((200, 3), 1e4, np.float32))
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()
    assert (found[(heights < 0.0)[..., 0]] == 0.0).all()
    # Nothing is brighter than what it shows, but for gains of multiple scattering and lights that lie in one another.
    assert found.max() < 200 * 1e4


def test_no_lights_give_no_light(device: Device) -> None:
    pixels = GlossyPixels(np.random.default_rng(8), SIZE)
    assert (reflection(device, pixels, empty_light_mesh(), np.zeros((0, 3), np.float32)) == 0.0).all()


def test_an_orthographic_eye_sees_all_from_one_direction(device: Device) -> None:
    generator = np.random.default_rng(9)
    pixels, lights = GlossyPixels(generator, SIZE, 0.4), random_lights(generator, 30, 0.3)
    radiosity = np.ones((30, 3), np.float32)
    far = camera_at((4e4, -3e4, 3e5), (0.0, 0.0, 0.0), clip_end=1e6)
    pixels.camera = far
    pixels.normals *= np.sign((pixels.normals * pixels.to_eye()).sum(-1, keepdims=True)).astype(np.float32)
    expected = reflection(device, pixels, lights, radiosity)
    pixels.camera = camera_at((0.4, -0.3, 3.0), (0.0, 0.0, 0.0), kind=ORTHOGRAPHIC)
    assert reflection(device, pixels, lights, radiosity) == pytest.approx(expected, rel=1e-3, abs=1e-4 * expected.max())


def test_the_split_into_dispatches_does_not_show_and_can_be_cancelled(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    generator = np.random.default_rng(10)
    count = phase_two.MIN_LIGHTS_PER_DISPATCH * 2 + 7
    pixels, lights = GlossyPixels(generator, SIZE), random_lights(generator, count, 0.2)
    radiosity = generator.uniform(0.0, 10.0, (count, 3)).astype(np.float32)
    whole = reflection(device, pixels, lights, radiosity)
    monkeypatch.setattr(phase_two, "EVALUATIONS_PER_DISPATCH", 1)
    calls: list[float] = []
    split = reflection(device, pixels, lights, radiosity, lambda done, label: calls.append(done) is None)
    assert len(calls) == 3
    assert calls[-1] == 1.0
    assert split == pytest.approx(whole, rel=1e-5, abs=1e-6)
    with pytest.raises(Cancelled):
        reflection(device, pixels, lights, radiosity, lambda done, label: done > 0.5)
