"""A protocol under way: its steps off the GUI thread, its prompts above the plots, its countdown."""

from __future__ import annotations

import math
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from queue import Empty
from typing import Any

from PySide6.QtCore import QObject, Signal

from fingerlab.acquisition.bench.bench import Bench, Status
from fingerlab.acquisition.control.machine import Initialise, SetUp
from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.acquisition.protocols.driver import ProtocolDriver, refuse_impossible
from fingerlab.acquisition.protocols.steps import Change, Record, Step, countdown
from fingerlab.core.errors import UserError

from ..app.context import ApplicationContext
from ..app.worker import Failed
from ..widgets.fields import take_typed
from .acquire_bars import PromptBar
from .acquire_panel import AcquirePanel
from .recording_control import RecordingControl, SessionEnding


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

    Attributes:
        completed: number of the last run that was recorded whole; 0 before the first.
        written: the session of the last protocol, once it is whole.

    Signals:
        asked(sentence): the operator has to do something, then :meth:`answer`.
        progressed(share, words, step_left_s, left_s). set_up_changed(SetUp).
        ended(how): it is over: ``done`` or a sentence.
    """

    asked = Signal(str)
    progressed = Signal(float, str, float, float)
    set_up_changed = Signal(object)
    ended = Signal(str)

    def __init__(self, recording: RecordingControl) -> None:
        super().__init__(recording)
        self._recording, self._controller = recording, recording.controller
        self._answered = threading.Event()
        self._reported: tuple[int, str, int] = (0, "", 0)
        self.completed = 0
        self.written: Path | None = None

    def start(
        self,
        steps: Sequence[Step],
        title: str,
        initial: Initialise,
        attributes: Mapping[str, Any] | None = None,
    ) -> bool:
        """Take the steps one by one and write the session; whether it has begun.

        Args:
            attributes: of the session, beside the usual ones.
        """
        recording = self._recording
        info = recording.described_info(title or "protocol")
        if info is None:
            return False
        info = replace(info, attributes={**info.attributes, **(attributes or {})})
        self._answered.clear()
        self._run_errands(None)
        recording.in_protocol = True
        self._controller.context.settings.set_under_way(info.path)

        self.completed, self.written = 0, None

        def work(bench: Bench) -> SessionEnding:
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
                self.completed = driver.completed
                raise UserError(_kept(bench, str(error) or type(error).__name__)) from error
            return recording.writing.close(bench, info.path)

        self._controller.do("The protocol", work, self._on_done, self._on_failed, True)
        recording.changed.emit()
        return True

    def answer(self) -> None:
        """The operator has done what was asked."""
        self._answered.set()

    # in the worker

    def _ask(self, bench: Bench, sentence: str) -> None:
        """Wait for the operator, but not for one who has pressed STOP."""
        self._answered.clear()
        bench.wait_until(self._answered.is_set, math.inf, "", lambda: self.asked.emit(sentence))

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
        self.completed = driver.completed
        now = round(500 * share), words, math.ceil(driver.step_left_s)
        if now != self._reported:
            self._reported = now
            self.progressed.emit(share, words, driver.step_left_s, driver.left_s)

    # its end

    def _on_done(self, ending: SessionEnding) -> None:
        self._recording.in_protocol = False
        self.written = ending.path if ending.whole else None
        self._recording.keep(ending)
        self.ended.emit("done")

    def _on_failed(self, failure: Failed) -> None:
        self._recording.in_protocol = False
        self._controller.context.settings.set_under_way(None)
        self._recording.writing.over()
        self._controller.context.tell(failure.sentence, failure.details)
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


class ProtocolController(QObject):
    """Between the protocol's form, its run, its prompts and the panel.

    Args:
        set_up: called with the set-up that the protocol has come to. refresh: called when it is over.

    Signals:
        torques_planned(plans by model): of a force trial, before the operator is asked.
        trial_taken(path): the session of a force trial is whole.
    """

    torques_planned = Signal(object)
    trial_taken = Signal(object)

    def __init__(
        self,
        context: ApplicationContext,
        recording: RecordingControl,
        panel: AcquirePanel,
        prompt: PromptBar,
        set_up: Callable[[SetUp], None],
        refresh: Callable[[], None],
    ) -> None:
        super().__init__(recording)
        self._context, self._recording, self._panel, self._prompt = context, recording, panel, prompt
        self._refresh = refresh
        self.running = ProtocolRun(recording)
        self.running.asked.connect(prompt.ask)
        self.running.progressed.connect(self._on_progress)
        self.running.set_up_changed.connect(set_up)
        self.running.ended.connect(self._on_ended)
        self._steps: Sequence[Step] = ()
        self._is_trial = False
        prompt.done.connect(self.running.answer)
        recording.controller.stopped.connect(lambda _: prompt.over())
        panel.motion.edited.connect(self.tell_total)
        panel.protocol.edited.connect(self.tell_total)
        panel.protocol.which.currentIndexChanged.connect(self._on_which)
        context.protocol_handed.connect(self._on_protocol_handed)
        self.tell_total()

    def start(self) -> None:
        """Take all runs of the protocol that is set."""
        panel = self._panel
        if take_typed(panel.protocol_fields):  # the field says what is wrong
            return
        try:
            steps = panel.protocol.steps(panel.motion.settings())
            bench = self._recording.controller.bench
            if bench is not None:
                refuse_impossible(steps, bench.settings)
        except UserError as error:
            self._context.tell(str(error), traceback.format_exc())
            return
        trial = panel.protocol.planned
        attributes = {} if trial is None else trial.attributes
        if trial is not None:
            trial.show = self.torques_planned.emit
        if self.running.start(steps, panel.protocol.title(), panel.initial.command(), attributes):
            self._steps, self._is_trial = steps, trial is not None
            self._recording.controller.doing = "protocol"

    def take_file(self, path: Path) -> bool:
        """A table that was dropped becomes the motion by hand; what is none is refused in a sentence."""
        motion = self._panel.motion
        try:
            read_trajectory({"kind": motion.kind_by_points, "file": str(path)}, str(path))
        except UserError as error:
            self._context.tell(str(error), traceback.format_exc())
            return False
        motion.show_file(path)
        self._panel.by_hand.click()
        self._context.say(f"Motion set: {path.name}")
        return True

    def tell_total(self) -> None:
        """How many runs, how long, as the forms are now."""
        form = self._panel.protocol
        try:
            form.tell_total(form.steps(self._panel.motion.settings()))
        except UserError as error:
            form.total.setText(str(error))

    def _on_progress(self, share: float, words: str, step_left_s: float, left_s: float) -> None:
        panel = self._panel
        panel.progress.show()
        panel.progress.setValue(round(1000 * share))
        step = f": {countdown(step_left_s)}" if step_left_s > 0 else ""
        panel.left.setText(f"{words[:1].upper()}{words[1:]}{step} · in all {countdown(left_s)} left")
        self._recording.controller.doing = f"protocol, {words}"

    def _on_which(self, _row: int) -> None:
        """How the last protocol ended is not said of another one."""
        if not self._recording.in_protocol:
            self._panel.left.setText("")
            self._panel.progress.setValue(0)

    def _on_ended(self, how: str) -> None:
        self._prompt.over()
        self._panel.progress.setValue(1000 if how == "done" else 0)
        first = next((step.number for step in self._steps if isinstance(step, Record)), 1)
        reached = max(self.running.completed + 1, first)
        self._panel.left.setText("All runs taken" if how == "done" else f"Given up in run {reached}")
        self._panel.protocol.go_on_from(1 if how == "done" else reached)
        self._recording.controller.doing = ""
        self._refresh()
        if how == "done" and self._is_trial and self.running.written is not None:
            self.trial_taken.emit(self.running.written)

    def _on_protocol_handed(self, steps: Sequence[Any], title: str) -> None:
        self._panel.protocol.hand(steps, title)
        self._panel.by_protocol.click()


def left_of_run(status: Status, rate_hz: float, lasts_s: float) -> float:
    """What is left of the trajectory that runs and lasts so long, s."""
    return max(lasts_s - (status.index - status.run_start) / rate_hz, 0.0)
