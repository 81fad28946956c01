# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader sources from `gpu_shaders/`: includes, constants from Python, and compile errors with file and line.

A shader file has no `#version` line (the library puts it) and may contain `#include "lib/x.glsl"` (path from
`gpu_shaders/`, included once) and `#include "gpu_layout/Name"` (a struct of `gpu_layout.STRUCTS`).
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ..core.errors import ShaderError
from . import gpu_layout

if TYPE_CHECKING:
    import moderngl

SHADER_ROOT = Path(__file__).resolve().parents[2] / "gpu_shaders"
GLSL_VERSION = 430
# Lines of the nth file of a source are numbered from n times this: drivers forget the source number that `#line`
# may carry (Mesa for undeclared names), never the line.
LINES_PER_FILE = 10_000
LAYOUT_PREFIX = "gpu_layout/"

_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"\s*$')
# "0:12(5): error" (Mesa), "0(12) : error" (NVIDIA), "ERROR: 0:12:" (Intel, Apple, ANGLE)
_LOCATION = re.compile(r"(?<![\w.])\d+(?::(\d+)(?:\(\d+\))?|\((\d+)\))\s*:")

Built = TypeVar("Built")
Defines = Mapping[str, int | float | bool | str]


class ShaderLibrary:
    """Compiles the programs of one context and keeps each variant once."""

    def __init__(self, context: moderngl.Context, root: Path = SHADER_ROOT) -> None:
        self._context = context
        self._root = root
        self._compute: dict[tuple, moderngl.ComputeShader] = {}
        self._programs: dict[tuple, moderngl.Program] = {}
        self._words: dict[str, frozenset[str]] = {}
        self._common: dict[str, int | float | bool | str] = {}

    def with_common(self, defines: Defines) -> ShaderLibrary:
        """The same library, whose shaders are compiled with `defines` where they name them; both share what was
        compiled."""
        other = copy.copy(self)
        other._common = dict(defines)
        return other

    def compute(self, path: str, defines: Defines | None = None) -> moderngl.ComputeShader:
        """The compute shader of file `path`. Raises ShaderError."""
        defines = self._all_defines([path], defines)
        key = (path, _key(defines))
        if key not in self._compute:
            self._compute[key] = self.compute_from_text(f'#include "{path}"\n', path, defines)
        return self._compute[key]

    def compute_from_text(self, text: str, name: str, defines: Defines | None = None) -> moderngl.ComputeShader:
        """A compute shader from text (with includes), not kept; `name` stands for the text in messages."""
        source, files = self.expand(text, name, defines)
        return self._build(lambda: self._context.compute_shader(source), [files])

    def program(self, vertex: str, fragment: str | None, defines: Defines | None = None) -> moderngl.Program:
        """The program of a vertex and a fragment shader file; fragment None for depth only. Raises ShaderError."""
        defines = self._all_defines([vertex, *([] if fragment is None else [fragment])], defines)
        key = (vertex, fragment, _key(defines))
        if key not in self._programs:
            vertex_source, vertex_files = self.expand(f'#include "{vertex}"\n', vertex, defines)
            fragment_text = "void main() {}" if fragment is None else f'#include "{fragment}"\n'
            fragment_source, fragment_files = self.expand(fragment_text, fragment or "no fragment shader", defines)
            self._programs[key] = self._build(
                lambda: self._context.program(vertex_shader=vertex_source, fragment_shader=fragment_source),
                [vertex_files, fragment_files],
            )
        return self._programs[key]

    def _all_defines(self, paths: list[str], defines: Defines | None) -> Defines | None:
        """`defines` with those of the common ones that one of the files, or what it includes, names."""
        named = set().union(*(self._words_of(path) for path in paths)) if self._common else set()
        return {**{name: value for name, value in self._common.items() if name in named}, **(defines or {})}

    def _words_of(self, path: str) -> frozenset[str]:
        if path not in self._words:
            lines = self._expanded_lines(f'#include "{path}"', 0, [path], set())
            self._words[path] = frozenset(re.findall(r"\w+", "\n".join(lines)))
        return self._words[path]

    def expand(self, text: str, name: str, defines: Defines | None = None) -> tuple[str, list[str]]:
        """Complete GLSL source of `text`, and its files in the order of their line numbers' thousands."""
        files = [name]
        lines = [f"#version {GLSL_VERSION} core"]
        constants: Defines = {**gpu_layout.CONSTANTS, **(defines or {})}
        lines += [f"#define {key} {_literal(value)}" for key, value in sorted(constants.items())]
        lines += ["#line 1", *self._expanded_lines(text, 0, files, set())]
        return "\n".join(lines) + "\n", files

    def _expanded_lines(self, text: str, file_index: int, files: list[str], included: set[str]) -> list[str]:
        lines: list[str] = []
        for number, line in enumerate(text.splitlines(), start=1):
            match = _INCLUDE.match(line)
            if match is None:
                lines.append(line)
                continue
            path = match.group(1)
            if path in included:
                lines.append("")
                continue
            included.add(path)
            files.append(path)
            index = len(files) - 1
            body = self._read(path, f"{files[file_index]}:{number}")
            lines += [f"#line {index * LINES_PER_FILE + 1}", *self._expanded_lines(body, index, files, included)]
            lines.append(f"#line {file_index * LINES_PER_FILE + number + 1}")
        return lines

    def _read(self, path: str, where: str) -> str:
        if path.startswith(LAYOUT_PREFIX):
            struct = gpu_layout.STRUCTS.get(path.removeprefix(LAYOUT_PREFIX))
            if struct is None:
                raise ShaderError(f"{where}: no struct {path!r}; known: {', '.join(sorted(gpu_layout.STRUCTS))}")
            return struct.glsl
        try:
            return (self._root / path).read_text(encoding="utf-8")
        except OSError:
            raise ShaderError(f"{where}: shader file {path!r} is missing from {self._root.name}/") from None

    def _build(self, make: Callable[[], Built], file_tables: list[list[str]]) -> Built:
        import moderngl

        try:
            return make()
        except moderngl.Error as error:
            files = file_tables[0]
            if len(file_tables) > 1 and "fragment_shader" in str(error):
                files = file_tables[1]
            raise ShaderError(named_locations(str(error), files)) from None


def set_uniforms(program: moderngl.Program | moderngl.ComputeShader, values: Mapping[str, Any]) -> None:
    """Sets uniforms by name: numbers, booleans, vectors, and (4, 4) matrices that map column vectors.

    A name that the program has not, because a variant does not use it, is left out.
    """
    members: Any = program
    for name, value in values.items():
        if name not in members:
            continue
        if np.ndim(value) == 2:
            members[name].write(gpu_layout.matrix_block(value).tobytes())
        else:
            members[name].value = tuple(value) if np.ndim(value) else value


def named_locations(message: str, files: list[str]) -> str:
    """A driver's message in one line, each `source:line` in it written as `file:line`."""

    def name(match: re.Match[str]) -> str:
        index, line = divmod(int(match.group(1) or match.group(2)), LINES_PER_FILE)
        return f"{files[index]}:{line}:" if index < len(files) else match.group(0)

    lines = [line.strip() for line in message.splitlines()]
    return "; ".join(_LOCATION.sub(name, line) for line in lines if line and not set(line) <= {"="})


def _key(defines: Defines | None) -> tuple:
    return tuple(sorted((defines or {}).items()))


def _literal(value: int | float | bool | str) -> str:
    if isinstance(value, bool):
        return str(int(value))
    return repr(float(value)) if isinstance(value, float) else str(value)
