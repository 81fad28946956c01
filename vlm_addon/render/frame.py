# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame, written top to bottom."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..core.array_codec import content_hash
from ..core.effects import EffectPlan, structure_decisions
from ..core.errors import InvalidInput
from ..core.light_mesh import VirtualLightMesh, require_valid
from ..core.progress import Progress, step
from ..core.scene import Camera, Finding, Light, SceneSnapshot
from ..core.scene_facts import ScreenFacts
from ..core.settings import from_mapping
from ..core.world_light import is_lit_by_world, world_lights
from .finished_images import display_image, finished_images, surface_images
from .frame_effects import FrameEffects, effect_settings
from .frame_plan import FramePlanner
from .frame_types import Frame, RenderSettings, require_in_range
from .kept import Kept
from .kept_geometry import kept_geometry
from .lamp_shadows import LampShadows, StillLamps
from .local_space import LocalSpace, is_fine_enough, make_local_space, make_still_space
from .passes.accumulate import AccumulatePass, PictureLight, jitter_offsets
from .passes.direct_light import DirectLightPass
from .passes.gbuffer import GBufferPass
from .passes.screen_census import ScreenCensusPass
from .picture_shares import direct_world_lights, picture_shares
from .shadow_casters import ShadowCasters
from .technique import FrameInputs, SceneInputs, technique_by_name
from .view import make_view, require_usable

if TYPE_CHECKING:
    from .device import Device, PassTimer

# Share of a frame's progress that comes before its first sample.
PREPARED = 0.1


@dataclass(frozen=True)
class _Stage:
    """What a frame is made with. kept: things of earlier frames, or none where nothing is to be used again."""

    device: Device
    settings: RenderSettings
    kept: Kept
    progress: Progress


def render_frame(
    device: Device,
    snapshot: SceneSnapshot,
    light_mesh: VirtualLightMesh | None,
    settings: RenderSettings,
    progress: Progress,
) -> Frame:
    """The picture of `snapshot`. Raises InvalidInput for what cannot be rendered, Cancelled when asked to stop."""
    kept = device.kept if settings.economical else Kept()
    with kept.frame(is_whole=not settings.plan_only):
        return _render(_Stage(device, settings, kept, progress), snapshot, light_mesh)


def _render(stage: _Stage, snapshot: SceneSnapshot, light_mesh: VirtualLightMesh | None) -> Frame:
    device, settings, progress = stage.device, stage.settings, stage.progress
    technique_type = technique_by_name(settings.technique)
    chosen: object = from_mapping(
        technique_type.settings, settings.technique_settings, f"technique {settings.technique!r}"
    )
    chosen_effects = effect_settings(settings)
    technique_type.require_light_mesh(light_mesh)
    _require_renderable(snapshot, light_mesh, settings)
    context, shaders, timer = device.context, device.shaders, device.timer()
    lamps = len(snapshot.lights)
    world: tuple[Light, ...] = ()
    direct_world: tuple[Light, ...] = ()
    if is_lit_by_world(snapshot):
        with timer.measure("world lights"):
            world, direct_world = _world_lights(stage, snapshot)
    with timer.measure("plan"):
        planner = FramePlanner(
            stage.kept, snapshot, light_mesh, (*world, *direct_world), technique_type.facts(chosen), settings
        )
    plan = planner.plan
    shaders = shaders.with_common(_plan_defines(plan))
    if not plan.runs("world_lights"):
        world = direct_world = ()
    lit = replace(snapshot, lights=(*snapshot.lights, *world))
    # From here on nothing is in world space but what is read back.
    space = make_local_space(lit)
    local, camera = _localised(space, lit)
    step(progress, 0.0, "geometry")
    with timer.measure("geometry"):
        geometry = kept_geometry(context, stage.kept, lit, space)
    still = StillLamps(
        ShadowCasters(context, stage.kept, lit, planner.occluders, _caster_space(lit, space)),
        stage.kept,
        lit.lights,
        space,
    )
    cast = _casting(local.lights, plan)
    shadows = LampShadows(context, shaders, geometry, cast, settings.shadow_resolution, still)
    # A sun is the same in every space.
    direct_shadows = shadows.for_lights((*shadows.lights[:lamps], *_casting(direct_world, plan)))
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
        structures=device.light_structures.kept_in(stage.kept),
        kept=stage.kept,
        settings=settings,
        progress=_within(progress, 0.0, PREPARED),
        plan=plan,
    )
    technique = technique_type(scene, chosen) if plan.runs("indirect_light") and not settings.plan_only else None
    direct_light = DirectLightPass(context, shaders, settings.width, settings.height)
    gbuffer_pass = GBufferPass(context, shaders, settings.width, settings.height)
    accumulate = AccumulatePass(
        context,
        shaders,
        settings.width,
        settings.height,
        snapshot.environment,
        every_output=settings.buffers,
    )
    effects = FrameEffects(scene, technique, chosen_effects, lamps)
    shares = picture_shares(direct_shadows.lights, settings.samples)
    census = ScreenCensusPass(context, shaders)

    for sample, jitter in enumerate(jitter_offsets(settings.samples)):
        view = make_view(camera, settings.width, settings.height, geometry.origin, tuple(jitter))
        with timer.measure("G-buffer"):
            gbuffer = gbuffer_pass.render(geometry, view, sample)
        screen: ScreenFacts | None = None
        if planner.asks_screen:
            with timer.measure("screen census"):
                screen = census.render(gbuffer, space)
        plan = planner.picture(screen)
        if settings.plan_only:
            break
        share = (1.0 - PREPARED) / settings.samples
        frame = FrameInputs(view, gbuffer, sample, _within(progress, PREPARED + sample * share, share))
        direct, irradiance = None, None
        if plan.runs("direct_light"):
            picture_lamps = planner.lamp_shares(screen, (*snapshot.lights, *direct_world), shares[sample])
            with timer.measure("direct light"):
                direct = direct_light.render(
                    gbuffer,
                    direct_shadows,
                    view,
                    sample,
                    settings.samples,
                    settings.shadow_samples,
                    picture_lamps,
                    has_highlights=plan.runs("direct_specular"),
                )
        if technique is not None and plan.runs("indirect_light"):
            irradiance = technique.indirect(frame)
        openness = effects.openness(plan, frame) if irradiance is not None else None
        specular = effects.specular(plan, frame, PictureLight(direct, irradiance, openness))
        with timer.measure("accumulate"):
            light = PictureLight(direct, irradiance, openness, specular)
            accumulate.add(gbuffer, light, view, snapshot.world_radiance, 1.0 / settings.samples)
        step(frame.progress, 1.0, "samples")

    if settings.plan_only:
        return _plan_alone(device, planner, stage, timer)
    with timer.measure("read back"):
        sums = accumulate.read()
    images, findings = finished_images(sums)
    if settings.buffers:
        images["coverage"] = np.ascontiguousarray(sums["direct"][..., 3:])
        images |= surface_images(gbuffer_pass, geometry, camera, settings, space)
        images |= effects.images() | ({} if technique is None else technique.images())
    if settings.display:
        with timer.measure("tone mapping"):
            images["display"] = display_image(device, images["combined"])
    counters = {
        "triangles": geometry.triangle_count,
        "lights": lamps,
        "world_lights": len(world),
        "world_lights_direct": len(direct_world),
        "samples": settings.samples,
        **({} if technique is None else technique.counters()),
    }
    findings += _scene_findings(snapshot, light_mesh)
    reasons = () if technique is None else tuple(technique.reasons())
    plan = _whole_plan(planner, stage)
    return Frame(images, timer.timings(), counters, device.name, timer.kind, tuple(findings), reasons, plan)


def _plan_alone(device: Device, planner: FramePlanner, stage: _Stage, timer: PassTimer) -> Frame:
    return Frame({}, timer.timings(), {}, device.name, timer.kind, plan=_whole_plan(planner, stage))


def _whole_plan(planner: FramePlanner, stage: _Stage) -> EffectPlan:
    """With what was used again; parts of a thing are told with it."""
    told = stage.kept.events()
    events = {kind: (reuse.built, reuse.reused) for kind, reuse in told.items() if kind.rpartition(" ")[0] not in told}
    return replace(planner.plan, structures=structure_decisions(events))


def _require_renderable(snapshot: SceneSnapshot, light_mesh: VirtualLightMesh | None, settings: RenderSettings) -> None:
    """Raises InvalidInput."""
    require_in_range(settings)
    if snapshot.camera is None:
        raise InvalidInput(f"scene {snapshot.name!r}", "it has no camera", "add one and make it the active camera")
    require_usable(snapshot.camera)
    for light in snapshot.lights:
        if not np.isfinite(light.power).all():
            raise InvalidInput(f"light {light.name!r}", f"its power is {light.power}", "give it a finite power")
    if light_mesh is not None:
        require_valid(light_mesh)


def _world_lights(stage: _Stage, snapshot: SceneSnapshot) -> tuple[tuple[Light, ...], tuple[Light, ...]]:
    """The lights of the world of `snapshot`, and those for direct light. Raises InvalidInput."""
    world, settings = (snapshot.world_radiance, snapshot.environment), stage.settings
    content = content_hash(list(world))

    def kept_lights(kind: str, count: int) -> tuple[Light, ...]:
        return stage.kept.get(kind, f"{content} {count}", lambda: world_lights(*world, count))

    lights = kept_lights("world_lights", settings.world_lights)
    direct_count = direct_world_lights(settings.world_lights, settings.samples)
    return lights, kept_lights("direct_world_lights", direct_count)


def _caster_space(world: SceneSnapshot, space: LocalSpace) -> LocalSpace:
    """Where shadow maps are drawn: where no camera moves them, if that has digits enough, else in the frame's space."""
    still = make_still_space(*world.bounds())
    assert world.camera is not None
    return still if is_fine_enough(still, world.camera) else space


def _plan_defines(plan: EffectPlan) -> dict[str, int | float | bool | str]:
    """Of all shaders of a frame: what is not called for is not in them."""
    absent = {"ALL_DIFFUSE": "layered_materials", "NO_TAGS": "light_tags"}
    return {name: True for name, effect in absent.items() if not plan.runs(effect)}


def _casting(lights: Sequence[Light], plan: EffectPlan) -> tuple[Light, ...]:
    """`lights` with shadows where the plan has any."""
    return tuple(lights if plan.runs("shadows") else (replace(light, casts_shadow=False) for light in lights))


def _localised(space: LocalSpace, snapshot: SceneSnapshot) -> tuple[SceneSnapshot, Camera]:
    """The scene and its camera in local space."""
    local = space.scene(snapshot)
    assert local.camera is not None
    return local, local.camera


def _within(progress: Progress, start: float, share: float) -> Progress:
    """Progress of a part of the work that begins at `start` and takes `share` of it all."""
    return lambda fraction, label: progress(start + fraction * share, label)


def _scene_findings(snapshot: SceneSnapshot, light_mesh: VirtualLightMesh | None) -> list[Finding]:
    glows = any(max(material.emission) > 0.0 for material in snapshot.materials)
    shines = light_mesh is not None and bool((light_mesh.emission > 0.0).any())
    if snapshot.lights or glows or shines or not snapshot.triangle_count:
        return []
    return [Finding(f"scene {snapshot.name!r}", "nothing lights its surfaces", "add a lamp or an emissive material")]
