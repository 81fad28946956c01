# SPDX-License-Identifier: GPL-3.0-or-later
"""The light mesh for what moves, another technique for the rest (seed 002, 3.5): the dancer against Cycles with one
diffuse bounce, and what frames take in which she moves.

"on her" and "elsewhere" are the errors of pixels all of whose neighbours show the same material: few are hers, and what
she throws on herself is what few virtual lights know least of. "light" is ours over Cycles', "chosen" the share of our
indirect irradiance that comes from the dancer by her virtual lights. "ms" is what a whole frame of another pose takes
all the processor's threads together, the least of some.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np

from benchmarks.support import ALONE, SAMPLE_BLENDS, quiet
from vlm_addon.blender.cycles_reference import render_reference
from vlm_addon.blender.extraction.light_mesh_io import Extraction, extract
from vlm_addon.blender.scene_file import open_scene
from vlm_addon.core.bounce_parts import Bools
from vlm_addon.core.metrics import relative_rmse
from vlm_addon.core.scene import SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import Frame, RenderSettings
from vlm_addon.render.techniques.vlm_and_rest import CHOSEN, REST, VlmAndRest
from vlm_addon.terminal import table

SCENE = "dancer"
RESTS = ("many_light", "rsm_gather", "second_order", "vlm")
OCTREE = {"visibility": "octree"}
RUNS: tuple[tuple[str, str, dict[str, object]], ...] = (
    ("vlm", "vlm", {}),
    ("vlm, octree", "vlm", dict(OCTREE)),
    *((name, name, {}) for name in RESTS[:-1]),
    *((f"vlm and {rest}", VlmAndRest.name, {"rest": rest}) for rest in RESTS),
    *((f"vlm, octree, and {rest}", VlmAndRest.name, {"rest": rest, **OCTREE}) for rest in RESTS[:-1]),
)
HEADS = ("technique", "indirect error", "on her", "elsewhere", "light", "chosen", "ms")


def main() -> None:
    """Prints a row for each technique and each pair of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=96, help="pixels along a side of each picture")
    parser.add_argument("--samples", type=int, default=4, help="jittered pictures of the frame that is compared")
    parser.add_argument("--poses", type=int, default=3, help="frames that are timed, one picture each")
    parser.add_argument("--reference-samples", type=int, default=2048)
    options = parser.parse_args()
    with quiet():
        poses = [_pose(number) for number in range(1 + options.poses, 0, -1)]
        # The pose that is open now is the last one.
        reference = render_reference(options.size, options.size, 1, options.reference_samples)
    truth = reference.images["indirect"]
    rows = []
    with Device() as device:
        for label, technique, chosen in RUNS:
            settings = RenderSettings(
                options.size, options.size, technique, chosen, options.samples, buffers=True, effects=ALONE
            )
            frame = device.render(poses[-1].snapshot, poses[-1].light_mesh, settings)
            indirect = frame.images["indirect"]
            single = RenderSettings(options.size, options.size, technique, chosen, 1, effects=ALONE)
            regions = _regions(frame, poses[-1].snapshot)
            errors = [f"{relative_rmse(indirect, truth, region):.1%}" for region in regions]
            light = f"{indirect.mean() / truth.mean():.3f}"
            rows.append((label, *errors, light, _chosen_share(frame), f"{_least_ms(device, poses, single):.0f}"))
    rows.append(("noise of the reference", f"{reference.noise['indirect']:.1%}", *[""] * 5))
    print(table(HEADS, rows))


def _pose(number: int) -> Extraction:
    open_scene(SAMPLE_BLENDS / f"{SCENE}.blend", number)
    return extract()


def _regions(frame: Frame, scene: SceneSnapshot) -> tuple[Bools, Bools, Bools]:
    """(h, w) each: all pixels; of those inside of a material, those of what moves; and the others."""
    shown = frame.images["material_id"][..., 0]
    around = np.lib.stride_tricks.sliding_window_view(np.pad(shown, 1, mode="edge"), (3, 3))
    inside = around.min(axis=(2, 3)) == around.max(axis=(2, 3))
    moving = np.isin(shown, np.concatenate([mesh.material_indices for mesh in scene.meshes if mesh.dynamic]))
    return np.ones_like(inside), inside & moving, inside & ~moving


def _chosen_share(frame: Frame) -> str:
    parts = [frame.images.get(f"{VlmAndRest.name}_{part}_irradiance") for part in (CHOSEN, REST)]
    if parts[0] is None or parts[1] is None:
        return ""
    chosen, rest = (float(np.mean(part, dtype=np.float64)) for part in parts if part is not None)
    return f"{chosen / (chosen + rest):.1%}"


def _least_ms(device: Device, poses: Sequence[Extraction], settings: RenderSettings) -> float:
    times = []
    for pose in poses:
        started = time.process_time()
        device.render(pose.snapshot, pose.light_mesh, settings)
        times.append(1e3 * (time.process_time() - started))
    return min(times[1:])


if __name__ == "__main__":
    main()
