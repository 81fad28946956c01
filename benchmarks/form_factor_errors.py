# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of each form against the float64 oracle on the same float32 numbers, by class of samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.form_factor_classes import CLASSES, WITHOUT_ORACLE
from benchmarks.form_factor_forms import FORMS, evaluate_forms, stored_with
from vlm_addon.core.form_factor import paired_form_factor
from vlm_addon.core.scene import Float64
from vlm_addon.render.device import Device

# Below this share of what the triangle would send if both faced each other, heights are float32 noise.
RELATIVE_FLOOR = 1e-3
_SAMPLES_PER_CHUNK = 1 << 17
_SEED = 20


@dataclass(frozen=True)
class Errors:
    """Of one form in one class. Errors are NaN where the class has no oracle or no sample above RELATIVE_FLOOR."""

    greatest: float
    percentile_99: float
    greatest_relative: float
    percentile_99_relative: float
    not_finite: int
    outside: int  # of [0, 1]
    not_zero: int  # though behind, in the plane or wholly under the horizon


INPUT_ROUNDING = "input rounding"
"""Name, among the forms, of the true value's own change when every number moves by half a float32 unit."""


def measure_errors(device: Device, class_name: str, samples: int) -> dict[str, Errors]:
    """Errors of every form over that many samples, by the form's name, and of INPUT_ROUNDING."""
    random = np.random.default_rng([_SEED, list(CLASSES).index(class_name)])
    chunks = []
    for start in range(0, samples, _SAMPLES_PER_CHUNK):
        sample = CLASSES[class_name](random, min(_SAMPLES_PER_CHUNK, samples - start))
        values = [*evaluate_forms(device, *sample).astype(np.float64).T]
        if class_name in WITHOUT_ORACLE:
            known, hidden = np.full(len(sample[0]), np.nan), np.zeros(len(sample[0]), bool)
            values.append(known)
        else:
            known, hidden = paired_form_factor(*sample), _hidden(*sample)
            values.append(paired_form_factor(*(_moved_by_half_a_unit(random, numbers) for numbers in sample)))
        chunks.append((np.stack(values, axis=1), known, hidden, RELATIVE_FLOOR * _unobstructed(sample[0], sample[2])))
    values, known, hidden, floor = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    names = [*(form.name for form in FORMS), INPUT_ROUNDING]
    return {name: _errors(values[:, i], known, hidden, floor) for i, name in enumerate(names)}


def _errors(values: Float64, known: Float64, hidden: npt.NDArray[np.bool_], floor: Float64) -> Errors:
    finite = np.isfinite(values)
    absolute = np.abs(values - known)[finite]
    clear = finite & (known > floor)
    relative = np.abs(values - known)[clear] / known[clear]
    outside = finite & ((values < 0.0) | (values > 1.0))
    return Errors(
        *_greatest_and_percentile(absolute[np.isfinite(absolute)]),
        *_greatest_and_percentile(relative),
        int((~finite).sum()),
        int(outside.sum()),
        int((hidden & (values != 0.0)).sum()),
    )


def _greatest_and_percentile(errors: Float64) -> tuple[float, float]:
    if not len(errors):
        return np.nan, np.nan
    return float(errors.max()), float(np.quantile(errors, 0.99))


def _moved_by_half_a_unit(random: np.random.Generator, numbers: Float64) -> Float64:
    return numbers + random.choice([-0.5, 0.5], numbers.shape) * np.spacing(numbers.astype(np.float32))


def _hidden(points: Float64, normals: Float64, triangles: Float64) -> npt.NDArray[np.bool_]:
    """(n,) whether no light arrives, by the signs of float64 heights."""
    offsets = triangles - points[:, None]
    under = (np.einsum("nkc,nc->nk", offsets, normals) <= 0.0).all(axis=1)
    nearest = np.take_along_axis(offsets, (offsets**2).sum(axis=2).argmin(axis=1)[:, None, None], axis=1)[:, 0]
    return under | ((stored_with(triangles)[0] * nearest).sum(axis=1) >= 0.0)


def _unobstructed(points: Float64, triangles: Float64) -> Float64:
    """(n,) form factors if point and triangle faced each other at the distance of the centroid, at most 1."""
    areas = np.linalg.norm(stored_with(triangles)[0], axis=1)
    squared = ((triangles.mean(axis=1) - points) ** 2).sum(axis=1)
    return areas / np.maximum(np.pi * squared, areas + 1e-300)
