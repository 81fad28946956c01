# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine: F12 and background renders by the renderer's process."""

from __future__ import annotations

from typing import Any

import bpy

from ..core.errors import Cancelled, VlmError
from ..core.scene import Finding
from ..render.frame_types import Frame, RenderSettings
from ..render.technique import technique_by_name
from .extraction.color_space import convert, rec709_to_working
from .extraction.light_mesh_io import extract
from .interface.availability import rendering_problem
from .interface.properties import effect_values, technique_settings
from .render_process import KEPT

ENGINE_ID = "VLM_ENGINE"
DIRECT_TECHNIQUE = "direct"
EXTRA_PASSES = {"direct": "Direct Light", "indirect": "Indirect Light"}
VIEW_MESSAGE = "Virtual Light Mesh renders by F12 (Render > Render Image); use Material Preview to look around"
MESSAGE_MARGIN = 24
MESSAGE_HEIGHT = 80
MESSAGE_SIZE = 14


class VLM_RenderEngine(bpy.types.RenderEngine):  # noqa: N801 (Blender's naming of classes)
    """Direct light from the lamps and bounce light from the scene's virtual light meshes."""

    bl_idname = ENGINE_ID
    bl_label = "Virtual Light Mesh"
    bl_use_eevee_viewport = True
    bl_use_postprocess = True
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene: Any, renderlayer: Any) -> None:
        """Tell the compositor which passes there are."""
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for name in EXTRA_PASSES.values():
            self.register_pass(scene, renderlayer, name, 3, "RGB", "COLOR")

    def render(self, depsgraph: Any) -> None:
        """One picture for F12, an animation's frame or `blender -b`; black where it fails or is cancelled."""
        for title in EXTRA_PASSES.values():
            self.add_pass(title, 3, "RGB", layer=depsgraph.view_layer.name)
        left, bottom, right, top = _render_region(depsgraph.scene)
        result = self.begin_result(0, 0, right - left, top - bottom, layer=depsgraph.view_layer.name)
        try:
            problem = rendering_problem()
            if problem:
                raise VlmError(problem)
            _fill(result.layers[0].passes, self._frame(depsgraph), slice(bottom, top), slice(left, right))
        except Cancelled:
            return
        except VlmError as error:
            self.report({"ERROR"}, str(error))
        finally:
            self.end_result(result)  # also after an exception: Blender crashes when it saves a picture without result

    def _frame(self, depsgraph: Any) -> Frame:
        scene = depsgraph.scene
        self.update_stats("", "Reading the scene")
        found = extract(depsgraph=depsgraph)
        technique = scene.vlm.technique
        if found.light_mesh is None and technique_by_name(technique).needs_light_mesh:
            technique = DIRECT_TECHNIQUE
            finding = Finding(
                f"scene {scene.name!r}", "has no virtual light mesh", "rendered with direct light only; create one"
            )
            self.report({"WARNING"}, str(finding))
        if scene.render.film_transparent:
            self.report({"WARNING"}, "Film > Transparent is not supported: the world is shown and alpha is 1")
        width, height = picture_size(scene)
        settings = RenderSettings(
            width=width,
            height=height,
            technique=technique,
            technique_settings=technique_settings(scene, technique),
            samples=scene.vlm.samples,
            world_lights=scene.vlm.world_lights,
            effects=effect_values(scene),
        )
        frame = KEPT.render(found.snapshot, found.light_mesh, settings, self._progress)
        if self._is_cancelled():  # too late for the renderer to notice
            raise Cancelled("render")
        return frame

    def _progress(self, fraction: float, label: str) -> bool:
        self.update_progress(fraction)
        self.update_stats("", label)
        return not self._is_cancelled()

    def _is_cancelled(self) -> bool:
        return bool(self.test_break())

    def view_update(self, context: Any, depsgraph: Any) -> None:
        """Nothing to prepare: the rendered viewport shows a message."""

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        """One line that says how to render."""
        import blf  # type: ignore[import-not-found]

        font = 0
        scale = context.preferences.system.ui_scale
        blf.position(font, MESSAGE_MARGIN * scale, MESSAGE_HEIGHT * scale, 0)
        blf.size(font, MESSAGE_SIZE * scale)
        blf.color(font, 1.0, 1.0, 1.0, 1.0)
        blf.draw(font, VIEW_MESSAGE)


def _fill(passes: Any, frame: Frame, rows: slice, columns: slice) -> None:
    """Copy the pictures of `frame` into Blender's passes. rows, columns: the part asked for, rows from the bottom."""
    to_working = rec709_to_working()
    sources = {"Combined": "combined", **{title: name for name, title in EXTRA_PASSES.items()}}
    for title, name in sources.items():
        pixels = frame.images[name][::-1][rows, columns].copy()
        pixels[..., :3] = convert(pixels[..., :3], to_working)
        passes[title].rect.foreach_set(pixels.ravel())


def picture_size(scene: Any) -> tuple[int, int]:
    """Width and height in pixels of the pictures of `scene`, rounded as Blender does."""
    render = scene.render
    return (
        max(render.resolution_x * render.resolution_percentage // 100, 1),
        max(render.resolution_y * render.resolution_percentage // 100, 1),
    )


def _render_region(scene: Any) -> tuple[int, int, int, int]:
    """Left, bottom, right, top of the pixels that Blender asks for: all, or those inside the render border."""
    width, height = picture_size(scene)
    render = scene.render
    if not render.use_border:
        return 0, 0, width, height
    return (
        int(render.border_min_x * width),
        int(render.border_min_y * height),
        int(render.border_max_x * width),
        int(render.border_max_y * height),
    )
