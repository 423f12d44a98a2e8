"""The run that would best separate the effects that these data leave closest.

Predicted separation: if the first effect were true, what would the second leave unexplained in the new run,
wherever its unknowns go, given what the old runs say of them? Each model predicts the equations of the new
run with the values that the old runs gave it; what the two predictions differ by, less what the second can
take up at a price that the old runs set, is whitened, and half its square in independent values is the
expected gain in log evidence (Hunter and Reiner, "Designs for discriminating between two rival models",
1965).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fingerlab.identify.diagnosis.bandwidth import EFFECTIVE_SHARE
from fingerlab.identify.diagnosis.evidence import LEAST_FALL, Evidence
from fingerlab.identify.diagnosis.features import Layout
from fingerlab.identify.diagnosis.fitting import feature_weights
from fingerlab.identify.diagnosis.imagined import (
    Press,
    bench_motion,
    finger_motion,
    pressing_motion,
    seen_press,
)
from fingerlab.identify.diagnosis.model import Choice, Model, build
from fingerlab.identify.diagnosis.reduction import Group, layout_of, narrow_columns
from fingerlab.identify.diagnosis.study import WANDER, Study, Trial, condition_weights
from fingerlab.identify.diagnosis.sums import Sums
from fingerlab.identify.diagnosis.unseen import DECIDING_LOG_ODDS, hidden_values
from fingerlab.physics.effects.base import Effect
from fingerlab.physics.effects.motion import Motion
from fingerlab.rig import Rig
from fingerlab.sessions.model import Array, Session

BENCH_LOADS_NM = (0.0, 0.05, 0.1)
"""Known loads that a motor bench is proposed with, N m; assumed."""
WEAK_PRIOR = 1e-4
LEAST_SEPARATION = 0.5
"""A run that is expected to bring less (nats) is not worth the operator's time."""
RIVALS = 4
"""So many effects of the set are separated from its first by one run; more are rarely left."""
EQUATIONS = 3  # of a finger's run
LOOK_ROUND = 3  # steps of a fit
DECISIVE = 10.0
"""A separation beyond this (nats) is worth no more: the effect is out of the set."""


@dataclass(frozen=True)
class Proposal:
    """A run from the menu: what the rig would be told, and the motion that the model expects."""

    phase: str
    cable: str
    trajectory: Mapping[str, Any]
    motion: Motion


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
    best: tuple[tuple[float, float], Proposal, Trial, float] | None = None
    for proposal in _menu(sessions, study, first):
        imagined = _imagine(sessions[0], proposal.motion, _held([first, *rivals], proposal.motion))
        gains = [_both_ways(study, imagined, first, rival, evidence.temperature) for rival in rivals]
        worth = (sum(min(g, DECISIVE) for g in gains), min(gains))
        if best is None or worth > best[0]:
            worst = int(np.argmin(gains))
            best = (worth, proposal, rivals[worst], gains[worst])
    if best is None or best[3] < LEAST_SEPARATION:
        return None
    _, proposal, rival, gain = best
    return {
        "trajectory": dict(proposal.trajectory),
        "phase": proposal.phase,
        "cable": proposal.cable,
        "separates": [t.model.choices[-1].effect.id for t in (first, rival)],
        "expected_separation": float(gain),
    }


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
    best: tuple[float, Proposal, list[float]] | None = None
    for proposal in _menu(sessions, study, base):
        imagined = _imagine(sessions[0], proposal.motion, _held([p for p, _ in pairs], proposal.motion))
        gains = [_shown(study, imagined, present, absent) for present, absent in pairs]
        worth = sum(s * min(g, DECISIVE) for s, g in zip(shares, gains, strict=True))
        if gains and (best is None or worth > best[0]):
            best = worth, proposal, gains
    if best is None:
        return None
    _, proposal, gains = best
    told = next((k for k, gain in enumerate(gains) if gain >= DECIDING_LOG_ODDS), None)
    if told is None:
        return None
    return {
        "trajectory": dict(proposal.trajectory),
        "phase": proposal.phase,
        "cable": proposal.cable,
        "separates": [pairs[told][0].model.choices[-1].effect.id, "nothing_missing"],
        "expected_separation": float(gains[told]),
    }


def _present_and_absent(study: Study, base: Trial, trial: Trial) -> tuple[Trial, Trial]:
    """The trial if its last effect were there at its typical strength and the rest hid it; and without it."""
    without = study.fit_like(base.model.choices, trial, LOOK_ROUND)
    known = dict(zip((u.key for u in without.model.unknowns), without.fit.values, strict=True))
    start = np.array([known.get(u.key, 0.0) for u in trial.model.unknowns])
    absent = replace(without, misfits=base.misfits)
    return replace(trial, fit=replace(trial.fit, values=hidden_values(trial, start))), absent


def _shown(study: Study, run: Imagined, truth: Trial, base: Trial) -> float:
    """Log odds that one more run brings for an effect; LEAST_FALL in the run's own condition decides."""
    gain = _separation(study, run, truth, base, 1.0)
    values = EFFECTIVE_SHARE * EQUATIONS * run.sums.samples
    counts = np.append(base.misfits[:, 1], values)
    needed = LEAST_FALL * float(counts.sum()) / float(condition_weights(counts)[-1])
    return gain * 2.0 * DECIDING_LOG_ODDS / max(needed, 2.0 * DECIDING_LOG_ODDS)


def _both_ways(study: Study, run: Imagined, first: Trial, second: Trial, heat: float) -> float:
    """The lesser gain, whichever of the two is true."""
    return min(
        _separation(study, run, first, second, heat),
        _separation(study, run, second, first, heat),
    )


def _wave(kind: str, frequency: float, amplitude: float, **more: float) -> dict[str, Any]:
    return {"kind": kind, "frequency_hz": frequency, "amplitude_deg": amplitude, **more}


FREE = (
    ("sine", 0.2, 1.0), ("sine", 0.5, 0.3), ("sine", 1.0, 0.25), ("sine", 2.0, 0.9), ("sine", 3.0, 0.5),
    ("chirp", 0.3, 0.8), ("steps", 0.4, 1.0), ("ramp_hold", 0.2, 1.0), ("multisine", 1.0, 1.0),
)  # fmt: skip
"""Kind, frequency (Hz) and share of the amplitude of the free runs on the menu."""
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
    """Runs that the rig can do: free ones on each known routing and pressing ones; or the motor alone.

    Runs of the motor alone are proposed beside their like only: with a finger's runs they are not compared.
    """
    rig = sessions[0].rig
    if study.reduced.on_bench:
        yield from _bench_menu(rig)
        return
    values = dict(zip((u.key for u in trial.model.unknowns), map(float, trial.fit.values), strict=True))
    signs = sorted({g.cable_sign for g in study.reduced.groups if g.cable_sign})
    for sign in signs:
        amplitude, offset = _room(sessions, sign)
        for kind, frequency, share in FREE:
            trajectory = _wave(kind, frequency, round(amplitude * share, 2), offset_deg=offset)
            motion = finger_motion(rig, sign, trajectory, values)
            if motion is not None:
                yield Proposal("on_air", {1: "flexion", -1: "extension"}[sign], trajectory, motion)
    press = seen_press(sessions)
    if press is not None and 1 in signs:
        yield from _pressing_menu(rig, press)


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


def _bench_menu(rig: Rig) -> Iterator[Proposal]:
    for load in BENCH_LOADS_NM:
        for kind, frequency, amplitude in BENCH:
            trajectory = _wave(kind, frequency, amplitude, offset_deg=amplitude + 5.0)
            loaded = {**trajectory, "load_torque": load} if load else trajectory
            yield Proposal("motor_bench", "none", loaded, bench_motion(rig, trajectory, load))


@dataclass(frozen=True)
class Imagined:
    """A run that was not taken: its motion, and the sums over the signals that it would give."""

    motion: Motion
    layout: Layout
    sums: Sums
    group: Group


def _imagine(session: Session, motion: Motion, effects: Sequence[Effect]) -> Imagined:
    layout = layout_of(motion, session, effects)
    low = narrow_columns(motion, effects, layout.signals)
    # A trace of friction may hold a standing finger anywhere: what is seen at rest decides little.
    columns = low.columns[~low.rest]
    return Imagined(motion, layout, Sums(columns.T @ columns, taut_samples=len(columns)), _group(motion))


def _separation(study: Study, run: Imagined, truth: Trial, rival: Trial, heat: float) -> float:
    """Expected gain in log evidence of ``truth`` over ``rival`` from one more run."""
    right = build(run.layout, [run.group], _choices(truth, run), truth.model.tip_law)
    wrong = build(run.layout, [run.group], _choices(rival, run), rival.model.tip_law)
    told, slopes = wrong.coefficients(_values(wrong, rival), run.group)
    wander = _wander(wrong, told)
    slopes = np.concatenate((slopes, wander), axis=1)
    every = np.union1d(right.active, wrong.active)
    gap, reach = np.zeros(len(every)), np.zeros((len(every), slopes.shape[1]))
    gap[np.searchsorted(every, right.active)] = right.features(_values(right, truth), run.group)
    gap[np.searchsorted(every, wrong.active)] -= told
    reach[np.searchsorted(every, wrong.active)] = slopes
    pick = run.layout.every[every]
    share = EFFECTIVE_SHARE / heat
    products = run.sums.of(pick) * feature_weights(_weights(study, run.motion), pick.rows) * share
    pull = gap @ products @ reach
    known = reach.T @ products @ reach
    old = len(wrong.unknowns)
    known[:old, :old] += _known(wrong, rival, heat)
    known[old:, old:] += np.eye(wander.shape[1]) / WANDER**2
    scale = 1.0 / np.sqrt(np.maximum(np.diag(known), 1e-300))
    system = known * np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
    taken = float((pull * scale) @ np.linalg.solve(system, pull * scale))
    return 0.5 * (float(gap @ products @ gap) - taken)


def _wander(model: Model, told: Array) -> Array:
    """What a run's own friction may add to the features, (k, gains): as it differs from run to run."""
    owners = [model.layout.features[i] for i in model.active]
    gains = [(c.effect.id, name) for c in model.choices if c.effect.wanders for name in c.effect.gains]
    parts = [np.where([(f.owner, f.parameter) == gain for f in owners], told, 0.0) for gain in gains]
    return np.stack(parts, axis=1) if parts else np.zeros((len(told), 0))


def _held(trials: Sequence[Trial], motion: Motion) -> list[Effect]:
    """Effects of all the models, each once, that act in such a run."""
    every = {c.effect.id: c.effect for t in trials for c in t.model.choices}
    return [e for e in every.values() if e.bench or motion.finger is not None]


def _choices(trial: Trial, run: Imagined) -> list[Choice]:
    return [c for c in trial.model.choices if c.effect in run.layout.effects]


def _group(motion: Motion) -> Group:
    kind = "contact" if motion.phase == "contact" else "free"
    cable = {1: "flexion", -1: "extension", 0: "none"}[motion.cable_sign]
    return Group((cable, kind), motion.cable_sign, [], np.zeros((0, 0)))


def _weights(study: Study, motion: Motion) -> Array:
    """Weights of the group that the run would belong to, or of the most similar one there is."""
    key = _group(motion).key
    same_kind = [w for k, w in study.weights.items() if k[1] == key[1]]
    return study.weights.get(key, (same_kind or list(study.weights.values()))[0])


def _values(model: Model, trial: Trial) -> Array:
    """The trial's values for a model of another run; what it does not know starts at nothing."""
    known = dict(zip((u.key for u in trial.model.unknowns), trial.fit.values, strict=True))
    return np.array([known.get(u.key, start) for u, start in zip(model.unknowns, model.start(), strict=True)])


def _known(model: Model, trial: Trial, heat: float) -> Array:
    """What the old runs say of the rival's unknowns, (p, p); little of those that they do not have."""
    old = {u.key: i for i, u in enumerate(trial.model.unknowns)}
    size = len(model.unknowns)
    result = np.zeros((size, size))
    places = [(i, old[u.key]) for i, u in enumerate(model.unknowns) if u.key in old]
    mine, theirs = [p[0] for p in places], [p[1] for p in places]
    # Unknowns of the old runs that the new one lacks are integrated out, not held.
    if mine:
        covariance = trial.fit.covariance[np.ix_(theirs, theirs)] * heat
        scale = 1.0 / np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        scaled = np.linalg.pinv(covariance * np.outer(scale, scale), hermitian=True)
        result[np.ix_(mine, mine)] = scaled * np.outer(scale, scale)
    for i, unknown in enumerate(model.unknowns):
        if unknown.key not in old:
            result[i, i] = WEAK_PRIOR / unknown.gain.typical**2
    return result
