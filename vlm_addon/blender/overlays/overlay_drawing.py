# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws overlays: buffers on the graphics card, made anew only where what they show has changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ...core.errors import VlmError
from ...core.grid_samples import Cells, GridView, cells_around, look, slice_cells
from ...core.light_grid import RANGE
from ...core.scene import Float64
from ..light_geometry import LightFaces
from ..light_grid_options import scene_grid_settings
from ..light_meshes import light_meshes
from ..names import HUE_PROPERTY, STRENGTH_PROPERTY, TAG_PROPERTY, is_light_mesh
from ..stored_values import plain
from .overlay_paint import Painter, as_batch
from .overlay_shapes import (
    NONE,
    TAGS,
    Shape,
    cell_shapes,
    depths_below,
    fill_shape,
    finding_shapes,
    half_ball_shape,
    side_shapes,
    tagged_surface_shapes,
    world_faces,
)

Bools = npt.NDArray[np.bool_]

NEARER = 0.002
"""Share of their distance by which lights come nearer to the eye, beside how deep they lie: they are behind what is
visible."""
STEEPNESS = 2.0
"""Ways along the line of sight for each metre of depth: surfaces are seen at slopes."""
SURFACE_NEARER = 0.001
STRIPE_PIXELS = 6.0
CURSOR_REACH = 2
"""Cells around the 3D cursor along each axis."""
LABEL_SIZE = 12
TAGGED_SURFACES, GRID = "tagged surfaces", "light grid"
AXES = {"X": 0, "Y": 1, "Z": 2}


@dataclass(frozen=True)
class _Part:
    """key: of all that the shapes depend on. batches: (is lines, batch, most metres nearer to the eye) in order."""

    key: Any
    batches: list[tuple[bool, Any, float]]


class OverlayDrawing:
    """What is drawn now. Shapes are kept by name of what they show, and made anew where their key is another."""

    def __init__(self) -> None:
        self._handles: list[Any] = []
        self._painter = Painter()
        self._parts: dict[str, _Part] = {}
        self._changes: dict[tuple[str, str], int] = {}
        self._depths: dict[str, tuple[Float64, Float64]] = {}
        self._surface_changes = 0
        self._grids: dict[str, GridView] = {}
        self._cells: tuple[Any, Cells] | None = None
        self._looks = 0

    def begin(self) -> None:
        """Draw in all 3D views."""
        if not self._handles:
            add = bpy.types.SpaceView3D.draw_handler_add
            self._handles = [add(self._draw, (), "WINDOW", "POST_VIEW"), add(self._label, (), "WINDOW", "POST_PIXEL")]

    def end(self) -> None:
        """Draw no longer, and let go of all buffers."""
        for handle in self._handles:
            bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
        self._handles = []
        self._painter = Painter()
        self._depths.clear()
        self.forget()

    def forget(self, with_grids: bool = False) -> None:
        """Everything may be another: undo, another file."""
        self._parts.clear()
        self._changes.clear()
        self._cells = None
        if with_grids:
            self._grids.clear()

    def touch(self, changed: Any) -> None:
        """Blender has changed this data-block."""
        original = changed.original
        kind = type(original).__name__
        if isinstance(original, bpy.types.Object | bpy.types.Mesh):
            name = (kind, original.name)
            self._changes[name] = self._changes.get(name, 0) + 1
            if not (isinstance(original, bpy.types.Object) and is_light_mesh(original)):
                self._surface_changes += 1

    def set_grid(self, scene: Any, view: GridView) -> None:
        """The light grid to show for a scene."""
        self._grids[scene.name] = view
        self._cells = None

    def grid_of(self, scene: Any) -> GridView | None:
        """The one that is shown, or None."""
        return self._grids.get(scene.name)

    def cells(self, scene: Any, place: str) -> Cells | None:
        """What the shown grid says of the cells at `place`, around or across the 3D cursor."""
        view = self._grids.get(scene.name)
        if view is None:
            return None
        point = np.array(scene.cursor.location, np.float64)
        cells = (
            cells_around(view.frame, point, CURSOR_REACH)
            if place not in AXES
            else slice_cells(view.frame, AXES[place], float(point[AXES[place]]))
        )
        key = (id(view), cells.tobytes())
        if self._cells is None or self._cells[0] != key:
            self._cells = key, look(view, cells)
            self._looks += 1
        return self._cells[1]

    def _draw(self) -> None:
        context = bpy.context
        settings = getattr(context.window_manager, "vlm_overlay", None)
        if settings is None or not context.space_data.overlay.show_overlays:
            return
        import gpu  # only while drawing: there is none in background

        gpu.state.blend_set("ALPHA")
        depth_test = "NONE" if settings.in_front else "LESS_EQUAL"
        depsgraph = context.evaluated_depsgraph_get()
        shown: set[str] = set()
        lights: list[_Part] = []
        for thing in light_meshes(context.scene):
            if thing.visible_get():
                part = self._light_mesh_part(thing, depsgraph, settings, context.scene)
                shown.add(thing.name)
                lights.append(part)
        if settings.fill == TAGS:
            part = self._part(TAGGED_SURFACES, self._surface_key(context.scene), self._surfaces(depsgraph, settings))
            shown.add(TAGGED_SURFACES)
            self._paint(gpu, context, part, "LESS_EQUAL", SURFACE_NEARER, 0.0)
        if not settings.in_front:
            self._write_depths(gpu, context, lights)
        for part in lights:
            self._paint(gpu, context, part, depth_test, NEARER, STRIPE_PIXELS if settings.sides else 0.0)
        if settings.grid and self.grid_of(context.scene) is not None:
            part = self._grid_part(context.scene, settings)
            shown.add(GRID)
            self._paint(gpu, context, part, depth_test, 0.0, 0.0)
        for gone in set(self._parts) - shown:
            del self._parts[gone]
        gpu.state.depth_test_set("NONE")
        gpu.state.blend_set("NONE")

    def _write_depths(self, gpu: Any, context: Any, parts: Iterable[_Part]) -> None:
        """So that of lights behind each other the nearest alone is seen: they come nearer than what hides the rest."""
        written = gpu.state.depth_mask_get()
        gpu.state.depth_mask_set(True)
        gpu.state.color_mask_set(False, False, False, False)
        for part in parts:
            self._paint(gpu, context, part, "LESS_EQUAL", NEARER, 0.0, with_lines=False)
        gpu.state.color_mask_set(True, True, True, True)
        gpu.state.depth_mask_set(written)

    def _light_mesh_part(self, thing: Any, depsgraph: Any, settings: Any, scene: Any) -> _Part:
        reach = reach_of(scene) if settings.half_balls and _is_chosen(thing) else None
        marks = _marks(scene) if settings.findings else ()
        changes = [self._changes.get(("Object", thing.name), 0), self._changes.get(("Mesh", thing.data.name), 0)]
        looks = (settings.fill, settings.sides, settings.opacity, reach, marks)
        own = (repr(plain(thing.get(STRENGTH_PROPERTY))), repr(plain(thing.get(HUE_PROPERTY))), thing.mode)
        key = (*changes, *looks, *own, tuple(map(tuple, thing.matrix_world)))

        def shapes() -> list[Shape]:
            faces = world_faces(thing, depsgraph)
            nearer = STEEPNESS * self._depths_below(thing, scene, depsgraph, faces)
            fill, alpha = settings.fill, settings.opacity
            found = [fill_shape(thing, faces, fill, alpha, nearer)] if fill != NONE else []
            if settings.sides:
                found += side_shapes(faces, float(nearer.max(initial=0.0)))
            if settings.findings:
                found += finding_shapes(scene, thing, faces, alpha, nearer)
            if reach is not None:
                found.append(half_ball_shape(thing, faces, reach))
            return found

        return self._part(thing.name, key, shapes)

    def _depths_below(self, thing: Any, scene: Any, depsgraph: Any, faces: LightFaces) -> Float64:
        """`depths_below`, kept while the lights stay where they are, and while they are dragged about in Edit Mode."""
        corners, depths = self._depths.get(thing.name, (np.zeros(0), np.zeros(0)))
        is_kept = corners.shape == faces.corners.shape
        if not is_kept or (thing.mode != "EDIT" and not np.array_equal(corners, faces.corners)):
            depths = depths_below(scene, depsgraph, faces)
            self._depths[thing.name] = faces.corners, depths
        return depths

    def _surface_key(self, scene: Any) -> Any:
        tags = tuple(
            (thing.name, repr(plain(thing.get(TAG_PROPERTY)))) for thing in scene.objects if TAG_PROPERTY in thing
        )
        return self._surface_changes, tags, bpy.context.mode

    def _surfaces(self, depsgraph: Any, settings: Any) -> Callable[[], Iterable[Shape]]:
        return lambda: tagged_surface_shapes(depsgraph, 0.6 * settings.opacity)

    def _grid_part(self, scene: Any, settings: Any) -> _Part:
        place, view = settings.grid_place, self._grids[scene.name]
        cells = self.cells(scene, place)
        assert cells is not None
        axis, tolerance = AXES.get(place, 0), view.grid.settings.tolerance
        key = (self._looks, place, settings.opacity)
        return self._part(GRID, key, lambda: cell_shapes(cells, tolerance, place in AXES, axis, 0.6 * settings.opacity))

    def _part(self, name: str, key: Any, shapes: Callable[[], Iterable[Shape]]) -> _Part:
        """The kept part of that name and key, or one made of `shapes`: empty where these cannot be had."""
        kept = self._parts.get(name)
        if kept is None or kept.key != key:
            try:
                found = list(shapes())
            except VlmError:
                found = []  # Check says what is wrong; a message with every redraw would help nobody
            self._parts[name] = _Part(key, [as_batch(shape) for shape in found if len(shape.positions)])
        return self._parts[name]

    def _paint(
        self,
        gpu: Any,
        context: Any,
        part: _Part,
        depth_test: str,
        share: float,
        stripe: float,
        with_lines: bool = True,
    ) -> None:
        """share: of their distance by which all come nearer to the eye, beside what each face needs by itself.
        stripe: width of the stripes on backs in pixels, 0 for backs that look like fronts."""
        gpu.state.depth_test_set(depth_test)
        for is_lines, batch, metres in part.batches:
            if not is_lines:
                self._painter.faces(context.region_data, batch, share, stripe)
            elif with_lines:
                self._painter.lines(context, batch, share, metres)

    def _label(self) -> None:
        """Numbers in the cells next to the 3D cursor."""
        context = bpy.context
        settings = getattr(context.window_manager, "vlm_overlay", None)
        if settings is None or not context.space_data.overlay.show_overlays or not settings.grid:
            return
        if settings.grid_place in AXES or self.grid_of(context.scene) is None:
            return
        import blf  # type: ignore[import-not-found]
        from bpy_extras.view3d_utils import location_3d_to_region_2d

        cells = self.cells(context.scene, settings.grid_place)
        assert cells is not None
        middles = cells.corners.mean(axis=1)
        near = _layer_towards(context.region_data, cells, np.array(context.scene.cursor.location))
        blf.size(0, LABEL_SIZE * context.preferences.system.ui_scale)
        blf.color(0, 1.0, 1.0, 1.0, 1.0)
        for row in np.flatnonzero(near & (cells.counts > 0)):
            place = location_3d_to_region_2d(context.region, context.region_data, middles[row])
            if place is not None:
                blf.position(0, place.x, place.y, 0.0)
                blf.draw(0, cell_text(cells, int(row)))


def _layer_towards(region_data: Any, cells: Cells, cursor: Float64) -> Bools:
    """(c,) cells of the layer of the 3D cursor that one looks at most directly: numbers behind others are no use."""
    axis = int(np.abs(np.array(region_data.view_matrix)[2, :3]).argmax())
    low = cells.corners[:, 0, axis]
    middle = cells.corners[np.abs(cells.corners[:, :, axis].mean(axis=1) - cursor[axis]).argmin(), 0, axis]
    return np.asarray(low == middle)


def cell_text(cells: Cells, row: int) -> str:
    """How many lights a cell lists, or with a tolerance how far irradiance there may be off."""
    return f"{int(cells.counts[row]):,}" if cells.errors is None else f"{cells.errors[row]:.1%}"


def _is_chosen(thing: Any) -> bool:
    return bool(thing.mode == "EDIT" or thing.select_get())


def reach_of(scene: Any) -> float | None:
    """Radii that lights reach, None where they reach everywhere."""
    try:
        settings = scene_grid_settings(scene)
    except VlmError:
        return None  # the renderer names the setting that is out of range
    return settings.range if settings is not None and settings.mode == RANGE else None


def _marks(scene: Any) -> Any:
    return tuple((mark.owner, mark.faces) for item in scene.vlm.findings for mark in item.marks)
