"""Stands for the window in fault tests: opens a bench, lets it run, records, and shows that it is alive.

``python -m tests.faults.window OUTPUT SESSION RESCUE [LATE [MOTION [CARD]]]`` prints one line of JSON when it
records. LATE is the lateness in s at which the loop stops by itself, CARD the address of a virtual card in
place of the bench whose output stands in the file OUTPUT. MOTION is what the motor is told: ``angle``, or
``torque`` as a wanted force needs it.
"""

from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

from fingerlab.acquisition.bench.process_bench import ProcessBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Enable, Initialise, SetUp, Start
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.recording import RunInfo, SessionInfo
from fingerlab.core.errors import UserError
from fingerlab.devices.choosing import choose_device
from fingerlab.rig.file import default_rig
from fingerlab.rig.limits import Limits
from tests.faults.shared_device import SharedChoice

SINE = {"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0, "offset_deg": 22.0, "ramp_s": 0.5}

PULL = {
    "kind": "torque", "time_s": [0.0, 0.5, 30.0], "torque_n_m": [0.0, 0.05, 0.05], "ramp_s": 0.0,
    "most_force_n": 3.3, "most_position_deg": 90.0,
}  # fmt: skip
MOTIONS = {"angle": SINE, "torque": PULL}

# A machine that is busy with other tests is late; lateness has tests of its own, on a virtual clock.
PATIENT = Limits(late_time=30.0, late_cycles=1e9, window_time=20.0, recorder_time=20.0)


def main(
    output: str, session: str, rescue: str, late: str = "30", motion: str = "angle", card: str = ""
) -> None:
    rig = default_rig()
    settings = LoopSettings(BenchUnits.from_rig(rig), replace(PATIENT, late_time=float(late)))
    choice = choose_device(f"{card}/Dev1") if card else SharedChoice(Path(output))
    bench = ProcessBench(choice, settings, Path(rescue))
    bench.recorder.open(SessionInfo(Path(session), rig.to_json(), "fault test", "2026-11-01T09:00:00+01:00"))
    for command in (SetUp("on_air", "extension"), Initialise(), Enable(), Start(MOTIONS[motion], True)):
        bench.ask(command)
    start = bench.status().run_start
    bench.recorder.begin(RunInfo("on_air", "extension", 1000.0, MOTIONS[motion], start))
    told = {
        "window": os.getpid(),
        "loop": bench.loop_process.pid,
        "recorder": bench.recorder_process.pid,
        "ring": bench.ring.name,
        "board": bench.board.name,
        "start": start,
    }
    print(json.dumps(told), flush=True)
    try:
        while not (status := bench.status()).recorder and not status.loop_ended:
            bench.idle()
        print(status.recorder or status.fault, file=sys.stderr)
    except UserError as error:
        print(error, file=sys.stderr)
    bench.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
