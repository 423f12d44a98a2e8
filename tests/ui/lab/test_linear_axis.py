"""A log of an axis along a line in the Model lab: its curves, tables and sentences in N, mm, mm/s and kg.

The log is 12 kg that are driven over Coulomb friction of 15 N, F = m a + f sign(v), on sums of sines.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from fingerlab.report.diagnosis_figures import diagnosis_figures
from fingerlab.report.page import write_report
from fingerlab.ui.app.window import MainWindow
from tests.cli.calling import call

from ..hands import child, drop, lab_of
from .test_where import choose

MASS, FRICTION, NOISE = 12.0, 15.0, 0.1
"""kg, N, N."""
PATIENCE = 120_000
pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")
ANGULAR = re.compile(r"N m\b|\bNm\b|°|\brad\b|[Tt]orque")
NAMES = re.compile(
    r"Torque ripple|Elastic torque on the motor side|torque ripple|elastic torque on the motor"
)
"""Titles of effects, which are those of the catalogue."""


def fastest() -> float:
    """mm/s, of all runs."""
    return max(float(np.abs(_moved(run)[2]).max()) for run in range(3)) * 1e3


def _moved(run: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time, position, speed and acceleration, SI."""
    time = np.arange(12 * 250) / 250.0
    rates, sizes = 2 * np.pi * np.array((0.25, 0.5, 0.75)), np.array((0.08, 0.03, 0.01))
    phases = rates[:, None] * time + np.array((0.0, 1.1, 2.3))[:, None] * (run + 1)
    rate = rates * sizes
    return time, sizes @ np.sin(phases), rate @ np.cos(phases), -(rates * rate) @ np.sin(phases)


@pytest.fixture(scope="module")
def linear(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("linear")
    files, random = [], np.random.default_rng(7)
    for run in range(3):
        time, x, v, a = _moved(run)
        force = MASS * a + FRICTION * np.sign(v) + NOISE * random.standard_normal(len(x))
        files.append(folder / f"{run}.csv")
        table = np.stack((time, 1e3 * x, force), axis=1)
        np.savetxt(files[-1], table, "%.6f", ",", header="time (s),position (mm),force (N)", comments="")
    code, _, err = call("import", "--axis", *files, "--out", folder / "stage.h5")
    assert code == 0, err
    return folder / "stage.h5"


@pytest.fixture
def window(qtbot: QtBot, make_window, linear: Path, tmp_path: Path) -> MainWindow:  # type: ignore[no-untyped-def]
    made: MainWindow = make_window()
    drop(made, Path(shutil.copy(linear, tmp_path)))  # a project stands beside its session
    qtbot.waitUntil(lambda: lab_of(made).controller.history is not None, timeout=PATIENCE)
    return made


def test_everything_is_told_along_the_line(window: MainWindow, qtbot: QtBot) -> None:
    view = lab_of(window).view
    top, bottom = (plot.getAxis("left").labelText for plot in (view.plot.top, view.plot.bottom))
    assert (top, bottom) == ("Motor force (N)", "Residual (N)")
    _, residual = view.plot.residual.series
    assert np.nanmedian(np.abs(residual)) == pytest.approx(FRICTION, rel=0.1)
    # A log does not say what its axis was told to do.
    assert view.bar.runs.itemText(1) == "Run 002 · motor bench, motion unknown"
    # The fingerprint of the friction, over the speed.
    plot = view.evidence.plot
    shown = plot.shown_series()[0]
    assert (shown.across, shown.up) == ("Speed (mm/s)", "Residual (N)")
    labels = [plot.getPlotItem().getAxis(side).labelText for side in ("left", "bottom")]
    assert labels == ["Residual (N)", "Speed (mm/s)"]
    x, y = plot.points.getData()
    assert np.abs(x).max() == pytest.approx(fastest(), rel=0.15)
    assert y.max() == pytest.approx(FRICTION, rel=0.15)
    found = re.search(r"friction force ([\d.]+)(?: ± [\d.]+)? N", view.evidence.title.toolTip())
    assert found is not None
    assert float(found[1]) == pytest.approx(FRICTION, rel=0.05)
    # Table of errors, headline of the equation, where it fails, what the error is made of.
    assert view.path.table.cell("motor_force", "now") in view.bar.error.text()
    assert float(view.path.table.cell("motor_force", "now")) == pytest.approx(FRICTION, rel=0.15)
    QTest.keyClick(window, Qt.Key.Key_F3)
    choose(view, "axis_speed")
    words = child(window, QLabel, "whereWords").text()
    assert re.match(r"Worst at speed −?\d+ to −?\d+ mm/s: 1\d\.\d+ N, ", words), words
    choose(view, "angle_loop")
    assert view.where.coordinate.currentText() == "Loop over the position of this run"
    assert view.where.shape.getPlotItem().getAxis("bottom").labelText == "Position (mm)"
    view.show_score_parts()
    view.show_budget()
    assert view._parts is not None
    assert view._budget is not None
    for part in (window, view._parts, view._budget):
        texts = [one.text() for one in part.findChildren(QLabel)]
        assert [text for text in texts if ANGULAR.search(NAMES.sub("", text))] == []
    assert " N " in view._budget.words.text()
    for dialog in (view._parts, view._budget):
        dialog.close()


def test_mass_and_friction_stand_in_the_table_and_move_in_kg(window: MainWindow, qtbot: QtBot) -> None:
    view = lab_of(window).view
    assert view.candidates.chosen_row().key == "motor_coulomb_friction"
    lab_of(window).controller.add("motor_coulomb_friction")
    qtbot.waitUntil(lambda: lab_of(window).controller.history.can_undo, timeout=PATIENCE)
    QTest.keyClick(window, Qt.Key.Key_F9)
    table = view.parameters.table
    qtbot.waitUntil(lambda: table.rowCount() > 0, timeout=PATIENCE)
    rows = {table.item(row, 0).text(): row for row in range(table.rowCount())}
    value, unit = ({name: table.item(row, column).text() for name, row in rows.items()} for column in (1, 5))
    assert unit["Mass"] == "kg"
    assert float(value["Mass"]) == pytest.approx(MASS, rel=0.03)
    assert unit["Friction force"] == "N"
    assert float(value["Friction force"]) == pytest.approx(FRICTION, rel=0.05)
    assert not any(ANGULAR.search(text) for text in (*value, *unit.values()))
    # Moved by a kilogram, the curve is off by the kilogram times the acceleration.
    table.setCurrentCell(rows["Mass"], 0)
    before = view.plot.modelled.series[1].copy()
    field = view.parameters.field
    assert field.suffix() == " kg"
    field.setValue(field.value() + 1.0)
    _, after = view.plot.modelled.series
    most = np.abs(_moved(0)[3]).max()  # m/s^2, so N
    assert np.nanmax(np.abs(after - before)) == pytest.approx(most, rel=0.15)
    assert re.search(r"motor force [\d.]+ → [\d.]+ N", view.parameters.words.text())
    assert re.search(r"error [\d.]+ → <b>[\d.]+</b> N", view.bar.error.text())
    # The slider does not run to bounds that no fit meets.
    view.parameters.slider.setValue(1000)
    assert field.value() < 100 * MASS


def test_the_page_and_the_figures(window: MainWindow, tmp_path: Path) -> None:
    lab = lab_of(window)
    shown = lab.controller.diagnosis
    assert shown is not None
    figures = diagnosis_figures(shown.computed, lab.controller.sessions)
    fingerprint = figures["fingerprint-motor-coulomb-friction"].axes[0]
    assert (fingerprint.get_xlabel(), fingerprint.get_ylabel()) == (
        "speed (mm/s)",
        "residual, motor force (N)",
    )
    assert figures["motor-force-1"].axes[0].get_ylabel() == "motor force (N)"
    path = write_report(lab.controller.sessions, tmp_path / "r.html", diagnosis=shown.computed)
    text = path.read_text()
    words = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text))
    assert "Motor force" in words
    assert re.search(r"[Ff]riction force 15\.?\d* ± [\d.]+ N", words)
    assert "Motor force = mass · acceleration" in words
