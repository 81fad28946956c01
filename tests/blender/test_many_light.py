# SPDX-License-Identifier: GPL-3.0-or-later
"""Many lights in cornell_box against Cycles, in pictures of one sample: one set of lights, the middles of pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

from vlm_addon.blender.cycles_reference import render_reference  # noqa: E402
from vlm_addon.blender.extraction.extract import extract_scene  # noqa: E402
from vlm_addon.core.metrics import flip, relative_rmse  # noqa: E402
from vlm_addon.core.surface_points import random_surface_points  # noqa: E402
from vlm_addon.render.device import Device  # noqa: E402
from vlm_addon.render.frame_types import RenderSettings  # noqa: E402

CORNELL_BOX = Path(__file__).resolve().parents[2] / "sample_blends" / "cornell_box.blend"
SMALL = (64, 2200)
LARGE = (128, 3072)
"""Pixels along a side, and Cycles' samples."""
TOTAL, INTERLEAVED, WHOLE, FLIP = 0.08, 0.20, 0.12, 0.06
NOISE_SHARE = 0.2
"""Of an error that is claimed: what the reference's own noise may be."""
NEAR_CORNER = 0.2
"""m: nearer than this to a surface that it faces and that faces another way, a point is in a corner."""


class Compared:
    """cornell_box with a reference of `bounces`, and its pictures by many_light."""

    def __init__(self, device, side, samples, bounces=1):
        bpy.ops.wm.open_mainfile(filepath=str(CORNELL_BOX))
        self.device, self.side = device, side
        self.snapshot = extract_scene()
        self.truth = render_reference(side, side, bounces, samples, at_centres=True)

    def frame(self, buffers=False, **values):
        settings = RenderSettings(self.side, self.side, "many_light", values, 1, buffers=buffers)
        return self.device.render(self.snapshot, None, settings)

    def error(self, frame, mask=None):
        return relative_rmse(frame.images["indirect"], self.truth.images["indirect"], mask)

    def require_bounds(self, frame, indirect_bound):
        picture, truth = np.ascontiguousarray(frame.images["combined"][..., :3]), self.truth.images["combined"]
        assert self.truth.noise["indirect"] <= NOISE_SHARE * indirect_bound
        assert self.truth.noise["combined"] <= NOISE_SHARE * TOTAL
        assert relative_rmse(picture, truth) <= TOTAL
        assert self.error(frame) <= indirect_bound
        assert flip(picture, truth)[0] <= FLIP


@pytest.fixture(scope="module")
def device():
    with Device() as opened:
        yield opened


@pytest.fixture(scope="module")
def small(device):
    return Compared(device, *SMALL)


@pytest.fixture(scope="module")
def large(device):
    return Compared(device, *LARGE)


@pytest.mark.parametrize(("interleave", "bound"), [(4, INTERLEAVED), (1, WHOLE)])
def test_2048_lights_are_as_near_to_cycles_as_claimed(small, interleave, bound):
    small.require_bounds(small.frame(lights=2048, interleave=interleave), bound)


@pytest.mark.full
@pytest.mark.parametrize(("interleave", "bound"), [(4, INTERLEAVED), (1, WHOLE)])
def test_2048_lights_are_as_near_to_cycles_as_claimed_in_a_larger_picture(large, interleave, bound):
    large.require_bounds(large.frame(lights=2048, interleave=interleave), bound)


@pytest.mark.full
def test_more_lights_err_less(large):
    errors = [large.error(large.frame(lights=lights, interleave=1)) for lights in (512, 1024, 2048, 8192)]
    assert errors == sorted(errors, reverse=True)
    assert len(set(errors)) == 4


def in_corner(snapshot, position, normal):
    """(h, w) whether something stands nearer than NEAR_CORNER before each pixel that faces another way."""
    surface = random_surface_points(snapshot.meshes, 20_000)
    places, normals = position.reshape(-1, 3), normal.reshape(-1, 3)
    near = np.zeros(len(places), bool)
    for first in range(0, len(places), 256):
        part = slice(first, first + 256)
        way = surface.positions[None] - places[part, None]
        stands_before = np.einsum("ijk,ik->ij", way, normals[part]) > -1e-3
        other = normals[part] @ surface.normals.T < 0.9
        near[part] = ((np.linalg.norm(way, axis=2) < NEAR_CORNER) & stands_before & other).any(axis=1)
    return near.reshape(position.shape[:2])


@pytest.mark.full
def test_the_mean_over_16_seeds_has_no_bias_outside_corners(large):
    frames = [large.frame(buffers=seed == 0, lights=2048, seed=seed) for seed in range(16)]
    mean = np.mean([frame.images["indirect"] for frame in frames], axis=0)
    position, normal = (frames[0].images[name] for name in ("position", "normal"))
    shown = (normal**2).sum(axis=2) > 0.5
    open_places = shown & ~in_corner(large.snapshot, position, normal)
    assert open_places.sum() > 0.75 * shown.sum()
    truth = large.truth.images["indirect"]
    assert mean[open_places].mean(axis=0) == pytest.approx(truth[open_places].mean(axis=0), rel=0.02)
    # And in each part of the picture that is large enough for the noise of both to be small.
    for rows in np.array_split(np.arange(large.side), 3):
        for columns in np.array_split(np.arange(large.side), 3):
            part = np.ix_(rows, columns)
            inside = open_places[part]
            if inside.sum() > 400:
                assert mean[part][inside].mean() == pytest.approx(truth[part][inside].mean(), rel=0.04)


@pytest.mark.full
@pytest.mark.parametrize("bounces", [2, 3])
def test_further_bounces_are_those_of_cycles(device, bounces):
    compared = Compared(device, 64, 2048, bounces)
    frame = compared.frame(lights=4096, bounces=bounces)
    assert compared.error(frame) <= INTERLEAVED
    indirect = compared.truth.images["indirect"]
    assert frame.images["indirect"].mean(axis=(0, 1)) == pytest.approx(indirect.mean(axis=(0, 1)), rel=0.03)
