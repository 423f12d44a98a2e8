"""The Calibrate tab: choose a sensor, be led through its steps, judge the result; or read a recording."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QFileDialog, QMessageBox, QStackedWidget, QWidget

from fingerlab.acquisition.control.machine import MoveByHand
from fingerlab.acquisition.ring import COLUMN
from fingerlab.calibration import SENSORS, StepTiming
from fingerlab.calibration.offline import outcome_from_files
from fingerlab.calibration.outcome import CalibrationOutcome
from fingerlab.calibration.sensors import Sensor, own_plan, standard_plan
from fingerlab.calibration.store import (
    ACCEPTED,
    CHANNELS,
    REJECTED,
    WITH_REASON,
    CalibrationRecord,
    CalibrationStore,
    apply_again,
    default_folder,
)
from fingerlab.calibration.wizard import Phase, Wizard
from fingerlab.core.errors import UserError

from ..app.context import ApplicationContext
from ..app.tab_registry import SEPARATOR, Command, Tab
from ..app.worker import Progress
from ..widgets.tables import header_name
from .measure_page import NO_RIG, MeasurePage, StartPage, VoltSource
from .result_page import SENSOR_NAMES, ResultPage

JOINTS = ("mcp", "pip")
RECORDINGS = "Recordings (*.txt *.csv *.tsv *.h5 *.hdf5);;All files (*)"
SESSIONS = "Session files (*.h5 *.hdf5)"
SIMULATED = (
    "The simulated rig is connected: a rehearsal, in which a button does what you would do with your hands. "
    "Faults of its sensors are chosen where it is connected, on Acquire."
)
UNCONNECTED = "No rig is connected. Connect one to calibrate it live, or calibrate from a recording."


class CalibrateTab(Tab):
    """Three pages: before, at work, result.

    Args:
        timing: how long each step is held. folder: for calibrations where no rig is connected.
    """

    def __init__(
        self, context: ApplicationContext, timing: StepTiming | None = None, folder: Path | None = None
    ) -> None:
        super().__init__(context)
        self._timing, self._folder = timing or StepTiming(), folder
        self.wizard: Wizard | None = None
        self.outcome: CalibrationOutcome | None = None
        self._source_words = ""
        self.source = VoltSource(context, self)
        self.start_page = StartPage()
        self.measure_page = MeasurePage(self.undo, self.redo, self._take, self.leave, self._rehearse)
        self._at_rest = 0.0
        self.result_page = ResultPage(self._decide, self._back)
        self.pages = QStackedWidget()
        for page in (self.start_page, self.measure_page, self.result_page):
            self.pages.addWidget(page)
        self.widget = self.pages
        self.header = self.title = header_name("calibrateTitle", "What is calibrated")
        self.commands = self._menu()
        self.source.arrived.connect(self._on_volts)
        self.start_page.start_asked.connect(self.start)
        self.start_page.file_asked.connect(self._ask_for_files)
        self.start_page.connect_asked.connect(lambda: context.show_tab("acquire"))
        self.start_page.again_asked.connect(self._ask_for_session)
        context.bench_changed.connect(self._on_bench)
        context.rig_changed.connect(self._on_rig)
        self._show_start()

    def _menu(self) -> tuple[Command, ...]:
        page, result = self.measure_page, self.result_page

        def press(text: str, button: Any, keys: str | None = None) -> Command:
            return Command(text, button.click, keys, lambda: button.isVisible() and button.isEnabled())

        starts = [
            press(f"Calibrate the {SENSOR_NAMES[name]}", button)
            for name, button in self.start_page.starts.items()
        ]
        return (
            *starts,
            SEPARATOR,
            press("It is as as&ked", page.take, "Ctrl+Return"),
            press("&Give up", page.leave),
            SEPARATOR,
            press("&Accept", result.accept, "Ctrl+Shift+Return"),
            press("Accept with the &reason", result.with_reason),
            press("Re&ject", result.reject),
            SEPARATOR,
            press("Apply to an old &session…", self.start_page.again),
        )

    # what the frame asks

    def window_title(self) -> str:
        sensor = self._sensor()
        return SENSOR_NAMES[sensor.name] if sensor is not None else ""

    def on_shown(self) -> None:
        if self.pages.currentWidget() is self.start_page:
            self._show_start()
        elif self.wizard is not None:
            self._show_reading()

    def accept_files(self, paths: Sequence[Path]) -> bool:
        texts = all(path.suffix.lower() in (".txt", ".csv", ".tsv") for path in paths)
        if not texts or self.wizard is not None:
            return False
        named = [name for name in SENSORS if any(name.split("-")[0] in p.name.lower() for p in paths)]
        if len(named) != 1:
            self.context.tell(
                "Of which sensor is it? Use From a recording beside the sensor, or put load, mcp or pip into "
                "the file's name."
            )
            return True
        self.read_files(named[0], paths)
        return True

    @property
    def can_undo(self) -> bool:
        return self.wizard is not None and self.wizard.can_undo

    @property
    def can_redo(self) -> bool:
        return self.wizard is not None and self.wizard.can_redo

    def undo(self) -> None:
        if self.wizard is not None and self.wizard.can_undo:
            self.wizard.undo()
            self._show_measuring()

    def redo(self) -> None:
        if self.wizard is not None and self.wizard.can_redo:
            self.wizard.redo()
            self._after_step()

    def can_close(self) -> bool:
        lost = self.wizard is not None and bool(self.wizard.captures)
        return not lost or ask_to_leave(self.widget)

    def shut_down(self) -> None:
        self.source.stop()

    # the wizard

    def start(self, name: str) -> None:
        """Begin with a sensor."""
        refusal = self.source.refusal
        if refusal:
            self.context.tell(refusal)
            return
        sensor = SENSORS[name]
        try:
            marks = self.start_page.marks(name)
            plan = standard_plan(sensor) if marks is None else own_plan(sensor, marks)
        except UserError as error:
            self.context.tell(str(error))
            return
        self.context.hush()  # what was said of marks before these
        bench = self.context.bench
        assert bench is not None
        channel = getattr(bench.rig.daq, CHANNELS[name][0])
        self.wizard = Wizard(plan, self._timing, rises=channel.sign * channel.gain > 0)
        self.measure_page.rehearse.setVisible(bench.simulated)
        newest = bench.bench.ring.last(200)
        self._at_rest = float(newest[:, COLUMN[f"{name}_angle"]].mean()) if name in JOINTS else 0.0
        line = self.context.rig_line
        self._source_words = line.device or "live"
        self.source.start(name)
        self._show_measuring()

    def leave(self) -> None:
        """Give up what is under way; asked first where steps would be lost."""
        if not self.can_close():
            return
        self._end()

    def _end(self) -> None:
        self.source.stop()
        bench = self.context.bench
        if bench is not None and bench.simulated and self.wizard is not None:
            with suppress(UserError):  # it may be gone, or stopped
                bench.bench.ask(MoveByHand(CHANNELS[self.wizard.plan.sensor.name][0], 0.0))
        self.wizard = self.outcome = None
        self._show_start()

    def _take(self) -> None:
        if self.wizard is not None:
            self.wizard.take_as_it_is()
            self._show_reading()

    def _rehearse(self) -> None:
        """The operator of the simulated rig does what is asked for now."""
        bench, wizard = self.context.bench, self.wizard
        if bench is None or wizard is None or wizard.move is None:
            return
        sensor = wizard.plan.sensor
        amount = sensor.mark_factor * wizard.move.mark - self._at_rest
        try:
            bench.bench.ask(MoveByHand(CHANNELS[sensor.name][0], amount))
        except UserError as error:
            self.context.tell(str(error))

    def _on_volts(self, time: Any, volts: Any) -> None:
        wizard = self.wizard
        if wizard is None or wizard.phase is Phase.DONE:
            return
        if self.source.refusal:
            wizard.interrupt()
        elif wizard.feed(time, volts):
            self._after_step()
        if wizard.phase is not Phase.DONE and self.pages.isVisible():
            self._show_reading()

    def _after_step(self) -> None:
        wizard = self.wizard
        assert wizard is not None
        if wizard.phase is Phase.DONE:
            self.context.say("All steps captured")
        else:
            self.context.say(f"Step {wizard.number} of {len(wizard.plan.moves)} captured")
            self._show_measuring()
            return
        try:
            outcome = wizard.outcome()
        except UserError as error:
            self.context.tell(str(error), traceback.format_exc())
            wizard.undo()
            self._show_measuring()
            return
        self._show_outcome(outcome, [], "&Back: undo the last step")

    def _on_rig(self) -> None:
        if self.start_page.isVisible():
            self._show_rig()

    def _on_bench(self) -> None:
        if self.wizard is not None:
            self.source.attach()
            self.wizard.interrupt()
            self._show_reading()
        elif self.outcome is None:
            self._show_start()

    # the result

    def _show_outcome(self, outcome: CalibrationOutcome, notes: list[str], back: str) -> None:
        self.outcome = outcome
        self.result_page.show_outcome(outcome, self._current().get(outcome.sensor.name), notes, back)
        self._turn_to(self.result_page)

    def _back(self) -> None:
        self.outcome = None
        if self.wizard is not None:
            self.undo()
        else:
            self._end()

    def _decide(self, accept: bool, reason: str) -> None:
        if self.outcome is None:
            return
        verdict = REJECTED if not accept else WITH_REASON if reason.strip() else ACCEPTED
        try:
            record = self.store().save(self.outcome, verdict, reason, self._source_words)  # type: ignore[arg-type]
        except UserError as error:
            self.context.tell(str(error), traceback.format_exc())
            return
        name = SENSOR_NAMES[record.sensor]
        if accept:
            again = " It counts once the rig is connected again." if self.context.bench is not None else ""
            self.context.announce(
                f"{name}: {record.title} is stored and counts for recordings to come.{again}"
            )
        else:
            self.context.announce(
                f"{name}: {record.title} is stored as rejected; the one before goes on to count."
            )
        self._end()

    # recordings and old sessions

    def _ask_for_files(self, name: str) -> None:
        names, _ = QFileDialog.getOpenFileNames(
            self.widget, f"Recording of the {SENSOR_NAMES[name]}", self.context.settings.folder(), RECORDINGS
        )
        if names:
            self.read_files(name, [Path(one) for one in names])

    def read_files(self, name: str, paths: Sequence[Path]) -> None:
        """Calibrate a sensor from one or two recordings."""

        def done(result: Any) -> None:
            outcome, notes = result
            if self.wizard is not None:
                return  # another calibration has begun meanwhile
            self._source_words = ", ".join(str(path) for path in paths)
            self._show_outcome(outcome, notes, "&Back")

        self._run(
            "Reading the recording",
            lambda progress: outcome_from_files(paths, SENSORS[name], progress=progress),
            done,
        )

    def _ask_for_session(self) -> None:
        folder = self.context.settings.folder()
        source, _ = QFileDialog.getOpenFileName(self.widget, "Session to calibrate anew", folder, SESSIONS)
        if not source:
            return
        path = Path(source)
        proposed = path.with_name(f"{path.stem}-calibrated{path.suffix}")
        target, _ = QFileDialog.getSaveFileName(self.widget, "Copy as", str(proposed), SESSIONS)
        if target:
            self.apply_to(path, Path(target))

    def apply_to(self, source: Path, target: Path) -> None:
        """Write a copy of a session with what counts now applied to its raw volts."""
        records = self._current()

        def done(result: Any) -> None:
            path, sentences = result
            self.context.recorded(path)
            self.context.announce(f"{path.name} is written: {'; '.join(sentences)}.", path)

        self._run("Calibrating anew", lambda progress: apply_again(source, target, records, progress), done)

    def _run(self, title: str, work: Callable[[Progress], Any], done: Callable[[Any], None]) -> None:
        self.context.hush()
        self.context.tasks.start(title, lambda progress, _cancelled: work(progress), done, owner="calibrate")

    # what is shown

    def store(self) -> CalibrationStore:
        """The calibrations of the rig that is connected, or of the default one."""
        bench = self.context.bench
        if bench is not None and bench.calibrations is not None:
            return CalibrationStore(bench.calibrations)
        return CalibrationStore(self._folder or default_folder())

    def _current(self) -> dict[str, CalibrationRecord]:
        try:
            return self.store().current()
        except UserError as error:
            self.context.tell(str(error), traceback.format_exc())
            return {}

    def _sensor(self) -> Sensor | None:
        if self.wizard is not None:
            return self.wizard.plan.sensor
        return self.outcome.sensor if self.outcome is not None else None

    def _turn_to(self, page: QWidget) -> None:
        sensor = self._sensor()
        source = f" – {self._source_words}" if self._source_words else ""
        self.title.setText(f"{sensor.title[:1].upper()}{sensor.title[1:]}{source}" if sensor else "")
        self.pages.setCurrentWidget(page)
        self.context.commands_changed.emit()

    def _show_start(self) -> None:
        self.start_page.show_current(self._current(), str(self.store().folder))
        self._show_rig()
        self._turn_to(self.start_page)

    def _show_rig(self) -> None:
        refusal = self.source.refusal
        bench = self.context.bench
        words = UNCONNECTED if refusal == NO_RIG else refusal
        if not words and bench is not None:
            device = self.context.rig_line.device or "a rig"
            words = SIMULATED if bench.simulated else f"{device[:1].upper()}{device[1:]} is connected."
        self.start_page.show_rig(words, refusal, bench is not None)

    def _show_measuring(self) -> None:
        assert self.wizard is not None
        self.outcome = None
        self.measure_page.show_steps(self.wizard)
        self._show_reading()
        self._turn_to(self.measure_page)

    def _show_reading(self) -> None:
        if self.wizard is not None:
            self.measure_page.show_reading(self.wizard, self.source.refusal)


def ask_to_leave(parent: QWidget) -> bool:
    """Whether the captured steps may be lost."""
    answer = QMessageBox.question(
        parent, "Calibration under way", "The captured steps are not stored yet and would be lost. Leave?"
    )
    return answer == QMessageBox.StandardButton.Yes
