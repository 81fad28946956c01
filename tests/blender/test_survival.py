# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes survive what artists do: random sequences of our operators and Blender's (survival_campaign.py).

After each step: no exception (in handlers neither), attributes of the table's type and length with values that lights
can have, every source found that is there and no other taken for it; after each of ours, besides: no data-block left
that nothing uses, no visible material changed, no tag newly shared by light meshes of unrelated sources, nothing
changed by a refusal; after undo and redo: the same bytes as before, in every attribute of every mesh.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy", reason="bpy is not installed in this Python")

CAMPAIGN = Path(__file__).with_name("survival_campaign.py")
ROOT = Path(__file__).resolve().parents[2]
SEQUENCES, ALL_SEQUENCES = 5, 500
MINUTES = 60
OTHER_BLENDERS = ("4.2", "4.5", "5.2")


def campaign(folder, sequences, python=sys.executable, first=0):
    """What survival_campaign.py found in so many sequences."""
    arguments = [CAMPAIGN, folder, "--sequences", str(sequences), "--first", str(first)]
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")}
    done = subprocess.run(
        [python, *arguments], capture_output=True, text=True, timeout=60 * MINUTES, env=environment, cwd=folder
    )
    assert not done.returncode, done.stdout + (folder / "campaign.log").read_text()[-3000:]
    return json.loads((folder / "campaign.json").read_text())


def sentences(told):
    return [f"{each['seed']}: {each['sentence']} after {each['steps']}" for each in told["failures"]]


def flipped_and_undone(path, saves):
    """Corners of a cube's faces before its normals are flipped in edit mode and after that is undone.

    saves: whether the file is saved in between, in edit mode.
    """

    def corners():
        bpy.context.view_layer.update()
        return [tuple(face.vertices) for face in bpy.context.object.data.polygons]

    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.ed.undo_push(message="cube")
    before = corners()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.flip_normals()
    bpy.ops.ed.undo_push(message="flipped")
    if saves:
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.ed.undo()
    return before, corners()


def test_blender_alone_loses_what_an_edited_mesh_was_before_once_the_file_is_saved(tmp_path):
    """Why the campaign does not compare such meshes at earlier steps: where this fails, Blender has mended it."""
    assert not dir(bpy.ops.vlm)
    before, after = flipped_and_undone(tmp_path / "cube.blend", saves=False)
    assert after == before
    before, after = flipped_and_undone(tmp_path / "cube.blend", saves=True)
    assert after != before


def test_a_few_sequences_survive(tmp_path):
    assert not sentences(campaign(tmp_path, SEQUENCES))


@pytest.mark.full
def test_hundreds_of_sequences_survive_and_every_operator_did_its_work_in_them(tmp_path):
    told = campaign(tmp_path, ALL_SEQUENCES)
    assert not sentences(told)
    met = {name.split()[0] for name in told["results"]}
    worked = {name.removesuffix(" FINISHED") for name in told["results"] if name.endswith(" FINISHED")}
    assert met == worked


@pytest.mark.full
@pytest.mark.parametrize("version", OTHER_BLENDERS)
def test_sequences_survive_in_other_versions_of_blender(version, tmp_path):
    python = Path(os.environ.get(f"VLM_PYTHON_{version.replace('.', '_')}", ROOT / f".venv-{version}/bin/python"))
    if not python.exists():
        pytest.skip(f"no Python with the bpy wheel {version} at .venv-{version}")
    assert not sentences(campaign(tmp_path, SEQUENCES * 8, python, first=ALL_SEQUENCES))
