"""Tables of text or MATLAB become a session: what each column is, in which unit, and how it looks."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QRect, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QResizeEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QGridLayout,
    QHeaderView,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QScrollArea,
    QSplitter,
    QTableWidgetItem,
    QWidget,
)

from fingerlab.core.errors import UserError
from fingerlab.core.text import ScreenUnit, largest_of, screen_unit
from fingerlab.report.diagnosis_words import PHASE_WORDS
from fingerlab.sessions.model import CABLES, CHANNEL_UNITS, PHASES, Array

from ..widgets.fields import NumberField, choice, set_usable
from ..widgets.layout import FLUSH, Spacer, WrappedRow, as_written, described, hbox, resize_on_screen, vbox
from ..widgets.plots import DecimatedCurve, QuietPlot, span_of
from ..widgets.tables import NumberTable, remark
from ..widgets.theme import colours_of, tint
from .review_data import CHANNELS

if TYPE_CHECKING:
    from fingerlab.rig.file import Rig
    from fingerlab.sessions.importing import ImportPlan, TextRun
    from fingerlab.sessions.mapping import Axis, Column, Table

TABLE_ENDINGS = (".txt", ".csv", ".tsv", ".mat")
"""Of files that are taken for tables where they are dropped."""
RIGS = "Rig files (*.toml);;All files (*)"
NO_RIG = "The thesis' rig; masses, lengths and springs of the finger are assumed."
NO_AXIS_RIG = "None is needed; one may say what an ampere gives."
OPTION_NAMES = {
    "map its column with --map": "choose its column in the table",
    "say which column is which with --map": "choose what each column is",
    "say which is which with --map": "choose what each of them is",
    "or leave the time column out of --map": "or leave the time column unused",
    "is imported with --axis": "is imported with 'Log of one axis of any machine' ticked",
    "--radius should give the lever between the two in m": "'Lever' should say at which radius it turns",
    "--map": "the table of columns",
    "--rate": "'Samples a second'",
    "--phase": "phase",
    "--out": "name",
}
"""What the sentences of the command call an option, and what it is called here."""
UNUSED = ""
OF_A_FINGER = {"motor_command", "mcp_angle", "pip_angle"}
"""Channels that a log of one axis does not have, or seldom."""
TITLES = {"time": "time", "motor_current": "motor current", **{k: c.title for k, c in CHANNELS.items()}}
AXIS_TITLES = {
    "time": "time",
    "motor_position": "position",
    "motor_torque": "torque or force",
    "motor_current": "current",
    "load_torque": "known load",
    "motor_command": "command",
}
"""What the same are called in a log of one axis, whatever it is that moves; it has no others."""
OF_AN_AXIS = "; motor bench, cable none"
"""What is told of a run, and means nothing to who has a log of one axis."""
COLUMNS = (
    ("Column", "Title of the column, or its number."),
    ("Is", "The channel that it becomes; what is not used is left out."),
    ("Unit", "In which unit its numbers are."),
    ("Times", "A factor in front of the unit, such as 0.00153 for an encoder of 4096 steps read in rad."),
    ("Sign reversed", "The numbers are taken times −1, for a sensor that counts the other way."),
    ("First values", "As they stand in the file."),
)
SHOWN_VALUES, NAME_LETTERS = 3, 10
SEEN_ROOM = 14
"""Of the words on what will be written, for frame and margins, px."""
LISTED_LINES = 8
"""About as many lines of letters as the list of files is high; beyond them it scrolls."""
ROOM, NUMBER_WIDTH = 48, 180
"""Of a list beside its words, for frame and arrow, and of a number, px."""
AXIS_HELP = (
    "Time, position, torque or current, and load of any machine, in units that are named. A linear axis is "
    "told as an arc of 10 mm radius: 1 mm is 0.1 rad, 1 N is 0.01 N m."
)
LEVER_HELP = (
    "Radius at which a force turns the axis, mm; needed where the position is an angle and torque or load "
    "are a force, or the other way round. A linear axis is told as an arc of this radius."
)
CONSTANT_HELP = (
    "What an ampere gives at the axis, gear included; needed where no torque was logged: N m/A, or N/A where "
    "the position is a length."
)
RATE_HELP = "Needed only where no column holds the time."
LEGEND_ROOM = 6
"""Between the curves and their names above them, px."""
COLOURS = ("measured", "modelled", "residual", "candidate", "alike", "muted")


class ColumnTable(NumberTable):
    """A row for each column of a file, with a list of channels and one of units. Signal ``changed``."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__("importTable", "Columns of the file, and what they are", COLUMNS, words=6)
        self.setSelectionMode(NumberTable.SelectionMode.SingleSelection)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        heading = header.fontMetrics().horizontalAdvance(COLUMNS[0][0]) + ROOM // 2
        header.setMinimumSectionSize(max(NAME_LETTERS * self.fontMetrics().averageCharWidth(), heading))
        for place, letters in ((1, 18), (2, 10), (3, 6)):
            header.setSectionResizeMode(place, QHeaderView.ResizeMode.Fixed)
            header.resizeSection(place, letters * self.fontMetrics().averageCharWidth() + ROOM)
        self.verticalHeader().setDefaultSectionSize(2 * self.fontMetrics().height())
        self._names: list[str] = []
        self.by_hand = False
        self._axis: Axis | None = None

    def show_columns(
        self, table: Table, values: Array, found: Sequence[Column | None], axis: Axis | None
    ) -> None:
        """Start from what the columns are likely to be; values of shape (rows, columns)."""
        from fingerlab.sessions.mapping import words_of

        self.by_hand, self._axis = False, axis
        for row in range(self.rowCount()):
            for place in (1, 2, 3, 4):
                self.cellWidget(row, place).setObjectName("")  # they go a moment later
        self.setRowCount(0)
        self.setRowCount(table.columns)
        self._names = list(table.header or (f"column {k + 1}" for k in range(table.columns)))
        words = words_of(table)
        own = [c.channel for c in found if c is not None and c.channel not in CHANNEL_UNITS]
        for row, column in enumerate(found):
            numbers = "  ".join(f"{value + 0.0:g}" for value in values[:SHOWN_VALUES, row])
            if row in words:
                numbers = f"{words[row]}  (words)" if words[row] else "empty"
            for place, text in ((0, self._names[row]), (5, numbers)):
                self.setItem(row, place, _cell(text))
            titles = {k: TITLES.get(k, k) for k in CHANNEL_UNITS} if axis is None else AXIS_TITLES
            channels = {UNUSED: "not used", **titles, **{k: k for k in own}}
            kind = choice(f"importIs{row}", channels, f"Column {row + 1} is: the channel that it becomes.")
            unit = choice(f"importUnit{row}", {}, f"Unit of column {row + 1}: in which its numbers are.")
            turned = described(
                QCheckBox(), f"importTurned{row}", accessible=f"Column {row + 1}, sign reversed"
            )
            times = described(QLineEdit("1"), f"importTimes{row}", accessible=f"Column {row + 1}, times")
            for place, field in ((1, kind), (2, unit), (3, times), (4, turned)):
                self.setCellWidget(row, place, field)
            kind.setCurrentIndex(max(kind.findData(column.channel if column is not None else UNUSED), 0))
            self._offer_units(row, column.unit if column is not None else "")
            set_usable(kind, row not in words)
            set_usable(times, row not in words)
            set_usable(turned, row not in words)
            kind.activated.connect(lambda _=0, r=row: self._on_kind(r))
            unit.activated.connect(self._on_edited)
            times.textEdited.connect(self._on_edited)
            turned.toggled.connect(self._on_edited)
        self.selectRow(next((k for k, c in enumerate(found) if c is not None and c.channel != "time"), 0))

    def _field(self, row: int, place: int) -> QComboBox:
        field = self.cellWidget(row, place)
        assert isinstance(field, QComboBox)
        return field

    def kind(self, row: int) -> str:
        """The channel that a column becomes; empty: it is not used."""
        return str(self._field(row, 1).currentData())

    def unit(self, row: int) -> str:
        """The unit that is chosen for a column."""
        return str(self._field(row, 2).currentData() or "")

    def scale(self, row: int) -> float:
        """By what a column is multiplied: less than 0 where its sign is reversed.

        Raises:
            UserError: what stands there is no factor.
        """
        times, box = self.cellWidget(row, 3), self.cellWidget(row, 4)
        assert isinstance(times, QLineEdit)
        assert isinstance(box, QCheckBox)
        try:
            factor = float(times.text().replace(",", "."))
        except ValueError:
            factor = math.nan
        if not (math.isfinite(factor) and factor > 0):
            raise UserError(
                f"Column {row + 1} is taken times {times.text()!r}; it should be a number above 0, such as 1."
            )
        return -factor if box.isChecked() else factor

    def title(self, row: int) -> str:
        """What a column is called: its channel, or its own title where it is not used."""
        titles = TITLES if self._axis is None else AXIS_TITLES
        return titles.get(self.kind(row), self.kind(row)) or self._names[row]

    def _offer_units(self, row: int, wanted: str = "") -> None:
        from fingerlab.core.text import factor
        from fingerlab.sessions.mapping import units_of

        field, channel = self._field(row, 2), self.kind(row)
        units = units_of(channel, self._axis)
        target = CHANNEL_UNITS.get(channel, "")
        if wanted and wanted not in units and units:
            units = (wanted, *(unit for unit in units if factor(unit, target) != factor(wanted, target)))
        field.clear()
        if self._axis is not None and units and not wanted:
            field.addItem("choose …", "")
        for unit in units:
            field.addItem(unit, unit)
        usual = wanted or ("deg" if target == "rad" and self._axis is None else target)
        place = field.findData(usual)
        field.setCurrentIndex(0 if self._axis is not None and not wanted else max(place, 0))
        set_usable(field, bool(units))

    def _on_kind(self, row: int) -> None:
        """A channel is one column's: the one that had it before is not used any more."""
        for other in range(self.rowCount()):
            if other != row and self.kind(row) and self.kind(other) == self.kind(row):
                self._field(other, 1).setCurrentIndex(0)
                self._offer_units(other)
        self._offer_units(row)
        self.selectRow(row)
        self._on_edited()

    def _on_edited(self) -> None:
        self.by_hand = True
        self.changed.emit()

    def mapping(self) -> str:
        """What is shown, as ``fingerlab import --map`` has it.

        Raises:
            UserError: a factor is none.
        """
        rows = [row for row in range(self.rowCount()) if self.kind(row)]
        return ",".join(f"{self.kind(row)}={row + 1}:{self.unit(row)}:{self.scale(row)!r}" for row in rows)


def _cell(text: str) -> QTableWidgetItem:
    item = QTableWidgetItem(text)
    item.setToolTip(as_written(text))
    return item


class PreviewPlot(QuietPlot):
    """The chosen column over time, with those of the same unit beside it."""

    def __init__(self) -> None:
        super().__init__("importPreview", "Preview of the chosen column")
        self.setToolTip("The chosen column, bold, and the others of its unit, in the unit of the screen.")
        self.shown: Mapping[str, Array] = {}
        self._drawn: tuple[Array, str, ScreenUnit, str] | None = None
        self._legend = self.getPlotItem().addLegend(offset=(-4, 4))

    def show_columns(
        self, time: Array, across: str, curves: Mapping[str, Array], unit: str, chosen: str
    ) -> None:
        """Curves by title in the SI unit ``unit`` over ``time``; the chosen one is bold."""
        screen = screen_unit(unit, max((largest_of(values) for values in curves.values()), default=0.0))
        self.shown, self._drawn = curves, (time, across, screen, chosen)
        self.redraw()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if getattr(self, "_drawn", None) is not None:
            QTimer.singleShot(0, self, self.redraw)  # once the plot within knows its height

    def redraw(self) -> None:
        plot = self.getPlotItem()
        plot.clear()
        if getattr(self, "_drawn", None) is None:
            return
        assert self._drawn is not None
        time, across, unit, chosen = self._drawn
        self.name_axes(chosen[:1].upper() + chosen[1:], unit, across)
        colours = iter(COLOURS[1:] * (len(self.shown) // len(COLOURS) + 2))
        for name, values in self.shown.items():
            mine = name == chosen
            curve = DecimatedCurve(
                name=name, pen=self.pen("measured", 2.0) if mine else self.pen(next(colours), 1.0)
            )
            plot.addItem(curve)
            curve.setZValue(1 if mine else 0)
            curve.set_series(time, values * unit.factor)
        every = np.concatenate(list(self.shown.values())) * unit.factor
        low, high = span_of(every)
        room = plot.getViewBox().height()
        self._legend.setColumnCount(max(len(self.shown), 1))
        needed = min(self._legend.boundingRect().height() + LEGEND_ROOM, 0.6 * room)
        high += (high - low) * needed / max(room - needed, 1.0)
        plot.setRange(xRange=(float(time[0]), float(time[-1])), yRange=(low, high), padding=0.0)
        self._legend.setBrush(tint(colours_of(self).surface, 0.85))
        self._legend.setLabelTextColor(self.palette().text().color())
        self.setAccessibleDescription(f"{chosen} in {unit.symbol}, {len(time)} samples")


class ImportDialog(QDialog):
    """Asks until the plan is possible; the attributes are read once it is accepted.

    Attributes:
        plans: what becomes of each table. rig_file: of the bench, where one was chosen.
        axis_rig: the rig of a machine of one axis, where it is one.
    """

    def __init__(self, files: Sequence[Path], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Import tables – FingerLab")
        resize_on_screen(self, 960, 700)
        self.plans: tuple[ImportPlan, ...] = ()
        self.rig_file: Path | None = None
        self.axis_rig: Rig | None = None
        self._files = tuple(files)
        self._table: Table | None = None
        self._values: Array = np.zeros((0, 0))
        phases = {key: PHASE_WORDS.get(key, key) for key in PHASES}
        self._each = [
            (
                choice(f"importPhase{n}", phases, "Phase: what it was."),
                choice(f"importCable{n}", {key: key for key in CABLES}, "Cable: the one that was hung in."),
            )
            for n in range(len(self._files))
        ]
        self.axis = described(QCheckBox("Log of &one axis of any machine"), "importAxis", tip=AXIS_HELP)
        self.constant = NumberField()
        described(self.constant, "importConstant", accessible="Torque of an ampere, N m/A", tip=CONSTANT_HELP)
        self.lever = NumberField()
        described(self.lever, "importLever", accessible="Lever of a force, mm", tip=LEVER_HELP)
        self.rate = NumberField()
        described(self.rate, "importRate", accessible="Samples a second", tip=RATE_HELP)
        self.rig = described(QPushButton("&Rig file…"), "importRig")
        self.rig_words = remark(NO_RIG)
        self.columns = ColumnTable()
        self.preview = PreviewPlot()
        self.seen = described(QPlainTextEdit(), "importSeen", accessible="What will be written")
        self.seen.setReadOnly(True)
        self._build()
        self._connect()
        self._read()
        self._see_an_axis()

    def _build(self) -> None:
        for number, most, decimals, text in (
            (self.rate, 1e6, 2, "by the time column"),
            (self.constant, 1e3, 4, "not known"),
            (self.lever, 1e5, 3, "none"),
        ):
            number.setRange(0.0, most)
            number.setDecimals(decimals)
            number.setSpecialValueText(text)
            number.setMaximumWidth(max(NUMBER_WIDTH, number.minimumSizeHint().width()))
        grid = QGridLayout()
        grid.setColumnStretch(0, 1)
        titles = [remark(words, wrap=False) for words in ("File, one run each", "Phase", "Cable")]
        for column, title in enumerate(titles):
            grid.addWidget(title, 0, column)
        self._finger_only: tuple[QWidget, ...] = (
            *titles[1:], *(field for fields in self._each for field in fields)
        )  # fmt: skip
        for row, (path, fields) in enumerate(zip(self._files, self._each, strict=True), start=1):
            name = QLabel(path.name, textFormat=Qt.TextFormat.PlainText)
            name.setToolTip(as_written(str(path)))
            grid.addWidget(name, row, 0)
            for column, field in enumerate(fields, start=1):
                grid.addWidget(field, row, column)
        self._listed = QWidget()
        self._listed.setLayout(grid)
        self._list = QScrollArea(widgetResizable=True)
        self._list.setWidget(self._listed)
        samples, ampere = QLabel("&Samples a second"), QLabel("Torque of an &ampere (N m/A, or N/A)")
        lever = QLabel("&Lever (mm)")
        for label, number in ((samples, self.rate), (ampere, self.constant), (lever, self.lever)):
            label.setBuddy(number)
        self._current_only, self._axis_only = QWidget(), QWidget()
        for both, label, number in (
            (self._current_only, ampere, self.constant),
            (self._axis_only, lever, self.lever),
        ):
            hbox(both, label, number, margins=FLUSH, spacing=8)  # a label and its field in one row
        first = hbox(None, samples, self.rate, 16, self.rig, (self.rig_words, 1), Spacer(), spacing=8)
        second = WrappedRow((self.axis, self._current_only, self._axis_only))
        halves = QSplitter(Qt.Orientation.Vertical)
        for half in (self.columns, self.preview):
            halves.addWidget(half)
        halves.setChildrenCollapsible(False)
        halves.setSizes([260, 200])
        self.buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Cancel)
        self.write = self.buttons.addButton("&Write session…", QDialogButtonBox.ButtonRole.AcceptRole)
        self.write.setObjectName("importWrite")
        about = "The columns shown are those of the first file; a change holds for all."
        vbox(self, remark(about), self._list, second, first, (halves, 1), self.seen, self.buttons, spacing=8)

    def _connect(self) -> None:
        for field in (field for fields in self._each for field in fields):
            field.currentIndexChanged.connect(self.look)
        self.axis.toggled.connect(self._read)
        self.columns.changed.connect(self.look)
        self.columns.itemSelectionChanged.connect(self._preview)
        self.rate.valueChanged.connect(self.look)
        self.constant.valueChanged.connect(self.look)
        self.lever.valueChanged.connect(self.look)
        self.rig.clicked.connect(self._choose_rig)
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)

    @property
    def _axis(self) -> Axis | None:
        from fingerlab.sessions.mapping import Axis

        if not self.axis.isChecked():
            return None
        return Axis(self._lever_m, lever=True) if self._lever_m else Axis()

    @property
    def _lever_m(self) -> float | None:
        return self.lever.value() / 1e3 or None

    def _read(self) -> None:
        """The first rows of the first file, and what its columns are likely to be."""
        from fingerlab.sessions.importing import first_rows
        from fingerlab.sessions.mapping import likely_columns

        axis = self._axis
        for widget in self._finger_only:
            widget.setVisible(axis is None)
        self._axis_only.setVisible(axis is not None)
        self._listed.adjustSize()
        most = LISTED_LINES * self.fontMetrics().lineSpacing()
        self._list.setFixedHeight(min(self._listed.sizeHint().height() + 2 * self._list.frameWidth(), most))
        if self.rig_file is None:
            self.rig_words.setText(NO_RIG if axis is None else NO_AXIS_RIG)
        try:
            self._table, self._values = first_rows(self._files[0])
            self.columns.show_columns(self._table, self._values, likely_columns(self._table, axis), axis)
        except UserError:
            self._table = None  # the plan says why
        self.look()

    def _see_an_axis(self) -> None:
        """Tick the log of one axis where the file is one by its titles and no run of a finger."""
        from fingerlab.sessions.mapping import Axis, likely_columns

        if self.plans or self._table is None:
            return
        ways = (likely_columns(self._table, Axis()), likely_columns(self._table))
        found = {column.channel for columns in ways for column in columns if column is not None}
        self.axis.setChecked("motor_position" in found and not found & OF_A_FINGER)

    def look(self) -> None:
        """Plan with the fields as they are; say what would be written, or why that cannot be."""
        from fingerlab.rig.file import load_axis_rig
        from fingerlab.sessions.importing import TextRun, describe, of_one_axis, refuse_unknown_constant

        kinds = {self.columns.kind(row) for row in range(self.columns.rowCount())}
        self._current_only.setVisible(self.axis.isChecked() and "motor_current" in kinds)
        sources: list[TextRun] = [
            TextRun(path, str(phase.currentData()), str(cable.currentData()))
            for path, (phase, cable) in zip(self._files, self._each, strict=True)
        ]
        self.axis_rig = None
        try:
            if self.axis.isChecked():
                if self.rig_file is None:
                    known, constant = None, self.constant.value() or None
                else:
                    known, constant = load_axis_rig(self.rig_file), None
                sources, self.axis_rig = of_one_axis(sources, known, constant, self._lever_m)
            self.plans = self._planned(sources)
            if self.axis_rig is not None:
                named = self.rig_file.name if self.rig_file is not None else ""
                where = f"{'without a rig file, ' if named else ''}in 'Torque of an ampere'"
                for plan in self.plans:
                    refuse_unknown_constant(plan, self.axis_rig, named, where)
            told = [
                _plainly(line) for plan in self.plans for line in describe(plan) if "<- column" not in line
            ]
            words = in_the_window("\n".join(told), self._files, self.axis.isChecked())
        except UserError as error:
            self.plans, words = (), in_the_window(str(error), self._files, self.axis.isChecked())
        self.seen.setPlainText(words)
        self._fit_seen()
        self.write.setEnabled(bool(self.plans))
        self.write.setToolTip("" if self.plans else as_written(words))
        self._preview()

    def _fit_seen(self) -> None:
        """As high as its words are, up to five lines: the rest is the table's."""
        letters, wraps = self.seen.fontMetrics(), int(Qt.TextFlag.TextWordWrap)
        room = QRect(0, 0, max(self.seen.viewport().width() - SEEN_ROOM, 1), 1)
        lines = letters.boundingRect(room, wraps, self.seen.toPlainText()).height() / letters.lineSpacing()
        self.seen.setFixedHeight(min(max(math.ceil(lines), 2), 5) * letters.lineSpacing() + SEEN_ROOM)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_seen()

    def _planned(self, sources: Sequence[TextRun]) -> tuple[ImportPlan, ...]:
        """Each file by its own header until something is chosen here, or where that does not go."""
        from fingerlab.sessions.importing import plan_import

        rate = self.rate.value() or None
        if self.columns.by_hand:
            return plan_import(sources, self.columns.mapping(), rate)
        try:
            return plan_import(sources, None, rate)
        except UserError as by_header:
            if self._table is None:
                raise
            try:
                return plan_import(sources, self.columns.mapping(), rate)
            except UserError:
                raise by_header from None  # it knows the unit that stands there

    def _preview(self) -> None:
        """The chosen column, and beside it what is of the same unit."""
        row = self.columns.currentRow()
        if self._table is None or row < 0 or len(self._values) < 2:
            return
        if not np.isfinite(self._values[:, row]).any():  # a column of words
            return
        unit = self._unit_of(row)
        alike = [k for k in range(self.columns.rowCount()) if self._unit_of(k) == unit] if unit else []
        curves = {self.columns.title(k): self._in_si(k) for k in dict.fromkeys((*alike, row))}
        times = [k for k in range(self.columns.rowCount()) if self.columns.kind(k) == "time"]
        time, across = np.arange(len(self._values), dtype=np.float64), "Sample"
        if times and bool(np.all(np.diff(self._in_si(times[0])) > 0)):
            time, across = self._in_si(times[0]), "Time (s)"
        elif self.rate.value():
            time, across = time / self.rate.value(), "Time (s)"
        self.preview.show_columns(time, across, curves, unit, self.columns.title(row))

    def _unit_of(self, row: int) -> str:
        """In which a column is drawn; empty as long as nobody knows in which it stands there."""
        from fingerlab.sessions.mapping import drawn_unit

        target, unit = CHANNEL_UNITS.get(self.columns.kind(row), ""), self.columns.unit(row)
        if not unit:
            return ""
        return target if self._axis is None else drawn_unit(unit, target)

    def _in_si(self, row: int) -> Array:
        """A column's first rows in the unit of its channel; as they are where that is not known."""
        from fingerlab.core.text import factor

        unit, target = self.columns.unit(row), self._unit_of(row)
        times = (factor(unit, target) if target and unit else None) or 1.0
        with suppress(UserError):  # said beside the plan
            times *= self.columns.scale(row)
        return np.asarray(self._values[:, row] * times)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Return in a field takes what was typed there; it is no press of a button beside it."""
        enter = event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter)
        if not enter or isinstance(self.focusWidget(), QPushButton):
            super().keyPressEvent(event)

    def accept(self) -> None:
        if self.plans:
            super().accept()

    def _choose_rig(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Rig file", str(self._files[0].parent), RIGS)
        if name:
            self.rig_file = Path(name)
            self.rig_words.setText(name)
            set_usable(self.constant, False)
            self.constant.setToolTip("The rig file says what an ampere gives.")
            self.look()


def _plainly(line: str) -> str:
    """What a channel is made of, in words and signs that are no program's."""
    channel, arrow, made = line.partition(" <- ")
    if not arrow:
        return line
    words = re.sub(
        r"\w+_\w+", lambda found: TITLES.get(found[0], found[0].replace("_", " ")), f"{channel}: {made}"
    )
    return words.replace(" * ", " × ")


def in_the_window(sentence: str, files: Sequence[Path] = (), axis: bool = False) -> str:
    """A sentence of the command, with the names that options, channels, phases and ``files`` have here.

    Args:
        axis: it is of the log of one axis.
    """
    for path in files:
        sentence = sentence.replace(str(path), path.name)
    names = {**TITLES, **(AXIS_TITLES if axis else {}), **PHASE_WORDS}
    sentence = re.sub(r"'(\w+)'", lambda found: f"'{names.get(found[1], found[1])}'", sentence)
    for phase in PHASES:
        sentence = sentence.replace(f"; {phase}, cable", f"; {PHASE_WORDS.get(phase, phase)}, cable")
    sentence = re.sub(r"say them, such as --map (\"[^\"]*\"|\S*\w)", "choose them in the table", sentence)
    sentence = re.sub(r"say which is which, such as --map .*", "choose them in the table.", sentence)
    sentence = re.sub(r"(takes a factor to one of them), such as .*", r"\1 under 'Times'.", sentence)
    for option, name in OPTION_NAMES.items():
        sentence = sentence.replace(option, name)
    return sentence.replace(OF_AN_AXIS, "") if axis else sentence
