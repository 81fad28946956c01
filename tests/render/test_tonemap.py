# SPDX-License-Identifier: GPL-3.0-or-later
"""The local tone mapping operator against numpy, closed forms, and what no picture may show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.render.rooms import box_room
from tests.render.shader_functions import evaluate
from vlm_addon.core.scene import Float32, Float64
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.tonemap import (
    EDGE_VARIANCE,
    KEY,
    MOST_SPREAD,
    RADIUS_SHARE,
    REACH,
    WHITE,
    ToneMapPass,
)

FILE = "lib/tonemap.glsl"
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def curve(luminance: Float64) -> Float64:
    x = np.minimum(luminance, WHITE)
    return x * (1.0 + x / WHITE**2) / (1.0 + x)


MIDDLE = float(curve(np.array(KEY)))
"""What the mean of a picture becomes."""


def shown(device: Device, picture: np.ndarray) -> Float32:
    """(h, w, 4) of (h, w, 3 or 4) linear Rec.709."""
    height, width = picture.shape[:2]
    values = np.ones((height, width, 4), np.float32)
    values[..., : picture.shape[2]] = picture
    with device.current() as context:
        texture = context.texture((width, height), 4, values[::-1].tobytes(), dtype="f4")
        return read_image(ToneMapPass(context, device.shaders, width, height).render(texture))


def random_picture(size: tuple[int, int], seed: int = 0, stops: float = 6.0) -> Float32:
    """Patches and noise over `stops` to both sides of 1, every tenth pixel black."""
    generator = np.random.default_rng(seed)
    height, width = size[1], size[0]
    patches = generator.uniform(-stops, stops, (height // 16 + 1, width // 16 + 1))
    level = patches.repeat(16, 0).repeat(16, 1)[:height, :width] + generator.normal(0.0, 0.5, (height, width))
    colors = generator.random((height, width, 3)) + 0.05
    colors[generator.random((height, width)) < 0.1] = 0.0
    return (colors * 2.0 ** level[..., None]).astype(np.float32)


def box_sums(image: Float64, radius: int) -> Float64:
    for axis in range(2):
        count = image.shape[axis]
        total = np.concatenate([np.zeros_like(image.take([0], axis)), image.cumsum(axis)], axis)
        low, high = (np.clip(np.arange(count) + end, 0, count) for end in (-radius, radius + 1))
        image = total.take(high, axis) - total.take(low, axis)
    return image


def oracle(picture: np.ndarray) -> Float64:
    """(h, w, 3) by the definition, in float64."""
    color = np.maximum(picture[..., :3].astype(float), 0.0)
    luminance = color @ LUMINANCE
    lit = luminance > 0.0
    radius = max(round(RADIUS_SHARE * max(picture.shape[:2])), 1)
    stops = np.log2(np.where(lit, luminance, 1.0))
    stops = np.where(lit, stops - stops[lit].mean(), 0.0)
    cut = np.clip(stops, -REACH, REACH)
    count = np.maximum(box_sums(lit.astype(float), radius), 1.0)
    mean = box_sums(cut, radius) / count
    slope = 1.0 - 1.0 / (1.0 + (box_sums(cut**2, radius) / count - mean**2) / EDGE_VARIANCE)
    base = box_sums(lit * slope, radius) / count * cut + box_sums(lit * (1.0 - slope) * mean, radius) / count
    contrast = min(1.0, MOST_SPREAD / base[lit].std())
    bright = np.where(lit, curve(KEY * 2.0 ** (stops - (1.0 - contrast) * base)), 0.0)[..., None]
    mapped = color * bright / np.where(lit, luminance, 1.0)[..., None]
    largest = mapped.max(axis=2, keepdims=True)
    grey = np.where(largest > 1.0, (1.0 - bright) / np.where(largest > 1.0, largest - bright, 1.0), 1.0)
    return bright + (mapped - bright) * grey


@pytest.mark.parametrize("size", [(96, 64), (61, 90), (200, 7), (16, 16)])
def test_operator_is_its_definition(device: Device, size: tuple[int, int]) -> None:
    """Also with a negative channel where another is too bright for the display."""
    picture = random_picture(size)
    picture[3, 5] = (-0.3, 0.01, 5.0)
    np.testing.assert_allclose(shown(device, picture)[..., :3], oracle(picture), atol=2e-4)


def test_a_pixel_of_absurd_brightness_hardly_moves_its_surroundings(device: Device) -> None:
    """Its logarithm is cut before it enters any base: at 2^90 as at 2^30. Both move the mean, which is made up for."""
    picture = np.ones((40, 48, 3), np.float32)
    found = []
    for stops in (30.0, 90.0):
        picture[20, 24] = 2.0**stops
        image = shown(device, picture)[..., 0].astype(float)
        image[20, 24] = image[19, 24]
        found.append(image / image[0, 0])
        np.testing.assert_allclose(shown(device, picture)[..., :3], oracle(picture), atol=2e-4)
    assert abs(found[0] - found[1]).max() < 0.02


@pytest.mark.parametrize("level", [1e-6, 0.02, 1.0, 3e7])
def test_an_even_picture_is_middle_grey_whatever_its_level(device: Device, level: float) -> None:
    found = shown(device, np.full((40, 50, 3), level))
    np.testing.assert_allclose(found[..., :3], MIDDLE, rtol=1e-5)
    assert (found[..., 3] == 1.0).all()


@settings(max_examples=15, deadline=None)
@given(exponent=st.floats(-20.0, 20.0), seed=st.integers(0, 1000))
def test_a_brighter_scene_gives_the_same_picture(device: Device, exponent: float, seed: int) -> None:
    picture = random_picture((48, 32), seed)
    found, expected = shown(device, picture * np.float32(2.0**exponent)), shown(device, picture)
    np.testing.assert_allclose(found, expected, atol=2e-5)


@settings(max_examples=15, deadline=None)
@given(width=st.integers(1, 80), height=st.integers(1, 80), seed=st.integers(0, 1000), stops=st.floats(0.0, 25.0))
def test_whatever_the_picture_values_lie_in_range_and_black_stays_black(
    device: Device, width: int, height: int, seed: int, stops: float
) -> None:
    picture = random_picture((width, height), seed, stops)
    found = shown(device, picture)
    assert ((found >= 0.0) & (found <= 1.0)).all()
    black = ~picture.any(axis=2)
    assert not found[black][:, :3].any()
    assert found[~black][:, :3].any() or black.all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, -5.0])
def test_what_is_not_finite_stays_in_its_pixel(device: Device, bad: float) -> None:
    """And moves no other: the picture is that with black there."""
    picture = random_picture((64, 48))
    picture[20, 30] = 0.0
    expected = shown(device, picture)
    picture[20, 30, 1] = bad
    assert (shown(device, picture) == expected).all()


def test_a_black_picture(device: Device) -> None:
    assert not shown(device, np.zeros((9, 13, 3)))[..., :3].any()


def test_black_around_a_picture_does_not_change_its_exposure(device: Device) -> None:
    picture = np.zeros((60, 80, 3))
    picture[20:40, 30:60] = 7.0
    found = shown(device, picture)
    np.testing.assert_allclose(found[20:40, 30:60, :3], MIDDLE, rtol=1e-5)


def two_halves(stops: float) -> Float32:
    """Left dark, right brighter by so many stops; wide against the radius."""
    picture = np.ones((32, 160, 3), np.float32)
    picture[:, 80:] *= 2.0**stops
    return picture


@pytest.mark.parametrize("stops", [0.25, 1.0, 3.0, 8.0, 14.0])
def test_even_regions_keep_their_order(device: Device, stops: float) -> None:
    found = shown(device, two_halves(stops))
    assert found[16, -1, 0] > found[16, 0, 0] + 0.01


def test_base_is_reduced_to_the_spread_that_fits(device: Device) -> None:
    """Halves 8 stops apart: a deviation of 4 stops, less what is smoothed at the edge, becomes MOST_SPREAD."""
    found = shown(device, two_halves(8.0))[16, [0, -1], 0].astype(float)
    x = np.geomspace(1e-4, WHITE, 100_000)
    before_curve = np.interp(found, curve(x), x)
    np.testing.assert_allclose(np.log2(before_curve / KEY), [-MOST_SPREAD, MOST_SPREAD], atol=0.05)


@pytest.mark.parametrize("stops", [2.0, 3.0, 4.0, 5.0, 8.0, 14.0])
def test_halos_are_small(device: Device, stops: float) -> None:
    """Below 0.12 stops before the curve: that much a pixel beside an edge leaves the range of the even regions."""
    found = shown(device, two_halves(stops))[16, :, 0].astype(float)
    x = np.geomspace(1e-6, WHITE, 200_000)
    before_curve = np.log2(np.interp(found, curve(x), x))
    low, high = sorted(before_curve[[0, -1]])
    halo = max(low - before_curve.min(), before_curve.max() - high)
    assert halo < 0.12


def test_detail_keeps_its_contrast_where_the_base_loses_it(device: Device) -> None:
    """A checkerboard of 0.2 stops on both halves, which are 10 stops apart."""
    y, x = np.mgrid[:32, :160]
    detail = 2.0 ** (0.1 * np.where((x + y) % 2, 1.0, -1.0))
    found = shown(device, two_halves(10.0) * detail[..., None])[16, :, 0].astype(float)
    levels = np.geomspace(1e-6, WHITE, 200_000)
    before_curve = np.log2(np.interp(found, curve(levels), levels))
    for columns in (slice(0, 40), slice(120, 160)):
        assert np.ptp(before_curve[columns]) == pytest.approx(0.2, abs=0.02)
    assert before_curve[120:].mean() - before_curve[:40].mean() == pytest.approx(2.0 * MOST_SPREAD, abs=0.1)


def test_colours_keep_their_hue_and_luminance(device: Device) -> None:
    """Saturated blue, far brighter than the rest: it gets paler, not another colour."""
    picture = np.full((32, 32, 3), 0.1, np.float32)
    picture[10:20, 10:20] = (0.0, 0.0, 40.0)
    found = shown(device, picture)[15, 15, :3].astype(float)
    assert found[2] == pytest.approx(1.0, abs=1e-5)
    assert found[0] == pytest.approx(found[1], abs=1e-6)
    assert found @ LUMINANCE == pytest.approx(oracle(picture)[15, 15] @ LUMINANCE, abs=1e-4)


def test_alpha_is_kept(device: Device) -> None:
    picture = np.dstack([random_picture((20, 10)), np.random.default_rng(2).random((10, 20))])
    assert (shown(device, picture)[..., 3] == picture[..., 3].astype(np.float32)).all()


def test_the_next_picture_holds_nothing_of_the_one_before(device: Device) -> None:
    pictures = [random_picture((40, 30), seed) for seed in range(2)]
    with device.current() as context:
        tone_map = ToneMapPass(context, device.shaders, 40, 30)
        found = []
        for picture in (*pictures, pictures[0]):
            values = np.dstack([picture, np.ones((30, 40), np.float32)])[::-1]
            found.append(read_image(tone_map.render(context.texture((40, 30), 4, values.tobytes(), dtype="f4"))))
    assert (found[0] == found[2]).all()
    assert not (found[0] == found[1]).all()


def test_a_frame_has_its_display_picture_on_demand(device: Device) -> None:
    settings = RenderSettings(40, 30, "direct", samples=1, display=True)
    images = device.render(box_room(), None, settings).images
    assert (images["display"] == shown(device, images["combined"])).all()
    assert "display" not in device.render(box_room(), None, replace(settings, display=False)).images


def test_luminance_is_that_of_rec709(device: Device) -> None:
    colors = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [-1, 2, 0]], np.float32)
    found = evaluate(device, FILE, "rec709_luminance(color)", {"color": colors})
    np.testing.assert_allclose(found, [0.2126, 0.7152, 0.0722, 1.0, 1.4304], rtol=1e-6)


def test_curve_is_the_published_one_up_to_white(device: Device) -> None:
    x = np.geomspace(1e-6, 10.0, 500)
    found = evaluate(device, FILE, "photographic_curve(x, 2.0)", {"x": x})
    np.testing.assert_allclose(found, np.where(x < 2.0, x * (1 + x / 4) / (1 + x), 1.0), rtol=1e-6)
    assert (np.diff(found) >= 0.0).all()


def test_colours_within_the_display_are_left_and_others_get_paler(device: Device) -> None:
    colors = np.array([[0.2, 0.9, 0.4], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0]], np.float32)
    luminance = (colors @ LUMINANCE).astype(np.float32)
    found = evaluate(device, FILE, "within_display(color, y)", {"color": colors, "y": luminance}, 3)
    share = (1.0 - luminance[1]) / (3.0 - luminance[1])
    paler = luminance[1] * (1.0 - share)
    np.testing.assert_allclose(found, [colors[0], (1.0, paler, paler), (0.0, 0.0, 0.0)], atol=1e-6)
