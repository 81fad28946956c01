# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of error against the number of lights."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Protocol

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

_STYLES = {"ours": "o-", "Decimate": "s-", "fast_simplification": "^-"}


class Point(Protocol):
    """What is drawn of a row of the table; errors relative to the mean irradiance."""

    scene: str
    budget: int
    way: str
    lights: int
    mean_error: float
    plain_mean: float


def draw(path: Path, rows: Sequence[Point], title: str) -> None:
    """Writes a PNG: a panel for each scene; dashed where nothing is done to the triangles of a rival. Points of a way
    that does not come down to a budget stand at the number of lights that it has."""
    scenes = list(dict.fromkeys(row.scene for row in rows))
    figure, axes = plt.subplots(1, len(scenes), figsize=(4.6 * len(scenes), 4.4), layout="constrained", squeeze=False)
    for panel, scene in zip(axes[0], scenes, strict=True):
        for way, style in _STYLES.items():
            own = [row for row in rows if row.scene == scene and row.way == way]
            if not own:
                continue
            color = f"C{list(_STYLES).index(way)}"
            panel.plot(*_line((row.lights, row.mean_error) for row in own), style, color=color, label=way)
            plain = [(row.lights, row.plain_mean) for row in own if row.plain_mean == row.plain_mean]
            if plain:
                panel.plot(
                    *_line(plain), style[0] + "--", color=color, label=f"{way}, as it is", markerfacecolor="none"
                )
        panel.set(xscale="log", yscale="log", xlabel="lights", title=scene)
        panel.grid(which="both", color="0.92")
    axes[0, 0].set_ylabel("mean error of the irradiance / mean irradiance")
    axes[0, 0].legend(fontsize=8)
    figure.suptitle(title)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _line(points: Iterable[tuple[int, float]]) -> tuple[list[int], list[float]]:
    ordered = sorted(set(points))
    return [x for x, _ in ordered], [y for _, y in ordered]
