# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits linearly transformed cosines to GGX and writes the table that ships (`core/ltc.py`).

    python -m benchmarks.fit_ltc [--out FILE]

Each entry is a fit of its own by Levenberg and Marquardt's method, begun from its neighbours' results. What is made
small is the integral of (lobe - fit)² / (lobe + fit), which weighs the tails as the share of light that they carry. The
light of half the points comes from where the lobe is, that of the other half from all of the hemisphere.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vlm_addon.core.brdf import ggx_brdf
from vlm_addon.core.ltc import TABLE_FILE, TABLE_SIZE, lobe_density, lobe_map, view_cosine
from vlm_addon.core.scene import Float64

LEAST_ROUGHNESS = 0.01
"""That of the table's first row; smoother lobes are as wide as this one."""
POINTS_PER_SIDE = 40
_STEP = 1e-5
_MOST_STEPS = 60
_MOST_TRIES = 12
_CONVERGED = 1e-9
# Of lean, widths and tilt. Where the eye is lower than alpha the best fit runs away along valleys that are nearly flat,
# and entries beside it could not be mixed with it.
_LOWEST, _HIGHEST = np.array([-1.6, 1e-3, 1e-3, -3.0]), np.array([0.2, 3.0, 3.0, 1.0])


@dataclass(frozen=True)
class LobePoints:
    """Directions (n, 3) above the surface, the lobe there (n,) in 1/sr, and the solid angle (n,) each stands for."""

    cos_view: float
    alpha: float
    directions: Float64
    lobe: Float64
    solid_angles: Float64

    @property
    def albedo(self) -> float:
        """Integral of the lobe."""
        return float(self.lobe @ self.solid_angles)


@dataclass(frozen=True)
class Fit:
    """parameters: (4,) as in core.ltc.ltc_table. cost: what was made small. variation: total variation distance."""

    parameters: Float64
    cost: float
    variation: float


def ggx_lobe(directions: Float64, cos_view: float, alpha: float) -> Float64:
    """(n,) GGX times the cosine of the light without Fresnel, 1/sr, for directions above the surface."""
    half = directions + _eye(cos_view)
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    cos_light = np.maximum(directions[:, 2], 1e-12)
    return np.asarray(ggx_brdf(half[:, 2], cos_light, max(cos_view, 1e-12), np.sqrt(alpha)) * cos_light)


def lobe_points(roughness: float, cos_view: float, per_side: int = POINTS_PER_SIDE) -> LobePoints:
    """Points for one entry of the table, spread evenly over both halves of a mixture (Veach and Guibas 1995)."""
    alpha = roughness * roughness
    u, v = (grid.ravel() for grid in np.meshgrid(*[(np.arange(per_side) + 0.5) / per_side] * 2, indexing="ij"))
    radius, turn = np.sqrt(u), 2.0 * np.pi * v
    disk = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1.0 - u)], axis=1)
    directions = np.concatenate([mirrored(disk, cos_view, alpha), disk])
    directions = directions[directions[:, 2] > 0.0]
    density = 0.5 * mirrored_density(directions, cos_view, alpha) + 0.5 * directions[:, 2] / np.pi
    solid_angles = 1.0 / (density * 2.0 * per_side * per_side)
    return LobePoints(cos_view, alpha, directions, ggx_lobe(directions, cos_view, alpha), solid_angles)


def _eye(cos_view: float) -> Float64:
    return np.array([np.sqrt(max(1.0 - cos_view * cos_view, 0.0)), 0.0, cos_view])


def mirrored(disk: Float64, cos_view: float, alpha: float) -> Float64:
    """(n, 3) the eye mirrored at visible normals (Heitz 2018), one for each point of the unit hemisphere `disk`."""
    eye = _eye(cos_view)
    stretched = eye * [alpha, alpha, 1.0]
    stretched /= np.linalg.norm(stretched)
    across, along = np.array([0.0, 1.0, 0.0]), np.array([-stretched[2], 0.0, stretched[0]])
    x, y = disk[:, 0], disk[:, 1]
    share = 0.5 * (1.0 + stretched[2])
    y = (1.0 - share) * np.sqrt(np.maximum(1.0 - x * x, 0.0)) + share * y
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    half = x[:, None] * across + y[:, None] * along + z[:, None] * stretched
    half = np.stack([alpha * half[:, 0], alpha * half[:, 1], np.maximum(half[:, 2], 1e-9)], axis=1)
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    return np.asarray(2.0 * (half @ eye)[:, None] * half - eye)


def mirrored_density(directions: Float64, cos_view: float, alpha: float) -> Float64:
    """(n,) of `mirrored`, 1/sr."""
    half = directions + _eye(cos_view)
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    squared = alpha * alpha
    spread = squared + (half[:, 0] ** 2 + half[:, 1] ** 2) * (1.0 - squared)
    distribution = squared / (np.pi * spread * spread)
    return np.asarray(0.5 * distribution / (cos_view + np.sqrt(cos_view * cos_view * (1.0 - squared) + squared)))


def fitted_lobe(points: LobePoints, parameters: Float64) -> Float64:
    """(n,) the fit's lobe at the points, 1/sr, with the albedo of the true one."""
    to_lobe = lobe_map(parameters, points.alpha, points.cos_view)
    return points.albedo * lobe_density(to_lobe, points.directions)


def fit(points: LobePoints, start: Float64) -> Fit:
    """The best parameters near `start`."""
    albedo = points.albedo

    def residuals(parameters: Float64) -> Float64:
        found = fitted_lobe(points, parameters)
        weights = points.solid_angles / (albedo * (points.lobe + found + 1e-12))
        return np.asarray((points.lobe - found) * np.sqrt(weights))

    parameters, damping = np.array(start), 1e-3
    rest = residuals(parameters)
    for _ in range(_MOST_STEPS):
        steps = _STEP * np.eye(4)
        slopes = np.stack([residuals(parameters + s) - residuals(parameters - s) for s in steps], 1) / (2.0 * _STEP)
        normal, gradient = slopes.T @ slopes, slopes.T @ rest
        for _ in range(_MOST_TRIES):
            step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), gradient)
            tried = np.clip(parameters + np.clip(step, -0.5, 0.5), _LOWEST, _HIGHEST)
            after = residuals(tried)
            if after @ after < rest @ rest:
                break
            damping *= 4.0
        else:
            break
        gain = 1.0 - (after @ after) / (rest @ rest)
        parameters, rest, damping = tried, after, max(damping / 5.0, 1e-9)
        if gain < _CONVERGED:
            break
    difference = np.abs(points.lobe - fitted_lobe(points, parameters))
    return Fit(parameters, float(rest @ rest), 0.5 * float(difference @ points.solid_angles) / albedo)


def fit_table() -> tuple[Float64, Float64]:
    """The table, from rough to smooth and from the normal to the horizon, and the total variation of each entry."""
    table, variations = np.zeros((TABLE_SIZE, TABLE_SIZE, 4)), np.zeros((TABLE_SIZE, TABLE_SIZE))
    views = view_cosine(np.linspace(0.0, 1.0, TABLE_SIZE))
    for row in reversed(range(TABLE_SIZE)):
        roughness = max(row / (TABLE_SIZE - 1), LEAST_ROUGHNESS)
        for column, cos_view in enumerate(views.tolist()):
            points = lobe_points(roughness, cos_view)
            starts = [table[row, column - 1]] if column else []
            starts += [table[row + 1, column]] if row < TABLE_SIZE - 1 else []
            best = min((fit(points, start) for start in starts or [_ROUGH_START]), key=lambda found: found.cost)
            table[row, column], variations[row, column] = best.parameters, best.variation
            if column == 0:
                # Along the normal a lobe is round.
                table[row, 0] = [0.0, *[best.parameters[1:3].mean()] * 2, 0.0]
    return table, variations


_ROUGH_START = np.array([0.0, 1.15, 1.15, 0.0])


def main() -> None:
    """Writes the table and prints how far its lobes are from GGX."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=TABLE_FILE)
    out = parser.parse_args().out
    table, variations = fit_table()
    np.save(out, table.astype(np.float32))
    print("total variation between GGX and its fit, by roughness (down) and cosine of the eye (across)")
    columns = [*range(0, TABLE_SIZE, 5), TABLE_SIZE - 1]
    print("roughness " + " ".join(f"{view_cosine(c / (TABLE_SIZE - 1)):6.3f}" for c in columns))
    for row in range(1, TABLE_SIZE, 3):
        print(f"{row / (TABLE_SIZE - 1):9.3f} " + " ".join(f"{variations[row, c]:6.4f}" for c in columns))


if __name__ == "__main__":
    main()
