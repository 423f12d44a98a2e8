"""Work area of the Fit tab, plots above and parameters below; the thesis' experiment beside its print."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QGridLayout,
    QHeaderView,
    QLabel,
    QPushButton,
    QTableWidgetItem,
    QWidget,
)

from fingerlab.core.text import MILLISECOND, UNITLESS, in_words, r2_text, with_minus
from fingerlab.signals.periods import REGION_TITLES
from fingerlab.thesis.fitting import delay_estimate
from fingerlab.thesis.inspection import Inspection
from fingerlab.thesis.onair import RegionResult
from fingerlab.thesis.traces import JOINT_TITLES, JOINTS, Joint

from ..app.worker import Failed, IsCancelled, Progress, Worker
from ..widgets.fields import WholeField, progress_bar, set_usable
from ..widgets.layout import FLUSH, Panes, ResultDialog, Spacer, described, hbox, vbox
from ..widgets.tables import NumberTable, WholeLabel, remark
from ..widgets.theme import colours_of, small_font
from .fit_plots import REGION_COLOURS, PlanePlot, RunBars, SpeedPlot

if TYPE_CHECKING:
    from fingerlab.report.comparison_words import ComparedQuantity

WIDTH, HEIGHT = 760, 620
MOST_BENCHES = 100
REPLICATE_COLUMNS = (
    ("Quantity", "As the thesis names it."),
    ("Published", "In the thesis, with its deviation over runs; in brackets a tolerance of ours."),
    ("Ours", "Mean and deviation over the runs of the simulated benches."),
    ("", "*: further off than the published deviation."),
    ("Unit", ""),
)
PUBLISHED = 1
PRESET = "as-built"


def squared(text: str) -> str:
    """With the sign that a terminal may lack."""
    return text.replace("R2", "R²")


class ReplicateDialog(ResultDialog):
    """What ``fingerlab replicate`` does. A seed draws the bench within its tolerances, and its noise."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, "replicate", "The thesis' experiment again", WIDTH, HEIGHT)
        self._worker = Worker(self)
        self.seed = self._field("replicateSeed", "Seed of the first bench", 0, 10**6, 1)
        self.benches = self._field("replicateBenches", "How many benches", 1, MOST_BENCHES, 1)
        self.run = described(QPushButton("&Run"), "replicateRun", primary="true")
        self.progress = progress_bar("replicateProgress", "How far it is")
        self.words = described(WholeLabel(), "replicateWords", font=small_font())
        self.table = NumberTable("replicateTable", "Published numbers and ours", REPLICATE_COLUMNS)
        self._build()
        self.run.clicked.connect(self._run_or_stop)
        self._worker.progressed.connect(lambda share, _what: self.progress.setValue(round(1000 * share)))
        self._worker.failed.connect(self._on_failed)
        self._worker.busy_changed.connect(self._refresh)
        self._worker.ended.connect(lambda _how: self._refresh())
        self._refresh()

    def _field(self, name: str, help_text: str, low: int, high: int, value: int) -> WholeField:
        field = described(WholeField(), name, accessible=help_text, tip=help_text)
        field.setRange(low, high)
        field.setValue(value)
        return field

    def _build(self) -> None:
        seed, benches = QLabel("&Seed"), QLabel("&Benches")
        seed.setBuddy(self.seed)
        benches.setBuddy(self.benches)
        fields = (seed, self.seed, 8, benches, self.benches, 8, self.run)
        row = hbox(None, *fields, (self.progress, 1), Spacer(0), spacing=8)
        hint = remark("Some ten seconds a bench; the bench as it was built. Ctrl+C copies the table.")
        self.lay_out(row, self.words, (self.table, 1), hint)

    def _run_or_stop(self) -> None:
        if self._worker.busy:
            self._worker.cancel()
            return
        seeds = [self.seed.value() + number for number in range(self.benches.value())]

        def work(progress: Progress, cancelled: IsCancelled) -> tuple[ComparedQuantity, ...]:
            from fingerlab.core.progress import Watch
            from fingerlab.report.comparison_words import replicated

            return replicated(PRESET, seeds, Watch(progress, cancelled))

        self._worker.start("Replicating", work, self._show)  # what stands stays until there is another

    def _show(self, lines: Sequence[ComparedQuantity]) -> None:
        from fingerlab.report.comparison_words import cells, outcome_sentences

        rows = [(squared(title), *map(with_minus, rest)) for title, *rest in map(cells, lines)]
        self.table.show_rows(rows)
        for row, line in enumerate(lines):
            item = self.table.item(row, PUBLISHED)
            if item is not None and line.tolerance is not None:
                item.setToolTip(line.tolerance.reason)
        said = squared(outcome_sentences(lines)[0])
        self.words.setText(f"{said} Spreads in brackets are ours; the mouse says why.")

    def _on_failed(self, failed: Failed) -> None:
        self.words.setText(failed.sentence)
        self.table.show_rows([])

    def _refresh(self) -> None:
        busy = self._worker.busy
        self.run.setText("&Stop" if busy else "&Run")
        self.progress.setVisible(busy)
        for field in (self.seed, self.benches):
            set_usable(field, not busy)

    def shut_down(self) -> None:
        """Wait until what runs has ended."""
        self._worker.shut_down()


COLUMNS = (
    ("Cable", "The cable with which the runs on air were moved."),
    ("Joint", "Its equation: LHS = s a T + L, thesis (3.16) and (3.17)."),
    ("Region", "Part of the period: flexion, extension and the standstills after each."),
    (
        "Moment arm\n(mm)",
        "a or b: s times the slope of joint torque on cable tension, with its 90 % interval.",
    ),
    (
        "Kinematic\narm (mm)",
        "Kinematic moment arm: a, b of x_m = x0 + s (a θ1 + b θ2), with its 90 % interval.",
    ),
    ("Friction loss\n(mN m)", "L: the line's torque at no tension, with its 90 % interval. Nominal: 0."),
    ("Nominal loss\n(mN m)", "The nominal equations hold no friction loss."),
    (
        "R²,\nall runs",
        "Of one line through the samples of all runs, about their common mean. What differs from run to run "
        "counts, so that it can be high where the line explains little within a run, as at a standstill.",
    ),
    ("Delay\n(ms)", "By which the tension was shifted before the fit, mean over runs. Nominal: 0."),
)
LEAST_CHARACTERS = 16
"""Width that each column keeps, in characters: room for the longest word of a heading."""
RowKey = tuple[str, Joint, str]


class ParameterTable(NumberTable):
    """One row a cable, joint and region. Signal ``chosen`` (cable, joint, region): another row is current."""

    chosen = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("parameters", "Fitted parameters with 90 % intervals", COLUMNS, 3, parent)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        # A narrower window scrolls before it cuts words.
        self.horizontalHeader().setMinimumSectionSize(
            LEAST_CHARACTERS * self.fontMetrics().averageCharWidth()
        )
        self.verticalHeader().setDefaultSectionSize(round(1.7 * self.fontMetrics().height()))
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.keys: list[RowKey] = []
        self.currentCellChanged.connect(self._on_row)

    def show_inspection(self, found: Inspection) -> None:
        """Fill in another fit; the row that was chosen stays if it is there."""
        before = self.key()
        with QSignalBlocker(self):
            self.keys = [(c, j, r) for c, results in found.fit.cables.items() for j, r in results]
            self.setRowCount(len(self.keys))
            for row, (cable, joint, region) in enumerate(self.keys):
                result = found.fit.cables[cable][joint, region]
                arms = found.kinematic.get(cable, {})
                kinematic = with_minus(in_words(arms[joint], with_unit=False)) if joint in arms else "–"
                texts = [cable, JOINT_TITLES[joint], REGION_TITLES[region], *_cells(result, kinematic, found)]
                for column, text in enumerate(texts):
                    item = QTableWidgetItem(text)
                    if column > 2:
                        item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                    self.setItem(row, column, item)
        self.choose(before if before in self.keys else _first(self.keys))

    def choose(self, key: RowKey | None) -> None:
        """Make a row the current one."""
        row = self.keys.index(key) if key in self.keys else -1
        self.setCurrentCell(row, 3)
        self.chosen.emit(self.key())

    def key(self) -> RowKey | None:
        """Cable, joint and region of the current row."""
        row = self.currentRow()
        return self.keys[row] if 0 <= row < len(self.keys) else None

    def _on_row(self, row: int, _column: int, before: int, _before_column: int) -> None:
        if row != before:
            self.chosen.emit(self.key())


def _cells(result: RegionResult, kinematic: str, found: Inspection) -> tuple[str, ...]:
    fitted = result.pooled
    if fitted is None:
        return ("not found", kinematic, "–", "0", "–", "–")
    delay = "0, not fitted"
    if found.fit.spec.delay != "none":
        delay = with_minus(in_words(delay_estimate(fitted.delay_s, result.delays_s), with_unit=False))
    return (
        with_minus(in_words(fitted.moment_arm, with_unit=False)),
        kinematic,
        with_minus(in_words(fitted.loss, with_unit=False)),
        "0",
        r2_text(fitted.r2),
        delay,
    )


def _first(keys: list[RowKey]) -> RowKey | None:
    """The extension of the PIP joint: the region that the thesis ended with."""
    return next((k for k in keys if k[1:] == ("pip", "extension")), keys[0] if keys else None)


class FitResultView(QWidget):
    """Shows one fit; the table's row says which joint and region, the panel which run.

    Signal ``run_wanted(name)``: a row of another cable was chosen, so another run has to be shown.
    """

    run_wanted = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.found: Inspection | None = None
        self.run = ""
        self.speeds = {joint: SpeedPlot(joint) for joint in JOINTS}
        self.plane = PlanePlot()
        self.r2 = RunBars("r2Bars", "R² within the run", UNITLESS, top=1.06)
        self.r2.setToolTip(
            "R² = 1 − Σ(LHS − line)² / Σ(LHS − mean)²: share of the joint torque's variance within a run "
            "that the run's own line explains. The table's is of one line through all runs."
        )
        self.delays = RunBars("delayBars", "Delay of torque after tension", MILLISECOND)
        self.delays.setToolTip(
            "Δt, ms: by how much the joint torque LHS comes after the cable tension T, by run and region; "
            "positive where the tension is first."
        )
        self.table = ParameterTable()
        self.plane_words, self.r2_words, self.delay_words = _words(), _words(), _words()
        self._build()
        self.table.chosen.connect(self._on_row)

    def _build(self) -> None:
        above = QWidget()
        speeds = hbox(above, margins=FLUSH)
        for plot in self.speeds.values():
            speeds.addWidget(plot)
        middle = QWidget()
        grid = QGridLayout(middle)
        grid.setContentsMargins(0, 4, 0, 0)
        grid.setVerticalSpacing(0)
        columns = (
            (self.plane_words, self.plane, 4),
            (self.r2_words, self.r2, 4),
            (self.delay_words, self.delays, 3),
        )
        for column, (words, plot, share) in enumerate(columns):
            grid.addWidget(words, 0, column)
            grid.addWidget(plot, 1, column)
            grid.setColumnStretch(column, share)
        self.panes = Panes("fit", ((above, 5), (middle, 6), (self.table, 5)), (200, 260, 220))
        vbox(self, self.panes, margins=FLUSH)

    def show_inspection(self, found: Inspection) -> None:
        """Another fit."""
        self.found = found
        self.table.show_inspection(found)

    def show_run(self, name: str) -> None:
        """Another run of the fit, by name."""
        self.run = name
        found = self.found
        if found is None or name not in found.views:
            return
        view = found.views[name]
        for plot in self.speeds.values():
            plot.show_view(view)
        key = self.table.key()
        if key is not None and key[0] != view.cable:
            self.table.choose((view.cable, key[1], key[2]))
        else:
            self._show_choice()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self._show_choice()  # the legends name colours

    def _on_row(self, key: RowKey | None) -> None:
        found = self.found
        if found is None or key is None:
            return
        if self.run in found.views and found.views[self.run].cable != key[0]:
            self.run_wanted.emit(found.fit.used[key[0]][0])
        self._show_choice()

    def _show_choice(self) -> None:
        found, key = self.found, self.table.key()
        if found is None or key is None:
            return
        cable, joint, region = key
        view = found.views.get(self.run)
        title = JOINT_TITLES[joint]
        self.plane.show_plane(joint, region, None if view is None else view.planes.get((joint, region)))
        colours = colours_of(self)
        self.plane_words.setText(
            f"Run {escape(self.run)}: <span style='color:{colours.modelled}'><b>—</b></span> this run, "
            "90 % interval; "
            f"<span style='color:{colours.candidate}'><b>- -</b></span> all runs"
        )
        results = found.fit.cables[cable]
        names = found.fit.used[cable]
        regions = found.fit.spec.regions
        self.r2.show_bars(names, {r: results[joint, r].r2.values for r in regions})
        self.r2_words.setText(f"{title}: {self._legend(regions)}")
        places = [list(found.views).index(name) for name in names]
        delays = {r: tuple(v[i] for i in places) for r, v in found.delays_s[joint].items()}
        self.delays.show_bars(names, delays)
        used = "used in the fit" if found.fit.spec.delay in ("xcorr", "findsignal") else "not in the fit"
        how = "colours as at the left" if "whole" not in delays else "by cross-correlation"
        self.delay_words.setText(f"{title}, delay: {how}; {used}")

    def _legend(self, regions: tuple[str, ...]) -> str:
        colours = colours_of(self)
        return " ".join(
            f"<span style='color:{getattr(colours, REGION_COLOURS[r])}'>■</span>&nbsp;{REGION_TITLES[r]}"
            for r in regions
        )


def _words() -> QLabel:
    label = described(WholeLabel(), font=small_font())
    label.setTextFormat(Qt.TextFormat.RichText)
    label.setMinimumWidth(10)
    return label
