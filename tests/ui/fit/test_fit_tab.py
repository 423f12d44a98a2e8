"""The Fit tab as a person uses it: analyse, look at a region and a run, keep the model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QFileDialog, QLabel, QPushButton, QTableView, QWhatsThis
from pytestqt.qtbot import QtBot

from fingerlab.models.file import load_model
from fingerlab.rig.file import Finger, Motor, Rig
from fingerlab.sessions import SessionWriter
from fingerlab.ui.app.tab_registry import TabEntry
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.fit.fit_tab import FitTab
from tests.stage import stage_session

from ..hands import PATIENCE, child, click, drop
from ..looking import look
from ..saving import save_each_plot

RATE, RADIUS = 1000.0, 0.015
K_MCP, K_PIP, A, B, L_MCP, L_PIP = 0.12, 0.06, 0.010, 0.007, -0.0015, 0.0008
RIG = Rig(
    Finger(0.0, 0.0, 0.0225, 0.024, 0.0, 0.0, K_MCP, K_PIP, wrist_angle=np.radians(15.0)),
    Motor(pulley_radius=RADIUS),
)
"""Without mass, ``K theta = -a T + L`` holds for an extension cable."""

TABS = (TabEntry(4, "fit", "Fit", "Fits.", FitTab),)


@pytest.fixture
def session_on_air(tmp_path: Path) -> Path:
    """Three runs of a finger whose moment arms and losses are known."""
    path = tmp_path / "air.h5"
    time = np.arange(20_000) / RATE
    tension = 3.0 + 2.0 * np.sin(2 * np.pi * time + 0.3)
    channels = {
        "motor_command": 0.4 + 0.1 * tension,
        "motor_position": 0.4 + 0.1 * tension,
        "motor_torque": tension * RADIUS,
        "motor_current": tension * RADIUS / (0.0302 * 4.3),
        "mcp_angle": (L_MCP - A * tension) / K_MCP,
        "pip_angle": (L_PIP - B * tension) / K_PIP,
    }
    with SessionWriter(path, RIG, "known arms") as writer:
        for _ in range(3):
            writer.add_run("on_air", "extension", RATE, {"kind": "sine", "frequency_hz": 1.0}, channels)
    return path


@pytest.fixture
def window(qtbot: QtBot, make_window, session_on_air: Path) -> MainWindow:  # type: ignore[no-untyped-def]
    made_window: MainWindow = make_window(tab="fit", tabs=TABS)
    made_window.context.open_paths([session_on_air], "fit")
    qtbot.waitUntil(lambda: bool(fit_of(made_window).sessions) and not made_window.tasks.busy)
    return made_window


def fit_of(window: MainWindow) -> FitTab:
    tab = window.tab("fit")
    assert isinstance(tab, FitTab)
    return tab


@pytest.fixture
def analysed(qtbot: QtBot, window: MainWindow) -> MainWindow:
    click(window, "analyse")
    assert child(window, QLabel, "fitEmpty").text() == "Fitting air.h5"
    qtbot.waitUntil(lambda: fit_of(window).found is not None and not window.tasks.busy, timeout=PATIENCE)
    return window


def test_what_a_column_is_can_be_asked_at_any_of_its_cells(
    analysed: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    monkeypatch.setattr(QWhatsThis, "showText", staticmethod(lambda _at, text, _widget: told.append(text)))
    table = analysed.tab("fit").widget.findChild(QTableView)
    QTest.keyClick(analysed, Qt.Key.Key_F1, Qt.KeyboardModifier.ShiftModifier)
    place = table.visualRect(table.model().index(0, 3)).center()
    QTest.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, pos=place)
    QWhatsThis.leaveWhatsThisMode()
    assert "slope of joint torque on cable tension" in told[-1]


def test_empty_and_waiting_say_what_will_be_here(make_window, window: MainWindow) -> None:  # type: ignore[no-untyped-def]
    assert child(window, QLabel, "fitEmpty").text() == "Not analysed yet"
    assert not child(window, QPushButton, "saveModel").isEnabled()
    none = make_window(tab="fit", tabs=TABS)
    assert child(none, QLabel, "fitEmpty").text() == "No session open"
    assert not child(none, QPushButton, "analyse").isEnabled()
    assert child(none, QPushButton, "analyse").toolTip() == "No session is open."


def test_an_axis_alone_has_nothing_to_fit_and_that_is_said_before_it_is_asked(
    qtbot: QtBot, make_window, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    window = make_window(tab="fit", tabs=TABS)
    drop(window, stage_session(tmp_path))
    qtbot.waitUntil(lambda: child(window, QLabel, "fitEmpty").text() == "Nothing to fit", timeout=PATIENCE)
    button = child(window, QPushButton, "analyse")
    assert not button.isEnabled()
    assert "stage.h5 has no run on air with a cable" in button.toolTip()
    assert "an axis alone, whose mass and friction the Model lab finds" in button.toolTip()
    fit_of(window).analyse()  # by the keyboard
    assert not window.tasks.busy


def test_numbers_that_were_built_in_stand_in_the_table(analysed: MainWindow) -> None:
    table = fit_of(analysed).view.table
    assert table.rowCount() == 8
    row = table.keys.index(("extension", "pip", "extension"))
    assert table.currentRow() == row
    arm, loss = (float(table.item(row, c).text().split()[0].replace("−", "-")) for c in (3, 5))
    assert arm == pytest.approx(1e3 * B, rel=0.01)
    assert loss == pytest.approx(1e3 * L_PIP, abs=0.05)
    assert "±" in table.item(row, 3).text()


def test_a_row_shows_its_region_and_the_keyboard_goes_from_run_to_run(analysed: MainWindow) -> None:
    view = fit_of(analysed).view
    view.table.setFocus()
    QTest.keyClick(view.table, Qt.Key.Key_Up)
    QTest.keyClick(view.table, Qt.Key.Key_Up)
    assert (view.plane.joint, view.plane.region) == ("pip", "flexion")
    shown = view.plane.plane
    assert shown is not None
    assert shown.lhs == pytest.approx(-B * shown.tension + L_PIP, abs=3e-5)
    assert [name for name, _, _ in view.speeds["pip"].view.spans["pip"]].count("flexion") >= 1
    QTest.keyClick(analysed, Qt.Key.Key_Down, Qt.KeyboardModifier.AltModifier)
    assert child(analysed, QComboBox, "fitRun").currentText() == view.run == "002"
    assert view.r2.names == ("001", "002", "003")
    assert np.all(np.array(view.r2.series["flexion"]) > 0.99)


def test_the_model_is_kept_once_and_never_written_over(
    qtbot: QtBot, analysed: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "arms.json"
    answer: Callable[..., tuple[str, str]] = lambda *_, **__: (str(path), "")  # noqa: E731
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(answer))
    click(analysed, "saveModel")
    qtbot.waitUntil(lambda: path.exists() and not analysed.tasks.busy, timeout=PATIENCE)
    arm = load_model(path).parameters["extension/pip/extension/moment_arm"]
    assert arm.value == pytest.approx(B, rel=0.01)
    before = path.read_bytes()
    click(analysed, "saveModel")
    qtbot.waitUntil(lambda: any("exists" in line for line in analysed.context.log), timeout=PATIENCE)
    assert path.read_bytes() == before


def test_a_fit_that_is_not_possible_is_one_sentence(qtbot: QtBot, window: MainWindow) -> None:
    panel = fit_of(window).panel
    panel.method.setCurrentIndex(panel.method.findData("whole"))
    panel.delay.setCurrentIndex(panel.delay.findData("findsignal"))
    click(window, "analyse")
    qtbot.waitUntil(lambda: any("choose regions" in line for line in window.context.log), timeout=PATIENCE)
    assert fit_of(window).found is None


@pytest.mark.qt_log_ignore("This plugin does not support")  # dialogs, on a screen that is none
def test_every_plot_is_saved_in_every_format(analysed: MainWindow, tmp_path: Path) -> None:
    save_each_plot(analysed, tmp_path / "plots", 5)  # two speeds, the plane, R2 and delays
    bars = fit_of(analysed).view.r2.shown_series()
    assert [one.x.tolist() for one in bars] == [[1, 2, 3]] * 4
    assert bars[0].y == pytest.approx(1.0, abs=1e-3)


def test_the_pages_are_whole(make_window, qtbot: QtBot, analysed: MainWindow) -> None:  # type: ignore[no-untyped-def]
    look(make_window(tab="fit", tabs=TABS))
    look(analysed)
    for method in ("flexion-extension", "whole"):
        panel = fit_of(analysed).panel
        panel.method.setCurrentIndex(panel.method.findData(method))
        fit_of(analysed).found = None
        click(analysed, "analyse")
        qtbot.waitUntil(
            lambda: fit_of(analysed).found is not None and not analysed.tasks.busy, timeout=PATIENCE
        )
        look(analysed)
