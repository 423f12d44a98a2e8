"""Nothing is missing that the data could show: what the Model lab and the browser make of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from fingerlab.core.text import NO_BREAK
from fingerlab.diagnosis.answer.results import Diagnosis, HeldOutRuns
from fingerlab.library.notes import StoredVerdict
from fingerlab.report.diagnosis_words import could_hide, set_sentence, verdict_sentence
from fingerlab.report.page_tables import short_ranking
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.candidates import row_places, unseen_words
from fingerlab.ui.lab.result_words import set_help, set_words, step_results
from fingerlab.ui.lab.validation import HeldOutTable
from fingerlab.ui.sessions.session_table import verdict_help, verdict_text

from .. import invented
from ..hands import child, click, lab_of, wait_for_result


@pytest.fixture
def window(qtbot: QtBot, make_window: Any, session_file: Path) -> MainWindow:
    made: MainWindow = make_window(
        diagnose=lambda sessions, *_: invented.unseen_diagnosis(str(sessions[0].path))
    )
    made.context.open_paths([session_file])
    wait_for_result(qtbot, made)
    return made


def test_one_run_alone_is_not_called_held_out(qtbot: QtBot, make_window: Any, session_file: Path) -> None:
    def diagnose(sessions: Any, *_: Any) -> Diagnosis:
        found = invented.friction_diagnosis(str(sessions[0].path))
        only = HeldOutRuns(("001",), "on_air", "extension", {"kind": "sine"}, 1.1)
        return replace(found, held_out=(only,))

    made: MainWindow = make_window(diagnose=diagnose)
    made.context.open_paths([session_file])
    wait_for_result(qtbot, made)
    lab_of(made).view.go_to("true")
    said = [label.text() for label in made.findChildren(QLabel) if label.isVisible()]
    said += [made.findChildren(HeldOutTable)[0].horizontalHeaderItem(0).text()]
    assert not [text for text in said if "held out" in text.lower() or "held-out" in text.lower()]
    assert "True of this one run, which the fit has seen" in said
    assert any("only a second run shows whether that holds" in text for text in said)


def test_the_verdict_says_what_it_could_not_see_and_offers_the_run(window: MainWindow) -> None:
    assert child(window, QLabel, "verdict").text() == "Nothing is missing that these data could show"
    assert child(window, QLabel, "setText").text() == (
        "They could not have shown: Stribeck joint friction, tilted base and cable stretch. "
        "The proposed run would show Stribeck joint friction and tilted base."
    )
    view = lab_of(window).view
    assert view.right.currentWidget() is view.validation
    assert view.validation.title.text() == "True, as far as these recordings can show"
    assert "It would show Stribeck joint friction and tilted base, if there" in view.validation.next.text()
    assert view.steps.result("missing") == "nothing that they could show"
    handed: list[Any] = []
    window.context.protocol_handed.connect(lambda steps, title: handed.append(steps))
    click(window, "handExperiment")
    assert handed[0][-1].trajectory["frequency_hz"] == 0.2


def test_what_was_not_visible_is_no_suspect(window: MainWindow) -> None:
    view = lab_of(window).view
    rows = view.candidates.list.rows
    assert [row.key for row in rows[:3]] == ["nothing_missing", "not_in_catalogue", "coulomb_friction"]
    assert not any(row.in_set for row in rows)
    assert [row.detectable for row in rows] == [True, True, True, False, False, False]
    assert sum(row.probability for row in rows) == pytest.approx(1.0)
    view.candidates.choose("stribeck_friction")
    assert "could not show it" in view.evidence.explanation.text()


def test_a_likely_effect_that_was_not_visible_stands_where_the_command_line_has_it(
    qtbot: QtBot, make_window: Any, session_file: Path
) -> None:
    """31 % among thirty effects of less than 1 % that the data could show."""
    found = invented.unseen_diagnosis(str(session_file))
    seen, stribeck, tilt, stretch = found.candidates
    weak = [replace(seen, effect=f"weak_{k}", title=f"Weak {k}", probability=0.006) for k in range(30)]
    likely = replace(tilt, probability=0.31)
    idle = replace(stretch, probability=0.001)
    told = replace(
        found,
        candidates=(*weak, idle, likely, stribeck),
        set=(likely.effect,),
        probability_nothing=0.45,
        probability_unknown=0.04,
    )
    made: MainWindow = make_window(diagnose=lambda *_: told)
    made.resize(1280, 800)
    made.context.open_paths([session_file])
    wait_for_result(qtbot, made)
    panel = lab_of(made).view.candidates
    shown = [row.title for row in panel.list.rows]
    assert shown[1] == "Tilted base"
    assert shown[-1] == idle.title
    assert shown == [row.title for row in short_ranking(told)]
    # What stands at the right of it is whole, in the room that there is.
    metrics = panel.view.fontMetrics()
    for row, begins in ((panel.list.rows[1], "31 %"), (panel.list.rows[-1], ("not visible", "unseen"))):
        places = row_places(panel.view.visualRect(panel.list.index_of(row.key)), metrics)
        room = places.number.united(places.bar)
        words = unseen_words(row, metrics, room.width())
        assert metrics.horizontalAdvance(words) <= room.width()
        assert words.startswith(begins)


def test_many_effects_are_counted_and_named_in_the_tooltip() -> None:
    few = invented.unseen_diagnosis("s.h5")
    many = replace(few, set=(*few.set, "added_mass", "motor_inertia", "sensor_drift"), next_experiment=None)
    assert set_words(many).endswith("cable stretch, mass that the budget left out and 2 more.")
    assert "drift of an angle sensor" in set_help(many).lower()
    assert set_help(few) == ""


def test_an_effect_that_is_not_ruled_out_but_improbable_is_said_apart() -> None:
    """As where the set keeps a law of the likeliest's kind at less than one in a hundred."""
    known = invented.nominal_diagnosis("s.h5")
    alike, rival = known.candidates[:2]
    assert set_words(known).startswith("Cannot be told apart here: Coulomb joint friction and Stribeck")
    far = replace(known, candidates=(alike, replace(rival, probability=0.004), *known.candidates[2:]))
    assert set_words(far) == "Less likely, but not ruled out: Stribeck joint friction."
    assert verdict_sentence(far).startswith("Coulomb joint friction is missing from the nominal model (83 %")
    assert set_sentence(far).startswith(
        f"Less likely, but not ruled out: Stribeck joint friction (< 1 %, {rival.score:.2f} floors). The one "
        "that is truly missing is meant to be among these 2 in 95 % of such cases."
    )


def test_the_browser_does_not_show_them_as_found() -> None:
    verdict = StoredVerdict(
        "nothing_missing", ("gravity_tilt",), 0.82, 1.03, Path("v.parquet"), outdated=False
    )
    assert verdict_text(verdict) == "nothing missing\n82 %"
    assert "leaves open, at a plausible strength: tilted base" in verdict_help(verdict)
    found = StoredVerdict("missing_effect", ("gravity_tilt",), 0.9, 1.03, Path("v.parquet"), outdated=False)
    assert verdict_text(found) == "Tilted base\n90 %"
    either = replace(found, effects=("gravity_tilt", "viscous_friction"))
    assert verdict_text(either) == "Tilted base or Viscous joint friction\none of 2, 90 %"
    first = replace(either, first=0.897)
    assert verdict_text(first) == "Tilted base\n90 %, not ruled out: 1 more"
    assert "Not ruled out: viscous joint friction; 90 % together" in verdict_help(first)
    assert "leaves open" not in verdict_help(found)


def test_what_shows_too_weakly_is_told_apart_from_what_could_not_show() -> None:
    known = invented.unseen_diagnosis("s.h5")
    weak = replace(known, set=("coulomb_friction", *known.set), next_experiment=None)
    assert set_words(weak) == (
        "They could not have shown: Stribeck joint friction, tilted base and cable stretch. "
        "Too weak to tell: Coulomb joint friction."
    )
    assert set_words(replace(weak, set=("coulomb_friction",))) == "Too weak to tell: Coulomb joint friction."
    assert "too weak to tell: Coulomb joint friction." in set_sentence(weak)


def test_where_an_effect_is_likelier_than_nothing_the_headline_says_so(
    make_window: Any, qtbot: QtBot, session_file: Path
) -> None:
    window = make_window(diagnose=lambda sessions, *_: invented.hiding_diagnosis(str(sessions[0].path)))
    window.context.open_paths([session_file])
    wait_for_result(qtbot, window)
    said = child(window, QLabel, "verdict").text().replace(NO_BREAK, " ")
    assert said == "No effect is shown to be missing; Stribeck joint friction could hide, 68 %"
    steps = step_results(invented.hiding_diagnosis("s.h5"), lab_of(window).controller.history)
    assert steps["missing"].replace(NO_BREAK, " ") == "none shown; Stribeck joint friction could hide, 68 %"
    assert verdict_sentence(invented.hiding_diagnosis("s.h5")) == (
        "No effect is shown to be missing from the nominal model, but Stribeck joint friction could hide "
        "(68 % probable, that nothing is missing 20 %): its error on runs left out of the fit is 1.10 times "
        "the bench's own repeatability."
    )
    assert lab_of(window).view.validation.title.text() == "Perhaps true: an effect could hide"
    # As likely as nothing is no contradiction.
    unseen = invented.unseen_diagnosis("s.h5")
    assert could_hide(unseen) is None
    assert could_hide(replace(unseen, probability_nothing=0.05)) is None
    assert verdict_sentence(unseen).startswith("Nothing is missing from the nominal model that these data")
