"""The run, of those that the rig can do, that would best separate the effects that these data leave closest.

What a run is expected to bring is told in the log odds that the diagnosis itself would give after it: for the
effects of a set among each other, or for an effect that could not be seen against nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fingerlab.diagnosis.bandwidth import EFFECTIVE_SHARE
from fingerlab.diagnosis.evidence import Evidence, against_nothing
from fingerlab.diagnosis.imagined import (
    DURATION_S,
    Press,
    bench_motion,
    finger_motion,
    pressing_motion,
    seen_press,
)
from fingerlab.diagnosis.odds import LEAST_EXCESS, by_what_is_left, left_for, small_excess
from fingerlab.diagnosis.reach import hidden_values
from fingerlab.diagnosis.separation import Imagined, apart, held_by, imagine, separation
from fingerlab.diagnosis.steps import DECIDING_LOG_ODDS, LEAST_FALL
from fingerlab.diagnosis.stretches import SETTLING_S
from fingerlab.diagnosis.study import Study
from fingerlab.diagnosis.trial import Trial, condition_weights
from fingerlab.effects.motion import Motion
from fingerlab.rig.constants import Rig
from fingerlab.sessions.model import Session

BENCH_LOADS_NM = (0.0, 0.05, 0.1)
"""Known loads that a motor bench is proposed with, N m; assumed."""
LEAST_SEPARATION = 0.2
"""A run that is expected to bring less (nats) is not worth the operator's time."""
RIVALS = 4
"""So many effects of the set are separated from its first by one run; more are rarely left."""
LOOK_ROUND = 3  # steps of a fit
DECISIVE = 10.0
"""A separation beyond this (nats) is worth no more: the effect is out of the set."""


LENGTHS_S = (DURATION_S, 60.0)
"""Lengths of a run, s; the longer one is proposed where the shorter would not decide. Assumed: an operator
spends a minute on a question rather than come back with half an answer."""


@dataclass(frozen=True)
class Proposal:
    """A run from the menu: what the rig would be told, and the motion that the model expects.

    ``motion`` lasts ``DURATION_S``, the run ``seconds``.
    """

    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    motion: Motion
    seconds: float = DURATION_S

    def told(self, separates: list[str], expected: float) -> dict[str, Any]:
        """The proposal as in ``cli.md``, with the two answers that it separates and by how much."""
        return {
            "trajectory": {**self.trajectory, "duration_s": self.seconds},
            "phase": self.phase,
            "cable": self.cable,
            "separates": separates,
            "expected_separation": float(expected),
        }


def propose(
    sessions: Sequence[Session], study: Study, evidence: Evidence, chosen: Sequence[int]
) -> dict[str, Any] | None:
    """The proposed run as in ``cli.md``; None where nothing needs to be separated or nothing would.

    The run that takes most of the set away from its first member is proposed; it is said for the rival that
    comes off worst.
    """
    if len(chosen) < 2:
        return None
    first, *rivals = [evidence.trials[i] for i in chosen[: 1 + RIVALS]]
    menu = list(_runs(sessions, study, first, [first, *rivals]))
    best: tuple[tuple[float, float], Proposal, Trial, float] | None = None
    for seconds in LENGTHS_S:
        for proposal, run in _lasting(menu, seconds):
            gains = [_expected(study, run, evidence, chosen[0], i) for i in chosen[1 : 1 + RIVALS]]
            worth = (sum(min(g, DECISIVE) for g in gains), min(gains))
            if best is None or worth > best[0]:
                worst = int(np.argmin(gains))
                best = (worth, proposal, rivals[worst], gains[worst])
        if best is not None and best[3] >= DECISIVE:
            break
    if best is None or best[3] < LEAST_SEPARATION:
        return None
    _, proposal, rival, gain = best
    return proposal.told([t.model.choices[-1].effect.id for t in (first, rival)], gain)


def reveal(
    sessions: Sequence[Session], study: Study, evidence: Evidence, unseen: Sequence[int]
) -> dict[str, Any] | None:
    """The run that would show most of the effects that these data could not; None where none would.

    What is expected is told for the likeliest effect that the run would show at its typical strength.
    """
    base = evidence.base
    unseen = [i for i in unseen if evidence.trials[i].reach.strengths][:RIVALS]
    shares = [evidence.unseen[i] for i in unseen]
    pairs = [_present_and_absent(study, base, evidence.trials[i]) for i in unseen]
    menu = list(_runs(sessions, study, base, [p for p, _ in pairs]))
    best: tuple[float, Proposal, list[Shown]] | None = None
    for seconds in LENGTHS_S:
        for proposal, run in _lasting(menu, seconds):
            gains = [_shown(study, run, evidence, i, *pair) for i, pair in zip(unseen, pairs, strict=True)]
            worth = sum(s * min(g.decides, DECISIVE) for s, g in zip(shares, gains, strict=True))
            if gains and (best is None or worth > best[0]):
                best = worth, proposal, gains
        if best is not None and min(g.decides for g in best[2]) >= DECISIVE:
            break
    if best is None:
        return None
    _, proposal, gains = best
    told = next((k for k, gain in enumerate(gains) if gain.decides >= DECIDING_LOG_ODDS), None)
    if told is None:
        return None
    shown = pairs[told][0].model.choices[-1].effect.id
    return proposal.told([shown, "nothing_missing"], gains[told].expected)


def _present_and_absent(study: Study, base: Trial, trial: Trial) -> tuple[Trial, Trial]:
    """The trial if its last effect were there at its typical strength and the rest hid it; and without it."""
    without = study.fit_like(base.model.choices, trial, LOOK_ROUND)
    known = dict(zip((u.key for u in without.model.unknowns), without.fit.values, strict=True))
    start = np.array([known.get(u.key, 0.0) for u in trial.model.unknowns])
    absent = replace(without, misfits=base.misfits)
    return replace(trial, fit=replace(trial.fit, values=hidden_values(trial, start))), absent


@dataclass(frozen=True)
class Shown:
    """What a run would say of an effect that could not be seen, if it were there.

    Attributes:
        decides: on the scale on which ``DECIDING_LOG_ODDS`` is where the verdict changes.
        expected: gain in the log odds against nothing.
    """

    decides: float
    expected: float


def _shown(study: Study, run: Imagined, evidence: Evidence, i: int, truth: Trial, without: Trial) -> Shown:
    """What the run would bring for trial ``i``; LEAST_FALL in the run's own condition decides."""
    base = evidence.base
    gain = separation(study, run, truth, without, 1.0)
    values = _values(run)
    counts = np.append(base.misfits[:, 1], values)
    needed = LEAST_FALL * float(counts.sum()) / float(condition_weights(counts)[-1])
    decides = gain * 2.0 * DECIDING_LOG_ODDS / max(needed, 2.0 * DECIDING_LOG_ODDS)
    usual, count = base.misfit / base.count, float(counts.sum())
    left = count * _after(base, run, usual, usual * values)
    misfit = count * _after(base, run, usual, usual * values + 2.0 * gain)
    after = against_nothing(base, misfit, left, count) - np.log(len(evidence.trials))
    before = np.log(max(float(evidence.unseen[i]), LEAST_SHARE) / max(evidence.nothing, LEAST_SHARE))
    return Shown(decides, float(after - before))


LEAST_SHARE = 1e-12
"""Probabilities are compared down to here."""


def _values(run: Imagined) -> float:
    """Independent values that a run would have."""
    return EFFECTIVE_SHARE * run.group.equations * run.sums.samples


def _after(like: Trial, run: Imagined, left: float, misfit: float) -> float:
    """What a model leaves of each value with one more run, of which it leaves ``misfit``.

    Now it leaves ``left`` of each, in conditions as ``like`` has them.
    """
    counts = np.append(like.misfits[:, 1], _values(run))
    misfits = np.append(left * like.misfits[:, 1], misfit)
    return float(misfits @ condition_weights(counts) / counts.sum())


def _expected(study: Study, run: Imagined, evidence: Evidence, first: int, second: int) -> float:
    """Expected gain in the log odds of the one of two effects that is true, as likely as they are now."""
    shares = evidence.probabilities[[first, second]]
    gains = [_gain(study, run, evidence, *ways) for ways in ((first, second), (second, first))]
    return float(shares @ gains / max(float(shares.sum()), LEAST_SHARE))


def _gain(study: Study, run: Imagined, evidence: Evidence, true: int, other: int) -> float:
    """Gain in the log odds of the true effect: by what its rival leaves, and by the constants it needs."""
    truth, rival = evidence.trials[true], evidence.trials[other]
    alone = run.group.on_bench and not any(g.on_bench for g in study.reduced.groups)
    found = apart(study, run, _with_offsets(truth) if alone else truth, rival, evidence.temperature)
    odds = evidence.log_odds[[true, other]]
    left = [left_for(float(one), evidence.least_left) for one in odds - odds.max()]
    usual = _values(run) * left[0]
    after = [
        _after(truth, run, left[0], usual),
        _after(truth, run, left[1], usual + found.left * evidence.temperature),
    ]
    gain = by_what_is_left(np.array(after)) - by_what_is_left(np.array(left))
    return float(gain[0] - gain[1]) + (0.5 * found.zero + _constants(study, truth, rival) if alone else 0.0)


def _constants(study: Study, truth: Trial, rival: Trial) -> float:
    """Log odds that a first run of the motor alone brings by what the constants are known to be then."""
    gain = 0.5 * (study.narrowed(rival) - study.narrowed(truth))
    if rival.model.choices[-1].effect.offsets and not truth.model.choices[-1].effect.offsets:
        gain += small_excess(rival, study.zero_spread) - small_excess(rival)
    return gain + (small_excess(truth) if truth.model.choices[-1].effect.offsets else 0.0)


def _with_offsets(trial: Trial) -> Trial:
    """The trial with the constants of its last effect, which no run has told, as large as they may well be.

    If the effect is there, they are at least what one would speak of.
    """
    effect, index = trial.model.choices[-1].effect, trial.model.index
    values = trial.fit.values.copy()
    for name in effect.offsets:
        place, under = index[f"{effect.id}.{name}"], index[f"{effect.id}.{effect.excess[name]}"]
        size = np.hypot(values[place], trial.fit.deviations[place])
        size = np.clip(size, LEAST_EXCESS * values[under], values[under])
        values[place] = np.copysign(size, values[place])
    return replace(trial, fit=replace(trial.fit, values=values))


def _runs(
    sessions: Sequence[Session], study: Study, like: Trial, trials: Sequence[Trial]
) -> Iterator[tuple[Proposal, Imagined]]:
    """Every run of the menu, as the model ``like`` would move, with the columns of all ``trials``."""
    for proposal in _menu(sessions, study, like):
        motion = proposal.motion
        yield (
            proposal,
            imagine(sessions[0], motion, held_by(trials, motion), not study.reduced.on_bench),
        )


def _lasting(
    menu: Sequence[tuple[Proposal, Imagined]], seconds: float
) -> Iterator[tuple[Proposal, Imagined]]:
    times = (seconds - SETTLING_S) / (DURATION_S - SETTLING_S)
    for proposal, run in menu:
        yield replace(proposal, seconds=seconds), run.lasting(times)


def _wave(kind: str, frequency: float, amplitude: float, **more: float) -> dict[str, Any]:
    return {"kind": kind, "frequency_hz": frequency, "amplitude_deg": amplitude, **more}


FREE = (
    ("sine", 0.2, 1.0, 0.0), ("sine", 0.5, 0.3, 0.0), ("sine", 1.0, 0.25, 0.0), ("sine", 2.0, 0.9, 0.0),
    ("sine", 3.0, 0.5, 0.0), ("chirp", 0.3, 0.8, 0.0), ("steps", 0.4, 1.0, 0.0), ("ramp_hold", 0.2, 1.0, 0.0),
    ("multisine", 1.0, 1.0, 0.0), ("sine", 0.5, 0.5, -0.5), ("sine", 0.5, 0.5, 0.5),
)  # fmt: skip
"""Kind, frequency (Hz), share of the amplitude and shift of the offset (in amplitudes) of the free runs on
the menu. All stay within the angles that were recorded: what the rig did once it can do again."""
FREE_ROOM = {-1: (14.0, 22.0), 1: (9.0, 15.0)}
"""Amplitude and offset of free runs, degrees at the pulley, by cable, where none were recorded: those of the
rich protocol."""
PRESSED = (
    ("sine", 0.25, 1.0),
    ("sine", 1.0, 0.5),
    ("sine", 2.5, 0.8),
    ("steps", 0.5, 1.0),
    ("chirp", 0.3, 0.8),
)
"""The same for pressing runs; the amplitude is a share of the one that was recorded."""


BENCH = (("sine", 0.5, 30.0), ("sine", 2.0, 20.0), ("ramp_hold", 0.2, 60.0))
"""The motor alone: kind, frequency (Hz), amplitude (degrees at the pulley)."""


def _menu(sessions: Sequence[Session], study: Study, trial: Trial) -> Iterator[Proposal]:
    """Runs that the rig can do: free ones on each known routing, pressing ones, and the motor alone.

    Beside a finger's runs a bench needs no known load: one is only proposed where there is nothing else.
    """
    rig = sessions[0].rig
    if study.reduced.on_bench:
        yield from _bench_menu(rig, BENCH_LOADS_NM)
        return
    values = dict(zip((u.key for u in trial.model.unknowns), map(float, trial.fit.values), strict=True))
    signs = sorted({g.cable_sign for g in study.reduced.groups if g.cable_sign})
    for sign in signs:
        amplitude, offset = _room(sessions, sign)
        for kind, frequency, share, shift in FREE:
            about = round(offset + amplitude * shift, 2)
            trajectory = _wave(kind, frequency, round(amplitude * share, 2), offset_deg=about)
            motion = finger_motion(rig, sign, trajectory, values)
            if motion is not None:
                yield Proposal("on_air", {1: "flexion", -1: "extension"}[sign], trajectory, motion)
    press = seen_press(sessions)
    if press is not None and 1 in signs:
        yield from _pressing_menu(rig, press)
    # Last: taking the finger off its cable is worth it only where no run with it tells as much.
    yield from _bench_menu(rig, BENCH_LOADS_NM[:1])


def _room(sessions: Sequence[Session], sign: int) -> tuple[float, float]:
    """Amplitude and offset, degrees at the pulley, of the widest free run on a cable."""
    seen = [
        (float(amplitude), float(run.trajectory.get("offset_deg", 0.0)))
        for session in sessions
        for run in session.runs
        if run.cable_sign == sign and run.phase == "on_air"
        and isinstance(amplitude := run.trajectory.get("amplitude_deg"), int | float)
    ]  # fmt: skip
    return max(seen, default=FREE_ROOM[sign])


def _pressing_menu(rig: Rig, press: Press) -> Iterator[Proposal]:
    for kind, frequency, share in PRESSED:
        trajectory = _wave(kind, frequency, round(share * press.commanded_deg, 2))
        motion = pressing_motion(rig, 1, trajectory, press)
        if motion is not None:
            yield Proposal("contact", "flexion", trajectory, motion)


def _bench_menu(rig: Rig, loads: Sequence[float]) -> Iterator[Proposal]:
    for load in loads:
        for kind, frequency, amplitude in BENCH:
            trajectory = _wave(kind, frequency, amplitude, offset_deg=amplitude + 5.0)
            loaded = {**trajectory, "load_torque": load} if load else trajectory
            yield Proposal("motor_bench", "none", loaded, bench_motion(rig, trajectory, load))
