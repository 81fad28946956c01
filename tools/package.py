# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the extension: one zip per platform, by Blender's own builder, with its contents checked against a list.

Run by `./dev package`. The wheels that the manifest names are downloaded into wheels/ and must have the checksums of
tools/wheels.sha256.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MANIFEST = ROOT / "blender_manifest.toml"
CHECKSUMS = ROOT / "tools" / "wheels.sha256"

ROOT_FILES = ("__init__.py", "blender_manifest.toml", "LICENSE", "README.md")
MANUAL = ("docs/authoring.md", "docs/authoring_*.png")
SOURCE_SUFFIXES = {
    "operators": {".py"},
    "vlm_addon": {".py"},
    "gpu_shaders": {".glsl", ".vert", ".frag", ".geom", ".comp", ".npy"},
}
WHEEL_MACHINES = {"linux-x64": "_x86_64", "windows-x64": "win_amd64", "macos-arm64": "_arm64"}


class PackagingError(Exception):
    """The zips could not be built or do not hold what they should; one sentence says why."""


@dataclass(frozen=True)
class Wheel:
    """A wheel's file name, taken apart: distribution, version, python tag and platform tags."""

    name: str
    distribution: str
    version: str
    python_tag: str
    platform_tags: tuple[str, ...]

    @classmethod
    def parse(cls, name: str) -> Wheel:
        """The parts of `name`, `distribution-version-python-abi-platform.platform….whl`."""
        distribution, version, python_tag, _abi, platforms = name.removesuffix(".whl").split("-")
        return cls(name, distribution, version, python_tag, tuple(platforms.split(".")))

    def runs_on(self, platform: str) -> bool:
        """Whether Blender's `platform` can load the wheel."""
        return any(tag == "any" or tag.endswith(WHEEL_MACHINES[platform]) for tag in self.platform_tags)


def main(arguments: list[str] | None = None) -> int:
    """Write the zips; 0 when all hold exactly what they should, 1 with a message otherwise."""
    parser = argparse.ArgumentParser(description="Build one extension zip per platform.")
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder for the zips (default: dist)")
    options = parser.parse_args(arguments)
    try:
        for path in build(options.output):
            print(f"{path}  {path.stat().st_size / 1e6:.2f} MB")
    except PackagingError as error:
        print(f"package: {error}", file=sys.stderr)
        return 1
    return 0


def build(output: Path) -> list[Path]:
    """The zips, written to `output`, one per platform of the manifest. Raises PackagingError."""
    manifest = tomllib.loads(MANIFEST.read_text())
    wheels = [Wheel.parse(Path(path).name) for path in manifest["wheels"]]
    fetch_wheels(wheels)
    output.mkdir(parents=True, exist_ok=True)
    run_blender_extension_command("build", "--source-dir", ROOT, "--output-dir", output, "--split-platforms")
    stem = f"{manifest['id']}-{manifest['version']}"
    zips = []
    for platform in manifest["platforms"]:
        path = output / f"{stem}-{platform.replace('-', '_')}.zip"
        check_contents(path, expected_contents(wheels, platform))
        run_blender_extension_command("validate", path)
        zips.append(path)
    return zips


def fetch_wheels(wheels: Iterable[Wheel]) -> None:
    """Download what wheels/ lacks and compare every wheel with its checksum. Raises PackagingError."""
    folder = ROOT / "wheels"
    folder.mkdir(exist_ok=True)
    missing = [wheel for wheel in wheels if not (folder / wheel.name).exists()]
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda wheel: _download(wheel, folder), missing))
    checksums = {name: checksum for checksum, name in map(str.split, CHECKSUMS.read_text().splitlines())}
    for wheel in wheels:
        path = folder / wheel.name
        if not path.exists():
            raise PackagingError(f"pip did not find {wheel.name}")
        if wheel.name not in checksums:
            raise PackagingError(f"{CHECKSUMS.name} has no line for {wheel.name}")
        if hashlib.sha256(path.read_bytes()).hexdigest() != checksums[wheel.name]:
            raise PackagingError(f"wheels/{wheel.name} does not have its checksum; delete it and try again")


def _download(wheel: Wheel, folder: Path) -> None:
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    command += ["--only-binary=:all:", "--dest", str(folder)]
    if wheel.python_tag != "py3":
        command += ["--implementation", "cp", "--python-version", wheel.python_tag.removeprefix("cp")]
        command += [f"--platform={tag}" for tag in wheel.platform_tags]
    _run([*command, f"{wheel.distribution}=={wheel.version}"])


def expected_contents(wheels: Iterable[Wheel], platform: str) -> set[str]:
    """Paths inside the zip of `platform`: the allow-list of what ships."""
    contents = {name for name in ROOT_FILES if (ROOT / name).exists()}
    contents |= {path.relative_to(ROOT).as_posix() for pattern in MANUAL for path in ROOT.glob(pattern)}
    for folder, suffixes in SOURCE_SUFFIXES.items():
        sources = (path for path in (ROOT / folder).rglob("*") if path.suffix in suffixes)
        contents |= {path.relative_to(ROOT).as_posix() for path in sources}
    return contents | {f"wheels/{wheel.name}" for wheel in wheels if wheel.runs_on(platform)}


def check_contents(path: Path, expected: set[str]) -> None:
    """Raises PackagingError unless the zip holds exactly the files `expected`, each once."""
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    missing, extra = sorted(expected - set(names)), sorted(set(names) - expected)
    if missing or extra or len(names) != len(set(names)):
        problem = f"lacks {missing or 'nothing'}, has {extra or 'nothing'} too much"
        raise PackagingError(f"{path.name}: {problem}; correct paths_exclude_pattern in {MANIFEST.name}")


def run_blender_extension_command(*arguments: object) -> None:
    """Run `blender --command extension …` from the installed bpy wheel. Raises PackagingError with its output."""
    bpy = importlib.util.find_spec("bpy")
    if bpy is None or bpy.origin is None:
        raise PackagingError("the bpy wheel is not installed; run this through ./dev package")
    (tool,) = Path(bpy.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    _run([sys.executable, str(tool), *map(str, arguments)])


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise PackagingError(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")


if __name__ == "__main__":
    sys.exit(main())
