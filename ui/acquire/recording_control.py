"""Recording by hand: one session file at a time, runs and markers in it, its writing and its verification.

Nothing is lost by putting the writing off: the runs are closed by then, and whoever opens the session
finishes it.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.control.machine import Mode
from fingerlab.acquisition.protocols.driver import run_to_record
from fingerlab.acquisition.recording import SessionInfo
from fingerlab.core.errors import Cancelled, UserError

from ..app.bars import time_left
from ..app.worker import Failed
from ..widgets.fields import PROGRESS_STEPS
from ..widgets.layout import described, hbox
from .bench_controller import NO_BENCH, BenchController


@dataclass
class SessionDetails:
    """What the operator says of the session to come."""

    folder: Path
    title: str = ""
    operator: str = ""
    notes: str = ""

    def attributes(self) -> dict[str, str]:
        """For the session file; without what was left empty."""
        return {name: text for name in ("operator", "notes") if (text := getattr(self, name).strip())}


class DetailsDialog(QDialog):
    """Fills :class:`SessionDetails` when it is accepted."""

    def __init__(self, details: SessionDetails, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Session to record – FingerLab")
        self.resize(520, 320)
        self._details = details
        self.folder = described(QLineEdit(str(details.folder)), "recordFolder")
        choose = QPushButton("Choose…")
        choose.clicked.connect(self._choose)
        across = hbox(None, (self.folder, 1), choose)
        self.title_field = QLineEdit(details.title)
        self.operator_field = QLineEdit(details.operator)
        self.notes = QPlainTextEdit(details.notes, tabChangesFocus=True)
        form = QFormLayout(self)
        form.setSpacing(8)
        label = QLabel("&Folder")
        label.setBuddy(self.folder)
        form.addRow(label, across)
        for words, name, edit in (
            ("&Title", "Title", self.title_field),
            ("&Operator", "Operator", self.operator_field),
            ("&Notes", "Notes", self.notes),
        ):
            edit.setAccessibleName(name)
            form.addRow(words, edit)
        self.folder.setAccessibleName("Folder")
        buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel
        )
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        form.addRow(buttons)

    def accept(self) -> None:
        details = self._details
        details.folder = Path(self.folder.text()).expanduser()
        details.title = self.title_field.text()
        details.operator = self.operator_field.text()
        details.notes = self.notes.toPlainText()
        super().accept()

    def _choose(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Folder for recordings", self.folder.text())
        if name:
            self.folder.setText(name)


CLOSING_S = 10.0
"""A window that closes waits so long for a session (an hour's is written meanwhile); then it is put off."""


@dataclass(frozen=True)
class SessionEnding:
    """What became of a session: its path, and whether it is written and verified or was put off."""

    path: Path
    whole: bool


class SessionWriting(QObject):
    """Closes one session at a time.

    Attributes:
        share: done, 0 to 1. words: what is being done and the time left; empty when nothing is.

    Signal ``changed``.
    """

    changed = Signal()
    _went_on = Signal(float, str)

    def __init__(self, parent: QObject | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(parent)
        self.share, self.words = 0.0, ""
        self._clock, self._began, self._until = clock, 0.0, math.inf
        self._later = threading.Event()
        self._reported = (-1, "")
        self._went_on.connect(self._on_went_on)

    @property
    def under_way(self) -> bool:
        """Whether a session is being written."""
        return bool(self.words)

    @property
    def asked_to_wait(self) -> bool:
        """Whether it is about to be put off."""
        return self.under_way and self._later.is_set()

    def put_off(self) -> None:
        """Stop here; the recording stays as it is and is finished when it is opened."""
        if self.under_way:
            self._later.set()
            self._show("Putting it off …")

    def hurry(self) -> None:
        """The window closes, or the bench: what is written now, or next, is put off where it takes long."""
        self._until = self._clock() + CLOSING_S

    def over(self) -> None:
        """The session is written, put off, or could not be written."""
        self.share, self._until = 0.0, math.inf
        self._show("")

    # in the worker

    def close(self, bench: Bench, path: Path) -> SessionEnding:
        """Write and verify the session that the bench's recorder has open under this name.

        Raises:
            UserError: it could not be written.
        """
        self._later.clear()
        self._reported, self._began = (-1, ""), self._clock()
        try:
            return SessionEnding(bench.recorder.close(self._report), True)
        except Cancelled:
            return SessionEnding(path, False)

    def _report(self, share: float, what: str) -> None:
        """Asked a hundred times a second; told when something of it changes on the screen."""
        if self._later.is_set() or self._clock() > self._until:
            raise Cancelled
        now = round(PROGRESS_STEPS * share), what
        if now != self._reported:
            self._reported = now
            self._went_on.emit(share, what)

    # in the window

    def _on_went_on(self, share: float, what: str) -> None:
        if self._later.is_set():
            return
        self.share = share
        left = time_left(share, self._clock() - self._began)
        self._show(f"{what.capitalize()}, {left}" if left else f"{what.capitalize()} …")

    def _show(self, words: str) -> None:
        self.words = words
        self.changed.emit()


WRITING = "Writing and verifying"
AFTER_STOP_MS = 300
"""The recording goes on for this long after a stop, so that the stop itself is in it."""


@dataclass
class _Open:
    """The session that is being recorded."""

    path: Path
    runs: int = 0
    notes: list[str] = field(default_factory=list)


class RecordingControl(QObject):
    """Begins and ends runs, marks, pauses, and writes the session.

    Attributes:
        in_protocol: whether a protocol has the bench's ear. errands: what it is to ask of the bench for
            others; the recorder takes one request at a time.

    Signals:
        changed. written(Path). put_off(Path): the session is kept as it was recorded, to be written later.
        failed_beside(sentence): an errand was refused.
    """

    changed = Signal()
    written = Signal(object)
    put_off = Signal(object)
    failed_beside = Signal(str)

    def __init__(
        self, controller: BenchController, details: SessionDetails, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self.controller, self.details = controller, details
        self.session: _Open | None = None
        self.writing = SessionWriting(self)
        self.in_protocol = self._under_way = self._asked_to_end = False
        self.errands: SimpleQueue[Callable[[Bench], None]] = SimpleQueue()
        self.failed_beside.connect(lambda sentence: controller.context.tell(sentence))
        self.writing.changed.connect(self._on_writing)
        controller.ticked.connect(self._on_tick)
        controller.stopped.connect(self._on_stopped)
        controller.warned.connect(self._on_warned)

    # what can be done

    @property
    def recording(self) -> bool:
        """Whether a run is being written (or pauses)."""
        return self.controller.status is not None and self.controller.status.recording > 0

    @property
    def paused(self) -> bool:
        return self.controller.status is not None and self.controller.status.recording == 2

    def refusal(self, what: str) -> str:
        """Why ``record``, ``end``, ``pause``, ``mark``, ``write``, ``protocol`` is refused now; or empty."""
        if self.controller.status is None:
            return NO_BENCH
        if self.in_protocol and what == "mark":
            return "" if self.recording else "Nothing is being recorded between two runs."
        if self.in_protocol:
            return "A protocol is under way; STOP ends it."
        if self.controller.worker.busy:
            return f"{self.controller.worker.title} is under way."
        if what == "record" and not self.recording and self._load_rests():
            return "The known load rests on its support; start the motion first, which lifts it."
        if what in ("record", "protocol") and self.controller.status.loop_ended:
            return "The device is gone; connect it again."
        if what in ("record", "protocol") and not self.recording and not self.controller.live:
            return "The device gives no samples; reset the fault, or connect it again."
        if what == "record":
            return "A run is being recorded; end it first." if self.recording else ""
        if what in ("end", "pause", "mark"):
            return "" if self.recording else "Nothing is being recorded."
        if what == "write":
            return "" if self.session is not None else "No run has been recorded yet."
        if self.recording or self.session is not None:
            return "A session is open; write it to its file first."
        if self.controller.mode is Mode.FAULT:
            return "The bench is in fault; reset it first."
        if self.controller.status.latched:
            return "The stop is latched; release it first."
        return ""

    def _load_rests(self) -> bool:
        return bool(self.controller.set_up.load_torque) and self.controller.mode is not Mode.RUNNING

    def record(self, trajectory: Mapping[str, Any], before_s: float) -> None:
        """Begin a run, ``before_s`` seconds ago; a session is opened where none is."""
        info = self.described_info() if self.session is None else None
        if self.session is None and info is None:
            return
        set_up = self.controller.set_up

        def work(bench: Bench) -> None:
            if info is not None:
                bench.recorder.open(info)
            try:
                bench.recorder.begin(run_to_record(bench, set_up, trajectory, before_s))
            except UserError:
                if info is not None:  # nothing is in it yet: let go of its place
                    with suppress(UserError):
                        bench.recorder.close()
                raise

        def done(_: object) -> None:
            if info is not None:
                self.session = _Open(info.path)
                self.controller.context.settings.set_under_way(info.path)
            assert self.session is not None
            self.session.runs += 1
            self.controller.context.say(f"Recording run {self.session.runs} of {self.session.path.name}")
            self.changed.emit()

        self.controller.do("Beginning the recording", work, done)

    def end(self) -> None:
        """End the run with the newest sample."""
        self._asked_to_end = True
        self.controller.do(
            "Ending the run", lambda bench: bench.recorder.end(), lambda _: self.changed.emit()
        )

    def pause(self, on: bool) -> None:
        """Leave samples out, or go on; what is left out is a gap in time."""
        self.controller.do("Pausing", lambda bench: bench.recorder.pause(on), lambda _: self.changed.emit())

    def mark(self, note: str, index: int) -> None:
        """A marker with a note at a sample."""
        text = note.strip() or "marker"

        def work(bench: Bench) -> None:
            bench.recorder.mark(text, index)

        def beside(bench: Bench) -> None:
            try:
                work(bench)
            except UserError as error:
                self.failed_beside.emit(str(error))

        if self.in_protocol:
            self.errands.put(beside)
            self.controller.context.say(f"Marked: {text}")
            return
        self.controller.do("Marking", work, lambda _: self.controller.context.say(f"Marked: {text}"))

    def mark_motion(self, words: str) -> None:
        """Where the motion was begun or changed within a run: its trajectory is the one at the key."""
        if self.recording and self.controller.bench is not None:
            self.mark(f"motion: {words}", self.controller.bench.status().run_start)

    def write(self) -> None:
        """Write the session whole, verify it, give it its name."""
        if self.session is None:
            return
        path = self.session.path
        self.controller.do(
            WRITING, lambda bench: self.writing.close(bench, path), self.keep, self._on_failed, True
        )

    def finish(self) -> None:
        """The window or the bench closes: what was recorded is written, or kept where that takes long."""
        bench, session = self.controller.bench, self.session
        if bench is None or session is None or self.writing.under_way:
            return
        self.writing.hurry()
        try:
            self.keep(self.writing.close(bench, session.path))
        except UserError as error:
            self.controller.context.tell(str(error))

    # ends

    def _on_tick(self) -> None:
        """A run against a known load ends by itself, with its motion: the load is not carried any more."""
        before, self._under_way = self._under_way, self.recording
        if self._under_way and not before:
            self._asked_to_end = False
        elif before and not self._under_way and not self.in_protocol:
            if self.controller.set_up.load_torque and not self._asked_to_end and self.session is not None:
                self.controller.context.say(
                    f"Run {self.session.runs} ended with its motion: the load is set down"
                )
            self.changed.emit()

    def _on_writing(self) -> None:
        self.controller.beside = self.writing.words
        self.changed.emit()

    def _on_stopped(self, sentence: str) -> None:
        if self.recording and not self.in_protocol:
            QTimer.singleShot(AFTER_STOP_MS, self, lambda: self._cut(sentence))

    def _cut(self, sentence: str) -> None:
        if self.recording and self.controller.bench is not None:
            self.controller.do(
                "Ending the run", lambda bench: bench.recorder.cut(sentence), lambda _: self.changed.emit()
            )

    def _on_warned(self, _sentence: str) -> None:
        self.changed.emit()

    def keep(self, ending: SessionEnding) -> None:
        """A session is whole, or put off: say so and let others know."""
        self.session = None
        self.writing.over()
        path, context = ending.path, self.controller.context
        context.settings.set_recordings(path.parent)
        context.settings.set_under_way(None)
        if ending.whole:
            context.recorded(path)
            self.written.emit(path)
        else:
            self.put_off.emit(path)
        self.changed.emit()

    def _on_failed(self, failure: Failed) -> None:
        self.session = None
        self.writing.over()
        self.controller.context.tell(failure.sentence, failure.details)
        self.changed.emit()

    def described_info(self, what: str = "") -> SessionInfo | None:
        """What the session to come says of itself; None where its place is impossible, which is told."""
        try:
            return self._info(what)
        except UserError as error:
            self.controller.context.tell(str(error))
            return None

    def _info(self, what: str = "") -> SessionInfo:
        opened = self.controller.opened
        assert opened is not None
        now = datetime.now().astimezone()
        status = self.controller.status
        device = status.device if status is not None else ""
        title = self.details.title.strip() or f"{what or 'recorded by hand'} on {device}"
        attributes = {**opened.attributes, "protocol": what or "by hand", "device": device}
        return SessionInfo(
            free_name(self.details.folder, f"{now:%Y-%m-%d-%H%M%S}"),
            opened.rig.to_json(),
            title,
            now.isoformat(timespec="seconds"),
            {**self.details.attributes(), **attributes},
        )


def free_name(folder: Path, stem: str) -> Path:
    """A name in the folder that is not taken."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"{folder} cannot be made ({error.strerror}); choose another folder for recordings."
        ) from None
    path, number = folder / f"{stem}.h5", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}.h5"
    return path
