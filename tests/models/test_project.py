"""Projects: what was done with sessions is there again, whatever happened while it was written."""

from __future__ import annotations

import json
import random
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import platformdirs
import pytest

from fingerlab.core.errors import UserError
from fingerlab.models import file as kept
from fingerlab.models.file import Project, TriedModel, View, load_project, project_path, save_project
from fingerlab.sessions import Session, open_session

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

WRITE = """
import sys, itertools
from dataclasses import replace
from pathlib import Path
from fingerlab.models.file import Project, save_project
print("ready", flush=True)
for number in itertools.count(1):
    save_project(Project(("day.h5",), notes=f"{number} " + "x" * 200_000), Path(sys.argv[1]))
    print(number, flush=True)
"""
UNREADABLE = ("", "[]", "{", '{"format": "x"}', '{"format": "fingerlab-project"}', "[" * 9999)
KILLS = 12
"""In a test run; fifty were taken by hand."""


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


@pytest.mark.parametrize(
    "content", ["", "[]", "{", '{"format": "x"}', '{"format": "fingerlab-project"}', "[" * 9999]
)
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
    monkeypatch.setattr(kept, "user_data_path", lambda *_, **__: tmp_path / "own")
    assert callable(platformdirs.user_data_path)
    beside = project_path([session.path])
    beside.mkdir()  # no file can have this name
    where = save_project(DONE, beside)
    assert (tmp_path / "own") in where.parents
    beside.rmdir()
    assert load_project([session]) == DONE


def test_killed_while_it_is_written_nothing_is_lost(tmp_path: Path) -> None:
    """As many kills as moments of a saving that takes some milliseconds."""
    place = tmp_path / "day.project.json"
    rng = random.Random(7)
    process = None
    for _ in range(KILLS):
        process = subprocess.Popen(
            [sys.executable, "-c", WRITE, str(place)], stdout=subprocess.PIPE, text=True
        ) if process is None or process.poll() is not None else process  # fmt: skip
        assert process.stdout is not None
        while process.stdout.readline() in ("", "ready\n"):
            assert process.poll() is None
        time.sleep(rng.random() * 0.01)
        process.kill()
        said = [line for line in process.communicate()[0].split() if line.isdigit()]
        project = json.loads(place.read_text(encoding="utf-8"))
        number = int(project["notes"].split()[0])
        assert len(project["notes"]) == len(str(number)) + 1 + 200_000
        assert number >= (int(said[-1]) if said else 1)  # what was said to be kept is there
        process = None
