# SPDX-License-Identifier: GPL-3.0-or-later
"""Form factor of a triangle: errors and cost of our form beside the forms that others use.

`./dev bench form_factor` prints the tables; `--write` also puts them into benchmarks/RESULTS.md and the plot of error
against cost into docs/. A million samples a class take some minutes.
"""

from __future__ import annotations

import argparse
import re
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.form_factor_classes import CLASSES, FAR
from benchmarks.form_factor_errors import INPUT_ROUNDING, RELATIVE_FLOOR, Errors, measure_errors
from benchmarks.form_factor_forms import FORMS
from benchmarks.form_factor_plot import draw
from benchmarks.form_factor_timing import EMPTY_LOOP, ROUNDS, Cost, Workload, measure, room, shuffled
from vlm_addon.render.device import Device
from vlm_addon.terminal import TerminalProgress, table

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "RESULTS.md"
PLOT = ROOT / "docs" / "form_factor_cost.png"
HEADING = "## Form factor"
SAMPLES = 1_000_000
WIDTH = 120
_ROOM_SEED = 1

Rows = list[tuple[str, ...]]
Layout = Callable[[Sequence[str], Rows], str]
ErrorTable = dict[str, dict[str, Errors]]
CostTable = dict[str, dict[str, Cost]]


def main() -> None:
    """Measures, prints and, when asked to, writes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=SAMPLES, help="per class")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="of the timing")
    parser.add_argument("--write", action="store_true", help="update RESULTS.md and the plot")
    arguments = parser.parse_args()
    with Device() as device:
        workload, costs = _costs(device, arguments.rounds)
        errors = _all_errors(device, arguments.samples)
        machine = f"{device.name}, {'processor time' if device.is_software else 'wall clock'}"
    print(_report(errors, costs, workload, arguments.samples, machine, table))
    if arguments.write:
        text = _report(errors, costs, workload, arguments.samples, machine, _markdown)
        picture = f"![Error against cost of each form](../{PLOT.relative_to(ROOT)})"
        _replace_section(f"{HEADING}\n\n`./dev bench form_factor --write`.\n{text}\n\n{picture}\n")
        draw(PLOT, errors, costs["neighbours"], machine)


def _costs(device: Device, rounds: int) -> tuple[Workload, CostTable]:
    random = np.random.default_rng(_ROOM_SEED)
    workload = room(random)
    orders = {"neighbours": workload, "shuffled": shuffled(workload, random)}
    return workload, {order: measure(device, points, FORMS, rounds) for order, points in orders.items()}


def _all_errors(device: Device, samples: int) -> ErrorTable:
    progress = TerminalProgress()
    errors = {}
    for i, name in enumerate(CLASSES):
        progress(i / len(CLASSES), name)
        errors[name] = measure_errors(device, name, samples)
    progress(1.0, "done")
    return errors


def _report(
    errors: ErrorTable, costs: CostTable, workload: Workload, samples: int, machine: str, layout: Layout
) -> str:
    forms = [form.name for form in FORMS]
    known = [*forms, INPUT_ROUNDING]
    far = {name: errors[name] for name in FAR}
    return "\n\n".join(
        (
            _wrapped(
                f"{machine}. {samples:,} samples a class, all of float32 numbers; errors against the float64 oracle on "
                "the same numbers, among finite values. `form_factor_classes.py` says what a class holds, `rivals/` "
                f"where the other forms come from. The last column, {INPUT_ROUNDING}, is how much the true value "
                "itself changes when every number moves by half a float32 unit, up or down."
            ),
            "Greatest absolute error (99th percentile):",
            layout(("class", *known), _rows(errors, known, _absolute)),
            _wrapped(
                f"Greatest relative error (99th percentile) where the true value is above {RELATIVE_FLOOR:g} of "
                "min(1, A / (pi d²)); for the far classes, whose bound is a relative one:"
            ),
            layout(("class", *known), _rows(far, known, _relative)),
            "Failures: NaN or infinite / outside [0, 1] / not 0 though behind, in the plane or under the horizon:",
            layout(("class", *forms), _rows(errors, forms, _failures)),
            _wrapped(
                f"Nanoseconds per point and light, each point summing {len(workload.lights)} lights of a room; "
                f"{workload.clipped:.0%} of the pairs are cut by the horizon, {workload.hidden:.0%} send nothing, nine "
                f"in ten are {workload.nearest:.1f} to {workload.farthest:.0f} bounding radii apart. "
                "Medians (quartiles) of rounds in which the forms take turns; net: without the empty loop; ratio: net, "
                "to the rational fit's, round by round. Points are neighbours in place and normal, or shuffled:"
            ),
            layout(("form", "order", "ns", "net ns", "ratio"), _cost_rows(costs)),
        )
    )


def _wrapped(paragraph: str) -> str:
    return textwrap.fill(paragraph, WIDTH)


def _rows(errors: ErrorTable, forms: Sequence[str], cell: Callable[[Errors], str]) -> Rows:
    return [(name, *(cell(of_class[form]) for form in forms)) for name, of_class in errors.items()]


def _absolute(errors: Errors) -> str:
    return _pair(errors.greatest, errors.percentile_99)


def _relative(errors: Errors) -> str:
    return _pair(errors.greatest_relative, errors.percentile_99_relative)


def _pair(greatest: float, percentile: float) -> str:
    return "-" if np.isnan(greatest) else f"{greatest:.1e} ({percentile:.1e})"


def _failures(errors: Errors) -> str:
    counts = (errors.not_finite, errors.outside, errors.not_zero)
    return " / ".join(f"{count:,}" for count in counts) if any(counts) else "0"


def _cost_rows(costs: CostTable) -> Rows:
    rows: Rows = []
    for order, of_order in costs.items():
        for name, cost in of_order.items():
            time = f"{cost.median:.1f} ({cost.low:.1f} to {cost.high:.1f})"
            ratio = f"{cost.ratio:.2f} ({cost.ratio_low:.2f} to {cost.ratio_high:.2f})"
            own = ("-", "-") if name == EMPTY_LOOP else (f"{cost.net:.1f}", ratio)
            rows.append((name, order, time, *own))
    return rows


def _markdown(header: Sequence[str], rows: Rows) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows))


def _replace_section(section: str) -> None:
    """Puts the section in the place of the one with its heading, or at the end of RESULTS.md."""
    text = RESULTS.read_text(encoding="utf-8")
    old = re.search(rf"^{re.escape(HEADING)}$.*?(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    section = section.rstrip() + "\n"
    if old is None:
        text = f"{text.rstrip()}\n\n{section}"
    else:
        rest = text[old.end() :]
        text = text[: old.start()] + section + ("\n" + rest if rest else "")
    RESULTS.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
