# SPDX-License-Identifier: GPL-3.0-or-later
"""Many lights while the dancer dances: light where nothing moves does not flicker, and memory stays what it is.

Sampling noise: standard deviation of the indirect light over seeds of one frame, root mean square over the pixels whose
surface stays, relative to their mean. Of 512 lights shared by 4 x 4 pixels at 48 x 36 it is 9 to 17 % in a frame and
12 % over the dance: a few bright pixels make that, half of all have less than 5 %. Two pictures with lights of their
own differ by sqrt(2) times as much. With the same seed lights stay where the maps stay, so what changes from frame to
frame, true changes counted, is 0.8 of the noise of a single picture over the dance, and 1.4 of it at the most.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

from vlm_addon.blender.extraction.extract import extract_scene  # noqa: E402
from vlm_addon.render.device import Device  # noqa: E402
from vlm_addon.render.frame_types import RenderSettings  # noqa: E402

DANCER = Path(__file__).resolve().parents[2] / "sample_blends" / "dancer.blend"
LOOP = 60
WIDTH, HEIGHT, LIGHTS, SEEDS = 48, 36, 512, 3
STATED_NOISE = 0.1, 0.2
MOST = 2.0
"""Times the noise: the greatest change from one frame to the next."""
SURFACE = ("position", "normal", "material_id", "tag_id", "face_id")


@dataclass(frozen=True)
class Picture:
    """Indirect light (h, w, 3), what its pixels show, and the counters of the frame."""

    indirect: np.ndarray
    surface: dict[str, np.ndarray]
    counters: dict[str, float]


@pytest.fixture(scope="module")
def device():
    with Device() as opened:
        yield opened


def opened():
    bpy.ops.wm.open_mainfile(filepath=str(DANCER))


def scene_at(number):
    bpy.context.scene.frame_set(1 + (number - 1) % LOOP)
    return extract_scene()


@pytest.fixture(scope="module")
def scenes():
    """Five frames one after the other."""
    opened()
    return [scene_at(number) for number in range(12, 17)]


def picture(device, snapshot, seed=0):
    values = {"lights": LIGHTS, "octree_resolution": 64, "resolution": 128, "seed": seed}
    size = WIDTH, HEIGHT
    lit = device.render(snapshot, None, RenderSettings(*size, "many_light", values, 1, 64, 1))
    shown = device.render(snapshot, None, RenderSettings(*size, "direct", {}, 1, 64, 1, buffers=True))
    return Picture(lit.images["indirect"], {name: shown.images[name] for name in SURFACE}, lit.counters)


def still(first, second):
    """(h, w) pixels that show the same place of the same face in both pictures."""
    same = [(first.surface[name] == second.surface[name]).all(axis=2) for name in SURFACE]
    shows = (first.surface["normal"] != 0.0).any(axis=2)
    return np.logical_and.reduce([shows, *same])


def change(first, second):
    """RMS change of the indirect light of pixels that stay, relative to its mean there."""
    stays = still(first, second)
    assert 0.5 < stays.mean() < 0.98, "most of the room stays, and the dancer moves"
    a, b = (each.indirect[stays].astype(float) for each in (first, second))
    return float(np.sqrt(((b - a) ** 2).mean()) / a.mean())


def seed_noise(first, second):
    """Relative sampling noise of pixels that stay from one frame to the next.

    first, second: pictures of the two frames, one of the first for each seed.
    """
    stays = still(first[0], second)
    values = np.stack([each.indirect[stays] for each in first]).astype(float)
    return float(np.sqrt(values.var(axis=0, ddof=1).mean()) / values.mean())


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def require_stated(found_noise):
    assert STATED_NOISE[0] <= found_noise <= STATED_NOISE[1]


def test_light_flickers_less_than_its_sampling_noise(device, scenes):
    """Where the lights of each frame have a seed of their own, it does not: that is noticed."""
    frames = [[picture(device, scene, seed) for seed in range(SEEDS)] for scene in scenes]
    pairs = list(pairwise(frames))
    noise = rms([seed_noise(first, second[0]) for first, second in pairs])
    require_stated(noise)
    changes = [change(a, b) for first, second in pairs for a, b in zip(first, second, strict=True)]
    assert rms(changes) <= noise
    assert max(changes) <= MOST * noise
    moved = [change(a, b) for first, second in pairs for a, b in zip(first, second[1:], strict=False)]
    assert rms(moved) > 1.2 * noise


def test_a_frame_comes_back_bit_for_bit(device, scenes):
    """Where nothing has moved nothing changes, whatever was shown in between."""
    opened()
    first, between, again = (picture(device, scene) for scene in (scenes[0], scenes[1], scene_at(12)))
    assert np.array_equal(first.indirect, again.indirect)
    assert not np.array_equal(first.indirect, between.indirect)


@pytest.mark.full
def test_two_hundred_frames_of_the_dancer(device):
    """The dance three times and a third: no flicker, and from the second round on nothing more is kept."""
    opened()
    found = []
    for number in (2, 14, 26, 38, 50):
        scene = scene_at(number)
        pictures = [picture(device, scene, seed) for seed in range(SEEDS)]
        found.append(seed_noise(pictures, picture(device, scene_at(number + 1))))
    noise = rms(found)
    require_stated(noise)
    changes, kept, resident = [], [], []
    last = picture(device, scene_at(1))
    for number in range(2, 202):
        shown = picture(device, scene_at(number))
        changes.append(change(last, shown))
        kept.append((shown.counters["octree_device_mb"], shown.counters["reflective_maps"]))
        resident.append(resident_bytes())
        last = shown
    assert rms(changes) <= noise
    assert max(changes) <= MOST * noise
    assert len(set(kept[100:])) == 1
    assert max(resident[150:]) <= max(resident[100:150]) + (8 << 20)


def resident_bytes():
    """Of this process, which a software renderer's buffers are part of; 0 where the system does not tell."""
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * 4096 if statm.exists() else 0
