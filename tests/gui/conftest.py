# SPDX-License-Identifier: GPL-3.0-or-later
"""The story of a test module, played once: the module names its driver, its minutes, its files and its screen."""

import pytest

from tests.gui.blender_window import SCREEN, played


@pytest.fixture(scope="module")
def story(request, tmp_path_factory):
    """What the driver of the module told; see `played`."""
    module = request.module
    folder = tmp_path_factory.mktemp(module.DRIVER)
    files, screen = getattr(module, "FILES", ()), getattr(module, "SCREEN", SCREEN)
    return played(module.DRIVER, folder, module.MINUTES, files, screen)
