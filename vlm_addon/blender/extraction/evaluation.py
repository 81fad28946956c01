# SPDX-License-Identifier: GPL-3.0-or-later
"""The evaluated scene as F12 would see it, handed to a function.

Blender gives a depsgraph of render mode (render-level modifiers, particles and visibility) to render engines only,
so an engine that renders nothing is registered for the time of one call. Nothing of the scene's data is edited
for it, and animated or driven visibility comes out right.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from types import TracebackType
from typing import Any, TypeVar

import bpy

from ...core.errors import VlmError
from ..names import is_light_mesh
from .temporary import restored

T = TypeVar("T")

TEMPORARY_PROPERTY = "vlm_temporary"
"""Marks the camera of a scene that has none."""

ENGINE_ID = "VLM_SNAPSHOT"
RENDER_HANDLERS = ("render_init", "render_pre", "render_post", "render_complete", "render_cancel", "render_stats")


class _KeptError:
    """Keeps an exception that Blender would print and drop at the border of an engine callback."""

    def __init__(self) -> None:
        self.error: BaseException | None = None

    def __enter__(self) -> _KeptError:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> bool:
        self.error = error
        return True


def evaluate(
    function: Callable[[Any], T], viewport_levels: bool = False, depsgraph: Any = None, light_meshes: bool = False
) -> T:
    """What `function` returns for `depsgraph`, or for the current view layer evaluated as for a render.

    viewport_levels: take the viewport's evaluation instead. light_meshes: show virtual light meshes to the render's,
    although they are hidden from renders.
    """
    if depsgraph is not None:
        return function(depsgraph)
    if viewport_levels:
        return function(bpy.context.evaluated_depsgraph_get())
    with light_meshes_in_render(shown=light_meshes):
        return with_render_depsgraph(bpy.context.scene, bpy.context.view_layer, function)


@contextmanager
def light_meshes_in_render(shown: bool) -> Iterator[None]:
    """Virtual light meshes are shown to renders, or hidden from them even where somebody has switched them on."""
    with ExitStack() as stack:
        for blender_object in filter(is_light_mesh, bpy.data.objects):
            if blender_object.hide_render == shown:
                stack.enter_context(restored(blender_object, hide_render=not shown))
        yield


def with_render_depsgraph(scene: Any, view_layer: Any, function: Callable[[Any], T]) -> T:
    """What `function` returns for the depsgraph of render mode of `view_layer` at the scene's current frame.

    Every setting changed for it is as before afterwards, also when `function` raises; its exception passes through.
    Raises VlmError where Blender cannot evaluate, for instance during another render.
    """
    if bpy.app.is_job_running("RENDER"):
        raise VlmError(f"scene {scene.name!r}: Blender is rendering; wait for the render to end and try again")
    results: list[T] = []
    kept = _KeptError()

    class SnapshotEngine(bpy.types.RenderEngine):
        bl_idname = ENGINE_ID
        bl_label = "Snapshot"

        def render(self, depsgraph: Any) -> None:
            with kept:
                results.append(function(depsgraph))

    with ExitStack() as stack:
        stack.enter_context(only_layer(scene, view_layer))
        stack.enter_context(_some_camera(scene))
        stack.enter_context(no_render_handlers())
        stack.enter_context(_own_render_slot())
        bpy.utils.register_class(SnapshotEngine)
        stack.callback(bpy.utils.unregister_class, SnapshotEngine)
        stack.enter_context(
            restored(
                scene.render,
                engine=ENGINE_ID,
                resolution_x=4,
                resolution_y=4,
                resolution_percentage=100,  # Blender refuses to render less than a pixel
                use_border=False,
                use_compositing=False,
                use_sequencer=False,
                use_multiview=False,
                use_single_layer=False,
            )
        )
        # by its name, a linked scene could be taken for a local one of the same name
        with bpy.context.temp_override(scene=scene):
            bpy.ops.render.render()
    if kept.error is not None:
        raise kept.error
    if not results:
        raise VlmError(f"scene {scene.name!r}: Blender did not evaluate it for rendering")
    return results[0]


@contextmanager
def only_layer(scene: Any, view_layer: Any) -> Iterator[None]:
    """Render `view_layer` and no other."""
    with ExitStack() as stack:
        for layer in scene.view_layers:
            stack.enter_context(restored(layer, use=layer.name == view_layer.name))
        yield


@contextmanager
def _some_camera(scene: Any) -> Iterator[None]:
    """Blender renders nothing, not even for an engine without pictures, unless the scene has a camera."""
    if scene.camera is not None:
        yield
        return
    data = bpy.data.cameras.new("vlm temporary")
    camera = bpy.data.objects.new("vlm temporary", data)
    camera[TEMPORARY_PROPERTY] = True
    scene.camera = camera
    try:
        yield
    finally:
        scene.camera = None
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(data)


@contextmanager
def no_render_handlers() -> Iterator[None]:
    """Scripts that wait for a render are not called: none happens."""
    kept = {name: list(getattr(bpy.app.handlers, name)) for name in RENDER_HANDLERS}
    for name in kept:
        getattr(bpy.app.handlers, name).clear()
    try:
        yield
    finally:
        for name, handlers in kept.items():
            getattr(bpy.app.handlers, name)[:] = handlers


@contextmanager
def _own_render_slot() -> Iterator[None]:
    """The picture of the last render stays in its slot."""
    result = bpy.data.images.get("Render Result")
    if result is None or not len(result.render_slots):
        yield
        return
    with restored(result.render_slots, active_index=len(result.render_slots) - 1):
        yield
