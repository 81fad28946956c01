# SPDX-License-Identifier: GPL-3.0-or-later
"""What the benchmark programs share: sample scenes, pictures by our renderer and by Cycles, with milliseconds."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import numpy as np
from PIL import Image

from vlm_addon.blender.extraction.light_mesh_io import Extraction, extract
from vlm_addon.blender.image_io import write_image
from vlm_addon.blender.scene_file import open_scene
from vlm_addon.core.scene import Float32

T = TypeVar("T")

ALONE = {"ambient_occlusion": "off"}
"""Effects of pictures that are to show what a technique finds by itself."""
ROOT = Path(__file__).resolve().parents[1]
SAMPLE_BLENDS = ROOT / "sample_blends"
MODELS = ROOT.parent / "shared" / "models"


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """What `work` returns and the milliseconds it took."""
    started = time.perf_counter()
    result = work()
    return result, 1000.0 * (time.perf_counter() - started)


@contextmanager
def quiet() -> Iterator[None]:
    """Blender's own lines on standard output go nowhere meanwhile."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def open_sample(name: str) -> Extraction:
    """The committed sample scene `name`, opened in Blender and extracted."""
    with quiet():
        open_scene(SAMPLE_BLENDS / f"{name}.blend")
        return extract()


def displayed(path: Path, image: Float32) -> Image.Image:
    """Writes a linear picture through the open scene's view transform as PNG; returns it as 8-bit RGB."""
    with quiet():
        write_image(path, image)
    with Image.open(path) as picture:
        return picture.convert("RGB")


def rgb(image: Float32) -> Float32:
    """The colours of a picture without its alpha."""
    return np.ascontiguousarray(image[..., :3])
