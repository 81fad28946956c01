# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of techniques, and what every one of them must hold."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.render.rooms import box_room, mesh_lights
from vlm_addon.core.errors import Cancelled, InvalidInput
from vlm_addon.core.light_mesh import empty_light_mesh
from vlm_addon.core.settings import describe
from vlm_addon.render import technique, techniques
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.render.technique import Technique, technique_by_name, technique_list

NAMES = [found.name for found in technique_list()]
SMALL = {"width": 16, "height": 12, "samples": 1, "shadow_resolution": 32, "shadow_samples": 1}


def test_one_file_is_one_technique() -> None:
    files = {path.stem for path in Path(techniques.__path__[0]).glob("*.py")} - {"__init__"}
    assert {found.__module__.rsplit(".", 1)[1] for found in technique_list()} == files
    assert len(NAMES) == len(files)
    assert {"direct", "vlm"} <= set(NAMES)


@pytest.mark.parametrize("found", technique_list(), ids=NAMES)
def test_each_says_what_it_is_what_is_wrong_with_it_and_what_can_be_set(found: type[Technique]) -> None:
    assert found.label
    assert found.description
    assert found.known_bias()
    for info in describe(found.settings):
        assert info.text
        assert info.source
        assert info.choices or info.type is bool or info.unit
    found.settings()


def test_an_unknown_name_lists_those_there_are() -> None:
    with pytest.raises(InvalidInput, match=r"'nonsense'.*direct, .*vlm"):
        technique_by_name("nonsense")


def test_an_import_error_in_a_technique_is_raised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken.py").write_text("import no_such_module_anywhere\n")
    monkeypatch.setattr(techniques, "__path__", [str(tmp_path)])
    monkeypatch.delitem(sys.modules, "vlm_addon.render.techniques.broken", raising=False)
    technique.technique_list.cache_clear()
    try:
        with pytest.raises(ModuleNotFoundError, match="no_such_module_anywhere"):
            technique_list()
    finally:
        technique.technique_list.cache_clear()


@pytest.mark.parametrize("lights", [None, empty_light_mesh()], ids=["none", "empty"])
@pytest.mark.parametrize("name", [found.name for found in technique_list() if found.needs_light_mesh])
def test_without_a_light_mesh_it_says_to_bake_one(device: Device, name: str, lights: object) -> None:
    with pytest.raises(InvalidInput, match="bake one first"):
        device.render(box_room(), lights, RenderSettings(technique=name, **SMALL))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", NAMES)
def test_a_setting_that_does_not_exist_is_refused(device: Device, name: str) -> None:
    settings = RenderSettings(technique=name, technique_settings={"nonsense": 1}, **SMALL)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="'nonsense'"):
        device.render(box_room(), None, settings)


@pytest.mark.parametrize("name", NAMES)
def test_pictures_are_finite_not_negative_and_the_same_each_time(device: Device, name: str) -> None:
    room = box_room()
    lights = mesh_lights(room.meshes, colour=0.5, emission=0.1)
    settings = RenderSettings(technique=name, **SMALL)  # type: ignore[arg-type]
    first, second = (device.render(room, lights, settings) for _ in range(2))
    for image_name, image in first.images.items():
        assert np.isfinite(image).all(), image_name
        assert (image >= 0.0).all(), image_name
        assert (image == second.images[image_name]).all(), image_name
    assert first.images["direct"].max() > 0.0
    assert (first.images["indirect"].max() > 0.0) == (name != "direct")


@pytest.mark.parametrize("name", NAMES)
def test_stop_is_heard_in_every_part_of_a_frame(device: Device, name: str) -> None:
    room = box_room()
    lights = mesh_lights(room.meshes, colour=0.5, emission=0.1)
    settings = RenderSettings(technique=name, **SMALL)  # type: ignore[arg-type]
    labels: list[str] = []

    def watch(fraction: float, label: str) -> bool:
        labels.append(label)
        return label != stop_at

    stop_at = ""
    device.forget()
    device.render(room, lights, settings, watch)
    for stop_at in dict.fromkeys(labels):
        labels.clear()
        # What is kept takes no time in which to stop.
        device.forget()
        with pytest.raises(Cancelled):
            device.render(room, lights, settings, watch)
        assert labels[-1] == stop_at
        assert labels.count(stop_at) == 1


@pytest.mark.parametrize("name", NAMES)
def test_a_frame_is_the_same_to_the_bit_whatever_came_before(device: Device, name: str) -> None:
    """Another scene, and the same scene with its lamps off or gone, which has no light of theirs left in it."""
    room = box_room()
    dark = replace(room, lights=tuple(replace(lamp, power=(0.0, 0.0, 0.0)) for lamp in room.lights))
    elsewhere = box_room((7.0, -3.0, 2.0))
    lights = mesh_lights(room.meshes, colour=0.5, emission=0.0)
    settings = RenderSettings(technique=name, buffers=True, **SMALL)  # type: ignore[arg-type]
    empty = replace(room, lights=())
    frames = [device.render(each, lights, settings) for each in (room, dark, empty, elsewhere, room)]
    first, again = frames[0], frames[-1]
    for off in frames[1:3]:
        assert not off.images["irradiance"].any()
    assert first.images["irradiance"].any() or name == "direct"
    for image_name, image in first.images.items():
        np.testing.assert_array_equal(again.images[image_name], image, err_msg=image_name)
