# SPDX-License-Identifier: GPL-3.0-or-later
"""Visibility baked by the renderer's process: the same as in this one, with the same errors."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.core.visible_room import block_room, surface_lights
from vlm_addon.core.array_codec import content_hash
from vlm_addon.core.errors import Cancelled, InvalidInput
from vlm_addon.render.client import RenderProcess
from vlm_addon.render.device import Device

ROOT = Path(__file__).resolve().parents[2]
SEARCH_PATHS = [ROOT, *(path for path in sys.path if path.endswith("site-packages"))]


def test_another_process_bakes_the_same_and_reports_the_same_errors(device: Device) -> None:
    room, lights = block_room(), surface_lights(block_room(), 0)
    with RenderProcess(sys.executable, SEARCH_PATHS) as process:
        with pytest.raises(InvalidInput, match="5 cells"):
            process.bake_visibility(room, lights, 5, 2)
        # Several dispatches, so that there is something left to cancel.
        many = surface_lights(room, 1)
        with pytest.raises(Cancelled):
            process.bake_visibility(room, many, 8, 32, lambda fraction, label: label != "visibility")
        found = process.bake_visibility(room, lights, 4, 2)
    assert content_hash(found) == content_hash(device.bake_visibility(room, lights, 4, 2))
