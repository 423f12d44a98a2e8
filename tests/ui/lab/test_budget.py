"""What would mend the error: bars that follow one another from all of it to nothing, and a table beside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QTableWidget
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.error_parts import Budget, BudgetPart
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.report.budget_words import mending_sentence
from fingerlab.sessions.model import Session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.budget import BudgetPlot
from fingerlab.ui.lab.error_path import ErrorPath
from fingerlab.ui.widgets.plot_figure import Paper, save_plot
from fingerlab.ui.widgets.theme import small_font

from .. import invented
from ..hands import child, invented_diagnosis, lab_of, wait_for_result

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")

FORCE, TORQUE = 0.5**2, 0.0048**2
# Thirds, which no decimal holds; beside the effect of the torque the other one mends nothing.
BUDGETS = {
    "joint_torque": Budget("N m", TORQUE, (
        BudgetPart("effect", TORQUE / 1.5, "coulomb_friction", "", TORQUE * 0.5, TORQUE * 0.7, TORQUE * 0.6),
        BudgetPart("effect", 0.0, "cable_stretch", "", 0.0, TORQUE / 3, 0.0),
        BudgetPart("unknown", 0.0), BudgetPart("parameters", 0.0, parameter="arm_mcp@extension"),
        BudgetPart("calibration", 0.0, parameter="torque_gain"), BudgetPart("between_runs", 0.0),
        BudgetPart("floor", TORQUE / 3),
    )),
    "endpoint_force": Budget("N", FORCE, (
        BudgetPart("effect", FORCE / 3, "coulomb_friction"), BudgetPart("effect", FORCE / 3, "cable_stretch"),
        BudgetPart("unknown", FORCE / 12),
        BudgetPart("parameters", FORCE / 12, parameter="arm_mcp@extension"),
        BudgetPart("calibration", FORCE / 24, parameter="force_gain"), BudgetPart("between_runs", 0.0),
        BudgetPart("floor", FORCE / 8),
    )),
}  # fmt: skip


@pytest.fixture
def window(qtbot: QtBot, make_window: Callable[..., MainWindow], session_file: Path) -> MainWindow:
    def diagnose(sessions: Sequence[Session], added: tuple[str, ...], *rest: object) -> Diagnosis:
        found = invented_diagnosis(sessions, added, *rest)  # type: ignore[arg-type]
        return replace(found, budget=BUDGETS)

    window = make_window(diagnose=diagnose)
    window.context.open_paths([session_file])
    wait_for_result(qtbot, window)
    return window


def spans(plot: BudgetPlot) -> tuple[list[float], list[float]]:
    bars = next(item for item in plot.getPlotItem().items if isinstance(item, pg.BarGraphItem))
    return list(bars.opts["x0"]), list(bars.opts["x1"])


def test_bars_follow_one_another_and_the_table_adds_up(window: MainWindow) -> None:
    QTest.keyClick(lab_of(window).view.candidates.view, Qt.Key.Key_F7, Qt.KeyboardModifier.ShiftModifier)
    plot, table = child(window, BudgetPlot, "budgetPlot"), child(window, QTableWidget, "budgetTable")
    family = child(window, QComboBox, "budgetFamily")
    assert plot.isVisible()
    assert family.currentText() == "endpoint force"
    low, high = spans(plot)
    assert (low[0], high[0], high[1], low[-1]) == pytest.approx((0.0, 100.0, 100.0, 0.0), abs=1e-9)
    assert low[1:-1] == pytest.approx(high[2:])  # each begins where the last one ended
    shares = [float(table.item(row, 1).text().replace("−", "-")) for row in range(7)]
    assert sum(shares) == pytest.approx(100.0, abs=1e-9)
    np.testing.assert_allclose(np.subtract(high, low)[1:], shares, atol=1e-9)
    # A third less of the square is the root of two thirds of 0.5 N.
    assert table.item(0, 3).text() == "0.408 N"
    assert table.item(1, 4).text() == "Use a stiffer or a shorter cable."
    family.setCurrentIndex(family.findData("joint_torque"))
    shares = [float(table.item(row, 1).text().replace("−", "-")) for row in range(7)]
    assert shares[:2] == [66.7, 0.0]
    assert sum(shares) == pytest.approx(100.0, abs=1e-9)
    assert table.item(0, 2).text() == "50 to 70, mean 60"
    assert table.item(1, 4).text() == ""  # what mends nothing has no advice


def test_on_a_low_screen_each_bar_has_a_line_for_its_name(window: MainWindow) -> None:
    """At 400 px, as a small screen at 200 % has, the names had been written over one another."""
    QTest.keyClick(lab_of(window).view.candidates.view, Qt.Key.Key_F7, Qt.KeyboardModifier.ShiftModifier)
    plot = child(window, BudgetPlot, "budgetPlot")
    plot.window().resize(1040, 360)
    QApplication.processEvents()
    low, high = plot.getPlotItem().getViewBox().viewRange()[1]
    apart = plot.getPlotItem().getViewBox().height() / (high - low)
    assert apart >= QFontMetrics(small_font()).ascent()


def test_what_the_verdict_holds_for_nothing_is_not_worth_mending() -> None:
    """Of 8.2 mN m, 62 % of the square is told by no effect, and the rest is the floor."""
    whole = 0.0082**2
    left = Budget("N m", whole, (BudgetPart("unknown", 0.62 * whole), BudgetPart("floor", 0.38 * whole)))
    nothing = invented.nominal_diagnosis("s.h5")
    nothing = replace(nothing, verdict="nothing_missing", budget={"joint_torque": left})
    said = mending_sentence(nothing)
    # The root of 0.38 of the square is 5.05 mN m.
    assert said == (
        "What remains is too small to be shown to be an effect: the error of the joint torque is 8.2 mN m, "
        "its floor 5.1 mN m. Largest part: left unexplained, 62 % of the squared error of the joint torque "
        "on runs left out of the fit. Without it the error would be 5.1 mN m."
    )
    assert mending_sentence(replace(nothing, verdict="not_in_catalogue")).startswith(
        "Worth mending first: left"
    )


def test_saved_figures_say_what_their_axis_is(window: MainWindow, tmp_path: Path) -> None:
    """Of bars the axis has a name and a unit on paper, too."""
    lab_of(window).view.show_budget()
    plot = child(window, BudgetPlot, "budgetPlot")
    for widget, expected in (
        (plot, "squared error of the endpoint force, %"),
        (child(window, ErrorPath, "errorPath"), "held-out error, in multiples of the floor"),
    ):
        save_plot(widget, tmp_path / "figure.svg")
        assert expected in (tmp_path / "figure.svg").read_text(encoding="utf-8")


def test_a_unit_is_not_parted_where_a_label_takes_two_lines(window: MainWindow, tmp_path: Path) -> None:
    save_plot(lab_of(window).view.plot, tmp_path / "low.svg", Paper(170.0, 60.0, 96, ""))
    words = [node.text for node in ElementTree.parse(tmp_path / "low.svg").iter() if node.text]
    assert "(mN m)" in {word.strip() for word in words} or "Residual (mN m)" in words
    assert not [word for word in words if word.strip() in ("m)", "(mN", "Residual (mN")]
