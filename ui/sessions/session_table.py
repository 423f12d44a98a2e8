"""The rows of the browser in its own words, addressed by path, with small pictures of motor motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QPointF,
    QRectF,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QPainter, QPolygonF
from PySide6.QtWidgets import QApplication, QStyle, QStyledItemDelegate, QStyleOptionViewItem

from fingerlab.core.text import percent, score_text
from fingerlab.diagnosis.score.calibration import Verdict
from fingerlab.library.index import UNWRITTEN, SessionFacts
from fingerlab.library.notes import LibraryEntry, Note, StoredVerdict, Test
from fingerlab.library.reviewing import Thumbnail, make_thumbnail
from fingerlab.report.diagnosis_words import in_sentence, kept_titles, listed
from fingerlab.sessions.model import Run, Session
from fingerlab.sessions.trajectory import motion_of_run

from ..app.worker import Worker
from ..widgets.layout import as_written
from ..widgets.tables import LINE_BREAK
from ..widgets.theme import colours_of, line, tint

PHASE_WORDS = {"on_air": "on air", "contact": "contact", "motor_bench": "motor bench", "free": "free"}


def run_words(run: Run, session: Session) -> str:
    """A run of a session, ``Run 002 · on air, extension, sine, 15°, 1 Hz``."""
    cable = "" if run.cable == "none" else f", {run.cable}"
    motion = motion_of_run(run, session.rig.line_radius)
    return f"Run {run.name} · {PHASE_WORDS.get(run.phase, run.phase)}{cable}, {motion}"


def duration(seconds: float) -> str:
    """``42 s``, ``3 min 05 s``, ``10 h 00 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{seconds:.1f} s" if seconds < 10 else f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def clock_time(when: datetime | None, stored: str) -> tuple[str, str]:
    """Date and time of day, both as stored: the clock that the lab notes were written by."""
    if when is None:
        return stored or "–", ""
    return f"{when:%Y-%m-%d}", f"{when:%H:%M:%S}"


def phases_text(facts: SessionFacts) -> str:
    """The phases, the first two by name."""
    words = [PHASE_WORDS.get(phase, phase) for phase in facts.phases]
    return "\n".join(words[:2]) + (f" +{len(words) - 2}" if len(words) > 2 else "")


def quality_text(facts: SessionFacts) -> str:
    """What is wrong with the recording, or that nothing is."""
    if facts.problem:
        known = next((words for words in (UNWRITTEN, "cut off") if words in facts.problem), None)
        return known or "✗ unreadable"
    if not facts.flags:
        return "✓ clean"
    return "\n".join(f"! {flag}" for flag in facts.flags[:2])


def verdict_text(verdict: StoredVerdict | None) -> str:
    """The verdict in two lines, or nothing where no table holds one."""
    if verdict is None:
        return ""
    sure = "" if verdict.probability is None else percent(verdict.probability)
    if verdict.effects and not unseen_in(verdict):
        words, more = titles_of(verdict)[0], len(verdict.effects) - 1
        if more and verdict.first is None:  # the probability is that it is one of them
            words = " or ".join(titles_of(verdict))
            sure = f"one of {len(verdict.effects)}, {sure}" if sure else sure
        elif more and verdict.first is not None:
            sure = f"{percent(verdict.first)}, not ruled out: {more} more"
    else:
        words = verdict.verdict.replace("_", " ")
    return f"{words}\n{'outdated' if verdict.outdated else sure}"


def titles_of(verdict: StoredVerdict) -> tuple[str, ...]:
    """What its effects are called: as the diagnosis found them; a table that is older holds ids alone."""
    return kept_titles(verdict.effects, verdict.titles)


def unseen_in(verdict: StoredVerdict) -> tuple[str, ...]:
    """Where nothing is missing: ids of the effects that the session could not have shown."""
    return verdict.effects if verdict.verdict == Verdict.NOTHING_MISSING else ()


def _searched(verdict: StoredVerdict | None) -> str:
    """The verdict with every effect that it does not rule out: one is found by any of their names."""
    found = verdict_text(verdict)
    if verdict is None or unseen_in(verdict):
        return found
    return "\n".join((found, *titles_of(verdict)))


def verdict_help(verdict: StoredVerdict | None) -> str:
    """Where the verdict comes from."""
    if verdict is None:
        return "Not diagnosed yet: no table of 'fingerlab batch' in this folder holds it."
    error = "" if verdict.score is None else f" Final error: {score_text(verdict.score)} times the floor."
    old = " The session was written after the table." if verdict.outdated else ""
    unseen = [*map(in_sentence, titles_of(verdict))] if unseen_in(verdict) else []
    others = [*map(in_sentence, titles_of(verdict)[1:])]
    if others and verdict.first is not None and not unseen and verdict.probability is not None:
        error = f"{error} Not ruled out: {listed(others)}; {percent(verdict.probability)} together."
    left = f" It leaves open, at a plausible strength: {listed(unseen)}." if unseen else ""
    return f"{' '.join(verdict_text(verdict).split())}, from {verdict.table.name}.{error}{left}{old}"


Index = QModelIndex | QPersistentModelIndex
NOWHERE = QModelIndex()

MOTOR, NAME, RECORDED, LENGTH, PHASES, RIG, QUALITY, VERDICT, TAGS = range(9)
TITLES = ("Motor", "Session", "Recorded", "Runs", "Phases", "Rig", "Quality", "Verdict", "Tags")
PATH_ROLE = Qt.ItemDataRole.UserRole


class SessionTable(QAbstractTableModel):
    """Holds all sessions of the folder; shows those that pass the filter."""

    def __init__(self) -> None:
        super().__init__()
        self._facts: dict[Path, SessionFacts] = {}
        self._notes: dict[Path, Note] = {}
        self._verdicts: Mapping[Path, StoredVerdict] = {}
        self._test: Test = lambda _: True
        self._shown: list[Path] = []
        self._sort = (RECORDED, Qt.SortOrder.DescendingOrder)

    # what there is

    def show_all(
        self,
        facts: Iterable[SessionFacts],
        notes: Mapping[Path, Note],
        verdicts: Mapping[Path, StoredVerdict],
    ) -> None:
        """Replace everything."""
        self._facts = {one.path: one for one in facts}
        self._notes = dict(notes)
        self._verdicts = verdicts
        self._refill()

    def show_note(self, path: Path, note: Note) -> None:
        """Other tags or notes for one session."""
        self._notes[path] = note
        if path in self._shown:
            row = self._shown.index(path)
            self.dataChanged.emit(self.index(row, 0), self.index(row, len(TITLES) - 1))

    def show_verdict(self, path: Path, verdict: StoredVerdict) -> None:
        """What was found of one session just now."""
        self._verdicts = {**self._verdicts, path: verdict}
        if path in self._shown:
            at = self.index(self._shown.index(path), VERDICT)
            self.dataChanged.emit(at, at)

    def filter(self, test: Test) -> None:
        """Show only sessions that pass."""
        self._test = test
        self._refill()

    @property
    def total(self) -> int:
        """Sessions in the folder, shown or not."""
        return len(self._facts)

    def facts(self, path: Path) -> SessionFacts | None:
        """Facts of a session."""
        return self._facts.get(path)

    def all_facts(self) -> tuple[SessionFacts, ...]:
        """Facts of all sessions."""
        return tuple(self._facts.values())

    def note(self, path: Path) -> Note:
        """What was noted of a session."""
        return self._notes.get(path, Note())

    def verdict(self, path: Path) -> StoredVerdict | None:
        """What a batch found out about a session."""
        return self._verdicts.get(path)

    def path(self, row: int) -> Path:
        """The session in a row."""
        return self._shown[row]

    def row(self, path: Path) -> int:
        """The row of a session; -1 where it is not shown."""
        return self._shown.index(path) if path in self._shown else -1

    # what Qt asks

    def rowCount(self, parent: Index = NOWHERE) -> int:
        return 0 if parent.isValid() else len(self._shown)

    def columnCount(self, parent: Index = NOWHERE) -> int:
        return 0 if parent.isValid() else len(TITLES)

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        if orientation == Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return TITLES[section]
        return None

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        path = self._shown[index.row()]
        if role == PATH_ROLE:
            return str(path)
        if role == Qt.ItemDataRole.DisplayRole:
            return self._text(path, index.column())
        if role == Qt.ItemDataRole.ToolTipRole:
            return as_written(self._help(path, index.column()))
        if role == Qt.ItemDataRole.AccessibleTextRole and index.column() == MOTOR:
            return f"Motor position of {self._facts[path].name}"
        return None

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:
        """By a column; by name where the column says the same."""
        self._sort = (column, order)
        self._refill()

    # how

    def _refill(self) -> None:
        self.layoutAboutToBeChanged.emit()
        kept = [(index, self._path_of(index)) for index in self.persistentIndexList()]
        shown = [path for path in self._facts if self._test(self._entry(path))]
        column, order = self._sort
        shown.sort(key=lambda path: self._facts[path].name)
        shown.sort(key=_keys(self)[column], reverse=order == Qt.SortOrder.DescendingOrder)
        self._shown = shown
        for old, path in kept:
            row = self.row(path) if path is not None else -1
            self.changePersistentIndex(old, self.index(row, old.column()) if row >= 0 else QModelIndex())
        self.layoutChanged.emit()

    def _path_of(self, index: QModelIndex) -> Path | None:
        return self._shown[index.row()] if 0 <= index.row() < len(self._shown) else None

    def _entry(self, path: Path) -> LibraryEntry:
        note = self.note(path)
        return LibraryEntry(self._facts[path], note.tags, note.notes, _searched(self.verdict(path)))

    def _text(self, path: Path, column: int) -> str:
        facts = self._facts[path]
        if column == NAME:
            return f"{facts.name}\n{facts.title}" if facts.title else facts.name
        if column == QUALITY:
            return quality_text(facts)
        if column == VERDICT:
            return verdict_text(self.verdict(path))
        if column == TAGS:
            return ", ".join(self.tags(path))
        if column == MOTOR or facts.problem:
            return ""
        if column == RECORDED:
            return "\n".join(clock_time(facts.when, facts.created)).rstrip()
        if column == LENGTH:
            return f"{facts.runs}\n{duration(facts.seconds)}"
        return phases_text(facts) if column == PHASES else facts.rig.replace(", ", "\n", 1)

    def tags(self, path: Path) -> tuple[str, ...]:
        """Tags of a session: those in the file, then those noted."""
        return tuple(dict.fromkeys((*self._facts[path].tags, *self.note(path).tags)))

    def _help(self, path: Path, column: int) -> str:
        facts = self._facts[path]
        if facts.problem:
            return facts.problem
        if column == QUALITY:
            return "\n".join(facts.flags) or "The file says nothing against the recording."
        if column == VERDICT:
            return verdict_help(self.verdict(path))
        if column == NAME:
            return str(path)
        return self._text(path, column).replace("\n", ", ")


def _keys(model: SessionTable) -> Mapping[int, Callable[[Path], Any]]:
    """What each column is sorted by."""

    def facts(path: Path) -> SessionFacts:
        found = model.facts(path)
        assert found is not None
        return found

    def recorded(path: Path) -> tuple[bool, float]:
        when = facts(path).when
        return when is not None, 0.0 if when is None else when.timestamp()

    return {
        MOTOR: recorded,
        NAME: lambda path: facts(path).name,
        RECORDED: recorded,
        LENGTH: lambda path: facts(path).seconds,
        PHASES: lambda path: facts(path).phases,
        RIG: lambda path: facts(path).rig,
        QUALITY: lambda path: (bool(facts(path).problem), len(facts(path).flags)),
        VERDICT: lambda path: verdict_text(model.verdict(path)),
        TAGS: model.tags,
    }


KEPT = 4000
"""Thumbnails held in memory: 1.5 kB each."""


class Thumbnails(QObject):
    """Signal ``ready(path)``: a thumbnail that was asked for is there."""

    ready = Signal(object)

    def __init__(
        self, parent: QObject | None = None, make: Callable[[Path], Thumbnail] = make_thumbnail
    ) -> None:
        super().__init__(parent)
        self._make = make
        self._kept: dict[tuple[Path, float], Thumbnail | None] = {}
        self._worker = Worker(self, newest_first=True)  # what fails, the row says

    def get(self, path: Path, modified: float) -> Thumbnail | None:
        """The thumbnail of a file as it was at a time; None while it is not read yet or cannot be."""
        key = (path, modified)
        if key not in self._kept:
            self._kept[key] = None
            self._worker.start("Browsing", lambda *_: self._make(path), partial(self._keep, key), key)
        return self._kept[key]

    def shut_down(self) -> None:
        self._worker.shut_down()

    def _keep(self, key: tuple[Path, float], found: Thumbnail) -> None:
        while len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]
        self._kept[key] = found
        self.ready.emit(key[0])


class ThumbnailDelegate(QStyledItemDelegate):
    """Paints the motor position of a session between its smallest and largest value."""

    def __init__(self, find: Callable[[Path], Thumbnail | None], parent: QObject) -> None:
        super().__init__(parent)
        self._find = find

    def paint(
        self, painter: QPainter, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        super().paint(painter, option, index)
        view: Any = option.widget
        found = self._find(Path(str(index.data(PATH_ROLE))))
        if found is None or not len(found.low):
            return
        room = QRectF(option.rect.adjusted(6, 5, -6, -5))
        selected = bool(option.state & QStyle.StateFlag.State_Selected)
        colours = colours_of(view)
        colour = colours.on_accent if selected else colours.measured
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(line(colour, 1.0))
        painter.setBrush(tint(colour, 0.35))
        painter.drawPolygon(outline(found, room))
        painter.setPen(line(colours.on_accent if selected else colours.line, 1.0))
        for place in found.breaks[1:] if len(found.breaks) <= len(found.low) // 3 else ():
            x = room.left() + room.width() * place / len(found.low)
            painter.drawLine(QPointF(x, room.top()), QPointF(x, room.bottom()))
        painter.restore()

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> QSize:
        return QSize(112, super().sizeHint(option, index).height())


class VerdictDelegate(QStyledItemDelegate):
    """A verdict whose name is longer than its column goes on in the second line, before how sure it is."""

    def initStyleOption(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        super().initStyleOption(option, index)
        asked: Any = option
        style = asked.widget.style() if asked.widget is not None else QApplication.style()
        margin = style.pixelMetric(QStyle.PixelMetric.PM_FocusFrameHMargin, asked, asked.widget) + 1
        room = asked.rect.width() - 2 * margin
        lines = asked.text.replace(LINE_BREAK, "\n")
        lines = in_two_lines(lines, lambda words: asked.fontMetrics.horizontalAdvance(words) <= room)
        asked.text = lines.replace("\n", LINE_BREAK)


def in_two_lines(text: str, fits: Callable[[str], bool]) -> str:
    """A name and, in the next line, what is said of it; the name goes on there where one line has no room.

    What is said ends in … behind its first part where there is no room for all of it beside the name's end.
    """
    name, _, said = text.partition("\n")
    words = name.split(" ")
    count = max((n for n in range(1, len(words) + 1) if fits(" ".join(words[:n]))), default=len(words))
    if count == len(words):
        return text
    first, rest = " ".join(words[:count]), " ".join(words[count:])
    shorter = said.partition(", ")
    second = f"{rest}, {said}" if said else rest
    return f"{first}\n{second if fits(second) or not shorter[1] else f'{rest}, {shorter[0]} …'}"


def outline(found: Thumbnail, room: QRectF) -> QPolygonF:
    """Along the largest values and back along the smallest, as large as there is room."""
    count = len(found.low)
    bottom, top = float(np.nanmin(found.low)), float(np.nanmax(found.high))
    scale = room.height() / (top - bottom) if top > bottom else 0.0
    x = room.left() + room.width() * (np.arange(count) + 0.5) / count
    upper = room.bottom() - scale * (found.high - bottom)
    lower = room.bottom() - scale * (found.low - bottom)
    there = [QPointF(float(a), float(b)) for a, b in zip(x, upper, strict=True)]
    back = [QPointF(float(a), float(b)) for a, b in zip(x[::-1], lower[::-1], strict=True)]
    return QPolygonF(there + back)
