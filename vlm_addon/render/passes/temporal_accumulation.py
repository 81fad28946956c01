# SPDX-License-Identifier: GPL-3.0-or-later
"""Accumulates what any noisy pass finds over pictures: occlusion, reflections, filtered light.

    accumulator = Accumulator(context, shaders, kept, "ambient_occlusion", width, height, settings)
    occlusion = occlusion_pass.render(gbuffer, view, accumulator.pictures)
    occlusion = accumulator.render(gbuffer, view, space, occlusion, key, scene_key, motion)

A pixel's history is what the last picture had where it showed the same surface: at the same place, or, for meshes that
moved or deformed, where `MotionPass` says that they were. While something changes, history counts for little and is
held near to what the neighbouring pixels have now (variance clipping by what deviates around or over time, whichever is
more), so that nothing trails and rare events still count; while nothing does, the result goes to the mean. A cut takes
nothing over: other keys, or a picture that shows other places or the same ones elsewhere. Values that are not numbers
are replaced by the history, or by 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.scene import Float32, Float64
from ...core.settings import OWN, setting
from ..gpu_layout import CONSTANTS
from ..kept import Kept
from ..local_space import LocalSpace
from ..shader_library import ShaderLibrary, set_uniforms
from ..view import View
from .accumulate import read_image
from .gbuffer import GBuffer
from .motion import Motion
from .temporal import GROUP_SIDE, LARGEST, SAME_NORMAL_COSINE, History, into_history

if TYPE_CHECKING:
    import moderngl

FIRST_UNIT = int(CONSTANTS["FIRST_FREE_UNIT"])
COUNT_BINDING = 0
LONGEST_WAY = 0.25
"""Picture widths that a surface moves between two pictures, but for a cut."""
MOST_MAGNIFIED = 2.0
"""How much larger a history may be shown than it was seen."""
LEAST_VIEW_COSINE = 0.97
"""Of the angle, 14 degrees, between directions in which two pictures see a place alike."""
MIRROR, ROUGH = 0.05, 0.3
"""Roughness of reflections without noise, which averaging only blurs while they change, and of those that need it."""
SAME_EYE = 1e-9
"""Relative difference of the matrices of a camera that rests: float64 rounding of jitter."""


@dataclass(frozen=True)
class AccumulationSettings:
    """How much earlier pictures count."""

    history: int = setting(
        128, "pictures", 1, 65536, "Earlier pictures that the mean counts at most while nothing changes", source=OWN
    )
    changing_history: int = setting(
        8,
        "pictures",
        1,
        65536,
        "Earlier pictures that the mean counts at most while something changes, and for as many pictures after it",
        source=OWN,
    )
    clamp: float = setting(
        1.0,
        "standard deviations",
        0.0,
        1e6,
        "While something changes, how far from the mean of the neighboring pixels earlier pictures may be: few leave "
        "no trails, many less noise; 0 does not look at neighbors",
        source=OWN,
    )
    cut_share: float = setting(
        0.25,
        "share",
        0.0,
        1.0,
        "Of the pixels that show a surface: where fewer have a history near by in the picture, seen alike, it is a "
        "cut and none counts",
        source=OWN,
    )


class AccumulatedHistory(History):
    """A history that knows what else it was made from. normal: its w is the deviation of what pictures found, of the
    channel that has most. unsettled: pictures until what changed counts as settled."""

    def __init__(self, context: moderngl.Context, width: int, height: int) -> None:
        super().__init__(context, width, height)
        self.picture = 0
        self.unsettled = 0


class Accumulator:
    """The mean over pictures of what one owner finds."""

    def __init__(
        self,
        context: moderngl.Context,
        shaders: ShaderLibrary,
        kept: Kept,
        owner: str,
        width: int,
        height: int,
        settings: AccumulationSettings,
        *,
        follows_eye: bool = False,
    ) -> None:
        """owner: name of the effect, which has a history of its own for the latest size of picture. follows_eye:
        whether what is seen of a place depends on where from, as reflections do: then a moving camera changes it."""
        self._context = context
        self._shaders = shaders
        self._settings = settings
        self._follows_eye = follows_eye
        size = (width, height)
        histories: dict[tuple[int, int], AccumulatedHistory] = kept.hold(f"{owner}_accumulated", dict)
        if size not in histories:
            histories.clear()
            histories[size] = AccumulatedHistory(context, width, height)
        self._history = histories[size]
        self._reprojected, self._result = (context.texture(size, 4, dtype="f4") for _ in range(2))
        self._age = context.texture(size, 4, dtype="f4")
        self._counts = context.buffer(bytes(8))
        self._groups = -(-width // GROUP_SIDE), -(-height // GROUP_SIDE)
        self._defines = {
            "GROUP_SIDE": GROUP_SIDE,
            "SAME_NORMAL_COSINE": SAME_NORMAL_COSINE,
            "COUNT_BINDING": COUNT_BINDING,
            "LONGEST_WAY": LONGEST_WAY,
            "MOST_MAGNIFIED": MOST_MAGNIFIED,
            "LEAST_VIEW_COSINE": LEAST_VIEW_COSINE,
            "MIRROR": MIRROR,
            "ROUGH": ROUGH,
        }

    @property
    def pictures(self) -> int:
        """That the owner has had so far, over frames. What it finds must differ from picture to picture: as
        `sample_index` of the pass that is averaged, 0 in the first one as without a history."""
        return self._history.step

    def render(
        self,
        gbuffer: GBuffer,
        view: View,
        space: LocalSpace,
        found: moderngl.Texture,
        key: str,
        scene_key: str = "",
        motion: Motion | None = None,
        sample_index: int = 0,
    ) -> moderngl.Texture:
        """What to show of `found` and of the history, RGBA32F, finite and at least 0.

        The average over the pictures of a frame is the mean of all that counts; with one picture a frame, so is the
        result; without any history, or where no surface shows, it is `found` itself.

        gbuffer, view, space: of the picture. found: of the picture's size, float, from one to four channels. key: hash
        of all without which the history means nothing (settings of the effect). scene_key: hash of what else the
        values depend on, but for the places of surfaces if there is motion. motion: of the same picture; without,
        surfaces are taken to stand still. sample_index: of the picture in its frame. The next call overwrites the
        texture.
        """
        history = self._history
        if history.key != key or (motion is not None and history.picture < motion.scene.since):
            history.seen = None
        is_settled = self._note_changes(view, space, scene_key, motion)
        self._reproject(gbuffer, view, space, motion, LARGEST if is_settled else self._settings.changing_history)
        self._blend(gbuffer, view, found, is_settled, sample_index)
        history.seen = view, space
        history.key, history.scene_key = key, scene_key
        history.picture = motion.scene.picture if motion is not None else 0
        history.step += 1
        return self._result

    def _note_changes(self, view: View, space: LocalSpace, scene_key: str, motion: Motion | None) -> bool:
        """Whether nothing has changed for as many pictures as history counts for while something does."""
        history = self._history
        changed = history.scene_key != scene_key or (motion is not None and motion.scene.changed)
        if self._follows_eye and history.seen is not None:
            changed = changed or not is_same_eye(view, space, *history.seen, history.place.size)
        if history.seen is None:
            # Nothing is taken over, so there is nothing to settle.
            history.unsettled = 0
        elif changed:
            history.unsettled = self._settings.changing_history
        else:
            history.unsettled = max(history.unsettled - 1, 0)
        return history.unsettled == 0

    def _reproject(
        self, gbuffer: GBuffer, view: View, space: LocalSpace, motion: Motion | None, most_age: float
    ) -> None:
        """Fills the images of reprojected history and its age, and counts."""
        history = self._history
        surfaces = motion.surfaces if motion is not None else None
        names = ["HISTORY_IRRADIANCE", "HISTORY_PLACE", "HISTORY_NORMAL"]
        textures = [history.irradiance, history.place, history.normal]
        if surfaces is not None:
            names += ["PLACE_BEFORE", "NORMAL_BEFORE", "PLANE_BEFORE"]
            textures += [surfaces.place, surfaces.normal, surfaces.plane]
        units = {f"{name}_UNIT": FIRST_UNIT + index for index, name in enumerate(names)}
        variant = {"ACCUMULATES": 1, **({} if surfaces is None else {"HAS_MOTION": 1})}
        shader = self._shaders.compute("passes/temporal_reproject.comp", {**self._defines, **units, **variant})
        uniforms: dict[str, object] = {"most_age": 0.0}
        if history.seen is not None:
            uniforms |= into_history(space, *history.seen, gbuffer.size[0])
            shift = np.subtract(history.seen[0].jitter, view.jitter)
            uniforms |= {"most_age": most_age, "jitter_shift": shift.tolist(), **_pixel_sizes(view, gbuffer, "now_")}
            uniforms |= {"eye_before": _eye(history.seen[0]), "eye_now": _eye(view), "follows_eye": self._follows_eye}
        gbuffer.bind()
        for unit, texture in enumerate(textures, FIRST_UNIT):
            texture.use(unit)
        self._reprojected.bind_to_image(0, read=False, write=True)
        self._age.bind_to_image(1, read=False, write=True)
        self._counts.orphan()
        self._counts.write(bytes(8))
        self._counts.bind_to_storage_buffer(COUNT_BINDING)
        set_uniforms(shader, uniforms)
        shader.run(*self._groups)
        self._context.memory_barrier()

    def _blend(
        self, gbuffer: GBuffer, view: View, found: moderngl.Texture, is_settled: bool, sample_index: int
    ) -> None:
        """Fills the result and the history."""
        history = self._history
        units = {f"{name}_UNIT": FIRST_UNIT + index for index, name in enumerate(("FOUND", "REPROJECTED", "AGE"))}
        settings = self._settings
        clamp_width = 0.0 if is_settled else settings.clamp
        variant = {"CLAMPS": 1} if clamp_width > 0.0 else {}
        shader = self._shaders.compute("passes/temporal_accumulate.comp", {**self._defines, **units, **variant})
        for unit, texture in enumerate((found, self._reprojected, self._age), FIRST_UNIT):
            texture.use(unit)
        for unit, texture in enumerate((history.irradiance, history.place, history.normal, self._result)):
            texture.bind_to_image(unit, read=False, write=True)
        uniforms = {
            "most_age": settings.history,
            "clamp_width": clamp_width,
            "mirror_age": settings.changing_history if self._follows_eye and not is_settled else -1.0,
            "pictures_of_frame": 1.0 + sample_index,
            "cut_share": settings.cut_share,
            **_pixel_sizes(view, gbuffer),
        }
        set_uniforms(shader, uniforms)
        shader.run(*self._groups)
        self._context.memory_barrier()

    def counters(self) -> dict[str, float]:
        """Share of the latest picture's surface pixels, one of each 2 x 2, whose history is near by and seen alike,
        which tells a cut."""
        shown, near = np.frombuffer(self._counts.read(), np.uint32)
        return {"history_share": float(near) / max(float(shown), 1.0)}

    def images(self) -> dict[str, Float32]:
        """Of the last picture, row 0 at the top: `history_age`, (h, w, 1), how many pictures are in the mean; `motion`,
        (h, w, 2), pixels to the right and up to where each surface was in the picture before, 0 where that is unknown
        or out of it."""
        age, found = read_image(self._history.place), read_image(self._age)
        return {
            "history_age": np.ascontiguousarray(age[..., 3:]),
            "motion": np.ascontiguousarray(found[..., 2:]),
        }


def is_same_eye(view: View, space: LocalSpace, other: View, other_space: LocalSpace, size: tuple[int, int]) -> bool:
    """Whether two views, each in its own space, show the same picture of `size` pixels but for jitter."""
    scale, offset = space.to(other_space)
    into_other = np.eye(4)
    into_other[:3, :3] *= scale
    into_other[:3, 3] = offset
    matrices = [_picture_matrix(view, size), _picture_matrix(other, size) @ into_other]
    # Homogeneous: spaces of other units differ by a factor.
    one, two = (matrix / np.linalg.norm(matrix) for matrix in matrices)
    return bool(np.abs(one - two).max() < SAME_EYE)


def _pixel_sizes(view: View, gbuffer: GBuffer, prefix: str = "") -> dict[str, float]:
    """Uniforms: a pixel's size at depth 0, and by how much it grows with depth."""
    width = gbuffer.size[0]
    at_0, per_depth = view.picture_width(width)
    return {f"{prefix}pixel_at_0": at_0 / width, f"{prefix}pixel_per_depth": per_depth / width}


def _eye(view: View) -> tuple[float, ...]:
    """Where it is and 1, or the direction towards it and 0."""
    if view.is_orthographic:
        return *view.backward.tolist(), 0.0
    return *view.position.tolist(), 1.0


def _picture_matrix(view: View, size: tuple[int, int]) -> Float64:
    """(3, 4): homogeneous places in the picture of local points, as if pixels were sampled at their centres."""
    clip = view.clip_from_local[[0, 1, 3]]
    shift = 2.0 * np.array(view.jitter) / size
    clip[:2] += shift[:, None] * clip[2]
    return clip
