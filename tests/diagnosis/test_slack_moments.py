"""Where a cable may be slack: by the pull that is left of the motor's torque, as surely as that is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fingerlab.diagnosis.fit.noise import _factor, _limited
from fingerlab.diagnosis.gram.decimation import counted, taut_moments
from fingerlab.diagnosis.settings import GRAM_RIDGE, MOST_NOISE, SLACK_TENSION_N
from fingerlab.physics.motion import Motion
from tests.effects.moving import MOTOR, moving

ACCELERATION = 40.0  # rad/s^2: what a chirp of 3 Hz over 7 degrees asks of the motor at its turns


def pulled(newtons: float, true_inertia: float, spread: float) -> Motion:
    """A motor that speeds up steadily against a cable tension, with the rig's inertia in the file."""
    motion = moving()
    speeding = np.full_like(motion.time, ACCELERATION)
    torque = newtons * motion.radius + true_inertia * speeding
    return replace(motion, acceleration=speeding, torque=torque, inertia_spread=spread)


def taut(motion: Motion, drive: Mapping[str, float] | None = None) -> np.ndarray:
    return taut_moments(motion, counted(motion), drive or {})


def test_a_slack_cable_is_not_taut_because_the_rotor_is_heavier_than_the_rig_file_says() -> None:
    assert MOTOR.inertia is not None
    heavier = 1.3 * MOTOR.inertia
    excess = 0.3 * MOTOR.inertia * ACCELERATION / 0.015  # N that the rotor seems to pull
    assert excess > SLACK_TENSION_N  # so that the tension alone would say: taut
    assert taut(pulled(0.0, heavier, 0.0)).all()
    assert not taut(pulled(0.0, heavier, 0.2 * MOTOR.inertia)).any()


def test_a_cable_that_pulls_is_taut_however_the_rotor_may_be() -> None:
    assert MOTOR.inertia is not None
    assert taut(pulled(1.0, MOTOR.inertia, 0.2 * MOTOR.inertia)).all()


def test_what_motor_and_gearbox_were_found_to_keep_is_no_pull() -> None:
    """4 mN m of friction and grease read as 0.27 N at a pulley of 15 mm, more than a slack cable may pull."""
    turning = pulled(0.0, MOTOR.inertia or 0.0, 0.0)
    turning = replace(turning, velocity=np.full_like(turning.time, 2.0))
    turning = replace(turning, torque=turning.torque + 2e-3 * 2.0)
    assert taut(turning).all()
    assert not taut(turning, {"drive_viscous": 2e-3}).any()
    rubbing = pulled(0.0, MOTOR.inertia or 0.0, 0.0)
    way = np.linspace(0.0, 2.0, len(rubbing.time))
    rubbing = replace(rubbing, position=way, torque=rubbing.torque + 4e-3)
    assert taut(rubbing).all()
    assert not taut(rubbing, {"drive_coulomb": 4e-3}).any()


def test_products_that_are_rounding_alone_have_a_factor_all_the_same() -> None:
    rng = np.random.default_rng(5)
    directions, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    sizes = np.array([2.0, 1.0, 1.0, 1.0, 1.0, -1e-7])  # a difference of products that are nearly the same
    factor = _factor((directions * sizes) @ directions.T)
    made = (directions * np.maximum(sizes, 0.0)) @ directions.T
    assert np.allclose(factor @ factor.T, made + GRAM_RIDGE * np.eye(6), atol=1e-12)


def test_noise_that_is_far_larger_than_the_whole_is_cut_to_a_share_of_it() -> None:
    """As of a bench whose cable hung loose, with the noise of other runs: its square stays one everywhere."""
    rng = np.random.default_rng(6)
    moving, still = rng.normal(size=(40, 3)) @ rng.normal(size=(3, 8)), 1e-7 * rng.normal(size=(40, 8))
    whole = (moving + still).T @ (moving + still) / 40
    shakes = 1e3 * rng.normal(size=(60, 8))
    limited = _limited(shakes.T @ shakes / 60, whole)
    size = np.sqrt(np.diag(whole))
    scaled = limited / np.outer(size, size)
    assert np.linalg.eigvalsh(scaled).min() > -1e-12
    lifted = whole / np.outer(size, size) + GRAM_RIDGE * np.eye(8)
    assert np.linalg.eigvalsh(MOST_NOISE * lifted - scaled).min() > -1e-12
    assert np.diag(scaled).max() > 0.9
