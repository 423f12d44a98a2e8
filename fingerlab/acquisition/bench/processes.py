"""The processes of a bench: control loop and recorder, and what each does when another one dies.

Who holds which end tells who lives: every process holds the writing end of a pipe to each that has to know,
and the system closes it with the process, whatever killed it; where the system tells sooner, loop and
guardian look there (``guardian.py``). Silence without death is told by heartbeats in the board. The
recorder's process also keeps the guardian: when the loop dies without having said goodbye, or stands
still with the amplifier on, it writes zero output and drops the enable line through a device of its own. The
loop opens its device once that of the guardian has been tried.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time
import traceback
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import NoReturn, Protocol

from fingerlab.acquisition.bench.guardian import PeerWatch, StallWatch, await_trial, guard, try_stop
from fingerlab.acquisition.bench.loop import ControlLoop
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.recorder import Recorder
from fingerlab.acquisition.ring import Ring
from fingerlab.acquisition.status import SharedStatus, Slot, Text
from fingerlab.core.errors import Cancelled, UserError
from fingerlab.core.progress import HIGH_CLASS, ask_for
from fingerlab.devices.protocol import Device, DeviceFault, DeviceLost

LOOK_S = 0.1
"""How often the enable line is looked at; a machine takes minutes to fall asleep."""

REFUSED = (
    "The system does not let its sleep be held off; switch sleep off in its settings before the motor is "
    "driven."
)


def _follow(board: SharedStatus) -> None:
    while True:
        if board[Slot.ENABLE_LINE]:
            _hold_off(board)
        time.sleep(LOOK_S)


def _hold_off(board: SharedStatus) -> None:
    """Ask the system not to sleep until the line is low again; that it refuses goes to the board, once."""
    from wakepy import keep

    with keep.running(on_fail="pass") as mode:
        board[Slot.AWAKE] = int(mode.active)
        if not mode.active:
            board.set_text(Text.SLEEP, REFUSED)
        while board[Slot.ENABLE_LINE]:
            time.sleep(LOOK_S)
    board[Slot.AWAKE] = 0


POLL_S = 0.02
"""How often the recorder takes what the ring has."""

NICENESS = -10
"""That loop and recorder ask for."""

REAL_TIME = 10
"""Priority in the class of real-time programs (Linux, sched(7)) that a loop paced by a clock asks for: before
every ordinary program, after the system's own (assumed). In the ordinary class even the most favoured program
waits for a running one to use up its slice, some 3 ms."""

GRACE_S = 2.0
"""How long the recorder waits for the loop to end when the window is lost."""

GUARDIAN_S = 5.0
"""How long the recorder's process waits at its end for the guardian to have stopped the motor (assumed)."""

WINDOW_LOST = "The window has ended unexpectedly; the motor was stopped."
RECORDER_LOST = "The recorder has ended unexpectedly; the motor was stopped."
CLOSED = "The bench was closed while it recorded."
LOOP_LOST = "The control loop ended unexpectedly; the recording was cut."


class DeviceSource(Protocol):
    """A device before it is built, such as :class:`fingerlab.devices.choosing.DeviceChoice`."""

    @property
    def kind(self) -> str: ...

    @property
    def real_time(self) -> bool:
        """Paced by a clock; else the loop runs on without ever waiting."""
        ...

    def build(self) -> Device: ...


IN_THE_LOOP = ("simulated", "replay")
"""Kinds of device that live and die with the loop's process and need no guardian."""


@dataclass(frozen=True)
class Plan:
    """What both processes are told at their start."""

    device: DeviceSource
    settings: LoopSettings
    ring: str
    board: str
    rescue: Path


def loop_main(plan: Plan, commands: Connection, recorder_lives: Connection, alive: Connection) -> None:
    """The control loop's process. ``alive`` is only held, so that the recorder sees it close."""
    _be_undisturbed()
    ring, board = Ring.attach(plan.ring), SharedStatus.attach(plan.board)
    board[Slot.LOOP_PID] = os.getpid()
    try:
        loop = ControlLoop(plan.device.build(), plan.settings, ring, board, time.perf_counter)
        await_trial(board, recorder_lives)
        gc.collect()  # takes tenths of a second: before the device counts cycles
        gc.freeze()
        gc.disable()
        loop.open()
    except Exception as error:
        board.set_text(Text.FAULT, _why(error))
        board[Slot.LOOP_ENDED] = 1
        _leave()

    def lost(sentence: str) -> None:
        if not loop.ended:
            loop.lose(sentence, farewell=sentence is WINDOW_LOST)

    lives = PeerWatch(os.getppid(), board, lost, (WINDOW_LOST, RECORDER_LOST))
    come_first(plan.device.real_time)
    # Only now, so that it comes first, too: set aside while it holds Python, it would hold up the loop.
    threading.Thread(target=_listen, args=(loop, lives, commands, recorder_lives), daemon=True).start()
    loop.run(lives.look)
    _leave()


def _listen(loop: ControlLoop, lives: PeerWatch, commands: Connection, recorder_lives: Connection) -> None:
    """Take commands, and notice who died; in a thread, so that the loop never waits."""
    ends = {commands: WINDOW_LOST, recorder_lives: RECORDER_LOST}
    while ends and not loop.ended:
        for end in wait(list(ends), timeout=0.5):
            assert isinstance(end, Connection)
            try:
                number, command = end.recv()
            except (EOFError, OSError):
                lives.tell(ends.pop(end))
            else:
                loop.submit(number, command)


def recorder_main(plan: Plan, requests: Connection, loop_lives: Connection, alive: Connection) -> None:
    """The recorder's process. ``alive`` is only held, so that the loop sees it close."""
    _be_undisturbed()
    come_first()  # before the driver starts threads of its own
    ring, board = Ring.attach(plan.ring), SharedStatus.attach(plan.board)
    try:
        # Built before it is needed: importing a driver takes longer than the motor may run. And before the
        # bench is told that this process is there: without a guardian no motor is driven.
        own = None if plan.device.kind in IN_THE_LOOP else plan.device.build()
    except Exception as error:
        board.set_text(Text.RECORDER, _why(error))
        _leave()
    try_stop(own, board)
    board[Slot.RECORDER_PID] = os.getpid()
    recorder = Recorder(ring, board, plan.rescue)
    # A simulated motor stands still with its loop; without a clock nothing moves while the loop does not.
    watched = own is not None and plan.device.real_time
    standstill = StallWatch(board, plan.settings.limits.late_time) if watched else None
    guardian = threading.Thread(
        target=_guard, args=(own, board, loop_lives, standstill, plan.device.real_time), daemon=True
    )
    guardian.start()
    if plan.device.kind not in IN_THE_LOOP:  # a simulated motor may fall asleep with its machine
        threading.Thread(target=_follow, args=(board,), name="awake", daemon=True).start()
    cut = False
    while True:
        recorder.poll()
        if board[Slot.GUARDIAN_ACTED] and not cut:
            cut = True
            recorder.cut(LOOP_LOST)
        try:
            if not requests.poll(POLL_S):
                continue
            name, arguments = requests.recv()
        except (EOFError, OSError):
            _end_alone(recorder, board)
            break
        if name == "quit":
            _write_whole(recorder, CLOSED if board[Slot.LOOP_ENDED] else LOOP_LOST)
            break
        _serve(recorder, requests, name, arguments)
    guardian.join(GUARDIAN_S)  # what it has begun to stop is stopped, whoever wants this process to end
    _leave()


def _guard(
    device: Device | None,
    board: SharedStatus,
    loop_lives: Connection,
    standstill: StallWatch | None,
    paced: bool,
) -> None:
    """The guardian's thread, which mostly waits, as the loop does."""
    come_first(paced)
    guard(device, board, loop_lives, standstill)


def _serve(recorder: Recorder, requests: Connection, name: str, arguments: tuple[object, ...]) -> None:
    try:
        answer = (True, getattr(recorder, name)(*arguments))
    except (UserError, Cancelled) as error:
        answer = (False, error)
    except (OSError, RuntimeError) as error:
        sentence = f"The recorder failed ({' '.join(str(error).split())}); look at the disk."
        answer = (False, UserError(sentence))
    with suppress(OSError):
        requests.send(answer)


def _end_alone(recorder: Recorder, board: SharedStatus) -> None:
    """The window is gone: record how the motor was stopped, then write the session whole."""
    end = time.monotonic() + GRACE_S
    while time.monotonic() < end and not board[Slot.LOOP_ENDED]:
        recorder.poll()
        time.sleep(POLL_S)
    _write_whole(recorder, WINDOW_LOST)


def _write_whole(recorder: Recorder, note: str) -> None:
    """What was recorded becomes a session that says why it was cut; nothing where all is closed."""
    with suppress(UserError, OSError, RuntimeError):
        recorder.cut(note)
        recorder.close()


def _why(error: Exception) -> str:
    """Why a device cannot be used. One that its user wrote may fail in any way, and they want the line."""
    if isinstance(error, (DeviceLost, DeviceFault, UserError)):
        return str(error)
    traceback.print_exception(error)
    return f"The device cannot be opened ({' '.join(f'{type(error).__name__}: {error}'.split())})."


def _leave() -> NoReturn:
    """End the process at once: everything is closed, and views of the shared memory need no farewell."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def come_first(paced: bool = False) -> None:
    """Ask for this thread, and those that it starts from now on, to run before ordinary programs.

    Not every system or user is granted it.

    Args:
        paced: it mostly waits, and may therefore come before everything else where another core is left.
    """
    ask_for(NICENESS, HIGH_CLASS)
    if paced and hasattr(os, "sched_setscheduler") and (os.cpu_count() or 1) > 1:
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(REAL_TIME))


def _be_undisturbed() -> None:
    """Ctrl-C belongs to the parent, who stops the motor first; threads change hands quickly."""
    with suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.setswitchinterval(5e-4)
