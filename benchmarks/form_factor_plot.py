# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of error against cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from benchmarks.form_factor_classes import EXACTLY_ZERO, FAR, WITHOUT_ORACLE
from benchmarks.form_factor_errors import INPUT_ROUNDING, Errors
from benchmarks.form_factor_timing import EMPTY_LOOP, Cost

# Classes without any error would lie below a logarithmic axis.
_LEAST_ERROR = 1e-9
# Where half a float32 unit of the input changes the true value by so much, no form can be right.
_ILL_POSED = 0.1
_MARKERS = "osD^vP*X<>h"

Table = Mapping[str, Mapping[str, Errors]]


def draw(path: Path, errors: Table, costs: Mapping[str, Cost], machine: str) -> None:
    """Writes a PNG. errors: by class and form; costs: by form."""
    near = [name for name in errors if name not in (*FAR, *EXACTLY_ZERO, *WITHOUT_ORACLE)]
    figure, axes = plt.subplots(1, 2, figsize=(13, 7.2), sharex=True, layout="constrained")
    _panel(axes[0], near, errors, costs, "greatest", "greatest absolute error of the form factor")
    _panel(axes[1], FAR, errors, costs, "greatest_relative", "greatest relative error")
    figure.suptitle(f"Form factor of a triangle: error against cost ({machine})")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _panel(
    axes: Axes, classes: Sequence[str], errors: Table, costs: Mapping[str, Cost], field: str, label: str
) -> None:
    forms = sorted((name for name in costs if name != EMPTY_LOOP), key=lambda name: costs[name].net)
    width = 0.06 * (costs[forms[-1]].net - costs[forms[0]].net)
    for i, name in enumerate(classes):
        # Side by side within a form, or equal errors would hide each other.
        aside = width * (2.0 * i / max(1, len(classes) - 1) - 1.0)
        heights = [max(getattr(errors[name][form], field), _LEAST_ERROR) for form in forms]
        places = [costs[form].net + aside for form in forms]
        ill_posed = errors[name][INPUT_ROUNDING].greatest > _ILL_POSED
        shown_name = f"{name} (rounding of the input decides)" if ill_posed else name
        axes.plot(places, heights, _MARKERS[i % len(_MARKERS)], label=shown_name, markersize=7, alpha=0.85)
    for form in forms:
        axes.axvline(costs[form].net, color="0.85", zorder=0)
        place, units = (costs[form].net, 1.0), ("data", "axes fraction")
        axes.annotate(form, place, (-4, 3), units, "offset points", rotation=20, ha="left", va="bottom")
    axes.set_yscale("log")
    axes.set_xlabel("ns per point and light, without the loop around it")
    axes.set_ylabel(label)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, frameon=False)
