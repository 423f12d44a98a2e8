"""Projects: what was done with sessions is there again, whatever happened while it was written."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path

import pytest

from fingerlab.core.errors import UserError
from fingerlab.models.file import Project, TriedModel, View, load_project, project_path, save_project
from fingerlab.sessions import Session, open_session
from tests.faults.saving import kill_saving

DONE = Project(
    sessions=("day.h5",),
    path=(TriedModel((), 30.9), TriedModel(("cable_stretch",), 7.5)),
    now=1,
    tried=(
        TriedModel((), 30.9),
        TriedModel(("viscous_friction",), 22.0),
        TriedModel(("cable_stretch",), 7.5),
    ),
    view=View("mcp", "003", 2.5, 4.0),
    notes="Clamped anew.\nθ₁ looks odd.",
    revealed=True,
)

UNREADABLE = ("", "[]", "{", '{"format": "x"}', '{"format": "fingerlab-project"}', "[" * 9999)
KILLS = 12
"""In a test run; fifty are counted in ``docs/faults.md``."""


@pytest.fixture
def session(make_session) -> Session:  # type: ignore[no-untyped-def]
    return open_session(make_session("day.h5"))


def test_what_was_kept_is_read_back(session: Session) -> None:
    place = project_path([session.path])
    assert place == session.path.with_name("day.project.json")
    assert load_project([session]) is None
    assert save_project(DONE, place) == place
    assert load_project([session]) == DONE


def test_keys_of_later_versions_are_left_and_missing_ones_have_defaults(session: Session) -> None:
    place = project_path([session.path])
    place.write_text(
        json.dumps({"format": "fingerlab-project", "sessions": ["day.h5"], "later": 1, "now": 9})
    )
    assert load_project([session]) == Project(("day.h5",))


@pytest.mark.parametrize("content", UNREADABLE)
def test_a_damaged_project_is_told_and_kept_aside(session: Session, content: str) -> None:
    place = project_path([session.path])
    for number in (1, 2):
        place.write_text(content)
        with pytest.raises(UserError, match=r"day\.project\.json is no project that can be read"):
            load_project([session])
        assert place.with_name(f"day.project.json.damaged{number}").read_text() == content
        assert not place.exists()


def test_a_project_of_other_sessions_is_not_taken(session: Session, make_session) -> None:  # type: ignore[no-untyped-def]
    save_project(replace(DONE, sessions=("night.h5",)), project_path([session.path]))
    assert load_project([session]) is None
    both = [session, open_session(make_session("night.h5"))]
    assert project_path([one.path for one in both]).name == "day+1.project.json"


def test_where_the_folder_takes_no_file_the_users_own_does(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path / "own"))
    beside = project_path([session.path])
    beside.mkdir()  # no file can have this name
    where = save_project(DONE, beside)
    assert (tmp_path / "own") in where.parents
    beside.rmdir()
    assert load_project([session]) == DONE


def test_killed_while_it_is_written_nothing_is_lost(tmp_path: Path) -> None:
    """What lies there is whole, and no older than what was said to be kept."""
    place, chance = tmp_path / "day.project.json", random.Random(7)
    for _ in range(KILLS):
        kill = kill_saving(place, chance)
        assert kill.whole
        assert kill.found >= kill.said
