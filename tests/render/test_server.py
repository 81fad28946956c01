# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer's process: the same pictures and errors as in one process, and none of its troubles for the caller."""

import dataclasses
import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from vlm_addon.core.errors import Cancelled, DeviceError, InvalidInput
from vlm_addon.core.scene import Camera, Light, Material, Mesh, SceneSnapshot
from vlm_addon.render import client
from vlm_addon.render.client import RenderProcess
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings

ROOT = Path(__file__).resolve().parents[2]
SEARCH_PATHS = [ROOT, *(path for path in sys.path if path.endswith("site-packages"))]
SETTINGS = RenderSettings(16, 12, technique="direct", samples=2, shadow_resolution=64)


def square():
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    normals = np.tile(np.array([0, 0, 1], np.float32), (2, 3, 1))
    return Mesh(
        "square", corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), normals, np.zeros((2, 3, 2), np.float32),
        np.zeros((0, 3, 3), np.float32), np.zeros(2, np.int32), np.zeros(2, np.int32),
        np.full((2, 3), 0.8, np.float32), np.zeros((2, 3), np.float32),
    )  # fmt: skip


@pytest.fixture(scope="module")
def snapshot():
    place = np.eye(4)
    place[2, 3] = 3.0
    return SceneSnapshot(
        "lit square",
        meshes=(square(),),
        materials=(Material("white", "DIFFUSE"),),
        lights=(Light("lamp", "POINT", (100.0, 80.0, 60.0), (0.0, 0.0, 2.0)),),
        camera=Camera("camera", place),
    )


@pytest.fixture
def renderer():
    with RenderProcess(sys.executable, SEARCH_PATHS) as process:
        yield process


def test_the_picture_is_that_of_a_device_in_this_process(renderer, snapshot):
    far = renderer.render(snapshot, None, SETTINGS)
    with Device() as device:
        near = device.render(snapshot, None, SETTINGS)
    assert near.images["combined"].max() > 0.1
    assert far.images.keys() == near.images.keys()
    for name, image in near.images.items():
        np.testing.assert_array_equal(far.images[name], image)
    assert far.counters == near.counters
    assert (far.device, far.timer) == (near.device, near.timer)


def test_an_error_keeps_its_kind_and_parts_and_the_process_goes_on(renderer, snapshot):
    with pytest.raises(InvalidInput) as caught:
        renderer.render(dataclasses.replace(snapshot, camera=None), None, SETTINGS)
    assert "lit square" in caught.value.subject
    assert renderer.render(snapshot, None, SETTINGS).images["combined"].shape == (12, 16, 4)


def test_progress_reaches_the_caller_and_can_cancel(renderer, snapshot):
    labels = []

    def stop_at_the_first_sample(fraction, label):
        labels.append(label)
        return fraction < 0.2

    with pytest.raises(Cancelled):
        renderer.render(snapshot, None, dataclasses.replace(SETTINGS, samples=4096), stop_at_the_first_sample)
    assert len(set(labels)) > 1
    assert renderer.render(snapshot, None, SETTINGS)


def test_a_killed_process_is_one_clear_error_and_leaves_no_files(snapshot):
    process = RenderProcess(sys.executable, SEARCH_PATHS)
    folder = process._folder
    process.render(snapshot, None, SETTINGS)
    os.kill(process.process_id, signal.SIGKILL)
    with pytest.raises(DeviceError, match="ended with code -9"):
        process.render(snapshot, None, SETTINGS)
    assert not folder.exists()


def test_a_process_killed_in_the_middle_of_a_picture_does_not_hang_the_caller(renderer, snapshot):
    def kill(fraction, label):
        if fraction > 0.2:
            os.kill(renderer.process_id, signal.SIGKILL)
        return True

    with pytest.raises(DeviceError, match="ended with code -9"):
        renderer.render(snapshot, None, dataclasses.replace(SETTINGS, samples=4096), kill)


def test_a_silent_process_is_ended(snapshot):
    process = RenderProcess(sys.executable, SEARCH_PATHS)
    process.render(snapshot, None, SETTINGS)
    process._silence_limit_s = 1.0
    os.kill(process.process_id, signal.SIGSTOP)
    with pytest.raises(DeviceError, match="said nothing"):
        process.render(snapshot, None, SETTINGS)


def test_the_child_ends_when_its_parent_is_gone(renderer, snapshot):
    renderer.render(snapshot, None, SETTINGS)
    renderer._child.stdin.close()
    assert renderer._child.wait(10.0) == 0


def test_a_child_that_cannot_import_says_why(snapshot):
    with (
        RenderProcess(sys.executable, [ROOT / "docs"]) as process,
        pytest.raises(DeviceError, match="No module named"),
    ):
        process.render(snapshot, None, SETTINGS)


def test_without_a_python_there_is_a_clear_error():
    with pytest.raises(DeviceError, match=r"sys\.executable"):
        RenderProcess("", SEARCH_PATHS)
    with pytest.raises(DeviceError, match="could not be started"):
        RenderProcess("/nowhere/python", SEARCH_PATHS)


NOISY_MAIN = (
    "import os; from vlm_addon.render import server; quiet_render = server.Device.render; "
    "server.Device.render = lambda *a: (os.write(1, b'noise'), print('noise', flush=True), quiet_render(*a))[2]; "
    "main(sys.argv[2])"
)


def test_what_libraries_print_does_not_reach_the_messages(snapshot, monkeypatch):
    monkeypatch.setattr(client, "BOOTSTRAP", client.BOOTSTRAP.replace("main(sys.argv[2])", NOISY_MAIN))
    with RenderProcess(sys.executable, SEARCH_PATHS) as process:
        assert process.render(snapshot, None, SETTINGS).images


def test_closing_twice_is_harmless(snapshot):
    process = RenderProcess(sys.executable, SEARCH_PATHS)
    process.render(snapshot, None, SETTINGS)
    process.close()
    process.close()
    assert process._child.returncode == 0
