"""The next experiment: imagined motion in balance, and proposals that a rig can run and that separate."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.core.progress import Watch
from fingerlab.diagnosis.equations.model import build
from fingerlab.diagnosis.experiment.predicted_runs import (
    Proposal,
    bench_motion,
    commanded,
    finger_motion,
    menu,
    pressing_motion,
    seen_press,
)
from fingerlab.diagnosis.experiment.proposal import best_run, propose
from fingerlab.diagnosis.experiment.separation import (
    PredictedRun,
    effects_in,
    known_of,
    predict_run,
    run_kind,
    separation,
    values_in,
)
from fingerlab.diagnosis.experiment.worth import Judged
from fingerlab.diagnosis.gram.decimation import decimated_columns
from fingerlab.diagnosis.score.evidence import Evidence
from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.next_effect import judge_all
from fingerlab.diagnosis.settings import NARROW_RATE_HZ
from fingerlab.diagnosis.signals.filters import EFFECTIVE_SHARE
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from fingerlab.physics.motion import Motion
from fingerlab.rig.file import Intervention
from fingerlab.sessions.model import Session
from fingerlab.twin.protocols import single_run
from tests.reduced import reduce_sessions

from . import closed_form as made

SINE = {"kind": "sine", "frequency_hz": 0.5, "amplitude_deg": 12.0, "offset_deg": 30.0}
VALUES = {
    "arm_mcp@extension": 0.0104, "arm_pip@extension": 0.0083, "offset@extension": 0.002,
    "arm_mcp@flexion": 0.0117, "arm_pip@flexion": 0.0058, "offset@flexion": 0.002,
    "cable_compliance": 2e-5,
}  # fmt: skip


def gravity(mcp: np.ndarray, pip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    f = made.NOMINAL
    second = -f.distal_mass * f.gravity * f.distal_half_length * np.cos(mcp + pip - f.wrist_angle)
    first = (f.proximal_mass + 2 * f.distal_mass) * f.gravity * f.proximal_half_length
    return -first * np.cos(f.wrist_angle - mcp) + second, second


@pytest.mark.parametrize(("sign", "cable"), [(-1, "extension"), (1, "flexion")])
def test_an_imagined_finger_hangs_in_balance_on_its_cable(sign: int, cable: str) -> None:
    """Springs and gravity against the tension in both joints, and the cable as long as they call for."""
    motion = finger_motion(made.RIG, sign, SINE, VALUES)
    assert motion is not None
    assert motion.joints is not None
    q, f = motion.joints, made.NOMINAL
    a, b = VALUES[f"arm_mcp@{cable}"], VALUES[f"arm_pip@{cable}"]
    pull = (motion.torque - made.INERTIA * motion.acceleration) / made.RADIUS
    first, second = gravity(q.mcp, q.pip)
    assert f.mcp_stiffness * q.mcp + first == pytest.approx(sign * a * pull, abs=1e-6)
    assert f.pip_stiffness * q.pip + second == pytest.approx(sign * b * pull, abs=1e-6)
    wound = made.RADIUS * motion.position - VALUES[f"offset@{cable}"]
    assert sign * (a * q.mcp + b * q.pip) == pytest.approx(wound, abs=1e-7)
    assert pull.min() > 0


def test_an_imagined_finger_with_a_known_change_hangs_in_balance_too() -> None:
    """Mass, spring, wider guide and load stand in the balances, and the cable follows the pulley."""
    change = Intervention(
        added_mass=0.01, added_mass_at=0.03, load_torque=0.02, mcp_stiffness=0.05, pip_arm=1.2
    )
    motion = finger_motion(made.RIG, -1, SINE, VALUES, change)
    assert motion is not None
    assert motion.joints is not None
    q, f = motion.joints, made.NOMINAL
    a, b = VALUES["arm_mcp@extension"], 1.2 * VALUES["arm_pip@extension"]
    pull = (motion.torque - 0.02 - made.INERTIA * motion.acceleration) / made.RADIUS
    assert motion.tension == pytest.approx((motion.torque - 0.02) / made.RADIUS)
    first, second = gravity(q.mcp, q.pip)
    weight = 0.01 * f.gravity
    far = -weight * 0.03 * np.cos(q.mcp + q.pip - f.wrist_angle)
    near = -weight * 2 * f.proximal_half_length * np.cos(f.wrist_angle - q.mcp) + far
    assert (f.mcp_stiffness + 0.05) * q.mcp + first + near == pytest.approx(-a * pull, abs=1e-6)
    assert f.pip_stiffness * q.pip + second + far == pytest.approx(-b * pull, abs=1e-6)
    length = -(a * q.mcp + b * q.pip)
    assert length - length[0] == pytest.approx(made.RADIUS * (motion.position - motion.position[0]), abs=1e-7)


def test_the_menu_repeats_free_motions_with_changes_of_the_machines_own_size(
    judged: tuple[Session, Scorer, Evidence],
) -> None:
    session, scorer, evidence = judged
    told = replace(session.runs[0], trajectory={**SINE, "duration_s": 10.0})
    sessions = [replace(session, runs=(told, *session.runs[1:]))]
    changed = [p for p in menu(sessions, scorer.reduced, evidence.base.values) if p.before is not None]
    assert {name for p in changed for name in p.change.to_json()} >= {"added_mass", "load_torque", "pip_arm"}
    for proposal in changed:
        said = proposal.to_json(["a", "b"], 1.0)
        plan = single_run(said["trajectory"], said["phase"], said["cable"], said["intervention"])
        assert plan.phase == "on_air"
        assert json.loads(plan.attributes["intervention"]) == said["intervention"]
        assert {k: said["trajectory"][k] for k in SINE} == SINE
    (mass,) = {p.change.added_mass for p in changed} - {0.0}
    assert mass == pytest.approx(made.NOMINAL.distal_mass, rel=0.1)


def test_a_motion_that_only_another_program_knows_is_not_proposed_again(
    judged: tuple[Session, Scorer, Evidence],
) -> None:
    """The contract leaves the kinds of trajectories open."""
    session, scorer, evidence = judged
    told = replace(session.runs[0], trajectory={**SINE, "kind": "ramp", "amplitude_deg": 40.0})
    menus = menu([replace(session, runs=(told, *session.runs[1:]))], scorer.reduced, evidence.base.values)
    assert {"ramp"}.isdisjoint(p.trajectory["kind"] for p in menus)


def test_a_finger_whose_cable_would_hang_loose_is_not_imagined() -> None:
    low = {**SINE, "offset_deg": -30.0}
    assert finger_motion(made.RIG, -1, low, VALUES) is None


def test_a_pressing_finger_is_imagined_as_it_was_seen() -> None:
    """At the recorded amplitude the force swings as the cell read; at half of it, half as far."""
    swing = 0.4
    rng = np.random.default_rng(2)
    run = made.contact_run(made.Bench(), 1.2, swing, 1.0, rng, 10.0, "001")
    cycle = run.channel("motor_position").reshape(10, -1).mean(axis=0)  # no pure sine: the tip's way bends
    told = float(np.degrees(np.sqrt(2.0) * cycle.std()))
    run = replace(run, trajectory={**run.trajectory, "amplitude_deg": told})
    press = seen_press([Session(Path("press.h5"), "", "", made.RIG, (run,))])
    assert press is not None
    assert press.follows == pytest.approx(1.0, rel=0.05)
    assert press.mean[2] == pytest.approx(1.2, abs=0.01)
    for share in (1.0, 0.5):
        wave = {"kind": "sine", "frequency_hz": 0.5, "amplitude_deg": share * told}
        pressing = pressing_motion(made.RIG, 1, wave, press)
        assert pressing is not None
        assert pressing.phase == "contact"
        assert pressing.force is not None
        assert np.ptp(pressing.force) / 2 == pytest.approx(share * swing, rel=0.06)
        pull = (pressing.torque - made.INERTIA * pressing.acceleration) / made.RADIUS
        seen = run.channel("motor_torque") / made.RADIUS
        assert pull.mean() == pytest.approx(seen.mean(), rel=0.02)


def test_a_finger_that_never_pressed_is_not_imagined_to() -> None:
    free = made.session(made.Bench(), contact=0, seconds=4.0)
    assert seen_press([free]) is None


def test_an_imagined_bench_follows_its_equation() -> None:
    motion = bench_motion(made.RIG, SINE, 0.1)
    omega = 2 * np.pi * 0.5
    time, position = commanded(SINE)
    assert motion.position == pytest.approx(position)
    inner = slice(5, -5)
    acceleration = -(omega**2) * (position - np.radians(30.0))
    assert motion.acceleration[inner] == pytest.approx(acceleration[inner], abs=2e-3)
    assert motion.torque[inner] == pytest.approx((made.INERTIA * acceleration + 0.1)[inner], abs=1e-5)
    assert time[0] >= 2.0


@pytest.fixture(scope="module")
def judged() -> tuple[Session, Scorer, Evidence]:
    """A bench with viscous joints, and all effects judged on it, as if its data had not told them apart."""
    session = made.session(made.Bench(missing=made.Missing(viscous=(3e-3, 2e-3))))
    chosen = (
        "viscous_friction",
        "motor_viscous_friction",
        "coulomb_friction",
        "spring_hardening",
        "stiffness_error",
    )
    scorer = Scorer(reduce_sessions([session], [CATALOGUE[n] for n in chosen]))
    base = scorer.fit_reweighted([])
    evidence = judge_all(scorer, base, scorer.reduced.layout.effects, Watch())
    even = np.full(len(evidence.candidates), 1.0 / len(evidence.candidates))
    told = {"probabilities": even, "nothing": 1e-6, "unknown": 1e-6}
    return session, scorer, replace(evidence, log_odds=np.zeros(len(even)), **told)


def index(evidence: Evidence, name: str) -> int:
    return [t.model.choices[-1].effect.id for t in evidence.candidates].index(name)


USUAL = {"left": 1.05}, "contact on_air"
"""What a session is like, as far as probabilities depend on it."""

PAIRS = [
    ("viscous_friction", "coulomb_friction"),
    ("viscous_friction", "motor_viscous_friction"),
    ("viscous_friction", "spring_hardening"),
]


@pytest.mark.parametrize("pair", PAIRS)
def test_a_proposal_can_be_run_and_names_what_it_separates(
    pair: tuple[str, str], judged: tuple[Session, Scorer, Evidence]
) -> None:
    session, scorer, evidence = judged
    found = propose([session], scorer, evidence, [index(evidence, n) for n in pair], USUAL)
    assert found is not None
    proposal = found.proposal
    assert proposal["separates"] == list(pair)
    assert np.isfinite(proposal["expected_separation"])
    assert proposal["expected_separation"] > 0
    assert proposal["phase"] in ("on_air", "contact", "motor_bench", "free")
    assert read_trajectory({**proposal["trajectory"], "duration_s": 5.0}).duration == 5.0


def test_nothing_is_proposed_where_nothing_is_left_to_separate(
    judged: tuple[Session, Scorer, Evidence],
) -> None:
    session, scorer, evidence = judged
    assert propose([session], scorer, evidence, [0], USUAL) is None
    assert propose([session], scorer, evidence, [], USUAL) is None


def test_a_wider_set_of_speeds_separates_viscous_from_coulomb(
    judged: tuple[Session, Scorer, Evidence],
) -> None:
    """One amplitude at one speed cannot tell them apart; the proposal is not the slow small sine."""
    session, scorer, evidence = judged
    pair = [index(evidence, n) for n in ("viscous_friction", "coulomb_friction")]
    found = propose([session], scorer, evidence, pair, USUAL)
    assert found is not None
    proposal = found.proposal
    assert proposal["trajectory"]["frequency_hz"] != 0.2 or proposal["trajectory"]["kind"] != "sine"


def test_a_run_is_foretold_with_the_nuisances_of_what_was_recorded(
    judged: tuple[Session, Scorer, Evidence],
) -> None:
    """Of a fast rotor a trace of viscous friction is a smaller one, and a tip that sticks may hold more."""
    session, scorer, evidence = judged
    told = dict(scorer.reduced.layout.nuisances)
    narrow = {**told, "trace_mcp": replace(told["trace_mcp"], typical=0.1 * told["trace_mcp"].typical)}
    fitted = evidence.candidates[index(evidence, "viscous_friction")]
    motion = finger_motion(made.RIG, -1, {**SINE, "amplitude_deg": 8.0}, fitted.values)
    assert motion is not None
    kinds = [run_kind(session, motion, [fitted.last_effect], nuisances=one) for one in (told, narrow)]
    usual, smaller = (
        next(u.parameter.typical for u in kind.model(fitted).unknowns if u.key == "trace_mcp")
        for kind in kinds
    )
    assert smaller == pytest.approx(0.1 * usual)


HEAT = 3.0


@pytest.fixture(scope="module")
def imagined(
    judged: tuple[Session, Scorer, Evidence],
) -> tuple[Motion, PredictedRun, Scorer, FittedModel, FittedModel]:
    """A run that was not taken, and two models to tell apart there."""
    session, scorer, evidence = judged
    pair = [evidence.candidates[index(evidence, n)] for n in ("viscous_friction", "coulomb_friction")]
    values = dict(zip((u.key for u in pair[0].model.unknowns), map(float, pair[0].fit.values), strict=True))
    motion = finger_motion(made.RIG, -1, {**SINE, "amplitude_deg": 8.0}, values)
    assert motion is not None
    effects = [t.model.choices[-1].effect for t in pair]
    return motion, predict_run(motion, run_kind(session, motion, effects)), scorer, pair[0], pair[1]


def test_a_separation_is_what_the_rival_leaves_of_every_sample(
    imagined: tuple[Motion, PredictedRun, Scorer, FittedModel, FittedModel],
) -> None:
    """The same number from whitened residuals, sample by sample, and a least-squares solver."""
    motion, run, scorer, truth, rival = imagined
    group, layout = run.kind.group, run.kind.layout
    columns = decimated_columns(motion, layout.effects, layout.signals).columns
    count = len(columns)

    def residuals(trial: FittedModel) -> tuple[np.ndarray, np.ndarray]:
        """Of the four equations, (4 n,), and their derivatives, (4 n, p)."""
        model = build(layout, [group], trial.model.choices)
        h, slopes = model.coefficients(values_in(model, trial), group)
        told, reach = np.zeros((5, count)), np.zeros((5, count, slopes.shape[1]))
        for i, row, signal in zip(range(len(h)), model.rows, model.pick.signals, strict=True):
            told[row] += h[i] * columns[:, signal]
            reach[row] += columns[:, signal, None] * slopes[i]
        there = [Row.MCP, Row.PIP, Row.CABLE, Row.TIP]
        root = np.linalg.cholesky(truth.weights[group.key][np.ix_(there, there)] * EFFECTIVE_SHARE / HEAT).T
        white = np.einsum("rs,sn->rn", root, told[there]), np.einsum("rs,snp->rnp", root, reach[there])
        return white[0].ravel(), white[1].reshape(4 * count, -1)

    gap = residuals(truth)[0] - residuals(rival)[0]
    reach = residuals(rival)[1]
    # One more unknown: Coulomb friction of this run alone, which is known to 5 % of the common value.
    model = build(layout, [group], rival.model.choices)
    common = values_in(model, rival)
    gains = [model.index[f"coulomb_friction.{name}"] for name in rival.model.choices[-1].effect.gains]
    reach = np.concatenate((reach, reach[:, gains] * common[gains]), axis=1)
    known = known_of(build(layout, [group], rival.model.choices), rival, HEAT)
    size, ways = np.linalg.eigh(known)
    prior = np.zeros((len(size) + len(gains), len(size) + len(gains)))
    prior[: len(size), : len(size)] = np.sqrt(np.maximum(size, 0.0))[:, None] * ways.T
    prior[len(size) :, len(size) :] = np.eye(len(gains)) / 0.05
    stacked = np.concatenate((reach, prior))
    scale = np.linalg.norm(stacked, axis=0)
    wanted = np.concatenate((gap, np.zeros(len(prior))))
    step = np.linalg.lstsq(stacked / scale, wanted, rcond=None)[0]
    left = wanted - stacked / scale @ step
    assert separation(scorer.reduced, run, truth, rival, HEAT) == pytest.approx(0.5 * left @ left, rel=1e-3)


def test_nothing_separates_a_model_from_itself(
    imagined: tuple[Motion, PredictedRun, Scorer, FittedModel, FittedModel],
) -> None:
    _, run, scorer, truth, rival = imagined
    assert separation(scorer.reduced, run, truth, truth, HEAT) == pytest.approx(0.0, abs=1e-6)
    assert separation(scorer.reduced, run, truth, rival, HEAT) > 1e-3


def test_the_motor_alone_tells_what_the_motor_does_from_what_the_joints_do(
    judged: tuple[Session, Scorer, Evidence],
) -> None:
    """A viscous motor takes its torque without a finger, too; of joints such a run says nothing."""
    session, scorer, evidence = judged
    names = ("motor_viscous_friction", "viscous_friction")
    motor, joint = (evidence.candidates[index(evidence, n)] for n in names)
    motion = bench_motion(made.RIG, {**SINE, "amplitude_deg": 30.0}, 0.0)
    run = predict_run(
        motion, run_kind(session, motion, effects_in([motor, joint], motion), beside_finger=True)
    )
    assert [e.id for e in run.kind.layout.effects] == ["motor_viscous_friction"]
    assert separation(scorer.reduced, run, motor, joint, HEAT) > 1.0
    assert separation(scorer.reduced, run, joint, joint, HEAT) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("nats_a_second", "seconds"), [(0.3, 60.0), (0.6, 20.0)])
def test_a_run_that_would_not_decide_in_twenty_seconds_lasts_a_minute(
    judged: tuple[Session, Scorer, Evidence], nats_a_second: float, seconds: float
) -> None:
    """A separation of 10 nats decides."""
    session = judged[0]
    motion = bench_motion(made.RIG, SINE, 0.0)
    runs = [
        (Proposal("motor_bench", "none", SINE, motion), predict_run(motion, run_kind(session, motion, [])))
    ]

    def worth(run: PredictedRun) -> Judged:
        gain = nats_a_second * run.sums.samples / NARROW_RATE_HZ
        return Judged((gain,), gain, ("viscous_friction",), gain)

    best = best_run(runs, worth)
    assert best is not None
    assert best[0].to_json(["a", "b"], 1.0)["trajectory"]["duration_s"] == seconds
    # Behind a start of 2 s, and without what the filters take at its ends.
    assert best[1].expected == pytest.approx(nats_a_second * (seconds - 2.0), rel=0.05)


def test_a_run_that_separates_nothing_is_not_proposed(judged: tuple[Session, Scorer, Evidence]) -> None:
    """One that is expected to bring less than 0.2 nats is not worth a run: an effect against itself."""
    session, scorer, evidence = judged
    first = index(evidence, "viscous_friction")
    assert propose([session], scorer, evidence, [first, first], USUAL) is None


def test_three_times_the_time_separates_three_times_as_well(judged: tuple[Session, Scorer, Evidence]) -> None:
    """Where the old runs leave the rival nothing to take up, the separation grows with the run's length."""
    session, scorer, evidence = judged
    first, second = (
        evidence.candidates[index(evidence, n)] for n in ("viscous_friction", "coulomb_friction")
    )
    motion = finger_motion(made.RIG, -1, SINE, VALUES)
    assert motion is not None
    run = predict_run(motion, run_kind(session, motion, effects_in([first, second], motion)))
    once, thrice = (separation(scorer.reduced, r, first, second, 1.0) for r in (run, run.lasting(3.0)))
    assert 1.0 < thrice / once <= 3.0 + 1e-9
    assert run.lasting(3.0).sums.samples == pytest.approx(3 * run.sums.samples, abs=1)
