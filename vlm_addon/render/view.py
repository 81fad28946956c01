# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera matrices in float64, relative to the geometry's local origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.errors import InvalidInput
from ..core.scene import ORTHOGRAPHIC, Camera, Float64

CENTRED = (0.0, 0.0)


@dataclass(frozen=True)
class View:
    """What the vertex and fragment stages need of a camera.

    clip_from_local: (4, 4) float64. position: (3,) float64, m from the local origin. backward: (3,) float64, unit,
    against the direction of view. is_orthographic: whether all rays run along -backward. clip_distances: nearest and
    farthest depth that shows. rays: (3, 3) float64, of a perspective camera: what leads to depth 1 through the
    window's lower left corner, and by how much that differs for each pixel to the right and up; 0 for an orthographic
    one. jitter: pixels right and up from their centres where the pixels are sampled.
    """

    clip_from_local: Float64
    position: Float64
    backward: Float64
    is_orthographic: bool
    clip_distances: tuple[float, float]
    rays: Float64
    jitter: tuple[float, float] = CENTRED

    def camera_uniforms(self) -> dict[str, object]:
        """What shaders need to know which way the eye is."""
        return {
            "camera_position": self.position,
            "camera_backward": self.backward,
            "is_orthographic": self.is_orthographic,
        }

    def picture_width(self, width: int) -> tuple[float, float]:
        """How much a picture of `width` pixels shows across, m: at depth 0, and more of it for each m of depth."""
        if self.is_orthographic:
            return 2.0 / float(np.linalg.norm(self.clip_from_local[0, :3])), 0.0
        return 0.0, width * float(np.linalg.norm(self.rays[1]))


def make_view(camera: Camera, width: int, height: int, origin: Float64, jitter: tuple[float, float] = CENTRED) -> View:
    """The view of `camera`, its pixels sampled at their centres plus `jitter` (pixels right and up, -0.5 to 0.5).

    origin: (3,) float64, world space. Raises InvalidInput where the camera has no finite frame.
    """
    require_usable(camera)
    left, right, bottom, top = camera.frame(width, height)
    shift_x = jitter[0] * (right - left) / width
    shift_y = jitter[1] * (top - bottom) / height
    frame = (left + shift_x, right + shift_x, bottom + shift_y, top + shift_y)
    is_orthographic = camera.kind == ORTHOGRAPHIC
    clip_from_view = _projection(frame, camera.clip_start, camera.clip_end, is_orthographic)
    rotation = camera.matrix_world[:3, :3]
    position = camera.matrix_world[:3, 3] - origin
    view_from_local = np.eye(4)
    view_from_local[:3, :3] = rotation.T
    view_from_local[:3, 3] = -rotation.T @ position
    backward = rotation[:, 2].copy()
    window = np.array([[frame[0], frame[2]], [(right - left) / width, 0.0], [0.0, (top - bottom) / height]])
    rays = window @ rotation[:, :2].T
    rays[0] -= backward
    return View(
        clip_from_local=clip_from_view @ view_from_local,
        position=position,
        backward=backward,
        is_orthographic=is_orthographic,
        clip_distances=(camera.clip_start, camera.clip_end),
        rays=np.zeros((3, 3)) if is_orthographic else rays,
        jitter=jitter,
    )


def _projection(frame: tuple[float, float, float, float], near: float, far: float, is_orthographic: bool) -> Float64:
    left, right, bottom, top = frame
    scale_x, scale_y, depth = 2.0 / (right - left), 2.0 / (top - bottom), far - near
    centre_x, centre_y = (right + left) / (right - left), (top + bottom) / (top - bottom)
    if is_orthographic:
        return np.array(
            [
                [scale_x, 0.0, 0.0, -centre_x],
                [0.0, scale_y, 0.0, -centre_y],
                [0.0, 0.0, -2.0 / depth, -(far + near) / depth],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
    return np.array(
        [
            [scale_x, 0.0, centre_x, 0.0],
            [0.0, scale_y, centre_y, 0.0],
            [0.0, 0.0, -(far + near) / depth, -2.0 * far * near / depth],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )


def require_usable(camera: Camera) -> None:
    """Raises InvalidInput where the camera, in metres, has no finite frame."""
    subject = f"camera {camera.name!r}"
    if not np.isfinite(camera.matrix_world).all() or abs(np.linalg.det(camera.matrix_world[:3, :3])) < 0.5:
        raise InvalidInput(subject, "its matrix is not a rotation and a position", "apply or clear its scale")
    if camera.kind != ORTHOGRAPHIC and not camera.clip_start > 0.0:
        raise InvalidInput(subject, f"clip start is {camera.clip_start} m", "give a distance above 0")
    if not camera.clip_end > camera.clip_start:
        problem = f"clip end {camera.clip_end} m is not beyond clip start {camera.clip_start} m"
        raise InvalidInput(subject, problem, "give a larger clip end")
    is_orthographic = camera.kind == ORTHOGRAPHIC
    sizes = (camera.ortho_scale,) if is_orthographic else (camera.lens, camera.sensor_width, camera.sensor_height)
    if not all(0.0 < size < np.inf for size in sizes):
        raise InvalidInput(subject, "its picture has no width", "give lens, sensor and scale above 0")
