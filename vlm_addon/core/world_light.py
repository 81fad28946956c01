# SPDX-License-Identifier: GPL-3.0-or-later
"""Light from the world as directional lights.

The sphere of directions is cut into as many regions as lights are wanted, by what the world sends from there: each
cell of a coarse map joins the light whose direction is nearest, and each light moves to the middle of its cells'
light, in turns (Lloyd 1982, weighted by luminance). That makes the sum of squared distances small, which is the first
term of the error of any smooth function's integral; bright spots draw lights to themselves, and an even sky gets an
even spread.

A light's power is the integral of radiance over its region, for each channel: what all lights together send through a
point is exactly what the world does, and so is the mean irradiance over all orientations of a surface. Its angle is
that of an evenly bright cone whose light is as directed as the region's: (1 + cos(angle / 2)) / 2 = |integral of
luminance times direction| / (integral of luminance). A sun in the map becomes a light as small as the sun.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .environment import (
    map_directions,
    map_places,
    map_solid_angles,
    radiance_at,
    require_usable_environment,
    resized_map,
)
from .errors import InvalidInput
from .scene import SUN, Environment, Float64, Light, SceneSnapshot

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear Rec.709."""
GRID_HEIGHT, GRID_WIDTH = 64, 128
"""Cells that are joined to lights."""
_TURNS = 24
"""Of moving lights to the middles of their regions: later ones change the error by less than a tenth."""


@dataclass(frozen=True)
class _Region:
    """Parts of the sphere. power: (n, 3) integral of radiance, W/m². moment: (n, 3) of luminance times direction."""

    power: Float64
    moment: Float64

    @property
    def directions(self) -> Float64:
        """(n, 3) unit vectors; 0 where nothing comes from."""
        lengths = np.linalg.norm(self.moment, axis=1, keepdims=True)
        unit: Float64 = self.moment / np.where(lengths > 0.0, lengths, 1.0)
        return unit

    def joined(self, labels: npt.NDArray[np.int64], count: int) -> _Region:
        """Sums over the parts of equal label."""
        return _Region(_sums(labels, self.power, count), _sums(labels, self.moment, count))


def is_lit_by_world(snapshot: SceneSnapshot) -> bool:
    """Whether any light comes from the world; radiance that means nothing counts, for `world_lights` to refuse."""
    has_map = snapshot.environment is not None and bool(snapshot.environment.radiance.any())
    return has_map or any(value != 0.0 for value in snapshot.world_radiance)


def world_lights(
    world_radiance: tuple[float, float, float], environment: Environment | None, count: int
) -> tuple[Light, ...]:
    """At most `count` suns that stand for the world; none where it is black.

    Neighbours in the list are near each other on the sphere. Raises InvalidInput for radiance that is not finite or
    below 0.
    """
    if not all(0.0 <= value < math.inf for value in world_radiance):
        raise InvalidInput("world", f"its radiance is {world_radiance}", "give finite values of at least 0")
    if environment is not None:
        require_usable_environment(environment)
    cells = _cells(np.array(world_radiance, np.float64), environment)
    lit = cells.power.max(axis=1) > 0.0
    if not lit.any():
        return ()
    cells = _Region(cells.power[lit], cells.moment[lit])
    return _lights(cells, _labels(cells, count), count)


def merged_world_lights(lights: Sequence[Light], count: int) -> tuple[Light, ...]:
    """`lights` with those from the world joined to at most `count`, for techniques that pay much for each."""
    lamps = tuple(light for light in lights if not light.from_world)
    world = [light for light in lights if light.from_world]
    if len(world) <= count:
        return tuple(lights)
    power = np.array([light.power for light in world], np.float64)
    directed = 0.5 * (1.0 + np.cos([0.5 * light.angle for light in world])) * (power @ LUMINANCE)
    moment = directed[:, None] * np.array([light.z_axis for light in world])
    labels = np.arange(len(world)) * count // len(world)
    return (*lamps, *_lights(_Region(power, moment), labels, count))


def _cells(world_radiance: Float64, environment: Environment | None) -> _Region:
    """GRID_HEIGHT x GRID_WIDTH cells; moments in world space."""
    solid_angles = np.repeat(map_solid_angles(GRID_HEIGHT, GRID_WIDTH), GRID_WIDTH)[:, None]
    power: Float64 = world_radiance * solid_angles
    moment = (power @ LUMINANCE)[:, None] * map_directions(GRID_HEIGHT, GRID_WIDTH).reshape(-1, 3)
    if environment is None:
        return _Region(power, moment)
    radiance = environment.radiance
    height, width = max(radiance.shape[0], GRID_HEIGHT), max(radiance.shape[1], GRID_WIDTH)
    directions = map_directions(height, width)
    if radiance.shape[:2] != (height, width):
        # Texels so large are not even: the picture goes from one's middle to the next.
        radiance = radiance_at(radiance, map_places(directions)).astype(np.float32)
    directed = (radiance @ LUMINANCE)[..., None] * directions
    power = power + resized_map(radiance, GRID_HEIGHT, GRID_WIDTH).reshape(-1, 3) * solid_angles
    moment = moment + resized_map(directed, GRID_HEIGHT, GRID_WIDTH).reshape(-1, 3) * solid_angles
    return _Region(power, moment @ environment.map_from_world)


def _labels(cells: _Region, count: int) -> npt.NDArray[np.int64]:
    """(n,) which light each cell joins."""
    directions = cells.directions
    labels = _halved(cells, count)
    for _ in range(_TURNS):
        centres = cells.joined(labels, count).directions
        nearest = np.argmax(directions @ centres.T, axis=1)
        if np.array_equal(nearest, labels):
            break
        labels = nearest
    return labels


def _halved(cells: _Region, count: int) -> npt.NDArray[np.int64]:
    """(n,) labels of at most `count` regions: the one whose light is directed least is halved, until there are."""
    luminance, directions = cells.power @ LUMINANCE, cells.directions
    groups = [np.arange(len(luminance))]
    spreads = [math.inf]
    while len(groups) < count and max(spreads) > 0.0:
        worst = int(np.argmax(spreads))
        group = groups.pop(worst)
        spreads.pop(worst)
        for half in _halves(group, directions, luminance):
            groups.append(half)
            spreads.append(_spread(cells.moment[half], luminance[half]))
    labels = np.zeros(len(luminance), np.int64)
    for label, group in enumerate(groups):
        labels[group] = label
    return labels


def _spread(moment: Float64, luminance: Float64) -> float:
    """Luminance that a region's light lacks to be all in one direction; 0 for a single cell."""
    return float(luminance.sum() - np.linalg.norm(moment.sum(axis=0))) if len(luminance) > 1 else 0.0


def _halves(
    group: npt.NDArray[np.int64], directions: Float64, weights: Float64
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The cells of a group on both sides of the middle of their light, across where they lie farthest apart."""
    found, share = directions[group], weights[group] / weights[group].sum()
    from_mean = found - share @ found
    axis = np.linalg.eigh((from_mean * share[:, None]).T @ from_mean)[1][:, -1]
    order = np.argsort(from_mean @ axis, kind="stable")
    middle = int(np.searchsorted(np.cumsum(share[order]), 0.5))
    middle = min(max(middle, 1), len(group) - 1)
    return group[order[:middle]], group[order[middle:]]


def _in_order(directions: Float64, members: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """`members` so that neighbours in the list are near each other."""
    if len(members) <= 2:
        return members
    first, second = _halves(members, directions, np.ones(len(directions)))
    return np.concatenate([_in_order(directions, first), _in_order(directions, second)])


def _lights(parts: _Region, labels: npt.NDArray[np.int64], count: int) -> tuple[Light, ...]:
    """A sun for each of the regions that `parts` of equal label make up, where it sends light."""
    regions = parts.joined(labels, count)
    shining = np.flatnonzero(regions.power.max(axis=1) > 0.0)
    shining = shining[_in_order(regions.directions[shining], np.arange(len(shining)))]
    directions, power = regions.directions[shining], regions.power[shining]
    luminance, lengths = power @ LUMINANCE, np.linalg.norm(regions.moment[shining], axis=1)
    cosines = np.clip(2.0 * lengths / np.where(luminance > 0.0, luminance, 1.0) - 1.0, 0.0, 1.0)
    angles = 2.0 * np.arccos(cosines)
    return tuple(
        _sun(f"World {number}", *light) for number, light in enumerate(zip(directions, power, angles, strict=True), 1)
    )


def _sun(name: str, direction: Float64, power: Float64, angle: float) -> Light:
    z_axis = direction if direction.any() else np.array([0.0, 0.0, 1.0])
    x_axis = np.cross(np.eye(3)[np.argmin(np.abs(z_axis))], z_axis)
    x_axis /= np.linalg.norm(x_axis)
    return Light(
        name,
        SUN,
        _triple(power),
        (0.0, 0.0, 0.0),
        _triple(x_axis),
        _triple(np.cross(z_axis, x_axis)),
        _triple(z_axis),
        angle=float(angle),
        from_world=True,
    )


def _triple(values: Float64) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _sums(labels: npt.NDArray[np.int64], values: Float64, count: int) -> Float64:
    """(count, 3) sums of the rows of equal label."""
    return np.stack([np.bincount(labels, column, count) for column in values.T], axis=1)
