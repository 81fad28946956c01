# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the sample scenes from code.

    python sample_blends/build.py all
    python sample_blends/build.py monkey_box --mesh bunny.obj --out /elsewhere
    python sample_blends/build.py city --percent 25 --out /elsewhere

Needs the bpy module. The committed files are saved by the oldest supported Blender, so that every later one opens them.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

# File name: the module that builds it and what its build function is given.
COMMITTED: dict[str, tuple[str, dict[str, Any]]] = {
    "cornell_box": ("cornell_box", {}),
    "empty_room": ("empty_room", {}),
    "monkey_box": ("monkey_box", {}),
    "atrium": ("atrium", {}),
    "lightwave_room": ("lightwave_room", {}),
    "lightwave_room_1": ("lightwave_room", {"pots": 1}),
    "lightwave_room_10": ("lightwave_room", {"pots": 10}),
    "dancer": ("dancer", {}),
    "hard_cases": ("hard_cases", {}),
}
ON_DEMAND: dict[str, tuple[str, dict[str, Any]]] = {"city": ("city", {})}
HERE = Path(__file__).resolve().parent


def share(text: str) -> float:
    """A percentage above 0 and up to 100."""
    percent = float(text)
    if not 0 < percent <= 100:
        raise argparse.ArgumentTypeError(f"{text}: give a number above 0 and up to 100")
    return percent


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """The command line; ends the process with exit code 2 on bad usage."""
    parser = argparse.ArgumentParser(description="Build the sample scenes.", epilog=__doc__.split("\n\n")[1])
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    names = (*COMMITTED, *ON_DEMAND)
    parser.add_argument("names", nargs="+", metavar="NAME", choices=[*names, "all"], help=", ".join([*names, "all"]))
    parser.add_argument("--out", type=Path, default=HERE, metavar="DIR", help="folder to write to (default: this one)")
    parser.add_argument("--mesh", type=Path, metavar="FILE", help="monkey_box: float this OBJ, PLY or glTF instead")
    parser.add_argument("--percent", type=share, default=100.0, metavar="P", help="city: share of 4 million triangles")
    return parser.parse_args(arguments)


def build(name: str, options: argparse.Namespace) -> Path:
    """Builds one scene and returns the file written."""
    from scenes import blend

    module, arguments = (COMMITTED | ON_DEMAND)[name]
    stem = name
    if name == "monkey_box" and options.mesh:
        arguments, stem = {"mesh_path": options.mesh}, f"{options.mesh.stem}_box"
    elif name == "city":
        arguments = {"percent": options.percent}
    importlib.import_module(f"scenes.{module}").build(**arguments)
    path = options.out / f"{stem}.blend"
    blend.save(str(path))
    return path


def main(arguments: Sequence[str]) -> int:
    """Builds what is asked for; `all` means the committed scenes."""
    options = parse(arguments)
    names = list(COMMITTED) if "all" in options.names else options.names
    options.out.mkdir(parents=True, exist_ok=True)
    for name in names:
        path = build(name, options)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
