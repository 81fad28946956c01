# SPDX-License-Identifier: GPL-3.0-or-later
import pytest

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.whole_file import atomic_output


def test_an_output_that_fails_leaves_nothing(tmp_path):
    target = tmp_path / "out.txt"
    target.write_text("before")

    def fail():
        with atomic_output(target) as temporary:
            temporary.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert [item.name for item in tmp_path.iterdir()] == ["out.txt"]
    assert target.read_text() == "before"


def test_an_output_appears_by_rename_with_ordinary_rights(tmp_path):
    target = tmp_path / "out.txt"
    with atomic_output(target) as temporary:
        assert temporary.suffix == ".txt"
        temporary.write_text("whole")
        assert not target.exists()
    ordinary = tmp_path / "ordinary"
    ordinary.write_text("")
    assert target.stat().st_mode == ordinary.stat().st_mode
    assert target.read_text() == "whole"


def test_a_path_that_takes_no_file_is_refused_and_left_as_it_was(tmp_path):
    for path in (tmp_path, tmp_path / "missing" / "out.txt"):
        with pytest.raises(InvalidInput, match="cannot be written") as caught, atomic_output(path):
            pass
        assert caught.value.subject == str(path)
    assert [*tmp_path.iterdir()] == []


def test_a_trial_leaves_nothing(tmp_path):
    with atomic_output(tmp_path / "out.txt", keep=False) as temporary:
        temporary.write_text("whole")
    assert [*tmp_path.iterdir()] == []
