# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cornell box with the tall block and a sphere, and a light mesh of 44 lights drawn by hand (seed 002, 5).

Figures: Cornell University Program of Computer Graphics, "The Cornell Box: Cornell Box Data"
(www.graphics.cornell.edu/online/box/data.html). One published millimetre is one centimetre here, so that the box is a
room of 5.5 m. Published x runs to the left and y up; here x runs to the right and z up, the origin is in the middle of
the open front's lower edge.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from . import blend
from .shapes import Shape, area_m2, icosphere, join, moved, octahedron, patch, prism, shape

METRES_PER_UNIT = 0.01
WIDTH, HEIGHT, DEPTH = 5.496, 5.488, 5.592

# The published reflectance spectra (400 to 700 nm) under D65, integrated with the CIE 1931 observer to linear Rec.709.
WHITE = (0.738, 0.736, 0.740)
RED = (0.490, 0.050, 0.051)
GREEN = (0.069, 0.398, 0.087)
LAMP_PANEL = (0.78, 0.78, 0.78)

# Published coordinates (x, z) of the tall block's outline and of the lamp.
TALL_BLOCK = ((423.0, 247.0), (265.0, 296.0), (314.0, 456.0), (472.0, 406.0))
TALL_BLOCK_HEIGHT = 3.30
LAMP_X, LAMP_Z = (213.0, 343.0), (227.0, 332.0)
CAMERA = (278.0, 273.0, -800.0)
CAMERA_LENS_MM, CAMERA_SENSOR_MM = 35.0, 25.0

# The sphere takes the short block's place: on its centre, with its height.
SHORT_BLOCK_CENTRE = (185.0, 168.5)
SPHERE_RADIUS = 0.825
SPHERE_SUBDIVISIONS = 4

# The lamp's colour is white because the reflectances were integrated under the white point; its power by eye.
LAMP_POWER_W = 170.0
PANEL_DROP, LAMP_DROP = 0.004, 0.008

# How far the lights lie behind the surfaces they stand for.
LIGHT_INSET = 0.001
SPHERE_TAG, BLOCK_TAG = 1, 2

# The walls' lights: quads of two lights each, columns x rows, with columns along the first axis named.
LIGHTS_ON_WALLS = {
    "floor": (2, 3),  # across, deep: bright, and crossed by both shadows
    "ceiling": (1, 1),  # nothing shines on it while the lamp hangs there
    "back": (1, 2),  # across, up
    "red": (1, 2),  # deep, up
    "green": (1, 2),
}


def here(x: float, z: float) -> tuple[float, float]:
    """A published floor position as metres (right, deep)."""
    return WIDTH / 2 - x * METRES_PER_UNIT, z * METRES_PER_UNIT


def walls(splits: dict[str, tuple[int, int]], inset: float) -> dict[str, Shape]:
    """Floor, ceiling and three walls facing inwards, each split in columns x rows and moved outwards by inset (m)."""
    right, left = WIDTH / 2, -WIDTH / 2
    x, y, z = (WIDTH, 0, 0), (0, DEPTH, 0), (0, 0, HEIGHT)
    turn_x, turn_y = (-WIDTH, 0, 0), (0, -DEPTH, 0)
    return {
        "floor": patch((left, 0, -inset), x, y, *splits["floor"]),
        "ceiling": patch((right, 0, HEIGHT + inset), turn_x, y, *splits["ceiling"]),
        "back": patch((left, DEPTH + inset, 0), x, z, *splits["back"]),
        "red": patch((left - inset, 0, 0), y, z, *splits["red"]),
        "green": patch((right + inset, DEPTH, 0), turn_y, z, *splits["green"]),
    }


def tall_block(inset: float = 0.0) -> Shape:
    """The closed tall block, or one whose sides and top lie inset (m) inside it and whose bottom stays on the floor."""
    outline = np.array([here(x, z) for x, z in TALL_BLOCK])
    centre = outline.mean(axis=0)
    # The outline is close to a square, so moving its corners towards the centre moves its sides evenly.
    half_side = math.sqrt(0.5) * float(np.linalg.norm(outline - centre, axis=1).mean())
    return prism(centre + (outline - centre) * (1 - inset / half_side), 0.0, TALL_BLOCK_HEIGHT - inset)


def sphere_centre() -> tuple[float, float, float]:
    """Where the sphere rests on the floor, m."""
    return (*here(*SHORT_BLOCK_CENTRE), SPHERE_RADIUS)


def without_bottom(block: Shape) -> Shape:
    """A prism's top and sides: what can receive light."""
    return shape(block.vertices, block.faces[1:])


def light_patches() -> list[blend.LightPatch]:
    """The 44 lights: 26 on the walls, 10 on the block's top and sides, 8 in the sphere."""
    reflectances = {"floor": WHITE, "ceiling": WHITE, "back": WHITE, "red": RED, "green": GREEN}
    surfaces = walls(LIGHTS_ON_WALLS, LIGHT_INSET)
    patches = [blend.LightPatch(surfaces[name], reflectances[name]) for name in surfaces]
    patches.append(blend.LightPatch(without_bottom(tall_block(LIGHT_INSET)), WHITE, BLOCK_TAG))
    inner = moved(octahedron(SPHERE_RADIUS - LIGHT_INSET), sphere_centre())
    scale = area_m2(icosphere(SPHERE_RADIUS, SPHERE_SUBDIVISIONS)) / area_m2(inner)
    patches.append(blend.LightPatch(inner, WHITE, SPHERE_TAG, scale))
    return patches


def lamp_rectangle() -> tuple[npt.NDArray[np.float64], float, float]:
    """The lamp's centre on the ceiling (m) and its size across and deep (m)."""
    low, high = here(LAMP_X[1], LAMP_Z[0]), here(LAMP_X[0], LAMP_Z[1])
    centre = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, HEIGHT])
    return centre, high[0] - low[0], high[1] - low[1]


def build() -> None:
    """Fills the current file with the scene."""
    scene = blend.empty_scene("cornell_box", 720, 720)
    white = blend.diffuse("White", WHITE)
    surfaces = walls(dict.fromkeys(LIGHTS_ON_WALLS, (1, 1)), 0.0)
    blend.add_mesh(scene, "Floor, ceiling, back", join([surfaces[k] for k in ("floor", "ceiling", "back")]), white)
    blend.add_mesh(scene, "Red wall", surfaces["red"], blend.diffuse("Red", RED))
    blend.add_mesh(scene, "Green wall", surfaces["green"], blend.diffuse("Green", GREEN))
    blend.add_mesh(scene, "Tall block", tall_block(), white)["vlm_tag"] = BLOCK_TAG
    sphere = blend.add_mesh(scene, "Sphere", icosphere(SPHERE_RADIUS, SPHERE_SUBDIVISIONS), white)
    sphere.location = sphere_centre()
    sphere["vlm_tag"] = SPHERE_TAG

    centre, across, deep = lamp_rectangle()
    corner = np.add(centre, (across / 2, -deep / 2, -PANEL_DROP))
    panel = patch(corner, (-across, 0, 0), (0, deep, 0))
    blend.add_mesh(scene, "Lamp panel", panel, blend.diffuse("Lamp panel", LAMP_PANEL))
    lamp = blend.add_lamp(scene, "Lamp", "AREA", LAMP_POWER_W, np.subtract(centre, (0, 0, LAMP_DROP)))
    lamp.data.shape, lamp.data.size, lamp.data.size_y = "RECTANGLE", across, deep

    x, y, z = CAMERA
    position = (*here(x, z), y * METRES_PER_UNIT)
    blend.add_camera(scene, position, np.add(position, (0, 1, 0)), CAMERA_LENS_MM, CAMERA_SENSOR_MM)
    blend.add_light_mesh(scene, "Cornell light mesh", light_patches())
