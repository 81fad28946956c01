# SPDX-License-Identifier: GPL-3.0-or-later
"""A dancer in leotard, tights and skirt: her skeleton and her surface, fine or coarse. No bpy.

She is 1.75 m tall, stands at the origin, faces -y, and holds her arms half down at rest. `.L` is her left, +x.
"""

from __future__ import annotations

import math

import numpy as np

from .shapes import Points, grid_faces, shape
from .skinned import Bone, Link, Part, Skeleton, Tube, mirrored, other_side, smoothstep, tube_part

SKIRT_CHAINS = 12
SKIRT_TOP, SKIRT_LENGTH = 1.07, 0.46
SKIRT_WAIST = (0.128, 0.096)  # half width and depth
SKIRT_FLARE = math.radians(38.0)  # from straight down, at rest
SKIRT_KNEE = 0.5  # where the lower bones begin, share of the length
PLEATS, PLEAT_DEPTH = 12, 0.13

TORSO, HEAD, ARM_LEFT, ARM_RIGHT, LEG_LEFT, LEG_RIGHT, SKIRT = range(1, 8)
"""Tag ids of the parts."""

SHOULDER, ELBOW, WRIST, FINGERTIPS = (0.165, 0.0, 1.40), (0.370, 0.012, 1.195), (0.547, 0.0, 1.018), (0.675, 0.0, 0.890)
HIP, KNEE, ANKLE, TOES = (0.088, 0.0, 0.93), (0.092, -0.012, 0.50), (0.092, 0.012, 0.085), (0.092, -0.165, 0.018)

SPINE_BONES = (
    Bone("hips", "", (0.0, 0.0, 0.95), (0.0, 0.0, 1.08)),
    Bone("spine", "hips", (0.0, 0.0, 1.08), (0.0, -0.005, 1.25)),
    Bone("chest", "spine", (0.0, -0.005, 1.25), (0.0, 0.005, 1.43)),
    Bone("neck", "chest", (0.0, 0.005, 1.43), (0.0, -0.005, 1.53)),
    Bone("head", "neck", (0.0, -0.005, 1.53), (0.0, -0.005, 1.75)),
)
LIMB_BONES = (
    Bone("upper_arm.L", "chest", SHOULDER, ELBOW),
    Bone("forearm.L", "upper_arm.L", ELBOW, WRIST),
    Bone("hand.L", "forearm.L", WRIST, FINGERTIPS),
    Bone("thigh.L", "hips", HIP, KNEE),
    Bone("shin.L", "thigh.L", KNEE, ANKLE),
    Bone("foot.L", "shin.L", ANKLE, TOES),
)


def skirt_azimuth(chain: int) -> float:
    """Direction of a skirt chain around the waist, radians from +x."""
    return 2.0 * math.pi * chain / SKIRT_CHAINS


def skirt_point(azimuth: Points, down: Points) -> Points:
    """(n, 3) points of the skirt without pleats at rest; down: share of its length from the waist."""
    out = down * SKIRT_LENGTH * math.sin(SKIRT_FLARE)
    return np.stack(
        [
            (SKIRT_WAIST[0] + out) * np.cos(azimuth),
            (SKIRT_WAIST[1] + out) * np.sin(azimuth),
            SKIRT_TOP - down * SKIRT_LENGTH * math.cos(SKIRT_FLARE),
        ],
        axis=-1,
    )


def _vector(values: Points) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _skirt_bones() -> list[Bone]:
    bones = []
    for chain in range(SKIRT_CHAINS):
        azimuth = np.full(3, skirt_azimuth(chain))
        top, middle, hem = (_vector(point) for point in skirt_point(azimuth, np.array([0.0, SKIRT_KNEE, 1.0])))
        bones.append(Bone(f"skirt_upper_{chain:02d}", "hips", top, middle))
        bones.append(Bone(f"skirt_lower_{chain:02d}", f"skirt_upper_{chain:02d}", middle, hem))
    return bones


def _right(bone: Bone) -> Bone:
    (x, y, z), (u, v, w) = bone.head, bone.tail
    return Bone(other_side(bone.name), other_side(bone.parent), (-x, y, z), (-u, v, w))


SKELETON: Skeleton = (*SPINE_BONES, *LIMB_BONES, *map(_right, LIMB_BONES), *_skirt_bones())

TRUNK_TUBES = (
    Tube(
        "torso",
        [(0, 0.004, 0.82), (0, 0.012, 0.95), (0, 0.0, 1.10), (0, -0.012, 1.29), (0, 0.0, 1.40), (0, 0.006, 1.465)],
        [
            (0.0, 0.100, 0.090), (0.09, 0.132, 0.104), (0.20, 0.160, 0.116), (0.33, 0.134, 0.100),
            (0.43, 0.112, 0.084), (0.55, 0.124, 0.094), (0.70, 0.140, 0.110), (0.82, 0.146, 0.096),
            (0.92, 0.120, 0.074), (1.0, 0.060, 0.055),
        ],
        (Link("hips"), Link("spine", 0.40, 0.10), Link("chest", 0.66, 0.10)),
        "leotard", TORSO,
    ),
    Tube(
        "neck",
        [(0, 0.012, 1.40), (0, 0.004, 1.48), (0, -0.004, 1.57)],
        [(0.0, 0.066, 0.058), (0.35, 0.050, 0.049), (1.0, 0.048, 0.048)],
        (Link("chest"), Link("neck", 0.2, 0.15), Link("head", 0.75, 0.15)),
        "skin", HEAD, cap=0.05,
    ),
    Tube(
        "head",
        [(0, -0.030, 1.515), (0, -0.012, 1.60), (0, 0.004, 1.68), (0, 0.006, 1.745)],
        [(0.0, 0.052, 0.060), (0.25, 0.068, 0.080), (0.55, 0.079, 0.092), (0.80, 0.080, 0.094), (1.0, 0.074, 0.088)],
        (Link("head"),),
        "skin", HEAD, cap=0.32,
    ),
    Tube(
        "nose",
        [(0, -0.086, 1.655), (0, -0.104, 1.628), (0, -0.088, 1.606)],
        [(0.0, 0.010, 0.010), (0.55, 0.014, 0.016), (1.0, 0.012, 0.010)],
        (Link("head"),),
        "skin", HEAD, cap=0.35,
    ),
    Tube(
        "hair",
        [(0, 0.062, 1.560), (0, 0.036, 1.640), (0, 0.012, 1.705), (0, -0.012, 1.765)],
        [(0.0, 0.050, 0.040), (0.35, 0.083, 0.070), (0.65, 0.088, 0.094), (1.0, 0.080, 0.094)],
        (Link("head"),),
        "hair", HEAD, cap=0.36,
    ),
    Tube(
        "bun",
        [(0, 0.085, 1.715), (0, 0.112, 1.745), (0, 0.136, 1.772)],
        [(0.0, 0.042, 0.042), (0.5, 0.048, 0.048), (1.0, 0.042, 0.042)],
        (Link("head"),),
        "hair", HEAD, cap=0.45,
    ),
)  # fmt: skip

EYE = Tube(
    "eye.L", [(0.031, -0.090, 1.672), (0.031, -0.093, 1.660), (0.031, -0.091, 1.648)],
    [(0.0, 0.013, 0.008), (0.5, 0.014, 0.009), (1.0, 0.013, 0.008)], (Link("head"),), "hair", HEAD, cap=0.4,
)  # fmt: skip

ARM_LINKS = (Link("upper_arm.L"), Link("forearm.L", 0.555, 0.06))
SIDE_TUBES = (
    EYE,
    Tube(
        "arm.L",
        [(0.132, 0.0, 1.415), SHOULDER, (0.267, 0.004, 1.298), ELBOW, (0.458, 0.008, 1.106), (0.561, 0.0, 1.004)],
        [
            (0.0, 0.052, 0.052), (0.12, 0.050, 0.050), (0.30, 0.043, 0.045), (0.53, 0.034, 0.035),
            (0.64, 0.037, 0.035), (0.80, 0.030, 0.028), (0.93, 0.021, 0.026), (1.0, 0.020, 0.027),
        ],
        ARM_LINKS, "skin", ARM_LEFT, side=(0.0, 1.0, 0.0), cap=0.05,
    ),
    Tube(
        "sleeve.L",
        [(0.120, 0.0, 1.420), (0.170, 0.001, 1.395), (0.235, 0.003, 1.330), (0.285, 0.005, 1.280)],
        [(0.0, 0.060, 0.058), (0.35, 0.062, 0.061), (0.8, 0.053, 0.054), (1.0, 0.050, 0.051)],
        (Link("upper_arm.L"),), "leotard", ARM_LEFT, side=(0.0, 1.0, 0.0), cap=0.08,
    ),
    Tube(
        "palm.L",
        [(0.538, 0.0, 1.027), (0.580, 0.0, 0.985), (0.622, 0.0, 0.943)],
        [(0.0, 0.026, 0.020), (0.45, 0.036, 0.016), (0.8, 0.040, 0.013), (1.0, 0.037, 0.011)],
        (Link("forearm.L"), Link("hand.L", 0.12, 0.10)), "skin", ARM_LEFT, side=(0.0, 1.0, 0.0), cap=0.14,
    ),
    Tube(
        "leg.L",
        [(0.080, 0.006, 0.965), (0.090, 0.004, 0.80), (0.090, -0.008, 0.64), KNEE, (0.092, 0.010, 0.36),
         (0.092, 0.014, 0.22), (0.092, 0.012, 0.055)],
        [
            (0.0, 0.074, 0.084), (0.12, 0.080, 0.092), (0.28, 0.073, 0.080), (0.44, 0.055, 0.058),
            (0.51, 0.050, 0.054), (0.58, 0.047, 0.052), (0.68, 0.052, 0.056), (0.80, 0.041, 0.044),
            (0.92, 0.030, 0.034), (1.0, 0.030, 0.034),
        ],
        (Link("thigh.L"), Link("shin.L", 0.511, 0.06), Link("foot.L", 0.965, 0.03)),
        "tights", LEG_LEFT, cap=0.05,
    ),
    Tube(
        "foot.L",
        [(0.092, 0.052, 0.046), (0.092, 0.010, 0.050), (0.093, -0.060, 0.034), (0.092, -0.120, 0.022), TOES],
        [(0.0, 0.028, 0.036), (0.25, 0.032, 0.050), (0.55, 0.036, 0.030), (0.8, 0.037, 0.020), (1.0, 0.024, 0.014)],
        (Link("foot.L"),), "shoes", LEG_LEFT, cap=0.12,
    ),
)  # fmt: skip


def _finger(index: int) -> Tube:
    """Finger 0 to 3 from the index to the little one; they spread and curl slightly."""
    along = np.array([0.7071, 0.0, -0.7071])
    out = np.array([0.7071, 0.0, 0.7071])
    spread = (-0.026, -0.009, 0.009, 0.025)[index]
    length = (0.070, 0.077, 0.071, 0.056)[index]
    root = np.array([0.606, spread, 0.959])
    tip_spread = np.array([0.0, 0.35 * spread, 0.0])
    path = [root, root + along * 0.5 * length + 0.5 * tip_spread, root + along * (length + 0.012) + tip_spread]
    path[2] = path[2] - 0.010 * out
    radii = [(0.0, 0.0085, 0.0085), (0.5, 0.0080, 0.0080), (1.0, 0.0062, 0.0062)]
    return Tube(f"finger_{index}.L", [_vector(point) for point in path], radii, (Link("hand.L"),),
                "skin", ARM_LEFT, side=(0.0, 1.0, 0.0), cap=0.10)  # fmt: skip


THUMB = Tube(
    "thumb.L", [(0.556, -0.020, 1.004), (0.580, -0.048, 0.975), (0.606, -0.062, 0.944)],
    [(0.0, 0.012, 0.012), (0.5, 0.0105, 0.0105), (1.0, 0.0075, 0.0075)],
    (Link("hand.L"),), "skin", ARM_LEFT, side=(0.0, 1.0, 0.0), cap=0.12,
)  # fmt: skip

# Corners around and rings along each tube of the visible figure; fingers and the thumb as "finger".
FINE = {
    "torso": (20, 13), "neck": (12, 4), "head": (18, 11), "nose": (6, 4), "eye.L": (6, 3), "hair": (18, 9),
    "bun": (10, 7), "arm.L": (11, 13), "sleeve.L": (12, 6), "palm.L": (10, 5), "finger": (5, 4), "leg.L": (14, 15),
    "foot.L": (12, 8),
}  # fmt: skip
# The same of the light mesh; what is missing has no lights of its own.
COARSE = {"torso": (6, 4), "head": (5, 2), "arm.L": (5, 4), "leg.L": (5, 4), "foot.L": (4, 2)}


def skirt(columns: int, rows: int, pleat_depth: float = PLEAT_DEPTH, inset: float = 0.0) -> Part:
    """The skirt as an open sheet that looks outwards, moved inwards by inset (m); pleats deepen towards the hem."""
    down, azimuth = (
        grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, rows + 1), np.arange(columns) / columns, indexing="ij")
    )
    azimuth = 2.0 * math.pi * azimuth
    vertices = skirt_point(azimuth, down)
    pleats = 1.0 + pleat_depth * down * np.cos(PLEATS * azimuth)
    vertices[:, :2] *= (pleats - inset / np.linalg.norm(vertices[:, :2], axis=1))[:, None]
    # Rows run downwards, so the ring of a lathe is turned inside out.
    faces = [face[::-1] for face in grid_faces(columns, rows, closed=True)]
    return Part("skirt", shape(vertices, faces, smooth=True), _skirt_weights(azimuth, down), "skirt", SKIRT)


def _skirt_weights(azimuth: Points, down: Points) -> Points:
    """The two nearest chains share each vertex; along them hips, upper and lower bones hand over."""
    columns = {bone.name: index for index, bone in enumerate(SKELETON)}
    weights = np.zeros((len(down), len(SKELETON)))
    turn = azimuth / (2.0 * math.pi) * SKIRT_CHAINS
    held = 1.0 - smoothstep(down / 0.12)
    lower = smoothstep((down - SKIRT_KNEE) / 0.3 + 0.5)
    weights[:, columns["hips"]] = held
    for side in (0, 1):
        chain = (np.floor(turn).astype(int) + side) % SKIRT_CHAINS
        share = (turn - np.floor(turn)) if side else 1.0 - (turn - np.floor(turn))
        for name, part in (("upper", 1.0 - lower), ("lower", lower)):
            bones = np.array([columns[f"skirt_{name}_{index:02d}"] for index in chain])
            weights[np.arange(len(down)), bones] += (1.0 - held) * share * part
    return weights


def body_parts(resolution: dict[str, tuple[int, int]], inset: float = 0.0) -> list[Part]:
    """All parts but the skirt, with corners and rings by name; tubes whose name is missing are left out."""
    parts = [tube_part(t, SKELETON, *resolution[t.name], inset) for t in TRUNK_TUBES if t.name in resolution]
    left = [tube_part(t, SKELETON, *resolution[t.name], inset) for t in SIDE_TUBES if t.name in resolution]
    if "finger" in resolution:
        left += [tube_part(t, SKELETON, *resolution["finger"]) for t in (*map(_finger, range(4)), THUMB)]
    right_tag = {ARM_LEFT: ARM_RIGHT, LEG_LEFT: LEG_RIGHT}
    return [*parts, *left, *(mirrored(part, SKELETON, right_tag.get(part.tag, part.tag)) for part in left)]
