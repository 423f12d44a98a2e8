"""The Acquire tab: connect a rig, see it, drive it, record it; one workflow, whichever device it is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from threading import Event
from typing import Any

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QMessageBox, QStackedWidget, QWidget

from fingerlab.acquisition.bench.bench import line_words
from fingerlab.acquisition.control.machine import (
    Disable,
    Enable,
    Finish,
    Jog,
    Mode,
    Release,
    Reset,
    SetGains,
    SetUp,
    Start,
    Tare,
    initial_of,
)
from fingerlab.acquisition.control.motion import Gains
from fingerlab.acquisition.protocols.finding import find_contact, take_up_slack
from fingerlab.acquisition.protocols.steps import countdown, prompt_of
from fingerlab.acquisition.recording import what_was_saved
from fingerlab.core.errors import UserError
from fingerlab.sessions.recording_files import recording_folder

from ..app.context import ApplicationContext
from ..app.tab_registry import Tab
from ..app.worker import Failed
from ..widgets.fields import take_typed
from ..widgets.layout import FLUSH, OnePage, SideRoom, hbox, vbox
from .acquire_bars import AbovePlots, AcquireHeader, LiveModelComparison, PlotToolbar, PromptBar, acquire_menu
from .acquire_panel import AcquirePanel, PanelActions
from .bench_controller import BenchController
from .bench_setup import (
    BenchRequest,
    FindCall,
    OpenBench,
    OpenCall,
    changed_set_up,
    effect_choices,
    fault_choices,
    find_devices,
    lift_and_start,
    lift_before,
    open_bench,
    run_choices,
)
from .check_page import CheckPage
from .connect_page import ConnectPage
from .force_trial_form import TrialTorques
from .live_plots import LivePlots
from .protocol_controller import ProtocolController, left_of_run
from .recording_control import DetailsDialog, RecordingControl, SessionDetails

TEXT_TABLES = (".csv", ".txt", ".tsv")
Choices = tuple[tuple[str, str], ...]
LOOKING = "Looking for devices"
JOG_SPEED = math.radians(10.0)
"""rad/s (assumed: a degree in a tenth of a second, as one lets go of a button)."""
AFTER_PICTURE_MS = 30
LONGEST_WAIT_S = 2.0
"""Looking for devices imports much, which would take the processor from the tab's first picture: it waits."""


class AcquireTab(Tab):
    """Composes the tab; all that it shows comes from the controller and the recording."""

    def __init__(
        self, context: ApplicationContext, opener: OpenCall = open_bench, finder: FindCall = find_devices
    ) -> None:
        super().__init__(context)
        self._finder = finder
        self.controller = BenchController(context, opener, self)
        self.recording = RecordingControl(
            self.controller, SessionDetails(context.settings.recordings()), self
        )
        self.connect_page = ConnectPage(context)
        self.plots = LivePlots()
        self.toolbar = PlotToolbar(self.plots)
        self.prompt = PromptBar()
        self.panel = AcquirePanel(self.controller, self.recording, self._actions())
        self.bar = self.header = AcquireHeader()
        self.check_page = CheckPage(self.controller)
        self.comparison = LiveModelComparison(context, self.controller, self.toolbar, self.plots)
        self.protocol = ProtocolController(
            context, self.recording, self.panel, self.prompt, self._on_set_up, self._refresh
        )
        self._looked = False
        self._painted = Event()
        self._mark_at: int | None = None
        self._jogging = False
        self._wanted: BenchRequest | None = None
        self._begun: OpenBench | None = None  # whose check was begun
        self._lasts_s: float | None = None
        self._moves: Mapping[str, Any] | None = None
        self._build()
        self.commands = acquire_menu(
            self.panel,
            self.toolbar,
            self.plots,
            self.prompt,
            self.recording,
            self.take_moment,
            self.disconnect_rig,
        )
        self._connect()
        self._refresh()

    def _build(self) -> None:
        self.torques = TrialTorques()
        self.beside_panel = QStackedWidget()
        self.beside_panel.addWidget(self.plots.free.beside(self.plots))
        self.plots.free.remember(self.context.settings, "acquire")
        self.beside_panel.addWidget(self.torques)
        left = vbox(None, AbovePlots(self.toolbar, self.prompt), (self.beside_panel, 1), spacing=0)
        bench = QWidget()
        hbox(bench, (left, 1), SideRoom(self.panel), margins=FLUSH, spacing=0)
        self.bench_page = bench
        self.pages = OnePage()
        self.pages.addWidget(self.connect_page)
        self.pages.addWidget(bench)
        self.pages.addWidget(self.check_page)
        self.widget = self.pages

    def _actions(self) -> PanelActions:
        ask, recording = self.controller.ask, self.recording
        return PanelActions(
            initialise=self._initialise,
            tare=lambda: ask("Resetting the load cell", Tare()),
            enable=self._toggle_enable,
            release=lambda: ask(
                "Releasing the stop", Release(), done=lambda: self.context.say("Stop released")
            ),
            reset=lambda: ask("Resetting the fault", Reset()),
            start=self._start,
            finish=lambda: ask("Coming to rest", Finish()),
            jog=self._jog,
            gains=self._change_gains,
            take_up=self._take_up,
            contact=self._find_contact,
            protocol=lambda: self.protocol.start(),
            record=self._toggle_record,
            pause=lambda: recording.pause(not recording.paused),
            mark=self._mark,
            write=recording.write,
            later=recording.writing.put_off,
            details=lambda: DetailsDialog(recording.details, self.widget).open(),
        )

    def _connect(self) -> None:
        controller, recording, context = self.controller, self.recording, self.context
        controller.changed.connect(self._on_controller)
        controller.ticked.connect(self._on_tick)
        recording.changed.connect(self._refresh)
        recording.written.connect(self._on_written)
        recording.put_off.connect(self._on_put_off)
        page = self.connect_page
        page.chosen.connect(self._open)
        self.check_page.drive_asked.connect(self._drive_checked)
        self.check_page.leave_asked.connect(self.disconnect_rig)
        page.look_asked.connect(self._look_for_devices)
        page.runs_asked.connect(self._look_for_runs)
        page.refused.connect(self.context.tell)
        self.panel.set_up_chosen.connect(self._on_set_up_chosen)
        self.panel.load_chosen.connect(self._on_load_chosen)
        self.panel.motions.done.connect(context.say)
        self.panel.motions.refused.connect(context.tell)
        self.panel.history.changed.connect(context.commands_changed)
        self.protocol.torques_planned.connect(self._show_torques)
        self.protocol.trial_taken.connect(self._show_trial)
        self.prompt.came.connect(self._leave_torques)
        self.bar.disconnect_asked.connect(self.disconnect_rig)
        self.bar.open_asked.connect(lambda path: context.open_paths([Path(path)]))

    # what the frame asks

    def window_title(self) -> str:
        return self.controller.status.device if self.controller.status is not None else ""

    def figure_source(self, plot: QWidget) -> str:
        return f"{self.window_title()}, live, {datetime.now():%Y-%m-%d %H:%M}"

    def on_shown(self) -> None:
        if not self._looked:
            self._looked = True
            self._tell_saved()
            QTimer.singleShot(AFTER_PICTURE_MS, self, self._painted.set)
            self.controller.call(
                LOOKING, self._choices, lambda choices: self.connect_page.show_choices(*choices)
            )
            self._look_for_devices()
        self.plots.refresh()

    def _tell_saved(self) -> None:
        """Once, what became of a recording in the middle of which FingerLab ended."""
        session = self.context.settings.under_way()
        if session is None:
            return
        saved = what_was_saved(session)
        if saved is None or not saved.held:
            self.context.settings.set_under_way(None)
        if saved is None:
            return
        self.context.tell(saved.sentence)
        (self.bar.show_written if saved.whole else self.bar.show_put_off)(saved.path)

    def accept_files(self, paths: Sequence[Path]) -> bool:
        if len(paths) != 1 or paths[0].suffix.lower() not in TEXT_TABLES:
            return False
        if self.protocol.take_file(paths[0]) and self.context.bench is None:
            self.connect_page.show_waiting(paths[0].name)
        return True

    def undo(self) -> None:
        self.panel.history.undo()

    def redo(self) -> None:
        self.panel.history.redo()

    @property
    def can_undo(self) -> bool:
        return self.connected() and self.panel.history.can_undo

    @property
    def can_redo(self) -> bool:
        return self.connected() and self.panel.history.can_redo

    def can_close(self) -> bool:
        running, checking = self.controller.driving, self.check_page.run.under_way
        kept = self.recording.session is None and not self.recording.in_protocol
        if not running and not checking and kept:
            return True
        what = "The amplifier is on" if running else "A recording is not yet written"
        what = "The check is not at its end" if checking else what
        if not ask_to_close(self.widget, what):
            return False
        self.controller.stop()
        return True

    def shut_down(self) -> None:
        self._painted.set()
        self.protocol.running.answer()
        self.recording.writing.hurry()
        self.controller.worker.shut_down(finish=True)
        self.recording.finish()
        self.controller.shut_down()

    # buttons

    def connected(self) -> bool:
        """Whether a bench is there to be driven."""
        return self.controller.bench is not None and not self._checks

    @property
    def _checks(self) -> bool:
        opened = self.controller.opened
        return self.controller.bench is not None and opened is not None and opened.to_check is not None

    def _open(self, wanted: BenchRequest) -> None:
        self._wanted = wanted
        self.controller.open(wanted)

    def _drive_checked(self) -> None:
        """The bench that was checked, opened anew: with its own limits, and what the check has come to."""
        if self._wanted is not None:
            self._open(replace(self._wanted, check=False))

    def disconnect_rig(self) -> None:
        """Let the device go; asked first where something would be lost."""
        if self.can_close():
            self.context.hush()  # what was said of this rig does not outlive it
            self.recording.finish()
            self.controller.close()
            self.context.say("Disconnected")
            self._look_for_devices()

    def _initialise(self) -> None:
        if self._wrong_angles():
            return
        self.controller.ask("Initialising", self.panel.initial.command())

    def _wrong_angles(self) -> bool:
        """Whether an angle to be set is none; its field lies in a menu that is shut, so it is told here."""
        wrong = take_typed(self.panel.initial.fields)
        if wrong:
            self.context.tell(wrong)
        return bool(wrong)

    def _toggle_enable(self) -> None:
        on = self.controller.mode in (Mode.ENABLED, Mode.RUNNING, Mode.STOPPING)
        self.controller.ask("Switching the amplifier", Disable() if on else Enable())

    def _jog(self, way: int) -> None:
        """Turn one way or the other, or hold; asked for again where a button was let go unseen."""
        self._jogging = way != 0
        self._lasts_s = None
        if way:
            self.controller.ask("Jogging", Jog(way * JOG_SPEED), doing="by hand")
        else:
            self.controller.do("Jogging", lambda bench: bench.ask(Jog(0.0)), failed=self._on_not_held)

    def _on_not_held(self, failed: Failed) -> None:
        """The button was let go of after STOP or a fault, whose own sentence stands there."""
        if self.controller.driving:
            self.context.tell(failed.sentence, failed.details)

    def _change_gains(self, gains: SetGains) -> None:
        self.controller.ask("Changing the gains", gains, done=self._mark_gains)

    def _mark_gains(self) -> None:
        words = self.panel.gains.words()
        self.context.say(f"Gains of the position loop: {words}")
        if self.recording.recording and self.controller.status is not None:
            self.recording.mark(f"gains: {words}", self.controller.status.index)

    def _take_up(self) -> None:
        if self._wrong_angles():
            return
        initial = self.panel.initial.command()

        def taken_up(slack: float) -> None:
            self.context.say(
                f"Slack of {math.degrees(slack):.1f}° taken up; the motor's reference is there now"
            )

        title = "Taking up the slack"
        self.controller.do(
            title, lambda bench: take_up_slack(bench, initial), taken_up, long=True, doing=title.lower()
        )

    def _find_contact(self) -> None:
        if take_typed([self.panel.protocol.force]):
            return
        force = self.panel.protocol.force.value()

        def found(angle: float | None) -> None:
            if angle is None:
                return
            offset = self.panel.motion.numbers["offset_deg"]
            degrees = round(math.degrees(angle), offset.decimals())
            offset.setValue(degrees)
            self.context.say(f"The fingertip presses at {degrees:g}°, which is the offset now")

        self._lasts_s = None
        title = "Finding the contact"
        self.controller.do(
            title, lambda bench: find_contact(bench, force), found, long=True, doing=title.lower()
        )

    def _start(self) -> None:
        motion, controller = self.panel.motion, self.controller
        if take_typed([self.panel.load, *motion.fields]):  # the field says what is wrong
            return
        start = Start(motion.settings(), motion.endless)
        try:
            lift = lift_before(controller.set_up, start.trajectory)
        except UserError as error:
            self.context.tell(str(error))
            return
        words = motion.words()
        lasts_s = None if motion.endless else motion.duration.value()

        def begun() -> None:
            self._lasts_s, self._moves = lasts_s, start.trajectory
            self.recording.mark_motion(words)

        if lift is None or controller.mode is Mode.RUNNING:  # what runs has the load lifted already
            controller.ask("Starting", start, done=begun, doing=words)
        else:
            self._lasts_s = None
            controller.do("Lifting the load", lift_and_start(lift, start), lambda _: begun(), doing=words)

    def _toggle_record(self) -> None:
        if self.recording.recording:
            self.recording.end()
        elif not take_typed([self.panel.before]):
            runs = self._moves if self.controller.mode is Mode.RUNNING else None
            self.recording.record(runs or self.panel.motion.settings(), self.panel.before.value())

    def take_moment(self) -> None:
        """Remember the moment of the key; the note may take its time."""
        if self.controller.status is not None:
            self._mark_at = self.controller.status.index
            self.panel.note.setFocus()
            self.panel.note.selectAll()

    def _mark(self) -> None:
        if self.recording.refusal("mark"):
            return
        status = self.controller.status
        assert status is not None
        index = self._mark_at if self._mark_at is not None else status.index
        self._mark_at = None
        note = self.panel.note.text()
        self.recording.mark(note, index)
        self.plots.mark(index, note.strip() or "marker")
        self.panel.note.clear()

    # set-up

    def _on_set_up_chosen(self, phase: str, cable: str) -> None:
        try:
            wanted = changed_set_up(
                self.controller.set_up, phase=phase, **({"cable": cable} if cable else {})
            )
        except UserError as error:
            self.context.tell(str(error))
            self.panel.show_set_up()
            return
        self.controller.apply(wanted, self._after_set_up)

    def _on_load_chosen(self, load_torque: float) -> None:
        wanted = changed_set_up(self.controller.set_up, load_torque=load_torque)

        def done() -> None:
            self._after_set_up()
            if self.controller.set_up == wanted:
                self.context.tell(prompt_of(wanted))

        if wanted != self.controller.set_up:
            self.controller.apply(wanted, done)

    def _on_set_up(self, set_up: SetUp) -> None:
        self.controller.set_up = set_up
        self._after_set_up()

    def _after_set_up(self) -> None:
        self.panel.show_set_up()
        self.comparison.show()

    # what is shown

    def _choices(self) -> tuple[Choices, Choices]:
        self._painted.wait(LONGEST_WAIT_S)
        return effect_choices(), fault_choices()

    def _look_for_devices(self) -> None:
        rig_file = self.connect_page.rig_file
        self.connect_page.show_looking()
        self.controller.call(
            LOOKING, lambda: self._finder(rig_file), self.connect_page.show_found, self._on_not_looked
        )

    def _on_not_looked(self, failed: Failed) -> None:
        """The rig file is none: the sentence, and the page as it was before."""
        self.context.tell(failed.sentence, failed.details)
        self.connect_page.show_not_looked()

    def _look_for_runs(self, session: Path) -> None:
        self.context.hush()
        self.controller.call(
            LOOKING, lambda: run_choices(session), lambda runs: self.connect_page.show_runs(session, runs)
        )

    def _on_controller(self) -> None:
        history = self.controller.history if self.connected() else None
        if self.plots.history is not history:
            self.plots.show_history(history)
            self.prompt.over()
            self.comparison.show()
            self._show_initial()
        if self._checks and self._begun is not self.controller.opened:
            self._begun = self.controller.opened
            status = self.controller.status
            self.check_page.begin(status.device if status is not None else "the rig")
        self._refresh()

    def _show_initial(self) -> None:
        """The values of the rig that was connected."""
        opened = self.controller.opened
        if opened is None:
            return
        if opened.checked is not None:
            tell = self.context.say if opened.checked.confirmed else self.context.tell
            tell(opened.checked.sentence(opened.rig))
        self.panel.show_rig(opened.rig)
        self.panel.history.note()
        try:
            self.panel.initial.show_command(initial_of(opened.rig))
        except UserError as error:
            self.context.tell(str(error))
        self.panel.gains.show_gains(Gains())  # another bench begins with the usual ones
        self.panel.history.given("initial")

    def _on_tick(self) -> None:
        if self._jogging and not (self.panel.back.isDown() or self.panel.forth.isDown()):
            self._jog(0)  # a dialog or another window took the mouse
        if not self.widget.isVisible():
            return
        if self._checks:
            self._show_lines()
            return
        self.plots.tick(self.controller.numbers_due, live=self.controller.live)
        if self.controller.numbers_due:
            self.comparison.show_errors()
            self.panel.refresh()
            self._count_down()
            status = self.controller.status
            key = (status.mode, status.latched, status.recording) if status is not None else None
            if key != getattr(self, "_last_mode", None):
                self._last_mode = key
                self.context.commands_changed.emit()
            self._show_lines()

    def _show_torques(self, plans: Mapping[str, Any]) -> None:
        """While the operator is asked whether a force trial's torque may be sent, it is drawn."""
        self.torques.show_plans(plans)
        self.beside_panel.setCurrentWidget(self.torques)

    def _show_trial(self, path: Path) -> None:
        from ..sessions.result_dialogs import show_force_trial

        show_force_trial(self.context, path, self.widget)

    def _leave_torques(self, asked: bool) -> None:
        if not asked:
            self.beside_panel.setCurrentIndex(0)

    def _show_lines(self) -> None:
        status = self.controller.status
        opened = self.controller.opened
        checked = opened.checked if opened is not None else None
        unchecked = checked is not None and not checked.confirmed and not self._checks
        self.bar.show_lines(line_words(status) if status is not None else {}, unchecked)

    def _count_down(self) -> None:
        """What is left of a motion that was started by hand for a time."""
        status, bench = self.controller.status, self.controller.bench
        words = ""
        running = status is not None and status.mode is Mode.RUNNING and not self.recording.in_protocol
        if self._lasts_s is not None and running and status is not None and bench is not None:
            words = f"{countdown(left_of_run(status, bench.rate_hz, self._lasts_s))} left"
        if words != self.panel.hand_left.text():
            self.panel.hand_left.setText(words)

    def _refresh(self) -> None:
        connected = self.connected()
        page = self.check_page if self._checks else self.bench_page if connected else self.connect_page
        self.pages.setCurrentWidget(page)
        busy = self.controller.worker.title
        self.connect_page.show_busy(busy if busy != LOOKING else "")
        device = self.controller.status.device if self.controller.status is not None else ""
        self.bar.show_device(device, self.recording.in_protocol)
        self._show_lines()
        if connected:
            self.panel.show_set_up()
            self.panel.refresh()
        self.context.commands_changed.emit()

    def _on_written(self, path: Path) -> None:
        self.bar.show_written(path)
        self.context.announce(f"Written and verified: {path}", path)

    def _on_put_off(self, path: Path) -> None:
        self.bar.show_put_off(path)
        self.context.tell(
            f"{path.name} is not written yet: the whole recording is kept beside it in "
            f"{recording_folder(path).name}, and becomes the file when you open it."
        )


def ask_to_close(parent: QWidget, what: str) -> bool:
    """Whether to stop the motor, write what was recorded, and go on."""
    box = QMessageBox(parent)
    box.setWindowTitle("FingerLab")
    box.setText(f"{what}. Stop the motor, write what was recorded, and close?")
    go_on = box.addButton("&Stop and close", QMessageBox.ButtonRole.AcceptRole)
    box.addButton("&Keep open", QMessageBox.ButtonRole.RejectRole)
    box.exec()
    return box.clickedButton() is go_on
