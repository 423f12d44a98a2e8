"""Sessions of a linear axis, written as somebody's CSV and imported by the command."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.cli.calling import call

STROKE, FRICTION, LOAD, RATE, SECONDS = 10.0, 15.0, 5.0, 250.0, 12
"""mm, N, N, Hz and s: a stage goes 10 mm to and fro over a friction of 15 N, against a load of 5 N."""


def stage_session(folder: Path, name: str = "stage", more: float = 0.0, radius: float = 0.01) -> Path:
    """Runs of 0.5 and 1 Hz, whose command, position, force and load are in mm and N.

    Args:
        more: N, of force all along. radius: m, of the arc as which it is kept.
    """
    files, random = [], np.random.default_rng(3)
    time = np.arange(round(SECONDS * RATE)) / RATE
    for run, rate in enumerate((0.5, 1.0)):
        turn = 2.0 * np.pi * rate * time
        x, force = STROKE * np.sin(turn), FRICTION * np.sign(np.cos(turn + 0.01)) + more
        force = force + 0.05 * random.standard_normal(len(time))
        files.append(folder / f"{name}{run}.csv")
        table = np.stack((time, x, x, force, np.full(len(time), LOAD)), axis=1)
        header = "time (s),command (mm),position (mm),force (N),load (N)"
        np.savetxt(files[-1], table, "%.6f", ",", header=header, comments="")
    mapping = "time=1:s,motor_command=2:mm,motor_position=3:mm,motor_torque=4:N,load_torque=5:N"
    session = folder / f"{name}.h5"
    code, _, err = call("import", "--axis", *files, "--map", mapping, "--radius", radius, "--out", session)
    assert code == 0, err
    return session
