# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of the light of virtual lights gets to each pixel: a few rays through the octree, used by the pixels around.

A ratio estimator (Heitz, Hill and McGuire 2018): the sum over all lights stays as it is and is multiplied by the share
of some picked light that gets there. Picks are in proportion to what each light gives to the pixel, spread over any
4 x 4 pixels so that these together have 16 times as many, and both sides of the share are means over these pixels.
Where all is visible the share is 1, so nothing of the sum is lost or made noisy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ..core.progress import Progress
from ..core.scene import Float32
from ..core.spread_pattern import SIDE
from .light_points import GpuLightPoints
from .light_sums import LightSum
from .passes.accumulate import read_image
from .passes.filter import FilterSettings, GeometryFilterPass
from .passes.light_picks import LightPicks
from .passes.pick_points import PickPointsPass
from .passes.shadow_rays import ShadowRatioPass, ShadowRayPass, ShadowRays
from .scene_octree import finer_text, fitted_octree
from .technique import FrameInputs, SceneInputs

if TYPE_CHECKING:
    import moderngl


class VisibilitySettings(Protocol):
    """What a technique's settings say of visibility rays; see core/settings.py for each."""

    visibility_rays: int
    octree_resolution: int
    exact_reach: int
    filter: str
    filter_distance: float
    filter_cosine: float


class OctreeVisibility:
    """Rays for the pictures of one frame."""

    def __init__(self, scene: SceneInputs, light_sum: LightSum, settings: VisibilitySettings) -> None:
        """Builds the octree where none is kept. Raises DeviceError where the device's blocks are too small."""
        assert scene.light_mesh is not None
        context, shaders = scene.context, scene.shaders
        size = scene.settings.width, scene.settings.height
        self._scene, self._sum, self._chosen = scene, light_sum, settings
        with scene.timer.measure("octree"):
            self._octree = fitted_octree(context, shaders, scene.kept, scene.world, settings.octree_resolution)
        self._points = GpuLightPoints(context, scene.light_mesh, scene.geometry.origin)
        self._picks = LightPicks(context, *size, settings.visibility_rays)
        self._pick_points = PickPointsPass(context, shaders)
        self._rays = ShadowRayPass(context, shaders, *size)
        self._filters = [GeometryFilterPass(context, shaders, *size, SIDE) for _ in range(2)]
        self._filter_settings = FilterSettings(settings.filter, settings.filter_distance, settings.filter_cosine)
        self._ratio = ShadowRatioPass(context, shaders, *size)
        self._unfiltered: Float32 | None = None

    def render(self, frame: FrameInputs, irradiance: moderngl.Texture, progress: Progress) -> moderngl.Texture:
        """What of `irradiance`, W/m², of the light sum's last picture, gets there; the next call overwrites it."""
        timer, gbuffer, picks = self._scene.timer, frame.gbuffer, self._picks
        with timer.measure("pick lights"):
            picks.sample_index = frame.sample_index
            self._sum.pick(picks, gbuffer, lambda done, label: progress(0.5 * done, "pick lights"))
            lights, radiosity = self._sum.lights, self._sum.radiosity
            self._pick_points.render(picks, gbuffer, lights, radiosity, self._points, self._sum.forest)
        with timer.measure("visibility rays"):
            rays = self._rays.render(
                picks,
                gbuffer,
                irradiance,
                radiosity,
                self._points,
                self._octree,
                self._scene.space,
                self._chosen.exact_reach,
                lambda done, label: progress(0.5 + 0.5 * done, label),
            )
        if self._scene.settings.buffers:
            self._ratio.render(irradiance, rays)
            self._unfiltered = read_image(self._ratio.ratio)[..., :3].copy()
        with timer.measure("visibility filter"):
            textures = zip(self._filters, (rays.shadowed, rays.unshadowed), strict=True)
            filtered = [each.render(gbuffer, texture, frame.view, self._filter_settings) for each, texture in textures]
            return self._ratio.render(irradiance, ShadowRays(*filtered))

    def counters(self) -> dict[str, float]:
        """Of ShadowRayPass and of the octree."""
        return {**self._rays.counters(), **self._octree.counters()}

    def reasons(self) -> list[str]:
        """Why the octree is another one than was asked for."""
        text = finer_text(self._octree, self._chosen.octree_resolution)
        return [text] if text else []

    def images(self) -> dict[str, Float32]:
        """Of the last picture: the share of the light that gets there, and the same before the filter."""
        if self._unfiltered is None:
            return {}
        return {
            "visibility": read_image(self._ratio.ratio)[..., :3].copy(),
            "visibility_unfiltered": self._unfiltered,
        }
