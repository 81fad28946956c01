# SPDX-License-Identifier: GPL-3.0-or-later
"""Split and merged pictures against indexing in numpy, bit for bit."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.render.pixels import Pixels
from tests.render.rooms import box_room
from tests.render.shader_functions import evaluate
from tests.render.test_low_resolution import picture
from vlm_addon.render.device import Device
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBuffer
from vlm_addon.render.passes.interleave import TILE_MULTIPLE, MergePass, SplitPass, tile_size

FILE = "lib/interleave.glsl"
SHADER_NAMES = ("position", "shading_normal", "geometric_normal", "ids")
SIDES = st.integers(1, 70)
COUNTS = st.integers(1, 8)


def random_gbuffer(device: Device, size: tuple[int, int]) -> GBuffer:
    """Another pattern of 32 bits in each channel of each texture, with NaN, Inf and denormal numbers among them."""
    generator = np.random.default_rng(size)
    textures = [
        device.context.texture(size, 4, generator.integers(0, 2**32, (*size, 4), np.uint32).tobytes(), dtype=kind)
        for kind in ("f4", "f4", "f4", "f4", "f4", "i4")
    ]
    return GBuffer(*textures)


def words(texture: object) -> np.ndarray:
    """(h, w, c) uint32, the texture's bits, row 0 at the bottom."""
    width, height = texture.size  # type: ignore[attr-defined]
    return np.frombuffer(texture.read(), np.uint32).reshape(height, width, -1)  # type: ignore[attr-defined]


def split_places(size: tuple[int, int], n: int) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) int each, columns and rows of the split picture for each pixel, by eq. 4.4 to 4.6."""
    columns, rows = tile_size(*size, n)
    y, x = np.mgrid[: size[1], : size[0]]
    return x % n * columns + x // n, y % n * rows + y // n


@settings(max_examples=25, deadline=None)
@given(width=SIDES, height=SIDES, n=COUNTS)
def test_every_pixel_is_split_once_and_nothing_else_shows(device: Device, width: int, height: int, n: int) -> None:
    size = width, height
    with device.current() as context:
        gbuffer = random_gbuffer(device, size)
        split = SplitPass(context, device.shaders, *size, n)
        picked = split.render(gbuffer)
        assert picked.gbuffer.size == split.size == (n * split.tile_size[0], n * split.tile_size[1])
        x, y = split_places(size, n)
        beyond = np.ones(picked.gbuffer.size[::-1], bool)
        beyond[y, x] = False
        assert beyond.sum() == beyond.size - width * height
        for name in SHADER_NAMES:
            found = words(getattr(picked.gbuffer, name))
            assert (found[y, x] == words(getattr(gbuffer, name))).all(), name
            assert not found[beyond].any(), name
        places = words(picked.pixel).view(np.int32)[y, x]
        assert (places == np.stack(np.mgrid[:height, :width][::-1], axis=2)).all()


@settings(max_examples=25, deadline=None)
@given(width=SIDES, height=SIDES, n=COUNTS)
def test_merge_is_the_inverse_to_the_bit(device: Device, width: int, height: int, n: int) -> None:
    size = width, height
    with device.current() as context:
        gbuffer = random_gbuffer(device, size)
        picked = SplitPass(context, device.shaders, *size, n).render(gbuffer)
        merged = MergePass(context, device.shaders, *size, n).render(picked.gbuffer.shading_normal)
        assert merged.size == size
        assert (words(merged) == words(gbuffer.shading_normal)).all()


def test_the_default_of_the_thesis_on_a_picture_in_hand(device: Device) -> None:
    """4 x 4 tiles of a picture of 5 x 4: pixel (4, 0) is the second of the first tile, (1, 0) the first of the next."""
    size = 5, 4
    with device.current() as context:
        values = np.arange(20, dtype=np.float32).repeat(4)
        texture = context.texture(size, 4, values.tobytes(), dtype="f4")
        ids = context.texture(size, 4, values.astype(np.int32).tobytes(), dtype="i4")
        split = SplitPass(context, device.shaders, *size, 4)
        found = split.render(GBuffer(texture, texture, texture, texture, texture, ids)).gbuffer.position
        assert split.tile_size == (8, 8)
        rows = np.frombuffer(found.read(), np.float32).reshape(32, 32, 4)[..., 0]
        assert rows[0, :2].tolist() == [0.0, 4.0]
        assert rows[[0, 8, 24], [8, 0, 24]].tolist() == [1.0, 5.0, 18.0]


def test_a_split_picture_of_a_room_shows_it(device: Device) -> None:
    """By way of the G-buffer that a gather gets: the surfaces are the picture's, their number the same."""
    size = 61, 43
    with device.current() as context:
        gbuffer, _ = picture(device, box_room(), size)
        picked = SplitPass(context, device.shaders, *size, 4).render(gbuffer)
        normal, split = (read_image(g.geometric_normal)[..., :3].any(axis=2) for g in (gbuffer, picked.gbuffer))
        assert 0 < normal.sum() == split.sum()


def test_the_next_picture_holds_nothing_of_the_one_before(device: Device) -> None:
    generator = np.random.default_rng(3)
    with device.current() as context:
        split = SplitPass(context, device.shaders, 21, 37, 3)
        merge = MergePass(context, device.shaders, 21, 37, 3)
        full, sparse = Pixels(generator), Pixels(generator)
        sparse.shown &= generator.random(sparse.shown.shape) < 0.5
        merge.render(split.render(full.gbuffer(device)).gbuffer.position)
        merged = read_image(merge.render(split.render(sparse.gbuffer(device)).gbuffer.position))
        assert (merged[..., :3] == np.where(sparse.shown[..., None], sparse.positions, 0.0)).all()


@given(width=st.integers(1, 5000), height=st.integers(1, 5000), n=COUNTS)
def test_tiles_hold_the_picture_in_whole_work_groups(width: int, height: int, n: int) -> None:
    for tile, side in zip(tile_size(width, height, n), (width, height), strict=True):
        assert tile % TILE_MULTIPLE == 0
        assert side <= n * tile < side + n * TILE_MULTIPLE


def test_places_are_each_others_inverse(device: Device) -> None:
    generator = np.random.default_rng(8)
    n = generator.integers(1, 9, 500).astype(np.int32)
    tiles = 8 * generator.integers(1, 300, (500, 2)).astype(np.int32)
    texels = (generator.random((500, 2)) * n[:, None] * tiles).astype(np.int32)
    inputs = {"x": texels[:, 0], "y": texels[:, 1], "n": n, "w": tiles[:, 0], "h": tiles[:, 1]}
    pixel = "interleaved_pixel(ivec2(x, y), n, ivec2(w, h))"
    pixels = evaluate(device, FILE, f"vec2({pixel})", inputs, 2)
    assert (pixels == texels % tiles * n[:, None] + texels // tiles).all()
    back = evaluate(device, FILE, f"vec2(interleaved_texel({pixel}, n, ivec2(w, h)))", inputs, 2)
    assert (back == texels).all()
