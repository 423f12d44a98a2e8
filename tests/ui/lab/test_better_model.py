"""A wrong effect in the model: the Model lab says that another one is better, and exchanges it at a click."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import QFrame, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.results import Diagnosis, OtherModel, PathStep, SmallerModel
from fingerlab.report.diagnosis_words import verdict_sentence
from fingerlab.sessions import Session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.result_words import step_results

from .. import invented
from ..hands import child, click, lab_of, wait_for_result

PATIENCE = 20_000


def wrong_diagnosis(session: str) -> Diagnosis:
    """Viscous friction was added where Coulomb friction is: its error stays, and the right one is known."""
    nominal = invented.nominal_diagnosis(session)
    right, rest = nominal.candidates[0], nominal.candidates[1:]
    return replace(
        nominal,
        model=("viscous_friction",),
        score=1.6,
        candidates=(replace(right, score=1.06, replaces=("viscous_friction",)), *rest),
        set=("coulomb_friction",),
        path=(PathStep(None, 1.6), PathStep("coulomb_friction", 1.06, "viscous_friction")),
        better=OtherModel(("viscous_friction",), ("coulomb_friction",), ("coulomb_friction",), 1.06, 5.0),
    )


@pytest.fixture
def window(qtbot: QtBot, make_window: Any, session_file: Path) -> MainWindow:
    asked: list[tuple[str, ...]] = []

    def diagnose(sessions: Sequence[Session], added: tuple[str, ...], *_: object) -> Diagnosis:
        asked.append(added)
        name = str(sessions[0].path)
        return wrong_diagnosis(name) if added != ("coulomb_friction",) else invented.friction_diagnosis(name)

    made: MainWindow = make_window(diagnose=diagnose)
    made.context.open_paths([session_file])
    wait_for_result(qtbot, made)
    lab_of(made).controller.add("viscous_friction")
    qtbot.waitUntil(
        lambda: lab_of(made).controller.history.can_undo and not made.tasks.busy, timeout=PATIENCE
    )
    return made


def test_the_banner_names_the_better_model_and_one_click_exchanges_it(
    qtbot: QtBot, window: MainWindow
) -> None:
    lab = lab_of(window)
    banner = child(window, QFrame, "betterModel")
    assert banner.isVisible()
    assert child(window, QLabel, "betterModelText").text() == (
        "Another model of these recordings is better: Coulomb joint friction in place of viscous joint "
        "friction takes the error on runs left out of the fit from 1.60 to 1.06 times the bench's own "
        "repeatability."
    )
    # The row of the list is told with 83 %; the odds against the model as given would be 99 %.
    chosen = lab.view.candidates.list.rows[0]
    assert (chosen.key, chosen.probability) == ("coulomb_friction", 0.83)
    assert child(window, QLabel, "verdict").text().endswith(", 83\N{NO-BREAK SPACE}%")
    assert lab.controller.diagnosis is not None
    told = verdict_sentence(lab.controller.diagnosis)
    assert "It is 83 % probable, and 150 times as likely." in told
    assert lab.view.validation.title.text() == "Not true: another model is better"
    assert child(window, QPushButton, "addToModel").text() == "Exchange in &the model"
    assert lab.view.path.path.bars[-1].title == "Coulomb joint friction for viscous joint friction"
    click(window, "exchange")
    qtbot.waitUntil(
        lambda: lab.controller.history.now.added == ("coulomb_friction",) and not window.tasks.busy,
        timeout=PATIENCE,
    )
    assert not banner.isVisible()
    assert lab.view.validation.title.text() == "True, as far as these recordings can show"
    assert lab.view.path.path.bars[-1].title == "Coulomb joint friction for viscous joint friction"
    click(window, "undo")
    assert lab.controller.history.now.added == ("viscous_friction",)
    assert banner.isVisible()


def test_adding_what_replaces_an_effect_takes_that_one_out(qtbot: QtBot, window: MainWindow) -> None:
    lab = lab_of(window)
    lab.view.candidates.choose("coulomb_friction")
    assert "⇄: in place of an effect of the model." in lab.view.candidates.set_text.text()
    shown = lab.view.candidates.view
    row = shown.visualRect(lab.view.candidates.list.index_of("coulomb_friction"))
    picture = shown.viewport().grab().toImage()
    marked, other = (
        {picture.pixelColor(x, top + y).rgb() for x in range(6, 20) for y in range(3, row.height() - 3)}
        for top in (row.top(), row.bottom() + 1)
    )
    assert len(marked) > 1  # the mark is drawn, and the next row bears none
    assert len(other) == 1
    click(window, "addToModel")
    qtbot.waitUntil(lambda: lab.controller.history.now.added == ("coulomb_friction",), timeout=PATIENCE)


def test_true_is_not_said_of_what_leaves_too_much_or_is_one_of_two(window: MainWindow) -> None:
    validation, history = lab_of(window).view.validation, lab_of(window).controller.history
    fine = invented.friction_diagnosis("invented.h5")
    other = OtherModel(("coulomb_friction",), ("stribeck_friction",), ("stribeck_friction",), 1.1, -0.5)
    for diagnosis, title, word in (
        (replace(fine, score=1.36), "Not shown to be true: too much is left", "too much is left"),
        (replace(fine, as_good=(other,)), "Perhaps true: another model is as good", "perhaps, as is another"),
    ):
        history.push(replace(history.now, diagnosis=diagnosis))
        validation.show_history(history)
        assert validation.title.text() == title
        assert step_results(diagnosis, history)["true"] == word


def test_an_effect_that_is_not_needed_is_named_and_taken_off_at_a_click(
    qtbot: QtBot, make_window: Any, session_file: Path
) -> None:
    def diagnose(sessions: Sequence[Session], added: tuple[str, ...], *_: object) -> Diagnosis:
        found = invented.friction_diagnosis(str(sessions[0].path))
        if len(added) < 2:
            return found if added else invented.nominal_diagnosis(str(sessions[0].path))
        return replace(found, model=added, smaller=SmallerModel("joint_coupling", added[:1], 1.12))

    window = make_window(diagnose=diagnose)
    lab = lab_of(window)
    window.context.open_paths([session_file])
    wait_for_result(qtbot, window)
    for effect in ("coulomb_friction", "joint_coupling"):
        lab.controller.add(effect)
        qtbot.waitUntil(
            lambda last=effect: lab.controller.history.now.added[-1:] == (last,) and not window.tasks.busy,
            timeout=PATIENCE,
        )
    assert lab.view.validation.title.text() == "More than is needed: stiffness between MCP and PIP"
    assert lab.view.steps.result("true") == "more than needed: stiffness between MCP and PIP"
    said = (
        "Stiffness between MCP and PIP is not needed in the model: without it the error on runs left out of "
        "the fit is 1.12 instead of 1.10 times the bench's own repeatability, too little to tell the two "
        "apart."
    )
    assert child(window, QLabel, "betterModelText").text() == said
    assert lab.controller.diagnosis is not None
    assert said in verdict_sentence(lab.controller.diagnosis)
    assert not child(window, QPushButton, "exchange").isVisible()
    click(window, "takeOff")
    qtbot.waitUntil(
        lambda: lab.controller.history.now.added == ("coulomb_friction",) and not window.tasks.busy,
        timeout=PATIENCE,
    )
    assert not child(window, QFrame, "betterModel").isVisible()
    assert lab.view.validation.title.text() == "True, as far as these recordings can show"
    assert lab.view.path.path.bars[-1].title == "− Stiffness between MCP and PIP"
    click(window, "undo")
    assert lab.controller.history.now.added == ("coulomb_friction", "joint_coupling")
