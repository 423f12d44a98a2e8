"""Branches side by side: errors, evidence, numbers, residuals of both; one click from one to the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QTableWidget
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.models.file import ParameterEstimate
from fingerlab.sessions.model import Session
from fingerlab.ui.app.window import MainWindow

from .. import invented
from ..hands import PATIENCE, child, click, invented_diagnosis, lab_of, wait_for_result

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


@pytest.fixture
def branched(qtbot: QtBot, make_window: Callable[..., MainWindow], session_file: Path) -> MainWindow:
    """Stribeck friction was added, taken back, and Coulomb friction added in its place, by clicks."""
    asked = []

    def diagnose(sessions: Sequence[Session], added: tuple[str, ...], *rest: object) -> Diagnosis:
        asked.append(added)
        found = replace(invented_diagnosis(sessions, added, *rest), model=added)  # type: ignore[arg-type]
        if added == ("stribeck_friction",):
            arm = ParameterEstimate(0.0051, "N m", 0.0042, 0.0060)
            return replace(found, score=1.3, parameters={"stribeck_friction.coulomb_mcp": arm})
        return found

    window = make_window(diagnose=diagnose)
    window.context.open_paths([session_file])
    wait_for_result(qtbot, window)
    lab = lab_of(window)
    for effect in ("stribeck_friction", "coulomb_friction"):
        lab.view.candidates.choose(effect)
        click(window, "addToModel")
        qtbot.waitUntil(lambda: lab.controller.history.now.added == (effect,), timeout=PATIENCE)  # noqa: B023
        if effect == "stribeck_friction":
            QTest.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert asked == [(), ("stribeck_friction",), ("coulomb_friction",)]
    window.setProperty("asked", asked)
    return window


def test_two_branches_stand_beside_each_other(branched: MainWindow) -> None:
    QTest.keyClick(branched, Qt.Key.Key_F8)
    table = child(branched, QTableWidget, "bothModels")
    assert table.isVisible()
    told = {table.item(row, 0).text(): (table.item(row, 1).text(), table.item(row, 2).text())
            for row in range(table.rowCount())}  # fmt: skip
    assert told["Error over all equations, in floors"] == ("1.30", "1.10")
    assert told["MCP friction torque"] == ("5.1 ± 0.9 mN m", "–")
    evidence = child(branched, QLabel, "bothEvidence").text()
    assert "6 % larger near zero speed" in evidence
    assert evidence.startswith("A, as it was foretold before the fit with it: ")
    first = child(branched, QComboBox, "modelA")
    letters = {one.text(): one.buddy() for one in first.window().findChildren(QLabel) if one.buddy()}
    assert letters["&A"] is first
    first.setFocus()
    QTest.keyClick(first, Qt.Key.Key_Home)  # the nominal model
    assert "nominal model" in first.currentText()
    rows = {table.item(row, 0).text(): row for row in range(table.rowCount())}
    joint = rows["Joint torque, mN m (floor 0.40)"]
    assert [table.item(joint, column).text() for column in (1, 2)] == ["4.81", "0.44"]
    dialog = lab_of(branched).view.findChildren(type(first.window()))[-1]
    by_a, by_b = (one.y for one in dialog.plot.shown_series())
    assert np.nanstd(by_a) == pytest.approx(1e3 * invented.FRICTION, rel=0.1)
    assert np.nanstd(by_b) == pytest.approx(1e3 * invented.NOISE, rel=0.1)


def test_one_click_goes_to_the_other_branch_without_a_new_fit(branched: MainWindow) -> None:
    QTest.keyClick(branched, Qt.Key.Key_F8)
    click(branched, "showA")
    lab = lab_of(branched)
    assert lab.controller.history.now.added == ("stribeck_friction",)
    assert len(branched.property("asked")) == 3
    QTest.keyClick(branched, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert lab.controller.history.now.added == ("coulomb_friction",)


def test_the_chosen_effects_error_is_foretold_and_each_stands_in_the_list(opened: MainWindow) -> None:
    lab = lab_of(opened).view
    rows = {row.key: row for row in lab.candidates.list.rows}
    assert rows["gravity_tilt"].score == 12.3
    assert rows["nothing_missing"].score is None
    list_ = lab.candidates.view
    list_.setFocus()
    assert [(bar.title, bar.score) for bar in lab.path.path.bars if not bar.tried] == [
        ("+ Coulomb joint friction", 1.1)
    ]
    QTest.keyClick(list_, Qt.Key.Key_Down)  # Stribeck friction, the next best
    assert [(bar.title, bar.score) for bar in lab.path.path.bars if not bar.tried] == [
        ("+ Stribeck joint friction", 1.12)
    ]
    spoken = list_.currentIndex().data(Qt.ItemDataRole.AccessibleTextRole)
    assert "error with it 1.12 floors" in spoken
