# SPDX-License-Identifier: GPL-3.0-or-later
"""A two-storey colonnaded hall, about 262,000 triangles in a render: a stand-in for the Sponza atrium.

The nave runs along x under a roof with an opening through which the sun falls; aisles with groin vaults lie below,
galleries with barrel vaults above. What repeats is built once for the side of positive y, arrayed or instanced along
the hall, and turned by half a circle for the other side.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import architecture as parts
from . import blend
from .shapes import Shape, box, lathe, moved, turned
from .textures import lattice

# Plan, m: eight bays along x; the arcade's wall from NAVE to AISLE, the aisle up to the lining of the outer wall.
BAY, BAYS = 3.75, 8
HALF_LENGTH = BAY * BAYS / 2
NAVE, AISLE, LINING, OUTER = 4.2, 4.8, 8.7, 9.0
COLUMN_LINE = (NAVE + AISLE) / 2
WALL = 0.6

# Elevation, m.
SPRINGING, RISE = 3.9, 1.5
VAULT_TOP, GALLERY = 5.9, 6.05
PEDESTAL = 0.95
UPPER_SPRINGING, UPPER_RISE = 9.35, 1.55
CEILING, ROOF = 11.6, 12.0
OPENING = (9.3, 3.5)  # half extents of the hole in the roof

LOWER_ARCH = parts.Arch(1.5, SPRINGING, RISE)
UPPER_ARCH = parts.Arch(1.55, UPPER_SPRINGING, UPPER_RISE)
COLUMN_RADIUS, UPPER_COLUMN_RADIUS = 0.33, 0.25
BALUSTERS_PER_BAY = 9
CURTAIN_LEVELS = 1
SMOOTH_BELOW, HEM_ABOVE = math.radians(35), math.radians(75)

CURTAIN_BAYS = (1, 3, 5, 6)
SWAG_BAYS = (0, 2, 4, 7)
CLOTH_COLORS: dict[str, blend.Rgb] = {
    "Red cloth": (0.52, 0.035, 0.03),
    "Green cloth": (0.04, 0.30, 0.07),
    "Blue cloth": (0.035, 0.10, 0.42),
}

SUN_IRRADIANCE, SUN_ANGLE = 14.0, math.radians(0.53)
SUN_FROM = (-0.22, -0.50, 1.0)  # towards the sun
LANTERN_POWER_W = 90.0
EXPOSURE = 1.4
LANTERNS = ((BAY * 2.5, (LINING + AISLE) / 2, 3.3), (-BAY * 0.5, -(LINING + AISLE) / 2, 3.3))

STRING_COURSE = ((0.1, -0.25), (0.1, 0.12), (-0.26, 0.12), (-0.26, 0.05), (-0.20, 0.02), (-0.16, -0.08), (-0.08, -0.15),
                 (-0.06, -0.25))  # fmt: skip
"""Section (y, z) of the moulding along the nave: y = 0 is the wall's face, negative y stands out from it."""

ARCHIVOLT = ((0.0, -0.06), (0.07, -0.06), (0.09, -0.10), (0.20, -0.10), (0.24, -0.05), (0.28, -0.04), (0.28, 0.05),
             (0.0, 0.05))  # fmt: skip
"""Section (distance outside the arch, y) of the moulding around an arch."""


class Hall:
    """The scene while it is being built: its materials, and how parts are put into it."""

    def __init__(self, scene: Any) -> None:
        self.scene = scene
        self.limestone = blend.diffuse("Limestone", (0.58, 0.51, 0.40))
        self.plaster = blend.diffuse("Vault plaster", (0.66, 0.60, 0.50))
        self.marble = blend.principled("Pale marble", (0.64, 0.60, 0.53))
        self.terracotta = blend.principled("Terracotta", (0.45, 0.17, 0.08), roughness=0.8)
        self.wood = blend.principled("Dark oak", (0.16, 0.075, 0.035), roughness=0.6)
        self.brass = blend.principled("Brass", (0.75, 0.53, 0.22), roughness=0.35, metallic=1.0)
        self.paving = blend.principled("Paving", (0.5, 0.45, 0.4), image=blend.packed_image("Paving", paving_pixels()))
        self.cloths = [blend.diffuse(name, color) for name, color in CLOTH_COLORS.items()]

    def add(self, name: str, source: Shape, material: Any, at: Sequence[float] = (0.0, 0.0, 0.0)) -> Any:
        """A mesh object; edges sharper than SMOOTH_BELOW stay sharp where the shape is smooth."""
        added = blend.add_mesh(self.scene, name, source, material)
        if source.smooth:
            added.data.set_sharp_from_angle(angle=SMOOTH_BELOW)
        added.location = at
        return added

    def instance(self, source: Any, at: Sequence[float], turn: float = 0.0) -> Any:
        """Another object of the same mesh with the same modifiers."""
        copy = source.copy()
        self.scene.collection.objects.link(copy)
        copy.location, copy.rotation_euler = at, (0.0, 0.0, turn)
        return copy

    def opposite(self, source: Any) -> Any:
        """The object once more on the other side of the hall, turned by half a circle about its middle."""
        x, y, z = source.location
        return self.instance(source, (-x, -y, z), source.rotation_euler.z + math.pi)


def repeat(target: Any, count: int, step: float) -> Any:
    """An array modifier along x."""
    array = target.modifiers.new("Array", "ARRAY")
    array.use_relative_offset, array.use_constant_offset = False, True
    array.count, array.constant_offset_displace = count, (step, 0.0, 0.0)
    return target


def paving_pixels(size: int = 256) -> npt.NDArray[np.uint8]:
    """Two by two slabs, the light ones with a dark diamond, with joints, veins and grain; it tiles."""
    rows, columns = np.mgrid[0:size, 0:size]
    y, x = rows / size, columns / size
    light, dark, accent = np.array([[178, 160, 132], [118, 82, 62], [74, 66, 60]], float)
    checker = ((x < 0.5) == (y < 0.5))[..., None]
    u, v = (2 * x) % 1 - 0.5, (2 * y) % 1 - 0.5
    diamond = (np.abs(u) + np.abs(v) < 0.24)[..., None] & checker
    color = np.where(checker, light, dark)
    color = np.where(diamond, accent, color)
    veins = sum(
        np.sin(2 * math.pi * (a * x + b * y) + 1.7 * np.sin(2 * math.pi * (c * x + d * y)))
        for a, b, c, d in ((1, 2, 3, 1), (3, -1, 2, 4), (2, 5, -4, 1))
    )
    grain = 0.1 * (lattice(columns, rows, 7) / 255 - 0.5)
    color *= (1 + 0.035 * veins + grain)[..., None]
    joint = (np.maximum(np.abs(u), np.abs(v)) > 0.5 - 3.0 / size)[..., None]
    return np.clip(np.where(joint, color * 0.55, color), 0, 255).astype(np.uint8)


def add_shell(hall: Hall) -> None:
    """Floor, outer walls, roof with its opening and the beams across it."""
    x, y = HALF_LENGTH + WALL, OUTER + WALL
    floor = box((-x, -y, -0.4), (x, y, 0.0))
    hall.add("Floor", parts.box_mapped(floor, 2.4), hall.paving)
    walls = parts.tube(((-x, -y, 0.0), (x, y, CEILING)), ((-HALF_LENGTH, -OUTER), (HALF_LENGTH, OUTER)))
    hall.add("Outer walls", walls, hall.limestone)
    roof = parts.tube(((-x, -y, CEILING), (x, y, ROOF)), ((-OPENING[0], -OPENING[1]), OPENING))
    hall.add("Roof", roof, hall.limestone)
    beam = hall.add("Beams", box((-0.11, -NAVE, -0.42), (0.11, NAVE, 0.0)), hall.wood, (-BAY * 3, 0, CEILING))
    repeat(beam, 13, BAY / 2)


def add_floor_of_gallery(hall: Hall) -> None:
    """The slabs over the aisles, which the vaults below carry."""
    slab = box((-HALF_LENGTH, 0, VAULT_TOP), (HALF_LENGTH, OUTER - NAVE, GALLERY))
    hall.opposite(hall.add("Gallery floor", parts.box_mapped(slab, 2.4), hall.paving, (0, NAVE, 0)))


def add_arcades(hall: Hall) -> None:
    """Both storeys of the nave's walls, their mouldings, and the lining of the outer walls."""
    for name, arch, top in (("Lower", LOWER_ARCH, VAULT_TOP), ("Upper", UPPER_ARCH, CEILING)):
        wall = parts.arched_wall(BAY, BAYS, arch, top, AISLE - NAVE)
        hall.opposite(hall.add(f"{name} arcade", wall, hall.limestone, (-HALF_LENGTH, NAVE, 0)))
        moulding = hall.add(f"{name} archivolts", parts.archivolt(ARCHIVOLT, arch), hall.marble)
        moulding.location = (-HALF_LENGTH + BAY / 2, NAVE, 0)
        hall.opposite(repeat(moulding, BAYS, BAY))
    for name, height in (("String course", GALLERY - 0.12), ("Cornice", CEILING - 0.12)):
        course = parts.band(STRING_COURSE, 2 * HALF_LENGTH)
        hall.opposite(hall.add(name, course, hall.marble, (-HALF_LENGTH, NAVE, height)))
    blind = parts.Arch(1.4, SPRINGING, RISE)
    lining = parts.arched_wall(BAY, BAYS, blind, VAULT_TOP, OUTER - LINING, foot=0.0)
    hall.opposite(hall.add("Lower lining", lining, hall.limestone, (-HALF_LENGTH, LINING, 0)))
    blind = parts.Arch(1.2, UPPER_SPRINGING - 0.7, 1.2)
    lining = parts.arched_wall(BAY, BAYS, blind, CEILING, OUTER - LINING, foot=GALLERY)
    hall.opposite(hall.add("Upper lining", lining, hall.limestone, (-HALF_LENGTH, LINING, 0)))


def add_vaults(hall: Hall) -> None:
    """Groin vaults over the aisles with ribs between them, a barrel vault with ribs over each gallery."""
    width = LINING - AISLE
    groin = parts.groin_vault(BAY, width, SPRINGING, VAULT_TOP - 0.1 - SPRINGING, VAULT_TOP, 16)
    hall.opposite(repeat(hall.add("Groin vaults", groin, hall.plaster, (-HALF_LENGTH, AISLE, 0)), BAYS, BAY))
    barrel = parts.arched_wall(width, 1, parts.Arch(width / 2, UPPER_SPRINGING, 1.9, 24), CEILING, 2 * HALF_LENGTH)
    added = hall.add("Barrel vault", turned(barrel, math.pi / 2), hall.plaster, (HALF_LENGTH, AISLE, 0))
    hall.opposite(added)
    for name, springing, rise, top in (
        ("Lower ribs", SPRINGING, 1.65, VAULT_TOP),
        ("Upper ribs", UPPER_SPRINGING, 1.72, CEILING),
    ):
        rib = parts.arched_wall(width, 1, parts.Arch(width / 2 - 0.16, springing, rise, 24), top, 0.4)
        rib = moved(turned(rib, math.pi / 2), (0.2, 0, 0))
        added = hall.add(name, rib, hall.limestone, (-HALF_LENGTH + BAY, AISLE, 0))
        hall.opposite(repeat(added, BAYS - 1, BAY))


def add_columns(hall: Hall) -> None:
    """Columns of both storeys, the outermost half inside the end walls, and the upper ones' pedestals."""
    height = UPPER_SPRINGING - GALLERY - PEDESTAL
    sources = (
        ("Column", parts.column(COLUMN_RADIUS, SPRINGING), 0.0),
        ("Pedestal", parts.pedestal(0.36, PEDESTAL), GALLERY),
        ("Upper column", parts.column(UPPER_COLUMN_RADIUS, height, 20), GALLERY + PEDESTAL),
    )
    for name, source, z in sources:
        first = hall.add(name, source, hall.marble, (-HALF_LENGTH, COLUMN_LINE, z))
        hall.opposite(first)
        for index in range(1, BAYS + 1):
            hall.opposite(hall.instance(first, (-HALF_LENGTH + index * BAY, COLUMN_LINE, z)))


def add_balustrades(hall: Hall) -> None:
    """Rails and posts between the pedestals of the gallery."""
    clear = 0.40
    length, y = BAY - 2 * clear, COLUMN_LINE
    for name, half, z, high in (("Plinth", 0.16, GALLERY, 0.13), ("Handrail", 0.19, GALLERY + 0.80, 0.14)):
        chamfer = (
            (-half, 0),
            (half, 0),
            (half, 0.6 * high),
            (half - 0.04, high),
            (-half + 0.04, high),
            (-half, 0.6 * high),
        )
        rail = hall.add(name, parts.band(chamfer, length), hall.marble, (-HALF_LENGTH + clear, y, z))
        hall.opposite(repeat(rail, BAYS, BAY))
    step = length / BALUSTERS_PER_BAY
    post = hall.add("Balusters", parts.baluster(0.67, 0.085), hall.marble)
    post.location = (-HALF_LENGTH + clear + step / 2, y, GALLERY + 0.13)
    hall.opposite(repeat(repeat(post, BALUSTERS_PER_BAY, step), BAYS, BAY))


def add_ends(hall: Hall) -> None:
    """Two tiers of blind arches on the end walls, a door below, a round moulding above."""
    deep, span = 0.35, 2 * NAVE / 3
    lower = parts.arched_wall(span, 3, parts.Arch(1.05, 3.2, 1.05), VAULT_TOP, deep, foot=0.0)
    upper = parts.arched_wall(span, 3, parts.Arch(0.95, 8.6, 0.95), CEILING, deep, foot=VAULT_TOP)
    course = parts.band(STRING_COURSE, 2 * NAVE)
    panels = parts.door(2.1, 3.2, 0.2)
    tympanum = parts.archivolt(ARCHIVOLT, parts.Arch(1.05, 3.2, 1.05))
    x = HALF_LENGTH - deep
    for name, source, material, at in (
        ("Lower end wall", lower, hall.limestone, (x, NAVE, 0)),
        ("Upper end wall", upper, hall.limestone, (x, NAVE, 0)),
        ("End string course", course, hall.marble, (x, NAVE, GALLERY - 0.12)),
        ("End cornice", course, hall.marble, (x, NAVE, CEILING - 0.12)),
        ("Door", panels, hall.wood, (HALF_LENGTH - 0.2, 1.05, 0)),
        ("Portal arch", tympanum, hall.marble, (x, 0, 0)),
    ):
        added = hall.add(name, turned(source, -math.pi / 2), material, at)
        hall.opposite(added)


def keep_hem(cloth: Any) -> None:
    """Makes the mesh sharp at its hems alone and keeps those square when it is subdivided; folds become smooth."""
    cloth.set_sharp_from_angle(angle=HEM_ABOVE)
    hems = np.zeros(len(cloth.edges), bool)
    cloth.attributes["sharp_edge"].data.foreach_get("value", hems)
    cloth.attributes.new("crease_edge", "FLOAT", "EDGE").data.foreach_set("value", hems.astype(np.float32))


def add_cloths(hall: Hall) -> None:
    """Curtains on rods between the lower columns, bows of cloth under the upper arches."""
    hang, width = SPRINGING - 0.45, BAY - 2 * COLUMN_RADIUS
    curtain = parts.drawn_curtain(width - 0.1, hang - 0.15, 0.95, 5, (36, 8))
    bar = None
    cloths = itertools.cycle(hall.cloths)
    for index in CURTAIN_BAYS:
        at = (-HALF_LENGTH + index * BAY + COLUMN_RADIUS, COLUMN_LINE, hang)
        first = hall.add("Curtain", curtain, next(cloths), np.add(at, (0.05, 0, 0)))
        keep_hem(first.data)
        subdivision = first.modifiers.new("Subdivision", "SUBSURF")
        subdivision.levels, subdivision.render_levels = 0, CURTAIN_LEVELS
        second = hall.opposite(first)
        second.material_slots[0].link = "OBJECT"
        second.material_slots[0].material = next(cloths)
        bar = hall.instance(bar, at) if bar else hall.add("Rod", parts.rod(width, 0.025), hall.brass, at)
        hall.opposite(bar)
    bow = parts.swag(2 * UPPER_ARCH.half_width, 1.1, (26, 10))
    for index in SWAG_BAYS:
        at = (-HALF_LENGTH + (index + 0.5) * BAY - UPPER_ARCH.half_width, COLUMN_LINE, UPPER_SPRINGING - 0.15)
        hanging = hall.add("Swag", bow, next(cloths), at)
        keep_hem(hanging.data)
        hall.opposite(hanging)


VASE = ((0.16, 0.0), (0.17, 0.05), (0.09, 0.10), (0.10, 0.16), (0.24, 0.34), (0.33, 0.56), (0.33, 0.70), (0.25, 0.84),
        (0.20, 0.90), (0.24, 0.98), (0.27, 1.00), (0.22, 0.985), (0.17, 0.90), (0.22, 0.80))  # fmt: skip


def add_furniture(hall: Hall) -> None:
    """Vases on pedestals in the nave, lanterns in the aisles."""
    stand = hall.add("Vase pedestal", parts.pedestal(0.32, 0.75), hall.marble, (-BAY * 1.5, 2.6, 0))
    vase = hall.add("Vase", lathe(parts.capped(VASE), 32), hall.terracotta, (-BAY * 1.5, 2.6, 0.75))
    for x in (BAY * 0.5, BAY * 2.5):
        for source, z in ((stand, 0.0), (vase, 0.75)):
            hall.opposite(hall.instance(source, (x, 2.6, z)))
            hall.instance(source, (x, 2.6, z))
    for source in (stand, vase):
        hall.opposite(source)
    hood = [(0.30, 0.0), (0.30, 0.02), (0.22, 0.10), (0.08, 0.17), (0.015, 0.20), (0.015, VAULT_TOP - 3.4)]
    lantern = lathe(parts.capped(hood), 24)
    for (x, y, z), name in zip(LANTERNS, ("Lantern east", "Lantern west"), strict=True):
        hall.add(name, lantern, hall.brass, (x, y, z + 0.1))


def add_lights(scene: Any) -> None:
    """The sun through the roof and a warm lamp in each lantern."""
    sun = blend.add_lamp(scene, "Sun", "SUN", SUN_IRRADIANCE, SUN_FROM, (0, 0, 0), (1.0, 0.94, 0.84))
    sun.data.angle = SUN_ANGLE
    sun.location = (0, 0, ROOF + 4)
    for place, name in zip(LANTERNS, ("Lamp east", "Lamp west"), strict=True):
        lamp = blend.add_lamp(scene, name, "POINT", LANTERN_POWER_W, place, color=(1.0, 0.72, 0.42))
        lamp.data.shadow_soft_size = 0.06


def build() -> None:
    """Fills the current file with the scene."""
    scene = blend.empty_scene("atrium", 1280, 720, view_transform="AgX")
    scene.view_settings.exposure = EXPOSURE
    hall = Hall(scene)
    add_shell(hall)
    add_floor_of_gallery(hall)
    add_arcades(hall)
    add_vaults(hall)
    add_columns(hall)
    add_balustrades(hall)
    add_ends(hall)
    add_cloths(hall)
    add_furniture(hall)
    add_lights(scene)
    blend.add_camera(scene, (-14.0, -1.4, 2.1), (0.0, 0.9, 3.3), lens_mm=18.0)
    blend.add_camera(scene, (9.2, 6.6, 7.9), (-3.0, -2.4, 4.4), lens_mm=20.0, name="Gallery camera")
    blend.add_camera(scene, (-13.0, 6.6, 1.7), (3.0, 5.4, 2.4), lens_mm=22.0, name="Aisle camera")
