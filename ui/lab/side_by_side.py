"""Two models side by side on the same held-out runs: errors, evidence, parameters, and residuals together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QLabel,
    QWidget,
)

from fingerlab.core.text import ScreenUnit, score_text, screen_unit
from fingerlab.diagnosis.answer.results import Comparison, Diagnosis
from fingerlab.models.file import ModelKey
from fingerlab.report.diagnosis_words import FAMILY_TITLES, PHASE_WORDS
from fingerlab.report.parameter_words import parameter_title, value_words
from fingerlab.report.score_words import evidence_for, runs_words
from fingerlab.sessions.model import Array

from ..widgets.labels import WholeLabel
from ..widgets.layout import described, hbox, vbox
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.series import Series
from ..widgets.tables import NumberTable
from ..widgets.theme import colours_of, small_font, tint
from .comparison_curves import largest
from .project_dialogs import model_words
from .result_words import equation_text, error_texts

WIDTH, HEIGHT = 900, 680
COLUMNS = (
    ("", "What is compared."),
    ("A", "The model at the left above."),
    ("B", "The model at the right above."),
)
Models = Mapping[ModelKey, Diagnosis]
"""Diagnoses by effects and what is held."""


class ResidualsPlot(QuietPlot):
    """What two models leave over of one equation in one run, with the floor."""

    def __init__(self, parent: QWidget | None = None) -> None:
        self.pair: tuple[Comparison, Comparison] | None = None
        super().__init__("bothResiduals", "Residuals of two models over one another", parent)

    def show_pair(self, pair: tuple[Comparison, Comparison] | None) -> None:
        """The same equation and run by model A and by model B; None: they do not share it."""
        self.pair = pair
        self.redraw()

    def redraw(self) -> None:
        plot = self.getPlotItem()
        plot.clear()
        if self.pair is None:
            return
        unit, every = self._scaled()
        self.name_axes("Residual", unit, "Time (s)")
        band = pg.LinearRegionItem(
            (-self.pair[0].floor * unit.factor, self.pair[0].floor * unit.factor), "horizontal", movable=False
        )
        band.setBrush(tint(colours_of(self).floor, 0.35))
        for edge in band.lines:
            edge.setPen(pg.mkPen(None))
        plot.addItem(band, ignoreBounds=True)
        for name, role, one, y in zip("AB", ("residual", "modelled"), self.pair, every, strict=True):
            plot.addItem(plain_curve(one.time, y, self.pen(role, 1.0, dashed=name == "B"), name))
        time = self.pair[0].time
        plot.setRange(xRange=(time[0], time[-1]), yRange=span_of(np.concatenate(every)), padding=0.0)

    def _scaled(self) -> tuple[ScreenUnit, list[Array]]:
        assert self.pair is not None
        left = [one.measured - one.modelled for one in self.pair]
        unit = screen_unit(self.pair[0].unit, max(*map(largest, left), self.pair[0].floor))
        return unit, [values * unit.factor for values in left]

    def shown_series(self) -> list[Series]:
        """For CSV."""
        if self.pair is None:
            return []
        unit, every = self._scaled()
        label = unit.label("Residual")
        return [
            Series(n, "Time (s)", label, c.time, y) for n, c, y in zip("AB", self.pair, every, strict=True)
        ]


class SideBySideDialog(QDialog):
    """Signal ``chosen(key)``: a model is to be the present one."""

    chosen = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("sideBySide")
        self.setWindowTitle("Models side by side – FingerLab")
        self.resize(WIDTH, HEIGHT)
        self._models: Models = {}
        self._place = ("", "", "")
        self.choices = [described(QComboBox(), f"model{name}", accessible=f"Model {name}") for name in "AB"]
        self.table = NumberTable("bothModels", "Two models compared", COLUMNS)
        self.evidence = described(WholeLabel(), "bothEvidence", font=small_font())
        self.title = described(QLabel(), "bothTitle", font=small_font())
        self.plot = ResidualsPlot()
        tops = hbox(None, QLabel("A"), (self.choices[0], 1), 8, QLabel("B"), (self.choices[1], 1))
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        for name, choice in zip("AB", self.choices, strict=True):
            button = buttons.addButton(f"Show {name} in the lab", QDialogButtonBox.ButtonRole.ActionRole)
            button.setObjectName(f"show{name}")
            button.clicked.connect(lambda _checked=False, box=choice: self.chosen.emit(self._key(box)))
            choice.currentIndexChanged.connect(lambda _row: self._show())
        buttons.rejected.connect(self.reject)
        vbox(self, tops, (self.table, 4), self.evidence, self.title, (self.plot, 3), buttons, spacing=8)

    def _key(self, choice: QComboBox) -> ModelKey:
        """The model chosen in a list."""
        return list(self._models)[max(choice.currentIndex(), 0)]

    def show_models(self, models: Models, now: ModelKey, shown: Comparison | None) -> None:
        """Offer these models, the one before the present one as A and that as B.

        Args:
            now: the present model. shown: whose equation and run the residuals are drawn of.
        """
        self._models = dict(models)
        self._place = (shown.equation, shown.session, shown.run) if shown is not None else ("", "", "")
        names = list(models)
        wanted = (next((name for name in reversed(names) if name != now), now), now)
        for choice, key in zip(self.choices, wanted, strict=True):
            choice.blockSignals(True)
            choice.clear()
            for name in names:
                choice.addItem(f"{score_text(models[name].score)}  {model_words(*name)}")
            choice.setCurrentIndex(names.index(key))
            choice.blockSignals(False)
        self._show()

    def _pair(self) -> tuple[Diagnosis, Diagnosis] | None:
        if not self._models:
            return None
        a, b = (self._models[self._key(choice)] for choice in self.choices)
        return a, b

    def _show(self) -> None:
        pair = self._pair()
        if pair is None:
            return
        rows = compared(*pair)
        self.table.show_rows(rows)
        self.evidence.setText(self._evidence_words())
        both = [self._comparison(one) for one in pair]
        there = both[0] is not None and both[1] is not None
        quantity = equation_text(self._place[0]).quantity
        self.title.setText(
            f"{quantity}, run {self._place[2]}: what A (solid) and B (dashed) leave over" if there else ""
        )
        self.plot.show_pair((both[0], both[1]) if both[0] is not None and both[1] is not None else None)

    def _comparison(self, diagnosis: Diagnosis) -> Comparison | None:
        places = ((c.equation, c.session, c.run) for c in diagnosis.comparisons)
        return next(
            (c for c, at in zip(diagnosis.comparisons, places, strict=True) if at == self._place), None
        )

    def _evidence_words(self) -> str:
        """What the model without it said for the last effect of each."""
        said = []
        for name, choice in zip("AB", self.choices, strict=True):
            effects, held = self._key(choice)
            before = self._models.get((effects[:-1], held)) if effects else None
            words = evidence_for(effects[-1:], before) if before is not None else ""
            said.append(f"{name}: {words}" if words else "")
        return "\n".join(filter(None, said))


def compared(a: Diagnosis, b: Diagnosis) -> list[tuple[str, str, str]]:
    """Rows of the table: what, by A, by B. Errors are of runs left out of the fits."""
    rows = [("Error over all equations, in floors", score_text(a.score), score_text(b.score))]
    for family, error in b.errors.items():
        other = a.errors.get(family, error)
        first, second, floor, unit = error_texts(other, error)
        rows.append((f"{FAMILY_TITLES.get(family, family)}, {unit} (floor {floor})", first, second))
    scores = {one.runs: one.score for one in a.held_out}
    for one in b.held_out:
        many = "s" if len(one.runs) > 1 else ""
        words = f"Run{many} {runs_words(one.runs)}, {PHASE_WORDS.get(one.phase, one.phase)}, in floors"
        before = score_text(scores[one.runs]) if one.runs in scores else "–"
        rows.append((words, before, score_text(one.score)))
    sure = "Probability that nothing more is missing"
    rows.append((sure, _share(a.probability_nothing), _share(b.probability_nothing)))
    keys = [
        key
        for key in dict.fromkeys((*a.parameters, *b.parameters))
        if _told(key) or key in a.held or key in b.held
    ]
    return rows + [(parameter_title(key, keys), _estimate(key, a), _estimate(key, b)) for key in keys]


def _estimate(key: str, diagnosis: Diagnosis) -> str:
    if key not in diagnosis.parameters:
        return "–"
    return value_words(key, diagnosis.parameters[key]) + (", held" if key in diagnosis.held else "")


def _share(share: float) -> str:
    return f"{round(100 * share)} %"


def _told(key: str) -> bool:
    """Effects' own numbers, and the moment arms; nuisances only let a constant move within its tolerance."""
    return "." in key or key.startswith("arm_")
