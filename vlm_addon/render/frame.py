# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame, written top to bottom."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..core.errors import InvalidInput
from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress
from ..core.scene import SceneSnapshot
from .frame_types import Frame, RenderSettings

if TYPE_CHECKING:
    from .device import Device


def render_frame(
    device: Device,
    snapshot: SceneSnapshot,
    light_mesh: VirtualLightMesh | None,
    settings: RenderSettings,
    progress: Progress,
) -> Frame:
    """The picture of `snapshot`. Raises InvalidInput for what cannot be rendered."""
    raise InvalidInput("renderer", "no pass is built yet", "wait for the next commit")
