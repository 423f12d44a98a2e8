"""Practice on a hidden effect: recorded off the GUI thread, opened, revealed."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from fingerlab.effects import find_effect
from fingerlab.models.file import ParameterEstimate
from fingerlab.report.diagnosis_words import effect_title
from fingerlab.sessions import open_session
from fingerlab.twin.effects import EFFECTS
from fingerlab.twin.session import reveal_session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab import practice

from ..hands import child, chosen_in_menu, click, invented_diagnosis, lab_of, wait_for_result

PATIENCE = 120_000
"""The twin compiles its integrator at its first use."""


def test_practise_then_reveal(
    qtbot: QtBot,
    make_window,  # type: ignore[no-untyped-def]
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path))
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
    assert not child(window, QLabel, "revealed").isVisible()
    click(window, "reveal")
    told = reveal_session(file)["effects"]
    sentence = child(window, QLabel, "message").text()
    for name in told:
        assert effect_title(name).lower() in sentence.lower()
    if not told:
        assert sentence.startswith("Nothing was hidden")
    answered(window, told)
    # The answer stands there when the session is opened again, which nobody can reveal twice.
    window.context.open_paths([file])
    wait_for_result(qtbot, window)
    qtbot.waitUntil(lambda: bool(child(window, QLabel, "revealed").text()), timeout=PATIENCE)
    answered(window, told)


def answered(window: MainWindow, told: dict[str, object]) -> None:
    """The answer stands in the header in place of the button; the menu has no reveal, either."""
    answer = child(window, QLabel, "revealed")
    assert answer.isVisible()
    assert all(effect_title(name).lower() in answer.text().lower() for name in told)
    assert answer.text().startswith("Hidden was: " if told else "Nothing was hidden")
    assert not child(window, QPushButton, "reveal").isVisible()
    window.menus.tab_menu.aboutToShow.emit()
    assert not chosen_in_menu(window, "Reveal the hidden effect").isEnabled()


def test_cancelled_practice_leaves_nothing_behind(
    qtbot: QtBot,
    make_window,  # type: ignore[no-untyped-def]
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path))
    window = make_window(diagnose=invented_diagnosis)
    click(window, "practise")
    qtbot.waitUntil(lambda: "run 1 of" in child(window, QLabel, "status").text(), timeout=PATIENCE)
    QTest.keyClick(window, Qt.Key.Key_Period, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: not window.tasks.busy, timeout=PATIENCE)
    assert lab_of(window).empty.isVisible()
    assert not child(window, QLabel, "emptyDoing").isVisible()
    assert child(window, QPushButton, "practise").isEnabled()
    assert list((tmp_path / "practice").iterdir()) == []


FRICTION = {"motor_coulomb_friction": {"torque": 0.012, "travel": 0.004}}
TOLD = "Hidden was: Coulomb friction in motor and gearbox (friction torque at the gearbox output 12 mN m). "
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


def test_what_was_hidden_stands_beside_what_was_fitted(
    session_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hidden = {
        "stribeck_friction": {"mcp": 2e-3, "excess": 1.5, "speed": 0.3, "pip_ratio": 0.6, "travel": 1e-3}
    }
    monkeypatch.setattr("fingerlab.twin.session.reveal_session", lambda path: {"effects": hidden})
    fitted = {"stribeck_friction.extra_pip": ParameterEstimate(1.75e-3, "N m", 1.65e-3, 1.85e-3)}
    said = practice.reveal(open_session(session_file), ("stribeck_friction",), fitted)
    # 2 mN m at the MCP, 0.6 of it at the PIP; near standstill 1.5 times as much comes on top.
    assert said.startswith(
        "Hidden was: Stribeck joint friction (MCP friction torque 2 mN m; PIP friction torque 1.2 mN m; "
        "MCP friction added near standstill 3 mN m; PIP friction added near standstill 1.8 mN m, fitted "
        "1.75 ± 0.10 mN m). Your guess was right"
    )
    assert said.endswith("open recordings of your own.")


def test_the_fit_has_names_for_what_is_told() -> None:
    told = {name: plant.expected(plant.defaults()) for name, plant in EFFECTS.items() if plant.expected}
    assert len(told) == 19
    for name, gains in told.items():
        effect = find_effect(name)
        assert effect is not None
        assert gains.keys() <= effect.unknowns.keys()
        assert all(gains.values())
