# SPDX-License-Identifier: GPL-3.0-or-later
"""What a frame needs before its first picture: its plan, and the scene on the device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.array_codec import content_hash
from ..core.effects import EffectPlan
from ..core.errors import InvalidInput
from ..core.light_mesh import VirtualLightMesh, require_valid
from ..core.progress import Progress, step
from ..core.scene import Camera, Light, SceneSnapshot
from ..core.settings import from_mapping
from ..core.world_light import is_lit_by_world, world_lights
from .frame_effects import effect_settings
from .frame_plan import FramePlanner
from .frame_types import RenderSettings, require_in_range
from .kept import Kept
from .kept_geometry import kept_geometry
from .lamp_shadows import LampShadows, StillLamps
from .link_table import LIGHT_LINKS
from .local_space import LocalSpace, is_fine_enough, make_local_space, make_still_space
from .picture_shares import direct_world_lights
from .shadow_casters import ShadowCasters
from .technique import SceneInputs, Technique, technique_by_name
from .view import require_usable

if TYPE_CHECKING:
    from .device import Device, PassTimer


@dataclass(frozen=True)
class Request:
    """What a frame is to show. kept: things of earlier frames, or none where nothing is to be used again. progress: of
    what is prepared."""

    device: Device
    snapshot: SceneSnapshot
    light_mesh: VirtualLightMesh | None
    settings: RenderSettings
    kept: Kept
    progress: Progress


@dataclass(frozen=True)
class FrameSetup:
    """What stays the same over the pictures of a frame.

    technique: None where the plan leaves it out. effect_settings: by name of effect. camera: in local space. world,
    direct_world: suns that stand for the world, and those for direct light. direct_shadows: of the lamps and of these.
    """

    request: Request
    planner: FramePlanner
    scene: SceneInputs
    technique: Technique | None
    effect_settings: dict[str, Any]
    camera: Camera
    world: tuple[Light, ...]
    direct_world: tuple[Light, ...]
    direct_shadows: LampShadows


def prepare(request: Request) -> FrameSetup:
    """Raises InvalidInput for what cannot be rendered, Cancelled when asked to stop."""
    snapshot, light_mesh, settings = request.snapshot, request.light_mesh, request.settings
    technique_type = technique_by_name(settings.technique)
    chosen: object = from_mapping(
        technique_type.settings, settings.technique_settings, f"technique {settings.technique!r}"
    )
    chosen_effects = effect_settings(settings)
    technique_type.require_light_mesh(light_mesh)
    _require_renderable(snapshot, light_mesh, settings)
    timer = request.device.timer()
    world: tuple[Light, ...] = ()
    direct_world: tuple[Light, ...] = ()
    if is_lit_by_world(snapshot):
        with timer.measure("world lights"):
            world, direct_world = _world_lights(request)
    with timer.measure("plan"):
        suns = (*world, *direct_world)
        planner = FramePlanner(request.kept, snapshot, light_mesh, suns, technique_type.facts(chosen), settings)
    if not planner.plan.runs("world_lights"):
        world = direct_world = ()
    lit = replace(snapshot, lights=(*snapshot.lights, *world))
    scene, camera = _on_device(request, planner, lit, timer)
    # A sun is the same in every space.
    lamps = scene.shadows.lights[: len(snapshot.lights)]
    direct_shadows = scene.shadows.for_lights((*lamps, *_casting(direct_world, planner.plan)))
    is_needed = planner.plan.runs("indirect_light") and not settings.plan_only
    technique = technique_type(scene, chosen) if is_needed else None
    return FrameSetup(request, planner, scene, technique, chosen_effects, camera, world, direct_world, direct_shadows)


def _on_device(
    request: Request, planner: FramePlanner, lit: SceneSnapshot, timer: PassTimer
) -> tuple[SceneInputs, Camera]:
    """The scene `lit`, with the lights of its world, as passes and techniques see it, and its camera in local space:
    from here on nothing is in world space but what is read back."""
    device, kept, settings, plan = request.device, request.kept, request.settings, planner.plan
    context, shaders = device.context, device.shaders.with_common(_plan_defines(plan, request.light_mesh))
    space = make_local_space(lit)
    local, camera = _localised(space, lit)
    step(request.progress, 0.0, "geometry")
    with timer.measure("geometry"):
        geometry = kept_geometry(context, kept, lit, space)
    casters = ShadowCasters(context, kept, lit, planner.occluders, _caster_space(lit, space))
    still = StillLamps(casters, kept, lit.lights, space)
    shadows = LampShadows(context, shaders, geometry, _casting(local.lights, plan), settings.shadow_resolution, still)
    light_mesh = request.light_mesh
    scene = SceneInputs(
        context=context,
        shaders=shaders,
        timer=timer,
        snapshot=local,
        geometry=geometry,
        shadows=shadows,
        light_mesh=None if light_mesh is None else space.light_mesh(light_mesh),
        world=lit,
        world_lights=light_mesh,
        space=space,
        structures=device.light_structures.kept_in(kept),
        kept=kept,
        settings=settings,
        progress=request.progress,
        plan=plan,
    )
    return scene, camera


def _require_renderable(snapshot: SceneSnapshot, light_mesh: VirtualLightMesh | None, settings: RenderSettings) -> None:
    """Raises InvalidInput."""
    require_in_range(settings)
    if snapshot.camera is None:
        raise InvalidInput(f"scene {snapshot.name!r}", "it has no camera", "add one and make it the active camera")
    require_usable(snapshot.camera)
    for light in snapshot.lights:
        if not np.isfinite(light.power).all():
            raise InvalidInput(f"light {light.name!r}", f"its power is {light.power}", "give it a finite power")
        if min(light.power) < 0.0:
            raise InvalidInput(f"light {light.name!r}", f"its power is {light.power}", "give it a power of at least 0")
    if light_mesh is not None:
        require_valid(light_mesh)


def _world_lights(request: Request) -> tuple[tuple[Light, ...], tuple[Light, ...]]:
    """The lights of the world, and those for direct light. Raises InvalidInput."""
    world, settings = (request.snapshot.world_radiance, request.snapshot.environment), request.settings
    content = content_hash(list(world))

    def kept_lights(kind: str, count: int) -> tuple[Light, ...]:
        return request.kept.get(kind, f"{content} {count}", lambda: world_lights(*world, count))

    lights = kept_lights("world_lights", settings.world_lights)
    direct_count = direct_world_lights(settings.world_lights, settings.samples)
    return lights, kept_lights("direct_world_lights", direct_count)


def _caster_space(world: SceneSnapshot, space: LocalSpace) -> LocalSpace:
    """Where shadow maps are drawn: where no camera moves them, if that has digits enough, else in the frame's space."""
    still = make_still_space(*world.bounds())
    assert world.camera is not None
    return still if is_fine_enough(still, world.camera) else space


def _plan_defines(plan: EffectPlan, light_mesh: VirtualLightMesh | None) -> dict[str, int | float | bool | str]:
    """Of all shaders of a frame: what is not called for is not in them."""
    absent = {"ALL_DIFFUSE": "layered_materials", "NO_TAGS": "light_tags"}
    defines: dict[str, int | float | bool | str] = {
        name: True for name, effect in absent.items() if not plan.runs(effect)
    }
    if light_mesh is not None and len(light_mesh.links):
        defines[LIGHT_LINKS] = True
    return defines


def _casting(lights: Sequence[Light], plan: EffectPlan) -> tuple[Light, ...]:
    """`lights` with shadows where the plan has any."""
    return tuple(lights if plan.runs("shadows") else (replace(light, casts_shadow=False) for light in lights))


def _localised(space: LocalSpace, snapshot: SceneSnapshot) -> tuple[SceneSnapshot, Camera]:
    """The scene and its camera in local space."""
    local = space.scene(snapshot)
    assert local.camera is not None
    return local, local.camera
