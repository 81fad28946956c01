# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures one after the other on one device, each with what some pass found at every pixel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tests.render.rooms import camera_at
from vlm_addon.core.scene import Camera, Float32, Float64, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.geometry import GpuGeometry
from vlm_addon.render.kept import Kept
from vlm_addon.render.local_space import make_local_space
from vlm_addon.render.mesh_motion import SceneMotion
from vlm_addon.render.passes.accumulate import read_image
from vlm_addon.render.passes.gbuffer import GBufferPass
from vlm_addon.render.passes.motion import MotionPass
from vlm_addon.render.passes.temporal_accumulation import AccumulationSettings, Accumulator
from vlm_addon.render.view import make_view

WIDTH, HEIGHT = 48, 36


@dataclass(frozen=True)
class Picture:
    """(h, w, …), row 0 at the top. places: m in world space. shown: whether a surface is. faces: their numbers. mean:
    RGBA, what is shown. age: pictures in the mean that is kept. before: where surfaces were, m in world space, and
    normal, plane then; None where nothing moved; known: whether they were. vectors: pixels right and up to there."""

    places: Float64
    shown: np.ndarray
    faces: np.ndarray
    normals: Float32
    mean: Float32
    age: Float32
    history_share: float
    motion: SceneMotion
    before: Float64 | None
    known: np.ndarray | None
    normal_before: Float32 | None
    plane_before: Float32 | None
    vectors: Float32


Found = Callable[[Float64, np.ndarray], np.ndarray]
"""Of (h, w, 3) places in m and (h, w) faces: (h, w) or (h, w, 1 to 4) values."""


class PictureSequence:
    """A device with a memory of its own."""

    def __init__(self, device: Device, size: tuple[int, int] = (WIDTH, HEIGHT)) -> None:
        self._device = device
        self._size = size
        self.kept = Kept()

    def picture(
        self,
        scene: SceneSnapshot,
        found: Found = lambda places, faces: np.ones(faces.shape),
        *,
        camera: Camera | None = None,
        jitter: tuple[float, float] = (0.0, 0.0),
        key: str = "",
        scene_key: str = "",
        follows_eye: bool = False,
        with_motion: bool = True,
        owner: str = "test",
        sample_index: int = 0,
        surfaces: Callable[[Float32], Float32] | None = None,
        **settings: float,
    ) -> Picture:
        """The next picture, of a frame of its own. surfaces: what to make of each float image of the G-buffer but its
        geometric normals, (h, w, 4). with_motion: whether the accumulator hears of it. settings: of
        AccumulationSettings."""
        scene = replace(scene, camera=camera or scene.camera)
        width, height = self._size
        space = make_local_space(scene)
        with self._device.current() as context:
            shaders = self._device.shaders
            local = space.scene(scene)
            assert local.camera is not None
            geometry = GpuGeometry(context, local, np.zeros(3))
            view = make_view(local.camera, width, height, geometry.origin, jitter)
            gbuffer = GBufferPass(context, shaders, width, height).render(geometry, view, 0)
            if surfaces is not None:
                for texture in (gbuffer.position, gbuffer.shading_normal):
                    texture.write(surfaces(read_image(texture))[::-1].astype(np.float32).tobytes())
            motion = MotionPass(context, shaders, self.kept, scene, space, width, height).render(gbuffer)
            places = space.world_points(read_image(gbuffer.position)[..., :3])
            faces = read_image(gbuffer.ids)[..., 2]
            values = np.asarray(found(places, faces), np.float32).reshape(height, width, -1)
            upload = context.texture(self._size, values.shape[2], values[::-1].tobytes(), dtype="f4")
            chosen = AccumulationSettings(**settings)  # type: ignore[arg-type]
            accumulator = Accumulator(
                context, shaders, self.kept, owner, width, height, chosen, follows_eye=follows_eye
            )
            given = motion if with_motion else None
            mean = accumulator.render(gbuffer, view, space, upload, key, scene_key, given, sample_index)
            surfaces = motion.surfaces
            before = None if surfaces is None else read_image(surfaces.place)
            return Picture(
                places,
                (read_image(gbuffer.geometric_normal)[..., :3] != 0.0).any(axis=2),
                faces,
                read_image(gbuffer.shading_normal)[..., :3],
                read_image(mean),
                accumulator.images()["history_age"][..., 0],
                accumulator.counters()["history_share"],
                motion.scene,
                None if before is None else space.world_points(before[..., :3]),
                None if before is None else before[..., 3] == 1.0,
                None if surfaces is None else read_half(surfaces.normal),
                None if surfaces is None else read_half(surfaces.plane),
                accumulator.images()["motion"],
            )


def read_half(texture: object) -> Float32:
    """(h, w, 3) of an RGBA16F texture, row 0 at the top."""
    width, height = texture.size  # type: ignore[attr-defined]
    data = np.frombuffer(texture.read(), np.float16).reshape(height, width, 4)  # type: ignore[attr-defined]
    return np.asarray(data[::-1, :, :3], np.float32)


def moved(mesh: Mesh, positions: Float64) -> Mesh:
    """`mesh` with its vertices elsewhere, flat."""
    corners = positions[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(mesh, positions=positions, corner_normals=np.repeat(normals[:, None], 3, axis=1).astype(np.float32))


def looking_down_y(place: tuple[float, float, float] = (1.0, -3.0, 1.0), **values: object) -> Camera:
    """A camera before `box_room`."""
    return camera_at(place, (place[0], 1.0, place[2]), **{"lens": 35.0, **values})
