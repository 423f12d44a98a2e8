"""Dialogs on models tried: their list and notes, two side by side, and what a headline is made of."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QHeaderView,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QPlainTextEdit,
    QPushButton,
    QTableWidgetItem,
    QWidget,
)

from fingerlab.core.text import ScreenUnit, score_text, screen_unit
from fingerlab.diagnosis.answer.error_parts import Comparison, equation_of
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.models.file import Held, ModelKey, TriedModel
from fingerlab.report.diagnosis_words import (
    FAMILY_TITLES,
    PHASE_WORDS,
    effect_title,
    in_sentence,
    listed,
    on_the_path,
)
from fingerlab.report.line_units import LineUnits
from fingerlab.report.parameter_words import held_words, is_told, parameter_title, value_words
from fingerlab.report.score_words import (
    ASIDE_HELP,
    ScoreTable,
    aside_sentence,
    evidence_for,
    runs_words,
    score_table,
)
from fingerlab.sessions.model import Array

from ..widgets.layout import described, hbox, resize_on_screen, vbox
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.series import Series
from ..widgets.tables import NumberTable, WholeLabel, heading, remark
from ..widgets.theme import colours_of, small_font, tint
from .comparison_curves import largest
from .result_words import error_texts

PROJECT_WIDTH, PROJECT_HEIGHT = 560, 380


class NotesDialog(QDialog):
    """Notes on the open sessions. Signal ``noted(text)`` at every change: nothing waits to be saved."""

    noted = Signal(str)

    def __init__(self, parent: QWidget | None, notes: str, place: str) -> None:
        super().__init__(parent)
        _prepare(self, "Notes", "projectNotes")
        self.text = described(QPlainTextEdit(notes), "notesText", accessible="Notes")
        self.text.setPlaceholderText("What you see, think and plan.")
        self.text.textChanged.connect(lambda: self.noted.emit(self.text.toPlainText()))
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        vbox(self, (self.text, 1), remark(f"Kept at every letter in {place}."), close, spacing=8)


class TriedDialog(QDialog):
    """Models that were tried, least error first. Signal ``chosen(key)``: one is to be shown again."""

    chosen = Signal(object)

    def __init__(self, parent: QWidget | None, tried: Sequence[TriedModel], now: ModelKey) -> None:
        super().__init__(parent)
        _prepare(self, "Models tried", "triedModels")
        self.models = described(QListWidget(), "triedList", accessible="Models tried, least error first")
        self.models.setWordWrap(True)
        self.models.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._tried = sorted(tried, key=lambda one: one.score)
        for model in self._tried:
            here = " (shown now)" if model.key == now else ""
            item = QListWidgetItem(f"{score_text(model.score)}  {model_words(*model.key)}{here}")
            item.setToolTip(model.evidence)
            self.models.addItem(item)
        self.models.itemActivated.connect(self._show_chosen)
        self.models.setCurrentRow(0)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        self.show_button = QPushButton("&Show it again")
        buttons.addButton(self.show_button, QDialogButtonBox.ButtonRole.ActionRole)
        self.show_button.clicked.connect(self._show_chosen)
        buttons.rejected.connect(self.reject)
        help_text = remark("Error on runs left out of the fit (in floors), and what was added.")
        vbox(self, help_text, (self.models, 1), buttons, spacing=8)

    def _show_chosen(self) -> None:
        row = self.models.currentRow()
        if row >= 0:
            self.chosen.emit(self._tried[row].key)
            self.accept()


def model_words(added: Sequence[str], held: Held = (), diagnosis: Diagnosis | None = None) -> str:
    """A model in words; ``diagnosis``: of it, whose names its effects have."""
    titles = [effect_title(one) if diagnosis is None else on_the_path(diagnosis, one) for one in added]
    names = [in_sentence(title) for title in titles]
    model = f"nominal model with {listed(names)}" if names else "nominal model"
    radius = 0.0 if diagnosis is None else diagnosis.line_radius
    return ", ".join(filter(None, (model, held_words(dict(held), radius))))


def _prepare(dialog: QDialog, title: str, name: str) -> None:
    dialog.setWindowTitle(f"{title} – FingerLab")
    dialog.setObjectName(name)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.resize(PROJECT_WIDTH, PROJECT_HEIGHT)


SCORE_WIDTH, SCORE_HEIGHT = 960, 560
ROOM = 8
"""About the words of a row, px."""
FLOOR_ROW, SQUARED_ROW = "The floor", "Squared error"
LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
STRONGEST = 0.45
"""Tint of a cell that is the whole of what is missed."""


class ScorePartsDialog(QDialog):
    """A table that adds up. Signal ``part_chosen(equation, run)``: a click on a part asks for its curves."""

    part_chosen = Signal(str, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("scoreParts")
        self.setWindowTitle("What the error is made of – FingerLab")
        resize_on_screen(self, SCORE_WIDTH, SCORE_HEIGHT)
        self.title = heading()
        self.words = described(WholeLabel(), "scorePartsWords", font=small_font())
        self.table = NumberTable("scoreTable", "Parts of the squared error", ())
        self.table.setSelectionBehavior(NumberTable.SelectionBehavior.SelectItems)
        self.table.setWordWrap(False)  # a row is a line; what is cut is whole in its tooltip
        self.table.verticalHeader().setDefaultSectionSize(QFontMetrics(small_font()).height() + ROOM)
        self.table.cellClicked.connect(self._choose)
        self.table.cellActivated.connect(self._choose)
        self._scores: ScoreTable | None = None
        close = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close.rejected.connect(self.reject)
        self.hint = remark(
            "Click a number to see its curves. Equations whose noise goes together are weighed together: "
            "what they miss alike counts once, in that which tells it more sharply, so that little can stand "
            "for curves that lie far apart. Ctrl+C copies the table, or what is chosen of it."
        )
        vbox(self, self.title, self.words, (self.table, 1), self.hint, close, spacing=8)

    def show_diagnosis(self, diagnosis: Diagnosis) -> None:
        """The parts of another model's error."""
        self._scores = scores = score_table(diagnosis)
        self.title.setText(f"The error is {score_text(diagnosis.score)} times the floor")
        if scores is None:
            self.words.setText("It is not known of what: no run could be left out of the fit.")
            for part in (self.table, self.hint):
                part.setVisible(False)
            resize_on_screen(self, SCORE_WIDTH, 0)  # a sentence alone needs no more than its lines
            return
        self.words.setText(
            f"Its square, {scores.squared}, is the sum of {scores.floor} for the floor and of what each "
            "equation misses beyond it in the runs of each motion: every number below, "
            f"{scores.together} together. {aside_sentence(diagnosis)}"
        )
        self._fill(scores)
        if self.table.isHidden():
            resize_on_screen(self, SCORE_WIDTH, SCORE_HEIGHT)
        for part in (self.table, self.hint):
            part.setVisible(True)

    def _fill(self, scores: ScoreTable) -> None:
        columns = [
            ("Runs", "Runs that were told the same motion."),
            ("Samples", "Their share of all samples that are judged."),
            *(
                (title, f"What the equation of the {title[:1].lower()}{title[1:]} adds.")
                for title in scores.titles
            ),
            ("Together", "What these runs add."),
            ("Left aside", "\n".join(ASIDE_HELP.values())),
        ]
        self.table.set_columns(columns)
        rows = [(row.title, row.samples, *row.cells, row.together, row.aside) for row in scores.rows]
        blank = [""] * (len(scores.equations) + 1)
        rows += [("All runs", "", *scores.sums, scores.together, "")]
        rows += [(FLOOR_ROW, *blank, scores.floor, ""), (SQUARED_ROW, *blank, scores.squared, "")]
        self.table.setRowCount(len(rows))
        largest = max((value for row in scores.rows for value in row.values), default=0.0)
        colour = colours_of(self).residual
        for place, row in enumerate(rows):
            for column, text in enumerate(row):
                item = QTableWidgetItem(text)
                words = column in (0, len(row) - 1)
                item.setTextAlignment(LEFT if words else RIGHT)
                part = place < len(scores.rows) and 2 <= column < 2 + len(scores.equations)
                value = scores.rows[place].values[column - 2] if part else 0.0
                if value > 0.0:
                    item.setBackground(tint(colour, STRONGEST * value / largest))
                if place >= len(scores.rows):
                    font = item.font()
                    font.setBold(True)
                    item.setFont(font)
                item.setToolTip(text if words else "")
                self.table.setItem(place, column, item)
        last = self.table.horizontalHeaderItem(len(columns) - 1)
        assert last is not None
        last.setTextAlignment(LEFT)
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(len(columns) - 1, QHeaderView.ResizeMode.Stretch)

    def _choose(self, row: int, column: int) -> None:
        scores = self._scores
        if scores is None or row >= len(scores.rows):
            return
        equations = scores.equations
        parts = scores.rows[row].values
        own = 2 <= column < 2 + len(equations)
        place = column - 2 if own else max(range(len(parts)), key=parts.__getitem__)
        self.part_chosen.emit(equations[place], scores.rows[row].runs[0])


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
        self.name_axes("Residual", unit, "Time in the run (s)")
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
            Series(n, "Time in the run (s)", label, c.time, y)
            for n, c, y in zip("AB", self.pair, every, strict=True)
        ]


class SideBySideDialog(QDialog):
    """Signal ``chosen(key)``: a model is to be the present one."""

    chosen = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("sideBySide")
        self.setWindowTitle("Models side by side – FingerLab")
        resize_on_screen(self, WIDTH, HEIGHT)
        self._models: Models = {}
        self._place = ("", "", "")
        self.choices = [described(QComboBox(), f"model{name}", accessible=f"Model {name}") for name in "AB"]
        self.table = NumberTable("bothModels", "Two models compared", COLUMNS)
        self.evidence = described(WholeLabel(), "bothEvidence", font=small_font())
        self.title = described(QLabel(), "bothTitle", font=small_font())
        self.plot = ResidualsPlot()
        letters = [QLabel(f"&{name}") for name in "AB"]
        for letter, choice in zip(letters, self.choices, strict=True):
            letter.setBuddy(choice)
        tops = hbox(None, letters[0], (self.choices[0], 1), 8, letters[1], (self.choices[1], 1))
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
            with QSignalBlocker(choice):
                choice.clear()
                for name in names:
                    choice.addItem(f"{score_text(models[name].score)}  {model_words(*name, models[name])}")
                choice.setCurrentIndex(names.index(key))
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
        quantity = equation_of(self._place[0]).quantity
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
            said.append(f"{name}, as it was foretold before the fit with it: {words}" if words else "")
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
    # No nuisances: they only let a constant move within its tolerance.
    keys = [
        key
        for key in dict.fromkeys((*a.parameters, *b.parameters))
        if (("." in key or key.startswith("arm_")) and is_told(key, {**a.parameters, **b.parameters}[key]))
        or key in a.held
        or key in b.held
    ]
    line = LineUnits(b.line_radius)
    titles = {key: line.title(parameter_title(key, keys)) for key in keys}
    named = Counter(titles.values())
    for key, title in titles.items():
        whose = f" ({in_sentence(effect_title(key.partition('.')[0]))})" if named[title] > 1 else ""
        rows.append((f"{title}{whose}", _estimate(key, a), _estimate(key, b)))
    return rows


def _estimate(key: str, diagnosis: Diagnosis) -> str:
    if key not in diagnosis.parameters:
        return "–"
    return value_words(key, diagnosis.parameters[key]) + (", held" if key in diagnosis.held else "")


def _share(share: float) -> str:
    return f"{round(100 * share)} %"
