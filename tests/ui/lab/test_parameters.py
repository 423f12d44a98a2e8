"""Parameters at hand, by clicks and keys on a real diagnosis: looked at, moved, held, taken back."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QCheckBox, QLabel, QPushButton, QSlider, QTableWidget
from pytestqt.qtbot import QtBot

from fingerlab.models.file import project_path
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.session import write_session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.lab_view import LabView

from ..hands import LEFT, child, click, lab_of

PATIENCE = 120_000
ARM = "arm_mcp@extension"
pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Thirty seconds on air of the simulated rig with friction in the motor."""
    preset = load_preset("practice")
    wave = {"kind": "sine", "amplitude_deg": 15.0, "offset_deg": 22.0, "duration_s": 10.0}
    plans = [RunPlan("on_air", "extension", {**wave, "frequency_hz": f}) for f in (1.0, 1.0, 0.5)]
    path = tmp_path_factory.mktemp("parameters") / "short.h5"
    write_session(path, preset, "short", plans, parse_effects(["motor_coulomb_friction"]), seed=3)
    return path


def opened(qtbot: QtBot, make_window, path: Path) -> LabView:  # type: ignore[no-untyped-def]
    """The lab with the session compared and the table laid out."""
    window: MainWindow = make_window()
    window.context.open_paths([path])
    lab = lab_of(window)
    qtbot.waitUntil(lambda: lab.controller.history is not None, timeout=PATIENCE)
    QTest.keyClick(window, Qt.Key.Key_F9)
    table = child(window, QTableWidget, "parametersTable")
    qtbot.waitUntil(lambda: table.rowCount() > 0 and not window.tasks.busy, timeout=PATIENCE)
    assert table.isVisible()
    assert not lab.view.candidates.isVisible()
    return lab.view


def choose(view: LabView, title: str) -> int:
    """Click a row of the table by what stands in it."""
    table = view.parameters.table
    (row,) = [r for r in range(table.rowCount()) if table.item(r, 0).text() == title]
    table.scrollToItem(table.item(row, 0))
    QTest.mouseClick(table.viewport(), LEFT, pos=table.visualItemRect(table.item(row, 0)).center())
    assert table.currentRow() == row
    return row


def test_a_value_is_moved_held_refitted_and_taken_back(
    qtbot: QtBot, make_window, recorded: Path, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "short.h5"
    shutil.copy(recorded, path)
    view = opened(qtbot, make_window, path)
    window, panel, controller = view.window(), view.parameters, view.controller
    first = controller.diagnosis
    assert first is not None
    view.bar.choose_equation("mcp_torque")
    row = choose(view, "Moment arm at the MCP, extension cable")
    cells = [panel.table.item(row, column).text() for column in range(7)]
    value = first.parameters[ARM].value
    assert float(cells[1]) == pytest.approx(1e3 * value, abs=0.01)
    assert cells[2] == ""
    assert cells[5:] == ["mm", "fitted here"]

    # the slider moves curves and error at once
    _, before = view.plot.modelled.series
    slider = child(window, QSlider, "parameterSlider")
    slider.setFocus()
    for _ in range(3):
        QTest.keyClick(slider, Qt.Key.Key_PageUp)
    moved = panel.what_if
    assert moved is not None
    assert moved.values[ARM] > value
    assert float(panel.table.item(row, 2).text()) == pytest.approx(1e3 * moved.values[ARM], abs=0.01)
    _, after = view.plot.modelled.series
    assert np.nanmax(np.abs(after - before)) > 0
    assert "Error on all runs" in child(window, QLabel, "whatIfWords").text()
    assert "→" in child(window, QLabel, "equationError").text()
    assert "values moved" in child(window, QLabel, "equationError").toolTip()
    alone = moved.score
    QTest.mouseClick(child(window, QCheckBox, "othersFollow"), LEFT, pos=panel.follow.rect().center() * 0.2)
    assert panel.what_if is not None
    assert panel.what_if.score < alone

    # each step of the hand is taken back by itself, the fit last
    for _ in range(3):
        QTest.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert panel.what_if is None
    assert np.array_equal(view.plot.modelled.series[1], before, equal_nan=True)
    assert controller.history is not None
    assert not controller.history.can_undo

    # a number typed, held, and fitted again
    panel.field.setFocus()
    panel.field.selectAll()
    wanted = round(1.05e3 * value, 2)
    QTest.keyClicks(panel.field, f"{wanted}")
    QTest.keyClick(panel.field, Qt.Key.Key_Return)
    assert not child(window, QPushButton, "refitHeld").isEnabled()
    click(window, "holdParameter")
    assert panel.table.item(row, 6).text() == "to be held"
    click(window, "refitHeld")
    qtbot.waitUntil(lambda: controller.diagnosis is not first and not window.tasks.busy, timeout=PATIENCE)
    held = controller.diagnosis
    assert held is not None
    assert held.held == {ARM: pytest.approx(1e-3 * wanted)}
    assert held.score > first.score
    assert "(with 1 held)" in view.candidates.verdict.text()
    assert "moment arm at the MCP, extension cable held at" in view.candidates.set_text.text()
    assert view.path.path.bars[1].title == "held: moment arm at the MCP, extension cable"
    again = choose(view, "Moment arm at the MCP, extension cable")
    assert panel.table.item(again, 6).text() == "held by hand"
    assert panel.hold.text() == "Let &free"

    # the project keeps it, with what was moved without a fit
    QTest.keyClick(slider, Qt.Key.Key_Home)
    kept = json.loads(project_path([path]).read_text(encoding="utf-8"))
    assert kept["path"][1]["held"] == [[ARM, held.held[ARM]]]
    assert kept["moved"][0][0] == ARM
    window.close()
    view = opened(qtbot, make_window, path)
    qtbot.waitUntil(lambda: view.parameters.what_if is not None, timeout=PATIENCE)
    assert view.controller.diagnosis is not None
    assert view.controller.diagnosis.held == held.held
    assert view.parameters.what_if is not None
    assert view.parameters.what_if.values[ARM] == pytest.approx(dict(kept["moved"])[ARM])
    click(view.window(), "asFitted")
    assert view.parameters.what_if is None
    click(view.window(), "closeParameters")
    assert view.candidates.isVisible()
    QTest.keyClick(view.window(), Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert view.controller.diagnosis.score == first.score
    assert "held" not in view.candidates.verdict.text()
