# SPDX-License-Identifier: GPL-3.0-or-later
"""Every function of `gpu_shaders/lib` is called by a test that runs it on the device."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "gpu_shaders" / "lib"
RENDER_TESTS = ROOT / "tests" / "render"

# At the start of a line, so nothing in a body: type, name, parameters, brace. Statements and macros have none of these.
FUNCTION = re.compile(r"^\w+\s+(\w+)\s*\([^;{}]*\)\s*\{", re.MULTILINE)


def functions(path):
    """Names of the functions that a GLSL file defines."""
    without_comments = re.sub(r"//.*", "", path.read_text())
    return sorted(set(FUNCTION.findall(without_comments)))


def calls(name, text):
    return re.search(rf"\b{name}\s*\(", text) is not None


@pytest.fixture(scope="module")
def test_text():
    return "\n".join(path.read_text() for path in sorted(RENDER_TESTS.glob("test_*.py")))


LIBRARY_FILES = [pytest.param(path, id=path.stem) for path in sorted(LIBRARY.glob("*.glsl"))]


@pytest.mark.parametrize("path", LIBRARY_FILES)
def test_every_function_is_called_by_a_test(path, test_text):
    assert functions(path)
    untested = [name for name in functions(path) if not calls(name, test_text)]
    assert not untested


def test_the_walk_sees_every_form_of_function(tmp_path):
    source = tmp_path / "x.glsl"
    source.write_text(
        "float one(float x) {\n    return two(x);\n}\n// float never(int i) {\n"
        "vec3 two(\n    vec3 a, inout float b\n) {\n    if (a.x > 0.0) {\n    }\n}\n"
        "struct S {\n    float x;\n};\nfloat declared(float x);\n"
    )
    assert functions(source) == ["one", "two"]


def test_only_whole_names_count_as_calls():
    assert calls("f0", "evaluate('f0(x)')")
    assert not calls("f0", "def test_f0_is(x): half_f0(x)")
