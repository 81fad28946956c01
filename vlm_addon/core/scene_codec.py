# SPDX-License-Identifier: GPL-3.0-or-later
"""SceneSnapshot and VirtualLightMesh from the trees that array_codec makes of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .light_mesh import SourceSamples, VirtualLightMesh
from .scene import Camera, Environment, Finding, Light, Material, Mesh, SceneSnapshot, Texture


def _tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: tuple(item) if isinstance(item, list) else item for key, item in values.items()}


def snapshot_from_tree(tree: Mapping[str, Any]) -> SceneSnapshot:
    """The snapshot whose `flatten` and `unflatten` gave `tree`."""
    return SceneSnapshot(
        name=tree["name"],
        meshes=tuple(Mesh(**item) for item in tree["meshes"]),
        materials=tuple(Material(**_tuples(item)) for item in tree["materials"]),
        textures=tuple(Texture(**item) for item in tree["textures"]),
        lights=tuple(Light(**_tuples(item)) for item in tree["lights"]),
        camera=Camera(**_tuples(tree["camera"])) if tree["camera"] is not None else None,
        world_radiance=tuple(tree["world_radiance"]),
        frame=tree["frame"],
        findings=tuple(Finding(**item) for item in tree["findings"]),
        environment=Environment(**tree["environment"]) if tree["environment"] is not None else None,
    )


def light_mesh_from_tree(tree: Mapping[str, Any]) -> VirtualLightMesh:
    """The light mesh whose `flatten` and `unflatten` gave `tree`."""
    return VirtualLightMesh(**{**tree, "samples": SourceSamples(**tree["samples"])})
