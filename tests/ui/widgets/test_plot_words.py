"""Words over a stretch of a plot: whole, shorter, upwards, or not at all; never cut."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QRectF
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from fingerlab.ui.widgets.plots import QuietPlot, WordsOver

LONG, SHORT = "PIP, extension: a long line of words", "a few"


@pytest.mark.parametrize(
    ("width", "stretch", "turns", "shown", "angle"),
    [
        (900, (0.0, 1.0), False, LONG, 0.0),
        (300, (0.0, 0.5), False, SHORT, 0.0),
        (300, (0.4, 0.48), True, LONG, 90.0),
        (300, (0.4, 0.48), False, "", 0.0),
        (300, (0.4, 0.41), True, "", 0.0),
    ],
)
def test_no_word_is_cut(  # type: ignore[no-untyped-def]
    qtbot: QtBot, width: int, stretch, turns: bool, shown: str, angle: float
) -> None:
    plot = QuietPlot("words", "Words")
    qtbot.addWidget(plot)
    plot.resize(600, 300)
    plot.show()
    plot.getPlotItem().setRange(xRange=(0.0, 1.0), yRange=(0.0, 1.0), padding=0)
    plot.write_over((LONG, SHORT), stretch, 1.0, turns)
    plot.resize(width, 300)
    QApplication.processEvents()
    (words,) = (item for item in plot.getPlotItem().items if isinstance(item, WordsOver))
    assert words.isVisible() == bool(shown)
    if shown:
        assert words.toPlainText() == shown
        assert words.angle == angle
        view = plot.getPlotItem().getViewBox()
        place: QRectF = words.mapRectToScene(words.boundingRect())
        assert view.sceneBoundingRect().adjusted(-4, -4, 4, 4).contains(place)
