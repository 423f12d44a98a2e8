"""The side panel, from top to bottom in the order of use: bench, motion or protocol, recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QButtonGroup,
    QDoubleSpinBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QWidget,
)

from fingerlab.acquisition.control.machine import Event, Machine, Mode, SetGains
from fingerlab.acquisition.protocols.driver import LONGEST_BEFORE_S
from fingerlab.core.text import grouped
from fingerlab.rig.file import Rig
from fingerlab.sessions.model import FINGER_PHASES

from ..app.undo import FormHistory
from ..widgets.fields import (
    PROGRESS_STEPS,
    ActionButton,
    choice,
    complaint_of,
    number,
    progress_bar,
    refuse_entries,
    row,
    set_shown,
    set_usable,
)
from ..widgets.layout import FLUSH, Pages, Spacer, described, fix_width, hbox, vbox
from ..widgets.tables import ElidedLabel, heading, remark
from .bench_controller import BenchController
from .bench_setup import LOADED_PHASE, cable_refusal
from .motion_form import GainsButton, MotionForm, MotionsButton
from .recording_control import WRITING, RecordingControl
from .run_forms import InitialButton, ProtocolForm

PHASES = {"on_air": "On air", "contact": "Contact", "motor_bench": "Motor bench", "free": "Free"}
CABLES = {"extension": "Extension cable", "flexion": "Flexion cable", "none": "No cable"}
LOAD_HELP = "Known load: torque of a weight on the pulley; above 0 where the motor lifts it turning forwards."
NO_FINGER = "The rig file names no finger, whose constants a run with one needs; give it a section [finger]."
MOTIONS = (
    "A motion that you set, start, change and end yourself.",
    "All runs of a series by itself, with a prompt at each change of the cable.",
)
WIDTH = 272


@dataclass(frozen=True)
class PanelActions:
    """What the buttons call."""

    initialise: Callable[[], Any]
    tare: Callable[[], Any]
    enable: Callable[[], Any]
    release: Callable[[], Any]
    reset: Callable[[], Any]
    start: Callable[[], Any]
    finish: Callable[[], Any]
    jog: Callable[[int], Any]
    gains: Callable[[SetGains], Any]
    take_up: Callable[[], Any]
    contact: Callable[[], Any]
    protocol: Callable[[], Any]
    record: Callable[[], Any]
    pause: Callable[[], Any]
    mark: Callable[[], Any]
    write: Callable[[], Any]
    later: Callable[[], Any]
    details: Callable[[], Any]


def _nothing() -> None:
    """What acts while it is held does nothing when it was clicked."""


class _Value:
    """One field as a form of its own, for the history."""

    def __init__(self, name: str, field: QDoubleSpinBox) -> None:
        self._name, self._field = name, field

    def state(self) -> dict[str, float]:
        return {self._name: self._field.value()}

    def restore(self, state: Mapping[str, float]) -> None:
        self._field.setValue(state[self._name])


class AcquirePanel(QWidget):
    """Signals: ``set_up_chosen(phase, cable)``; the cable is empty where the phase was changed.
    ``load_chosen(load_torque)``, N m.
    """

    set_up_chosen = Signal(str, str)
    load_chosen = Signal(float)

    def __init__(
        self,
        controller: BenchController,
        recording: RecordingControl,
        actions: PanelActions,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("acquirePanel")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._controller, self._recording = controller, recording
        self.pages = Pages()
        self._make_bench(actions)
        self._make_motion(actions)
        self._make_recording(actions)
        parts = (*self._bench, 2, *self._motion, 2, *self._record, 2)
        vbox(self, *parts, Spacer(1), margins=(8, 2, 8, 0), spacing=3)
        fix_width(self, WIDTH)
        self._keep_history()

    def _keep_history(self) -> None:
        forms: dict[str, Any] = {"initial": self.initial, "motion": self.motion, "protocol": self.protocol}
        self.history = FormHistory({**forms, "recording": _Value("before", self.before)}, self)
        for form in forms.values():
            form.edited.connect(self.history.edited)
            self.history.watch(form.fields)
        self.protocol.edited.connect(self._refresh_recording)
        self.before.valueChanged.connect(self.history.edited)
        self.history.watch([self.before])
        self.history.shown.connect(self._show_form)

    def _show_form(self, name: str) -> None:
        """Undo has changed a form: let it be seen."""
        if name in ("motion", "protocol"):
            (self.by_hand if name == "motion" else self.by_protocol).click()

    def _make_bench(self, actions: PanelActions) -> None:
        self.phase = choice("phase", PHASES, "Phase: what is on the bench.")
        self.cable = choice("cable", CABLES, "Cable: which one is fixed to the pulley.")
        self.load = number("knownLoad", 0.0, -1.0, 1.0, 4, 0.01, LOAD_HELP)
        self.load_label = QLabel("Known load (N m)")
        self.load_label.setBuddy(self.load)
        self.load.valueChanged.connect(self.load_chosen)
        self.initialise = ActionButton(
            "&Initialise",
            "initialise",
            "Encoder and angle sensors to their predefined values, at rest (Ctrl+I).",
            actions.initialise,
        )
        self.tare = ActionButton(
            "Reset &load cell", "tare", "The load cell's reading now is no force (Ctrl+T).", actions.tare
        )
        self.initial = InitialButton()
        self.enable = ActionButton("Ena&ble", "enable", "Amplifier on or off (Ctrl+E).", actions.enable)
        self.enable.setProperty("primary", "true")
        self.release = ActionButton(
            "Release stop", "release", "Open the latch of the stop (Ctrl+L).", actions.release
        )
        self.reset = ActionButton(
            "Reset fault", "resetFault", "Acknowledge the fault (Ctrl+Shift+L).", actions.reset
        )
        self.phase.activated.connect(lambda: self.set_up_chosen.emit(str(self.phase.currentData()), ""))
        self.cable.activated.connect(
            lambda: self.set_up_chosen.emit(str(self.phase.currentData()), str(self.cable.currentData()))
        )
        self._bench = (
            heading("Bench"),
            row(self.phase, self.cable),
            row(self.load_label, self.load),
            row(self.initialise, self.tare),
            self.initial,
            self.enable,
            row(self.release, self.reset),
        )

    def _make_motion(self, actions: PanelActions) -> None:
        self.by_hand, self.by_protocol = QPushButton("By han&d"), QPushButton("By p&rotocol")
        group = QButtonGroup(self)
        for number_, button in enumerate((self.by_hand, self.by_protocol)):
            button.setCheckable(True)
            button.setObjectName("byProtocol" if number_ else "byHand")
            button.setToolTip(MOTIONS[number_])
            button.clicked.connect(lambda _checked=False, page=number_: self.pages.show_page(page))
            group.addButton(button)
        self.by_hand.setChecked(True)
        self.motion, self.protocol = MotionForm(), ProtocolForm()
        self.start = ActionButton(
            "&Start", "start", "Run the motion, or go over to it without a jump (Ctrl+Return).", actions.start
        )
        self.finish = ActionButton(
            "To &rest", "finish", "Bring the motor to rest softly (Ctrl+Backspace).", actions.finish
        )
        self._make_by_hand(actions)
        self.run = ActionButton(
            "Run &protocol",
            "runProtocol",
            "Take all runs and write the file (Ctrl+Shift+Return).",
            actions.protocol,
        )
        self.progress = progress_bar("protocolProgress", "Progress of the protocol")
        keeps = self.progress.sizePolicy()
        keeps.setRetainSizeWhenHidden(True)  # nothing below moves when it appears
        self.progress.setSizePolicy(keeps)
        self.progress.hide()
        self.hand_left = described(ElidedLabel(), "motionLeft", accessible="Time left of the motion")
        self.left = described(ElidedLabel(), "protocolLeft")
        for entries in (
            (
                self.motion,
                row(self.start, self.finish),
                row(self.back, self.forth, self.take_up, self.contact),
                row(self.gains, self.motions),
                self.hand_left,
            ),
            (self.protocol, self.run, self.progress, self.left),
        ):
            page = QWidget()
            vbox(page, *entries, Spacer(1), margins=FLUSH, spacing=4)
            self.pages.add(page)
        self._motion: tuple[QWidget | QHBoxLayout, ...] = (
            hbox(None, heading("Motion"), 8, (self.by_hand, 1), (self.by_protocol, 1), spacing=8),
            self.pages,
        )

    def _make_by_hand(self, actions: PanelActions) -> None:
        self.back = ActionButton("◀", "jogBack", "Jog: unwind slowly for as long as it is held.", _nothing)
        self.forth = ActionButton("▶", "jogForth", "Jog: wind slowly for as long as it is held.", _nothing)
        for button, way, name in ((self.back, -1, "Jog back"), (self.forth, 1, "Jog on")):
            button.setAccessibleName(name)
            button.pressed.connect(lambda way=way: actions.jog(way))
            button.released.connect(lambda: actions.jog(0))
        self.take_up = ActionButton(
            "Take up",
            "takeUp",
            "Slack: wind with little current until the joints move; the motor's reference is then there.",
            actions.take_up,
        )
        self.motions = MotionsButton(self.motion)
        self.gains = GainsButton()
        self.gains.asked.connect(actions.gains)
        self.contact = ActionButton(
            "Contact",
            "findContact",
            "Wind until the fingertip presses with the Force of By protocol; the offset is then there.",
            actions.contact,
        )

    def _make_recording(self, actions: PanelActions) -> None:
        self.record = ActionButton("Re&cord", "record", "Record a run, or end it (Ctrl+R).", actions.record)
        self.pause = ActionButton(
            "&Pause", "pauseRecording", "Leave samples out: a gap in time (Ctrl+Shift+P).", actions.pause
        )
        self.before = number(
            "before",
            0.0,
            0.0,
            LONGEST_BEFORE_S,
            1,
            1.0,
            "Pre-trigger: seconds before the key that are recorded, too.",
        )
        self.note = described(QLineEdit(), "note", accessible="Note for a marker")
        self.note.setPlaceholderText("Note for a marker")
        self.note.returnPressed.connect(lambda: actions.mark())
        self.mark = ActionButton(
            "Mar&k",
            "mark",
            "Marker with the note; Ctrl+M takes the moment, then asks for the note.",
            actions.mark,
        )
        self._make_writing(actions)
        self.warning = described(remark(), "recordWarning", accessible="Warning")
        self.warning.hide()
        label = QLabel("Before (s)")
        label.setBuddy(self.before)
        self._record = (
            hbox(None, heading("Recording"), 8, (self.count, 1), spacing=8),
            row(self.record, self.pause),
            row(label, self.before),
            row(self.note, self.mark),
            row(self.write, self.later, self.details),
            self.writing,
            self.warning,
        )

    def _make_writing(self, actions: PanelActions) -> None:
        self.write = ActionButton(
            "&Write to file",
            "write",
            "Write the session, verify it, give it its name (Ctrl+S).",
            actions.write,
        )
        self.later = ActionButton(
            "Fi&nish later",
            "writeLater",
            "Go on without the file: the recording is kept whole, and is written when it is opened.",
            actions.later,
        )
        self.later.hide()
        self.details = ActionButton(
            "Details…", "details", "Folder, title, operator and notes of the session.", actions.details
        )
        self.count = described(ElidedLabel(), "recordedText")
        self.writing = progress_bar("writingProgress", "Progress of writing and verifying")
        self.writing.setTextVisible(False)
        self.writing.hide()

    # what is shown

    def show_set_up(self) -> None:
        """Show the set-up that holds."""
        set_up = self._controller.set_up
        self.phase.setCurrentIndex(self.phase.findData(set_up.phase))
        self.cable.setCurrentIndex(self.cable.findData(set_up.cable))
        with QSignalBlocker(self.load):
            self.load.setValue(set_up.load_torque)
        for widget in (self.load_label, self.load):
            widget.setVisible(set_up.phase == LOADED_PHASE)
        refuse_entries(self.cable, {cable: cable_refusal(set_up, cable) for cable in CABLES})

    def show_rig(self, rig: Rig) -> None:
        """What cannot be done on it: a load that the motor may not hold, runs of a finger without one."""
        most = rig.limits.torque
        with QSignalBlocker(self.load):
            self.load.setRange(-most, most)
        why = NO_FINGER if rig.finger is None else ""
        refuse_entries(self.phase, dict.fromkeys(FINGER_PHASES, why))
        self.protocol.refuse_fingers(why)
        self.protocol.show_rig(rig)

    def refresh(self) -> None:
        """Which buttons can be used now, and why not."""
        controller, recording = self._controller, self._recording
        busy = recording.refusal("mark") if recording.in_protocol else ""
        hands_off = "A protocol is under way; STOP ends it." if recording.in_protocol else busy
        mode = controller.mode
        on = mode in (Mode.ENABLED, Mode.RUNNING, Mode.STOPPING)
        for button, event in (
            (self.initialise, Event.INITIALISE),
            (self.enable, Event.DISABLE if on else Event.ENABLE),
            (self.start, Event.RUN),
            (self.finish, Event.FINISH),
        ):
            button.refuse(hands_off or controller.refusal(event))
        self._refresh_by_hand(hands_off)
        set_usable(self.gains, not hands_off and controller.status is not None)
        latched = controller.status is not None and controller.status.latched
        self.release.refuse(
            hands_off or (controller.refusal(Event.RELEASE) if latched else "No stop is latched.")
        )
        self.reset.refuse(hands_off or controller.refusal(Event.RESET))
        not_now = Machine(mode or Mode.IDLE).tare_refusal
        self.tare.refuse(hands_off or controller.refusal(Event.FAULT) or not_now)
        for button, fields in (
            (self.initialise, self.initial.fields),
            (self.start, [self.load, *self.motion.fields]),
        ):
            if button.isEnabled():
                button.refuse(complaint_of(fields))
        self._set_text(self.enable, "Disa&ble" if on else "Ena&ble")
        self._set_text(self.start, "&Change" if mode is Mode.RUNNING else "&Start")
        fixed = hands_off or ("The amplifier is enabled; disable it first." if on else "")
        for field, help_text in (
            (self.phase, "What is on the bench."),
            (self.cable, "Fixed to the pulley."),
            (self.load, LOAD_HELP),
        ):
            set_usable(field, not fixed and controller.status is not None)
            field.setToolTip(fixed or help_text)
        self._refresh_recording()

    def _refresh_by_hand(self, hands_off: str) -> None:
        controller = self._controller
        drives = hands_off or controller.refusal(Event.RUN)
        for button in (self.back, self.forth):
            if not button.isDown():
                button.refuse(drives)
        finger = controller.set_up.phase in ("on_air", "contact") and controller.set_up.cable != "none"
        self.take_up.refuse(
            hands_off
            or ("The amplifier is enabled; disable it first." if controller.driving else "")
            or controller.refusal(Event.ENABLE)
            or ("" if finger else "Only a cable that is fixed to a finger has slack.")
        )
        presses = controller.set_up.phase == "contact"
        self.contact.refuse(
            drives or ("" if presses else "Choose the phase Contact: only then is there a load cell.")
        )

    def _refresh_recording(self) -> None:
        recording = self._recording
        self._set_text(self.record, "End &run" if recording.recording else "Re&cord")
        self._set_text(self.pause, "&Go on" if recording.paused else "&Pause")
        self.record.refuse(recording.refusal("end" if recording.recording else "record"))
        for button, what in (
            (self.pause, "pause"),
            (self.mark, "mark"),
            (self.write, "write"),
            (self.run, "protocol"),
        ):
            button.refuse(recording.refusal(what))
        for button, fields in ((self.record, [self.before]), (self.run, self.protocol_fields)):
            if button.isEnabled() and not recording.recording:
                button.refuse(complaint_of(fields))
        if self.run.isEnabled():
            self.run.refuse(self.protocol.missing)
        self._refresh_writing()
        status, session = self._controller.status, recording.session
        if self._controller.worker.title == WRITING or recording.writing.under_way:
            words = recording.writing.words or f"{WRITING} …"
        elif recording.recording and status is not None:
            words = f"{grouped(status.recorded)} samples"
        elif session is not None:
            words = f"{session.runs} run{'s' * (session.runs != 1)}, not yet written"
        else:
            words = "Nothing recorded"
        if words != self.count.text():
            self.count.setText(words)
        warning = f"⚠ {self._controller.warning}" if self._controller.warning else ""
        if warning != self.warning.text():
            self.warning.setText(warning)
            self.warning.setVisible(bool(warning))

    def _refresh_writing(self) -> None:
        writing = self._recording.writing
        set_shown(self.write, not writing.under_way)
        set_shown(self.later, writing.under_way)
        self.writing.setVisible(writing.under_way)
        self.later.refuse("It is being put off." if writing.asked_to_wait else "")
        self.writing.setValue(round(PROGRESS_STEPS * writing.share))

    @property
    def protocol_fields(self) -> list[QWidget]:
        """All numbers that the protocol is made of."""
        return [*self.protocol.fields, *(self.motion.fields if self.protocol.own else ())]

    @staticmethod
    def _set_text(button: QPushButton, text: str) -> None:
        if button.text() != text:
            button.setText(text)
