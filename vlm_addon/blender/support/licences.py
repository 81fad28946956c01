# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose work the extension contains, and under which terms."""

from __future__ import annotations

import importlib.metadata
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
MISSING = "not installed"


@dataclass(frozen=True)
class Licence:
    """One piece of software: what it is, its version, its licence's SPDX identifier and where it comes from."""

    name: str
    version: str
    spdx: str
    url: str

    def __str__(self) -> str:
        return f"{self.name} {self.version}: {self.spdx} ({self.url})"


BUNDLED = (
    ("moderngl", "MIT", "https://github.com/moderngl/moderngl"),
    ("glcontext", "MIT", "https://github.com/moderngl/glcontext"),
    ("trimesh", "MIT", "https://github.com/mikedh/trimesh"),
    ("fast_simplification", "MIT", "https://github.com/pyvista/fast-simplification"),
)
"""Distributions that the extension's zip holds as wheels: name, licence, home."""


def licences() -> list[Licence]:
    """Of this extension first, then of what it brings along."""
    own = Licence("Virtual Light Mesh", extension_version(), "GPL-3.0-or-later", str(ROOT / "LICENSE"))
    return [own, *(Licence(name, version(name), spdx, url) for name, spdx, url in BUNDLED)]


def extension_version() -> str:
    """As the manifest says."""
    return str(manifest()["version"])


def manifest() -> dict[str, Any]:
    """The extension's manifest."""
    with (ROOT / "blender_manifest.toml").open("rb") as file:
        return tomllib.load(file)


def version(distribution: str) -> str:
    """Of an installed distribution, without importing it."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return MISSING
