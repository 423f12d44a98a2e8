"""Saves each plot that a page shows in every format, by the menu's own way, and opens what was written."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QDialog, QFileDialog, QPushButton, QWidget

from fingerlab.ui.app.menus import is_plot
from fingerlab.ui.app.window import MainWindow

ENDINGS = ("png", "svg", "pdf", "csv")


def plots_shown(window: MainWindow) -> list[QWidget]:
    """Every plot that is seen now."""
    return [widget for widget in window.findChildren(QWidget) if widget.isVisible() and is_plot(widget)]


def save_each_plot(window: MainWindow, folder: Path, expected: int, empty: tuple[str, ...] = ()) -> None:
    """PNG, SVG, PDF and CSV of each; of those named in ``empty`` there are no numbers to write."""
    plots = plots_shown(window)
    assert len(plots) == expected, [plot.objectName() for plot in plots]
    folder.mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        for number, plot in enumerate(plots):
            for ending in ENDINGS:
                path = folder / f"{number}.{ending}"
                patch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, p=path: (str(p), "")))
                save_by_dialog(window, plot)
                if ending == "csv" and plot.objectName() in empty:
                    assert "no curve" in window.context.log[-1]
                    continue
                assert window.context.log[-1].endswith(f"Plot saved: {path}"), (
                    plot.objectName(),
                    window.context.log[-1],
                )
                check(path, plot)


def save_by_dialog(window: MainWindow, plot: QWidget) -> None:
    """Ask for the dialog of a plot and press its Save."""
    window.plots.ask_and_save(plot)
    dialog = window.plots.dialog
    assert dialog is not None
    press_save(dialog)


def press_save(dialog: QDialog) -> None:
    """The button that accepts, as the mouse does it."""
    (button,) = [one for one in dialog.findChildren(QPushButton) if one.text() == "&Save…"]
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def check(path: Path, plot: QWidget) -> None:
    """That the file can be opened and shows something."""
    name = f"{plot.objectName() or plot.accessibleName()}{path.suffix}"
    if path.suffix == ".png":
        image = QImage(str(path))
        size = 2 * plot.width(), 2 * max(plot.height(), 60 / 25.4 * 96)  # a low plot becomes higher
        assert (image.width(), image.height()) == pytest.approx(size, abs=1), name  # a dot of rounding
        colours = {image.pixel(x, y) for x in range(0, image.width(), 3) for y in range(0, image.height(), 7)}
        assert len(colours) > 3, name
    elif path.suffix == ".svg":
        tree = ElementTree.parse(path)
        drawn = [node for node in tree.iter() if re.search(r"(path|polyline|rect|text)$", node.tag)]
        assert len(drawn) > 5, name
    elif path.suffix == ".pdf":
        content = path.read_bytes()
        assert content.startswith(b"%PDF"), name
        assert content.rstrip().endswith(b"%%EOF"), name
        assert b"/Font" in content, name
    else:
        rows = list(csv.reader(path.open(encoding="utf-8")))
        assert len(rows) > 1, name
        assert all(rows[0]), (name, rows[0])
        for column in zip(*rows[1:], strict=True):
            assert np.isfinite([float(cell) for cell in column if cell]).any(), (name, rows[0])
