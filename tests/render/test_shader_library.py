# SPDX-License-Identifier: GPL-3.0-or-later
"""Includes, constants, struct layouts and messages of the shader library."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest

from vlm_addon.core.errors import ShaderError
from vlm_addon.render import gpu_layout
from vlm_addon.render.device import Device
from vlm_addon.render.shader_library import SHADER_ROOT, ShaderLibrary, named_locations

OUTPUT = "layout(std430, binding = 0) buffer Out { float result[]; };\nlayout(local_size_x = 1) in;\n"
# Components of each GLSL type, as the expression that flattens it starts.
COMPONENTS = {"float": 1, "int": 1, "uint": 1, "vec2": 2, "vec3": 3, "vec4": 4, "ivec2": 2, "ivec4": 4, "uvec4": 4}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "two.glsl").write_text("float two() { return 2.0; }\n")
    (tmp_path / "lib" / "four.glsl").write_text('#include "lib/two.glsl"\nfloat four() { return two() + two(); }\n')
    return tmp_path


def run_shader(device: Device, library: ShaderLibrary, text: str, count: int = 1) -> np.ndarray:
    with device.current() as context:
        buffer = context.buffer(reserve=4 * count)
        shader = library.compute_from_text(OUTPUT + text, "test.comp")
        buffer.bind_to_storage_buffer(0)
        shader.run(1)
        return np.frombuffer(buffer.read(), np.float32)


def test_a_file_is_included_once_however_often_it_is_named(device: Device, root: Path) -> None:
    text = '#include "lib/two.glsl"\n#include "lib/four.glsl"\n#include "lib/two.glsl"\n'
    library = ShaderLibrary(device.context, root)
    assert run_shader(device, library, text + "void main() { result[0] = four() + two(); }")[0] == 6.0


def test_an_include_that_names_itself_ends(root: Path, device: Device) -> None:
    (root / "lib" / "self.glsl").write_text('#include "lib/self.glsl"\nfloat one() { return 1.0; }\n')
    library = ShaderLibrary(device.context, root)
    assert run_shader(device, library, '#include "lib/self.glsl"\nvoid main() { result[0] = one(); }')[0] == 1.0


@pytest.mark.parametrize(
    ("value", "literal"), [(3, "3"), (-2, "-2"), (0.5, "0.5"), (1e-30, "1e-30"), (True, "1"), (False, "0")]
)
def test_constants_of_python_reach_the_shader(device: Device, root: Path, value: float, literal: str) -> None:
    library = ShaderLibrary(device.context, root)
    source, _ = library.expand("", "x", {"VALUE": value})
    assert f"#define VALUE {literal}\n" in source


def test_shared_constants_are_there_without_asking(device: Device, root: Path) -> None:
    text = "void main() { result[0] = float(MATERIAL_BINDING); }"
    result = run_shader(device, ShaderLibrary(device.context, root), text)
    assert result[0] == gpu_layout.CONSTANTS["MATERIAL_BINDING"]


@pytest.mark.parametrize(
    ("file", "line"),
    [("test.comp", 6), ("lib/four.glsl", 2), ("lib/two.glsl", 1)],
    ids=["after the includes", "in an include", "in a nested include"],
)
def test_a_compile_error_names_file_and_line(device: Device, root: Path, file: str, line: int) -> None:
    text = ['#include "lib/four.glsl"', '#include "lib/two.glsl"', "", "void main() {", "    float x = four();", "}"]
    if file == "test.comp":
        text[5] = "    unknown_name = x; }"
    else:
        lines = (root / file).read_text().splitlines()
        lines[line - 1] = "float broken() { return unknown_name; }" + lines[line - 1]
        (root / file).write_text("\n".join(lines))
    library = ShaderLibrary(device.context, root)
    with pytest.raises(ShaderError, match=f"{file}:{line}: .*unknown_name"), device.current():
        library.compute_from_text("\n".join(text), "test.comp")


@pytest.mark.parametrize("stage", ["vert", "frag"])
def test_the_stage_at_fault_is_named(device: Device, root: Path, stage: str) -> None:
    (root / "a.vert").write_text("void main() { gl_Position = vec4(0.0); }\n")
    (root / "a.frag").write_text("out vec4 color;\nvoid main() { color = vec4(1.0); }\n")
    lines = (root / f"a.{stage}").read_text().splitlines()
    (root / f"a.{stage}").write_text("\n".join([*lines, "", "float f() { return unknown_name; }"]))
    library = ShaderLibrary(device.context, root)
    with pytest.raises(ShaderError, match=rf"a\.{stage}:{len(lines) + 2}: "), device.current():
        library.program("a.vert", "a.frag")


def test_a_link_error_is_a_shader_error(device: Device, root: Path) -> None:
    (root / "a.vert").write_text("out vec2 uv; void main() { uv = vec2(0.0); gl_Position = vec4(0.0); }\n")
    (root / "a.frag").write_text("in vec3 uv; out vec4 color; void main() { color = vec4(uv, 1.0); }\n")
    with pytest.raises(ShaderError, match="uv"), device.current():
        ShaderLibrary(device.context, root).program("a.vert", "a.frag")


@pytest.mark.parametrize("path", ["lib/missing.glsl", "gpu_layout/Missing"])
def test_a_missing_include_names_who_wanted_it(device: Device, root: Path, path: str) -> None:
    (root / "lib" / "wants.glsl").write_text(f'\n#include "{path}"\n')
    with pytest.raises(ShaderError, match=r"lib/wants\.glsl:2: .*issing"):
        ShaderLibrary(device.context, root).expand('#include "lib/wants.glsl"', "test.comp")


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("0:12(5): error: x", "a.comp:12: error: x"),
        ("0(10007) : error C1008: x", "lib/b.glsl:7: error C1008: x"),
        ("ERROR: 0:10003: 'x' : undeclared", "ERROR: lib/b.glsl:3: 'x' : undeclared"),
        ("0:90003: unknown file", "0:90003: unknown file"),
    ],
    ids=["Mesa", "NVIDIA", "Intel and ANGLE", "a number of no file"],
)
def test_locations_of_every_driver_are_understood(message: str, expected: str) -> None:
    assert named_locations(message, ["a.comp", "lib/b.glsl"]) == expected


def test_each_variant_is_compiled_once(device: Device, root: Path) -> None:
    (root / "a.comp").write_text("layout(local_size_x = SIZE) in; void main() {}\n")
    library = ShaderLibrary(device.context, root)
    with device.current():
        first = library.compute("a.comp", {"SIZE": 4})
        assert library.compute("a.comp", {"SIZE": 4}) is first
        assert library.compute("a.comp", {"SIZE": 8}) is not first


@pytest.mark.parametrize("struct", gpu_layout.STRUCTS.values(), ids=lambda struct: struct.name)
def test_numpy_and_the_gpu_agree_where_every_field_lies(device: Device, struct: gpu_layout.GpuStruct) -> None:
    """The second record of an array: offsets inside and the stride are both right."""
    records = struct.zeros(2)
    expected: list[float] = []
    writes: list[str] = []
    for glsl_type, name in struct.fields:
        components = COMPONENTS[glsl_type]
        values = np.arange(components) + len(expected) + 1
        records[name][1] = values if components > 1 else values[0]
        for k in range(components):
            part = f"records[1].{name}" + (f"[{k}]" if components > 1 else "")
            writes.append(f"result[{len(expected)}] = float({part});")
            expected.append(float(values[k]))
    text = (
        f'#include "gpu_layout/{struct.name}"\n'
        f"layout(std430, binding = 1) readonly buffer Records {{ {struct.name} records[]; }};\n"
        f"void main() {{ {' '.join(writes)} }}"
    )
    with device.current() as context:
        buffer: moderngl.Buffer = context.buffer(records.tobytes())
        buffer.bind_to_storage_buffer(1)
        result = run_shader(device, device.shaders, text, len(expected))
    assert result.tolist() == expected


def test_every_shader_file_starts_with_its_licence() -> None:
    tables = SHADER_ROOT / "tables"
    files = [path for path in SHADER_ROOT.rglob("*") if path.is_file() and tables not in path.parents]
    assert len(files) > 5
    for path in files:
        assert path.read_text(encoding="utf-8").startswith("// SPDX-License-Identifier: GPL-3.0-or-later\n"), path
