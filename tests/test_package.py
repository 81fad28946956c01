# SPDX-License-Identifier: GPL-3.0-or-later
"""The zips that ./dev package writes: what is in them, for which Python and system, and what stops the build."""

import importlib.util
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parents[1]
PYTHONS = {
    "linux_x64": {"cp311", "cp313", "cp314"},
    "windows_x64": {"cp311", "cp313"},
    "macos_arm64": {"cp311", "cp313"},
}
NATIVE = {"moderngl", "glcontext", "fast_simplification"}
LITTER = (
    "vlm_addon/notes.txt",
    "vlm_addon/core/__pycache__/scene.cpython-311.pyc",
    "operators/.bake.py.swp",
    "gpu_shaders/lib/noise.glsl.orig",
    "secrets.py",
    "build/leftover.py",
    ".venv/lib/module.py",
)


def load_package_tool():
    spec = importlib.util.spec_from_file_location("package_tool", ROOT / "tools" / "package.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def checkout_files():
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True
    )
    if listed.returncode:
        pytest.skip("not a git checkout, so there is no list of files to compare with")
    return sorted({name for name in listed.stdout.splitlines() if (ROOT / name).is_file()})


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Zip paths by platform, built in a copy of the checkout with an awkward folder name and litter in it."""
    copy = tmp_path_factory.mktemp("package") / "virtual-light mesh 2"
    for name in (*checkout_files(), *LITTER):
        target = copy / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes((ROOT / name).read_bytes() if (ROOT / name).is_file() else b"litter")
    wheels = ROOT / "wheels"
    wheels.mkdir(exist_ok=True)
    (copy / "wheels").symlink_to(wheels)
    done = subprocess.run([sys.executable, "tools/package.py"], cwd=copy, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    zips = (copy / "dist").glob("*.zip")
    return {path.stem.split("-")[-1]: path for path in zips}


def names_in(path):
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def test_there_is_one_zip_for_each_platform(built):
    assert set(built) == set(PYTHONS)


@pytest.mark.parametrize("platform", PYTHONS)
def test_a_zip_holds_the_sources_that_ship_and_nothing_else(built, platform):
    folders = {"vlm_addon": ".py", "operators": ".py", "gpu_shaders": ""}
    manual = "docs/authoring"
    roots = {"__init__.py", "blender_manifest.toml", "LICENSE", "README.md"}
    ships = {
        name
        for name in checkout_files()
        if name in roots
        or name.startswith(manual)
        or ("/" in name and name.endswith(folders.get(name.split("/")[0], "no such file")))
    }
    sources = [name for name in names_in(built[platform]) if not name.startswith("wheels/")]
    assert sorted(sources) == sorted(ships)


@pytest.mark.parametrize("platform", PYTHONS)
def test_a_zip_holds_every_native_wheel_for_every_python_of_its_platform(built, platform):
    wheels = [PurePosixPath(name).name for name in names_in(built[platform]) if name.startswith("wheels/")]
    native = {(wheel.split("-")[0], wheel.split("-")[2]) for wheel in wheels if "py3-none-any" not in wheel}
    assert native == {(name, tag) for name in NATIVE for tag in PYTHONS[platform]}


@pytest.mark.parametrize("platform", PYTHONS)
def test_the_manifest_inside_names_its_platform_and_the_wheels_beside_it(built, platform):
    with zipfile.ZipFile(built[platform]) as archive:
        generated = tomllib.loads(archive.read("blender_manifest.toml").decode())["build"]["generated"]
    assert generated["platforms"] == [platform.replace("_", "-")]
    listed = {name.removeprefix("./") for name in generated["wheels"]}
    assert listed == {name for name in names_in(built[platform]) if name.startswith("wheels/")}


def test_the_manifest_pins_the_versions_that_the_tests_use():
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    shipped = {tuple(Path(path).name.split("-")[:2]) for path in manifest["wheels"]}
    tested = tomllib.loads((ROOT / "pyproject.toml").read_text())["dependency-groups"]["runtime"]
    assert shipped == {tuple(pin.replace("-", "_").split("==")) for pin in tested}


def test_a_file_that_the_list_does_not_know_stops_the_build(tmp_path):
    tool = load_package_tool()
    path = tmp_path / "extension.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("__init__.py", "")
        archive.writestr("secrets.py", "")
    with pytest.raises(tool.PackagingError, match=r"secrets\.py"):
        tool.check_contents(path, {"__init__.py"})


def test_a_file_that_the_zip_lacks_stops_the_build(tmp_path):
    tool = load_package_tool()
    path = tmp_path / "extension.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("__init__.py", "")
    with pytest.raises(tool.PackagingError, match=r"new_folder/room\.py"):
        tool.check_contents(path, {"__init__.py", "vlm_addon/new_folder/room.py"})


def test_a_wheel_with_other_contents_than_its_checksum_stops_the_build(tmp_path, monkeypatch):
    tool = load_package_tool()
    name = "trimesh-5.2.0-py3-none-any.whl"
    (tmp_path / "wheels").mkdir()
    (tmp_path / "wheels" / name).write_bytes(b"something else")
    monkeypatch.setattr(tool, "ROOT", tmp_path)
    with pytest.raises(tool.PackagingError, match="checksum"):
        tool.fetch_wheels([tool.Wheel.parse(name)])
