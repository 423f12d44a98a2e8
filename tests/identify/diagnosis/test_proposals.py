"""The next experiment: imagined motion in balance, and proposals that a rig can run and that separate."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.acquisition.trajectories import read_trajectory
from fingerlab.identify.diagnosis.evidence import Evidence
from fingerlab.identify.diagnosis.imagined import bench_motion, commanded, finger_motion
from fingerlab.identify.diagnosis.next_experiment import propose
from fingerlab.identify.diagnosis.reduction import reduce_sessions
from fingerlab.identify.diagnosis.search import Watch, weigh
from fingerlab.identify.diagnosis.study import Study
from fingerlab.physics.effects import CATALOGUE
from fingerlab.sessions.model import Session

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
    motion = finger_motion(made.RIG, sign, SINE, VALUES, None)
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


def test_a_finger_whose_cable_would_hang_loose_is_not_imagined() -> None:
    low = {**SINE, "offset_deg": -30.0}
    assert finger_motion(made.RIG, -1, low, VALUES, None) is None


def test_a_pressing_finger_stands_still_and_pushes_as_its_cable_pulls() -> None:
    """Extra tension b T becomes force times its lever about the PIP joint."""
    free = finger_motion(made.RIG, 1, SINE, VALUES, None)
    pressing = finger_motion(made.RIG, 1, {**SINE, "amplitude_deg": 1.0}, VALUES, np.radians(15.0))
    assert free is not None
    assert pressing is not None
    assert pressing.phase == "contact"
    assert pressing.force is not None
    assert pressing.joints is not None
    assert np.ptp(pressing.joints.mcp) < 0.05 * np.ptp(free.joints.mcp if free.joints else 0)
    f, q = made.NOMINAL, pressing.joints
    lever = 2 * f.distal_half_length * np.cos(q.mcp + q.pip - f.wrist_angle)
    pull = (pressing.torque - made.INERTIA * pressing.acceleration) / made.RADIUS
    slope = np.polyfit(pull, pressing.force * lever, 1)[0]
    assert slope == pytest.approx(VALUES["arm_pip@flexion"], rel=0.02)


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
def judged() -> tuple[Session, Study, Evidence]:
    """A bench with viscous joints, and all effects judged on it."""
    session = made.session(made.Bench(missing=made.Missing(viscous=(3e-3, 2e-3))))
    chosen = (
        "viscous_friction",
        "motor_viscous_friction",
        "coulomb_friction",
        "spring_hardening",
        "stiffness_error",
    )
    study = Study(reduce_sessions([session], [CATALOGUE[n] for n in chosen]))
    base = study.settle([])
    return session, study, weigh(study, base, study.reduced.layout.effects, Watch())


def index(evidence: Evidence, name: str) -> int:
    return [t.model.choices[-1].effect.id for t in evidence.trials].index(name)


PAIRS = [
    ("viscous_friction", "coulomb_friction"),
    ("viscous_friction", "motor_viscous_friction"),
    ("spring_hardening", "stiffness_error"),
]


@pytest.mark.parametrize("pair", PAIRS)
def test_a_proposal_can_be_run_and_names_what_it_separates(
    pair: tuple[str, str], judged: tuple[Session, Study, Evidence]
) -> None:
    session, study, evidence = judged
    proposal = propose([session], study, evidence, [index(evidence, n) for n in pair])
    assert proposal is not None
    assert proposal["separates"] == list(pair)
    assert np.isfinite(proposal["expected_separation"])
    assert proposal["expected_separation"] > 0
    assert proposal["phase"] in ("on_air", "contact", "motor_bench", "free")
    assert read_trajectory({**proposal["trajectory"], "duration_s": 5.0}).duration == 5.0


def test_nothing_is_proposed_where_nothing_is_left_to_separate(
    judged: tuple[Session, Study, Evidence],
) -> None:
    session, study, evidence = judged
    assert propose([session], study, evidence, [0]) is None
    assert propose([session], study, evidence, []) is None


def test_a_wider_set_of_speeds_separates_viscous_from_coulomb(
    judged: tuple[Session, Study, Evidence],
) -> None:
    """One amplitude at one speed cannot tell them apart; the proposal is not the slow small sine."""
    session, study, evidence = judged
    pair = [index(evidence, n) for n in ("viscous_friction", "coulomb_friction")]
    proposal = propose([session], study, evidence, pair)
    assert proposal is not None
    assert proposal["trajectory"]["frequency_hz"] != 0.2 or proposal["trajectory"]["kind"] != "sine"
