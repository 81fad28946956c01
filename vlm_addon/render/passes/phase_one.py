# SPDX-License-Identifier: GPL-3.0-or-later
"""What falls on the virtual lights from the lamps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...core.errors import DeviceError
from ...core.light_mesh import VirtualLightMesh
from ...core.progress import Progress, silent, step
from ...core.scene import Float32, Float64
from ..gpu_layout import CONSTANTS, LAMP, SOURCE_SAMPLE
from ..lamp_shadows import LampShadows
from ..shader_library import ShaderLibrary, set_uniforms
from ..shadow_windows import WHOLE_SCENE, ShadowWindow, sample_windows

if TYPE_CHECKING:
    import moderngl

GROUP_SIZE = 64
ANY_WINDOW = -1


class PhaseOnePass:
    """Irradiance at the source samples of each virtual light (seed 002, 3.2)."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary) -> None:
        self._context = context
        self._shader = shaders.compute("passes/phase_one.comp", {"GROUP_SIZE": GROUP_SIZE})
        self._lamp = context.buffer(reserve=LAMP.dtype.itemsize)

    def render(
        self,
        light_mesh: VirtualLightMesh,
        origin: Float64,
        shadows: LampShadows,
        lamps: Sequence[int],
        shadow_samples: int,
        progress: Progress = silent,
    ) -> Float32:
        """(n, 3) float32 W/m²: what falls on each light from `lamps`, rows of `shadows.lights`.

        The weighted mean over the light's source samples, each with its own shadows; soft lamps are the mean over
        `shadow_samples` points. origin: (3,) float64, of the space of light mesh and lamps. Raises DeviceError where
        the samples do not fit the device, Cancelled when `progress` says so.
        """
        count = len(light_mesh)
        if count == 0:
            return np.zeros((0, 3), np.float32)
        samples = source_records(light_mesh, origin)
        self._require_room(samples.nbytes, len(samples))
        windows = _assign_windows(samples, light_mesh, shadows, lamps)
        offsets = light_mesh.samples.offsets.astype(np.int32)
        sources, ends = self._context.buffer(samples.tobytes() or bytes(16)), self._context.buffer(offsets.tobytes())
        irradiance = self._context.buffer(bytes(16 * count))
        runs = [
            (lamp, sample, window)
            for lamp in lamps
            for sample in range(shadows.samples_of(lamp, shadow_samples))
            for window in (windows if shadows.uses_windows(lamp) else {ANY_WINDOW: None})
        ]
        for done, (lamp, sample, window) in enumerate(runs):
            step(progress, done / len(runs), "phase one")
            sample_count = shadows.samples_of(lamp, shadow_samples)
            shadow_map = shadows.shadow_map(lamp, sample, sample_count, window=windows.get(window))
            # New storage: llvmpipe (Mesa 22) lets a write overtake work that still reads the old one.
            self._lamp.orphan()
            self._lamp.write(shadow_map.record.tobytes())
            self._lamp.bind_to_storage_buffer(int(CONSTANTS["LAMP_BINDING"]))
            sources.bind_to_storage_buffer(int(CONSTANTS["SOURCE_SAMPLE_BINDING"]))
            ends.bind_to_storage_buffer(int(CONSTANTS["SOURCE_LIGHT_BINDING"]))
            irradiance.bind_to_storage_buffer(int(CONSTANTS["RESULT_BINDING"]))
            shadow_map.bind()
            set_uniforms(self._shader, {"share": 1.0 / sample_count, "light_count": count, "window": window})
            self._shader.run(-(-count // GROUP_SIZE))
            self._context.memory_barrier()
        return read_radiosity(irradiance, count)

    def _require_room(self, size: int, count: int) -> None:
        limit = int(self._context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        if size > limit:
            most = limit // SOURCE_SAMPLE.dtype.itemsize
            raise DeviceError(f"{count:,} source samples; the device holds {most:,}; bake fewer lights or samples")


def source_records(light_mesh: VirtualLightMesh, origin: Float64) -> np.ndarray:
    """Records of SOURCE_SAMPLE. origin: (3,) float64, of the light mesh's space."""
    samples = light_mesh.samples
    points = SOURCE_SAMPLE.zeros(len(samples.positions))
    points["position"] = samples.positions - origin
    points["normal"] = samples.normals
    points["weight"] = samples.weights
    return points


def _assign_windows(
    samples: np.ndarray, light_mesh: VirtualLightMesh, shadows: LampShadows, lamps: Sequence[int]
) -> dict[int, ShadowWindow | None]:
    """The windows of suns' maps that hold source samples; fills the field `window` of their records."""
    suns = [lamp for lamp in lamps if shadows.uses_windows(lamp)]
    if not suns:
        return {WHOLE_SCENE: None}
    counts = np.diff(light_mesh.samples.offsets)
    spacings = np.repeat(np.sqrt(light_mesh.areas / np.maximum(counts, 1)), counts)
    side = min(shadows.side(lamp) for lamp in suns)
    windows, samples["window"] = sample_windows(samples["position"].astype(np.float64), spacings, *shadows.bounds, side)
    return {int(index): windows[index] for index in np.unique(samples["window"])}


def read_radiosity(buffer: moderngl.Buffer, count: int) -> Float32:
    """(count, 3) float32, W/m²."""
    return np.frombuffer(buffer.read(), np.float32).reshape(-1, 4)[:count, :3].copy()
