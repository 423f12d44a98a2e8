"""The Acquire tab: connect a rig, see it, drive it, record it; one workflow, whichever device it is."""

from __future__ import annotations

import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QFileDialog, QHBoxLayout, QMessageBox, QStackedWidget, QVBoxLayout, QWidget

from fingerlab.acquisition.commands import (
    Disable,
    Enable,
    Finish,
    Initialise,
    Release,
    Reset,
    SetUp,
    Start,
    Tare,
)
from fingerlab.acquisition.machine import Mode
from fingerlab.errors import UserError
from fingerlab.identify.live_model import Balance

from ..desk import Desk
from ..tab import SEPARATOR, Command, Tab
from .caller import Call
from .channels import PLOTS, QUANTITIES
from .connect_page import ConnectPage
from .details_dialog import DetailsDialog
from .header import AcquireHeader
from .opening import OpenCall, effect_choices, find_devices, open_bench
from .panel import Actions, Panel
from .plots import LivePlots
from .prompt_bar import PromptBar
from .protocol_form import clock
from .recording import Details, Recording
from .station import Station, changed_set_up
from .toolbar import FILE, FROM_FILE, NO_MODEL, NOMINAL, Toolbar

TEXT_TABLES = (".csv", ".txt", ".tsv")
MODEL_FILTER = "Model files (*.json);;All files (*)"


class AcquireTab(Tab):
    """Composes the tab; all that it shows comes from the station and the recording."""

    def __init__(self, desk: Desk, opener: OpenCall = open_bench) -> None:
        super().__init__(desk)
        self.station = Station(desk, opener, self)
        self.recording = Recording(self.station, Details(desk.settings.recordings()), self)
        self.connect_page = ConnectPage(desk.settings.folder())
        self.plots = LivePlots()
        self.toolbar = Toolbar(self.plots)
        self.prompt = PromptBar()
        self.panel = Panel(self.station, self.recording, self._actions())
        self.bar = self.header = AcquireHeader()
        self._balance: Balance | None = None
        self._model_path: Path | None = None
        self._compares = NO_MODEL
        self._looked = False
        self._mark_at: int | None = None
        self._protocol_began = 0.0
        self._build()
        self.commands = self._menu()
        self._connect()
        self._tell_total()
        self._refresh()

    def _build(self) -> None:
        left = QVBoxLayout()
        left.setSpacing(0)
        left.addWidget(self.prompt)
        left.addWidget(self.toolbar)
        left.addWidget(self.plots, 1)
        bench = QWidget()
        across = QHBoxLayout(bench)
        across.setContentsMargins(0, 0, 0, 0)
        across.setSpacing(0)
        across.addLayout(left, 1)
        across.addWidget(self.panel)
        self.bench_page = bench
        self.pages = QStackedWidget()
        self.pages.addWidget(self.connect_page)
        self.pages.addWidget(bench)
        self.widget = self.pages

    def _actions(self) -> Actions:
        ask, recording = self.station.ask, self.recording
        return Actions(
            initialise=lambda: ask("Initialising", Initialise()),
            tare=lambda: ask("Resetting the load cell", Tare()),
            enable=self._toggle_enable,
            release=lambda: ask("Releasing the stop", Release()),
            reset=lambda: ask("Resetting the fault", Reset()),
            start=self._start,
            finish=lambda: ask("Coming to rest", Finish()),
            protocol=self._run_protocol,
            record=self._toggle_record,
            pause=lambda: recording.pause(not recording.paused),
            mark=self._mark,
            write=recording.write,
            details=lambda: DetailsDialog(recording.details, self.widget).open(),
        )

    def _connect(self) -> None:
        station, recording, desk = self.station, self.recording, self.desk
        station.changed.connect(self._on_station)
        station.ticked.connect(self._on_tick)
        station.stopped.connect(lambda _: self.prompt.hide())
        recording.changed.connect(self._refresh)
        recording.written.connect(self._on_written)
        recording.asked.connect(self.prompt.ask)
        recording.progressed.connect(self._on_progress)
        recording.set_up_changed.connect(self._on_set_up)
        recording.ended.connect(self._on_protocol_ended)
        self.prompt.done.connect(recording.answer)
        self.connect_page.chosen.connect(station.open)
        self.connect_page.rig_file_changed.connect(self._look_for_devices)
        self.panel.set_up_chosen.connect(self._on_set_up_chosen)
        self.panel.motion.edited.connect(self._tell_total)
        self.panel.protocol.edited.connect(self._tell_total)
        self.toolbar.model_chosen.connect(self._on_model)
        self.bar.disconnect_asked.connect(self.disconnect_rig)
        self.bar.open_asked.connect(lambda path: desk.open_paths([Path(path)]))
        desk.protocol_handed.connect(self._on_protocol_handed)
        desk.trajectory_handed.connect(self._on_trajectory_handed)

    def _menu(self) -> tuple[Command, ...]:
        panel, bar = self.panel, self.toolbar

        def press(text: str, button: Any, keys: str) -> Command:
            return Command(text, button.click, keys, lambda: self._connected() and button.isEnabled())

        return (
            press("&Initialise", panel.initialise, "Ctrl+I"),
            press("Reset &load cell", panel.tare, "Ctrl+T"),
            press("&Enable or disable", panel.enable, "Ctrl+E"),
            press("&Release stop", panel.release, "Ctrl+L"),
            press("Reset &fault", panel.reset, "Ctrl+Shift+L"),
            SEPARATOR,
            press("&Start or change", panel.start, "Ctrl+Return"),
            press("To res&t", panel.finish, "Ctrl+Backspace"),
            press("Run &protocol", panel.run, "Ctrl+Shift+Return"),
            Command("&Done as asked", self.prompt.button.click, "Ctrl+D", self.prompt.isVisible),
            SEPARATOR,
            press("Re&cord or end run", panel.record, "Ctrl+R"),
            press("Pause recording", panel.pause, "Ctrl+Shift+P"),
            Command("&Marker with a note", self._take_moment, "Ctrl+M", lambda: panel.mark.isEnabled()),
            press("&Write to file", panel.write, "Ctrl+S"),
            SEPARATOR,
            Command("&Hold the picture", bar.hold.toggle, "Ctrl+P", self._connected, bar.hold.isChecked),
            Command("C&ursors", bar.cursors.toggle, "Ctrl+K", self._connected, bar.cursors.isChecked),
            Command("Tri&gger", bar.trigger.on.toggle, "Ctrl+G", self._connected, bar.trigger.on.isChecked),
            SEPARATOR,
            Command("Disco&nnect", self.disconnect_rig, None, self._connected),
        )

    # what the frame asks

    def window_title(self) -> str:
        return self.station.status.device if self.station.status is not None else ""

    def on_shown(self) -> None:
        if not self._looked:
            self._looked = True
            self.station.caller.call(
                Call("Looking for devices", effect_choices, self.connect_page.show_effects)
            )
            self._look_for_devices()
        self.plots.refresh()

    def accept_files(self, paths: Sequence[Path]) -> bool:
        if len(paths) != 1 or paths[0].suffix.lower() not in TEXT_TABLES:
            return False
        self.panel.motion.show_file(paths[0])
        return True

    def can_close(self) -> bool:
        running = self.station.driving
        if not running and self.recording.session is None and not self.recording.in_protocol:
            return True
        what = "The amplifier is on" if running else "A recording is not yet written"
        if not ask_to_close(self.widget, what):
            return False
        self.station.stop()
        return True

    def shut_down(self) -> None:
        self.recording.answer()
        self.station.caller.shut_down()
        self.recording.finish()
        self.station.shut_down()

    # buttons

    def _connected(self) -> bool:
        return self.station.bench is not None

    def disconnect_rig(self) -> None:
        """Let the device go; asked first where something would be lost."""
        if self.can_close():
            self.recording.finish()
            self.station.close()

    def _toggle_enable(self) -> None:
        on = self.station.mode in (Mode.ENABLED, Mode.RUNNING, Mode.STOPPING)
        self.station.ask("Switching the amplifier", Disable() if on else Enable())

    def _start(self) -> None:
        motion = self.panel.motion
        self.station.doing = motion.words()
        self.station.ask("Starting", Start(motion.settings(), motion.endless))

    def _toggle_record(self) -> None:
        if self.recording.recording:
            self.recording.end()
        else:
            self.recording.record(self.panel.motion.settings(), self.panel.before.value())

    def _take_moment(self) -> None:
        """Remember the moment of the key; the note may take its time."""
        if self.station.status is not None:
            self._mark_at = self.station.status.index
            self.panel.note.setFocus()
            self.panel.note.selectAll()

    def _mark(self) -> None:
        if self.recording.refusal("mark"):
            return
        status = self.station.status
        assert status is not None
        index = self._mark_at if self._mark_at is not None else status.index
        self._mark_at = None
        note = self.panel.note.text()
        self.recording.mark(note, index)
        self.plots.mark(index, note.strip() or "marker")
        self.panel.note.clear()

    def _run_protocol(self) -> None:
        try:
            steps = self.panel.protocol.steps(self.panel.motion.settings())
        except UserError as error:
            self.desk.tell(str(error), traceback.format_exc())
            return
        self._protocol_began = time.monotonic()
        self.station.doing = "protocol"
        self.recording.run_protocol(steps, self.panel.protocol.title())

    # set-up and model

    def _on_set_up_chosen(self, phase: str, cable: str) -> None:
        try:
            wanted = changed_set_up(self.station.set_up, phase=phase, **({"cable": cable} if cable else {}))
        except UserError as error:
            self.desk.tell(str(error))
            self.panel.show_set_up()
            return
        self.station.apply(wanted, self._after_set_up)

    def _on_set_up(self, set_up: SetUp) -> None:
        self.station.set_up = set_up
        self._after_set_up()

    def _after_set_up(self) -> None:
        self.panel.show_set_up()
        self._compare()

    def _on_model(self, key: str) -> None:
        if key == FROM_FILE:
            name, _ = QFileDialog.getOpenFileName(
                self.widget, "Model", self.desk.settings.folder(), MODEL_FILTER
            )
            if not name or not self._load_model(Path(name)):
                self.toolbar.show_model(self._compares)
                return
            key = FILE
        self._compares = key
        self._compare()

    def _load_model(self, path: Path) -> bool:
        from fingerlab.identify.live_model import balance_of
        from fingerlab.identify.model_file import load_model

        try:
            self._balance = balance_of(load_model(path), self.station.set_up.cable, path.name)
        except UserError as error:
            self.desk.tell(str(error), traceback.format_exc())
            return False
        self._model_path = path
        return True

    def _compare(self) -> None:
        key = self._compares
        if key == FILE and self._model_path is not None:
            self._load_model(self._model_path)
        try:
            self.station.compare(self._balance if key == FILE else None, key in (NOMINAL, FILE))
        except UserError as error:
            self.desk.tell(str(error))
            self._compares = key = NO_MODEL
        self.toolbar.show_model(key, self._model_path if key == FILE else None)
        modelled = self.station.model is not None
        self.plots.show_model(modelled, modelled and self.station.set_up.phase == "contact")
        self.plots.refresh()

    # what is shown

    def _look_for_devices(self) -> None:
        rig_file = self.connect_page.rig_file
        self.station.caller.call(
            Call("Looking for devices", lambda: find_devices(rig_file), self.connect_page.show_found)
        )

    def _on_station(self) -> None:
        history = self.station.history if self._connected() else None
        if self.plots.history is not history:
            self.plots.show_history(history)
            self.prompt.hide()
            self._compare()
        self._refresh()

    def _on_tick(self) -> None:
        if not self.widget.isVisible():
            return
        self.plots.tick()
        self._show_errors()
        self.panel.refresh()
        self._follow_mode()

    def _follow_mode(self) -> None:
        status = self.station.status
        key = (status.mode, status.latched, status.recording) if status is not None else None
        if key != getattr(self, "_last_mode", None):
            self._last_mode = key
            self.desk.commands_changed.emit()

    def _show_errors(self) -> None:
        model = self.station.model
        if model is None:
            return
        for spec in PLOTS:
            if spec.key in ("torque", "force"):
                column = spec.readings[0]
                error = model.error(spec.key)
                words = QUANTITIES[column].text(error) if error == error else "–"
                label = self.plots.panes[spec.key].error
                label.setText(f"error {words}")
                label.setToolTip(
                    f"Root mean square of measured less modelled over the last seconds. The model is "
                    f"{1e3 * model.delay_s:.0f} ms behind the measurement."
                )

    def _refresh(self) -> None:
        connected = self._connected()
        self.pages.setCurrentWidget(self.bench_page if connected else self.connect_page)
        busy = self.station.caller.title if self.station.caller.busy else ""
        self.connect_page.show_busy(busy if busy != "Looking for devices" else "")
        device = self.station.status.device if self.station.status is not None else ""
        self.bar.show_device(device, self.recording.in_protocol)
        if connected:
            self.panel.show_set_up()
            self.panel.refresh()
        self.desk.commands_changed.emit()

    def _on_written(self, path: Path) -> None:
        self.bar.show_written(path)
        self.desk.tell(f"Written and verified: {path}")

    # protocol

    def _on_progress(self, share: float, words: str) -> None:
        panel = self.panel
        panel.progress.setValue(round(1000 * share))
        gone = time.monotonic() - self._protocol_began
        left = f", about {clock(gone / share - gone)} left" if share > 0.02 else ""
        panel.left.setText(f"{words}{left}".capitalize())
        self.station.doing = f"protocol, {words}"

    def _on_protocol_ended(self, how: str) -> None:
        self.prompt.hide()
        self.panel.progress.setValue(1000 if how == "done" else 0)
        self.panel.left.setText("All runs taken" if how == "done" else "Given up")
        self._refresh()

    def _on_protocol_handed(self, steps: Sequence[Any], title: str) -> None:
        self.panel.protocol.hand(steps, title)
        self.panel.by_protocol.click()

    def _on_trajectory_handed(self, trajectory: dict[str, Any], title: str) -> None:
        try:
            self.panel.motion.show_settings(trajectory)
        except UserError as error:
            self.desk.tell(str(error))
            return
        self.panel.by_hand.click()
        self.desk.say(f"Motion set: {title or self.panel.motion.words()}")

    def _tell_total(self) -> None:
        try:
            steps = self.panel.protocol.steps(self.panel.motion.settings())
            self.panel.protocol.tell_total(steps)
        except UserError as error:
            self.panel.protocol.total.setText(str(error))


def ask_to_close(parent: QWidget, what: str) -> bool:
    """Whether to stop the motor, write what was recorded, and go on."""
    box = QMessageBox(parent)
    box.setWindowTitle("FingerLab")
    box.setText(f"{what}. Stop the motor, write what was recorded, and close?")
    go_on = box.addButton("&Stop and close", QMessageBox.ButtonRole.AcceptRole)
    box.addButton("&Keep open", QMessageBox.ButtonRole.RejectRole)
    box.exec()
    return box.clickedButton() is go_on
