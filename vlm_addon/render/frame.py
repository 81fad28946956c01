# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame, written top to bottom."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..core.effects import EffectPlan, structure_decisions
from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress, step
from ..core.scene import Finding, Float32, Float64, SceneSnapshot
from ..core.scene_facts import ScreenFacts
from .finished_images import display_image, finished_images, surface_images
from .frame_effects import FrameEffects
from .frame_setup import FrameSetup, Request, prepare
from .frame_types import Frame, RenderSettings
from .kept import Kept
from .passes.accumulate import AccumulatePass, PictureLight, jitter_offsets
from .passes.direct_light import DirectLightPass
from .passes.gbuffer import GBuffer, GBufferPass
from .passes.screen_census import ScreenCensusPass
from .picture_shares import picture_shares
from .technique import FrameInputs
from .view import make_view

if TYPE_CHECKING:
    import moderngl

    from .device import Device

# Share of a frame's progress that comes before its first sample.
PREPARED = 0.1


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
        setup = prepare(Request(device, snapshot, light_mesh, settings, kept, _within(progress, 0.0, PREPARED)))
        pictures = _Pictures(setup)
        for sample, jitter in enumerate(jitter_offsets(settings.samples)):
            share = (1.0 - PREPARED) / settings.samples
            pictures.add(sample, jitter, _within(progress, PREPARED + sample * share, share))
            if settings.plan_only:
                return _frame(setup, {}, [])
        images, findings = pictures.finished()
        return _frame(setup, images, [*findings, *_scene_findings(snapshot, light_mesh)])


class _Pictures:
    """The jittered pictures of a frame, and their sum."""

    def __init__(self, setup: FrameSetup) -> None:
        scene, settings = setup.scene, setup.request.settings
        passes = scene.context, scene.shaders, settings.width, settings.height
        self._setup = setup
        self._gbuffer = GBufferPass(*passes)
        self._census = ScreenCensusPass(scene.context, scene.shaders, counts_glossy=setup.planner.has_glossy)
        self._direct = DirectLightPass(*passes)
        self._effects = FrameEffects(scene, setup.technique, setup.effect_settings, len(setup.request.snapshot.lights))
        environment = setup.request.snapshot.environment
        self._sum = AccumulatePass(*passes, environment, every_output=settings.buffers)
        self._shares = picture_shares(setup.direct_shadows.lights, settings.samples)

    def add(self, sample: int, jitter: Float64, progress: Progress) -> None:
        """One picture, as far as the plan goes; its G-buffer alone where only the plan is asked for."""
        setup, scene, settings = self._setup, self._setup.scene, self._setup.request.settings
        view = make_view(setup.camera, settings.width, settings.height, scene.geometry.origin, tuple(jitter))
        with scene.timer.measure("G-buffer"):
            gbuffer = self._gbuffer.render(scene.geometry, view, sample)
        screen = self._counted(gbuffer)
        plan = setup.planner.picture(screen)
        if settings.plan_only:
            return
        frame = FrameInputs(view, gbuffer, sample, progress)
        direct = self._direct_light(frame, plan, screen)
        irradiance = None
        if setup.technique is not None and plan.runs("indirect_light"):
            irradiance = setup.technique.indirect(frame)
        openness = self._effects.openness(plan, frame) if irradiance is not None else None
        light = PictureLight(direct, irradiance, openness)
        light = replace(light, specular=self._effects.specular(plan, frame, light))
        with scene.timer.measure("accumulate"):
            self._sum.add(gbuffer, light, view, scene.world.world_radiance, 1.0 / settings.samples)
        step(progress, 1.0, "samples")

    def _counted(self, gbuffer: GBuffer) -> ScreenFacts | None:
        """What the picture shows, where that may change what it needs."""
        if not self._setup.planner.asks_screen:
            return None
        with self._setup.scene.timer.measure("screen census"):
            return self._census.render(gbuffer, self._setup.scene.space)

    def _direct_light(
        self, frame: FrameInputs, plan: EffectPlan, screen: ScreenFacts | None
    ) -> moderngl.Texture | None:
        if not plan.runs("direct_light"):
            return None
        setup, settings = self._setup, self._setup.request.settings
        lights = (*setup.request.snapshot.lights, *setup.direct_world)
        shares = setup.planner.lamp_shares(screen, lights, self._shares[frame.sample_index])
        with setup.scene.timer.measure("direct light"):
            return self._direct.render(
                frame.gbuffer,
                setup.direct_shadows,
                frame.view,
                frame.sample_index,
                settings.samples,
                settings.shadow_samples,
                shares,
                has_highlights=plan.runs("direct_specular"),
            )

    def finished(self) -> tuple[dict[str, Float32], list[Finding]]:
        """The images of the frame, and what had to be changed in them."""
        setup, scene, settings = self._setup, self._setup.scene, self._setup.request.settings
        with scene.timer.measure("read back"):
            sums = self._sum.read()
        images, findings = finished_images(sums)
        if settings.buffers:
            images["coverage"] = np.ascontiguousarray(sums["direct"][..., 3:])
            images |= surface_images(self._gbuffer, scene.geometry, setup.camera, settings, scene.space)
            images |= self._effects.images() | ({} if setup.technique is None else setup.technique.images())
        if settings.display:
            with scene.timer.measure("tone mapping"):
                images["display"] = display_image(setup.request.device, images["combined"])
        return images, findings


def _frame(setup: FrameSetup, images: dict[str, Float32], findings: list[Finding]) -> Frame:
    device, technique, timer = setup.request.device, setup.technique, setup.scene.timer
    counters = {
        "triangles": setup.scene.geometry.triangle_count,
        "lights": len(setup.request.snapshot.lights),
        "world_lights": len(setup.world),
        "world_lights_direct": len(setup.direct_world),
        "samples": setup.request.settings.samples,
        **({} if technique is None else technique.counters()),
    }
    reasons = () if technique is None else tuple(technique.reasons())
    plan = _whole_plan(setup)
    return Frame(images, timer.timings(), counters, device.name, timer.kind, tuple(findings), reasons, plan)


def _whole_plan(setup: FrameSetup) -> EffectPlan:
    """With what was used again; parts of a thing are told with it."""
    told = setup.request.kept.events()
    events = {kind: (reuse.built, reuse.reused) for kind, reuse in told.items() if kind.rpartition(" ")[0] not in told}
    return replace(setup.planner.plan, structures=structure_decisions(events))


def _within(progress: Progress, start: float, share: float) -> Progress:
    """Progress of a part of the work that begins at `start` and takes `share` of it all."""
    return lambda fraction, label: progress(start + fraction * share, label)


def _scene_findings(snapshot: SceneSnapshot, light_mesh: VirtualLightMesh | None) -> list[Finding]:
    glows = any(max(material.emission) > 0.0 for material in snapshot.materials)
    shines = light_mesh is not None and bool((light_mesh.emission > 0.0).any())
    if snapshot.lights or glows or shines or not snapshot.triangle_count:
        return []
    return [Finding(f"scene {snapshot.name!r}", "nothing lights its surfaces", "add a lamp or an emissive material")]
