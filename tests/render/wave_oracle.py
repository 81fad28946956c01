# SPDX-License-Identifier: GPL-3.0-or-later
"""What LightWave is to give, in numpy: sums over lights, and shadows by rays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from vlm_addon.core.light_wave import Wave, WaveSettings, lamp_waves
from vlm_addon.core.scene import Float64, Mesh, SceneSnapshot
from vlm_addon.core.stacked_hemispheres import emission_share


def waves_of(snapshot: SceneSnapshot, angle: float, shells: int = 5, reach: float = 1.0) -> list[Wave]:
    settings = WaveSettings(angle, shells, reach, 1.0)
    return [wave for light in snapshot.lights for wave in lamp_waves(light, *snapshot.bounds(), settings)]


def unshadowed(waves: Sequence[Wave], points: Float64, normals: Float64) -> Float64:
    """(p, 3) W/m² at `points` with unit `normals`: seed 000, eq. 4.5 without its specular term."""
    total = np.zeros((len(points), 3))
    for wave in waves:
        towards = wave.positions[None] - points[:, None]
        towards /= np.maximum(np.linalg.norm(towards, axis=2, keepdims=True), 1e-12)
        received = np.maximum(np.einsum("pnk,pk->pn", towards, normals), 0.0)
        sent = emission_share(-np.einsum("pnk,nk->pn", towards, wave.normals))
        total += (received * sent) @ wave.irradiance
    return total


def occluded(meshes: Sequence[Mesh], points: Float64, light: Float64) -> npt.NDArray[np.bool_]:
    """(p,) whether a triangle stands between each point and the light, not counting the ends (Möller and Trumbore)."""
    corners = np.concatenate([mesh.positions[mesh.triangles] for mesh in meshes])
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    hit = np.zeros(len(points), bool)
    rays = light - points
    for origin, edge_u, edge_v in zip(a, u, v, strict=True):
        across = np.cross(rays, edge_v)
        determinant = across @ edge_u
        with np.errstate(divide="ignore", invalid="ignore"):
            offset = points - origin
            s = np.einsum("pk,pk->p", across, offset) / determinant
            turned = np.cross(offset, edge_u)
            t = np.einsum("pk,pk->p", turned, rays) / determinant
            along = turned @ edge_v / determinant
            hit |= (determinant != 0.0) & (s >= 0) & (t >= 0) & (s + t <= 1) & (along > 1e-6) & (along < 1.0 - 1e-6)
    return hit
