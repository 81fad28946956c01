# SPDX-License-Identifier: GPL-3.0-or-later
"""What accumulation over frames makes of noisy effects: error of the last of some frames of one picture each.

Of the effect's own image, mean absolute difference from its mean over many pictures of that last frame, over the mean.
"alone" is a frame without history. The camera moves by about a pixel a frame, the object turns by 3 degrees a frame.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.support import open_sample
from vlm_addon.core.scene import PRINCIPLED, Mesh, SceneSnapshot
from vlm_addon.render.device import Device
from vlm_addon.render.frame_types import RenderSettings
from vlm_addon.terminal import table

MOTIONS = ("rest", "camera", "object")
TURN = np.radians(3.0)
GATHER = {"samples": 20, "resolution": 64, "low_resolution": 4}
EFFECTS: dict[str, dict[str, object]] = {
    "ambient_occlusion": {"directions": 1, "blur": "false"},
    "screen_reflection": {},
}
VARIANTS: dict[str, dict[str, object]] = {
    "default": {},
    "no clamp": {"clamp": 0.0},
    "history of 4 on the move": {"changing_history": 4},
    "history of 16 on the move": {"changing_history": 16},
}


def main() -> None:
    """Prints a row for each effect, motion and variant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("effects", nargs="*", default=list(EFFECTS), help=f"of {', '.join(EFFECTS)} (default: all)")
    parser.add_argument("--scene", default="monkey_box", help="sample scene (default: %(default)s)")
    parser.add_argument("--size", type=int, default=64, help="pixels across; three quarters of it high")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--reference-frames", type=int, default=64)
    parser.add_argument("--roughness", type=float, default=0.3, help="of all surfaces, for reflections")
    options = parser.parse_args()
    still = _glossy(open_sample(options.scene).snapshot, options.roughness)
    rows = []
    for effect in options.effects:
        for motion in MOTIONS:
            frames = list(_moved(still, motion, options.frames, options.size))
            last = [frames[-1]]
            truth = _image(effect, last * options.reference_frames, {"history": 65536}, options.size)
            errors = {"alone": _image(effect, last, {}, options.size)}
            variants = VARIANTS if motion != "rest" else {"default": {}}
            errors |= {name: _image(effect, frames, values, options.size) for name, values in variants.items()}
            for name, image in errors.items():
                rows.append((effect, motion, name, f"{np.abs(image - truth).mean() / truth.mean():.1%}"))
    print(table(("effect", "what moves", "accumulation", "error"), rows))


def _image(effect: str, frames: list[SceneSnapshot], accumulation: dict[str, object], width: int) -> np.ndarray:
    """What the effect shows in the last frame."""
    effects: dict[str, object] = {effect: "on", "temporal_accumulation": "on"}
    effects |= {f"{effect}.{name}": value for name, value in EFFECTS[effect].items()}
    effects |= {f"temporal_accumulation.{name}": value for name, value in accumulation.items()}
    settings = RenderSettings(
        width, width * 3 // 4, "rsm_gather", GATHER, 1, shadow_samples=4, buffers=True, effects=effects
    )
    with Device() as device:
        for snapshot in frames:
            frame = device.render(snapshot, None, settings)
    return frame.images[effect]


def _glossy(snapshot: SceneSnapshot, roughness: float) -> SceneSnapshot:
    materials = tuple(
        replace(material, model=PRINCIPLED, metallic=0.5, roughness=roughness) for material in snapshot.materials
    )
    return replace(snapshot, materials=materials)


def _moved(snapshot: SceneSnapshot, motion: str, count: int, width: int) -> Iterator[SceneSnapshot]:
    """The frames."""
    largest = max(snapshot.meshes, key=lambda mesh: len(mesh.triangles))
    camera = snapshot.camera
    assert camera is not None
    distance = float(np.linalg.norm(camera.matrix_world[:3, 3] - largest.positions.mean(axis=0)))
    pixel = distance * camera.sensor_width / camera.lens / width
    for index in range(count):
        if motion == "camera":
            matrix = camera.matrix_world.copy()
            matrix[:3, 3] += index * pixel * matrix[:3, 0]
            yield replace(snapshot, camera=replace(camera, matrix_world=matrix))
        elif motion == "object":
            meshes = tuple(_turned(m, index * TURN) if m is largest else m for m in snapshot.meshes)
            yield replace(snapshot, meshes=meshes)
        else:
            yield snapshot


def _turned(mesh: Mesh, angle: float) -> Mesh:
    """About the vertical through its middle."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    middle = mesh.positions.mean(axis=0)
    normals = np.ascontiguousarray(mesh.corner_normals @ turn.T, np.float32)
    return replace(mesh, positions=(mesh.positions - middle) @ turn.T + middle, corner_normals=normals)


if __name__ == "__main__":
    main()
