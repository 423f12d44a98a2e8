"""What the error of one family of equations is made of, as a figure that adds up, and what would mend it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QComboBox, QDialog, QDialogButtonBox, QHeaderView, QLabel, QWidget

from fingerlab.core.text import fixed, with_minus
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.report.budget_words import BudgetLine, budget_lines, main_family, mending_sentence
from fingerlab.report.diagnosis_words import FAMILY_TITLES, in_sentence
from fingerlab.report.recording_words import run_proposed

from ..widgets.layout import described, hbox, resize_on_screen, vbox
from ..widgets.plots import QuietPlot, bottom_axis_height
from ..widgets.series import Series
from ..widgets.tables import NumberTable, WholeLabel, remark
from ..widgets.theme import colours_of, line, small_font

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fingerlab.diagnosis.answer.error_parts import Budget

WIDTH, HEIGHT = 1040, 700
THICK = 0.62
"""Of a row, that its bar takes."""
NAME_ROOM = 16
"""Beside the longest name, px."""
COLOURS = {"effect": "candidate", "floor": "floor"}
"""Of a part; others are drawn as what is modelled is."""
COLUMNS = (
    ("Part", "What the squared error is made of."),
    ("Share, %", "Of the squared error; the column adds up to 100.0."),
    ("In other orders, %", "Least to most that it falls by if the effects are added in another order; mean."),
    ("Error without it", "Root mean square of the error if this part alone is mended."),
    ("What mends it", "On the bench."),
)
ORDERS = 2


class BudgetPlot(QuietPlot):
    """From all of the squared error at the top down to nothing: each bar begins where the last one ended."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("budgetPlot", "What the squared error is made of", parent)
        self.lines: tuple[BudgetLine, ...] = ()
        self._family = ""
        self._budget: Budget | None = None

    def show_budget(self, family: str, budget: Budget, proposed: bool = False) -> None:
        """Another family's parts; ``proposed``: the answer proposes a run."""
        self._family, self._budget, self.lines = family, budget, budget_lines(budget, proposed)
        self.redraw()

    def redraw(self) -> None:
        plot, lines = self.getPlotItem(), getattr(self, "lines", ())
        plot.clear()
        if not lines:
            return
        colours, (low, high), count = colours_of(self), self.spans(), len(lines)
        rows = np.arange(count, 0, -1, dtype=float)
        brushes = [pg.mkBrush(getattr(colours, COLOURS.get(one.kind, "modelled"))) for one in lines]
        names = ["All of it", *(one.title for one in lines)]
        axis = plot.getAxis("left")
        axis.setTicks([[(count - k, name) for k, name in enumerate(names)], []])
        line_height = QFontMetrics(small_font()).height()  # each name has one to itself on a low screen, too
        self.setMinimumHeight((count + 2) * line_height + bottom_axis_height())
        axis.setWidth(max(map(self.fontMetrics().horizontalAdvance, names)) + NAME_ROOM)
        plot.setLabel("bottom", f"Squared error of the {in_sentence(FAMILY_TITLES[self._family])} (%)")
        places = [float(count), *(rows - 1)]
        brushes = [pg.mkBrush(colours.residual), *brushes]
        plot.addItem(
            pg.BarGraphItem(
                x0=[0.0, *low], x1=[100.0, *high], y=places, height=THICK, brushes=brushes, pen=pg.mkPen(None)
            )
        )
        plot.addItem(pg.InfiniteLine(0, angle=90, pen=line(colours.muted)), ignoreBounds=True)
        ends = [100.0, *np.maximum(low, high)]
        texts = ["100.0", *(self.share(one) for one in lines)]
        for end, row, text in zip(ends, places, texts, strict=True):
            said = pg.TextItem(text, color=colours.text, anchor=(0, 0.5))
            said.setFont(small_font())
            said.setPos(end, row)
            plot.addItem(said, ignoreBounds=True)
        reach = min(0.0, *low, *high), max(ends)
        plot.setRange(
            xRange=(reach[0], reach[1] + 0.1 * (reach[1] - reach[0])), yRange=(-0.6, count + 0.6), padding=0.0
        )
        self.setAccessibleDescription(self.text())

    def spans(self) -> tuple[list[float], list[float]]:
        """Where each part's bar ends and begins, in per cent; they follow one another from 100 to 0."""
        falls = np.cumsum([0.0, *(0.1 * one.tenths for one in self.lines)])
        return [float(100.0 - v) for v in falls[1:]], [float(100.0 - v) for v in falls[:-1]]

    @staticmethod
    def share(one: BudgetLine) -> str:
        """The number beside a bar."""
        return with_minus(fixed(0.1 * one.tenths, 1))

    def text(self) -> str:
        """The parts in words."""
        return ", ".join(f"{one.title} {self.share(one)} %" for one in self.lines)

    def shown_series(self) -> list[Series]:
        """For CSV: the shares by the number of their part, from the top."""
        if not self.lines:
            return []
        numbers = np.arange(1, len(self.lines) + 1, dtype=float)
        shares = np.array([0.1 * one.tenths for one in self.lines])
        return [Series(self.text(), "Part", "Share of the squared error (%)", numbers, shares)]

    def draw_figure(self, figure: Figure) -> None:
        """The same for paper."""
        from fingerlab.report.diagnosis_figures import draw_budget

        if self._budget is not None:
            draw_budget(figure.subplots(), self._budget, self._family)


class BudgetDialog(QDialog):
    """The figure, and a row for each of its bars with what mends it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("errorBudget")
        self.setWindowTitle("What would mend the error – FingerLab")
        resize_on_screen(self, WIDTH, HEIGHT)
        self._budgets: Mapping[str, Budget] = {}
        self._proposed = False
        self.words = described(WholeLabel(), "budgetWords", font=small_font())
        self.family = described(QComboBox(), "budgetFamily", accessible="Error of")
        self.family.currentIndexChanged.connect(lambda _row: self._show())
        label = QLabel("&Error of the")
        label.setBuddy(self.family)
        self.plot = BudgetPlot()
        self.table = NumberTable("budgetTable", "Parts of the squared error and what mends them", COLUMNS)
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        top = hbox(None, label, self.family, 1, spacing=8)
        self.hint = remark("Each bar begins where the one above it ends. Ctrl+C copies the table.")
        vbox(self, self.words, top, (self.plot, 1), (self.table, 1), self.hint, close, spacing=8)

    def show_diagnosis(self, diagnosis: Diagnosis) -> None:
        """The parts of another model's errors."""
        self._budgets, self._proposed = diagnosis.budget, run_proposed(diagnosis)
        known = bool(self._budgets)
        self.words.setText(mending_sentence(diagnosis) or "It is not known what these errors are made of.")
        wanted = str(self.family.currentData() or "")
        with QSignalBlocker(self.family):
            self.family.clear()
            for name in self._budgets:
                self.family.addItem(in_sentence(FAMILY_TITLES.get(name, name)), name)
            if known:
                chosen = wanted if wanted in self._budgets else main_family(self._budgets)
                self.family.setCurrentIndex(self.family.findData(chosen))
        for part in (self.family, self.plot, self.table, self.hint):
            part.setVisible(known)
        self._show()

    def _show(self) -> None:
        name = str(self.family.currentData() or "")
        if name not in self._budgets:
            return
        self.plot.show_budget(name, self._budgets[name], self._proposed)
        lines = self.plot.lines
        rows = [(one.title, self.plot.share(one), one.orders, one.after, one.how) for one in lines]
        self.table.show_rows(rows, stretched=len(COLUMNS) - 1)
        self.table.setColumnHidden(ORDERS, not any(one.orders for one in lines))  # of one effect: none
        header = self.table.horizontalHeaderItem(len(COLUMNS) - 1)
        if header is not None:
            header.setTextAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        for column in (0, len(COLUMNS) - 1):
            for row in range(self.table.rowCount()):
                item = self.table.item(row, column)
                if item is not None:
                    item.setTextAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
                    item.setToolTip(lines[row].how if column else lines[row].help)
        self.table.setWordWrap(True)  # what mends it is read whole
        self.table.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
