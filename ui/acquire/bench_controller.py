"""The bench behind the Acquire tab: polled by a timer, asked off the GUI thread, kept for scrolling back."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np
from PySide6.QtCore import QObject, Qt, QTimer, Signal

from fingerlab.acquisition.bench.bench import Bench, Kind, Status, endangered, notices
from fingerlab.acquisition.control.machine import MODE_WORDS, Command, Event, Machine, Mode, SetUp
from fingerlab.acquisition.ring import COLUMN, CycleTimes, RingReader

from ..app.context import ApplicationContext, Light, RigLine
from ..app.worker import Failed, Worker, attempt
from .bench_setup import BenchRequest, OpenBench, OpenCall, open_bench
from .live_history import (
    FORCE_RESIDUAL,
    MODELLED,
    MODELLED_FORCE,
    MODELLED_TORQUE,
    SHOWN,
    TORQUE_RESIDUAL,
    LiveHistory,
)

if TYPE_CHECKING:
    from fingerlab.acquisition.bench.process_bench import InlineBench
    from fingerlab.models.live import Balance, LiveModel

TICK_MS = 33
"""At most 30 looks a second, each followed by one repaint."""

NUMBERS_EVERY = 3
"""Looks from one showing of the numbers to the next: ten a second, more than one can read."""

SILENT_LOOKS = 15
"""Half a second without a sample: what is shown is none of now (assumed, as a window that hangs)."""

NO_BENCH = "No rig is connected; choose one first."
_LIGHTS: dict[Mode, Light] = {
    Mode.IDLE: "off",
    Mode.INITIALISED: "ready",
    Mode.ENABLED: "live",
    Mode.RUNNING: "live",
    Mode.STOPPING: "live",
    Mode.FAULT: "fault",
}


PLAIN = (Kind.LOST, Kind.RUN, Kind.LINE)
"""What is told in the status line alone where it is not grave."""


class BenchController(QObject):
    """One bench at a time.

    Attributes:
        doing, beside: what runs, such as a motion; what is done meanwhile, such as writing a file. In the
            header of every tab.
        numbers_due: whether this look's numbers are to be shown: each third, and wherever a state changes.

    Signals:
        changed: another bench, or none, or something is being asked of it. ticked: new samples may be there.
        stopped(sentence): the motor was stopped by the operator, a check or a lost process.
        warned(sentence): samples lost, recorder failed.
    """

    changed = Signal()
    ticked = Signal()
    stopped = Signal(str)
    warned = Signal(str)

    def __init__(
        self, context: ApplicationContext, opener: OpenCall = open_bench, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self.context = context
        self.bench: Bench | None = None
        self.opened: OpenBench | None = None
        self.status: Status | None = None
        self.set_up = SetUp()
        self.doing = self.beside = ""
        self.history = LiveHistory((*SHOWN, *MODELLED), 1000.0, 1.0)
        self.model: LiveModel | None = None
        self._cycles = CycleTimes(1000.0)
        self.worker = Worker(self)
        self._opener = opener
        self._arriving: OpenBench | None = None  # opened off the GUI thread, not yet shown in it
        self._reader: RingReader | None = None
        self._seen: Status | None = None
        self.numbers_due = True
        self._looks = self._silent = 0
        self._timer = QTimer(self, timerType=Qt.TimerType.PreciseTimer, interval=TICK_MS)
        self._timer.timeout.connect(self.tick)
        self.worker.busy_changed.connect(self.changed)
        self.worker.failed.connect(self._on_failed)
        context.stop_asked.connect(self.stop)

    # opening and closing

    def open(self, wanted: BenchRequest) -> None:
        """Open a bench; the one that is open is closed first."""
        before, self.bench = self.bench, None
        self._let_go()
        if before is not None:
            self.context.hush()  # it told of the bench that is let go

        def work() -> OpenBench:
            if before is not None:
                before.close()
            self._arriving = opened = self._opener(wanted)
            return opened

        self.call("Connecting", work, self._on_opened)
        self.changed.emit()

    def close(self) -> None:
        """Stop the motor and let the device go."""
        bench, self.bench = self.bench, None
        self._let_go()
        if bench is not None:
            self.call("Disconnecting", bench.close)
        self.changed.emit()

    def shut_down(self) -> None:
        """The window closes: end the processes, which stops the motor, and wait for them."""
        bench, self.bench = self.bench, None
        self._let_go()
        self.worker.shut_down(finish=True)
        arrived, self._arriving = self._arriving, None  # the window was closed while it connected
        for one in (bench, arrived.bench if arrived is not None else None):
            if one is not None:
                one.close()

    def _on_opened(self, opened: OpenBench) -> None:
        self._arriving = None
        self.opened, self.bench = opened, opened.bench
        self.history = LiveHistory((*SHOWN, *MODELLED), opened.bench.rate_hz)
        self._cycles = CycleTimes(opened.bench.rate_hz)
        self.status = self._seen = opened.bench.status()
        self._silent = 0
        self._reader = opened.bench.ring.reader()
        self.set_up = SetUp()
        self.model = None
        self._timer.start()
        self.context.show_bench(opened)
        device = self.status.device
        self.context.say(f"{device[:1].upper()}{device[1:]} is open")
        self._show()
        self.changed.emit()

    def _let_go(self) -> None:
        self._timer.stop()
        self.opened = self.status = self._seen = self._reader = self.model = None
        self.doing = self.beside = ""
        self.context.show_bench(None)
        self.context.show_rig(RigLine())

    # what can be asked

    @property
    def mode(self) -> Mode | None:
        """The bench's mode; None without a bench."""
        return self.status.mode if self.status is not None else None

    @property
    def driving(self) -> bool:
        """Whether the motor may have current."""
        return self.status is not None and self.status.enabled

    @property
    def live(self) -> bool:
        """Whether samples come."""
        return self.status is not None and not self.status.loop_ended and self._silent < SILENT_LOOKS

    @property
    def warning(self) -> str:
        """What endangers the recording now, in few words; empty for nothing."""
        status, bench = self.status, self.bench
        if status is None or bench is None:
            return ""
        return endangered(status, bench.rate_hz)

    def refusal(self, event: Event) -> str:
        """Why an event cannot be asked for now, empty where it can."""
        if self.status is None:
            return NO_BENCH
        if self.worker.busy:
            return f"{self.worker.title} is under way."
        if self.status.loop_ended:
            return "The device is gone; connect it again."
        status = self.status
        return Machine(status.mode, status.latched, status.pressed, status.unready).refusal(event)

    def ask(
        self, title: str, *commands: Command, done: Callable[[], None] | None = None, doing: str | None = None
    ) -> None:
        """Ask the loop for something, one command after the other; a refusal is told.

        Args:
            doing: what runs from then on, unless it was refused: then what ran before still does.
        """

        def work(bench: Bench) -> None:
            for command in commands:
                bench.ask(command)

        self.do(title, work, lambda _: done() if done is not None else None, doing=doing)

    def do(
        self,
        title: str,
        work: Callable[[Bench], Any],
        done: Callable[[Any], None] = lambda _: None,
        failed: Callable[[Failed], None] | None = None,
        long: bool = False,
        doing: str | None = None,
    ) -> None:
        """Do something that waits for the bench; ``long`` for what takes seconds on a virtual clock, too.

        Args:
            doing: as for :meth:`ask`.
        """
        bench, before, failed = self.bench, self.doing, failed or self._on_failed
        if doing is not None:
            self.doing, on_failed = doing, failed

            def failed(failure: Failed) -> None:
                self.doing = before
                on_failed(failure)

        if bench is None:
            self.context.tell(NO_BENCH)
            return
        if has_virtual_clock(bench) and not long:
            result, failure = attempt(title, lambda: work(bench))  # nobody else turns its clock
            if failure is not None:
                failed(failure)
            else:
                done(result)
            self.tick()
            return
        self.call(title, lambda: work(bench), done, failed)

    def call(
        self,
        title: str,
        work: Callable[[], Any],
        done: Callable[[Any], None] = lambda _: None,
        failed: Callable[[Failed], None] | None = None,
    ) -> None:
        """Do something off the GUI thread, after what was asked before."""
        self.worker.start(title, lambda *_: work(), done, failed=failed, replace=False)

    def stop(self) -> None:
        """The latched stop. Never waits."""
        bench = self.bench
        if bench is None:
            return
        if has_virtual_clock(bench) and self.worker.busy:
            Bench.stop(bench)  # its clock is being turned by another thread
        else:
            bench.stop()
        self.context.say("STOP: motor current to zero, amplifier off")

    def apply(self, set_up: SetUp, done: Callable[[], None]) -> None:
        """Say what is on the bench; ``done`` in any case, for the fields to show what holds."""

        def took(_: Any) -> None:
            self.set_up = set_up
            done()

        def refused(failed: Failed) -> None:
            self._on_failed(failed)
            done()

        self.do("Changing the set-up", lambda bench: bench.ask(set_up), took, refused)

    def compare(self, balance: Balance | None, on: bool) -> None:
        """Model beside the measurement from now on.

        Raises:
            UserError: the rig lacks what the model needs.
        """
        self.model = None
        if on and self.opened is not None and self.bench is not None:
            from fingerlab.models.live import LiveModel

            rate, set_up = self.bench.rate_hz, self.set_up
            self.model = LiveModel(self.opened.rig, rate, set_up.phase, set_up.cable, balance)

    # looking

    def tick(self) -> None:
        """Look at the bench: new samples, its state, what went wrong."""
        bench, reader = self.bench, self._reader
        if bench is None or reader is None:
            return
        stands = has_virtual_clock(bench) and self.worker.busy
        if has_virtual_clock(bench) and not stands:
            bench.step(round(TICK_MS * 1e-3 * bench.rate_hz))
        bench.beat()
        piece = reader.read()
        before, self.status = self.status, bench.status()
        if len(piece.rows):
            self._take(piece.rows)
        self._silent = 0 if len(piece.rows) or stands else self._silent + 1
        self._looks += 1
        self.numbers_due = self._looks % NUMBERS_EVERY == 0 or _state(before) != _state(self.status)
        if self.numbers_due:
            self._show()
        self._complain(self.status)
        self.ticked.emit()

    def _take(self, rows: np.ndarray[Any, np.dtype[np.float64]]) -> None:
        self._cycles.take(rows)
        index = rows[:, COLUMN["index"]]
        whole = self.history.extend(index, {name: rows[:, COLUMN[name]] for name in SHOWN})
        model = self.model
        if model is None:
            return
        from fingerlab.models.live import Measured

        if not whole:
            model.forget()
        torque, force = rows[:, COLUMN["motor_torque"]], rows[:, COLUMN["endpoint_force"]]
        mcp, pip, motor = (rows[:, COLUMN[name]] for name in ("mcp_angle", "pip_angle", "motor_position"))
        modelled = model.extend(Measured(mcp, pip, motor, torque, force))
        stop = int(index[-1]) + 1 - model.delay
        self.history.fill(stop, {MODELLED_TORQUE: modelled.torque, MODELLED_FORCE: modelled.force})
        start = stop - len(index)
        for measured, fitted, residual in (
            ("motor_torque", modelled.torque, TORQUE_RESIDUAL),
            ("endpoint_force", modelled.force, FORCE_RESIDUAL),
        ):
            first, values = self.history.series(measured, start, stop)
            if len(values):
                self.history.fill(stop, {residual: values - fitted[first - start :]})

    def _show(self) -> None:
        status = self.status
        if status is None:
            return
        word = MODE_WORDS[status.mode]
        if status.loop_ended:
            word = "device gone"
        elif status.latched and status.mode is not Mode.FAULT:
            word = f"stopped, {word}"
        self.context.show_rig(
            RigLine(
                light="fault" if status.loop_ended or status.latched else _LIGHTS[status.mode],
                state=word,
                doing=self.doing if status.mode in (Mode.RUNNING, Mode.STOPPING) else self.beside,
                recording=status.recorded if status.recording else None,
                paused=status.recording == 2,
                device=status.device,
                samples=status.index + 1,
                late=status.late + status.lost,
                free_bytes=status.free_bytes,
                warning=self.warning,
                live=status.enabled,
                cycle_s=_known(self._cycles.mean),
                longest_cycle_s=_known(self._cycles.longest),
            )
        )

    def _complain(self, now: Status) -> None:
        """Tell what is new since the last look."""
        before, self._seen = self._seen, now
        if before is None or self.bench is None:
            return
        for notice in notices(before, now, self.bench.rate_hz):
            # In a check a hand tries the lines and the stop, and the page says what came of it.
            asked = self._checks and notice.kind in (Kind.LINE, Kind.STOPPED)
            if notice.kind is not Kind.STOPPED and (asked or (notice.kind in PLAIN and not notice.grave)):
                self.context.say(notice.sentence)
                continue
            if notice.kind is Kind.STOPPED:
                if notice.grave:
                    (self.context.say if asked else self.context.tell)(notice.sentence)
                self.stopped.emit(notice.sentence)
                continue
            self.context.tell(notice.sentence)
            self.warned.emit(notice.sentence)

    @property
    def _checks(self) -> bool:
        return self.opened is not None and self.opened.to_check is not None

    def _on_failed(self, failed: Failed) -> None:
        self.context.tell(failed.sentence, failed.details)


def has_virtual_clock(bench: Bench) -> TypeGuard[InlineBench]:
    """Whether its time only passes when it is told to; such a bench has its own, late import."""
    module = sys.modules.get("fingerlab.acquisition.bench.process_bench")
    return module is not None and isinstance(bench, module.InlineBench)


def _known(seconds: float) -> float:
    return seconds if seconds == seconds else 0.0


def _state(status: Status | None) -> Status | None:
    """A status without what counts on all the time."""
    return status and replace(status, index=0, cycles=0, late=0, run_start=0, recorded=0, free_bytes=0)
