"""A file is written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from fingerlab.core.errors import UserError
from fingerlab.core.files import new_file, put_in_place, whole_file


def write_half(path: Path) -> None:
    with whole_file(path) as part:
        part.write_text("half a", encoding="utf-8")
        raise KeyError


def test_what_was_there_is_replaced_only_by_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "notes.json"
    for content in ("first", "second"):
        with whole_file(path) as part:
            assert part.parent == path.parent
            part.write_text(content, encoding="utf-8")
        assert path.read_text(encoding="utf-8") == content
    with pytest.raises(KeyError):
        write_half(path)
    assert path.read_text(encoding="utf-8") == "second"
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_takes_no_file_is_told_in_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "notes.json"
    with pytest.raises(UserError) as told, whole_file(path, "buy a disk.") as part:
        part.write_text("x", encoding="utf-8")
    assert str(told.value).startswith(f"{path} cannot be written (")
    assert str(told.value).endswith("); buy a disk.")


def test_a_file_that_cannot_be_moved_is_removed(tmp_path: Path) -> None:
    part, folder = tmp_path / "page.part", tmp_path / "page.html"
    part.write_text("x", encoding="utf-8")
    folder.mkdir()
    with pytest.raises(UserError, match=r"page\.html cannot be replaced \(.+\); choose another name\.$"):
        put_in_place(part, folder, "choose another name.", "replaced")
    assert list(tmp_path.iterdir()) == [folder]


def test_a_new_file_takes_no_other_ones_place(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    with new_file(path) as part:
        part.write_text("mine", encoding="utf-8")
        assert not path.exists()
    with pytest.raises(UserError, match="exists already"), new_file(path):
        raise AssertionError  # the body is not reached
    path.unlink()
    with pytest.raises(UserError, match="exists already"), new_file(path) as part:
        path.write_text("somebody else's", encoding="utf-8")
    assert path.read_text(encoding="utf-8") == "somebody else's"
    assert list(tmp_path.iterdir()) == [path]


def test_a_new_file_that_cannot_be_finished_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    with pytest.raises(UserError, match=r"cannot be written \(No space left on device\)"), new_file(path):
        raise OSError(28, "No space left on device")
    with pytest.raises(KeyError), new_file(path):
        raise KeyError
    assert not list(tmp_path.iterdir())
