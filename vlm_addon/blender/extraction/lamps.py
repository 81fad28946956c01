# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's lamps and cameras as the snapshot describes them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...core.scene import (
    AREA,
    ELLIPSE,
    ORTHOGRAPHIC,
    PERSPECTIVE,
    POINT,
    RECTANGLE,
    SPOT,
    SUN,
    Camera,
    Float32,
    Float64,
    Light,
)
from .color_space import into_rec709
from .materials import FindingList
from .node_graph import node_label, source
from .node_values import NodeEvaluator

FULL_SPREAD = math.pi
FACTORS = ("diffuse_factor", "specular_factor", "transmission_factor", "volume_factor")
RAY_VISIBILITY = ("visible_diffuse", "visible_glossy")
Vector = tuple[float, float, float]


def _vector(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def read_light(
    lamp_object: Any, matrix: Float64, name: str, evaluator: NodeEvaluator, to_rec709: Float64, report: FindingList
) -> Light | None:
    """The light of an evaluated lamp object at `matrix` ((4, 4) float64); None for a portal, which sends no light."""
    lamp = lamp_object.data
    owner = f"light {name!r}"
    if getattr(lamp.cycles, "is_portal", False) and lamp.type == AREA:
        report(owner, "light portals are not simulated", "it is left out")
        return None
    _report_unsupported(lamp_object, lamp, owner, report)
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = matrix[:3, :3] / np.where(scale > 0.0, scale, 1.0)
    size_x, size_y, shape = _area_size(lamp, scale)
    radius = 0.0 if lamp.type in (SUN, AREA) else lamp.shadow_soft_size
    color = _color(lamp, evaluator, to_rec709, owner)
    power = color * lamp.energy * 2.0 ** getattr(lamp, "exposure", 0.0) * _normalization(lamp, radius, size_x, size_y)
    if min(power) < 0.0:
        report(owner, f"sends out negative light ({_vector(power)})", "what is negative of it counts as 0")
        power = np.maximum(power, 0.0)
    spot_scale = (1.0, 1.0)
    if lamp.type == SPOT and scale[2] > 0.0:
        spot_scale = (float(scale[0] / scale[2]), float(scale[1] / scale[2]))
    return Light(
        name=name,
        kind=lamp.type,
        power=_vector(power),
        position=_vector(matrix[:3, 3]),
        x_axis=_vector(axes[:, 0]),
        y_axis=_vector(axes[:, 1]),
        z_axis=_vector(axes[:, 2]),
        radius=radius,
        angle=lamp.angle if lamp.type == SUN else 0.0,
        spot_angle=lamp.spot_size if lamp.type == SPOT else math.pi / 4,
        spot_blend=lamp.spot_blend if lamp.type == SPOT else 0.0,
        spot_scale=spot_scale,
        shape=shape,
        size_x=size_x,
        size_y=size_y,
        casts_shadow=lamp.use_shadow,
        soft_falloff=getattr(lamp, "use_soft_falloff", True),
    )


def _area_size(lamp: Any, scale: Float64) -> tuple[float, float, str]:
    """Extents in m, times the object's scale as Cycles does, and the shape."""
    if lamp.type != AREA:
        return 1.0, 1.0, RECTANGLE
    height = lamp.size_y if lamp.shape in ("RECTANGLE", "ELLIPSE") else lamp.size
    shape = ELLIPSE if lamp.shape in ("DISK", "ELLIPSE") else RECTANGLE
    return float(lamp.size * scale[0]), float(height * scale[1]), shape


def _normalization(lamp: Any, radius: float, size_x: float, size_y: float) -> float:
    """Factor from the strength of a lamp whose power is not normalised (4.5 and later) to the power it sends out."""
    if getattr(lamp, "normalize", True):
        return 1.0
    if lamp.type in (POINT, SPOT):
        return 4.0 * math.pi * radius * radius if radius > 0.0 else 1.0
    if lamp.type == SUN:
        return math.pi * math.sin(0.5 * lamp.angle) ** 2 if lamp.angle > 0.0 else 1.0
    area = size_x * size_y
    return area * math.pi / 4.0 if lamp.shape in ("DISK", "ELLIPSE") else area


def _color(lamp: Any, evaluator: NodeEvaluator, to_rec709: Float64, owner: str) -> Float32:
    """Colour of a lamp, its temperature and its emission node included."""
    color = np.array(lamp.color, np.float32)
    if getattr(lamp, "use_temperature", False):
        color *= np.array(lamp.temperature_color, np.float32)
    color = into_rec709(color, to_rec709)
    if lamp.node_tree is None or not getattr(lamp, "use_nodes", True):
        return color
    output = lamp.node_tree.get_output_node("CYCLES")
    found = None if output is None else source(output.inputs["Surface"])
    if found is None or found.is_constant:
        return color
    report = evaluator.report
    if found.node.type != "EMISSION":
        label = node_label(owner, found.node)
        report(label, f"{found.node.bl_label} is not simulated", "the lamp's own color is used")
        return color
    values = [evaluator.color(found.input("Color"), owner), evaluator.number(found.input("Strength"), owner)]
    if any(value.is_textured for value in values):
        report(node_label(owner, found.node), "a texture on a lamp is not simulated", "its mean is used")
    return color * values[0].mean[:3] * values[1].number


def _report_unsupported(lamp_object: Any, lamp: Any, owner: str, report: FindingList) -> None:
    if lamp.type == AREA and getattr(lamp, "spread", FULL_SPREAD) < FULL_SPREAD - 1e-4:
        report(owner, f"a spread of {math.degrees(lamp.spread):.0f} degrees is not simulated", "it shines to all sides")
    if any(getattr(lamp, name, 1.0) != 1.0 for name in FACTORS):
        report(owner, "its diffuse, glossy, transmission or volume factor is not simulated", "all are read as 1")
    if any(not getattr(lamp_object, name, True) for name in RAY_VISIBILITY):
        report(owner, "ray visibility is not simulated", "it lights every surface")
    linking = getattr(lamp_object, "light_linking", None)
    if linking is not None and (linking.receiver_collection or linking.blocker_collection):
        report(owner, "light linking is not simulated", "it lights every object")


def read_camera(camera_object: Any, matrix: Float64, scene: Any, report: FindingList) -> Camera | None:
    """The camera of an evaluated object; None, with a finding, for a lens that no matrix describes."""
    data = camera_object.data
    owner = f"camera {camera_object.name!r}"
    if data.type not in ("PERSP", "ORTHO"):
        report(owner, f"the lens type {data.type} is not simulated", "choose a perspective or orthographic lens")
        return None
    if data.dof.use_dof:
        report(owner, "depth of field is not simulated", "everything is sharp")
    rigid = np.eye(4)
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    rigid[:3, :3] = matrix[:3, :3] / np.where(scale > 0.0, scale, 1.0)
    rigid[:3, 3] = matrix[:3, 3]
    return Camera(
        name=camera_object.name,
        matrix_world=rigid,
        kind=PERSPECTIVE if data.type == "PERSP" else ORTHOGRAPHIC,
        lens=data.lens,
        sensor_width=data.sensor_width,
        sensor_height=data.sensor_height,
        sensor_fit=data.sensor_fit,
        ortho_scale=data.ortho_scale,
        shift_x=data.shift_x,
        shift_y=data.shift_y,
        clip_start=data.clip_start,
        clip_end=data.clip_end,
        pixel_aspect=(scene.render.pixel_aspect_x, scene.render.pixel_aspect_y),
    )
