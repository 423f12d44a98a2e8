"""What a force trial came to: by how much the force error fell, what was predicted, what is left by cause."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from fingerlab.core.text import NEWTON, ScreenUnit
from fingerlab.prediction.trial import Trial
from fingerlab.report.trial import result_sentences, trial_row
from fingerlab.sessions.model import Array

from ..app.context import ApplicationContext, read_session
from ..app.worker import IsCancelled, Progress
from ..widgets.layout import ResultDialog, described
from ..widgets.plots import QuietPlot, plain_curve, span_of
from ..widgets.series import Series
from ..widgets.tables import NumberTable, WholeLabel, remark
from ..widgets.theme import large_font, small_font

WIDTH, HEIGHT = 940, 720
MILLI_NEWTON = ScreenUnit("mN", 1e3)
ROOM = 4
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
        frame = 2 * self.table.frameWidth() + ROOM
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
