"""Side panel of the Fit tab: how to fit, which run to look at, and what to keep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton, QVBoxLayout, QWidget

from fingerlab.signals.periods import THRESHOLDS_PERCENT
from fingerlab.thesis.traces import Delay, FitSpec, Method

from ..widgets.labels import heading, remark

METHOD_WORDS: dict[Method, str] = {
    "regions": "four regions",
    "flexion-extension": "flexion and extension",
    "whole": "whole run",
}
DELAY_WORDS: dict[Delay, str] = {
    "none": "no delay",
    "xcorr": "by cross-correlation, one a run",
    "findsignal": "by least squares, one a region",
    "finddelay": "as the thesis: finddelay",
}
PANEL_WIDTH = 240


class FitPanel(QWidget):
    """Signals ``analyse_asked``, ``save_asked``, ``run_chosen(name)``."""

    analyse_asked = Signal()
    save_asked = Signal()
    run_chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFixedWidth(PANEL_WIDTH)
        self.method = _choice("method", "Regions", [(METHOD_WORDS[m], m) for m in get_args(Method)])
        self.delay = _choice("delay", "Delay", [(DELAY_WORDS[d], d) for d in get_args(Delay)])
        self.threshold = _choice(
            "threshold",
            "Threshold",
            [(f"{t} % of the speed range", float(t)) for t in THRESHOLDS_PERCENT],
        )
        self.method.setToolTip("Into which parts of the period the runs are cut; each has a line of its own.")
        self.threshold.setToolTip(
            "Joint speed that parts motion from standstill, thesis sections 4.1 and 4.2."
        )
        self.delay.setToolTip("The tension is shifted by the delay before the line is fitted.")
        self.analyse = QPushButton("&Analyse the runs on air")
        self.analyse.setObjectName("analyse")
        self.analyse.setProperty("primary", "true")
        self.save = QPushButton("&Save model file…")
        self.save.setObjectName("saveModel")
        self.run = _choice("fitRun", "Run shown", [])
        self.run.setToolTip("Run that the plots show (Alt+Up, Alt+Down for the next); the table is of all.")
        self.remarks = remark()
        self.remarks.setObjectName("fitRemarks")
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 0, 0, 0)
        layout.setSpacing(4)
        layout.addWidget(heading("How to fit"))
        for title, box in (("Re&gions", self.method), ("&Delay", self.delay), ("&Threshold", self.threshold)):
            layout.addWidget(_label(title, box))
            layout.addWidget(box)
        layout.addSpacing(4)
        layout.addWidget(self.analyse)
        layout.addSpacing(16)
        layout.addWidget(heading("What is shown"))
        layout.addWidget(_label("&Run", self.run))
        layout.addWidget(self.run)
        layout.addWidget(self.remarks)
        layout.addStretch(1)
        layout.addWidget(self.save)
        self.analyse.clicked.connect(self.analyse_asked)
        self.save.clicked.connect(self.save_asked)
        self.run.currentTextChanged.connect(self.run_chosen)
        self.set_ready(False, "There is no fit yet: analyse first.")

    def spec(self) -> FitSpec:
        """What is chosen."""
        return FitSpec(self.method.currentData(), self.delay.currentData(), self.threshold.currentData())

    def set_ready(self, ready: bool, why_not: str = "") -> None:
        """Whether there is a fit to keep."""
        self.save.setEnabled(ready)
        self.save.setToolTip("Parameters, intervals and origin; never over a file." if ready else why_not)

    def show_runs(self, names: Sequence[str], remarks: str) -> None:
        """Runs of another fit; the one that was shown stays if it is there."""
        before = self.run.currentText()
        self.run.blockSignals(True)
        self.run.clear()
        self.run.addItems(list(names))
        self.run.setCurrentIndex(max(self.run.findText(before), 0))
        self.run.blockSignals(False)
        self.remarks.setText(remarks)


def _choice(name: str, words: str, entries: Sequence[tuple[str, object]]) -> QComboBox:
    box = QComboBox()
    box.setObjectName(name)
    box.setAccessibleName(words)
    for text, data in entries:
        box.addItem(text, data)
    return box


def _label(text: str, buddy: QWidget) -> QLabel:
    label = QLabel(text)
    label.setBuddy(buddy)
    return label
