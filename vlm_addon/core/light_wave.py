# SPDX-License-Identifier: GPL-3.0-or-later
"""The wave of virtual point lights that a lamp sends out (seed 000), in units of light.

The seed's lamp brings the same light to every facing surface, however far, and each virtual light is as bright. A real
lamp's light falls with the square of the distance. Its wave therefore carries, in each direction, the lamp's intensity
over the mean square of the distance to the end of the scene: an unchanging irradiance of the same power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .lamps import spot_attenuation
from .scene import AREA, POINT, SPOT, SUN, Float64, Light
from .stacked_hemispheres import hemisphere_rays, shell_attenuations, shell_distances

Int64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

SPREAD_LIGHTS = 5
"""Lights of the innermost shell whose maps are integrated between (seed 000, 3.3)."""
_EVEN_DIRECTIONS = 1024
_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
# Of the bounds' diagonal: a lamp on a wall is inside.
_BOUNDS_MARGIN = 1e-6
# Of the generator that picks lights by chance: the same picture every time.
_SEED = 0
# Places nearer to the rim are not worth leaving the meridian for.
_OFF_MERIDIAN = 4.0


@dataclass(frozen=True)
class WaveSettings:
    """angle_degrees: between rays. shells: lights on a ray. reach: farthest distance of a light, share of the mean
    distance to the end of the scene. active_share: of the lights, switched on by chance."""

    angle_degrees: float
    shells: int
    reach: float
    active_share: float


@dataclass(frozen=True)
class Wave:
    """Virtual point lights of one hemisphere around a lamp, shell by shell from within, each in the order of its rays.

    positions, normals: (n, 3) float64, m in world space and unit. irradiance: (n, 3) W/m², what a light adds to a
    surface that faces it and that it faces; attenuation and the division by the count are in it (seed 000, eq. 4.5).
    specular_irradiance: (n, 3) W/m², the same without attenuation, as the specular term has none there. shells: (n,)
    from 0. inside: (n,) whether a light lies within the bounds of what shows. frame: (3, 3) unit rows, the last one the
    hemisphere's axis. max_distance: m, of eq. 4.1.
    """

    positions: Float64
    normals: Float64
    irradiance: Float64
    specular_irradiance: Float64
    shells: Int64
    inside: Bools
    frame: Float64
    max_distance: float

    def __len__(self) -> int:
        return len(self.positions)


def lamp_waves(light: Light, low: Float64, high: Float64, settings: WaveSettings) -> tuple[Wave, ...]:
    """The hemispheres of `light`: about the direction it shines in; for a POINT also one about the opposite direction.

    low, high: (3,) bounds of what shows, m in world space. A SUN's wave starts at the end of the bounds that is nearest
    to it. Rays that do not meet the bounds carry no light.
    """
    shining = -np.array(light.z_axis)
    axes = (shining, -shining) if light.kind == POINT else (shining,)
    return tuple(_hemisphere(light, axis, low, high, settings) for axis in axes)


def _hemisphere(light: Light, axis: Float64, low: Float64, high: Float64, settings: WaveSettings) -> Wave:
    origin = _origin(light, low, high)
    frame = np.array([light.x_axis, light.y_axis, axis])
    mean_distance = mean_end_distance(origin, frame, low, high)
    max_distance = settings.reach * mean_distance
    rays = hemisphere_rays(settings.angle_degrees) @ frame
    carried = _carried_irradiance(light, rays, mean_distance)
    carried = np.where((end_distances(origin, rays, low, high) > 0.0)[:, None], carried, 0.0)
    distances = shell_distances(settings.shells, max_distance)
    kept = np.repeat(1.0 - shell_attenuations(settings.shells), len(rays))
    positions = origin + (distances[:, None, None] * rays).reshape(-1, 3)
    active = _switched_on(len(positions), settings.active_share)
    facing = np.tile(carried, (settings.shells, 1))[active] / len(active)
    margin = _margin(low, high)
    inside = ((positions >= low - margin) & (positions <= high + margin)).all(axis=1)
    return Wave(
        positions=positions[active],
        normals=np.tile(rays, (settings.shells, 1))[active],
        irradiance=facing * kept[active, None],
        specular_irradiance=facing,
        shells=np.repeat(np.arange(settings.shells), len(rays))[active],
        inside=inside[active],
        frame=frame,
        max_distance=max_distance,
    )


def _origin(light: Light, low: Float64, high: Float64) -> Float64:
    if light.kind != SUN:
        return np.array(light.position, np.float64)
    towards = np.array(light.z_axis)
    return 0.5 * (low + high) + 0.5 * float(np.abs(towards) @ (high - low)) * towards


def _carried_irradiance(light: Light, rays: Float64, distance: float) -> Float64:
    """(r, 3) W/m² that the lamp's wave carries along `rays`: 0 where it does not reach the scene at all."""
    power = np.array(light.power, np.float64)
    if light.kind == SUN:
        return np.tile(power, (len(rays), 1))
    if light.kind == AREA:
        share = np.maximum(rays @ -np.array(light.z_axis), 0.0) / math.pi
    else:
        share = np.full(len(rays), 0.25 / math.pi)
        if light.kind == SPOT:
            share = share * spot_attenuation(light, rays)
    square = distance * distance
    return share[:, None] * power / square if square > 0.0 else np.zeros((len(rays), 3))


def _switched_on(count: int, share: float) -> Int64:
    """Indices of the lights that are on, in order: picked by chance, a smaller share a part of a larger one's."""
    chosen = max(1, round(share * count))
    return np.sort(np.random.default_rng(_SEED).permutation(count)[:chosen])


def mean_end_distance(origin: Float64, frame: Float64, low: Float64, high: Float64) -> float:
    """Root mean square of the distances, m, at which rays of a hemisphere leave the bounds, over those that meet them.

    frame: (3, 3) unit rows, the last one the hemisphere's axis. 0 if no ray meets them.
    """
    index = np.arange(_EVEN_DIRECTIONS) + 0.5
    z = index / _EVEN_DIRECTIONS
    ring, azimuth = np.sqrt(1.0 - z * z), _GOLDEN_ANGLE * index
    even = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=-1)
    ends = end_distances(origin, even @ frame, low, high)
    met = ends > 0.0
    return float(np.sqrt(np.mean(ends[met] ** 2))) if met.any() else 0.0


def end_distances(origin: Float64, rays: Float64, low: Float64, high: Float64) -> Float64:
    """(r,) m along unit `rays` from `origin` to where they leave the bounds; 0 for those that do not meet them."""
    margin = _margin(low, high)
    with np.errstate(divide="ignore", invalid="ignore"):
        to_low, to_high = (low - margin - origin) / rays, (high + margin - origin) / rays
    # A ray along a slab is inside of it all the way or never.
    within = (origin >= low - margin) & (origin <= high + margin)
    along = rays == 0.0
    enter = np.where(along, np.where(within, -np.inf, np.inf), np.minimum(to_low, to_high)).max(axis=1)
    leave = np.where(along, np.where(within, np.inf, -np.inf), np.maximum(to_low, to_high)).min(axis=1)
    return np.where(leave >= np.maximum(enter, 0.0), np.maximum(leave, 0.0), 0.0)


def _margin(low: Float64, high: Float64) -> float:
    return _BOUNDS_MARGIN * float(np.linalg.norm(high - low))


def sampled_lights(wave: Wave, count: int) -> Int64:
    """Indices of `count` lights picked by chance, those whose shadows are drawn (seed 000, 3.3), all if there are
    fewer; fewer of them are a part of more.

    Among those inside the bounds: from beyond its outer walls a room is all shadow. Among all if none is inside.
    """
    lit = wave.irradiance.max(axis=1, initial=0.0) > 0.0
    among = np.flatnonzero(wave.inside & lit)
    if not len(among):
        among = np.arange(len(wave))
    return np.sort(np.random.default_rng(_SEED).permutation(among)[:count])


def spread_lights(wave: Wave) -> Int64:
    """Indices of SPREAD_LIGHTS lights of the innermost shell: nearest to the axis, and to four places a quarter turn
    apart from each other and from it (seed 000, 3.3: equidistant).

    Along each of the four meridians the place moves towards the axis until it lies inside the bounds. The same light
    may stand for several of them.
    """
    candidates = np.flatnonzero(wave.shells == wave.shells.min())
    if wave.inside[candidates].any():
        candidates = candidates[wave.inside[candidates]]
    across, up, ahead = (wave.normals[candidates] @ wave.frame.T).T
    scores = [ahead]
    for side, away in ((across, up), (-across, up), (up, across), (-up, across)):
        scores.append(side - _OFF_MERIDIAN * np.abs(away))
    # Rounded, so that of lights that are alike the first one is taken.
    return candidates[[int(np.argmax(np.round(score, 9))) for score in scores]]


def sampled_frames(wave: Wave, lights: Int64) -> Float64:
    """(m, 3, 3) unit rows for each of `lights`: the wave's frame, turned the shortest way until its axis is the normal.

    Where maps of single lights look.
    """
    axis, normals = wave.frame[2], wave.normals[lights]
    share = (normals @ wave.frame[:2].T) / (1.0 + normals @ axis)[:, None]
    across, up = (wave.frame[row] - share[:, row, None] * (axis + normals) for row in range(2))
    return np.stack([across, up, normals], axis=1)


def spread_frames(wave: Wave, lights: Int64) -> Float64:
    """(m, 3, 3): the wave's own frame for each of `lights`.

    Where maps that are integrated between look. Seed 000 leaves it open; only between maps that look the same way is
    a coordinate in between that of a light in between.
    """
    return np.tile(wave.frame, (len(lights), 1, 1))
