# SPDX-License-Identifier: GPL-3.0-or-later
"""The Virtual Light Mesh: light that its virtual lights send to each pixel (seed 002, chapters 3 and 4)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.baked_visibility import CELL_COUNTS, MOST_POINTS
from ...core.effects import SKIP
from ...core.light_grid import FEW_LIGHTS, RANGE, TOLERANCE, GridSettings
from ...core.range_grid import RangeSettings
from ...core.scene import Float32
from ...core.scene_facts import TechniqueFacts
from ...core.settings import OWN, setting
from ..baked_lights import BakedLights
from ..light_sums import CellSum, ClusteredSum, FullSum, LightSum
from ..light_visibility import OctreeVisibility
from ..lit_lights import scene_lights, scene_radiosity
from ..octree_settings import OctreeSettings
from ..passes.accumulate import read_image
from ..passes.filter import FilterSettings
from ..passes.light_picks import MOST_PICKS
from ..technique import FrameInputs, SceneInputs, Technique
from ..virtual_lights import GpuVirtualLights

if TYPE_CHECKING:
    import moderngl

ALL = "all"
NONE, OCTREE, BAKED = "none", "octree", "baked"
WITH_OCTREE, WITH_BAKED = ("visibility", OCTREE), ("visibility", BAKED)
SUM_SHARE = 0.4
"""Of a picture's progress, where rays are cast after the sum."""


def _shared(settings_type: type, name: str, only_with: tuple[str, str]) -> Any:
    """The setting `name` of `settings_type`, which counts where another has the value `only_with`."""
    field = next(field for field in dataclasses.fields(settings_type) if field.name == name)
    return dataclasses.field(default=field.default, metadata={**field.metadata, "only_with": only_with})


@dataclass(frozen=True)
class Settings:
    """Which lights are summed for a pixel, and what is in their way."""

    lights: str = setting(
        TOLERANCE,
        "",
        None,
        None,
        "Near lights and clusters of far ones (tolerance), those of the pixel's grid cell (range), or all",
        source="002, 4",
        choices=(TOLERANCE, RANGE, ALL),
    )
    tolerance: float = _shared(GridSettings, "tolerance", ("lights", TOLERANCE))
    grid: int = _shared(GridSettings, "grid", ("lights", RANGE))
    range: float = _shared(GridSettings, "range", ("lights", RANGE))
    max_lights: int = _shared(GridSettings, "max_lights", ("lights", RANGE))
    visibility: str = setting(
        NONE,
        "",
        None,
        None,
        "Whether surfaces stand in the way of indirect light: they do not, as in the thesis (none), a few rays for "
        "each pixel through an octree of the scene tell (octree), which about doubles the time and needs no bake, or "
        "what pieces of surface see of each light is found once for what stands still (baked)",
        source="002, 3.6; " + OWN,
        choices=(NONE, OCTREE, BAKED),
    )
    visibility_rays: int = setting(
        4,
        "rays",
        1,
        MOST_PICKS,
        "For each pixel and sample, shared by the 4 x 4 pixels around: soft shadows get smoother with more, and with "
        "more samples",
        source=OWN,
        only_with=WITH_OCTREE,
    )
    octree_resolution: int = _shared(OctreeSettings, "octree_resolution", WITH_OCTREE)
    exact_reach: int = _shared(OctreeSettings, "exact_reach", WITH_OCTREE)
    filter: str = _shared(FilterSettings, "filter", WITH_OCTREE)
    filter_distance: float = _shared(FilterSettings, "filter_distance", WITH_OCTREE)
    filter_cosine: float = _shared(FilterSettings, "filter_cosine", WITH_OCTREE)
    visibility_cells: int = setting(
        16,
        "cells",
        CELL_COUNTS[0],
        CELL_COUNTS[-1],
        "Along the longest side of the scene, a power of two: shadows are as sharp as cells are small; twice as many "
        "take four times the memory and the time to bake",
        source=OWN,
        only_with=WITH_BAKED,
    )
    visibility_points: int = setting(
        8,
        "points",
        1,
        MOST_POINTS,
        "Of each piece of surface, from which rays are cast to points of each light; more are smoother and take longer "
        "to bake",
        source=OWN,
        only_with=WITH_BAKED,
    )


class VirtualLightMeshTechnique(Technique):
    """One diffuse bounce from the triangles of the light mesh.

    Known bias: each light has one radiosity all over, light that leaves a surface by its specular layer does not
    bounce, and there is one bounce. Without visibility, indirect light is not occluded (seed 002, 3.6). With an octree,
    the rays of the 4 x 4 pixels around are shared, so that shadows are no sharper than that; a ray ends at a source
    sample of its light; farther from its ends than the exact reach whole voxels stand in its way. Baked visibility is
    that of pieces of surface, so that shadows are no sharper than its cells, and next to the end of a wall light of
    its other side reaches as far as a cell; surfaces of which nothing is baked see every light. With a tolerance,
    irradiance may be off by that share; with a range, the light of all lights that are farther away is missing.
    """

    name = "vlm"
    label = "Virtual Light Mesh"
    description = "One diffuse bounce from the virtual lights, exact form factors, with or without occlusion"
    settings = Settings
    needs_light_mesh = True

    @classmethod
    def facts(cls, settings: Any) -> TechniqueFacts:
        """That virtual lights are polygons, and whether something is asked to tell where they are occluded."""
        asks = settings.visibility != NONE
        return TechniqueFacts(
            cls.name,
            knows_visibility=asks,
            asks_visibility=asks,
            has_reflecting_lights=True,
            gains_by_occlusion=True,
        )

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        super().__init__(scene, settings)
        assert scene.light_mesh is not None
        self._lights = scene_lights(scene)
        with scene.timer.measure("phase one"):
            self._radiosity = scene_radiosity(scene)
        before = dict(scene.kept.built)
        self._baked, baked_reasons = self._chosen_bake()
        self._sum = self._chosen_sum(self._baked)
        # For the picture of visibility alone.
        self._unoccluded = self._chosen_sum(None) if self._baked is not None and scene.settings.buffers else None
        self._seen: Float32 | None = None
        kinds = self._sum.kinds if self._baked is None else (*self._sum.kinds, *self._baked.kinds)
        self._built = {f"{kind}_built": scene.kept.built.get(kind, 0) - before.get(kind, 0) for kind in kinds}
        self._visibility, octree_reasons = self._chosen_visibility()
        self._occlusion = [*baked_reasons, *octree_reasons]

    def _chosen_bake(self) -> tuple[BakedLights | None, list[str]]:
        """What the sum is multiplied by, light by light, if anything need, and why not, if it was asked for."""
        if self.chosen.visibility != BAKED:
            return None, []
        decided = self.scene.plan["light_visibility"]
        if decided.action == SKIP:
            return None, [f"no visibility is baked: {decided.reason}"]
        return BakedLights(self.scene, self.chosen), []

    def _chosen_sum(self, baked: BakedLights | None) -> LightSum:
        """How the lights are summed."""
        chosen, inputs = self.chosen, (self.scene, self._lights, self._radiosity, baked)
        if chosen.lights == RANGE:
            return CellSum(*inputs, RangeSettings(chosen.grid, chosen.range, chosen.max_lights))
        if chosen.lights == TOLERANCE and self._lights.count > FEW_LIGHTS:
            return ClusteredSum(*inputs, chosen.tolerance)
        return FullSum(*inputs)

    def _chosen_visibility(self) -> tuple[OctreeVisibility | None, list[str]]:
        """What tells how much of the light gets there, if anything need, and why rays are cast or not, if asked for."""
        if self.chosen.visibility != OCTREE:
            return None, []
        decided = self.scene.plan["light_visibility"]
        if decided.action == SKIP:
            return None, [f"no visibility rays are cast: {decided.reason}"]
        visibility = OctreeVisibility(self.scene, self._sum, self.chosen)
        return visibility, [f"visibility rays are cast: {decided.reason}", *visibility.reasons()]

    def indirect(self, frame: FrameInputs) -> moderngl.Texture:
        """Sum over the lights of radiosity times form factor, and times what gets there."""
        share = 1.0 if self._visibility is None else SUM_SHARE
        if self._baked is not None:
            self._baked.find(frame)
        with self.scene.timer.measure("phase two"):
            irradiance = self._sum.render(frame.gbuffer, lambda done, label: frame.progress(share * done, label))
        if self._unoccluded is not None:
            seen, whole = (read_image(image)[..., :3] for image in (irradiance, self._unoccluded_sum(frame)))
            self._seen = np.where(whole > 0.0, seen / np.where(whole > 0.0, whole, 1.0), 1.0).astype(np.float32)
        if self._visibility is None:
            return irradiance
        return self._visibility.render(
            frame, irradiance, lambda done, label: frame.progress(share + (1.0 - share) * done, label)
        )

    def _unoccluded_sum(self, frame: FrameInputs) -> moderngl.Texture:
        assert self._unoccluded is not None
        with self.scene.timer.measure("phase two without visibility"):
            return self._unoccluded.render(frame.gbuffer, frame.progress)

    def reflecting_lights(self) -> tuple[GpuVirtualLights, moderngl.Buffer]:
        """All lights."""
        return self._lights, self._radiosity

    def counters(self) -> dict[str, float]:
        """Virtual lights, which structures were built in this frame (0: kept), what their lists hold, and rays."""
        seen = [part.counters() for part in (self._visibility, self._baked) if part is not None]
        found = {name: count for counters in seen for name, count in counters.items()}
        return {"virtual_lights": self._lights.count, **self._built, **self._sum.counters(), **found}

    def images(self) -> dict[str, Float32]:
        """Of OctreeVisibility where rays are cast; the share of the light that gets there where visibility is baked."""
        found = {} if self._visibility is None else self._visibility.images()
        if self._seen is not None:
            found["visibility"] = self._seen
        return {f"{self.name}_{name}": image for name, image in found.items()}

    def reasons(self) -> list[str]:
        """Why all lights are summed where a tolerance was asked for, why light is missing with a range, and why rays
        are cast or visibility is baked, or not."""
        seen = [*self._occlusion, *([] if self._baked is None else self._baked.reasons())]
        if self.chosen.lights != TOLERANCE or not isinstance(self._sum, FullSum):
            return [*self._sum.reasons(), *seen]
        text = f"all {self._lights.count} virtual lights are summed: that costs no more than clusters of so few"
        return [text, *seen]
