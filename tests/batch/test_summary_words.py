"""What the batch's summary says of sessions in which nothing is missing."""

from __future__ import annotations

from typing import Any

from fingerlab.report.time_words import not_shown_sentence


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
