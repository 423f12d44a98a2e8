"""What the batch's summary says of sessions in which nothing is missing."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from fingerlab.batch import table
from fingerlab.batch.table import Options, SessionRow, Task
from fingerlab.cli.main import cli
from fingerlab.report.time_words import not_shown_sentence
from fingerlab.sessions import file_hash

COULOMB = "motor_coulomb_friction.coulomb"


def row(verdict: str, *effects: str) -> dict[str, Any]:
    return {"verdict": verdict, "set": list(effects)}


def test_what_no_session_could_have_shown_is_said_with_its_count() -> None:
    rows = [
        row("nothing_missing", "gravity_tilt"),
        row("nothing_missing", "gravity_tilt", "cable_stretch"),
        row("nothing_missing"),
        row("missing_effect", "coulomb_friction"),
    ]
    assert not_shown_sentence(rows) == (
        "2 sessions with nothing missing leave open, at a plausible strength: "
        "tilted base (2) and cable stretch (1)."
    )
    assert not_shown_sentence(rows[:1]).startswith("One session with nothing missing leaves open")


def test_without_such_a_session_nothing_is_said() -> None:
    assert not_shown_sentence([row("nothing_missing"), row("missing_effect", "coulomb_friction")]) == ""


def summary(
    monkeypatch: pytest.MonkeyPatch, folder: Path, rows: Sequence[Mapping[str, Any]]
) -> tuple[str, dict[str, Any]]:
    """What the command prints and its JSON, of sessions with these numbers (SI)."""
    sessions = folder / "bench"
    sessions.mkdir()
    for number in range(len(rows)):
        (sessions / f"s{number}.h5").write_text(str(number), encoding="utf-8")

    def told(tasks: Sequence[Task], options: Options) -> Iterator[SessionRow]:
        for task in tasks:
            row = {
                "session": task.name, "sha256": file_hash(Path(task.path)), "software": table.SOFTWARE,
                "options": options.key, "error": None, "seconds": 0.0, "score": 1.0, "final_score": 1.0,
                "verdict": "nothing_missing", "set": [], "set_titles": [], "final_model": [],
            }  # fmt: skip
            row |= rows[int(task.name[1:-3])]
            yield SessionRow(row, {name: "N m" for name in row if COULOMB in name})

    monkeypatch.setattr("fingerlab.cli.batch.locally", lambda _jobs: told)
    out, data = folder / "T.parquet", folder / "T.json"
    done = CliRunner().invoke(cli, ["batch", str(sessions), "--out", str(out), "--json", str(data)])
    assert done.exit_code == 0, done.output
    return done.stdout, json.loads(data.read_text(encoding="utf-8"))


def line_of(text: str, begins: str) -> str:
    return next(line for line in text.splitlines() if line.startswith(begins))


def test_the_unit_is_that_of_the_values_whatever_the_slope(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """0.5 N m that grows by 0.1 N m a day would be 3 N m more in a month."""
    rows = [
        {"created": f"2026-03-0{day}T09:00:00+00:00", f"alone.{COULOMB}": 0.1 + 0.1 * day}
        for day in range(1, 8)
    ]
    told = line_of(summary(monkeypatch, tmp_path, rows)[0], "Motor friction, Coulomb").split()
    assert told[3:7] == ["500", "mN", "m", "3043.7500"]


def test_of_sessions_of_one_day_no_change_a_month_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    rows = [
        {"created": f"2026-03-01T{hour:02d}:00:00+00:00", f"alone.{COULOMB}": 0.5 + 0.01 * hour}
        for hour in range(9, 15)
    ]
    text, data = summary(monkeypatch, tmp_path, rows)
    told = line_of(text, "Motor friction, Coulomb").split()
    assert told[3:] == ["615", "mN", "m", "–", "–", "6"]
    assert "The sessions were recorded within a day, so that no change a month is told." in text
    assert "Theil-Sen" not in text
    trend = next(one for one in data["trends"] if one["column"] == f"alone.{COULOMB}")
    assert (trend["per_month"], trend["changes"], trend["median"]) == (None, False, pytest.approx(0.615))


def test_friction_is_that_of_the_last_model_where_it_holds_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Fitted alone it takes up what is of the spring beside it: 0.9 N m in place of 0.3 N m."""
    alone = {f"alone.{COULOMB}{end}": value for end, value in (("", 0.9), (".low", 0.8), (".high", 1.0))}
    inside = {f"param.{COULOMB}{end}": value for end, value in (("", 0.3), (".low", 0.2), (".high", 0.4))}
    model = {"final_model": ["motor_spring", "motor_coulomb_friction"]}
    rows = [
        {"created": "2026-03-01T09:00:00+00:00", **alone, **inside, **model},
        {"created": "2026-03-02T09:00:00+00:00", **alone},
    ]
    text, _ = summary(monkeypatch, tmp_path, rows)
    assert line_of(text, "2026-03-01").split()[-1] == "300.00"
    assert line_of(text, "2026-03-02").split()[-1] == "(900.00)"
    assert "in brackets, where that does not hold it, of a fit with this friction alone" in " ".join(
        text.split()
    )
