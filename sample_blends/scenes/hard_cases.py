# SPDX-License-Identifier: GPL-3.0-or-later
"""What breaks renderers, in stations around the origin: millimetre props on a kilometre of floor, walls that touch and
walls in one plane, slivers, one-sheet cloth, thin curved shells, mirrored and squashed objects. Ten cameras look on.
Every station has virtual lights.

Object positions are multiples of 2^-10 m, so that the whole scene can be moved by 8,192 m without rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import blend
from .blend import LightPatch
from .hard_case_lights import (
    BOWL_TAG,
    CLOTH_TAG,
    FLOOR_INNERMOST,
    HALF_PIPE_TAG,
    add_lights,
    ball_lights,
    both_sides,
    corner_lights,
    nested_squares,
    whole,
    without_bottom,
)
from .shapes import Shape, box, flipped, icosphere, join, lathe, moved, octahedron, patch, shape

FLOOR_EXTENT = 1024.0
GRAIN = 2.0**-10  # m; nearly a millimetre
WALL_HEIGHT, WALL_THICKNESS = 2.5, 0.25

# Stations' centres on the floor.
PROPS, WALLS, SLIVERS, CLOTH, SHELLS, FRAMES = (0, 0), (-5, 3), (4, 3), (0, 6), (5, 7), (-4.5, 9)
FAR_TOWER = (160, 400)

GREY, PALE, RED, BLUE = (0.42, 0.42, 0.40), (0.68, 0.66, 0.60), (0.56, 0.10, 0.07), (0.09, 0.20, 0.50)
GREEN, GLAZED = (0.12, 0.42, 0.14), (0.60, 0.42, 0.12)

SUN_IRRADIANCE, POINT_W, SPOT_W, PROP_LAMP_W, AREA_W = 1.2, 120.0, 400.0, 0.004, 30.0

CAMERAS: tuple[tuple[str, tuple[float, float, float], tuple[float, float, float], float], ...] = (
    ("01 millimetre props", (0.028, -0.050, 0.030), (0.0, 0.0, 0.003), 50.0),
    ("02 kilometre floor", (-2.0, -14.0, 1.6), (60.0, 200.0, 2.0), 28.0),
    ("03 touching walls", (-2.5, 0.25, 1.9), (-5.2, 3.4, 0.8), 28.0),
    ("04 inner corner", (-5.3, 1.7, 2.0), (-6.6, 2.9, 0.8), 22.0),
    ("05 slivers", (4.0, -0.25, 1.8), (4.0, 3.0, 0.6), 32.0),
    ("06 cloth", (-1.9, 3.6, 1.5), (0.0, 6.0, 1.0), 35.0),
    ("07 cloth from behind", (1.9, 8.3, 1.3), (0.0, 6.0, 1.0), 35.0),
    ("08 thin shells", (3.2, 4.4, 1.5), (5.1, 7.1, 0.6), 32.0),
    ("09 grazing", (-9.0, -4.0, 0.02), (1.0, 5.0, 0.7), 35.0),
    ("10 from above", (0.0, 5.0, 26.0), (0.0, 5.5, 0.0), 30.0),
)
# Shares of the larger sensor side.
SHIFTS = {"04 inner corner": (0.10, -0.15)}
ORTHOGRAPHIC_EXTENTS = {"10 from above": 18.0}  # m
NEAR_CLIPS = {"01 millimetre props": 0.002}  # m
NEAR_CLIP = 0.01


def snapped(position: Sequence[float]) -> tuple[float, ...]:
    """The nearest position whose coordinates are multiples of GRAIN."""
    return tuple(round(value / GRAIN) * GRAIN for value in position)


def millimetre_props() -> dict[str, Shape]:
    """Cubes, balls and a spike of one to six millimetres on a saucer, some touching, some hovering by a tenth."""
    grain = GRAIN
    return {
        "Cube 1 mm": moved(box((0, 0, 0), (grain, grain, grain)), (-0.010, -0.004, 0)),
        "Cube 4 mm": moved(box((0, 0, 0), (4 * grain, 4 * grain, 4 * grain)), (-0.008, -0.002, 0)),
        "Hovering slab": moved(box((0, 0, 0), (0.012, 0.003, 0.0004)), (-0.004, -0.011, 0.0001)),
        "Ball 6 mm": moved(icosphere(0.003, 3), (0.004, 0.002, 0.003)),
        "Ball 1 mm": moved(icosphere(0.0005, 2), (0.0075, -0.003, 0.0005)),
        "Spike": spike(12),
    }


def spike(segments: int) -> Shape:
    """A cone of twelve millimetres, less than one across."""
    return lathe([(0.0, 0.0), (0.0004, 0.0), (0.0, 0.012)], segments)


def saucer(segments: int = 48) -> Shape:
    """A flat dish under the props, its rim a fifth of a millimetre thick."""
    profile = [(0.0, -0.0005), (0.012, -0.0005), (0.018, 0.0012), (0.0178, 0.0014), (0.0118, 0.0), (0.0, 0.0)]
    return lathe(profile, segments)


def touching_walls() -> dict[str, Shape]:
    """Walls that share a plane, a face, an edge or a corner, without a gap and without overlap of visible faces."""
    t, h = WALL_THICKNESS, WALL_HEIGHT
    return {
        "Long wall": box((-2, 0, 0), (0, t, h)),
        "Wall in the same plane": box((0, 0, 0), (1.5, t, h)),
        "Wall at right angles": box((-2, -2, 0), (-2 + t, 0, h)),
        "Low wall against it": box((-2 + t, -1, 0), (-1, 0, 1.0)),
        "Block on an edge": box((-1, -2, 0), (-0.25, -1, 0.5)),
        "Block on a corner": box((-0.25, -1, 0.5), (0.25, -0.5, 1.0)),
        "Panel in the wall's plane": box((0.25, 0, 0.75), (1.25, 0.0625, 1.75)),
    }


def wall_with_panel_hole() -> Shape:
    """The wall's front as a frame around the flush panel, its back and sides whole."""
    t, h = WALL_THICKNESS, WALL_HEIGHT
    xs, zs = (0.0, 0.25, 1.25, 1.5), (0.0, 0.75, 1.75, h)
    front = [
        patch((xs[i], 0, zs[j]), (xs[i + 1] - xs[i], 0, 0), (0, 0, zs[j + 1] - zs[j]))
        for i in range(3)
        for j in range(3)
        if (i, j) != (1, 1)
    ]
    whole = box((0, 0, 0), (1.5, t, h))
    without_front = shape(whole.vertices, [face for index, face in enumerate(whole.faces) if index != 2])
    return join([*front, without_front])


def needle_disc(radius: float, count: int) -> Shape:
    """A flat disc of triangles that all meet in one point of its rim: ever thinner needles."""
    angles = np.linspace(0, 2 * math.pi, count, endpoint=False)
    rim = np.c_[radius * np.cos(angles), np.zeros(count), radius * np.sin(angles)]
    return shape(rim, [(0, i, i + 1) for i in range(1, count - 1)])


def sliver_strip(length: float, height: float) -> Shape:
    """An upright sheet cut into strips of 1e-1 down to 1e-7 m in width, and the same again, mirrored."""
    widths = [10.0**-power for power in range(1, 8)]
    spare = (length - 2 * sum(widths)) / 2
    xs = np.cumsum([0.0, spare, *widths, *widths[::-1], spare]) - length / 2
    points = [(x, 0.0, z) for z in (0.0, height) for x in xs]
    k = len(xs)
    halves = [((i, i + 1, k + i + 1), (i, k + i + 1, k + i)) for i in range(k - 1)]
    return shape(points, [triangle for pair in halves for triangle in pair])


def degenerate_sheet() -> Shape:
    """A sheet with triangles without area, in a line and in a point, and with doubled vertices among its good ones."""
    points = [(0, 0, 0), (0.5, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1), (0.5, 0, 0), (0.5, 0, 0), (0.5, 0, 1)]
    return shape(points, [(0, 1, 7), (0, 7, 4), (5, 2, 3), (5, 3, 7), (0, 1, 2), (1, 5, 6), (3, 7, 4)])


def sliver_station(needles: int = 512) -> dict[str, Shape]:
    """A disc of needles, a sheet cut into slivers and a sheet with triangles without area."""
    return {
        "Needle disc": moved(needle_disc(0.6, needles), (-1.1, 0, 0.75)),
        "Sliver strip": moved(sliver_strip(1.0, 1.2), (0.2, 0, 0)),
        "Degenerate sheet": moved(degenerate_sheet(), (0.9, 0, 0)),
    }


def cloth(width: float, height: float, columns: int = 48, rows: int = 24) -> Shape:
    """One hanging sheet without thickness, to be seen and lit from both sides."""
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    wave = np.sin(6 * math.pi * u + 0.8 * v) + 0.4 * np.sin(14 * math.pi * u - 1.3 * v)
    points = np.stack([(u - 0.5) * width, 0.16 * (0.3 + 0.7 * (1 - v)) * wave, v * height], axis=-1)
    sheet = patch((0, 0, 0), (1, 0, 0), (0, 1, 0), columns, rows)
    return Shape(points.reshape(-1, 3), sheet.faces, sheet.materials, None, True)


def half_pipe(radius: float, thickness: float, length: float, segments: int = 40) -> Shape:
    """Half a tube lying along y, open below, with walls of the given thickness; closed."""
    angles = np.linspace(0, math.pi, segments + 1)
    rings = [
        [(r * math.cos(a), y, r * math.sin(a)) for a in angles]
        for y in (-length / 2, length / 2)
        for r in (radius, radius - thickness)
    ]
    k = segments + 1
    outer_front, inner_front, outer_back, inner_back = (np.arange(k) + i * k for i in range(4))
    pairs = [(outer_front, outer_back), (inner_back, inner_front), (inner_front, outer_front), (outer_back, inner_back)]
    faces = [(a[i], b[i], b[i + 1], a[i + 1]) for a, b in pairs for i in range(segments)]
    ends = [(outer_front[i], outer_back[i], inner_back[i], inner_front[i]) for i in (0, segments)]
    faces += [ends[0][::-1], ends[1]]
    return shape(np.concatenate(rings), faces)


def bowl(radius: float, thickness: float, segments: int = 64, steps: int = 24) -> Shape:
    """A hemispherical bowl, open at the top, standing on its pole; closed, with walls of the given thickness."""
    angles = np.linspace(-math.pi / 2, 0, steps + 1)
    outer = [(radius * math.cos(a), radius + radius * math.sin(a)) for a in angles]
    inside = radius - thickness
    inner = [(inside * math.cos(a), radius + inside * math.sin(a)) for a in angles[::-1]]
    outer[0], inner[-1] = (0.0, outer[0][1]), (0.0, inner[-1][1])
    return lathe([*outer, *inner], segments)


def add_station(scene: Any, parts: dict[str, Shape], centre: Sequence[float], material: Any) -> None:
    """Objects with their origins at a station's centre."""
    for name, part in parts.items():
        blend.add_mesh(scene, name, part, material).location = snapped((*centre, 0.0)[:3])


CORNER_ARMS = (((0, 0, 0), (0.8, 0.25, 0.25)), ((0, 0.25, 0), (0.25, 0.6, 0.25)), ((0, 0, 0.25), (0.25, 0.25, 1.1)))
CORNER_PLACES = (((1, 1, 1), 0.0), ((-1, 1, 1), 0.0), ((1, -1, 1), 0.6), ((2.0, 0.5, 0.001), 0.0))
"""Scale and turn of each."""


def add_frames(scene: Any, material: Any) -> None:
    """One shape as it is, mirrored, mirrored and turned, squashed flat, and sheared by its parent's scale.

    Each has light mesh objects in the same place, turned and scaled as it is.
    """
    x, y = FRAMES
    corner = join([box(lower, upper) for lower, upper in CORNER_ARMS])
    data = blend.mesh_data("Corner", corner, [material])
    lights = [LightPatch(corner_lights(CORNER_ARMS), PALE)]
    parent = blend.add_object(scene, "Squash", None)
    parent.location, parent.scale = snapped((x, y + 1.5, 0.0)), (1.5, 0.5, 1.0)
    for index, (scale, turn) in enumerate(CORNER_PLACES):
        location = snapped((x + 1.6 * index - 2.4, y, 0.0))
        added = blend.add_object(scene, f"Corner {index}", data)
        for thing in (added, add_lights(scene, added.name, location, lights)):
            thing.location, thing.scale, thing.rotation_euler = location, scale, (0, 0, turn)
    child = blend.add_object(scene, "Sheared corner", data)
    for thing in (child, add_lights(scene, child.name, (0, 0, 0), lights)):
        thing.parent, thing.rotation_euler = parent, (0, 0, 0.7)


def add_virtual_lights(scene: Any) -> None:
    """Lights of everything but the frames, coarser than the surfaces where those are curved."""
    add_lights(scene, "Floor", (0, 0, 0), [LightPatch(nested_squares(FLOOR_INNERMOST, FLOOR_EXTENT / 2), GREY)])
    tower = without_bottom(box((-4, -4, 0), (4, 4, 60)))
    add_lights(scene, "Tower", (*FAR_TOWER, 0), [LightPatch(tower, RED)])

    props = millimetre_props()
    patches = [whole(saucer(8), saucer(), PALE)]
    for name, color in (("Cube 1 mm", RED), ("Cube 4 mm", BLUE), ("Hovering slab", GREEN)):
        patches.append(LightPatch(without_bottom(props[name]), color))
    patches.append(whole(ball_lights((0.004, 0.002, 0.003), 0.003), props["Ball 6 mm"], GLAZED))
    patches.append(whole(ball_lights((0.0075, -0.003, 0.0005), 0.0005), props["Ball 1 mm"], PALE))
    patches.append(whole(spike(4), props["Spike"], RED))
    add_lights(scene, "Props", snapped((*PROPS, GRAIN)), patches)

    walls = {name: without_bottom(wall) for name, wall in touching_walls().items()}
    panel = walls.pop("Panel in the wall's plane")
    patches = [*(LightPatch(wall, PALE) for wall in walls.values()), LightPatch(panel, BLUE)]
    add_lights(scene, "Walls", snapped((*WALLS, 0)), patches)

    slivers = sliver_station(needles=24)
    add_lights(scene, "Slivers", snapped((*SLIVERS, 0)), [LightPatch(part, GREEN) for part in slivers.values()])

    sheet = cloth(2.0, 1.9, 12, 3)
    patches = [whole(side, cloth(2.0, 1.9), RED, CLOTH_TAG) for side in (sheet, flipped(sheet))]
    add_lights(scene, "Cloth", snapped((*CLOTH, 0.125)), patches)
    facing_away = flipped(cloth(0.8, 1.2, 6, 2))
    facing_away_lights = [LightPatch(both_sides(facing_away), BLUE, CLOTH_TAG)]
    add_lights(scene, "Cloth facing away", snapped((1.75, 6.5, 0.125)), facing_away_lights)

    pipe, inner_pipe = half_pipe(0.7, 0.002, 1.6, 8), half_pipe(0.694, 0.002, 1.6, 8)
    patches = [whole(pipe, half_pipe(0.7, 0.002, 1.6), GLAZED, HALF_PIPE_TAG)]
    patches.append(whole(inner_pipe, half_pipe(0.694, 0.002, 1.6), GLAZED, HALF_PIPE_TAG))
    coarse_bowl = moved(bowl(0.45, 0.003, 8, 3), (1.3, -0.4, 0))
    patches.append(whole(coarse_bowl, bowl(0.45, 0.003), GLAZED, BOWL_TAG))
    patches.append(LightPatch(moved(octahedron(0.2), (1.3, -0.4, 0.6)), GLAZED))
    add_lights(scene, "Shells", snapped((*SHELLS, 0)), patches)


def add_lamps(scene: Any) -> None:
    """A sun, a point without extent, a soft spot, an area lamp behind the cloth, and a speck beside the props."""
    sun = blend.add_lamp(scene, "Sun", "SUN", SUN_IRRADIANCE, (-3, -5, 9), (0, 0, 0))
    sun.data.angle = math.radians(0.53)
    point = blend.add_lamp(scene, "Point", "POINT", POINT_W, snapped((-4.5, 1.5, 2.25)))
    point.data.shadow_soft_size = 0.0
    blend.add_spot(scene, "Spot", SPOT_W, snapped((1.5, 2.0, 4.0)), (3.5, 6.0, 0.0), 90.0, 0.3, 0.05)
    area = blend.add_lamp(scene, "Area", "AREA", AREA_W, snapped((-1.5, 8.0, 2.25)), (0.0, 6.0, 1.0))
    area.data.shape, area.data.size, area.data.size_y = "RECTANGLE", 0.75, 0.25
    area.visible_camera = False
    prop_lamp = blend.add_lamp(scene, "Prop lamp", "POINT", PROP_LAMP_W, snapped((0.02, -0.02, 0.03)))
    prop_lamp.data.shadow_soft_size = 0.0005


def add_cameras(scene: Any) -> None:
    """The ten cameras; the first becomes the scene's."""
    for name, position, target, lens in CAMERAS:
        clip = (NEAR_CLIPS.get(name, NEAR_CLIP), 2 * FLOOR_EXTENT)
        camera = blend.add_camera(scene, position, target, lens, name=f"Camera {name}", clip=clip)
        camera.location = snapped(position)
        camera.data.shift_x, camera.data.shift_y = SHIFTS.get(name, (0.0, 0.0))
        if name in ORTHOGRAPHIC_EXTENTS:
            camera.data.type, camera.data.ortho_scale = "ORTHO", ORTHOGRAPHIC_EXTENTS[name]


def build() -> None:
    """Fills the current file with the scene."""
    scene = blend.empty_scene("hard_cases", 640, 480)
    grey, pale = blend.diffuse("Grey floor", GREY), blend.diffuse("Pale", PALE)
    red, blue, green = blend.diffuse("Red", RED), blend.diffuse("Blue", BLUE), blend.diffuse("Green", GREEN)
    glossy = blend.principled("Glazed", GLAZED)

    half = FLOOR_EXTENT / 2
    blend.add_mesh(scene, "Kilometre floor", patch((-half, -half, 0), (FLOOR_EXTENT, 0, 0), (0, FLOOR_EXTENT, 0)), grey)
    tower = moved(box((-4, -4, 0), (4, 4, 60)), (0, 0, 0))
    blend.add_mesh(scene, "Far tower", tower, red).location = (*FAR_TOWER, 0)

    on_saucer = snapped((*PROPS, GRAIN))
    blend.add_mesh(scene, "Saucer", saucer(), pale).location = on_saucer
    for (name, part), material in zip(millimetre_props().items(), (red, blue, green, glossy, pale, red), strict=True):
        blend.add_mesh(scene, name, part, material).location = on_saucer

    walls = touching_walls() | {"Wall in the same plane": wall_with_panel_hole()}
    panel = walls.pop("Panel in the wall's plane")
    add_station(scene, walls, WALLS, pale)
    add_station(scene, {"Panel in the wall's plane": panel}, WALLS, blue)

    add_station(scene, sliver_station(), SLIVERS, green)

    sheets = (("Cloth", cloth(2.0, 1.9), red, (*CLOTH, 0.125)),)
    sheets += (("Cloth facing away", flipped(cloth(0.8, 1.2)), blue, (1.75, 6.5, 0.125)),)
    for name, sheet, material, place in sheets:
        added = blend.add_mesh(scene, name, sheet, material)
        added.location, added["vlm_tag"] = snapped(place), CLOTH_TAG

    shells = {
        "Half pipe": half_pipe(0.7, 0.002, 1.6),
        "Bowl": moved(bowl(0.45, 0.003), (1.3, -0.4, 0)),
        "Half pipe in half pipe": half_pipe(0.694, 0.002, 1.6),
        "Floating gem": moved(octahedron(0.2), (1.3, -0.4, 0.6)),
    }
    add_station(scene, shells, SHELLS, glossy)
    for name, tag in (("Half pipe", HALF_PIPE_TAG), ("Half pipe in half pipe", HALF_PIPE_TAG), ("Bowl", BOWL_TAG)):
        scene.objects[name]["vlm_tag"] = tag
    add_frames(scene, pale)
    add_virtual_lights(scene)

    add_lamps(scene)
    add_cameras(scene)
