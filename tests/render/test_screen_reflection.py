# SPDX-License-Identifier: GPL-3.0-or-later
"""Screen-space reflections against rays traced in float64 through the scene itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.render.mirror_rays import (
    MATERIALS,
    MATT,
    MIRROR,
    SIZE,
    Reflected,
    broken,
    broken_gbuffer,
    mirror_scene,
    mirror_truth,
    reflected,
    upload,
)
from tests.render.rooms import camera_at, quad
from vlm_addon.core import brdf
from vlm_addon.core.scene import ORTHOGRAPHIC, Float64, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.screen_reflection import ReflectionSettings, ScreenReflectionPass

NO_EDGE = ReflectionSettings(edge_fade=0.0)
CAMERAS = {
    "perspective": camera_at((0.2, -4.0, 1.6), (0.0, 0.3, 0.6), lens=30.0),
    "low": camera_at((-0.8, -3.5, 0.5), (0.0, 0.5, 0.5), lens=24.0),
    "high": camera_at((0.5, -2.5, 3.5), (0.0, 0.3, 0.2), lens=24.0),
    "orthographic": camera_at((0.5, -4.0, 2.0), (0.0, 0.3, 0.5), kind=ORTHOGRAPHIC, ortho_scale=4.0),
}


def mirrors(found: Reflected) -> np.ndarray:
    return found.material == MIRROR


def off(found: Reflected, pixels: np.ndarray, place: Float64) -> Float64:
    """(n,) pixels between where it was found and `place`."""
    return np.linalg.norm(found.hits[pixels][:, :2] - place, axis=1)


@pytest.mark.parametrize("jitter", [(0.0, 0.0), (0.4, -0.3)])
@pytest.mark.parametrize("name", CAMERAS)
def test_what_the_picture_shows_is_found_where_it_is(device: Device, name: str, jitter: tuple[float, float]) -> None:
    """Issue 7: 95 % of pixels whose hit is on screen within 2 pixels. A pixel without a hit counts as off."""
    snapshot = mirror_scene(camera=CAMERAS[name])
    found = reflected(device, snapshot, NO_EDGE, jitter=jitter)
    pixels = mirrors(found)
    truth = mirror_truth(snapshot, found, pixels)
    assert truth.on_screen.sum() > 300
    distance = np.where(found.confidence[pixels] > 0.0, off(found, pixels, truth.place), np.inf)
    assert (distance[truth.on_screen] <= 2.0).mean() >= 0.95
    assert np.median(distance[truth.on_screen]) < 0.05
    hit = truth.on_screen & (distance <= 2.0)
    assert np.isclose(found.hits[pixels][hit, 2], truth.distance[hit], rtol=1e-3).mean() > 0.95


@pytest.mark.parametrize("name", CAMERAS)
def test_what_the_picture_does_not_show_fades(device: Device, name: str) -> None:
    """Rays that meet nothing, or what is hidden or beside the picture, bring little: no smear."""
    snapshot = mirror_scene(camera=CAMERAS[name])
    found = reflected(device, snapshot, NO_EDGE)
    pixels = mirrors(found)
    truth = mirror_truth(snapshot, found, pixels)
    wrong = ~truth.on_screen & ~(off(found, pixels, truth.place) <= 2.0)
    assert wrong.sum() > 100
    confidence = found.confidence[pixels][wrong]
    assert confidence.mean() < 0.05
    assert (confidence > 0.5).mean() < 0.05


def energy(device: Device, snapshot: SceneSnapshot) -> tuple[Reflected, np.ndarray]:
    """A picture with light 1 everywhere, and which of its mirrors' pixels have a sure hit."""
    found = reflected(device, snapshot, NO_EDGE)
    sure = mirrors(found) & (found.confidence == 1.0)
    assert sure.sum() > 300
    return found, sure


def test_a_white_mirror_reflects_all_and_a_coloured_one_its_colour_at_least(device: Device) -> None:
    found, sure = energy(device, mirror_scene())
    np.testing.assert_allclose(found.image[sure][:, :3], 1.0, atol=0.01)
    gold = replace(MATERIALS[0], base_color=(0.9, 0.5, 0.1))
    found, sure = energy(device, mirror_scene(mirror=gold))
    cosine = _cosines(found)[sure][:, None]
    expected = np.array(gold.base_color) + (1.0 - np.array(gold.base_color)) * (1.0 - cosine) ** 5
    np.testing.assert_allclose(found.image[sure][:, :3], expected, atol=0.01)


def test_polish_reflects_as_its_interface_does(device: Device) -> None:
    polish = replace(MATERIALS[0], metallic=0.0, ior=1.7, base_color=(0.2, 0.9, 0.4))
    found, sure = energy(device, mirror_scene(mirror=polish))
    expected = brdf.fresnel_dielectric(_cosines(found)[sure], 1.7)
    assert np.ptp(expected) > 0.05
    np.testing.assert_allclose(found.image[sure][:, :3], np.repeat(expected[:, None], 3, 1), rtol=0.02)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5])
def test_white_metal_of_any_roughness_reflects_all_that_it_finds(device: Device, roughness: float) -> None:
    """Light 1 everywhere, light scattered more than once among the facets included."""
    found = reflected(device, mirror_scene(mirror=replace(MATERIALS[0], roughness=roughness)), NO_EDGE)
    sure = mirrors(found) & (found.confidence > 0.5)
    assert sure.sum() > 300
    np.testing.assert_allclose(found.image[sure][:, 0], found.confidence[sure], rtol=0.02)


def test_shared_rays_say_in_two_pictures_what_many_pictures_say(device: Device) -> None:
    rough = mirror_scene(mirror=replace(MATERIALS[0], roughness=0.3))
    lit = np.ones((SIZE[1], SIZE[0], 4), np.float32)
    lit[:, : SIZE[0] // 2] = 0.1
    pictures = [reflected(device, rough, NO_EDGE, lit, sample_index=i).image for i in range(34)]
    mean = np.mean(pictures[2:], axis=0)
    well = mean[..., 3] > 0.9
    assert well.sum() > 300
    error = (0.5 * (pictures[0] + pictures[1]) - mean)[well][:, 0]
    assert np.sqrt(np.mean(error**2)) < 0.13 * mean[well][:, 0].mean()
    assert abs(error.mean()) < 0.02 * mean[well][:, 0].mean()


def test_rays_are_not_shared_with_what_is_on_another_surface(device: Device) -> None:
    """Two rough floors, a step apart in height: what is under the first one's wall does not show in the second."""
    rough = replace(MATERIALS[0], roughness=0.4)
    step = quad((0.0, -3.0, 0.15), (3.0, 0.0, 0.0), (0.0, 5.0, 0.0), material=MIRROR, name="step")
    alone = reflected(device, mirror_scene(step, mirror=rough), NO_EDGE)
    matt = replace(step, material_indices=np.full(2, MATT, np.int32))
    without = reflected(device, mirror_scene(matt, mirror=rough), NO_EDGE)
    shared = (without.material == MIRROR) & (alone.confidence > 0.0)
    assert shared.sum() > 300
    np.testing.assert_allclose(alone.image[shared], without.image[shared], atol=1e-6)


def _cosines(found: Reflected) -> Float64:
    """Of the view to the normal, perspective."""
    camera = CAMERAS["perspective"].matrix_world[:3, 3] - found.position
    return np.einsum("...i,...i->...", camera / np.linalg.norm(camera, axis=2, keepdims=True), found.normal)


def test_light_is_that_of_the_pixel_that_is_hit(device: Device) -> None:
    random = np.random.default_rng(2)
    lit = np.concatenate([random.uniform(0.5, 2.0, (SIZE[1], SIZE[0], 3)), np.ones((SIZE[1], SIZE[0], 1))], axis=2)
    found = reflected(device, mirror_scene(), NO_EDGE, lit.astype(np.float32))
    sure = mirrors(found) & (found.confidence == 1.0)
    column, row = np.floor(found.hits[sure][:, :2]).astype(int).T
    inside = (found.hits[sure][:, :2] % 1.0 > 0.01).all(axis=1)
    np.testing.assert_allclose(found.image[sure][inside, :3], lit[SIZE[1] - 1 - row, column][inside, :3], rtol=0.01)


def test_matt_surfaces_and_the_background_reflect_nothing(device: Device) -> None:
    found = reflected(device, mirror_scene())
    assert not found.image[~mirrors(found)].any()
    assert not found.hits[~mirrors(found)].any()


def test_hits_fade_to_nothing_at_the_edges(device: Device) -> None:
    whole = reflected(device, mirror_scene(), NO_EDGE)
    faded = reflected(device, mirror_scene(), ReflectionSettings(edge_fade=0.25))
    sure = mirrors(whole) & (whole.confidence == 1.0)
    inside = whole.hits[sure][:, :2] / SIZE
    to_edge = np.minimum(inside, 1.0 - inside).min(axis=1)
    np.testing.assert_allclose(faded.confidence[sure], np.minimum(to_edge / 0.25, 1.0), atol=1e-4)
    np.testing.assert_allclose(faded.image[sure][:, 0], faded.confidence[sure], atol=0.01)
    assert (to_edge < 0.1).any()


def test_roughness_fades_between_its_settings(device: Device) -> None:
    settings = replace(NO_EDGE, fade_start=0.2, fade_end=0.4)

    def most(roughness: float, chosen: ReflectionSettings = settings) -> float:
        mirror = replace(MATERIALS[0], roughness=roughness)
        return float(reflected(device, mirror_scene(mirror=mirror), chosen).confidence.max())

    shares = [most(roughness) for roughness in (0.0, 0.15, 0.25, 0.3, 0.35, 0.4, 0.9)]
    assert shares == pytest.approx([1.0, 1.0, 0.84375, 0.5, 0.15625, 0.0, 0.0], abs=1e-3)
    assert most(0.3, replace(settings, fade_end=0.2)) == 0.0
    assert most(0.1, replace(settings, fade_end=0.2)) == 1.0


def test_rays_end_with_their_reach(device: Device) -> None:
    whole = reflected(device, mirror_scene(), NO_EDGE)
    short = reflected(device, mirror_scene(), replace(NO_EDGE, reach=0.2))
    reach = 0.2 * 2048.0 * whole.space.unit
    sure = mirrors(whole) & (whole.confidence == 1.0)
    distance = whole.hits[sure][:, 2]
    expected = np.clip((reach - distance) / (0.1 * reach), 0.0, 1.0)
    assert 0.1 < (expected > 0.0).mean() < 0.9
    np.testing.assert_allclose(short.confidence[sure], expected, atol=2e-3)


def behind_a_board(device: Device, thickness: float) -> tuple[Reflected, np.ndarray]:
    """Rays that rise from the mirror under a board that hangs over it, and come in behind what is seen of it."""
    board = quad((-1.0, -1.0, 0.4), (2.0, 0.0, 0.0), (0.0, 0.0, 1.8), material=MATT, name="board")
    snapshot = mirror_scene(board)
    found = reflected(device, snapshot, replace(NO_EDGE, thickness=thickness))
    pixels = mirrors(found)
    truth = mirror_truth(snapshot, found, pixels)
    hidden = np.zeros(pixels.shape, bool)
    hidden[pixels] = ~truth.on_screen & np.isfinite(truth.distance)
    hidden &= (np.abs(found.position[..., 0]) < 0.9) & (found.position[..., 1] > -1.0)
    assert hidden.sum() > 50
    return found, hidden


def test_thickness_says_what_stops_rays_behind_things(device: Device) -> None:
    thin, hidden = behind_a_board(device, 0.0)
    assert (thin.confidence[hidden] > 0.0).mean() < 0.05
    thick, _ = behind_a_board(device, 0.5)
    shown = thick.confidence[hidden]
    assert (shown > 0.0).mean() > 0.9
    # The farther behind the board a ray comes in, the less.
    depth = thick.position[..., 1][hidden]
    assert np.corrcoef(depth, shown)[0, 1] < -0.9


def test_a_ray_far_behind_a_narrow_thing_goes_on_and_close_behind_a_wide_one_fades(device: Device) -> None:
    """Sideways mirror: rays cross behind a pole and go on to a wall that the picture shows."""
    mirror = quad((-2.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 2.0), material=MIRROR, name="side mirror")
    wall = quad((-3.0, 6.0, -2.0), (6.0, 0.0, 0.0), (0.0, 0.0, 6.0), material=MATT, name="wall")

    def shares(x: float, y: float, width: float) -> np.ndarray:
        pole = quad((x - 0.5 * width, y, -2.0), (width, 0.0, 0.0), (0.0, 0.0, 6.0), material=MATT, name="pole")
        camera = camera_at((0.4, -4.0, 1.0), (-0.6, 0.0, 1.0), lens=30.0)
        snapshot = SceneSnapshot("side", (mirror, wall, pole), MATERIALS, camera=camera)
        found = reflected(device, snapshot, NO_EDGE)
        pixels = mirrors(found)
        truth = mirror_truth(snapshot, found, pixels)
        assert truth.on_screen.sum() > 100
        return found.confidence[pixels][truth.on_screen]

    assert np.median(shares(-0.22, -1.5, 0.1)) == 1.0
    assert np.median(shares(-1.2, 2.2, 0.6)) < 0.7


def test_the_same_input_gives_the_same_bits_and_samples_differ(device: Device) -> None:
    rough = mirror_scene(mirror=replace(MATERIALS[0], roughness=0.4))
    first, again, other = (reflected(device, rough, sample_index=i) for i in (3, 3, 4))
    assert (first.image == again.image).all()
    assert (first.hits == again.hits).all()
    assert (first.image != other.image).any()


def test_nothing_is_seen_in_an_empty_picture(device: Device) -> None:
    away = camera_at((0.0, -4.0, 1.0), (0.0, -8.0, 1.0))
    assert not reflected(device, mirror_scene(camera=away)).image.any()


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_whatever_the_buffers_hold_the_result_is_sound(device: Device, kind: str) -> None:
    """Every texture with a hundredth of its numbers broken."""
    random = np.random.default_rng(7)
    base = reflected(device, mirror_scene(camera=CAMERAS[kind]))
    with device.current() as context:
        gbuffer = broken_gbuffer(context, base.space.local_points(base.position), base.normal, random)
        lit = upload(context, broken(np.ones((SIZE[1], SIZE[0], 4)), random))
        reflection = ScreenReflectionPass(context, device.shaders, *SIZE, ReflectionSettings())
        image = read_image(reflection.render(gbuffer, base.view, lit, 0))  # type: ignore[arg-type]
        hits = read_image(reflection.hits)
    assert np.isfinite(image).all()
    assert (image >= 0.0).all()
    assert (image[..., 3] <= 1.0).all()
    assert np.isfinite(hits).all()
    assert image.any()
