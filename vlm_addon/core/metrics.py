# SPDX-License-Identifier: GPL-3.0-or-later
"""How far one picture is from another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput

POINT_ERROR_FLOOR = 0.1
"""Share of the reference's mean below which a point's error is measured against that mean instead of the point."""

Image = npt.NDArray[np.floating]
Mask = npt.NDArray[np.bool_]


def relative_rmse(image: Image, reference: Image, mask: Mask | None = None) -> float:
    """sqrt(mean((x - r)²)) / mean(r) over linear RGB, dimensionless.

    image, reference: (h, w, 3) linear. mask: (h, w), the pixels that show geometry; all pixels without it. A black
    reference gives 0 for a black image and infinity otherwise. Raises InvalidInput if the shapes differ.
    """
    x, r = _selected(image, reference, mask)
    error, mean = np.sqrt(np.mean((x - r) ** 2)), np.mean(r)
    if mean == 0.0:
        return 0.0 if error == 0.0 else float("inf")
    return float(error / mean)


def mean_relative_error(image: Image, reference: Image, mask: Mask | None = None) -> float:
    """mean(|x - r|) / mean(r) over linear RGB, dimensionless. Arguments as for `relative_rmse`."""
    x, r = _selected(image, reference, mask)
    return float(np.mean(np.abs(x - r)) / np.mean(r))


def point_error(values: Image, reference: Image) -> npt.NDArray[np.float64]:
    """|x - r| / max(r, 10 % of mean r) of every value, float64 in the shape of the inputs; 0 where both are 0."""
    x, r = values.astype(np.float64), reference.astype(np.float64)
    floor = POINT_ERROR_FLOOR * r.mean() if r.size else 0.0
    return np.asarray(np.abs(x - r) / np.maximum(r, max(floor, float(np.finfo(float).tiny))))


def within_tolerance(errors: npt.NDArray[np.float64], tolerance: float) -> bool:
    """Whether 95 % of the point errors are at most the tolerance, and 99.9 % at most three times as much."""
    if not errors.size:
        return True
    most, nearly_all = np.quantile(errors, (0.95, 0.999))
    return bool(most <= tolerance and nearly_all <= 3.0 * tolerance)


def flip(image: Image, reference: Image) -> tuple[float, npt.NDArray[np.float32]]:
    """Mean FLIP difference in [0, 1] and its (h, w) map, for two linear pictures clipped to [0, 1] as displayed.

    Andersson et al. 2020, as evaluated by the flip-evaluator package at its default viewing distance.
    """
    import flip_evaluator

    x, r = (np.clip(picture, 0.0, 1.0).astype(np.float32) for picture in (image, reference))
    error_map, mean, _ = flip_evaluator.evaluate(r, x, "LDR", inputsRGB=False, applyMagma=False)
    return float(mean), np.asarray(error_map, np.float32)[..., 0]


def similarity(image: npt.NDArray[np.uint8], reference: npt.NDArray[np.uint8]) -> float:
    """Mean over all components of the smaller over the larger value, 1 added to both; in [1/256, 1], 1 for the same.

    image, reference: (h, w, 3) uint8 as displayed. Seed 000, algorithm 1, whose ratio is printed upside down. Raises
    InvalidInput if the shapes differ or a picture has not 8 bits.
    """
    for picture in (image, reference):
        if picture.dtype != np.uint8:
            raise InvalidInput("pictures to compare", f"values of type {picture.dtype}", "give 8 bits as displayed")
    x, r = _selected(image.astype(np.float64), reference.astype(np.float64), None)
    return float(np.mean((np.minimum(x, r) + 1.0) / (np.maximum(x, r) + 1.0)))


def rank_value(frame_rate: float, reference_frame_rate: float, found: float) -> float:
    """Frames per second gained for each percent of similarity lost (seed 000, eq. 5.3 as table 5.10 evaluates it).

    found: of `similarity` against the reference. Infinite without loss; 0 where there is no gain either.
    """
    gain, loss = frame_rate - reference_frame_rate, 100.0 * (1.0 - found)
    if loss > 0.0:
        return gain / loss
    return 0.0 if gain == 0.0 else float(np.copysign(np.inf, gain))


def _selected(
    image: Image, reference: Image, mask: Mask | None
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    if image.shape != reference.shape:
        raise InvalidInput("pictures to compare", f"sizes {image.shape} and {reference.shape}", "render both alike")
    x, r = image.astype(np.float64), reference.astype(np.float64)
    return (x, r) if mask is None else (x[mask], r[mask])
