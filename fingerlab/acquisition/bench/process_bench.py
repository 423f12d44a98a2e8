"""Two benches with one face: loop and recorder in processes of their own, or here on a virtual clock.

On a virtual clock it is the same objects as in ``processes.py``, without processes; nothing watches from
outside, so that one is for devices that are simulated or replayed.
"""

from __future__ import annotations

import multiprocessing
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from fingerlab.acquisition.bench.bench import Bench, RecorderClient, Status
from fingerlab.acquisition.bench.loop import STOOD_STILL, ControlLoop
from fingerlab.acquisition.bench.processes import DeviceSource, Plan, loop_main, recorder_main
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Command, Quit
from fingerlab.acquisition.recorder import Recorder
from fingerlab.acquisition.recording import RunInfo, SessionInfo
from fingerlab.acquisition.ring import COLUMNS, Ring
from fingerlab.acquisition.status import Number, SharedStatus, Slot, Text
from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.progress import Progress, own_code_only
from fingerlab.devices.protocol import Device, DeviceFault, DeviceLost
from fingerlab.sessions.recording_files import VERIFYING, WRITING

INLINE_RING_S = 30.0
"""Length of the ring; the recorder is polled far more often."""

POLL_CYCLES = 200
"""Rows taken at a time: with fewer, HDF5 would cost more than the bench."""

IDLE_CYCLES = 10


class InlineBench(Bench):
    """A bench stepped by hand; see :class:`Bench`."""

    def __init__(
        self, device: Device, settings: LoopSettings, rescue: Path, clock: Callable[[], float] | None = None
    ) -> None:
        """Open the device.

        Args:
            clock: seconds, to measure cycles; without one each lasts its period.

        Raises:
            UserError: the device cannot be opened.
        """
        self.rate_hz, self.settings = device.rate_hz, settings
        self.ring = Ring.make(round(INLINE_RING_S * self.rate_hz), len(COLUMNS), shared=False)
        self.board = SharedStatus.make(shared=False)
        self.device = device
        settings = replace(settings, watch_window=False, watch_recorder=False, watch_guardian=False)
        self.loop = ControlLoop(device, settings, self.ring, self.board, clock)
        self.recorder: Recorder = Recorder(self.ring, self.board, rescue)
        self._number = self._cycles = 0
        try:
            self.loop.open()
        except (DeviceLost, DeviceFault) as error:
            self.loop.close()
            raise UserError(str(error)) from None

    def step(self, cycles: int) -> None:
        """Let the loop do ``cycles`` cycles, and the recorder its part."""
        for _ in range(cycles):
            if self.loop.ended:
                break
            self.loop.cycle()
            self._cycles += 1
            if self._cycles % POLL_CYCLES == 0:
                self.recorder.poll()

    def stop(self) -> None:
        """The latched stop; nobody else lets the loop's next cycle come, so it is done here."""
        super().stop()
        self.step(1)

    def idle(self) -> None:
        self.step(IDLE_CYCLES)

    def ask(self, command: Command) -> None:
        self._number += 1
        self.loop.submit(self._number, command)
        while self.board[Slot.ACK] != self._number and not self.loop.ended:
            self.step(1)
        refusal = self.board.text(Text.ANSWER) if self.board[Slot.ACK] == self._number else ""
        if self.board[Slot.ACK] != self._number:
            refusal = self.board.text(Text.FAULT) or "The control loop has ended."
        if refusal:
            raise UserError(refusal)

    def close(self) -> None:
        if not self.loop.ended or not self.board[Slot.LOOP_ENDED]:
            self.loop.close()
        if self.recorder.recording:
            self.recorder.cut("The bench was closed while it recorded.")


RING_S = 240.0
"""Length of the ring: the last four minutes can be scrolled back, 43 MB at 1 kHz."""

START_S = 60.0
"""A process that is not ready after this will not be (importing and compiling take seconds)."""

LOOP_DIED = "The control loop has ended unexpectedly; the motor was stopped, connect the device again."
ANSWER_S = 5.0
IDLE_S = 0.005


class ProcessBench(Bench):
    """A bench in processes of its own; see :class:`Bench`. Safe to make in a program with a window.

    The caller has to call ``beat`` (or ``idle``, which does) at least every ``limits.window_time`` while the
    amplifier is enabled; otherwise the motor is stopped.
    """

    @own_code_only()
    def __init__(
        self, device: DeviceSource, settings: LoopSettings, rescue: Path, rate_hz: float = 1000.0
    ) -> None:
        """Start both processes and wait until the device is ready.

        Raises:
            UserError: the device cannot be opened.
        """
        self.rate_hz, self.settings = rate_hz, settings
        self._number = 0
        self._closed = True  # there is nothing to close yet
        try:
            with _heard_later():  # what is half made could not be closed
                self._make(device, rescue)
                self._closed = False
            self._wait_for_start()
        except BaseException:
            self.close()
            raise

    def _make(self, device: DeviceSource, rescue: Path) -> None:
        self.ring = Ring.make(round(RING_S * self.rate_hz), len(COLUMNS))
        self.board = SharedStatus.make()
        plan = Plan(device, self.settings, str(self.ring.name), str(self.board.name), rescue)
        context = multiprocessing.get_context("spawn")
        commands_in, self._commands = context.Pipe(duplex=False)
        requests_in, requests = context.Pipe()
        recorder_lives, recorder_holds = context.Pipe(duplex=False)
        loop_lives, loop_holds = context.Pipe(duplex=False)
        self.loop_process = context.Process(
            target=loop_main, args=(plan, commands_in, recorder_lives, loop_holds), name="fingerlab-loop"
        )
        self.recorder_process = context.Process(
            target=recorder_main,
            args=(plan, requests_in, loop_lives, recorder_holds),
            name="fingerlab-recorder",
        )
        before = _interrupts("SIG_BLOCK", {signal.SIGINT})  # who has just begun is ended in order, by close
        self.loop_process.start()
        self.recorder_process.start()
        _interrupts("SIG_SETMASK", before)
        for end in (commands_in, requests_in, recorder_lives, recorder_holds, loop_lives, loop_holds):
            end.close()
        self._far = RemoteRecorder(self, requests)
        self.recorder = self._far

    def ask(self, command: Command) -> None:
        self._number += 1
        try:
            self._commands.send((self._number, command))
        except OSError:
            why = self._loss or self.board.text(Text.FAULT)
            raise UserError(why or "The control loop has ended; open the bench again.") from None
        end = time.monotonic() + ANSWER_S
        while self.board[Slot.ACK] != self._number:
            if self.board[Slot.LOOP_ENDED] or self._loss:
                raise UserError(self._loss or self.board.text(Text.FAULT) or "The control loop has ended.")
            if time.monotonic() > end:
                raise UserError("The control loop does not answer; stop the motor by its own switch.")
            self.beat()
            time.sleep(1e-3)
        # What a loop that stood still answers in its last cycle is not why.
        refusal = STOOD_STILL if self.board[Slot.GUARDIAN_ACTED] else self.board.text(Text.ANSWER)
        if refusal:
            raise UserError(refusal)

    def status(self) -> Status:
        status = super().status()
        loss = "" if self._closed else self._loss
        if loss:
            return replace(status, loop_ended=True, fault=loss)
        return super().status() if not self._closed and self.board[Slot.LOOP_ENDED] else status

    @property
    def _loss(self) -> str:
        """How the loop was lost without having ended; empty where it was not."""
        alive = self.loop_process.is_alive()
        if self.board[Slot.LOOP_ENDED]:  # looked at last: it may have ended meanwhile, and properly
            return ""
        if not alive:
            return LOOP_DIED
        return STOOD_STILL if self.board[Slot.GUARDIAN_ACTED] else ""

    def idle(self) -> None:
        self.beat()
        loss = self._loss
        if loss:
            raise UserError(loss)
        if not self.recorder_process.is_alive():
            raise UserError("The recorder has ended unexpectedly; the motor was stopped.")
        time.sleep(IDLE_S)

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        with _heard_later():  # half closed, its recorder would wait for a word, and the program for it
            self.stop()
            with suppress(OSError):
                self._commands.send((self._number + 1, Quit()))
            self._join(self.loop_process)
            self._far.quit()
            self._join(self.recorder_process)
            self._commands.close()
            self.ring.close()
            self.board.close()

    def _wait_for_start(self) -> None:
        end = time.monotonic() + START_S
        while not self.board[Slot.LOOP_READY] or not self.board[Slot.RECORDER_PID]:
            failed = self.board.text(Text.FAULT) if self.board[Slot.LOOP_ENDED] else ""
            dead = self.loop_process.exitcode is not None or self.recorder_process.exitcode is not None
            if failed or dead or time.monotonic() > end:
                failed = failed or self.board.text(Text.RECORDER)
                self.close()
                raise UserError(failed or "The control loop did not start; look at the terminal for why.")
            time.sleep(0.01)

    def _join(self, process: Any) -> None:
        process.join(10.0)
        if process.is_alive():
            process.terminate()
            process.join(5.0)
        if process.is_alive():  # one that is held still does not hear it
            process.kill()
            process.join(5.0)


def _interrupts(how: str, which: Any) -> Any:
    """Block Ctrl-C for processes that begin, or what was before again; Windows cannot, and does without."""
    if hasattr(signal, "pthread_sigmask"):
        return signal.pthread_sigmask(getattr(signal, how), which)
    return which


@contextmanager
def _heard_later() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait until the end, where this is the thread that is told of them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {
        which: signal.signal(which, lambda number, _: came.append(number))
        for which in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for which, handler in before.items():
            signal.signal(which, signal.SIG_DFL if handler is None else handler)
        for number in came:
            signal.raise_signal(number)


class RemoteRecorder(RecorderClient):
    """The recorder in its own process."""

    def __init__(self, bench: ProcessBench, requests: Connection) -> None:
        self._bench, self._requests = bench, requests

    def open(self, info: SessionInfo) -> None:
        self._call("open", info)

    def begin(self, run: RunInfo) -> None:
        self._call("begin", run)

    def pause(self, on: bool) -> None:
        self._call("pause", on)

    def mark(self, note: str, index: int | None = None) -> None:
        self._call("mark", note, index)

    def end(self, stop: int | None = None) -> None:
        self._call("end", stop)

    def cut(self, note: str) -> None:
        self._call("cut", note)

    def close(self, progress: Progress | None = None) -> Path:
        board = self._bench.board
        board.set_number(Number.WRITTEN, 0.0)
        board[Slot.VERIFYING] = board[Slot.PUT_OFF] = 0

        def tell() -> None:
            if progress is None or board[Slot.PUT_OFF]:
                return
            try:
                progress(board.number(Number.WRITTEN), VERIFYING if board[Slot.VERIFYING] else WRITING)
            except Cancelled:
                board[Slot.PUT_OFF] = 1

        try:
            path: Path = self._call("close", waiting=tell)
        finally:
            board[Slot.PUT_OFF] = 0  # the next session is another question
        return path

    def quit(self) -> None:
        """End the recorder's process."""
        with suppress(OSError):
            self._requests.send(("quit", ()))

    def _call(self, name: str, *arguments: Any, waiting: Callable[[], None] = lambda: None) -> Any:
        try:
            self._requests.send((name, arguments))
            while not self._requests.poll(0.01):
                self._bench.beat()
                waiting()
            good, answer = self._requests.recv()
        except (EOFError, OSError):
            raise UserError("The recorder has ended unexpectedly; open the bench again.") from None
        if not good:
            raise answer
        return answer
