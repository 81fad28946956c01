# SPDX-License-Identifier: GPL-3.0-or-later
"""What the noisy effects of a frame found in pictures before, where the plan accumulates over frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..core.scene import Float32
from .passes.motion import Motion, MotionPass
from .passes.temporal_accumulation import AccumulationSettings, Accumulator
from .technique import FrameInputs, SceneInputs

if TYPE_CHECKING:
    import moderngl


class EffectHistory:
    """Accumulators of one frame, by name of effect."""

    def __init__(self, scene: SceneInputs, settings: AccumulationSettings) -> None:
        size = scene.settings.width, scene.settings.height
        self._scene = scene
        self._settings = settings
        self._size = size
        self._motion_pass = MotionPass(scene.context, scene.shaders, scene.kept, scene.world, scene.space, *size)
        self._motion: tuple[int, Motion] | None = None
        self._accumulators: dict[str, Accumulator] = {}
        self._shows_light: set[str] = set()
        world, frame = scene.world, scene.settings
        # Old light cannot be told from rare bright events of noise by what neighbours find, so it is dropped.
        self._lights_key = scene.kept.digests.of(
            (world.lights, world.materials, world.textures, world.world_radiance, world.environment),
            [(mesh.material_indices, mesh.corner_colors) for mesh in world.meshes],
            scene.world_lights,
            (frame.technique, frame.technique_settings, frame.effects, frame.shadow_resolution, frame.shadow_samples),
        )

    def picture(self, name: str, *, follows_eye: bool) -> int:
        """The number of the picture, over frames, that the effect is about to look at: what its noise is made from.

        follows_eye: whether it shows light, which depends on where from a place is seen, and on the lights: with others
        its history is dropped.
        """
        if follows_eye:
            self._shows_light.add(name)
        if name not in self._accumulators:
            scene = self._scene
            self._accumulators[name] = Accumulator(
                scene.context, scene.shaders, scene.kept, name, *self._size, self._settings, follows_eye=follows_eye
            )
        return self._accumulators[name].pictures

    def mean(self, name: str, frame: FrameInputs, found: moderngl.Texture, key: str) -> moderngl.Texture:
        """`found` with what earlier pictures had. key: of the effect's settings."""
        with self._scene.timer.measure("accumulation"):
            if self._motion is None or self._motion[0] != frame.sample_index:
                self._motion = frame.sample_index, self._motion_pass.render(frame.gbuffer)
            return self._accumulators[name].render(
                frame.gbuffer,
                frame.view,
                self._scene.space,
                found,
                key + (self._lights_key if name in self._shows_light else ""),
                motion=self._motion[1],
                sample_index=frame.sample_index,
            )

    def images(self) -> dict[str, Float32]:
        """How many pictures are in the mean of each pixel, by effect, and where in the last picture its surface was:
        pixels right and up."""
        found: dict[str, Float32] = {}
        for name, each in self._accumulators.items():
            images = each.images()
            found |= {f"{name}_history_age": images["history_age"], "motion": images["motion"]}
        return found
