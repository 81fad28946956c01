# SPDX-License-Identifier: GPL-3.0-or-later
"""What the mouse does in each drawing tool; everything else is in draw_modal.py."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.counting import counted
from ...core.errors import InvalidInput
from ...core.scene import Float64
from ..light_meshes import chosen_light_meshes
from ..names import is_light_mesh
from .draw_erase import LightTree
from .draw_lights import light_count
from .draw_mesh import rings_of, vertices_world
from .draw_modal import ModalStroke, in_surface, near_in_view
from .draw_points import text_of
from .draw_preview import ERASE_COLOR
from .draw_shapes import rectangle, simplified, strip, way_in_steps
from .draw_snap import Place, nearest_edge
from .drawn_faces import plane_of

FREEHAND_PIXELS = 6.0
"""How far a freehand outline may be from the polygon that is made of it."""

EDGE_PIXELS = 20.0
CIRCLE_CORNERS = 33


class PolygonGesture(ModalStroke):
    """Clicks set corners, a click on the first ends; a drag draws the outline freehand."""

    title = "Light polygon"
    least_points = 3
    is_freehand = True

    def shape(self, places: list[Place]) -> list[Float64]:
        """The outline, closed."""
        ring = _locations(places)
        return [np.concatenate([ring, ring[:1]])]

    def status(self, places: list[Place]) -> str:
        """Number of corners and area."""
        area = plane_of(_locations(places))[1] if len(places) > 2 else 0.0
        return f"{counted(len(places), 'corner')}, {area:.3g} m²  ·  click the first corner to finish"

    def closes(self, places: list[Place], place: Place) -> bool:
        """On the first corner."""
        return len(places) >= self.least_points and near_in_view(places[0], place)

    def store(self, places: list[Place], dragged: bool) -> None:
        """The corners; of a freehand outline those that it needs."""
        if dragged and len(places) > self.least_points:
            kept = simplified(np.array([place.pixel for place in places]), FREEHAND_PIXELS)
            places = [places[row] for row in kept]
        super().store(places, dragged)


class RectangleGesture(ModalStroke):
    """A drag from corner to corner, or two clicks, in the plane of the surface at the first."""

    title = "Light rectangle"
    least_points = 2
    most_points = 2
    along: Any
    columns: int
    rows: int

    def begin(self, context: Any, place: Place) -> str | None:
        """Columns go along the longest edge of the face."""
        if len(place.ring) and not any(self.along):
            ways = np.roll(place.ring, -1, axis=0) - place.ring
            self.along = ways[int(np.argmax((ways**2).sum(axis=1)))]
        return None

    def shape(self, places: list[Place]) -> list[Float64]:
        """The lights' outlines."""
        grid = self._grid(places)
        return [] if grid is None else [grid[0][[*ring, ring[0]]] for ring in grid[1]]

    def status(self, places: list[Place]) -> str:
        """Width and height."""
        grid = self._grid(places)
        if grid is None:
            return "drag from corner to corner"
        points = grid[0]
        width = np.linalg.norm(points[self.columns] - points[0])
        height = np.linalg.norm(points[-1] - points[self.columns])
        return f"{width:.3g} × {height:.3g} m, {light_count(self.columns * self.rows)}"

    def _grid(self, places: list[Place]) -> tuple[Float64, list[list[int]]] | None:
        if len(places) < self.least_points:
            return None
        along, (first, last) = np.array(self.along, np.float64), (places[0], places[-1])
        try:
            return rectangle(first.location, last.location, first.normal, along, self.columns, self.rows)
        except InvalidInput:
            return None


class ExtrudeGesture(ModalStroke):
    """A drag that begins at an edge of a light of the active light mesh."""

    title = "Extrude lights"
    least_points = 2
    is_freehand = True
    edge: str

    def begin(self, context: Any, place: Place) -> str | None:
        """Takes the edge of a light that shows nearest to the mouse."""
        active = context.active_object
        if active is None or active.type != "MESH" or not is_light_mesh(active):
            return "Make a light mesh active and drag an edge of one of its lights"
        vertices, rings = vertices_world(active), rings_of(active)
        pairs = [pair for ring in rings for pair in zip(ring, [*ring[1:], ring[0]], strict=True)]
        found = nearest_edge(self._view, place.pixel, vertices[np.array(pairs, np.int64).reshape(-1, 2)], EDGE_PIXELS)
        if found is None:
            return "There is no edge of a light under the mouse"
        self._edge = found
        self.edge = text_of(self._edge)
        return None

    def store(self, places: list[Place], dragged: bool) -> None:
        """The way of the edge's middle, in steps of the edge's length."""
        path, normals = self._way(places)
        self.points, self.normals = text_of(path), text_of(normals)

    def shape(self, places: list[Place]) -> list[Float64]:
        """The strip."""
        points, rings = self._strip(places)
        return [points[[*ring, ring[0]]] for ring in rings]

    def status(self, places: list[Place]) -> str:
        """What is to be done, and how many lights there will be."""
        count = len(self._strip(places)[1])
        return light_count(count) if count else "drag an edge of a light"

    def _strip(self, places: list[Place]) -> tuple[Float64, list[list[int]]]:
        """Points and corners; none before the mouse has left the edge, or found one."""
        if len(places) < self.least_points:
            return np.zeros((0, 3)), []
        try:
            return strip(self._edge, *self._way(places))[:2]
        except InvalidInput:
            return np.zeros((0, 3)), []

    def _way(self, places: list[Place]) -> tuple[Float64, Float64]:
        # The grabbed point of the edge shows at the first place, and goes the way that the mouse goes.
        shift = self._edge.mean(axis=0) - places[0].location
        rows = [0, *way_in_steps(_locations(places), float(np.linalg.norm(self._edge[1] - self._edge[0])))]
        return _locations(places)[rows] + shift, np.array([places[row].normal for row in rows])


class CutGesture(ModalStroke):
    """Clicks set the way of the cut; a drag cuts straight."""

    title = "Cut lights"
    least_points = 2

    def status(self, places: list[Place]) -> str:
        """How many points there are."""
        return f"{counted(len(places), 'point')}  ·  click across lights, or drag"


class EraseGesture(ModalStroke):
    """A drag over lights, or a click on one."""

    title = "Erase lights"
    color = ERASE_COLOR
    is_freehand = True
    ends_on_click = True
    radius: float

    def begin(self, context: Any, place: Place) -> str | None:
        """The lights are looked up once for the stroke."""
        self._trees = [LightTree.of(thing) for thing in chosen_light_meshes(context)]
        self._outlines: list[dict[int, Float64]] = [{} for _ in self._trees]
        self._seen = 0
        return None

    def shape(self, places: list[Place]) -> list[Float64]:
        """The brush, and the outlines of the lights that it has met."""
        self._look_at(places[self._seen :])
        # The last of the places is the mouse's own until the button is pressed or dragged on.
        self._seen = len(self._places)
        return [_circle(places[-1], self.radius), *(ring for found in self._outlines for ring in found.values())]

    def status(self, places: list[Place]) -> str:
        """How many lights will go."""
        return light_count(sum(map(len, self._outlines)))

    def _look_at(self, places: list[Place]) -> None:
        for place in places if self._held else ():
            for tree, found in zip(self._trees, self._outlines, strict=True):
                for row in tree.near(place.location, place.normal, self.radius):
                    found[row] = tree.outline(row)


def _locations(places: list[Place]) -> Float64:
    return np.array([place.location for place in places])


def _circle(place: Place, radius: float) -> Float64:
    side, other = in_surface(place.normal)
    angles = np.linspace(0.0, 2.0 * np.pi, CIRCLE_CORNERS)[:, None]
    circle: Float64 = place.location + radius * (np.cos(angles) * side + np.sin(angles) * other)
    return circle
