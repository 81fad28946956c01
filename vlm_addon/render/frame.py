# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame, written top to bottom."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..core.array_codec import content_hash
from ..core.errors import InvalidInput
from ..core.light_mesh import VirtualLightMesh, require_valid
from ..core.progress import Progress, step
from ..core.scene import Camera, Finding, Float32, Light, SceneSnapshot
from ..core.settings import from_mapping
from ..core.world_light import is_lit_by_world, world_lights
from .frame_types import Frame, RenderSettings, require_in_range
from .geometry import GpuGeometry
from .local_space import LocalSpace, make_local_space
from .passes.accumulate import AccumulatePass, jitter_offsets, read_image
from .passes.direct_light import DirectLightPass
from .passes.gbuffer import GBufferPass
from .passes.shadow_map import LampShadows
from .passes.tonemap import ToneMapPass
from .picture_shares import direct_world_lights, picture_shares
from .technique import FrameInputs, SceneInputs, technique_by_name
from .view import make_view, require_usable

if TYPE_CHECKING:
    from .device import Device

NO_SURFACE = -1
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
    technique_type = technique_by_name(settings.technique)
    chosen: object = from_mapping(
        technique_type.settings, settings.technique_settings, f"technique {settings.technique!r}"
    )
    _require_renderable(snapshot, light_mesh, settings)
    context, shaders, timer = device.context, device.shaders, device.timer()
    lamps = len(snapshot.lights)
    direct_world: tuple[Light, ...] = ()
    if is_lit_by_world(snapshot):
        with timer.measure("world lights"):
            snapshot, direct_world = _with_world_lights(device, snapshot, settings)
    width, height = settings.width, settings.height
    # From here on nothing is in world space but what is read back.
    space = make_local_space(snapshot)
    local, camera = _localised(space, snapshot)
    local_lights = None if light_mesh is None else space.light_mesh(light_mesh)
    step(progress, 0.0, "geometry")
    with timer.measure("geometry"):
        geometry = GpuGeometry(context, local, np.zeros(3))
    shadows = LampShadows(context, shaders, geometry, local.lights, settings.shadow_resolution)
    # A sun is the same in every space.
    direct_shadows = shadows.for_lights((*local.lights[:lamps], *direct_world))
    scene = SceneInputs(
        context,
        shaders,
        timer,
        local,
        geometry,
        shadows,
        local_lights,
        snapshot,
        light_mesh,
        space,
        device.light_structures,
        device.kept,
        settings,
        _within(progress, 0.0, PREPARED),
    )
    technique = technique_type(scene, chosen)
    direct_light = DirectLightPass(context, shaders, width, height)
    gbuffer_pass = GBufferPass(context, shaders, width, height)
    accumulate = AccumulatePass(context, shaders, width, height, snapshot.environment)
    shares = picture_shares(direct_shadows.lights, settings.samples)

    for sample, jitter in enumerate(jitter_offsets(settings.samples)):
        view = make_view(camera, width, height, geometry.origin, tuple(jitter))
        with timer.measure("G-buffer"):
            gbuffer = gbuffer_pass.render(geometry, view, sample)
        with timer.measure("direct light"):
            direct = direct_light.render(
                gbuffer, direct_shadows, view, sample, settings.samples, settings.shadow_samples, shares[sample]
            )
        share = (1.0 - PREPARED) / settings.samples
        sample_progress = _within(progress, PREPARED + sample * share, share)
        irradiance = technique.indirect(FrameInputs(view, gbuffer, sample, sample_progress))
        with timer.measure("accumulate"):
            weight = 1.0 / settings.samples
            specular = technique.specular()
            accumulate.add(gbuffer, direct, irradiance, view, snapshot.world_radiance, weight, specular)
        step(sample_progress, 1.0, "samples")

    with timer.measure("read back"):
        sums = accumulate.read()
    images, findings = _finished_images(sums)
    if settings.buffers:
        images["coverage"] = np.ascontiguousarray(sums["direct"][..., 3:])
        images |= _surface_images(gbuffer_pass, geometry, camera, settings, space)
        images |= technique.images()
    else:
        del images["irradiance"]
    if settings.display:
        with timer.measure("tone mapping"):
            images["display"] = _display_image(device, images["combined"])
    counters = {
        "triangles": geometry.triangle_count,
        "lights": lamps,
        "world_lights": len(snapshot.lights) - lamps,
        "world_lights_direct": len(direct_world),
        "samples": settings.samples,
        **technique.counters(),
    }
    findings += _scene_findings(snapshot, light_mesh)
    reasons = tuple(technique.reasons())
    return Frame(images, timer.timings(), counters, device.name, timer.kind, tuple(findings), reasons)


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


def _with_world_lights(
    device: Device, snapshot: SceneSnapshot, settings: RenderSettings
) -> tuple[SceneSnapshot, tuple[Light, ...]]:
    """`snapshot` with the lights of its world after its lamps, and those for direct light. Raises InvalidInput."""
    world, count = (snapshot.world_radiance, snapshot.environment), settings.world_lights
    content = content_hash(list(world))

    def kept_lights(kind: str, count: int) -> tuple[Light, ...]:
        return device.kept.get(kind, f"{content} {count}", lambda: world_lights(*world, count))

    lights = kept_lights("world_lights", count)
    direct = kept_lights("direct_world_lights", direct_world_lights(count, settings.samples))
    return replace(snapshot, lights=(*snapshot.lights, *lights)), direct


def _localised(space: LocalSpace, snapshot: SceneSnapshot) -> tuple[SceneSnapshot, Camera]:
    """The scene and its camera in local space."""
    local = space.scene(snapshot)
    assert local.camera is not None
    return local, local.camera


def _within(progress: Progress, start: float, share: float) -> Progress:
    """Progress of a part of the work that begins at `start` and takes `share` of it all."""
    return lambda fraction, label: progress(start + fraction * share, label)


def _finished_images(sums: dict[str, Float32]) -> tuple[dict[str, Float32], list[Finding]]:
    """The pictures with every value finite and at least 0, and what had to be changed for that."""
    images, findings = {}, []
    for name, values in sums.items():
        values = values if name == "combined" else values[..., :3]
        broken = ~np.isfinite(values).all(axis=2)
        if broken.any():
            problem = f"{int(broken.sum())} pixels were not finite"
            findings.append(Finding(f"image {name!r}", problem, "set to 0; look for broken values in the materials"))
        clean = np.where(broken[..., None], 0.0, np.maximum(values, 0.0))
        images[name] = np.ascontiguousarray(clean, np.float32)
    return images, findings


def _display_image(device: Device, image: Float32) -> Float32:
    """RGBA, display-linear, of a picture of linear RGBA."""
    height, width = image.shape[:2]
    picture = device.context.texture((width, height), 4, np.ascontiguousarray(image[::-1]).tobytes(), dtype="f4")
    return read_image(ToneMapPass(device.context, device.shaders, width, height).render(picture))


def _surface_images(
    gbuffer_pass: GBufferPass, geometry: GpuGeometry, camera: Camera, settings: RenderSettings, space: LocalSpace
) -> dict[str, Float32]:
    """What shows at the pixels' centres: world positions in m, normals, base colour, depth in m, ids."""
    gbuffer = gbuffer_pass.render(geometry, make_view(camera, settings.width, settings.height, geometry.origin), 0)
    position, normal, base_color, ids = (
        read_image(texture) for texture in (gbuffer.position, gbuffer.shading_normal, gbuffer.base_color, gbuffer.ids)
    )
    shown = np.any(normal[..., :3] != 0.0, axis=2, keepdims=True)
    images = {
        "position": np.where(shown, space.world_points(position[..., :3]), 0.0),
        "normal": normal[..., :3],
        "albedo": base_color[..., :3],
        "depth": position[..., 3:] * space.unit,
    }
    for channel, name in enumerate(("material_id", "tag_id", "face_id")):
        images[name] = np.where(shown, ids[..., channel : channel + 1], NO_SURFACE)
    return {name: np.ascontiguousarray(image, np.float32) for name, image in images.items()}


def _scene_findings(snapshot: SceneSnapshot, light_mesh: VirtualLightMesh | None) -> list[Finding]:
    glows = any(max(material.emission) > 0.0 for material in snapshot.materials)
    shines = light_mesh is not None and bool((light_mesh.emission > 0.0).any())
    if snapshot.lights or glows or shines or not snapshot.triangle_count:
        return []
    return [Finding(f"scene {snapshot.name!r}", "nothing lights its surfaces", "add a lamp or an emissive material")]
