"""Copy and save of plots, as a person does it; what was written is read back."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QContextMenuEvent, QGuiApplication, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QMenu, QSplitter, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.core.text import ScreenUnit
from fingerlab.ui.acquire.live_canvas import Canvas
from fingerlab.ui.acquire.live_curves import ShownPart
from fingerlab.ui.acquire.live_history import LiveHistory, LiveTrace
from fingerlab.ui.app.context import ApplicationContext
from fingerlab.ui.app.tab_registry import Tab, TabEntry
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.widgets.plots import DecimatedCurve, QuietPlot
from fingerlab.ui.widgets.theme import colours_of

from ..saving import press_save

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")  # menus, on a screen that is none

TIME = np.arange(60_000) / 1000.0
FORCE = 1.0 + np.sin(TIME)
FEW = np.array([0.25, 1.5, 2.0 / 3.0])


class Plots(Tab):
    """A long curve that the screen decimates, points with symbols, and a live plot."""

    def __init__(self, context: ApplicationContext) -> None:
        super().__init__(context)
        self.widget = QSplitter(Qt.Orientation.Vertical)
        self.long, self.dots = QuietPlot("longPlot", "Force over time"), QuietPlot("dots", "Bins")
        self.long.name_axes("Endpoint force", ScreenUnit("N", 1.0), "Time (s)")
        self.dots.name_axes("Residual", ScreenUnit("mN m", 1e3), "Speed (°/s)")
        curve = DecimatedCurve(pen=pg.mkPen(colours_of(self.long).measured))
        self.long.getPlotItem().addItem(curve)
        self.long.setRange(xRange=(0, 60), yRange=(-0.1, 2.1), padding=0)
        curve.set_series(TIME, FORCE)
        self.dots.getPlotItem().addItem(pg.ScatterPlotItem([1.0, 2.0, 3.0], FEW, size=8, name="bins"))
        self.dots.getPlotItem().addItem(pg.PlotCurveItem([1.0, 2.0, 3.0], 2 * FEW, name="effect"))
        self.dots.setRange(xRange=(0, 4), yRange=(0, 3), padding=0)
        self.live = Canvas("Motor torque", "mN m")
        self.live.setObjectName("live")
        self.live.setAccessibleName("Motor torque")
        self.live.y_range = (0.0, 3.0)
        history = LiveHistory(("torque",), 1.0)
        history.extend(np.arange(3.0), {"torque": FEW})
        self.live.show_part(
            ShownPart(history, (LiveTrace("torque", "measured", wide=True),), frozenset(), 0, 3, 1.0)
        )
        for plot in (self.long, self.dots, self.live):
            self.widget.addWidget(plot)

    def figure_source(self, plot: QWidget) -> str:
        return "bench.h5, recorded 2026-05-03; run 003"


TABS = (TabEntry(1, "plots", "Plots", "Plots.", Plots),)


@pytest.fixture
def window(make_window) -> MainWindow:  # type: ignore[no-untyped-def]
    made: MainWindow = make_window(tab="plots", tabs=TABS)
    return made


def plots_of(window: MainWindow) -> Plots:
    tab = window.tab("plots")
    assert isinstance(tab, Plots)
    return tab


def right_click(qtbot: QtBot, window: MainWindow, plot: QWidget) -> QMenu:
    """Right of a plot's middle, on whatever widget is there, as the mouse would."""
    target = plot.viewport() if isinstance(plot, pg.GraphicsView) else plot
    at = target.rect().center() + QPoint(20, 0)
    event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, target.mapToGlobal(at))
    QApplication.sendEvent(target, event)
    menu = window.findChild(QMenu, "plotMenu")
    assert menu is not None, "no menu"
    qtbot.waitUntil(menu.isVisible)
    return menu


def save(monkeypatch: pytest.MonkeyPatch, window: MainWindow, plot: QWidget, path: Path) -> None:
    """By the keyboard: focus the plot, press the keys, name the file."""
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_: (str(path), "")))
    plot.setFocus()
    keys = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    QTest.keyClick(window, Qt.Key.Key_S, keys)
    assert window.plots.dialog is not None
    press_save(window.plots.dialog)


def test_numbers_of_a_long_curve_are_all_there_with_name_and_unit(
    window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "force.csv"
    save(monkeypatch, window, plots_of(window).long, path)
    rows = list(csv.reader(path.open(encoding="utf-8")))
    assert rows[0] == ["Time (s)", "Endpoint force (N): measured"]
    values = np.array(rows[1:], dtype=float)
    assert np.array_equal(values, np.stack((TIME, FORCE), axis=1))
    assert window.context.log[-1].endswith("force.csv")


def test_curves_over_the_same_points_share_them(
    qtbot: QtBot, window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    menu = right_click(qtbot, window, plots_of(window).dots)
    QTest.keyClick(menu, Qt.Key.Key_N)
    rows = list(csv.reader(io.StringIO(QGuiApplication.clipboard().text())))
    assert rows[0] == ["Speed (°/s)", "Residual (mN m): bins", "Residual (mN m): effect"]
    assert np.array(rows[1:], dtype=float) == pytest.approx(np.stack(([1, 2, 3], FEW, 2 * FEW), axis=1))


def test_a_live_plot_has_the_menu_too(qtbot: QtBot, window: MainWindow) -> None:
    menu = right_click(qtbot, window, plots_of(window).live)
    QTest.keyClick(menu, Qt.Key.Key_N)
    assert QGuiApplication.clipboard().text().splitlines() == [
        "Time since connecting (s),Motor torque (mN m): measured", "0.0,0.25", "1.0,1.5",
        f"2.0,{2 / 3!r}",
    ]  # fmt: skip


def test_a_picture_on_the_clipboard_shows_the_curve(qtbot: QtBot, window: MainWindow) -> None:
    plot = plots_of(window).long
    menu = right_click(qtbot, window, plot)
    QTest.keyClick(menu, Qt.Key.Key_C)
    image = QGuiApplication.clipboard().image()
    assert image.width() == pytest.approx(2 * plot.width(), abs=1)
    column = [image.pixelColor(image.width() // 2, y).lightness() for y in range(image.height())]
    assert min(column) < 60  # the curve, nearly black
    assert image.pixelColor(1, 1).name() == "#ffffff"


@pytest.mark.parametrize("name", ["long", "dots", "live"])
def test_vector_pictures_are_lines_and_letters(
    window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    plot = getattr(plots_of(window), name)
    svg, pdf, png = (tmp_path / f"{name}{ending}" for ending in (".svg", ".pdf", ".png"))
    for path in (svg, pdf, png):
        save(monkeypatch, window, plot, path)
    text = svg.read_text(encoding="utf-8")
    assert "<image" not in text
    assert len(re.findall(r"<(?:path|polyline|circle|ellipse)", text)) > 3
    label = {"long": "Endpoint force (N)", "dots": "Residual (mN m)", "live": "Motor torque (mN m)"}[name]
    assert label in text or label.partition("(")[2].rstrip(")") in text
    content = pdf.read_bytes()
    assert content.startswith(b"%PDF")
    assert b"/Subtype /Image" not in content
    assert b"/Font" in content
    read = QImage(str(png))
    assert (read.width(), read.height()) == pytest.approx(
        (2 * plot.width(), 2 * max(plot.height(), 60 / 25.4 * 96)), abs=1
    )


def test_size_title_and_fineness_are_what_was_asked_and_are_offered_again(
    window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    proposed = []

    def ask(_parent: object, _title: str, path: str, _kinds: str) -> tuple[str, str]:
        proposed.append(Path(path).name)
        return str(tmp_path / "asked.png"), ""

    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(ask))
    window.plots.ask_and_save(plots_of(window).long)
    dialog = window.plots.dialog
    assert dialog is not None
    assert dialog.title.text() == "Force over time – bench.h5, recorded 2026-05-03; run 003"
    dialog.title.setText("Force, run 3: $5 a newton")
    dialog.size_choice.setCurrentIndex(dialog.size_choice.findData("column"))
    dialog.fineness.setCurrentIndex(dialog.fineness.findData("600"))
    tall = dialog.height_mm.value()
    press_save(dialog)
    image = QImage(str(tmp_path / "asked.png"))
    assert (image.width(), image.height()) == pytest.approx((85 / 25.4 * 600, tall / 25.4 * 600), abs=1)
    assert proposed == ["force-run-3-5-a-newton.png"]
    window.plots.ask_and_save(plots_of(window).dots)
    assert window.plots.dialog is not None
    assert window.plots.dialog.width_mm.value() == 85
    assert window.plots.dialog.fineness.currentData() == "600"
    window.plots.dialog.reject()


def test_another_ending_and_a_plot_without_curves_are_one_sentence(
    window: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plot = plots_of(window).dots
    save(monkeypatch, window, plot, tmp_path / "plot.bmp")
    assert "should end in .png, .svg, .pdf or .csv" in window.context.log[-1]
    plot.getPlotItem().clear()
    save(monkeypatch, window, plot, tmp_path / "plot.csv")
    assert "shows no curve now" in window.context.log[-1]
    assert not list(tmp_path.glob("plot.*"))


def test_the_menu_key_opens_it_and_the_sheet_of_keys_tells(qtbot: QtBot, window: MainWindow) -> None:
    plot = plots_of(window).live
    plot.setFocus()
    middle = plot.rect().center()
    event = QContextMenuEvent(QContextMenuEvent.Reason.Keyboard, middle, plot.mapToGlobal(middle))
    QApplication.sendEvent(plot, event)
    menu = window.findChild(QMenu, "plotMenu")
    assert menu is not None
    menu.close()
    entries = [entry for _, part in window.menus.keys() for entry in part]  # noqa: SIM118
    assert ("Save plot", "Ctrl+Shift+S") in entries
    assert ("Copy plot", "Ctrl+Shift+C") in entries
