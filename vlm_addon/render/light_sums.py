# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to sum the virtual lights at the pixels of a frame: all, by clusters within a tolerance, or by grid cells."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from ..core.cell_limit import Occupancy, overflow_text
from ..core.progress import Progress
from ..core.range_grid import RangeSettings
from .baked_lights import BakedLights
from .light_forest import GpuLightForest, make_forest
from .passes.gbuffer import GBuffer
from .passes.light_picks import LightPicks
from .passes.phase_one import read_radiosity
from .passes.phase_two import PhaseTwoPass
from .passes.phase_two_clustered import ClusteredPhaseTwoPass
from .passes.phase_two_range import RangePhaseTwoPass
from .technique import SceneInputs
from .virtual_lights import GpuVirtualLights

if TYPE_CHECKING:
    import moderngl


FOREST = "light forest"


class LightSum(ABC):
    """One way to sum the lights of a frame. kinds: of the structures that it needs. forest: of the clusters that it
    picks, if any."""

    kinds: tuple[str, ...] = ()
    forest: GpuLightForest | None = None

    def __init__(
        self,
        scene: SceneInputs,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        baked: BakedLights | None = None,
    ) -> None:
        """radiosity: of PhaseOnePass. baked: visibility that each light is multiplied by; its rows are to be found
        before each picture."""
        self.scene = scene
        self.lights = lights
        self.radiosity = radiosity

    @abstractmethod
    def render(self, gbuffer: GBuffer, progress: Progress) -> moderngl.Texture:
        """Irradiance of each pixel in W/m², RGBA32F."""

    @abstractmethod
    def pick(self, picks: LightPicks, gbuffer: GBuffer, progress: Progress) -> None:
        """Fills `picks` from what the last `render`, of the same G-buffer, added up."""

    @abstractmethod
    def counters(self) -> dict[str, float]:
        """What was counted so far."""

    def reasons(self) -> list[str]:
        """Why light is missing in it, a sentence each."""
        return []


class FullSum(LightSum):
    """Every light for every pixel."""

    def __init__(
        self,
        scene: SceneInputs,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        baked: BakedLights | None = None,
    ) -> None:
        super().__init__(scene, lights, radiosity, baked)
        size = scene.settings.width, scene.settings.height
        seen = None if baked is None else baked.of_lights()
        self._pass = PhaseTwoPass(scene.context, scene.shaders, *size, seen)
        self._pictures = 0

    def render(self, gbuffer: GBuffer, progress: Progress) -> moderngl.Texture:
        """Irradiance of each pixel in W/m², RGBA32F."""
        self._pictures += 1
        return self._pass.render(gbuffer, self.lights, self.radiosity, progress)

    def pick(self, picks: LightPicks, gbuffer: GBuffer, progress: Progress) -> None:
        """Of all lights."""
        self._pass.pick(picks, gbuffer, self.lights, self.radiosity, progress)

    def counters(self) -> dict[str, float]:
        """For how many pairs of a light and a pixel of a sample they were summed."""
        pixels = self.scene.settings.width * self.scene.settings.height
        return {"evaluations": self._pictures * pixels * self.lights.count, "evaluated_per_pixel": self.lights.count}


class ClusteredSum(LightSum):
    """Near lights one by one, far ones by clusters, within a tolerance."""

    kinds = ("static_tree", "dynamic_tree", "window_factor", "scale", "static_clusters", "dynamic_clusters")

    def __init__(
        self,
        scene: SceneInputs,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        baked: BakedLights | None,
        tolerance: float,
    ) -> None:
        super().__init__(scene, lights, radiosity, baked)
        assert scene.world_lights is not None
        with scene.timer.measure("relight"):
            values = read_radiosity(radiosity, lights.count)
            found = scene.structures.trees(scene.world, scene.world_lights, values, tolerance)
            self._window_factor, trees = found.window_factor, list(found.trees)

            def upload() -> GpuLightForest:
                return GpuLightForest(scene.context, make_forest(trees, scene.space, lights.count))

            self.forest = scene.kept.several(FOREST, scene.kept.digests.of(found.key, scene.space), upload)
        size = scene.settings.width, scene.settings.height
        seen = None if baked is None else baked.of_trees(trees)
        self._pass = ClusteredPhaseTwoPass(scene.context, scene.shaders, *size, seen)

    def render(self, gbuffer: GBuffer, progress: Progress) -> moderngl.Texture:
        """Irradiance of each pixel in W/m², RGBA32F."""
        assert self.forest is not None
        return self._pass.render(gbuffer, self.lights, self.radiosity, self.forest, progress)

    def pick(self, picks: LightPicks, gbuffer: GBuffer, progress: Progress) -> None:
        """Of the lights and clusters that count at each pixel."""
        assert self.forest is not None
        self._pass.pick(picks, gbuffer, self.lights, self.radiosity, self.forest, progress)

    def counters(self) -> dict[str, float]:
        """evaluated_per_pixel: lights and clusters in the list of a pixel's tile, mean over tiles that show a surface;
        those that face away or lie below the horizon of all of it are still left out. window_factor: see
        core.window_factor."""
        return {
            "window_factor": self._window_factor,
            "lists_entries": self._pass.entries,
            "lists_bytes": self._pass.nbytes,
            "evaluated_per_pixel": self._pass.entries / max(self._pass.tiles, 1),
        }


class CellSum(LightSum):
    """The lights of the pixel's cell in light grids of range mode."""

    kinds = ("static_grid", "dynamic_grid")

    def __init__(
        self,
        scene: SceneInputs,
        lights: GpuVirtualLights,
        radiosity: moderngl.Buffer,
        baked: BakedLights | None,
        settings: RangeSettings,
    ) -> None:
        super().__init__(scene, lights, radiosity, baked)
        self._max_lights = settings.max_lights
        size = scene.settings.width, scene.settings.height
        seen = None if baked is None else baked.of_lights()
        self._pass = RangePhaseTwoPass(scene.context, scene.shaders, *size, seen)
        assert scene.world_lights is not None
        with scene.timer.measure("light grid"):
            self._grids = scene.structures.range_grids(
                scene.context, scene.shaders, scene.world, scene.world_lights, settings, scene.progress
            )

    def render(self, gbuffer: GBuffer, progress: Progress) -> moderngl.Texture:
        """Irradiance of each pixel in W/m², RGBA32F."""
        space, bounds = self.scene.space, self.scene.world.bounds()
        return self._pass.render(gbuffer, self.lights, self.radiosity, self._grids, space, bounds, progress)

    def pick(self, picks: LightPicks, gbuffer: GBuffer, progress: Progress) -> None:
        """Of the lights of each pixel's cell."""
        space, bounds = self.scene.space, self.scene.world.bounds()
        self._pass.pick(picks, gbuffer, self.lights, self.radiosity, self._grids, space, bounds, progress)

    def counters(self) -> dict[str, float]:
        """lists_entries: pairs of a light and a block of cells in the grids' lists. The others are of full cells."""
        return {
            "lists_entries": sum(grid.lists.pairs for grid in self._grids),
            "overflowing_cells": sum(len(occupancy.overflowing_cells) for occupancy in self._occupancies),
            "dropped_entries": sum(occupancy.dropped_entries for occupancy in self._occupancies),
        }

    def reasons(self) -> list[str]:
        """Which cells are too full for their lights."""
        overflow = overflow_text(self._occupancies, self._max_lights)
        return [f"light is missing: {overflow}"] if overflow else []

    @property
    def _occupancies(self) -> list[Occupancy]:
        return [grid.occupancy for grid in self._grids if grid.occupancy is not None]
