# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer as a child process: the same pictures and errors, and nothing left behind whatever happens."""

from __future__ import annotations

import gc
import io
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.render.rooms import box_room, mesh_lights
from vlm_addon.core.errors import Cancelled, DeviceError, InvalidInput
from vlm_addon.core.scene import SceneSnapshot
from vlm_addon.render import client, framing
from vlm_addon.render.client import RenderProcess
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.render.framing import map_arrays, read_message, store_arrays, write_message

ROOT = Path(__file__).resolve().parents[2]
SEARCH_PATHS = [ROOT, *(path for path in sys.path if path.endswith("site-packages"))]
ROOM = box_room()
SETTINGS = RenderSettings(32, 24, "vlm", samples=2, shadow_resolution=32, shadow_samples=1, buffers=True)
LIGHTS = mesh_lights(ROOM.meshes, colour=0.5, emission=0.1)
ENDLESS = RenderSettings(512, 512, "direct", samples=4096, shadow_resolution=32)


@pytest.fixture(autouse=True)
def temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where array files go; empty again when the test ends."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    gc.collect()
    assert list(folder.iterdir()) == []


@pytest.fixture
def renderer() -> Iterator[RenderProcess]:
    with RenderProcess(sys.executable, SEARCH_PATHS) as opened:
        yield opened


def stand_in(tmp_path: Path, body: str) -> list[Path]:
    """Search paths with a server whose `main` is `body`, after the real `framing`."""
    package = tmp_path / "stand_in"
    (package / "vlm_addon" / "render").mkdir(parents=True)
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    (package / "vlm_addon" / "render" / "server.py").write_text(
        f"import os, sys, time, json, struct\ndef main(folder):\n"
        f"    def send(message):\n"
        f"        data = json.dumps(message).encode()\n"
        f"        sys.stdout.buffer.write(struct.pack('<I', len(data)) + data); sys.stdout.buffer.flush()\n{lines}\n"
    )
    return [package]


def is_alive(process_id: int) -> bool:
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return False
    return True


def test_pictures_are_those_of_the_device(renderer: RenderProcess, device: Device) -> None:
    here = device.render(ROOM, LIGHTS, SETTINGS)
    there = renderer.render(ROOM, LIGHTS, SETTINGS)
    assert list(there.images) == list(here.images)
    for name, image in here.images.items():
        assert there.images[name].dtype == np.float32
        assert (there.images[name] == image).all(), name
    assert (there.device, there.timer, there.counters) == (here.device, here.timer, here.counters)
    assert [name for name, _ in there.timings] == [name for name, _ in here.timings]
    assert there.findings == here.findings


def test_findings_arrive(renderer: RenderProcess, device: Device) -> None:
    dark = SceneSnapshot("dark", ROOM.meshes[:1], ROOM.materials[:1], camera=ROOM.camera)
    settings = RenderSettings(8, 8, "direct", samples=1)
    findings = renderer.render(dark, None, settings).findings
    assert findings == device.render(dark, None, settings).findings
    assert len(findings) == 1


def test_bad_input_keeps_its_parts_and_the_process(renderer: RenderProcess) -> None:
    with pytest.raises(InvalidInput) as caught:
        renderer.render(SceneSnapshot("blind"), LIGHTS, SETTINGS)
    assert caught.value.subject == "scene 'blind'"
    assert caught.value.problem == "it has no camera"
    process_id = renderer.process_id
    assert renderer.render(ROOM, LIGHTS, SETTINGS).images["combined"].max() > 0.0
    assert renderer.process_id == process_id


def test_progress_comes_across_and_a_cancelled_renderer_goes_on(renderer: RenderProcess) -> None:
    seen: list[float] = []

    def until_half(fraction: float, label: str) -> bool:
        seen.append(fraction)
        return label != "samples"

    start = time.monotonic()
    with pytest.raises(Cancelled):
        renderer.render(ROOM, None, ENDLESS, until_half)
    assert time.monotonic() - start < 60.0
    assert seen == sorted(seen)
    assert renderer.render(ROOM, LIGHTS, SETTINGS).images["combined"].max() > 0.0


def test_an_exception_of_the_progress_leaves_no_stale_answer(renderer: RenderProcess) -> None:
    def fail(fraction: float, label: str) -> bool:
        if label == "samples":
            raise KeyError("bar")
        return True

    with pytest.raises(KeyError, match="bar"):
        renderer.render(ROOM, None, RenderSettings(16, 12, "direct", samples=2, shadow_resolution=32), fail)
    assert renderer.render(ROOM, LIGHTS, SETTINGS).images["combined"].shape == (24, 32, 4)


def test_a_killed_child_is_one_sentence_and_leaves_nothing(temporary_folder: Path) -> None:
    renderer = RenderProcess(sys.executable, SEARCH_PATHS)
    renderer.render(ROOM, LIGHTS, SETTINGS)

    def kill(fraction: float, label: str) -> bool:
        if label == "samples":
            os.kill(renderer.process_id, signal.SIGKILL)
        return True

    with pytest.raises(DeviceError, match="ended with code -9"):
        renderer.render(ROOM, None, ENDLESS, kill)
    assert not is_alive(renderer.process_id)
    assert list(temporary_folder.iterdir()) == []


def test_files_of_finished_pictures_are_removed(renderer: RenderProcess, temporary_folder: Path) -> None:
    for _ in range(3):
        renderer.render(ROOM, LIGHTS, SETTINGS)
    assert list(temporary_folder.rglob("*.bin")) == []


def test_the_child_ends_when_its_parent_is_killed(tmp_path: Path) -> None:
    """The parent dies without a chance to close anything."""
    code = (
        "import sys, time; from pathlib import Path\n"
        "from vlm_addon.render.client import RenderProcess\n"
        f"process = RenderProcess(sys.executable, {[str(path) for path in SEARCH_PATHS]!r})\n"
        "print(process.process_id, process._folder, flush=True); time.sleep(60)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, cwd=ROOT, text=True)
    assert parent.stdout is not None
    child, folder = parent.stdout.readline().split()
    parent.kill()
    parent.communicate()
    deadline = time.monotonic() + 20.0
    while is_alive(int(child)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_alive(int(child))
    for path in Path(folder).iterdir():
        path.unlink()
    Path(folder).rmdir()


def test_closing_ends_the_child() -> None:
    renderer = RenderProcess(sys.executable, SEARCH_PATHS)
    renderer.close()
    renderer.close()
    assert not is_alive(renderer.process_id)


@pytest.mark.parametrize("executable", ["", None])
def test_no_python_is_said_plainly(executable: str | None) -> None:
    with pytest.raises(DeviceError, match=r"sys\.executable"):
        RenderProcess(executable, SEARCH_PATHS)  # type: ignore[arg-type]


def test_a_python_that_does_not_start_is_named(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"could not be started.*no_such_python"):
        RenderProcess(tmp_path / "no_such_python", SEARCH_PATHS)


def test_missing_modules_are_in_the_message() -> None:
    with RenderProcess(sys.executable, []) as renderer, pytest.raises(DeviceError, match="No module named 'vlm_addon'"):
        renderer.render(ROOM, None, SETTINGS)


def test_a_child_that_stops_in_the_middle_is_ended() -> None:
    with RenderProcess(sys.executable, SEARCH_PATHS) as renderer:
        renderer.render(ROOM, LIGHTS, SETTINGS)
        renderer._silence_limit_s = 0.5
        os.kill(renderer.process_id, signal.SIGSTOP)
        with pytest.raises(DeviceError, match="said nothing"):
            renderer.render(ROOM, LIGHTS, SETTINGS)
        assert not is_alive(renderer.process_id)


def test_a_child_that_hangs_is_ended(tmp_path: Path) -> None:
    paths = stand_in(tmp_path, "time.sleep(600)")
    with RenderProcess(sys.executable, paths) as renderer:
        renderer._silence_limit_s = 0.5
        with pytest.raises(DeviceError, match="said nothing"):
            renderer.render(ROOM, None, SETTINGS)
        assert not is_alive(renderer.process_id)


HELLO = f"send({{'type': 'hello', 'version': {framing.PROTOCOL_VERSION}, 'device': 'x'}})"
READ = "sys.stdin.buffer.read(4)"
BAD_CHILDREN = {
    "another version": ("send({'type': 'hello', 'version': -1, 'device': 'x'})", "another version"),
    "text": ("print('hello world, this is a library speaking', flush=True)", "broken message"),
    "half a message": ("sys.stdout.buffer.write(struct.pack('<I', 100) + b'{}'); sys.stdout.flush()", "broken message"),
    "no object": ("send([1, 2])", "unknown form"),
    "a strange answer": (f"{HELLO}\n{READ}\nsend({{'type': 'poem'}})\ntime.sleep(600)", "answered 'poem'"),
    "a crash": (f"{HELLO}\n{READ}\nos.abort()", "ended with code -6"),
    "last words": (f"{HELLO}\n{READ}\nsys.exit('the driver is on fire')", "driver is on fire"),
    "arrays beyond the file": (
        f"{HELLO}\n{READ}\nopen(os.path.join(folder, 'f.bin'), 'wb').write(bytes(16))\n"
        "send({'type': 'frame', 'frame': {}, 'file': 'f.bin', "
        "'arrays': [{'offset': 0, 'dtype': '<f4', 'shape': [100]}]})\ntime.sleep(600)",
        "exceeds the mapped file",
    ),
}


@pytest.mark.parametrize("kind", BAD_CHILDREN)
def test_a_child_that_misbehaves_is_a_device_error(tmp_path: Path, kind: str) -> None:
    body, message = BAD_CHILDREN[kind]
    with RenderProcess(sys.executable, stand_in(tmp_path, body)) as renderer:
        renderer._silence_limit_s = 20.0
        with pytest.raises(DeviceError, match=message):
            renderer.render(ROOM, None, SETTINGS)
        assert not is_alive(renderer.process_id)


NOISY_MAIN = (
    "import os; from vlm_addon.render import server; quiet_render = server.Device.render; "
    "server.Device.render = lambda *a: (os.write(1, b'noise'), print('noise', flush=True), quiet_render(*a))[2]; "
    "main(sys.argv[2])"
)


def test_what_libraries_print_does_not_reach_the_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "BOOTSTRAP", client.BOOTSTRAP.replace("main(sys.argv[2])", NOISY_MAIN))
    with RenderProcess(sys.executable, SEARCH_PATHS) as renderer:
        assert renderer.render(ROOM, LIGHTS, SETTINGS).images["combined"].max() > 0.0


def test_messages_and_arrays_come_back_as_they_went(tmp_path: Path) -> None:
    stream = io.BytesIO()
    sent = [{"type": "x", "text": "Umlaut äöü", "numbers": [1, 2.5, None]}, {}]
    for message in sent:
        write_message(stream, message)
    stream.seek(0)
    assert [read_message(stream), read_message(stream), read_message(stream)] == [*sent, None]
    arrays = [
        np.arange(5, dtype=np.int32),
        np.zeros((0, 3)),
        np.float32([[1.5, np.inf], [np.nan, -0.0]]).T,
        np.array([True, False]),
    ]
    blocks = store_arrays(tmp_path / "a.bin", arrays)
    for array, back in zip(arrays, map_arrays(tmp_path / "a.bin", blocks), strict=True):
        assert back.dtype == array.dtype
        np.testing.assert_array_equal(back, array)
        assert not back.flags.writeable


@pytest.mark.parametrize("change", [{"offset": -64}, {"shape": [-1]}, {"shape": [1 << 40]}, {"offset": 1 << 40}])
def test_blocks_outside_the_file_are_refused(tmp_path: Path, change: dict[str, object]) -> None:
    (block,) = store_arrays(tmp_path / "a.bin", [np.zeros(4)])
    with pytest.raises(DeviceError, match="exceeds"):
        map_arrays(tmp_path / "a.bin", [{**block, **change}])


def test_errors_of_every_kind_can_come_back() -> None:
    for name, kind in client.ERROR_KINDS.items():
        assert kind.__name__ == name
