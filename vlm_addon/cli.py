# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line, the same as `python -m vlm_addon` and as `blender --command vlm`.

Exit codes: 0 done; 1 failed; 2 bad usage or bad input; 3 findings (`check`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from .core.errors import VlmError

EXIT_DONE, EXIT_FAILED, EXIT_BAD_INPUT, EXIT_FINDINGS = 0, 1, 2, 3

EXAMPLES = """examples:
  vlm bake hall.blend --triangles 2000 --tolerance 0.02 --save hall_vlm.blend --json hall.json
  vlm render hall_vlm.blend --technique vlm --size 960x540 --out hall.png
  vlm check hall_vlm.blend
  vlm techniques
  vlm effects hall_vlm.blend

vlm is `python -m vlm_addon` or `blender --background --command vlm`.
"""


def main(argv: Sequence[str]) -> int:
    """Run one command; returns its exit code. Errors are one line on standard error."""
    arguments = _parser().parse_args(list(argv))
    try:
        return int(arguments.run(arguments))
    except VlmError as error:
        _complain(str(error))
        return error.exit_code
    except KeyboardInterrupt:
        _complain("interrupted")
        return EXIT_FAILED


def _complain(problem: str) -> None:
    """One line on standard error, in place of a progress bar."""
    start = "\r\033[K" if sys.stderr.isatty() else ""
    print(f"{start}error: {problem}", file=sys.stderr)


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line instead of repeating the usage."""

    def error(self, message: str) -> NoReturn:
        _complain(f"{message}; see {self.prog} --help")
        sys.exit(EXIT_BAD_INPUT)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="vlm",
        description="Virtual Light Meshes: bake, render and check scenes without a window.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_bake(commands)
    _add_render(commands)
    _add_check(commands)
    _add_techniques(commands)
    _add_effects(commands)
    return parser


def _add_bake(commands: argparse._SubParsersAction[_Parser]) -> None:
    text = "create the light mesh where the scene has none (or anew with --triangles), check it, write it"
    command = _command(commands, "bake", text, "vlm bake hall.blend --triangles 2000 --save hall_vlm.blend")
    _scene_options(command)
    command.add_argument("--triangles", type=int, metavar="N", help="virtual lights to make; replaces generated ones")
    split_help = "of those, the share spent on halving the largest lights, so that walls are not two lights each (0)"
    command.add_argument("--split", type=float, metavar="SHARE", help=split_help)
    command.add_argument("--grid", type=int, metavar="N", help="cells along each side of the light grid, with --range")
    mode = command.add_mutually_exclusive_group()
    tolerance_help = (
        "most error of the light grid, as a share of the irradiance; the scene's own setting without (0.02)"
    )
    mode.add_argument("--tolerance", type=float, metavar="E", help=tolerance_help)
    range_help = "a light grid that drops lights farther away than so many of their radii, instead of a tolerance"
    mode.add_argument("--range", type=float, metavar="R", help=range_help)
    command.add_argument("--max-lights", type=int, metavar="K", help="most lights in a cell, with --range")
    grid_help = (
        "the light grid as a file; with --range, OUT.npz holds the thesis's lists of one size for other programs"
    )
    command.add_argument("--light-grid", type=Path, metavar="OUT.vlmgrid", help=grid_help)
    visibility_help = "bake what surfaces see of each light, too, into the light grid's file and the report"
    command.add_argument("--visibility", action="store_true", help=visibility_help)
    command.add_argument("--save", type=Path, metavar="OUT.blend", help="the scene with its light mesh and settings")
    command.add_argument("--json", type=Path, metavar="REPORT.json", help="what was made, measured and found")
    command.set_defaults(run=_bake)


def _add_render(commands: argparse._SubParsersAction[_Parser]) -> None:
    text = "one picture by one technique"
    command = _command(
        commands, "render", text, "vlm render hall_vlm.blend --technique vlm --out hall.exr --samples 64"
    )
    _scene_options(command)
    command.add_argument("--technique", required=True, metavar="NAME", help="one of `vlm techniques`")
    command.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a setting of the technique")
    _effect_option(command)
    command.add_argument("--size", type=_size, metavar="WxH", help="pixels; as the scene says without")
    command.add_argument("--samples", type=int, default=16, metavar="N", help="jittered pictures averaged (16)")
    shadow_help = "points of each soft lamp, for its penumbra (32)"
    command.add_argument("--shadow-samples", type=int, default=32, metavar="N", help=shadow_help)
    world_help = "directions that stand for the world's light, each with a shadow map; the scene's own setting without"
    command.add_argument("--world-lights", type=int, metavar="N", help=world_help)
    view_help = (
        "view transform of a PNG; the scene's without; local: an exposure of its own and less contrast between bright "
        "and dark parts, so that both show their textures"
    )
    command.add_argument("--view", metavar="NAME", help=view_help)
    all_help = "run all that is enabled anew, also what would change nothing: what the plan of effects saves"
    command.add_argument("--everything", action="store_true", help=all_help)
    command.add_argument("--out", type=Path, required=True, metavar="IMG", help=".exr (linear Rec.709) or .png")
    command.add_argument("--buffers", type=Path, metavar="DIR", help="every intermediate image as EXR into a folder")
    command.add_argument("--json", type=Path, metavar="REPORT.json", help="times, counts and findings")
    command.set_defaults(run=_render)


def _add_check(commands: argparse._SubParsersAction[_Parser]) -> None:
    text = "what is wrong with the scene's light mesh; exit code 3 if anything is"
    command = _command(commands, "check", text, "vlm check hall_vlm.blend --json findings.json")
    _scene_options(command)
    command.add_argument("--json", type=Path, metavar="REPORT.json", help="the findings")
    command.set_defaults(run=_check)


def _add_techniques(commands: argparse._SubParsersAction[_Parser]) -> None:
    command = _command(commands, "techniques", "techniques with their settings and defaults", "vlm techniques")
    command.add_argument("--json", type=Path, metavar="REPORT.json", help="the same, machine-readable")
    command.set_defaults(run=_techniques)


def _add_effects(commands: argparse._SubParsersAction[_Parser]) -> None:
    text = "which effects this scene calls for, and why"
    command = _command(commands, "effects", text, "vlm effects hall_vlm.blend --json plan.json")
    _scene_options(command)
    command.add_argument("--technique", metavar="NAME", help="one of `vlm techniques`; the scene's without")
    command.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a setting of the technique")
    _effect_option(command)
    command.add_argument("--size", type=_size, metavar="WxH", help="pixels; as the scene says without")
    command.add_argument("--json", type=Path, metavar="REPORT.json", help="the plan")
    command.set_defaults(run=_effects)


def _effect_option(command: argparse.ArgumentParser) -> None:
    effect_help = (
        "an effect, auto, on or off, or one of its settings, as in ambient_occlusion=on or "
        "ambient_occlusion.radius=0.1; `vlm effects` lists them"
    )
    command.add_argument("--effect", action="append", default=[], metavar="NAME=VALUE", help=effect_help)


def _command(
    commands: argparse._SubParsersAction[_Parser], name: str, text: str, example: str
) -> argparse.ArgumentParser:
    return commands.add_parser(name, help=text, description=text, epilog=f"example: {example}")


def _scene_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("scene", type=Path, metavar="SCENE.blend", help="opened by this command, never changed")
    command.add_argument("--frame", type=int, metavar="N", help="frame; the file's current one without")
    command.add_argument(
        "--scene", dest="scene_name", metavar="NAME", help="scene of the file; its current one without"
    )
    command.add_argument("--view-layer", metavar="NAME", help="view layer; the scene's first without")
    command.add_argument("--camera", metavar="NAME", help="camera object; the scene's without")
    command.add_argument("--viewport-levels", action="store_true", help="modifiers as in the viewport")


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT, as in 960x540")
    return int(width), int(height)


def _bake(arguments: argparse.Namespace) -> int:
    from .blender.commands import bake_command

    bake_command(arguments)
    return EXIT_DONE


def _render(arguments: argparse.Namespace) -> int:
    from .blender.render_commands import render_command

    render_command(arguments)
    return EXIT_DONE


def _check(arguments: argparse.Namespace) -> int:
    from .blender.commands import check_command

    return EXIT_FINDINGS if check_command(arguments) else EXIT_DONE


def _techniques(arguments: argparse.Namespace) -> int:
    from .blender.render_commands import techniques_command

    techniques_command(arguments)
    return EXIT_DONE


def _effects(arguments: argparse.Namespace) -> int:
    from .blender.render_commands import effects_command

    effects_command(arguments)
    return EXIT_DONE
