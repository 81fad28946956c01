# SPDX-License-Identifier: GPL-3.0-or-later
"""Reference pictures from Cycles: N diffuse bounces and nothing that the comparison does not mean."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..core.errors import InvalidInput, VlmError
from ..core.exr import image_of, read_exr
from ..core.scene import Float32
from .extraction.color_space import convert, working_to_rec709
from .extraction.evaluation import light_meshes_in_render, no_render_handlers, only_layer
from .extraction.temporary import present, restored

CONVERGED_BOUNCES = 32
MINIMAL_SAMPLES = 2
# Cycles' own bound of its seed.
SEED_STEP = 7919

PASSES = {
    "combined": ("Combined", "Combined"),
    "diffuse_direct": ("Diffuse Direct", "DiffDir"),
    "diffuse_indirect": ("Diffuse Indirect", "DiffInd"),
    "diffuse_color": ("Diffuse Color", "DiffCol"),
    "glossy_direct": ("Glossy Direct", "GlossDir"),
    "glossy_color": ("Glossy Color", "GlossCol"),
    "emission": ("Emission", "Emit"),
}
"""Our names of Cycles' passes: what Blender 5.0 and later call them in a file, and what earlier ones do."""

LAYER_PASSES = (
    "use_pass_combined",
    "use_pass_diffuse_direct",
    "use_pass_diffuse_indirect",
    "use_pass_diffuse_color",
    "use_pass_glossy_direct",
    "use_pass_glossy_color",
    "use_pass_emit",
)


@dataclass(frozen=True)
class Reference:
    """A path-traced picture.

    images: float32 (h, w, 3) linear Rec.709, row 0 at the top: `combined`; `direct` and `indirect`, the diffuse light
    times the diffuse colour; `diffuse_color`; `glossy_direct`, times the glossy colour; `emission`. noise: relative
    RMSE of `combined`, `direct` and `indirect` that is left in them, from two halves of the samples.
    """

    images: dict[str, Float32]
    noise: dict[str, float]


def render_reference(
    width: int,
    height: int,
    diffuse_bounces: int,
    samples: int,
    *,
    seed: int = 0,
    caustics: bool = True,
    at_centres: bool = False,
    scene: Any = None,
    view_layer: Any = None,
) -> Reference:
    """The current scene by Cycles on the CPU with exactly `diffuse_bounces` diffuse bounces after the first hit.

    Specular light counts where it comes straight from a lamp. `samples` per pixel are shared by two renders of
    different seeds, whose difference gives the noise. caustics=False also leaves out lamps that are seen in a
    specular lobe after a diffuse bounce; Cycles then gives that lobe's share back to the diffuse one. at_centres:
    the middles of pixels, as our pictures of one sample show, not means over pixels. Every setting is as before
    afterwards. Raises InvalidInput for sizes, bounces or samples out of range or a scene without camera.
    """
    scene = scene or bpy.context.scene
    view_layer = view_layer or bpy.context.view_layer
    _require(width >= 1 and height >= 1, f"size {width}x{height}", "give at least one pixel each way")
    _require(samples >= MINIMAL_SAMPLES, f"samples {samples}", f"give at least {MINIMAL_SAMPLES}")
    _require(diffuse_bounces >= 0, f"diffuse bounces {diffuse_bounces}", "give 0 or more")
    if scene.camera is None:
        raise InvalidInput(f"scene {scene.name!r}", "it has no camera", "add one (Add > Camera)")
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="vlm_reference_")))
        stack.enter_context(_reference_settings(scene, view_layer, width, height))
        settings = _cycles_settings(diffuse_bounces, caustics) | (_CENTRES if at_centres else {})
        stack.enter_context(restored(scene.cycles, **settings))
        stack.enter_context(light_meshes_in_render(shown=False))
        shares = (samples - samples // 2, samples // 2)
        halves = [_render(scene, view_layer, folder, seed + i * SEED_STEP, count) for i, count in enumerate(shares)]
    images = {name: 0.5 * (halves[0][name] + halves[1][name]) for name in halves[0]}
    noise = {name: _noise(halves[0][name], halves[1][name]) for name in ("combined", "direct", "indirect")}
    return Reference(images, noise)


def _require(holds: bool, found: str, remedy: str) -> None:
    if not holds:
        raise InvalidInput("reference", f"{found} is out of range", remedy)


def _noise(a: Float32, b: Float32) -> float:
    """Relative RMSE of the mean of two independent pictures: half of their difference's."""
    mean = float(0.5 * (a.mean(dtype=np.float64) + b.mean(dtype=np.float64)))
    difference = a.astype(np.float64) - b
    return 0.5 * float(np.sqrt(np.mean(difference**2))) / mean if mean > 0.0 else 0.0


@contextmanager
def _reference_settings(scene: Any, view_layer: Any, width: int, height: int) -> Iterator[None]:
    render, settings = scene.render, scene.render.image_settings
    with ExitStack() as stack:
        stack.enter_context(only_layer(scene, view_layer))
        stack.enter_context(no_render_handlers())
        # The engine comes first: Cycles' own properties of layers exist only with it.
        stack.enter_context(
            restored(
                render,
                engine="CYCLES",
                resolution_x=width,
                resolution_y=height,
                resolution_percentage=100,
                use_border=False,
                film_transparent=False,
                use_compositing=False,
                use_sequencer=False,
                use_multiview=False,
                use_motion_blur=False,
                use_single_layer=False,
                use_persistent_data=False,
                filepath=render.filepath,
                use_file_extension=False,
                use_overwrite=True,
                use_placeholder=False,
            )
        )
        stack.enter_context(restored(view_layer, **dict.fromkeys(LAYER_PASSES, True)))
        stack.enter_context(restored(view_layer.cycles, use_denoising=False, pass_debug_sample_count=False))
        stack.enter_context(restored(settings, **present(settings, _IMAGE_SETTINGS)))
        yield


# Restored from the last to the first: a file format is offered only with its media type.
_IMAGE_SETTINGS = ("use_exr_interleave", "exr_codec", "color_depth", "color_mode", "file_format", "media_type")

# Cycles' box is always a pixel wide.
_CENTRES = {"pixel_filter_type": "GAUSSIAN", "filter_width": 0.01}


def _cycles_settings(diffuse_bounces: int, caustics: bool) -> dict[str, Any]:
    return {
        "device": "CPU",
        "feature_set": "SUPPORTED",
        "shading_system": False,
        "use_adaptive_sampling": False,
        "use_denoising": False,
        "use_guiding": False,
        "use_light_tree": True,
        "light_sampling_threshold": 0.0,
        "time_limit": 0.0,
        "sample_offset": 0,
        "use_sample_subset": False,
        "use_layer_samples": "IGNORE",
        "auto_scrambling_distance": False,
        "scrambling_distance": 1.0,
        "seed": 0,
        "samples": MINIMAL_SAMPLES,
        "use_animated_seed": False,
        "pixel_filter_type": "BOX",
        "film_exposure": 1.0,
        "sample_clamp_direct": 0.0,
        "sample_clamp_indirect": 0.0,
        "blur_glossy": 0.0,
        "caustics_reflective": caustics,
        "caustics_refractive": caustics,
        "max_bounces": diffuse_bounces,
        "diffuse_bounces": diffuse_bounces,
        "glossy_bounces": 0,
        "transmission_bounces": 0,
        "volume_bounces": 0,
        "min_light_bounces": 0,
        "min_transparent_bounces": 0,
        "transparent_max_bounces": 8,
        "use_fast_gi": False,
        "direct_light_sampling_type": "MULTIPLE_IMPORTANCE_SAMPLING",
        "debug_use_spatial_splits": False,
    }


def _render(scene: Any, view_layer: Any, folder: Path, seed: int, samples: int) -> dict[str, Float32]:
    path = folder / f"{seed}.exr"
    scene.cycles.seed = seed
    scene.cycles.samples = samples
    image_settings = scene.render.image_settings
    if hasattr(image_settings, "media_type"):
        # 5.0 and later; they also write one part per pass unless told to interleave.
        image_settings.media_type = "MULTI_LAYER_IMAGE"
        image_settings.use_exr_interleave = True
    image_settings.file_format = "OPEN_EXR_MULTILAYER"
    image_settings.color_depth = "32"
    image_settings.exr_codec = "ZIP"
    scene.render.filepath = str(path)
    bpy.ops.render.render(scene=scene.name, write_still=True)
    if not path.exists():
        raise VlmError(f"scene {scene.name!r}: Cycles wrote no picture")
    return _pictures(read_exr(path), view_layer.name)


def _pictures(channels: dict[str, Float32], layer: str) -> dict[str, Float32]:
    matrix = working_to_rec709()
    raw = {}
    for name, spellings in PASSES.items():
        spelling = next((text for text in spellings if f"{layer}.{text}.R" in channels), spellings[0])
        raw[name] = convert(image_of(channels, f"{layer}.{spelling}."), matrix)
    return {
        "combined": raw["combined"],
        "direct": raw["diffuse_direct"] * raw["diffuse_color"],
        "indirect": raw["diffuse_indirect"] * raw["diffuse_color"],
        "diffuse_color": raw["diffuse_color"],
        "glossy_direct": raw["glossy_direct"] * raw["glossy_color"],
        "emission": raw["emission"],
    }
