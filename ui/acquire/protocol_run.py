"""A protocol under way: its steps taken off the GUI thread, what it asks, how far it is."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from queue import Empty

from PySide6.QtCore import QObject, Signal

from fingerlab.acquisition.bench import Bench
from fingerlab.acquisition.commands import Initialise, SetUp
from fingerlab.acquisition.protocol import Change, Step
from fingerlab.acquisition.protocol_driver import ProtocolDriver
from fingerlab.core.errors import UserError

from ..tasks import Failed
from .recording import Recording
from .writing import Ending


class _Driver(ProtocolDriver):
    """Says which set-up it has come to."""

    def __init__(
        self,
        bench: Bench,
        ask_operator: Callable[[str], None],
        changed: Callable[[SetUp], None],
        initial: Initialise,
        between: Callable[[], None],
    ) -> None:
        super().__init__(bench, ask_operator, None, initial, between)
        self._changed = changed

    def _take(self, step: Step) -> None:
        super()._take(step)
        if isinstance(step, Change):
            self._changed(step.set_up)


class ProtocolRun(QObject):
    """Takes the steps of one protocol at a time.

    Signals:
        asked(sentence): the operator has to do something, then :meth:`answer`.
        progressed(share, words, step_left_s, left_s). set_up_changed(SetUp).
        ended(how): it is over: ``done`` or a sentence.
    """

    asked = Signal(str)
    progressed = Signal(float, str, float, float)
    set_up_changed = Signal(object)
    ended = Signal(str)

    def __init__(self, recording: Recording) -> None:
        super().__init__(recording)
        self._recording, self._station = recording, recording.station
        self._answered = threading.Event()
        self._told: tuple[int, str, int] = (0, "", 0)

    def start(self, steps: Sequence[Step], title: str, initial: Initialise) -> bool:
        """Take the steps one by one and write the session; whether it has begun."""
        recording = self._recording
        info = recording.told_info(title or "protocol")
        if info is None:
            return False
        self._answered.clear()
        self._run_errands(None)
        recording.in_protocol = True

        def work(bench: Bench) -> Ending:
            driver = _Driver(
                bench,
                lambda sentence: self._ask(bench, sentence),
                self.set_up_changed.emit,
                initial,
                lambda: self._run_errands(bench),
            )
            driver.report_to(lambda share, words: self._report(driver, share, words))
            try:
                bench.recorder.open(info)
                driver.take(steps)
                self._run_errands(bench)
            except BaseException as error:
                bench.stop()  # before anything else
                raise UserError(_kept(bench, str(error) or type(error).__name__)) from error
            return recording.writing.close(bench, info.path)

        self._station.do("The protocol", work, self._on_done, self._on_failed, True)
        recording.changed.emit()
        return True

    def answer(self) -> None:
        """The operator has done what was asked."""
        self._answered.set()

    # in the worker

    def _ask(self, bench: Bench, sentence: str) -> None:
        """Wait for the operator, but not for one who has pressed STOP."""
        self._answered.clear()
        self.asked.emit(sentence)
        bench.wait_until(self._answered.is_set, math.inf, "")

    def _run_errands(self, bench: Bench | None) -> None:
        """Do what others asked for meanwhile; without a bench, forget it."""
        while True:
            try:
                errand = self._recording.errands.get_nowait()
            except Empty:
                return
            if bench is not None:
                errand(bench)

    def _report(self, driver: ProtocolDriver, share: float, words: str) -> None:
        """Asked hundreds of times a second; told when something of it changes on the screen."""
        now = round(500 * share), words, math.ceil(driver.step_left_s)
        if now != self._told:
            self._told = now
            self.progressed.emit(share, words, driver.step_left_s, driver.left_s)

    # its end

    def _on_done(self, ending: Ending) -> None:
        self._recording.in_protocol = False
        self._recording.keep(ending)
        self.ended.emit("done")

    def _on_failed(self, failure: Failed) -> None:
        self._recording.in_protocol = False
        self._recording.writing.over()
        self._station.desk.tell(failure.sentence, failure.details)
        self.ended.emit(failure.sentence)
        self._recording.changed.emit()


def _kept(bench: Bench, reason: str) -> str:
    """What was recorded before it broke off becomes a session that says so."""
    try:
        bench.recorder.cut(reason)
        path = bench.recorder.close()
    except UserError:
        return f"{reason} The protocol was given up before a run was recorded."
    return f"{reason} The protocol was given up; what was recorded is in {path}."
