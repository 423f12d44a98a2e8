"""Diagnoses from closed forms, so that the window can be tested without the instrument.

A joint with stiffness k that swings as A sin(wt) under Coulomb friction c: the motor gives
k A sin(wt) + c sign(cos(wt)), the nominal model says k A sin(wt), so the residual is c sign(cos(wt)).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fingerlab.diagnosis.answer.error_parts import Comparison, EquationError
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis, Failure, Fingerprint, PathStep
from fingerlab.models.file import ParameterEstimate
from fingerlab.prediction.trial import CAUSES, ForceError, ModelForce, Trial, TrialRun

STIFFNESS = 0.05  # N m/rad
AMPLITUDE = 0.3  # rad
FRICTION = 0.0048  # N m
FREQUENCY = 1.0  # Hz
FLOOR = 0.0004  # N m
CABLE_FLOOR = 4e-5  # m
NOISE = 0.0003  # N m
RATE = 100.0
DURATION = 12.0
START_UP = 1.5
CABLE_ARM = 0.012  # m


def _comparisons(session: str, with_friction: bool) -> tuple[Comparison, ...]:
    time = np.arange(0.0, DURATION, 1 / RATE)
    phase = 2 * np.pi * FREQUENCY * time
    gap = (time < START_UP) | (time > DURATION - 0.3)
    result = []
    for number, run in enumerate(("001", "002", "003")):
        noise = np.random.default_rng(number).normal(0, NOISE, len(time))
        spring = STIFFNESS * AMPLITUDE * np.sin(phase)
        friction = FRICTION * np.sign(np.cos(phase))
        for scale, equation in ((1.0, "mcp_torque"), (0.8, "pip_torque")):
            measured = scale * (spring + friction) + noise
            modelled = scale * (spring + (friction if with_friction else 0.0))
            result.append(_comparison(equation, session, run, time, measured, modelled, "N m", FLOOR, gap))
        wound = CABLE_ARM * AMPLITUDE * np.sin(phase)
        result.append(
            _comparison(
                "cable_kinematics", session, run, time, wound + noise * 0.1, wound, "m", CABLE_FLOOR, gap
            )
        )
        force = np.abs(spring) * 50.0
        for equation in ("endpoint_force_pip", "endpoint_force_mcp"):
            result.append(_comparison(equation, session, run, time, force, force * 0.9, "N", 0.01, gap))
        motor = spring / 2.0
        result.append(_comparison("motor_torque", session, run, time, motor, motor, "N m", FLOOR, gap))
    return tuple(result)


def _comparison(
    equation: str,
    session: str,
    run: str,
    time: np.ndarray,
    measured: np.ndarray,
    modelled: np.ndarray,
    unit: str,
    floor: float,
    gap: np.ndarray,
) -> Comparison:
    measured, modelled = np.where(gap, np.nan, measured), np.where(gap, np.nan, modelled)
    turn = 2 * np.pi * FREQUENCY * time
    angle, speed = AMPLITUDE * np.sin(turn), AMPLITUDE * 2 * np.pi * FREQUENCY * np.cos(turn)
    coordinates = {
        "motor angle": 2 * angle, "motor speed": 2 * speed, "tension": 3.0 + angle, "joint angle mcp": angle,
        "joint angle pip": angle, "joint speed mcp": speed, "joint speed pip": speed,
    }  # fmt: skip
    return Comparison(
        equation, session, run, "on_air", time, measured, modelled, unit, floor, coordinates=coordinates
    )


def _fingerprint(gain: float) -> Fingerprint:
    speed = np.linspace(-1.8, 1.8, 17)
    curve = gain * np.sign(speed)
    mean = FRICTION * np.sign(speed)
    return Fingerprint(
        "mcp_torque", "MCP speed", "rad/s", "N m", speed, mean, mean - 2e-4, mean + 2e-4, curve
    )


def nominal_diagnosis(session: str) -> Diagnosis:
    """Coulomb friction is missing, and Stribeck friction cannot be told apart from it."""
    coulomb = Candidate(
        "coulomb_friction",
        "Coulomb joint friction",
        1.1,
        0.83,
        True,
        {"coulomb_mcp": ParameterEstimate(FRICTION, "N m", 0.0046, 0.0050)},
        ("joint_torque",),
        "The residual flips sign with speed and is 4.8 mN m on both sides.",
        True,
        _fingerprint(FRICTION),
    )
    stribeck = Candidate(
        "stribeck_friction",
        "Stribeck joint friction",
        1.12,
        0.14,
        True,
        {"coulomb_mcp": ParameterEstimate(0.0051, "N m", 0.0042, 0.0068)},
        ("joint_torque",),
        "Coulomb friction that is 6 % larger near zero speed fits as well.",
        True,
        _fingerprint(0.0051),
    )
    tilt = Candidate(
        "gravity_tilt",
        "Tilted base",
        12.3,
        0.0,
        False,
        {},
        ("joint_torque",),
        "At one posture a tilt cannot be told from a preload; runs at several offsets would reveal it.",
        False,
    )
    return Diagnosis(
        sessions=(session,),
        model=(),
        errors={
            "joint_torque": EquationError("N m", 0.00481, 0.83, FLOOR),
            "cable_kinematics": EquationError("m", 4.1e-5, 0.999, CABLE_FLOOR),
            "motor_torque": EquationError("N m", 0.00052, 0.997, 0.0005),
            "endpoint_force": EquationError("N", 0.05, 0.99, 0.05),
        },
        score=12.4,
        verdict="missing_effect",
        candidates=(coulomb, stribeck, tilt),
        set=("coulomb_friction", "stribeck_friction"),
        path=(PathStep(None, 12.4), PathStep("coulomb_friction", 1.1)),
        final_model=("coulomb_friction",),
        next_experiment={
            "trajectory": {"kind": "sine", "frequency_hz": 0.1, "amplitude_deg": 10.0},
            "phase": "on_air",
            "separates": ["coulomb_friction", "stribeck_friction"],
            "expected_separation": 9.0,
        },
        seconds=0.1,
        probability_nothing=0.0,
        probability_unknown=0.03,
        comparisons=_comparisons(session, with_friction=False),
        failure=Failure("start of flexion, low speed", "mcp_torque", "002", 4.7, 5.3),
    )


def friction_diagnosis(session: str) -> Diagnosis:
    """With Coulomb friction in the model nothing is missing."""
    tilt = Candidate(
        "gravity_tilt", "Tilted base", 1.1, 0.04, False, {}, ("joint_torque",), "No sign of it.", True
    )
    return Diagnosis(
        sessions=(session,),
        model=("coulomb_friction",),
        errors={
            "joint_torque": EquationError("N m", 0.00044, 0.998, FLOOR),
            "cable_kinematics": EquationError("m", 4.1e-5, 0.999, CABLE_FLOOR),
            "motor_torque": EquationError("N m", 0.00052, 0.997, 0.0005),
            "endpoint_force": EquationError("N", 0.05, 0.99, 0.05),
        },
        score=1.1,
        verdict="nothing_missing",
        candidates=(tilt,),
        set=(),
        path=(PathStep(None, 1.1),),
        final_model=("coulomb_friction",),
        next_experiment=None,
        seconds=0.1,
        probability_nothing=0.95,
        probability_unknown=0.01,
        comparisons=_comparisons(session, with_friction=True),
        failure=None,
    )


def unseen_diagnosis(session: str) -> Diagnosis:
    """Nothing is missing that the data could show; three effects they could not have, and a run for two."""
    idle = friction_diagnosis(session)
    hidden = tuple(
        Candidate(
            effect,
            title,
            1.1,
            share,
            True,
            {},
            ("joint_torque",),
            "These data could not show it at a plausible strength; a slow run would.",
            False,
        )
        for effect, title, share in (
            ("stribeck_friction", "Stribeck joint friction", 0.02),
            ("gravity_tilt", "Tilted base", 0.02),
            ("cable_stretch", "Cable stretch", 0.01),
        )
    )
    seen = Candidate(
        "coulomb_friction",
        "Coulomb joint friction",
        1.1,
        0.05,
        False,
        {},
        ("joint_torque",),
        "No sign of it.",
        True,
        _fingerprint(0.0001),
    )
    return replace(
        idle,
        model=(),
        candidates=(seen, *hidden),
        set=tuple(one.effect for one in hidden),
        final_model=(),
        next_experiment={
            "trajectory": {"kind": "sine", "frequency_hz": 0.2, "amplitude_deg": 14.0},
            "phase": "on_air",
            "cable": "extension",
            "separates": ["nothing_missing", "stribeck_friction", "gravity_tilt"],
            "expected_separation": 7.0,
        },
        probability_nothing=0.82,
        probability_unknown=0.08,
    )


def hiding_diagnosis(session: str) -> Diagnosis:
    """Nothing is shown to be missing, and yet an effect is likelier than that."""
    unseen = unseen_diagnosis(session)
    first, second, *rest = unseen.candidates
    likely = replace(second, probability=0.68)
    return replace(
        unseen, candidates=(first, likely, *rest), probability_nothing=0.2, probability_unknown=0.04
    )


def invented_trial() -> Trial:
    """Two runs of each model: the nominal one misses a tenth of the force, the found one a hundredth."""
    time = np.arange(0.1, 7.9, 0.004)
    wanted = 0.9 + 0.5 * np.sin(np.pi * time)

    def of(model: str, missed: float) -> ModelForce:
        runs = tuple(
            TrialRun(f"{k:03d}", model, ForceError(time, wanted, (1.0 + k * missed) * wanted), 0.02)
            for k in (1, 2)
        )
        parts = dict.fromkeys(CAUSES, 0.0) | {"gain": 0.9, "scatter": 0.1}
        return ModelForce(model, runs, missed, 2.0 * missed, 0.02, 0.1 * missed, parts)

    return Trial("M.json", ("coulomb_friction",), of("nominal", 0.1), of("found", 0.01), 0.1, 0.08, 0.12, 0.2)
