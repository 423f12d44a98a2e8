"""What a standing motor leaves open, against sums of covariances written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.fit.noise import change_of_weight, encoder_spread, log_widening
from fingerlab.diagnosis.fit.solver import Fitter
from fingerlab.diagnosis.gram.decimation import rest_moments, stuck_moments
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.score.selection import contact_penalty
from fingerlab.diagnosis.settings import CONTACT_PENALTY, NARROW_RATE_HZ, SETTLING_S, WIDE_RATE_HZ
from fingerlab.diagnosis.signals.filters import decimate
from fingerlab.effects import CATALOGUE
from fingerlab.effects.base import Row
from fingerlab.physics.motion import Motion
from fingerlab.rig.file import Motor
from fingerlab.sessions.model import Run
from tests.reduced import reduce_sessions

from . import closed_form as made


def random_covariance(seed: int) -> np.ndarray:
    root = np.random.default_rng(seed).normal(size=(5, 5))
    return root @ root.T + 0.5 * np.eye(5)


def test_weights_are_the_inverse_of_the_sum_of_both_covariances() -> None:
    noise, more = random_covariance(1), random_covariance(2)
    weights = np.linalg.inv(noise)
    assert weights + change_of_weight(weights, more) == pytest.approx(np.linalg.inv(noise + more))
    expected = np.linalg.slogdet(noise + more)[1] - np.linalg.slogdet(noise)[1]
    assert log_widening(weights, more) == pytest.approx(expected)


def test_equations_that_are_not_judged_stay_so() -> None:
    """A weight of zero has no covariance to add to."""
    weights = np.diag([1.0, 4.0, 9.0, 0.0, 0.0])
    changed = weights + change_of_weight(weights, encoder_spread(0.5))
    assert np.diag(changed) == pytest.approx([1.0, 4.0, 1.0 / (1.0 / 9.0 + 0.5), 0.0, 0.0])


@pytest.fixture(scope="module")
def scorer() -> Scorer:
    """An invented bench whose runs hold still for a while."""
    return Scorer(reduce_sessions([made.session(made.Bench(), 2)], list(CATALOGUE.values())))


def test_friction_at_rest_frees_its_own_equation_by_a_third_of_its_square(scorer: Scorer) -> None:
    trial = scorer.fit([Choice(CATALOGUE["coulomb_friction"], 1)])
    values = trial.fit.values.copy()
    torque = 4e-3
    values[trial.model.index["coulomb_friction.coulomb_mcp"]] = torque
    values[trial.model.index["coulomb_friction.coulomb_pip"]] = 0.0
    group = scorer.reduced.groups[0]
    group.whole.rest = group.whole.products.copy()  # as if it stood all the time
    weights = trial.weights[group.key]
    held = scorer.data.stiction_weights(0, trial.model, trial.model.features(values, group), weights)
    assert held is not None
    arm = values[trial.model.index["arm_mcp@extension"]]
    # The state is nearly always at one of its extremes in these runs, so its square is nearly one.
    spread = 1.0 / (weights + held[0])[Row.MCP, Row.MCP] - 1.0 / weights[Row.MCP, Row.MCP]
    assert spread == pytest.approx((torque / arm) ** 2 / 3.0, rel=0.2)
    assert (weights + held[0])[Row.PIP, Row.PIP] == pytest.approx(weights[Row.PIP, Row.PIP])
    # A standstill holds one unknown force: seen twice as long, it is known to half the variance, and the
    # density of each of the seven falls by that alone.
    values[trial.model.index["coulomb_friction.coulomb_mcp"]] = 100.0 * torque
    fallen = []
    for samples in (700, 1400):
        group.whole.rest_samples, group.whole.standstills = samples, 7
        found = scorer.data.stiction_weights(0, trial.model, trial.model.features(values, group), weights)
        assert found is not None
        fallen.append(found[1])
    assert fallen[1] - fallen[0] == pytest.approx(7 * np.log(2.0), rel=0.01)
    group.whole.rest, group.whole.rest_samples, group.whole.standstills = None, 0, 0


def alone(time: np.ndarray, position: np.ndarray, torque: np.ndarray) -> Motion:
    """A motor alone."""
    velocity = np.gradient(position, time)
    motor = Motor(torque_constant=1.0, gear_ratio=1.0, pulley_radius=None, inertia=None)
    return Motion(
        phase="motor_bench", cable_sign=0, sample_rate_hz=WIDE_RATE_HZ, time=time, position=position,
        velocity=velocity, acceleration=np.gradient(velocity, time), torque=torque, motor=motor,
    )  # fmt: skip


@pytest.mark.parametrize("dwell", [0.0, 0.06])
def test_a_motor_sticks_where_it_stands_while_its_torque_goes_on(dwell: float) -> None:
    """Strokes of half a second; in a dwell at either end the torque goes from one side to the other.

    Without a dwell a spring's torque, which goes on where the motion turns round: nothing sticks.
    """
    stroke, time = 0.5, np.arange(0.0, 8.0, 1.0 / WIDE_RATE_HZ)
    number, into = np.divmod(time, stroke + dwell)
    way = 0.5 - 0.5 * np.cos(np.pi * np.minimum(into / stroke, 1.0))
    sense = np.where(number % 2 == 0, 1.0, -1.0)
    position = np.where(sense > 0, way, 1.0 - way)
    waited = np.clip((into - stroke) / dwell, 0.0, 1.0) if dwell else np.zeros(len(time))
    torque = sense * (1.0 - 2.0 * waited) if dwell else position
    stuck = stuck_moments(alone(time, position, torque), slice(None))
    standing = (into > stroke + 0.01) & (into < stroke + dwell - 0.01)
    assert np.all(stuck[standing[: len(stuck)]])
    assert not stuck[(into > 0.02) & (into < stroke - 0.02)].any()
    assert stuck.mean() == pytest.approx(dwell / (stroke + dwell), abs=0.02)


def test_what_is_held_at_rest_is_doubted_wherever_the_low_pass_carries_it() -> None:
    """A motor that turns at 1 rad/s and stands from 2 s to 3 s, and a torque of 1 that is held meanwhile."""
    time = np.arange(0.0, 5.0, 1.0 / WIDE_RATE_HZ)
    position = np.minimum(time, 2.0) + np.maximum(time - 3.0, 0.0)
    held = ((time > 2.0) & (time < 3.0)).astype(float)
    rest = rest_moments(alone(time, position, np.zeros(len(time))), slice(None))
    carried, at = decimate(held), decimate(time)
    assert rest[carried > 0.6].all()  # at its edges a half
    assert not rest[(at < 1.85) | (at > 3.15)].any()
    assert rest.sum() < 1.4 * NARROW_RATE_HZ


def test_a_model_without_friction_is_weighed_as_ever(scorer: Scorer) -> None:
    trial = scorer.fit([Choice(CATALOGUE["added_mass"])])
    fitter = Fitter(trial.model, scorer.data, trial.weights)
    before = [sums.matrix.copy() for sums in fitter.sums]
    fitter.set_friction_weights(trial.fit.values)
    assert all(np.array_equal(a, b.matrix) for a, b in zip(before, fitter.sums, strict=True))
    assert fitter.widening == 0.0


def test_how_a_tip_rubs_is_held_against_a_lean_and_not_against_a_span(scorer: Scorer) -> None:
    """A force along the face may pass for one that leans; a normal one turns the joints otherwise."""
    charges = {
        name: contact_penalty(scorer.bare, scorer.fit([Choice(CATALOGUE[name])], iterations=1))
        for name in ("load_cell_gain", "contact_angle", "contact_compliance")
    }
    assert charges == {
        "load_cell_gain": 0.0, "contact_angle": CONTACT_PENALTY, "contact_compliance": CONTACT_PENALTY
    }  # fmt: skip


@pytest.mark.parametrize("cycles", [10, 20])
def test_what_is_held_again_in_every_cycle_is_one_standstill(cycles: int) -> None:
    """A motor that turns in a tenth of a second and stands for 0.4 s at either end, once a second."""
    stroke, time = 0.1, np.arange(0.0, cycles + SETTLING_S, 1.0 / made.RATE)
    number, into = np.divmod(time, 0.5)
    way = 0.5 - 0.5 * np.cos(np.pi * np.minimum(into / stroke, 1.0))
    position = np.where(number % 2 == 0, way, 1.0 - way)
    noise = np.random.default_rng(3).normal(scale=1e-4, size=(2, len(time)))
    run = Run.from_arrays(
        {"motor_position": position + noise[0], "motor_torque": 0.02 * position + noise[1], "time": time},
        name="001", phase="motor_bench", cable="none", sample_rate_hz=made.RATE,
        trajectory={"kind": "sine", "frequency_hz": 1.0},
    )  # fmt: skip
    (group,) = reduce_sessions([replace(made.session(made.Bench(), 2), runs=(run,))], []).groups
    assert group.whole.rest_samples > 4 * cycles
    assert group.whole.standstills == pytest.approx(2.0, abs=0.1)
