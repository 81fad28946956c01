# SPDX-License-Identifier: GPL-3.0-or-later
"""The context's life: what it refuses, what it releases, how it measures."""

from __future__ import annotations

import gc
import sys
import threading
import time
from collections import Counter

import moderngl
import pytest

from tests.render.rooms import box_room, mesh_lights
from vlm_addon.core.errors import DeviceError
from vlm_addon.render.device import FENCE, QUERY, Device, PassTimer
from vlm_addon.render.frame_types import RenderSettings


def test_a_closed_device_is_refused() -> None:
    device = Device()
    device.close()
    device.close()
    with pytest.raises(DeviceError, match="closed"), device.current():
        pass


def test_another_thread_is_refused(device: Device) -> None:
    errors: list[Exception] = []

    def use() -> None:
        try:
            with device.current():
                pass
        except DeviceError as error:
            errors.append(error)

    thread = threading.Thread(target=use)
    thread.start()
    thread.join()
    assert "thread" in str(errors[0])


def test_failing_calls_of_opengl_are_device_errors(device: Device) -> None:
    with pytest.raises(DeviceError, match=device.name[:8]), device.current() as context:
        context.texture((4, 4), 4, data=b"too few bytes")


def test_no_driver_names_both_attempts_and_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**settings: object) -> None:
        raise Exception(f"cannot open {settings.get('backend', 'window system')}")

    monkeypatch.setattr(moderngl, "create_standalone_context", refuse)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(DeviceError) as caught:
        Device()
    for word in ("egl: cannot open egl", "default: cannot open window system", "libegl1", "libgl1-mesa-dri"):
        assert word in str(caught.value)


@pytest.mark.parametrize(("display", "first"), [("", "egl"), (":0", None)])
def test_egl_comes_first_without_a_display(monkeypatch: pytest.MonkeyPatch, display: str, first: str | None) -> None:
    attempts: list[object] = []

    def refuse(**settings: object) -> None:
        attempts.append(settings.get("backend"))
        raise ValueError("no")

    monkeypatch.setattr(moderngl, "create_standalone_context", refuse)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(DeviceError):
        Device()
    assert attempts[0] == first
    assert len(attempts) == 2


def test_missing_moderngl_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "moderngl", None)
    with pytest.raises(DeviceError, match="install the package moderngl"):
        Device()


def test_the_timer_suits_the_device(device: Device) -> None:
    assert device.timer().kind == (FENCE if device.is_software else QUERY)


@pytest.mark.parametrize("is_software", [True, False])
def test_times_of_one_name_are_summed_in_order_of_first_use(device: Device, is_software: bool) -> None:
    with device.current() as context:
        timer = PassTimer(context, is_software, [])
        for name in ("one", "two", "one"):
            with timer.measure(name):
                time.sleep(0.01)
        timings = timer.timings()
        again = timer.timings()
    assert [name for name, _ in timings] == ["one", "two"]
    assert timings == again
    if is_software:
        assert dict(timings)["one"] >= 20.0


def live_objects(device: Device) -> Counter[str]:
    """OpenGL objects that were not yet let go of, by type; those let go of are released with the block."""
    with device.current() as context:
        pass
    assert not context.objects
    return Counter(type(item).__name__ for item in gc.get_objects() if type(item).__module__ == "moderngl")


def test_repeated_frames_keep_nothing(device: Device) -> None:
    room = box_room()
    lights = mesh_lights(room.meshes, colour=0.5)
    settings = RenderSettings(32, 24, samples=2, shadow_resolution=32, buffers=True)
    device.render(room, lights, settings)
    before = live_objects(device)
    assert before
    for _ in range(3):
        device.render(room, lights, settings)
    assert live_objects(device) == before


def test_a_failed_frame_keeps_nothing(device: Device) -> None:
    room = box_room()
    settings = RenderSettings(32, 24, "direct", samples=2, shadow_resolution=32)
    device.render(room, None, settings)
    before = live_objects(device)
    with pytest.raises(Exception, match="cancelled"):
        device.render(room, None, settings, lambda fraction, label: fraction < 0.5)
    assert live_objects(device) == before


def test_two_devices_do_not_disturb_each_other(device: Device) -> None:
    room = box_room()
    settings = RenderSettings(16, 12, "direct", samples=1, shadow_resolution=32)
    alone = device.render(room, None, settings).images["combined"]
    with Device() as other:
        first = other.render(room, None, settings).images["combined"]
        second = device.render(room, None, settings).images["combined"]
    assert (alone == first).all()
    assert (alone == second).all()
