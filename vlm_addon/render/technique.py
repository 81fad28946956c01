# SPDX-License-Identifier: GPL-3.0-or-later
"""What a technique of indirect light is, and the list of those in `techniques/`."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

from ..core.effects import EffectPlan
from ..core.errors import InvalidInput
from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress
from ..core.scene import Float32, SceneSnapshot
from ..core.scene_facts import TechniqueFacts
from . import techniques
from .frame_types import RenderSettings
from .geometry import GpuGeometry
from .kept import Kept
from .lamp_shadows import LampShadows
from .light_structures import LightStructures
from .local_space import LocalSpace
from .passes.gbuffer import GBuffer
from .passes.rsm import LampReflections
from .shader_library import ShaderLibrary
from .view import View
from .virtual_lights import GpuVirtualLights

if TYPE_CHECKING:
    import moderngl

    from .device import PassTimer


KNOWN_BIAS = "Known bias:"


@dataclass(frozen=True)
class SceneInputs:
    """What stays the same over the samples of a frame.

    light_mesh: None where the caller gave none. world, world_lights: snapshot and light mesh in world space; space:
    where the others are. structures, kept: what the
    device keeps over frames. progress: of the work before the first sample. plan: of the frame, before there was a
    picture.
    """

    context: moderngl.Context
    shaders: ShaderLibrary
    timer: PassTimer
    snapshot: SceneSnapshot
    geometry: GpuGeometry
    shadows: LampShadows
    light_mesh: VirtualLightMesh | None
    world: SceneSnapshot
    world_lights: VirtualLightMesh | None
    space: LocalSpace
    structures: LightStructures
    kept: Kept
    settings: RenderSettings
    progress: Progress
    plan: EffectPlan


@dataclass(frozen=True)
class FrameInputs:
    """One jittered picture of the scene. progress: of this picture alone."""

    view: View
    gbuffer: GBuffer
    sample_index: int
    progress: Progress


@dataclass(frozen=True)
class NoSettings:
    """Of a technique that has nothing to set."""


class Technique(ABC):
    """One way to find the indirect light; made anew for each frame. Its docstring states its KNOWN_BIAS."""

    name: ClassVar[str]
    label: ClassVar[str]
    description: ClassVar[str]
    settings: ClassVar[type] = NoSettings
    needs_light_mesh: ClassVar[bool] = False

    @classmethod
    def facts(cls, settings: Any) -> TechniqueFacts:
        """What it finds by itself with these settings: indirect light that nothing occludes, and effects add what shows
        in glossy surfaces, unless a technique says otherwise."""
        return TechniqueFacts(cls.name)

    def __init__(self, scene: SceneInputs, settings: Any) -> None:
        """Does what is needed once for all samples of a frame. settings: an instance of `settings`.

        Raises InvalidInput where the technique needs a light mesh and there is none.
        """
        self.require_light_mesh(scene.light_mesh)
        self.scene = scene
        self.chosen = settings

    @classmethod
    def require_light_mesh(cls, light_mesh: VirtualLightMesh | None) -> None:
        """Raises InvalidInput where the technique needs a light mesh and there is none."""
        if cls.needs_light_mesh and not light_mesh:
            raise InvalidInput(f"technique {cls.name!r}", "the scene has no virtual light mesh", "bake one first")

    @classmethod
    def known_bias(cls) -> str:
        """What is wrong with it by its nature: what its docstring says after KNOWN_BIAS."""
        return " ".join((inspect.getdoc(cls) or "").partition(KNOWN_BIAS)[2].split())

    @abstractmethod
    def indirect(self, frame: FrameInputs) -> moderngl.Texture | None:
        """Irradiance of each pixel in W/m², RGBA32F of the G-buffer's size; None for none at all."""

    def specular(self) -> moderngl.Texture | None:
        """Radiance in W/(m² sr) that specular layers send to the eye beside direct light, RGBA32F of the G-buffer's
        size; None for none. Asked for after `indirect`, of the same picture; it is in the finished picture alone."""
        return None

    def reflecting_lights(self) -> tuple[GpuVirtualLights, moderngl.Buffer] | None:
        """Lights that show in glossy surfaces, and the radiosity of each (vec4, rgb in W/m²); None for none."""
        return None

    def lamp_maps(self) -> LampReflections | None:
        """The reflective shadow maps that it has drawn, so that effects draw no others; None for none."""
        return None

    def counters(self) -> dict[str, float]:
        """What the technique counted so far in this frame."""
        return {}

    def images(self) -> dict[str, Float32]:
        """Its intermediate buffers after the last sample, (h, w, c) linear, row 0 at the top, for people to look at.

        Asked for where every buffer is written; names start with the technique's own.
        """
        return {}

    def reasons(self) -> list[str]:
        """Why it does something in another way than was asked for, a sentence each."""
        return []


@lru_cache(maxsize=1)
def technique_list() -> tuple[type[Technique], ...]:
    """The techniques in the files of `techniques/`, by name. An import error there is raised."""
    found: dict[str, type[Technique]] = {}
    for module_info in pkgutil.iter_modules(techniques.__path__):
        module = importlib.import_module(f"{techniques.__name__}.{module_info.name}")
        for _, member in inspect.getmembers(module, inspect.isclass):
            is_own = member.__module__ == module.__name__
            if is_own and issubclass(member, Technique) and not inspect.isabstract(member):
                found[member.name] = member
    return tuple(found[name] for name in sorted(found))


def technique_by_name(name: str) -> type[Technique]:
    """Raises InvalidInput that lists the names there are."""
    by_name = {technique.name: technique for technique in technique_list()}
    if name not in by_name:
        raise InvalidInput(f"technique {name!r}", "no such technique", f"use one of: {', '.join(by_name)}")
    return by_name[name]
