"""One kill: a bench under way, one of its processes killed, and what became of motor and recording."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from pathlib import Path

import numpy as np
import psutil

from fingerlab.acquisition.ring import COLUMN, Ring
from fingerlab.acquisition.status import SharedStatus, Slot
from fingerlab.core.errors import UserError
from fingerlab.sessions import check_session, open_session
from tests.faults.live_card import Served
from tests.faults.shared_device import make_output, read_output

ROOT = Path(__file__).resolve().parents[2]
VICTIMS = ("window", "recorder", "loop")
PATIENCE_S = 60.0


@dataclass(frozen=True)
class Outcome:
    """What was seen after a kill.

    Attributes:
        plant_ms: cycles of the bench from the kill to zero output (1 ms each); after the death of the loop,
            whose cycles end with it, milliseconds of the machine's clock.
        clock_ms: from the kill to zero output by the machine's clock, whoever was killed.
        moving: whether the motor was enabled and had a current when the kill came.
        lost_s: seconds of samples that the loop had published before the kill and the session lacks.
        flushed_lost: samples that the recorder had flushed before the kill and the session lacks.
        kept: samples in the session. ended: what it says of itself. wrong: samples that differ from the ring.
        how: the signal. card: whether the bench was that behind the virtual card.
    """

    victim: str
    after_s: float
    zero: bool
    plant_ms: float
    clock_ms: float
    moving: bool
    lost_s: float
    flushed_lost: int
    kept: int
    ended: str
    wrong: int
    how: str = "SIGKILL"
    card: bool = False


def signal_of(how: str) -> int:
    """The number of SIGTERM or SIGKILL; Windows ends a process the same way for either."""
    return int(getattr(signal, how, signal.SIGTERM))


def kill_once(
    folder: Path,
    victim: str,
    after_s: float,
    how: str = "SIGKILL",
    card: Served | None = None,
    motion: str = "angle",
) -> Outcome:
    """Let a bench run for ``after_s`` seconds of recording, kill ``victim``, and look.

    Args:
        how: the signal's name. card: takes the place of the fake bench. motion: of ``tests.faults.window``.
    """
    output, session = folder / "output", folder / "session.h5"
    arguments = [
        sys.executable,
        "-m",
        "tests.faults.window",
        str(output),
        str(session),
        str(folder / "saved"),
        "30",
        motion,
    ]
    if card is None:
        make_output(output)
    else:
        output = card.output
        card.do("set_up", "on_air", "extension")  # the finger hangs at rest
        arguments.append(card.address)
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, cwd=ROOT, text=True) as window:
        assert window.stdout is not None
        told = json.loads(window.stdout.readline())
        ring, board = Ring.attach(told["ring"]), SharedStatus.attach(told["board"])
        for name in (told["ring"], told["board"]):  # they are the window's, not ours, to remove
            with suppress(AttributeError, KeyError):
                resource_tracker.unregister(f"/{name.lstrip('/')}", "shared_memory")
        _wait_for_samples(board, told["start"] + 1000.0 * after_s)
        before, driven, flushed = ring.last(1)[0], read_output(output), board[Slot.FLUSHED]
        killed_ns = time.monotonic_ns()
        os.kill(told[victim], signal_of(how))
        zero = _wait_for_zero(output)
        at = read_output(output)
        clock = (at.changed_ns - killed_ns) / 1e6
        # The fake bench's cycles end with the loop; a card's go on.
        plant = clock if victim == "loop" and card is None else float(at.changed_at - driven.cycles)
        _wait_for_end(told, window)
        rows = ring.last(ring.rows)
    kept, wrong, last, ended = _look_at(session, rows, told["start"])
    lost = float(max(0.0, (before[COLUMN["index"]] - last) / 1000.0))
    moving = driven.enabled and driven.volts != 0.0
    ring.close()
    board.close()
    forgotten = max(0, flushed - kept)
    return Outcome(
        victim,
        after_s,
        zero,
        plant,
        clock,
        moving,
        lost,
        forgotten,
        kept,
        ended,
        wrong,
        how,
        card is not None,
    )


def _look_at(session: Path, rows: np.ndarray, start: int) -> tuple[int, int, int, str]:
    try:
        found = open_session(session)
    except UserError as error:  # killed before the first flush: all that was recorded counts as lost
        if "holds no samples" not in str(error):
            raise
        return 0, 0, start - 1, "empty"
    assert not check_session(found).errors
    run = found.runs[0]
    data = run.load(["time", "motor_position", "raw/encoder_counts"])
    index = start + np.rint(data["time"] * 1000.0).astype(int)
    published = rows[np.isin(rows[:, COLUMN["index"]], index)]
    assert len(published) == len(index)
    same = data["raw/encoder_counts"] == published[:, COLUMN["raw/encoder_counts"]]
    same &= np.abs(data["motor_position"] - published[:, COLUMN["motor_position"]]) < 1e-6
    return len(index), int((~same).sum()), int(index[-1]), str(found.attributes["ended"])


def _wait_for_samples(board: SharedStatus, index: float) -> None:
    end = time.monotonic() + PATIENCE_S
    while board[Slot.INDEX] < index and time.monotonic() < end:
        time.sleep(2e-3)


def _wait_for_zero(output: Path) -> bool:
    end = time.monotonic() + PATIENCE_S
    while not read_output(output).zero:
        if time.monotonic() > end:
            return False
        time.sleep(1e-3)
    return True


def _wait_for_end(told: dict[str, int], window: subprocess.Popen[str]) -> None:
    """Until no process holds the recording any more; a window that lives on ends by itself."""
    end = time.monotonic() + PATIENCE_S
    try:
        window.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        window.kill()
    for name in ("loop", "recorder"):
        while psutil.pid_exists(told[name]) and time.monotonic() < end:
            time.sleep(0.01)
