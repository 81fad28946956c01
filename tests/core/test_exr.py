# SPDX-License-Identifier: GPL-3.0-or-later
"""EXR files: our own round trip, and refusal of what is not read. (Blender reads them in tests/blender.)"""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.exr import _shuffle, _unshuffle, image_of, read_exr, write_channels, write_exr


def test_values_come_back_bit_by_bit(tmp_path):
    image = np.random.default_rng(0).normal(size=(37, 21, 4)).astype(np.float32)
    image[0, 0] = [np.nan, np.inf, -np.inf, -0.0]
    write_exr(tmp_path / "a.exr", image)
    channels = read_exr(tmp_path / "a.exr")
    assert image_of(channels, names="RGBA").tobytes() == image.tobytes()


def test_smooth_pictures_are_compressed(tmp_path):
    image = np.zeros((64, 64, 3), np.float32)
    write_exr(tmp_path / "a.exr", image)
    assert (tmp_path / "a.exr").stat().st_size < image.nbytes / 50
    assert not image_of(read_exr(tmp_path / "a.exr")).any()


@given(npst.arrays(np.uint8, st.integers(1, 99)))
def test_shuffling_is_undone(data):
    assert _unshuffle(_shuffle(data.tobytes())) == data.tobytes()


def test_channels_are_stored_by_name(tmp_path):
    channels = {f"{'layer' * 10}.{name}": np.full((3, 2), i, np.float32) for i, name in enumerate("BAC")}
    write_channels(tmp_path / "a.exr", channels)
    found = read_exr(tmp_path / "a.exr")
    assert {name: float(values[0, 0]) for name, values in found.items()} == {
        name: float(values[0, 0]) for name, values in channels.items()
    }


def test_half_floats_without_compression_are_read(tmp_path):
    def attribute(name, kind, value):
        return name + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value

    window = struct.pack("<4i", 0, 0, 1, 1)
    header = struct.pack("<ii", 20000630, 2)
    header += attribute(b"channels", b"chlist", b"Y\0" + struct.pack("<iB3xii", 1, 0, 1, 1) + b"\0")
    header += attribute(b"compression", b"compression", b"\0") + attribute(b"dataWindow", b"box2i", window) + b"\0"
    first = len(header) + 16
    lines = [struct.pack("<ii", y, 4) + np.array([y, 0.5], "<f2").tobytes() for y in (0, 1)]
    (tmp_path / "a.exr").write_bytes(header + struct.pack("<QQ", first, first + 12) + b"".join(lines))
    assert read_exr(tmp_path / "a.exr")["Y"].tolist() == [[0.0, 0.5], [1.0, 0.5]]


@pytest.mark.parametrize("keep", [0, 3, 20, 200, -1])
def test_files_cut_short_are_named(tmp_path, keep):
    write_exr(tmp_path / "a.exr", np.random.default_rng(0).random((20, 20, 3)).astype(np.float32))
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(data[:keep])
    with pytest.raises(InvalidInput, match=r"a.exr"):
        read_exr(tmp_path / "a.exr")


def test_other_files_are_refused(tmp_path):
    (tmp_path / "a.exr").write_bytes(b"not a picture at all")
    with pytest.raises(InvalidInput, match="it is not an EXR file"):
        read_exr(tmp_path / "a.exr")


def test_a_missing_channel_is_named():
    with pytest.raises(InvalidInput, match=r"no channel x.R; it has: Y"):
        image_of({"Y": np.zeros((1, 1), np.float32)}, "x.")
