# SPDX-License-Identifier: GPL-3.0-or-later
"""Armatures in Blender: from bones and poses to a rig that moves meshes. Same calls in 4.2 to 5.x."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
import mathutils
import numpy as np

from . import blend
from .dance import Pose
from .shapes import Points
from .skinned import Skeleton

LEAST_WEIGHT = 1e-4
MOST_BONES = 4
"""Bones that may move one vertex: what engines and glTF allow."""


def add_armature(scene: Any, name: str, skeleton: Skeleton) -> Any:
    """An armature object with these bones at rest, not connected."""
    data = bpy.data.armatures.new(name)
    armature = blend.add_object(scene, name, data)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in skeleton:
        added = data.edit_bones.new(bone.name)
        added.head, added.tail = bone.head, bone.tail
        if bone.parent:
            added.parent = data.edit_bones[bone.parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def limited(weights: Points) -> Points:
    """Weights of at most MOST_BONES bones per vertex, none below LEAST_WEIGHT, rows summing to 1."""
    least_kept = np.sort(weights, axis=1)[:, -MOST_BONES, None]
    kept = np.where((weights >= least_kept) & (weights >= LEAST_WEIGHT), weights, 0.0)
    return kept / kept.sum(axis=1, keepdims=True)


def bind(mesh_object: Any, armature: Any, skeleton: Skeleton, weights: Points) -> None:
    """Lets the armature move the mesh; weights: (v, bones)."""
    weights = limited(weights)
    for column, bone in enumerate(skeleton):
        moved = np.flatnonzero(weights[:, column])
        if not len(moved):
            continue
        group = mesh_object.vertex_groups.new(name=bone.name)
        for vertex in moved.tolist():
            group.add([vertex], float(weights[vertex, column]), "REPLACE")
    mesh_object.parent = armature
    modifier = mesh_object.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature


def set_pose(armature: Any, skeleton: Skeleton, pose: Pose) -> None:
    """Puts the armature into a pose; quaternions keep the sign of those before, so that keys interpolate shortly."""
    for bone in skeleton:
        posed = armature.pose.bones[bone.name]
        rest = posed.bone.matrix_local.to_quaternion()
        turned = mathutils.Matrix(pose.rotations.get(bone.name, np.eye(3)).tolist()).to_quaternion()
        local = rest.inverted() @ turned @ rest
        local.make_compatible(posed.rotation_quaternion)
        posed.rotation_quaternion = local
        if not bone.parent:
            posed.location = rest.inverted() @ mathutils.Vector(pose.root_offset.tolist())


def add_keys(armature: Any, skeleton: Skeleton, poses: Sequence[tuple[int, Pose]]) -> None:
    """Keys the whole pose at each of the frames."""
    for frame, pose in poses:
        set_pose(armature, skeleton, pose)
        for bone in skeleton:
            posed = armature.pose.bones[bone.name]
            posed.keyframe_insert("rotation_quaternion", frame=frame, group=bone.name)
            if not bone.parent:
                posed.keyframe_insert("location", frame=frame, group=bone.name)
