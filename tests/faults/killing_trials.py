"""One kill of a force trial: in its motion of angle, under torque, or between two runs.

``python -m tests.faults.killing_trials OUTPUT SESSION RESCUE MODEL`` stands for ``record --feed-forward``
with the nominal side of MODEL: the simulated finger in real time, its output in the file OUTPUT, which
outlives the process that drives it. It prints a line of JSON when its bench is open, and goes on until its
trial ends or is ended.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from fingerlab.acquisition.bench.process_bench import ProcessBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.protocols.driver import ProtocolDriver
from fingerlab.acquisition.protocols.force_trial import ForceTrial, TrialSettings
from fingerlab.acquisition.recording import SessionInfo
from fingerlab.acquisition.status import SharedStatus, Slot
from fingerlab.core.errors import UserError
from fingerlab.prediction.feed_forward import NOMINAL
from fingerlab.rig.file import default_rig
from fingerlab.sessions import check_session, open_session
from tests.faults.killing import PATIENCE_S, ROOT, VICTIMS, signal_of
from tests.faults.killing_checks import NotSoFar
from tests.faults.shared_device import SharedChoice, make_output, read_output
from tests.faults.window import PATIENT

WANTED = {"kind": "sine", "amplitude_n": 0.4, "mean_n": 0.9, "frequency_hz": 0.5, "duration_s": 4.0}
MOMENTS = {"pose": (0, 5.0), "torque": (1, 4.0), "between": (1, 0.2)}
"""Moment -> whole runs before it, and within how many s of its beginning the kill comes."""


@dataclass(frozen=True)
class TrialKill:
    """What was seen.

    Attributes:
        victim, moment, how: who, when and by which signal. driven: whether a set value stood at the kill.
        zero: whether zero and low were reached, and stayed. plant_ms: cycles of the bench until then, and ms
            of the machine's clock after the death of the loop; 0 where nothing stood.
        said: how each run of the session ended. whole: how many had been recorded whole.
        ended: whether no process was left.
    """

    victim: str
    moment: str
    how: str
    driven: bool
    zero: bool
    plant_ms: float
    said: tuple[str, ...]
    whole: int
    ended: bool


def kill_trial(folder: Path, model: Path, victim: str, moment: str, how: str, share: float) -> TrialKill:
    """Kill ``victim`` at this share (0 to 1) of its moment's time.

    Raises:
        NotSoFar: the trial ended before.
    """
    session, output = folder / "trial.h5", folder / "output"
    whole, seconds = MOMENTS[moment]
    make_output(output)
    arguments = [sys.executable, "-m", "tests.faults.killing_trials"]
    arguments += [str(output), str(session), str(folder / "saved"), str(model)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, cwd=ROOT, text=True) as window:
        assert window.stdout is not None
        told = json.loads(window.stdout.readline() or "{}")
        if not told:
            raise NotSoFar
        board = SharedStatus.attach(told["board"])
        with suppress(AttributeError, KeyError):  # it is the trial's, not ours, to remove
            resource_tracker.unregister(f"/{told['board'].lstrip('/')}", "shared_memory")

        def begun() -> bool:
            if board[Slot.RECORDED_RUNS] != whole:
                return False
            recording = board[Slot.RECORDING] > 0
            return not recording if moment == "between" else recording

        try:
            _wait(begun, window)
            time.sleep(seconds * share)
            before, done = read_output(output), board[Slot.RECORDED_RUNS]
            killed_ns = time.monotonic_ns()
            os.kill(told[victim], signal_of(how))
            _wait(lambda: read_output(output).zero)
            at = read_output(output)
            gone = _all_gone([told[name] for name in VICTIMS], window)
            after = read_output(output)
        finally:
            window.kill()
            board.close()
    stood = not before.zero
    cycles, clock = float(at.changed_at - before.cycles), (at.changed_ns - killed_ns) / 1e6
    plant = (clock if victim == "loop" else cycles) if stood else 0.0  # its cycles end with the loop
    said = _said_by_runs(session)
    zero = at.zero and after.zero
    return TrialKill(victim, moment, how, before.volts != 0.0, zero, plant, said, done, gone)


def rows_of_trials(kills: list[dict[str, Any]]) -> list[str]:
    """Rows of the page's table, by moment and victim."""
    told = []
    for moment in MOMENTS:
        for victim in VICTIMS:
            mine = [kill for kill in kills if (kill["moment"], kill["victim"]) == (moment, victim)]
            if not mine:
                continue
            plant = [kill["plant_ms"] for kill in mine if kill["driven"]]
            ms = f"{np.median(plant):.0f} | {max(plant):.0f}" if plant else "- | -"
            term, kill9 = (sum(kill["how"] == how for kill in mine) for how in ("SIGTERM", "SIGKILL"))
            lost = sum(
                len([end for end in kill["said"] if end != "truncated"]) < kill["whole"] for kill in mine
            )
            told.append(
                f"| {moment} | {victim} | {term} + {kill9} | {sum(kill['zero'] for kill in mine)} | "
                f"{len(plant)} | {ms} | {sum(ms_ > 50.0 for ms_ in plant)} | {lost} | "
                f"{sum(not kill['ended'] for kill in mine)} |"
            )
    return told


def _said_by_runs(session: Path) -> tuple[str, ...]:
    try:
        found = open_session(session)
    except UserError as error:  # killed before the first flush
        if "holds no samples" not in str(error):
            raise
        return ()
    assert not check_session(found).errors
    return tuple(str(run.attributes["ended"]) for run in found.runs)


def _wait(condition: Callable[[], bool], trial: subprocess.Popen[str] | None = None) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > end or (trial is not None and trial.poll() is not None):
            raise NotSoFar
        time.sleep(1e-3)


def _all_gone(pids: list[int], trial: subprocess.Popen[str]) -> bool:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        trial.poll()
        if not any(psutil.pid_exists(pid) for pid in pids):
            return True
        time.sleep(0.01)
    return False


def main(output: str, session: str, rescue: str, model: str) -> None:
    """A trial, without its terminal; a machine that is busy with other programs may be late."""
    rig = default_rig()
    settings = LoopSettings(BenchUnits.from_rig(rig), PATIENT)
    bench = ProcessBench(SharedChoice(Path(output), finger=True), settings, Path(rescue))
    told = TrialSettings(Path(model), json.dumps(WANTED), runs=2, variant=NOMINAL, rest_s=0.5)
    trial = ForceTrial(told, rig)
    bench.recorder.open(SessionInfo(Path(session), rig.to_json(), "fault test", "2026-11-01T09:00:00+01:00"))
    pids = {"window": os.getpid(), "loop": bench.loop_process.pid, "recorder": bench.recorder_process.pid}
    print(json.dumps({**pids, "board": bench.board.name}), flush=True)
    try:
        ProtocolDriver(bench, lambda _: None).take(trial.steps())
    except UserError as error:
        print(error, file=sys.stderr)
    bench.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
