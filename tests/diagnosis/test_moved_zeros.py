"""Zeros of the angles that move from run to run, beside a law of the joints that is no straight line.

The bench is integrated from equations written out apart from the project's (``closed_form``); the zeros that
are put into the readings are known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.sessions.model import Run, Session

from . import closed_form as made

LINES: tuple[made.Line, ...] = (
    (-1, 4.0, ((2.0, 1.0, 0.0),)),
    (-1, 4.0, ((2.0, 0.5, 1.0),)),
    (1, 3.0, ((1.5, 1.0, 0.0),)),
)
TIMES, ZEROS_DEG = 3, 0.4
ANGLES = ("mcp_angle", "pip_angle")


def moved(bench: made.Bench) -> tuple[Session, np.ndarray]:
    """Each motion so many times, the zeros of the angles others in every run; these, rad, (runs, 2)."""
    rng = np.random.default_rng(11)
    zeros = np.radians(ZEROS_DEG) * rng.standard_normal((len(LINES) * TIMES, len(ANGLES)))
    runs = []
    for line in LINES:
        for _ in range(TIMES):
            run = made.free_run(bench, line, rng, 8.0, len(runs))
            channels = run.load()
            for name, zero in zip(ANGLES, zeros[len(runs)], strict=True):
                channels[name] = channels[name] + zero
            told = {**run.trajectory, "amplitude_deg": 10.0 * line[2][0][0]}
            names = {"name": run.name, "phase": run.phase, "cable": run.cable}
            runs.append(Run.from_arrays(channels, **names, sample_rate_hz=made.RATE, trajectory=told))
    return replace(made.session(bench, contact=0), runs=tuple(runs)), zeros


@pytest.mark.parametrize(("missing", "effect"), [
    (made.Missing(stop=(-0.25, 1.0)), "joint_stop"),  # at its end eight times as stiff as the spring
    (made.Missing(cubic=(0.0, 0.5)), "spring_hardening"),
])  # fmt: skip
def test_a_law_is_found_and_so_are_the_zeros(missing: made.Missing, effect: str) -> None:
    """Integrated out as constants they left the stop at 16 floors, and springs that harden were an arm."""
    session, zeros = moved(made.Bench(missing=missing))
    said = diagnose([session], with_curves=False)
    assert said.final_model == (effect,)
    assert said.path[-1].score < 1.2  # the mean of all zeros is not known, and a cubic law bends by it
    off = np.array([
        [said.run_zeros[str(session.path), run.name][name].zero for name in ANGLES] for run in session.runs
    ])  # fmt: skip
    # What all runs of a motion have in common may be a spring's rest as well.
    between = (off - zeros).reshape(len(LINES), TIMES, len(ANGLES))
    between = between - between.mean(axis=1, keepdims=True)
    assert np.degrees(np.abs(between)).max() < 0.05
    told = {one.channel: one.size for one in said.bench if one.kind == "moving_zero"}
    apart = zeros.reshape(between.shape) - zeros.reshape(between.shape).mean(axis=1, keepdims=True)
    scatter = np.sqrt(np.sum(apart**2, axis=(0, 1)) / (len(zeros) - len(LINES)))
    assert told == {name: pytest.approx(size, rel=0.1) for name, size in zip(ANGLES, scatter, strict=True)}


UNLIKE: tuple[made.Line, ...] = (
    (-1, 4.0, ((2.0, 1.0, 0.0),)),
    (-1, 4.0, ((0.7, 0.4, 0.1), (0.6, 0.9, 1.3), (0.5, 1.5, 2.2), (0.5, 2.3, 3.0))),
    (-1, 3.0, ((1.5, 0.5, 0.3), (0.8, 1.7, 0.1))),
)


@pytest.mark.parametrize(("missing", "seed", "path"), [
    (made.Missing(), 11, [None]),
    (made.Missing(), 15, [None]),
    (made.Missing(viscous=(4e-3, 2e-3)), 11, [None, "viscous_friction"]),
])  # fmt: skip
def test_zeros_of_runs_that_are_all_unlike_are_no_effect(
    missing: made.Missing, seed: int, path: list[str | None]
) -> None:
    """Creep, with 93 % on a plain bench: through a weight a zero is no constant, and creep mends the rest."""
    bench, rng = made.Bench(missing=missing), np.random.default_rng(seed)
    zeros = np.radians(ZEROS_DEG) * rng.standard_normal((len(UNLIKE), len(ANGLES)))
    runs = []
    for number, line in enumerate(UNLIKE):
        run = made.free_run(bench, line, rng, 10.0, number)
        channels = run.load()
        for name, zero in zip(ANGLES, zeros[number], strict=True):
            channels[name] = channels[name] + zero
        told = {"name": run.name, "phase": run.phase, "cable": run.cable, "trajectory": run.trajectory}
        runs.append(Run.from_arrays(channels, **told, sample_rate_hz=made.RATE))
    session = replace(made.session(bench, contact=0), runs=tuple(runs))
    said = diagnose([session], with_curves=False)
    assert [step.added for step in said.path] == path
    assert said.path[-1].score < 1.06
    assert {one.channel for one in said.bench if one.kind == "moving_zero"} == set(ANGLES)
