"""What the browser knows of files, against files written by plain h5py."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import pytest

from fingerlab.batch.table import Contents, complete, write_table
from fingerlab.core.errors import UserError
from fingerlab.library.index import SessionFacts, read_facts, scan
from fingerlab.library.notes import FILE_NAME, LibraryEntry, Note, Notebook, find_verdicts, matches
from fingerlab.library.reviewing import make_thumbnail
from fingerlab.sessions.recording_files import session_files


def test_facts_say_what_the_file_says(make_session) -> None:  # type: ignore[no-untyped-def]
    def spoil(file: h5py.File) -> None:
        file.attrs["tags"] = '["good", "new cable"]'
        file.attrs["operator"] = "Zoë"
        file["runs/001"].attrs["late_cycles"] = 12
        file["runs/002"].attrs["late_cycles"] = 3
        file["runs/002"].attrs["complete"] = 0

    facts = read_facts(make_session("a.h5", spoil), "a.h5")
    assert (facts.runs, facts.seconds) == (2, 8.0)
    assert facts.phases == ("on_air", "contact")
    assert facts.tags == ("good", "new cable")
    assert facts.operator == "Zoë"
    assert facts.flags == ("1 of 2 runs not complete", "15 late cycles")
    assert facts.when is not None
    assert f"{facts.when:%H:%M}" == "09:00"  # the clock of the bench, not of this machine


def test_a_scan_finds_the_tree_and_opens_only_what_changed(make_session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "may").mkdir()
    (tmp_path / ".hidden").mkdir()
    make_session("may/b.h5")
    make_session("a.h5")
    make_session(".hidden/c.h5")
    (tmp_path / "broken.hdf5").write_text("no session", encoding="utf-8")
    first = scan(tmp_path)
    assert [one.name for one in first] == ["a.h5", "broken.hdf5", "may/b.h5"]
    assert "not an HDF5 file" in first[1].problem
    os.utime(tmp_path / "a.h5", (1e9, 1e9))
    again = {one.name: one for one in scan(tmp_path, first)}
    assert again["may/b.h5"] is first[2]
    assert again["a.h5"] is not first[0]
    with pytest.raises(UserError, match="not a folder"):
        session_files(tmp_path / "nowhere")


FACTS = SessionFacts(
    Path("x.h5"), "may/Finger.h5", 1, 1.0, title="Ring finger", created="2026-05-04T10:00:00+02:00",
    phases=("on_air", "contact"), cables=("flexion",), runs=2, seconds=90.0, flags=("12 late cycles",),
)  # fmt: skip
ENTRY = LibraryEntry(FACTS, tags=("good",), notes="cable changed", verdict="Coulomb friction\n94 %")


@pytest.mark.parametrize(
    ("query", "found"),
    [
        ("", True),
        ("ring CABLE", True),
        ("ring missing", False),
        ("phase:contact tag:good", True),
        ("phase:motor", False),
        ("-tag:good", False),
        ("-tag:bad verdict:coulomb", True),
        ("flag:late is:bad", True),
        ("is:clean", False),
        ("after:2026-05 before:2026-05-05", True),
        ("after:2026-05-05", False),
        ("longer:60 shorter:91", True),
        ("longer:90", False),
        ('"on air"', True),
        ('"on ai', True),
    ],
)
def test_the_search_box(query: str, found: bool) -> None:
    assert matches(query)(ENTRY) is found


def test_a_query_that_is_not_understood_says_so() -> None:
    for query in ("longer:much", "is:fine", "after:may"):
        with pytest.raises(UserError, match="not understood"):
            matches(query)


def test_verdicts_come_from_a_table_in_the_folder(make_session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    make_session("a.h5")
    make_session("b.h5")
    facts = scan(tmp_path)
    row = {"session": "a.h5", "verdict": "found", "set": ["coulomb_friction"], "probability": 0.94}
    table = tmp_path / "batch.parquet"
    # A tree that was moved: the folder that the table names is no longer there.
    write_table(table, Contents(str(tmp_path / "gone"), (), (complete(row),)))
    (tmp_path / "other.parquet").write_bytes(b"not a table")
    found = find_verdicts(tmp_path, facts)
    assert list(found) == [tmp_path / "a.h5"]
    verdict = found[tmp_path / "a.h5"]
    assert (verdict.effects, verdict.probability, verdict.outdated) == (("coulomb_friction",), 0.94, False)
    os.utime(table, (1e9, 1e9))
    assert find_verdicts(tmp_path, facts)[tmp_path / "a.h5"].outdated


def test_a_thumbnail_holds_each_runs_extremes(make_session) -> None:  # type: ignore[no-untyped-def]
    found = make_thumbnail(make_session("a.h5"), columns=10)
    assert len(found.low) == len(found.high) == 10
    assert found.breaks == (0, 5)
    # 22 degrees plus and minus 14.9 degrees, from conftest.
    assert found.low.min() == pytest.approx(0.12392, abs=1e-4)
    assert found.high.max() == pytest.approx(0.64403, abs=1e-4)


def test_notes_stay_beside_the_recordings_and_follow_a_renamed_one(make_session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    path = make_session("a.h5")
    before = path.read_bytes()
    [facts] = scan(tmp_path)
    Notebook(tmp_path).write(facts, Note(("good", "Łódź"), "cable changed"))
    assert path.read_bytes() == before
    path.rename(tmp_path / "renamed.h5")
    [moved] = scan(tmp_path)
    book = Notebook(tmp_path)
    book.read()
    assert book.note_of(moved, {"renamed.h5"}) == Note(("good", "Łódź"), "cable changed")
    book.write(moved, Note(("bad",)), {"renamed.h5"})
    text = (tmp_path / FILE_NAME).read_text(encoding="utf-8")
    assert '"a.h5"' not in text
    assert "bad" in text
    book.write(moved, Note(), {"renamed.h5"})
    assert book.note_of(moved) == Note()


def test_a_side_file_that_is_not_ours_is_left_alone(make_session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    make_session("a.h5")
    [facts] = scan(tmp_path)
    side = tmp_path / FILE_NAME
    for text in ("{", '{"format": "fingerlab-library", "version": 2, "sessions": {}}'):
        side.write_text(text, encoding="utf-8")
        with pytest.raises(UserError):
            Notebook(tmp_path).write(facts, Note(("good",)))
        assert side.read_text(encoding="utf-8") == text
