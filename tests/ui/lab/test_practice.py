"""Practice on a hidden effect: recorded off the GUI thread, opened, revealed."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from fingerlab.report.diagnosis_words import effect_title
from fingerlab.sessions import open_session
from fingerlab.twin.session import reveal_session
from fingerlab.ui.lab import practice

from ..hands import child, click, invented_diagnosis, lab_of, wait_for_result

PATIENCE = 120_000
"""The twin compiles its integrator at its first use."""


def test_practise_then_reveal(
    qtbot: QtBot,
    make_window,  # type: ignore[no-untyped-def]
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(practice, "practice_folder", lambda: tmp_path / "practice")
    window = make_window(tab="acquire", diagnose=invented_diagnosis)
    click(window, "practiseFromHere")  # who opens the program for the first time stands there
    assert window.current == "model_lab"
    assert child(window, QPushButton, "cancel").isVisible()
    assert "Recording a practice session" in child(window, QLabel, "emptyDoing").text()
    assert child(window, QLabel, "emptyDoing").isVisible()
    qtbot.waitUntil(lambda: lab_of(window).controller.history is not None, timeout=PATIENCE)
    wait_for_result(qtbot, window)
    (file,) = (tmp_path / "practice").glob("*.h5")
    assert file.name in window.windowTitle()
    assert len(lab_of(window).controller.sessions[0].runs) == len(open_session(file).runs)
    click(window, "reveal")
    told = reveal_session(file)["effects"]
    sentence = child(window, QLabel, "message").text()
    for name in told:
        assert effect_title(name).lower() in sentence.lower()
    if not told:
        assert sentence.startswith("Nothing was hidden")


def test_cancelled_practice_leaves_nothing_behind(
    qtbot: QtBot,
    make_window,  # type: ignore[no-untyped-def]
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(practice, "practice_folder", lambda: tmp_path / "practice")
    window = make_window(diagnose=invented_diagnosis)
    click(window, "practise")
    qtbot.waitUntil(lambda: "run 1 of" in child(window, QLabel, "status").text(), timeout=PATIENCE)
    QTest.keyClick(window, Qt.Key.Key_Period, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: not window.tasks.busy, timeout=PATIENCE)
    assert lab_of(window).empty.isVisible()
    assert not child(window, QLabel, "emptyDoing").isVisible()
    assert child(window, QPushButton, "practise").isEnabled()
    assert list((tmp_path / "practice").iterdir()) == []


FRICTION = {"motor_coulomb_friction": {"torque": 0.012}}
TOLD = "Hidden was: Coulomb friction in motor and gearbox (torque 12 mN m). "
NOTHING = "Nothing was hidden: the bench has noise and tolerances and no missing effect. "


@pytest.mark.parametrize(
    ("effects", "model", "answer"),
    [
        ({}, (), f"{NOTHING}Your guess was right"),
        (
            {},
            ("coulomb_friction",),
            f"{NOTHING}Your guess was another: your model has Coulomb joint friction.",
        ),
        (FRICTION, (), f"{TOLD}You have made no guess"),
        (FRICTION, ("motor_coulomb_friction",), f"{TOLD}Your guess was right"),
        (FRICTION, ("coulomb_friction",), f"{TOLD}Your guess was another: your model has Coulomb joint"),
        (FRICTION, ("torque_ripple", "motor_coulomb_friction"), f"{TOLD}Your guess was right in part"),
    ],
)
def test_what_reveal_says(
    effects: dict[str, dict[str, float]],
    model: tuple[str, ...],
    answer: str,
    session_file: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("fingerlab.twin.session.reveal_session", lambda path: {"effects": effects})
    assert practice.reveal(open_session(session_file), model).startswith(answer)
