# SPDX-License-Identifier: GPL-3.0-or-later
"""Dependencies point one way: the table of docs/architecture.md, held by walking every import."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "vlm_addon"

BLENDER = {"bpy", "bmesh", "mathutils", "gpu", "bpy_extras", "addon_utils", "blf", "bl_ext"}
GL = {"moderngl", "glcontext"}
FORBIDDEN = {
    "core": (BLENDER | GL, {"render", "gltf", "measure", "blender"}),
    "render": (BLENDER, {"gltf", "measure", "blender"}),
    "gltf": (BLENDER | GL, {"render", "measure", "blender"}),
    "measure": (BLENDER, {"blender"}),
    "blender": (GL, set()),
}


def imports(path):
    """(absolute top-level module names, vlm_addon sub-packages, relative levels beyond the package) of one file."""
    outside, inside, above = set(), set(), []
    depth = len(path.relative_to(PACKAGE).parts) if path.is_relative_to(PACKAGE) else 0
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            outside |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            outside.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.ImportFrom) and depth:
            if node.level > depth:
                above.append(node.lineno)
                continue
            base = path.relative_to(PACKAGE).parts[: depth - node.level]
            parts = [*base, *(node.module or "").split(".")]
            targets = [parts] if node.module else [[*base, alias.name] for alias in node.names]
            inside |= {target[0] for target in targets if target and target[0]}
    return outside, inside, above


def files(folder):
    return sorted((PACKAGE / folder).rglob("*.py"))


@pytest.mark.parametrize("layer", sorted(FORBIDDEN))
def test_a_layer_imports_only_what_lies_below_it(layer):
    modules, layers = FORBIDDEN[layer]
    for path in files(layer):
        outside, inside, _ = imports(path)
        assert not outside & modules, f"{path} imports {outside & modules}"
        assert not inside & layers, f"{path} imports the layer {inside & layers}"


def test_the_package_never_imports_above_itself_or_by_its_own_name():
    for path in sorted(PACKAGE.rglob("*.py")):
        outside, _, above = imports(path)
        assert not above, f"{path}:{above} reaches above vlm_addon"
        assert "vlm_addon" not in outside, f"{path} names vlm_addon absolutely; use a relative import"


def test_operators_hold_no_algorithms():
    for path in sorted((ROOT / "operators").rglob("*.py")):
        outside, _, _ = imports(path)
        assert not outside & ({"numpy", "trimesh", "fast_simplification"} | GL), f"{path} computes by itself"


def test_the_extension_root_needs_no_blender_to_import():
    top_level = ast.parse((ROOT / "__init__.py").read_text()).body
    assert not [node for node in top_level if isinstance(node, ast.Import | ast.ImportFrom) and _names(node) & BLENDER]


def _names(node):
    if isinstance(node, ast.Import):
        return {alias.name.split(".")[0] for alias in node.names}
    return {(node.module or "").split(".")[0]}


@pytest.mark.parametrize("suffix", [".py", ".glsl", ".vert", ".frag", ".geom", ".comp"])
def test_every_source_file_names_its_licence(suffix):
    tracked = [
        p
        for folder in ("vlm_addon", "operators", "gpu_shaders", "tests", "benchmarks", "sample_blends", "tools")
        for p in (ROOT / folder).rglob(f"*{suffix}")
    ]
    missing = [str(p) for p in tracked if "SPDX-License-Identifier: GPL-3.0-or-later" not in p.read_text()[:200]]
    assert not missing


def test_the_walk_sees_imports_inside_functions(tmp_path):
    probe = tmp_path / "probe.py"
    probe.write_text("def f():\n    import bpy.types\n")
    assert imports(probe)[0] == {"bpy"}
