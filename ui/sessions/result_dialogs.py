"""Dialogs of results: what a force trial came to; two sessions, runs of the same motion over one another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QHeaderView, QLabel, QTableWidgetItem, QWidget

from fingerlab.core.text import NEWTON, ScreenUnit, fixed, largest_of
from fingerlab.diagnosis.settings import Z90
from fingerlab.prediction.trial import Trial
from fingerlab.report.comparison_words import (
    NOTABLE,
    cell,
    channel_title,
    channels_of,
    line_of,
    pair_title,
    pairs_sentence,
    result_sentences,
    trial_row,
)
from fingerlab.report.line_units import LineUnits
from fingerlab.sessions.model import Array
from fingerlab.signals.run_pairs import ChannelPair, RunPair, SessionPair

from ..app.context import ApplicationContext, read_session
from ..app.worker import IsCancelled, Progress
from ..widgets.layout import ResultDialog, described
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.series import Series
from ..widgets.tables import NumberTable, WholeLabel, remark
from ..widgets.theme import colours_of, large_font, small_font, tint

WIDTH, HEIGHT = 940, 720
MILLI_NEWTON = ScreenUnit("mN", 1e3)
TABLE_ROOM = 4
"""Below the last row, px."""
COLOURS = {"nominal": "modelled", "found": "candidate"}
COLUMNS = (
    ("Model", "Whose torque was sent."),
    ("Runs", "That count; practice does not."),
    ("Error, rms (mN)", "Measured less wanted force, low-passed at 8 Hz."),
    ("Foretold (mN)", "What the found model foretold of it before the runs."),
    ("Largest (mN)", "Mean of the runs' largest errors."),
    ("Run to run (mN)", "What differs between runs of the same model: no feed-forward takes it away."),
)


class TrialPlot(QuietPlot):
    """Force of each model's runs beside the wanted one, or what it misses: runs thin, their mean thick."""

    def __init__(self, name: str, accessible: str, missed: bool, parent: QWidget | None = None) -> None:
        self._missed = missed
        self._trial: Trial | None = None
        super().__init__(name, accessible, parent)
        title, unit = ("Measured less wanted", MILLI_NEWTON) if missed else ("Endpoint force", NEWTON)
        self._label_text = unit.label(title)
        self.name_axes(title, unit, "Time in the profile (s)")
        self.setToolTip(
            "F less wanted F, mN: every run thin, the mean of a model's runs thick."
            if missed
            else "F, N: what the load cell read, the mean of each model's runs; dashed what was wanted."
        )

    def show_trial(self, trial: Trial) -> None:
        """Another trial."""
        self._trial = trial
        self.redraw()

    def _curves(self) -> Iterator[tuple[str, str, bool, Array, Array]]:
        """Name, colour, whether thick, time (s) and values in the axis' unit."""
        trial = self._trial
        for model in (trial.nominal, trial.found) if trial is not None else ():
            if model is None:
                continue
            time, wanted, measured = model.courses
            if self._missed:
                for run, one in zip(model.runs, measured, strict=True):
                    yield (
                        f"run {run.run}, {model.model} model",
                        COLOURS[model.model],
                        False,
                        time,
                        1e3 * (one - wanted),
                    )
            mean = measured.mean(axis=0)
            shown = 1e3 * (mean - wanted) if self._missed else mean
            yield f"{model.model} model", COLOURS[model.model], True, time, shown
        if trial is not None and not self._missed:
            one = trial.found or trial.nominal
            assert one is not None
            time, wanted, _ = one.courses
            yield "wanted", "measured", True, time, wanted

    def redraw(self) -> None:
        plot = self.getPlotItem()
        plot.clear()
        curves = list(self._curves())
        if not curves:
            return
        for name, colour, thick, time, values in curves:
            pen = self.pen(colour, 1.8 if thick else 0.6, dashed=name == "wanted")
            plot.addItem(plain_curve(time, values, pen, name))
        low, high = span_of(np.concatenate([values for *_, values in curves]))
        zero = (min(low, 0.0), max(high, 0.0)) if self._missed else (min(low, 0.0), high)
        plot.setRange(xRange=(curves[0][3][0], curves[0][3][-1]), yRange=zero, padding=0.0)

    def shown_series(self) -> list[Series]:
        """For CSV."""
        across, label = "Time in the profile (s)", self._label_text
        return [Series(name, across, label, time, values) for name, _, _, time, values in self._curves()]


class TrialDialog(ResultDialog):
    """Sentences, the two plots, and the numbers."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, "forceTrial", "Force trial", WIDTH, HEIGHT)
        self.headline = described(WholeLabel(), "trialHeadline", font=large_font())
        self.words = described(WholeLabel(), "trialWords", font=small_font())
        self.force = TrialPlot("trialForces", "Wanted and measured force of both models", missed=False)
        self.error = TrialPlot("trialErrors", "Measured less wanted force of both models", missed=True)
        self.hint = remark("Blue: nominal model; green: found model; dashed: wanted.")
        self.table = NumberTable("trialNumbers", "Force error of both models", COLUMNS)
        plots = (self.force, 3), (self.error, 3)
        self.lay_out(self.headline, self.words, *plots, self.hint, self.table)

    def show_trial(self, trial: Trial, name: str) -> None:
        """What a session's trial came to; ``name`` of its file."""
        headline, *rest = result_sentences(trial)
        self.headline.setText(headline)
        self.words.setText(" ".join((*rest, f"Session {name}, model {trial.model_file}.")))
        self.force.show_trial(trial)
        self.error.show_trial(trial)
        models = [one for one in (trial.nominal, trial.found) if one is not None]
        self.table.show_rows([trial_row(model)[: len(COLUMNS)] for model in models])
        rows = self.table.verticalHeader().defaultSectionSize() * len(models)
        frame = 2 * self.table.frameWidth() + TABLE_ROOM
        self.table.setFixedHeight(self.table.horizontalHeader().sizeHint().height() + rows + frame)


def show_force_trial(context: ApplicationContext, path: Path, parent: QWidget) -> None:
    """Analyse the force trial of a session file off the GUI thread, and show it in a window of its own."""

    def work(progress: Progress, cancelled: IsCancelled) -> Trial:
        from fingerlab.prediction.trial import analyse_trial

        return analyse_trial(read_session(path))

    def done(trial: Trial) -> None:
        dialog = TrialDialog(parent)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.show_trial(trial, path.name)
        dialog.show()
        dialog.raise_()

    context.tasks.start(f"Looking at the force trial of {path.name}", work, done, "force trial")


PAIRS_WIDTH, PAIRS_HEIGHT = 980, 720
ROW_ROOM = 6
"""About the words of a row, px."""
STRONGEST, MOST_TIMES = 0.45, 20.0
"""Tint of a cell, and the difference over the scatter from which on it is no stronger."""


class PairPlot(QuietPlot):
    """One channel of a pair: both courses, or the second less the first with the scatter of a cycle."""

    def __init__(self, name: str, accessible: str, difference: bool, parent: QWidget | None = None) -> None:
        self._difference = difference
        self._pair: tuple[RunPair, str, tuple[str, str]] | None = None
        self._line = LineUnits()
        super().__init__(name, accessible, parent)
        self.setToolTip(
            "Second less first; the band is what one cycle differs by from another of its run (90 %)."
            if difference
            else "Mean cycles of both runs; phase 0 is where the motor passes its mean, rising."
        )

    def show_pair(self, pair: RunPair | None, channel: str, names: tuple[str, str], line: LineUnits) -> None:
        """Show a channel of a pair; ``names`` of the two sessions, ``line`` of their axis."""
        self._line = line
        self._pair = (pair, channel, names) if pair is not None and channel in pair.channels else None
        self.redraw()

    def _curves(self) -> tuple[RunPair, ChannelPair, ScreenUnit, list[tuple[str, Array]]]:
        assert self._pair is not None
        pair, channel, names = self._pair
        one = pair.channels[channel]
        curves = list(zip(names, (one.first, one.second), strict=True))
        if self._difference:
            curves = [("second less first", one.second - one.first)]
        unit = self._line.channel(channel, largest_of(float(np.abs(y).max()) for _, y in curves))
        return pair, one, unit, [(name, y * unit.factor) for name, y in curves]

    def redraw(self) -> None:
        plot = self.getPlotItem()
        plot.clear()
        if self._pair is None:
            return
        pair, one, unit, curves = self._curves()
        title = "Difference" if self._difference else channel_title(self._pair[1], self._line)
        self.name_axes(title, unit, "Phase (of a cycle)" if pair.periodic else "Time (s)")
        values = [y for _, y in curves]
        if self._difference:
            half = Z90 * one.scatter * unit.factor
            zero = np.zeros(len(pair.axis))
            self.draw_band(pair.axis, zero, half, tint(colours_of(self).floor, 0.35), "scatter")
            values += [half[np.isfinite(half)], -half[np.isfinite(half)]]
        roles = ("residual",) if self._difference else ("measured", "modelled")
        for number, (role, (name, y)) in enumerate(zip(roles, curves, strict=True)):
            plot.addItem(plain_curve(pair.axis, y, self.pen(role, 1.5, dashed=number == 1), name))
        plot.setRange(
            xRange=(pair.axis[0], pair.axis[-1]), yRange=span_of(np.concatenate(values)), padding=0.0
        )

    def shown_series(self) -> list[Series]:
        """For CSV."""
        if self._pair is None:
            return []
        pair, _, unit, curves = self._curves()
        across = "Phase (of a cycle)" if pair.periodic else "Time (s)"
        label = unit.label(channel_title(self._pair[1], self._line))
        return [Series(name, across, label, pair.axis, y) for name, y in curves]


class PairsDialog(ResultDialog):
    """A row for each pair of runs, a column for each channel; a click draws it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, "runPairs", "Compared run by run", PAIRS_WIDTH, PAIRS_HEIGHT)
        self.words = described(WholeLabel(), "pairWords", font=small_font())
        self.table = NumberTable("pairTable", "Differences of runs of the same motion", ())
        self.table.setSelectionBehavior(NumberTable.SelectionBehavior.SelectItems)
        self.table.setWordWrap(False)
        self.table.verticalHeader().setDefaultSectionSize(QFontMetrics(small_font()).height() + ROW_ROOM)
        self.table.currentCellChanged.connect(lambda *_: self._show_chosen())
        self.title = described(QLabel(), "pairTitle", font=small_font())
        self.curves = PairPlot("pairCurves", "Both runs over one another", difference=False)
        self.difference = PairPlot("pairDifference", "Second run less the first", difference=True)
        self._found: SessionPair | None = None
        self._channels: Sequence[str] = ()
        hint = remark(
            "A number is the root mean square of the second less the first, and in brackets how many times "
            "the scatter of a cycle that is. A click draws it; Ctrl+C copies the table."
        )
        plots = (self.curves, 3), (self.difference, 2)
        self.lay_out(self.words, (self.table, 3), self.title, *plots, hint)

    def show_pair(self, found: SessionPair) -> None:
        """Show two sessions that were compared."""
        self._found = found
        self.words.setText(" ".join((pairs_sentence(found), *found.refused)))
        units, line = channels_of(found), line_of(found)
        self._channels = tuple(units)
        columns = [("Runs", "Of the first session and of the second."), ("Motion", "That both were told.")]
        titles = {name: channel_title(name, line) for name in units}
        columns += [(unit.label(titles[n]), f"{titles[n]}: difference.") for n, unit in units.items()]
        self.table.set_columns(columns, words=2)
        self.table.setRowCount(len(found.pairs))
        colour = colours_of(self).residual
        for row, pair in enumerate(found.pairs):
            for column, text in enumerate(pair_title(pair, line)):
                item = QTableWidgetItem(text)
                item.setToolTip(text)
                self.table.setItem(row, column, item)
            for column, (name, unit) in enumerate(units.items(), start=2):
                shown = cell(pair, name, unit, line)
                item = QTableWidgetItem(shown.text)
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                item.setToolTip(shown.help)
                if shown.times > NOTABLE:
                    item.setBackground(tint(colour, STRONGEST * min(shown.times / MOST_TIMES, 1.0)))
                self.table.setItem(row, column, item)
        header = self.table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        self.table.setCurrentCell(0, 2 + max(self._strongest(found), 0))
        self._show_chosen()

    def _strongest(self, found: SessionPair) -> int:
        """The channel that differs most in the first pair, by its scatter."""
        first = found.pairs[0].channels if found.pairs else {}
        times = [first[n].times if n in first else 0.0 for n in self._channels]
        return int(np.argmax(np.nan_to_num(times))) if times else 0

    def _show_chosen(self) -> None:
        row, column = self.table.currentRow(), self.table.currentColumn() - 2
        found = self._found
        if found is None or not 0 <= row < len(found.pairs):
            return
        pair, line = found.pairs[row], line_of(found)
        channel = self._channels[min(max(column, 0), len(self._channels) - 1)]
        names = found.first.path.name, found.second.path.name
        lag = f"; the second was shifted by {fixed(1e3 * pair.lag, 0)} ms" if abs(pair.lag) > 5e-4 else ""
        cycles = f", {pair.cycles[0]} and {pair.cycles[1]} cycles" if pair.periodic else ""
        self.title.setText(
            f"{channel_title(channel, line)}, runs {pair_title(pair, line)[0]}: {names[0]} (solid), "
            f"{names[1]} (dashed){cycles}{lag}"
        )
        for plot in (self.curves, self.difference):
            plot.show_pair(pair, channel, names, line)
