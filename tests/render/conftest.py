# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from collections.abc import Iterator

import pytest

from vlm_addon.render.device import Device


@pytest.fixture(scope="session")
def device() -> Iterator[Device]:
    """One OpenGL device for all tests that do not ask for one of their own."""
    with Device() as opened:
        yield opened
