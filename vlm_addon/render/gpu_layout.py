# SPDX-License-Identifier: GPL-3.0-or-later
"""Structs shared by numpy and GLSL: the layout is stated once, the dtype and the GLSL text both follow from it.

A shader gets a struct with `#include "gpu_layout/Name"`; Python fills an array of `STRUCT.dtype` and uploads its
bytes. Offsets follow std430 (OpenGL 4.6 core, 7.6.2.2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..core.brdf import MAX_F0
from ..core.brick_triangles import ALL_EXACT, EDGE_SHARE, LIFT_SHARE
from ..core.lamps import NARROW_CONE
from ..core.light_clusters import FADE, SOFTNESS
from ..core.octree_march import FAR_OUTSIDE, SLACK
from ..core.stacked_hemispheres import LEAST_COSINE

# GLSL type: (numpy scalar, components, alignment in bytes)
_STD430: Mapping[str, tuple[str, int, int]] = {
    "float": ("<f4", 1, 4),
    "int": ("<i4", 1, 4),
    "uint": ("<u4", 1, 4),
    "vec2": ("<f4", 2, 8),
    "vec3": ("<f4", 3, 16),
    "vec4": ("<f4", 4, 16),
    "ivec2": ("<i4", 2, 8),
    "ivec4": ("<i4", 4, 16),
    "uvec4": ("<u4", 4, 16),
    "mat4": ("<f4", 16, 16),
}


@dataclass(frozen=True)
class GpuStruct:
    """A GLSL struct. fields: (GLSL type, name) in order; `mat4` is a (16,) float32 column-major block."""

    name: str
    fields: tuple[tuple[str, str], ...]

    @property
    def dtype(self) -> np.dtype:
        """Structured dtype with the std430 offsets, itemsize rounded up to the largest alignment."""
        formats: list[object] = []
        offsets: list[int] = []
        end, largest = 0, 4
        for glsl_type, _ in self.fields:
            scalar, components, alignment = _STD430[glsl_type]
            offset = _round_up(end, alignment)
            formats.append(scalar if components == 1 else (scalar, (components,)))
            offsets.append(offset)
            end = offset + 4 * components
            largest = max(largest, alignment)
        names = [name for _, name in self.fields]
        itemsize = _round_up(end, largest)
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": itemsize})

    @property
    def glsl(self) -> str:
        """The struct as GLSL text."""
        lines = [f"    {glsl_type} {name};" for glsl_type, name in self.fields]
        return "\n".join([f"struct {self.name} {{", *lines, "};", ""])

    def zeros(self, count: int) -> np.ndarray:
        """(count,) zeros of `dtype`, ready to be filled and uploaded."""
        return np.zeros(count, self.dtype)


def _round_up(value: int, multiple: int) -> int:
    return (value + multiple - 1) // multiple * multiple


def matrix_block(matrix: np.ndarray) -> np.ndarray:
    """(16,) float32, column-major as GLSL reads a mat4, of a (4, 4) matrix that maps column vectors."""
    return np.asarray(matrix, np.float64).T.reshape(16).astype(np.float32)


VIRTUAL_LIGHT = GpuStruct(
    "VirtualLight",
    (
        ("vec3", "v0"),
        ("int", "tag_id"),
        ("vec3", "v1"),
        ("float", "strength"),
        ("vec3", "v2"),
        ("float", "bounding_radius"),
        ("vec3", "area_vector"),
        ("float", "area"),
    ),
)
"""One triangle of the light mesh: corners in metres from the local origin, vector area in m²."""

TRIANGLE = GpuStruct(
    "Triangle",
    (
        ("vec3", "geometric_normal"),
        ("int", "material"),
        ("int", "tag_id"),
        ("int", "face_id"),
        ("float", "plane_offset"),
        ("float", "reach"),
    ),
)
"""What is constant over one visible triangle; face_id counts the triangles of the snapshot in order. plane_offset:
distance of its plane from the local origin along the normal; reach: of its farthest corner from there."""

MATERIAL = GpuStruct(
    "Material",
    (
        ("vec3", "base_color"),
        ("float", "alpha"),
        ("vec3", "emission"),
        ("float", "roughness"),
        ("float", "metallic"),
        ("float", "specular_ior_level"),
        ("float", "ior"),
        ("float", "normal_strength"),
        ("uint", "flags"),
        ("int", "alpha_channel"),
        ("int", "roughness_channel"),
        ("int", "metallic_channel"),
    ),
)
"""core.scene.Material; flags: the MATERIAL_* bits of CONSTANTS."""

LAMP = GpuStruct(
    "Lamp",
    (
        ("vec3", "position"),
        ("int", "kind"),
        ("vec3", "sample_position"),
        ("float", "radius"),
        ("vec3", "intensity"),
        ("float", "falloff_radius_squared"),
        ("vec3", "x_axis"),
        ("float", "spot_cos_half"),
        ("vec3", "y_axis"),
        ("float", "spot_sharpness"),
        ("vec3", "z_axis"),
        ("int", "corner_count"),
        ("vec2", "spot_scale"),
        ("float", "cell_area"),
        ("float", "cell_radius"),
        ("vec4", "corners_01"),
        ("vec4", "corners_23"),
        ("vec4", "corners_45"),
        ("vec4", "corners_67"),
        ("vec2", "shadow_extent"),
        ("vec2", "shadow_centre"),
        ("vec3", "shadow_origin"),
        ("float", "shadow_near"),
        ("vec2", "cell_centre"),
        ("int", "shadow_kind"),
        ("float", "sample_weight"),
        ("float", "shadow_rounding"),
        ("float", "world_solid_angle"),
        ("vec3", "shadow_origin_rest"),
        ("float", "shadow_scale"),
    ),
)
"""One sample of a lamp and the frame of its shadow map; filled by render/lamp_records.py, read by lib/lights.glsl.

position: m from the local origin, for LAMP_SUN the unit vector towards it; sample_position likewise, where the shadows
come from. radius: m, for LAMP_SUN the sine of half its angle. intensity: W/sr; LAMP_SUN irradiance, LAMP_AREA
radiosity of its cell over the cell's share, W/m². corners: pairs of (x, y) on an area lamp, m from `position`, counter-
clockwise seen from its shining side. shadow_extent: tangent of half the field of view, for SHADOW_PARALLEL half the
size in m. shadow_origin: where the map's coordinates and depths start; shadow_centre: of a parallel map, m from there.
shadow_near: m, nearest distance in a perspective map. shadow_rounding: m, what float32 leaves of a surface's place.
world_solid_angle: sr, of the part of the world that a LAMP_SUN without radius stands for; 0 for a lamp.
shadow_scale: units of the space that a kept map is drawn in for each of this one, 1 where both are the same; the map's
lengths are in its own. shadow_origin_rest: what float32 has no digits for in shadow_origin.
"""

SOURCE_SAMPLE = GpuStruct(
    "SourceSample", (("vec3", "position"), ("float", "weight"), ("vec3", "normal"), ("int", "window"))
)
"""A point on the visible surface where phase one measures irradiance; position in m from the local origin; window: of
a sun's shadow map that shows it best."""

HALF_BALL = GpuStruct(
    "HalfBall",
    (("vec3", "centre"), ("float", "radius_squared"), ("vec3", "normal"), ("vec3", "inverse_normal")),
)
"""One of core.active_hemisphere.HalfBalls, in the grid's frame."""

POINT_GROUP = GpuStruct(
    "PointGroup",
    (
        ("vec3", "centre"),
        ("vec3", "half_extent"),
        ("vec3", "axis"),
        ("float", "lowest"),
        ("float", "highest"),
        ("float", "cos_spread"),
    ),
)
"""Bounds of a group of surface points, in metres from the local origin. centre, half_extent: of the box around them.
axis: unit, amid the normals; lowest, highest: least and greatest dot(axis, point). cos_spread: of the largest angle
between a normal and the axis."""

LIGHT_NODE = GpuStruct(
    "LightNode",
    (
        ("vec3", "centre"),
        ("float", "window"),
        ("vec3", "axis"),
        ("float", "plane"),
        ("vec3", "middle"),
        ("float", "cone_cos"),
        ("vec3", "half_extent"),
        ("float", "cone_sin"),
        ("uint", "first_child"),
        ("uint", "end_child"),
        ("uint", "first_light"),
        ("uint", "end_light"),
    ),
)
"""A cluster of core.light_tree.LightTree in metres from the local origin. centre: its centroid. middle, half_extent: of
its box. Its clusters are nodes first_child to end_child, its lights those at first_light to end_light in the forest's
order."""

LIGHT_CLUSTER = GpuStruct(
    "LightCluster",
    (
        ("vec3", "mean"),
        ("int", "tag_id"),
        ("vec3", "first_axis"),
        ("float", "parent_window"),
        ("vec3", "second_axis"),
        ("float", "least_squared"),
        ("vec3", "normal"),
        ("vec3", "variances"),
        ("vec3", "covariances"),
        ("vec3", "power"),
        ("vec3", "parent_centre"),
    ),
)
"""What a cluster sends out: core.light_clusters.LightClusters. first_axis, second_axis: from the mean to two of its
four points. normal: flux over power. variances (xx, yy, zz), covariances (xy, yz, xz): of normals. power: rgb, W."""

VIRTUAL_POINT_LIGHT = GpuStruct(
    "VirtualPointLight",
    (("vec3", "position"), ("float", "area"), ("vec3", "normal"), ("vec3", "flux"), ("vec3", "geometric_normal")),
)
"""core.vpl.VirtualPointLights, in metres from the local origin and watts; area of the piece of surface, m².
geometric_normal: unit, of the triangle that the light lies on, where rays to it end; 0 where none is known."""

LIGHT_POINT = GpuStruct("LightPoint", (("vec3", "position"), ("float", "weight"), ("vec3", "normal"), ("int", "light")))
"""A source sample of the virtual light `light`, m from the local origin: where its visibility is asked for."""

STRUCTS: dict[str, GpuStruct] = {
    struct.name: struct
    for struct in (
        VIRTUAL_LIGHT,
        TRIANGLE,
        MATERIAL,
        LAMP,
        SOURCE_SAMPLE,
        HALF_BALL,
        POINT_GROUP,
        LIGHT_NODE,
        LIGHT_CLUSTER,
        VIRTUAL_POINT_LIGHT,
        LIGHT_POINT,
    )
}
"""What `#include "gpu_layout/Name"` finds."""

CONSTANTS: dict[str, int | float] = {
    # storage buffer bindings
    "TRIANGLE_BINDING": 0,
    "MATERIAL_BINDING": 1,
    "VIRTUAL_LIGHT_BINDING": 2,
    "RADIOSITY_BINDING": 3,
    "LAMP_BINDING": 4,
    "SOURCE_SAMPLE_BINDING": 5,
    "RESULT_BINDING": 6,
    "SOURCE_LIGHT_BINDING": 7,
    # texture units of a material
    "BASE_COLOR_UNIT": 0,
    "ALPHA_UNIT": 1,
    "ROUGHNESS_UNIT": 2,
    "METALLIC_UNIT": 3,
    "EMISSION_UNIT": 4,
    "NORMAL_UNIT": 5,
    # texture units of the G-buffer
    "GBUFFER_POSITION_UNIT": 0,
    "GBUFFER_SHADING_NORMAL_UNIT": 1,
    "GBUFFER_GEOMETRIC_NORMAL_UNIT": 2,
    "GBUFFER_BASE_COLOR_UNIT": 3,
    "GBUFFER_EMISSION_UNIT": 4,
    "GBUFFER_IDS_UNIT": 5,
    "FIRST_FREE_UNIT": 6,
    # texture units of the passes that light surfaces
    "SHADOW_MAP_UNIT": 8,
    "ALBEDO_TABLE_UNIT": 9,
    # bits of Material.flags; a texture's bit is 1 << its unit
    "MATERIAL_PRINCIPLED": 1 << 8,
    "MATERIAL_CORNER_COLOR": 1 << 9,
    # models in the G-buffer's id image
    "MODEL_DIFFUSE": 0,
    "MODEL_PRINCIPLED": 1,
    # Lamp.kind and Lamp.shadow_kind
    "LAMP_POINT": 0,
    "LAMP_SPOT": 1,
    "LAMP_SUN": 2,
    "LAMP_AREA": 3,
    "SHADOW_NONE": 0,
    "SHADOW_CUBE": 1,
    "SHADOW_CONE": 2,
    "SHADOW_PARALLEL": 3,
    # tiles of the map of a cube: +x -x +y / -y +z -z
    "SHADOW_CUBE_COLUMNS": 3,
    "SHADOW_CUBE_ROWS": 2,
    # bounds and widths of formulas that core states
    "MAX_F0": MAX_F0,
    "NARROW_CONE": NARROW_CONE,
    "CLUSTER_FADE": FADE,
    "CLUSTER_SOFTNESS": SOFTNESS,
    "LEAST_COSINE": LEAST_COSINE,
    "OCTREE_FAR": FAR_OUTSIDE,
    "OCTREE_SLACK": SLACK,
    "OCTREE_EDGE_SHARE": EDGE_SHARE,
    "OCTREE_LIFT_SHARE": LIFT_SHARE,
    "OCTREE_ALL_EXACT": ALL_EXACT,
}
"""Numbers that Python and GLSL share; every shader sees them as `#define`s."""
