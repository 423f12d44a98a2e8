"""A diagnosis whose every number is known beforehand, and a way to write its page.

A joint that swings as A sin(wt) on a spring k under Coulomb friction c: the motor gives
k A sin(wt) + c sign(cos(wt)), the nominal model says k A sin(wt), the residual is c sign(cos(wt)).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fingerlab.diagnosis.answer.error_parts import Comparison, EquationError
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis, Failure, Fingerprint, PathStep
from fingerlab.models.file import ParameterEstimate

STIFFNESS, AMPLITUDE, FRICTION, FLOOR, RATE = 0.05, 0.3, 0.0048, 0.0004, 25.0


def swing(run: str, equation: str = "pip_torque", friction: float = FRICTION) -> Comparison:
    """Twelve seconds at 1 Hz; nothing said for the first and the last second."""
    time = 2.0 + np.arange(0.0, 12.0, 1 / RATE)
    modelled = STIFFNESS * AMPLITUDE * np.sin(2 * np.pi * time)
    measured = modelled + friction * np.sign(np.cos(2 * np.pi * time))
    gap = (time < 3.0) | (time > 13.0)
    measured, modelled = (np.where(gap, np.nan, v) for v in (measured, modelled))
    return Comparison(equation, "session.h5", run, "on_air", time, measured, modelled, "N m", FLOOR)


def fingerprint() -> Fingerprint:
    speed = np.linspace(-1.75, 1.75, 8)
    mean = FRICTION * np.sign(speed)
    return Fingerprint(
        "pip_torque", "joint speed", "rad/s", "N m", speed, mean, mean - 2e-4, mean + 2e-4, 1.1 * mean
    )


def _candidate(effect: str, title: str, score: float, share: float, in_set: bool, **more: Any) -> Candidate:
    values: dict[str, Any] = {
        "parameters": {},
        "equations": ("joint_torque",),
        "explanation": f"Why {title}.",
        "detectable": True,
        **more,
    }
    return Candidate(effect, title, score, share, in_set, **values)


def _proposal(trajectory: dict[str, Any], cable: str, first: str, gain: float) -> dict[str, Any]:
    """A run on air that tells the first from a cable that stretches."""
    return {
        "trajectory": trajectory, "phase": "on_air", "cable": cable,
        "separates": [first, "cable_stretch"], "expected_separation": gain,
    }  # fmt: skip


@pytest.fixture(scope="session")
def found() -> Diagnosis:
    """Coulomb friction is missing, and nothing else comes near."""
    coulomb = _candidate(
        "coulomb_friction", "Coulomb joint friction", 1.1, 0.83, True,
        parameters={
            "coulomb_mcp": ParameterEstimate(0.0034, "N m", 0.0032, 0.0036),
            "coulomb_pip": ParameterEstimate(FRICTION, "N m", 0.0046, 0.0050),
            "travel_deg": ParameterEstimate(0.08, "deg", 0.08, 0.25),
        },
        fingerprint=fingerprint(),
    )  # fmt: skip
    stretch = _candidate("cable_stretch", "Cable stretch", 12.3, 0.04, False, equations=("cable_kinematics",))
    tilt = _candidate("gravity_tilt", "Tilted base", 12.4, 0.0, False, detectable=False)
    return Diagnosis(
        sessions=("session.h5",),
        model=(),
        errors={
            "joint_torque": EquationError("N m", 0.0052, 0.874, 0.0004),
            "cable_kinematics": EquationError("m", 41e-6, 0.99941, 3.6e-6),
            "endpoint_force": EquationError("N", 0.912, -0.25, 0.051),
        },
        score=12.4,
        verdict="missing_effect",
        candidates=(coulomb, stretch, tilt),
        set=("coulomb_friction",),
        path=(PathStep(None, 12.4), PathStep("coulomb_friction", 1.1)),
        final_model=("coulomb_friction",),
        next_experiment=None,
        seconds=1.25,
        probability_nothing=0.03,
        probability_unknown=0.10,
        parameters={"arm_pip@extension": ParameterEstimate(0.0081, "m", 0.0079, 0.0083)},
        comparisons=(swing("001"), swing("002", friction=2 * FRICTION), swing("003", friction=0.0)),
        failure=Failure("PIP torque of run 002 at 5.0 to 5.5 s: flexing slowly", "pip_torque", "002", 5, 5.5),
    )


@pytest.fixture(scope="session")
def nothing(found: Diagnosis) -> Diagnosis:
    """The same bench with nothing missing."""
    idle = tuple(replace(c, probability=0.0, in_set=False) for c in found.candidates)
    return replace(
        found, verdict="nothing_missing", score=1.03, candidates=idle, set=(), path=(PathStep(None, 1.03),),
        final_model=(), probability_nothing=0.999, probability_unknown=0.001,
    )  # fmt: skip


@pytest.fixture(scope="session")
def unseen(nothing: Diagnosis) -> Diagnosis:
    """Nothing is missing that the data could show; two effects they could not have, and a run for one."""
    first, stretch, tilt = nothing.candidates
    hidden = tuple(
        replace(one, probability=0.02, in_set=True, detectable=False, fingerprint=None)
        for one in (stretch, tilt)
    )
    return replace(
        nothing, candidates=(first, *hidden), set=("cable_stretch", "gravity_tilt"), probability_nothing=0.82,
        probability_unknown=0.14,
        next_experiment=_proposal(
            {"kind": "sine", "amplitude_deg": 14.0, "frequency_hz": 0.2}, "extension", "nothing_missing", 7.0
        ),
    )  # fmt: skip


@pytest.fixture(scope="session")
def unknown(nothing: Diagnosis) -> Diagnosis:
    """Something repeats that no effect explains."""
    return replace(
        nothing, verdict="not_in_catalogue", score=63.2, path=(PathStep(None, 63.2),),
        candidates=tuple(replace(one, score=61.0) for one in nothing.candidates),
        probability_nothing=0.0, probability_unknown=1.0,
    )  # fmt: skip


@pytest.fixture(scope="session")
def alike(found: Diagnosis) -> Diagnosis:
    """Two effects that the data cannot tell apart, and a run that would."""
    first, second, third = found.candidates
    pair = (replace(first, probability=0.5), replace(second, probability=0.48, in_set=True), third)
    return replace(
        found, candidates=pair, set=("coulomb_friction", "cable_stretch"), probability_nothing=0.01,
        probability_unknown=0.01,
        next_experiment=_proposal(
            {"kind": "chirp", "amplitude_deg": 11.0, "load_torque": 0.1}, "flexion", "coulomb_friction", 17.42
        ),
    )  # fmt: skip


WritePage = Callable[..., str]


@pytest.fixture
def write_page(make_session: Callable[..., Path], tmp_path: Path) -> WritePage:
    """Writes the page of a diagnosis that is there already, of a small session, and gives its text.

    Runs of four seconds are too short for the analysis of the thesis, which saves time here.
    """

    def write(diagnosis: Diagnosis, **options: Any) -> str:
        from fingerlab.report.page import write_report
        from fingerlab.sessions import open_session

        session = open_session(make_session(**options))
        path = tmp_path / "page.html"
        assert write_report([session], path, diagnosis=diagnosis) == path
        return path.read_text(encoding="utf-8")

    return write


_PAGES: list[str] = []


@pytest.fixture
def found_page(write_page: WritePage, found: Diagnosis) -> str:
    """The page of ``found`` with all its figures, written once for all tests."""
    if not _PAGES:
        _PAGES.append(write_page(found))
    return _PAGES[0]


@pytest.fixture
def bare(found: Diagnosis) -> Diagnosis:
    """``found`` without curves, where a test is about words: figures take time."""
    return replace(found, comparisons=(), failure=None)
