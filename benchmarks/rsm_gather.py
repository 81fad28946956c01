# SPDX-License-Identifier: GPL-3.0-or-later
"""Light gathered from reflective shadow maps against Cycles with one diffuse bounce: weights, numbers of samples, maps.

Cycles knows what occludes indirect light and this does not: that is most of the error in scenes with things in them.
"light" is ours over Cycles': 50, 200 and 2,000 samples come to the same from below, as the bound takes less; the
squared weight loses more than half whatever their number. What frames take in the seed's rows is in rsm_tables.py.
"""

from __future__ import annotations

import argparse

from benchmarks.support import open_sample, quiet
from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.terminal import table

SCENES = ("empty_room", "cornell_box", "monkey_box")
PICTURES = 8
VARIANTS: dict[str, dict[str, object]] = {
    "200 samples": {},
    "at every pixel": {"low_resolution": 1},
    "rotating, 10 of 200": {"pattern": "rotating", "low_resolution": 1},
    "50 samples": {"samples": 50},
    "2,000 samples, 512 texels": {"samples": 2000, "resolution": 512},
    "one map for an area lamp": {"area_maps": 1},
    "squared weight, 50": {"weight": "squared", "samples": 50},
    "squared weight, 200": {"weight": "squared"},
    "squared weight, 2,000": {"weight": "squared", "samples": 2000, "resolution": 512},
    "disc of 0.3": {"radius": 0.3},
}


def main() -> None:
    """Prints a row for each scene and variant, the light mesh as a comparison."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES, help=f"sample scenes (default: {', '.join(SCENES)})")
    parser.add_argument("--size", type=int, default=64, help="pixels along a side of each picture")
    parser.add_argument("--reference-samples", type=int, default=1024)
    options = parser.parse_args()
    rows = []
    for scene in options.scenes:
        with quiet():
            found = open_sample(scene)
            reference = render_reference(options.size, options.size, 1, options.reference_samples)
        truth = reference.images["indirect"]
        runs = [(name, "rsm_gather", values) for name, values in VARIANTS.items()]
        if found.light_mesh is not None:
            runs.append(("virtual light mesh", "vlm", {}))
        with Device() as device:
            for name, technique, values in runs:
                settings = RenderSettings(options.size, options.size, technique, values, PICTURES)
                frame = device.render(found.snapshot, found.light_mesh, settings)
                indirect = frame.images["indirect"]
                removed = frame.counters.get("bound_removes_share")
                rows.append(
                    (
                        scene,
                        name,
                        f"{relative_rmse(indirect, truth):.1%}",
                        f"{indirect.mean() / truth.mean():.3f}",
                        "" if removed is None else f"{removed:.1%}",
                        f"{sum(ms for _, ms in frame.timings):.0f}",
                    )
                )
        rows.append((scene, "noise of the reference", f"{reference.noise['indirect']:.1%}", "", "", ""))
    print(table(("scene", "variant", "indirect error", "light", "bound takes", "ms"), rows))


if __name__ == "__main__":
    main()
