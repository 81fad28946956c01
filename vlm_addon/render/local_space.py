# SPDX-License-Identifier: GPL-3.0-or-later
"""The space that the renderer works in: near the camera's part of the scene, and as large as every other scene.

float32 holds seven digits of a coordinate. They are spent where the camera is, on lengths that do not depend on how
large the scene is or where in the world it lies, so a scene that is moved or scaled gives the same picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..core.light_mesh import VirtualLightMesh
from ..core.scene import ORTHOGRAPHIC, SUN, Camera, Float32, Float64, Light, SceneSnapshot

HALF_DIAGONAL = 1024.0
"""Of every scene's visible bounds, in local units: fourth powers of a scene's length and of a millionth of it are
both far from the ends of float32."""
GRAIN = 0.25
"""The origin moves in steps of this many local units, so that a small move of the camera rounds nothing anew."""
FLOAT32_STEP = 2.0**-23
FINEST_SHARE = 2.0**-12
"""Of the width of the nearest thing that a camera can see whole: a quarter of a pixel of a picture of a thousand."""
FINEST_SHARE_ORTHOGRAPHIC = 2.0**-18
"""The same of an orthographic picture's width: with more, single pixels at shadows of grazing light differ."""
STILL_GRAIN = 128.0
"""The same of the space that no camera moves: so that an object which widens the scene a little moves nothing else."""


@dataclass(frozen=True)
class LocalSpace:
    """origin: (3,) float64, m in world space. unit: m per local unit of length.

    Radiance, irradiance and everything without length are the same in both spaces.
    """

    origin: Float64
    unit: float

    def scene(self, snapshot: SceneSnapshot) -> SceneSnapshot:
        """`snapshot` with everything that has a place or a length in local units."""
        meshes = tuple(replace(mesh, positions=self.local_points(mesh.positions)) for mesh in snapshot.meshes)
        lights = tuple(self.light(light) for light in snapshot.lights)
        camera = self._camera(snapshot.camera) if snapshot.camera is not None else None
        return replace(snapshot, meshes=meshes, lights=lights, camera=camera)

    def light_mesh(self, light_mesh: VirtualLightMesh) -> VirtualLightMesh:
        """`light_mesh` in local units."""
        samples = replace(light_mesh.samples, positions=self.local_points(light_mesh.samples.positions))
        return replace(light_mesh, vertices=self.local_points(light_mesh.vertices), samples=samples)

    def world_points(self, points: Float32) -> Float64:
        """(..., 3) float64 m in world space of local `points`."""
        return points * self.unit + self.origin

    def local_points(self, points: Float64) -> Float64:
        """(..., 3) local points of `points` in world space."""
        return (points - self.origin) / self.unit

    def to(self, other: LocalSpace) -> tuple[float, Float64]:
        """Scale and (3,) offset that take a point of this space into `other`: scale * point + offset."""
        return self.unit / other.unit, (self.origin - other.origin) / other.unit

    def light(self, light: Light) -> Light:
        """`light` in local units."""
        x, y, z = self.local_points(np.array(light.position, np.float64)).tolist()
        red, green, blue = light.power
        # Irradiance falls with the square of a distance; a sun's is given.
        share = 1.0 if light.kind == SUN else self.unit**-2
        return replace(
            light,
            position=(x, y, z),
            power=(red * share, green * share, blue * share),
            radius=light.radius / self.unit,
            size_x=light.size_x / self.unit,
            size_y=light.size_y / self.unit,
        )

    def _camera(self, camera: Camera) -> Camera:
        matrix = camera.matrix_world.copy()
        matrix[:3, 3] = self.local_points(matrix[:3, 3])
        return replace(
            camera,
            matrix_world=matrix,
            ortho_scale=camera.ortho_scale / self.unit,
            clip_start=camera.clip_start / self.unit,
            clip_end=camera.clip_end / self.unit,
        )


def make_local_space(snapshot: SceneSnapshot) -> LocalSpace:
    """The local space of a scene and its camera.

    Its origin is the place in the visible bounds that is nearest to the camera, but for rounding; without a finite
    camera or extent it falls back to the middle and to metres.
    """
    low, high = snapshot.bounds()
    half_diagonal, usable = _half_diagonal(low, high)
    unit = half_diagonal / HALF_DIAGONAL if usable else 1.0
    middle = 0.5 * (low + high)
    eye = middle if snapshot.camera is None else snapshot.camera.matrix_world[:3, 3]
    if not (usable and np.isfinite(eye).all()):
        return LocalSpace(np.where(np.isfinite(middle), middle, 0.0), unit)
    steps = np.round((np.clip(eye, low, high) - middle) / (GRAIN * unit))
    return LocalSpace(middle + steps * (GRAIN * unit), unit)


def make_still_space(low: Float64, high: Float64) -> LocalSpace:
    """A space for everything between two corners, (3,) m, that is the same from wherever it is seen.

    Its unit is a power of two in m and its origin lies on a coarse grid, so that most things that move leave it as it
    is. Falls back as `make_local_space`.
    """
    half_diagonal, usable = _half_diagonal(low, high)
    middle = 0.5 * (low + high)
    if not usable:
        return LocalSpace(np.where(np.isfinite(middle), middle, 0.0), 1.0)
    unit = 2.0 ** math.ceil(math.log2(half_diagonal / HALF_DIAGONAL))
    return LocalSpace(np.round(middle / (STILL_GRAIN * unit)) * (STILL_GRAIN * unit), unit)


def is_fine_enough(still: LocalSpace, camera: Camera) -> bool:
    """Whether what float32 leaves of a place in `still` is too small to be seen by a camera, (world space, usable),
    however near something is. Otherwise only a space near the camera will do, as in a scene that is a kilometre wide
    and is seen from a hand's breadth."""
    left, right, _, _ = camera.frame(1, 1)
    is_orthographic = camera.kind == ORTHOGRAPHIC
    finest = FINEST_SHARE_ORTHOGRAPHIC if is_orthographic else FINEST_SHARE * camera.clip_start
    return HALF_DIAGONAL * FLOAT32_STEP * still.unit <= finest * (right - left)


def _half_diagonal(low: Float64, high: Float64) -> tuple[float, bool]:
    """Of the box between two corners, and whether it is a finite length above 0."""
    half_diagonal = 0.5 * float(np.linalg.norm(high - low))
    return half_diagonal, bool(np.isfinite(half_diagonal) and half_diagonal > 0.0)
