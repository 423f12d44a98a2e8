"""A copy keeps what this version does not know."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.sessions import copy_session, open_session


def add_extras(file):
    file.attrs["future"] = "kept"
    file["settings/gains"] = np.eye(3)
    file["settings"].attrs["who"] = "nobody knows"
    file["runs/001/raw/load_cell"] = np.arange(4000, dtype=np.int16)
    file["runs/001/markers"] = np.arange(7)
    file["runs/002/mcp_angle"].attrs["comment"] = "new magnet"


def contents(path):
    found = {}
    with h5py.File(path) as file:

        def visit(name, item):
            hidden = ("DIMENSION_LIST", "REFERENCE_LIST")
            found[name] = {key: str(value) for key, value in item.attrs.items() if key not in hidden}
            if isinstance(item, h5py.Dataset):
                found[name]["values"] = item[()].tobytes()

        file.visititems(visit)
        found["/"] = {key: str(value) for key, value in file.attrs.items()}
    return found


def test_a_copy_is_whole(tmp_path, make_session):
    source = make_session(change=add_extras)
    target = copy_session(source, tmp_path / "copy.h5")
    assert contents(target) == contents(source)
    with h5py.File(target) as file:
        assert file["runs/001/mcp_angle"].dims[0]["time"] == file["runs/001/time"]


def test_a_copy_may_have_another_title(tmp_path, make_session):
    source = make_session(change=add_extras)
    before = source.read_bytes()
    target = copy_session(source, tmp_path / "copy.h5", {"title": "gewählt", "tags": ["a", "b"]})
    session = open_session(target)
    assert session.title == "gewählt"
    assert session.attributes["tags"] == '["a", "b"]'
    assert session.attributes["future"] == "kept"
    assert source.read_bytes() == before


def test_nothing_is_overwritten_and_nothing_bad_is_copied(tmp_path, make_session):
    source = make_session()
    (tmp_path / "there.h5").write_text("precious")
    with pytest.raises(UserError, match="exists already"):
        copy_session(source, tmp_path / "there.h5")
    (tmp_path / "bad.h5").write_text("not a session")
    with pytest.raises(UserError, match="not an HDF5 file"):
        copy_session(tmp_path / "bad.h5", tmp_path / "copy.h5")
    with pytest.raises(UserError, match="not JSON"):
        copy_session(source, tmp_path / "copy.h5", {"rig": "{broken"})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.h5", "session.h5", "there.h5"]
    assert (tmp_path / "there.h5").read_text() == "precious"
