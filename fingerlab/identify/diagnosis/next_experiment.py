"""The run that would best separate the two effects that these data leave closest.

Predicted separation: if the first effect were true, what would the second leave unexplained in the new run,
whatever its unknowns, given what the old runs say of them? Half that, whitened and in independent values, is
the expected gain in log evidence (Hunter and Reiner, "Designs for discriminating between two rival models",
1965).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fingerlab.identify.diagnosis.bandwidth import EFFECTIVE_SHARE
from fingerlab.identify.diagnosis.evidence import Evidence
from fingerlab.identify.diagnosis.features import Layout
from fingerlab.identify.diagnosis.fitting import feature_weights
from fingerlab.identify.diagnosis.imagined import bench_motion, finger_motion
from fingerlab.identify.diagnosis.model import Choice, Model, build
from fingerlab.identify.diagnosis.reduction import Group, layout_of, narrow_columns
from fingerlab.identify.diagnosis.study import Study, Trial
from fingerlab.identify.diagnosis.sums import Pick, Sums
from fingerlab.physics.effects.base import Effect, Row
from fingerlab.physics.effects.motion import Motion
from fingerlab.rig import Rig
from fingerlab.sessions.model import Array, Session

BENCH_LOAD_NM = 0.1
WEAK_PRIOR = 1e-4


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
    """The proposed run as in ``cli.md``; None where nothing needs to be separated or nothing would."""
    if len(chosen) < 2:
        return None
    first, second = evidence.trials[chosen[0]], evidence.trials[chosen[1]]
    best: tuple[float, Proposal] | None = None
    for proposal in _menu(sessions[0].rig, study, first):
        imagined = _imagine(sessions[0], proposal.motion, _held(first, second, proposal.motion))
        gains = [
            _separation(study, imagined, truth, rival, evidence.temperature)
            for truth, rival in ((first, second), (second, first))
        ]
        # On the bench, one of the two may not act at all: what the other shows there is the separation.
        gain = max(gains) if proposal.phase == "motor_bench" else min(gains)
        if best is None or gain > best[0]:
            best = (gain, proposal)
    if best is None or best[0] <= 0:
        return None
    gain, proposal = best
    return {
        "trajectory": dict(proposal.trajectory),
        "phase": proposal.phase,
        "cable": proposal.cable,
        "separates": [t.model.choices[-1].effect.id for t in (first, second)],
        "expected_separation": float(gain),
    }


def _menu(rig: Rig, study: Study, trial: Trial) -> Iterator[Proposal]:
    """Runs that the rig can do: free ones on each known routing, pressing ones, and the motor alone."""
    values = dict(zip((u.key for u in trial.model.unknowns), map(float, trial.fit.values), strict=True))
    free = [
        {"kind": "sine", "frequency_hz": 0.2, "amplitude_deg": 12.0, "offset_deg": 20.0},
        {"kind": "sine", "frequency_hz": 2.0, "amplitude_deg": 12.0, "offset_deg": 22.0},
        {"kind": "sine", "frequency_hz": 1.0, "amplitude_deg": 3.0, "offset_deg": 22.0},
        {
            "kind": "chirp",
            "frequency_hz": 0.3,
            "end_frequency_hz": 4.0,
            "amplitude_deg": 10.0,
            "offset_deg": 22.0,
        },
        {"kind": "steps", "frequency_hz": 0.4, "amplitude_deg": 14.0, "offset_deg": 22.0},
        {"kind": "multisine", "frequency_hz": 1.0, "amplitude_deg": 13.0, "offset_deg": 22.0},
    ]
    signs = sorted({g.cable_sign for g in study.reduced.groups if g.cable_sign})
    for sign in signs:
        for trajectory in free:
            motion = finger_motion(rig, sign, trajectory, values, None)
            if motion is not None:
                yield Proposal("on_air", {1: "flexion", -1: "extension"}[sign], trajectory, motion)
    if 1 in signs:
        for trajectory in (
            {"kind": "sine", "frequency_hz": 0.5, "amplitude_deg": 2.0, "offset_deg": 24.0},
            {"kind": "steps", "frequency_hz": 0.5, "amplitude_deg": 2.0, "offset_deg": 24.0},
        ):
            motion = finger_motion(rig, 1, trajectory, values, np.radians(20.0))
            if motion is not None:
                yield Proposal("contact", "flexion", trajectory, motion)
    for trajectory in ({"kind": "sine", "frequency_hz": 0.5, "amplitude_deg": 30.0, "offset_deg": 30.0},):
        loaded = {**trajectory, "load_torque": BENCH_LOAD_NM}
        yield Proposal("motor_bench", "none", loaded, bench_motion(rig, trajectory, BENCH_LOAD_NM))


@dataclass(frozen=True)
class Imagined:
    """A run that was not taken: its motion, and the sums over the signals that it would give."""

    motion: Motion
    layout: Layout
    sums: Sums
    group: Group


def _imagine(session: Session, motion: Motion, effects: Sequence[Effect]) -> Imagined:
    layout = layout_of(motion, session, effects)
    columns = narrow_columns(motion, effects, layout.signals).columns
    return Imagined(motion, layout, Sums(columns.T @ columns), _group(motion))


def _separation(study: Study, run: Imagined, truth: Trial, rival: Trial, heat: float) -> float:
    """Expected gain in log evidence of ``truth`` over ``rival`` from one more run."""
    weights = _weights(study, run.motion)
    added, missing = _added(build(run.layout, [run.group], _choices(truth, run)), truth, run)
    model = build(run.layout, [run.group], _choices(rival, run))
    _, slopes = model.coefficients(_values(model, rival), run.group)
    share = EFFECTIVE_SHARE / heat
    product = slopes.T @ (run.sums.of(model.pick) * feature_weights(weights, model.rows)) @ slopes * share
    pull = run.sums.across(missing[None], added, weights, model.pick)[0] @ slopes * share
    whole = float(missing @ (run.sums.of(added) * feature_weights(weights, added.rows)) @ missing) * share
    known = _known(model, rival, heat)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(product + known), 1e-300))
    system = (product + known) * np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
    return 0.5 * (whole - float((pull * scale) @ np.linalg.solve(system, pull * scale)))


def _held(truth: Trial, rival: Trial, motion: Motion) -> list[Effect]:
    """Effects of both models, each once, that act in such a run."""
    both = {c.effect.id: c.effect for c in (*truth.model.choices, *rival.model.choices)}
    return [e for e in both.values() if e.bench or motion.finger is not None]


def _choices(trial: Trial, run: Imagined) -> list[Choice]:
    return [c for c in trial.model.choices if c.effect in run.layout.effects]


def _group(motion: Motion) -> Group:
    kind = "contact" if motion.phase == "contact" else "free"
    cable = {1: "flexion", -1: "extension", 0: "none"}[motion.cable_sign]
    return Group((cable, kind), motion.cable_sign, [], np.zeros((0, 0)))


def _weights(study: Study, motion: Motion) -> Array:
    """Weights of the group that the run would belong to, or of the most similar one there is."""
    tension = [w for k, w in study.weights.items() if motion.cable_sign == 0 or k[0] != "none"]
    if motion.cable_sign != 0:
        same = study.weights.get(_group(motion).key)
        return same if same is not None else tension[0]
    result = np.zeros((5, 5))
    spread = np.linalg.inv(tension[0][:1, :1])[0, 0] if tension[0][0, 0] > 0 else 1e-6
    result[Row.BENCH, Row.BENCH] = tension[0][3, 3] or 1.0 / (spread * study.reduced.radius**2)
    return result


def _values(model: Model, trial: Trial) -> Array:
    """The trial's values for a model of another run; what it does not know starts at nothing."""
    known = dict(zip((u.key for u in trial.model.unknowns), trial.fit.values, strict=True))
    return np.array([known.get(u.key, start) for u, start in zip(model.unknowns, model.start(), strict=True)])


def _added(model: Model, trial: Trial, run: Imagined) -> tuple[Pick, Array]:
    """What the trial's last effect adds to the equations: its features, and their coefficients, (k,)."""
    owner = trial.model.choices[-1].effect.id
    theirs = np.flatnonzero([model.layout.features[i].owner == owner for i in model.active])
    return model.pick[theirs], model.features(_values(model, trial), run.group)[theirs]


def _known(model: Model, trial: Trial, heat: float) -> Array:
    """What the old runs say of the rival's unknowns, (p, p); little of those that they do not have."""
    old = {u.key: i for i, u in enumerate(trial.model.unknowns)}
    size = len(model.unknowns)
    result = np.zeros((size, size))
    places = [(i, old[u.key]) for i, u in enumerate(model.unknowns) if u.key in old]
    mine, theirs = [p[0] for p in places], [p[1] for p in places]
    # Unknowns of the old runs that the new one lacks are integrated out, not held.
    covariance = np.linalg.pinv(trial.fit.information / heat, hermitian=True)
    if mine:
        result[np.ix_(mine, mine)] = np.linalg.pinv(covariance[np.ix_(theirs, theirs)], hermitian=True)
    for i, unknown in enumerate(model.unknowns):
        if unknown.key not in old:
            result[i, i] = WEAK_PRIOR / unknown.gain.typical**2
    return result
