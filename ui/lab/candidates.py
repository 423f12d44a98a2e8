"""The candidates, ranked: effects and the two other outcomes, the verdict above, "Add to model" below."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import (
    QAbstractListModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QRect,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QColor, QFont, QFontMetrics, QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QListView,
    QPushButton,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QWidget,
)

from fingerlab.core.text import percent, score_text
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.report.diagnosis_words import called, in_sentence, listed, shown_best_first, suspects

from ..widgets.fields import set_usable
from ..widgets.layout import FLUSH, Spacer, described, hbox, vbox
from ..widgets.tables import WholeLabel, copies, with_tabs
from ..widgets.theme import Colours, colours_of, large_font, small_font, tint
from .result_words import (
    EXCHANGE_MARK,
    OUTCOME_TITLES,
    bench_words,
    best_choice,
    set_help,
    set_words,
    verdict_headline,
)

Index = QModelIndex | QPersistentModelIndex


@dataclass(frozen=True)
class CandidateRow:
    """``key`` is an effect id, or ``nothing_missing`` or ``not_in_catalogue``.

    ``score``: error with it, in floors; None for an outcome.
    ``replaces``: titles of the model's effects in whose place it would be; empty: beside them.
    """

    key: str
    title: str
    probability: float
    in_set: bool
    detectable: bool
    remark: str = ""
    replaces: str = ""
    score: float | None = None


def rows_of(diagnosis: Diagnosis) -> list[CandidateRow]:
    """All rows, the verdict's first, then by probability as the command line has them.

    Last is what the data cannot show and what nothing else speaks for either.
    """
    many = len(suspects(diagnosis)) > 1
    rows = [
        CandidateRow(
            c.effect,
            c.title,
            c.probability,
            c.in_set and many,
            c.detectable,
            "" if c.detectable else "these data cannot show it",
            listed([in_sentence(called(diagnosis, name)) for name in c.replaces]),
            c.score,
        )
        for c in shown_best_first(diagnosis)
    ]
    chances = (diagnosis.probability_nothing, diagnosis.probability_unknown)
    outcomes = zip(OUTCOME_TITLES.items(), chances, strict=True)
    rows += [CandidateRow(outcome, title, chance, False, True) for (outcome, title), chance in outcomes]
    first = diagnosis.verdict
    return sorted(rows, key=lambda row: (row.key != first, _idle(row), -row.probability))


def _idle(row: CandidateRow) -> bool:
    return not row.detectable and not row.in_set and row.probability < WORTH_SAYING


class CandidateList(QAbstractListModel):
    """Rows for the list; ``RowRole`` gives the whole row."""

    RowRole = Qt.ItemDataRole.UserRole + 1

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.rows: list[CandidateRow] = []

    def show(self, diagnosis: Diagnosis | None) -> None:
        self.beginResetModel()
        self.rows = rows_of(diagnosis) if diagnosis is not None else []
        self.endResetModel()

    def rowCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self.rows)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        if not index.isValid():
            return None
        row = self.rows[index.row()]
        if role == Qt.ItemDataRole.DisplayRole:
            return row.title
        if role == self.RowRole:
            return row
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            instead = f" in place of {row.replaces}" if row.replaces else ""
            text = f"{row.title}{instead}: probability {percent(row.probability)}"
            text += f", error with it {score_text(row.score)} floors" if row.score is not None else ""
            if row.in_set:
                text += ", cannot be ruled out, as the others that are marked"
            return f"{text}, {row.remark}" if row.remark else text
        return None

    def as_table(self) -> str:
        """All rows with probability and the error that each would leave, as text with tabs."""
        lines = [
            (row.title, percent(row.probability), "" if row.score is None else score_text(row.score))
            for row in self.rows
        ]
        return with_tabs([("candidate", "probability", "error with it (floors)"), *lines])

    def index_of(self, key: str) -> QModelIndex:
        """The row of an effect or outcome; an invalid index where it is not listed."""
        for number, row in enumerate(self.rows):
            if row.key == key:
                return self.index(number, 0)
        return QModelIndex()


SET_MARK = "≈"
BAR_SHARE = 0.06
TIGHT_LETTERS = 52
"""Of a row's width, below which the error with each effect is left to its tooltip."""
GAP = 8
WORTH_SAYING = 0.005
"""Probability from which an effect that the data could not show has its number, too."""


@dataclass(frozen=True)
class RowPlaces:
    """Where the parts of a row stand; ``score`` has no width where room is short."""

    mark: QRect
    title: QRect
    score: QRect
    number: QRect
    bar: QRect


def row_places(row: QRect, metrics: QFontMetrics) -> RowPlaces:
    """Places within a row: mark, title and, at the right, error with it, probability and its bar."""
    room = row.adjusted(GAP, 0, -GAP, 0)
    mark = max(map(metrics.horizontalAdvance, (SET_MARK, EXCHANGE_MARK))) + GAP // 2
    bar, number = int(room.width() * BAR_SHARE), metrics.horizontalAdvance("> 99 %")
    # Where room is short the title has it: the error is in the tooltip, and predicted by the bar below.
    tight = room.width() < TIGHT_LETTERS * metrics.averageCharWidth()
    score = 0 if tight else metrics.horizontalAdvance(f"> {MOST_FLOORS:.0f}")
    title = room.width() - mark - bar - number - score - 3 * GAP
    left, places = room.left(), []
    for width, gap in ((mark, 0), (title, GAP), (score, GAP), (number, GAP), (bar, 0)):
        places.append(QRect(left, room.top(), width, room.height()))
        left += width + gap
    return RowPlaces(*places)


class CandidateHeading(QWidget):
    """What the numbers in the list below are, above their columns."""

    def __init__(self, view: QListView) -> None:
        super().__init__()
        self._view = view
        self.setFont(small_font())
        self.setFixedHeight(self.fontMetrics().height())
        self.setToolTip(HEADING_HELP)
        self.setAccessibleName("Columns of the list: error with it, in multiples of the floor; probability")

    def paintEvent(self, event: QPaintEvent) -> None:
        shown = self._view.viewport()
        row = QRect(shown.mapTo(self._view, shown.rect().topLeft()).x(), 0, shown.width(), self.height())
        places = row_places(row, self._view.fontMetrics())
        painter = QPainter(self)
        painter.setPen(QColor(colours_of(self).muted))
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        if places.score.width():
            painter.drawText(places.title.united(places.score), right, "error with it, × floor")
        painter.drawText(places.number.united(places.bar).adjusted(-GAP, 0, 0, 0), right, "probability")


class CandidateDelegate(QStyledItemDelegate):
    """One line a candidate. The chosen one is tinted; those in the set carry ≈ at the left."""

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> QSize:
        return QSize(160, QFontMetrics(option.font).height() + GAP)

    def paint(
        self, painter: QPainter, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        row: CandidateRow = index.data(CandidateList.RowRole)
        widget = option.widget
        if row is None or not isinstance(widget, QWidget):
            return
        colours = colours_of(widget)
        painter.save()
        room = QRect(option.rect)
        if option.state & QStyle.StateFlag.State_Selected:
            painter.fillRect(room, tint(colours.accent, 0.18))
            painter.fillRect(QRect(room.left(), room.top(), 3, room.height()), QColor(colours.accent))
        self._paint_row(painter, option, room, row, colours)
        painter.restore()

    def _paint_row(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        room: QRect,
        row: CandidateRow,
        colours: Colours,
    ) -> None:
        metrics = QFontMetrics(option.font)
        middle = Qt.AlignmentFlag.AlignVCenter
        places = row_places(room, metrics)
        painter.setFont(QFont(option.font))
        painter.setPen(QColor(colours.text if row.detectable else colours.muted))
        mark = EXCHANGE_MARK if row.replaces else SET_MARK if row.in_set else ""
        painter.drawText(places.mark, middle, mark)
        wide = places.title.united(places.score) if row.score is None else places.title
        title = metrics.elidedText(row.title, Qt.TextElideMode.ElideRight, wide.width())
        painter.drawText(wide, middle, title)
        if row.score is not None and places.score.width():
            painter.setPen(QColor(colours.muted))
            painter.drawText(places.score, middle | Qt.AlignmentFlag.AlignRight, _score_words(row.score))
            painter.setPen(QColor(colours.text if row.detectable else colours.muted))
        if not row.detectable:
            wide = places.number.united(places.bar)
            text = unseen_words(row, metrics, wide.width())
            place = places.number if text == percent(row.probability) else wide
            painter.drawText(place, middle | Qt.AlignmentFlag.AlignRight, text)
            return
        painter.drawText(places.number, middle | Qt.AlignmentFlag.AlignRight, percent(row.probability))
        height = max(6, places.bar.height() // 3)
        bar = QRect(places.bar.left(), places.bar.center().y() - height // 2, places.bar.width(), height)
        painter.fillRect(bar, tint(colours.floor, 0.25))
        bar.setWidth(max(1, round(places.bar.width() * min(max(row.probability, 0.0), 1.0))))
        painter.fillRect(bar, QColor(colours.candidate))


MOST_FLOORS = 999.0


def unseen_words(row: CandidateRow, metrics: QFontMetrics, width: int) -> str:
    """What stands at the right of an effect that the data could not show, as much as ``width``, px, takes."""
    worth, said = row.probability >= WORTH_SAYING, percent(row.probability)
    wanted = (f"{said}, not visible", f"{said}, unseen", said)
    wanted = wanted if worth else ("not visible here", "not visible", "unseen")
    return next((words for words in wanted if metrics.horizontalAdvance(words) <= width), wanted[-1])


def _score_words(score: float) -> str:
    """The error to which the effect brings the model, short."""
    return score_text(score) if score <= MOST_FLOORS else f"> {MOST_FLOORS:.0f}"


LEAST_ROWS = 2
"""Of the list, that are always seen; with the words above it more would not fit at 1280 x 800."""


class CandidateView(QListView):
    """A list whose Enter key asks to add the chosen effect."""

    accepted = Signal()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.accepted.emit()
            return
        super().keyPressEvent(event)


HEADING_HELP = (
    "Error: that of the model with the effect in it, in multiples of the floor, on runs left out of the fit "
    "where there are several. Probability: that the effect is what is missing."
)
OWN_HELP = "A file with law, parameters and explanation to edit, which then takes part in the comparison."


class CandidatesPanel(QWidget):
    """Signals: ``chosen(key)`` when another row is chosen, ``add_asked(effect)``.

    ``own_asked``: what is missing is not in the catalogue, and is to become an effect of the user's own.
    """

    chosen = Signal(str)
    add_asked = Signal(str)
    own_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.verdict = described(WholeLabel(), "verdict", font=large_font(), role="heading")
        self.set_text = described(WholeLabel(), "setText", font=small_font(), role="muted")
        self.bench = described(WholeLabel(), "bench", font=small_font(), role="muted")
        self.list = CandidateList(self)
        self.view = described(CandidateView(), "candidates", accessible="Candidates, best first")
        self.view.setModel(self.list)
        copies(self.view, self.list.as_table)
        self.view.setItemDelegate(CandidateDelegate(self.view))
        self.view.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.view.setVerticalScrollMode(QListView.ScrollMode.ScrollPerPixel)
        self.view.setUniformItemSizes(True)
        # Where room is short the list gives way and scrolls, not the words above it.
        self.view.setMinimumHeight(LEAST_ROWS * 2 * self.fontMetrics().height())
        self.add_button = described(QPushButton("Add &to model"), "addToModel", primary="true")
        head = CandidateHeading(self.view)
        listed_below = vbox(None, head, (self.view, 1), spacing=0)
        layout = vbox(
            self, self.verdict, self.set_text, self.bench, (listed_below, 1), margins=FLUSH, spacing=4
        )
        row = hbox(None, self.add_button, Spacer(1))
        layout.addLayout(row)
        self._busy = False
        self.view.selectionModel().currentChanged.connect(self._on_current)
        self.view.accepted.connect(self._ask)
        self.view.doubleClicked.connect(self._ask)
        self.add_button.clicked.connect(self._ask)
        self._update_button()

    def show_diagnosis(self, diagnosis: Diagnosis | None) -> None:
        """Show the rows of a diagnosis and choose the one that its verdict names."""
        self.list.show(diagnosis)
        self.verdict.setText(verdict_headline(diagnosis) if diagnosis is not None else "")
        self.set_text.setText(set_words(diagnosis) if diagnosis is not None else "")
        self.set_text.setToolTip(set_help(diagnosis) if diagnosis is not None else "")
        text, every = bench_words(diagnosis) if diagnosis is not None else ("", "")
        self.bench.setText(text)
        self.bench.setToolTip(every)
        self.bench.setVisible(bool(text))
        if diagnosis is not None:
            self.choose(best_choice(diagnosis))
        self._update_button()

    def choose(self, key: str) -> None:
        """Choose a row by effect id or outcome."""
        index = self.list.index_of(key)
        if index.isValid():
            self.view.setCurrentIndex(index)

    def chosen_row(self) -> CandidateRow | None:
        index = self.view.currentIndex()
        return self.list.rows[index.row()] if index.isValid() else None

    def set_busy(self, busy: bool) -> None:
        """While the model is being refitted nothing more can be added."""
        self._busy = busy
        self._update_button()

    def _on_current(self, current: QModelIndex, _previous: QModelIndex) -> None:
        self._update_button()
        row = self.chosen_row()
        if current.isValid() and row is not None:
            self.chosen.emit(row.key)

    def _ask(self) -> None:
        row = self.chosen_row()
        if row is not None and row.key == Verdict.NOT_IN_CATALOGUE and self.add_button.isEnabled():
            self.own_asked.emit()
        elif row is not None and self.add_button.isEnabled():
            self.add_asked.emit(row.key)

    def _update_button(self) -> None:
        row = self.chosen_row()
        if row is None:
            why = "Choose an effect first."
        elif row.key in OUTCOME_TITLES and row.key != Verdict.NOT_IN_CATALOGUE:
            why = f"“{row.title}” is a result, not an effect: there is nothing to add."
        elif self._busy:
            why = "Work is running; wait for it or cancel it below."
        else:
            why = ""
        set_usable(self.add_button, not why)
        gone = row.replaces if row is not None else ""
        self.add_button.setText("Exchange in &the model" if gone else "Add &to model")
        there = f"in place of {gone}" if gone else "in the model"
        help_text = f"Refit with {row.title} {there} (Enter)." if row is not None else ""
        if row is not None and row.key == Verdict.NOT_IN_CATALOGUE:
            self.add_button.setText("Wri&te an effect of your own…")
            help_text = OWN_HELP
        self.add_button.setToolTip(why or help_text)
        self.add_button.setAccessibleDescription(why or help_text)
