"""The whole diagnosis on benches whose missing effect is a closed form: verdict, numbers, look-alikes."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis
from fingerlab.diagnosis.score.calibration import Odds
from fingerlab.effects import CATALOGUE
from fingerlab.sessions.model import Run, Session

from . import closed_form as made

Missing = made.Missing

CASES: dict[str, tuple[Missing, dict[str, float]]] = {
    "viscous_friction": (Missing(viscous=(3e-3, 2e-3)), {"viscous_mcp": 3e-3, "viscous_pip": 2e-3}),
    "spring_hardening": (Missing(cubic=(0.4, 0.25)), {"cubic_mcp": 0.4, "cubic_pip": 0.25}),
    "gravity_tilt": (Missing(tilt=0.12), {"tilt": 0.12}),
    "cable_stretch": (Missing(compliance=3e-4), {"cable_compliance": 3e-4}),
    "cable_slack": (Missing(let_out=6e-3), {}),
    "transport_delay": (Missing(delay=0.037), {"delay": 0.037}),
    "motor_coulomb_friction": (Missing(motor_coulomb=6e-3), {"coulomb": 6e-3}),
    "motor_viscous_friction": (Missing(motor_viscous=3e-3), {"viscous": 3e-3}),
    "load_cell_gain": (Missing(read_share=0.85), {"gain": 1 / 0.85 - 1}),
    "contact_compliance": (Missing(give=8e-4), {"tip_compliance": 8e-4}),
    "routing_change": (Missing(), {"arm_mcp@flexion": 0.0073, "arm_pip@flexion": 0.0036}),
}
"""What is missing -> how the bench has it, and the value of the effect's own parameters."""


def session(name: str | None) -> Session:
    bench = made.Bench(missing=CASES[name][0] if name else Missing())
    if name == "routing_change":
        bench = replace(bench, arms={**bench.arms, 1: (0.0073, 0.0036)})
    # Only a swing that lets the cable out entirely shows slack.
    whole = made.session(bench, mean=1.7 if name == "cable_slack" else 4.0)
    if name != "motor_coulomb_friction":
        return whole
    # No tangent is as steep as a sign, and a search that ends beside the floor is long: fewer of each kind.
    return replace(whole, runs=tuple(whole.runs[k] for k in (0, 1, 3, 5, 7, 8, 10)))


HEARD: list[float] = []
"""Shares of progress that the diagnosis of viscous friction told."""


@cache
def diagnosed(name: str | None) -> Diagnosis:
    if name == "viscous_friction":
        return diagnose([session(name)], progress=lambda share, what: HEARD.append(share))
    return diagnose([session(name)], with_curves=False)


def found_by(name: str) -> Candidate:
    """The candidate of the true effect."""
    return next(c for c in diagnosed(name).candidates if c.effect == name)


@pytest.mark.parametrize("name", list(CASES))
def test_the_missing_effect_comes_first(name: str) -> None:
    result = diagnosed(name)
    assert result.verdict == "missing_effect"
    assert result.candidates[0].effect == name
    assert name in result.final_model


@pytest.mark.parametrize("name", list(CASES))
def test_the_missing_effect_is_in_a_small_set_with_its_strength(name: str) -> None:
    assert name in diagnosed(name).set
    # A law that holds the true one and more leaves no more than it by construction.
    own = CATALOGUE[name].gains.keys()
    assert sum(not own < CATALOGUE[one].gains.keys() for one in diagnosed(name).set) <= 3
    for key, truth in CASES[name][1].items():
        found = found_by(name).parameters[key]
        half = 0.5 * (found.high - found.low)
        # The 90 % interval, and as much again for the one number in ten that lies outside it.
        assert abs(found.value - truth) < 2 * half, key
        assert half < 0.4 * abs(truth), key


def test_nine_in_ten_strengths_lie_in_their_intervals() -> None:
    inside = []
    for name, (_, truths) in CASES.items():
        for key, truth in truths.items():
            found = found_by(name).parameters[key]
            inside.append(found.low <= truth <= found.high)
    assert np.mean(inside) >= 0.8


@pytest.mark.parametrize("name", list(CASES))
def test_error_falls_to_the_floor_when_the_effect_is_added(name: str) -> None:
    result = diagnosed(name)
    assert [s.added for s in result.path] == [None, name]
    # A motor's friction that is a sign of its speed is steeper than the steepest tangent that is tried.
    assert result.path[1].score < (1.4 if name == "motor_coulomb_friction" else 1.2)
    assert result.path[0].score == pytest.approx(result.score, rel=0.05)


def test_a_cable_that_stiffens_is_told_with_the_tension_at_which_it_does() -> None:
    """As a straight line it left 2.9 floors on another engine; an error of the angle sensors was told."""
    bench = made.Bench(missing=Missing(compliance=1.4e-4, stiffens_at=24.5))
    result = diagnose([made.session(bench)], with_curves=False)
    assert [step.added for step in result.path] == [None, "cable_stretch"]
    assert result.path[1].score < 1.1
    assert result.set[0] == "cable_stretch"
    told = result.candidates[0].parameters
    assert told["stiffens_at"].value == pytest.approx(24.5, rel=0.3)  # a shape, looked at by half octaves
    assert told["cable_compliance"].value == pytest.approx(1.4e-4, rel=0.1)


def test_a_second_look_finds_the_edge_of_a_stop_between_the_points_of_the_grid() -> None:
    """Every 5 degrees are tried first; the stop is at -27.7, and what the grid leaves is no second effect."""
    bench = made.Bench(missing=made.Missing(stop=(np.radians(-27.7), 0.5)))
    result = diagnose([made.session(bench)], with_curves=False)
    assert [s.added for s in result.path] == [None, "joint_stop"]
    assert result.path[1].score < 1.2
    best = result.candidates[0]
    assert best.effect == "joint_stop"
    assert best.score == result.path[1].score
    assert best.parameters["edge_deg"].value == pytest.approx(-27.7, abs=1.0)
    assert best.parameters["stop_pip"].value == pytest.approx(0.5, rel=0.1)


def odds_of(result: Diagnosis) -> Odds:
    """What the evidence says, before it is set against trials."""
    assert result.odds is not None
    return result.odds


def test_where_nothing_is_missing_nothing_is_found() -> None:
    result = diagnosed(None)
    assert result.verdict == "nothing_missing"
    assert odds_of(result).nothing > 0.95
    assert result.set == ()  # a load cell that errs would not show, but put constants off their tolerances
    assert [s.added for s in result.path] == [None]
    assert result.final_model == ()
    assert result.score < 1.1


LOOSE = dict.fromkeys(
    ("proximal_mass", "distal_mass", "mcp_stiffness", "pip_stiffness", "torque_constant"), 0.1
)
"""Relative tolerances: springs, masses and torque constant may well be wrong by 5 per cent together."""


def with_a_load_cell_that_reads_too_little() -> Session:
    """By 5 per cent: no error of the model grows by that."""
    return made.session(made.Bench(missing=Missing(read_share=1 / 1.05)))


def test_what_the_misfit_does_not_tell_the_rig_s_constants_do() -> None:
    result = diagnose([with_a_load_cell_that_reads_too_little()], with_curves=False)
    assert result.verdict == "missing_effect"
    assert result.set == ("load_cell_gain",)
    before, after = (step.score for step in result.path)
    assert before == pytest.approx(after, abs=0.01)
    share = result.candidates[0].parameters["gain"]
    assert share.low < 0.05 < share.high
    assert share.value == pytest.approx(0.05, abs=0.02)


def test_what_could_not_show_is_told_and_keeps_its_share() -> None:
    """With the effect there, and constants that may well be so far off, the answer says both itself."""
    session = with_a_load_cell_that_reads_too_little()
    rig = replace(session.rig, tolerance={**session.rig.tolerance, **LOOSE})
    result = diagnose([replace(session, rig=rig)], with_curves=False)
    assert result.verdict == "nothing_missing"
    assert "load_cell_gain" in result.set
    found = result.candidates[0]
    assert found.effect == "load_cell_gain"
    assert found.in_set
    assert not found.detectable
    # One of all the effects against nothing, 0.45 to 0.5 before anything was seen, and hardly more was.
    odds = odds_of(result)
    told = odds.hidden[odds.effects.index("load_cell_gain")]
    assert told == pytest.approx(0.45 / len(CATALOGUE) / 0.5 * odds.nothing, rel=0.6)
    assert "could not show" in found.explanation


def test_what_could_have_shown_is_not_thought_to_be_there() -> None:
    odds = odds_of(diagnosed(None))
    told = dict(zip(odds.effects, odds.found + odds.hidden, strict=True))
    for candidate in diagnosed(None).candidates:
        if candidate.detectable:
            assert told[candidate.effect] < 2e-3, candidate.effect


def test_a_group_of_two_runs_raises_no_alarm() -> None:
    result = diagnose([made.session(made.Bench(), 1, contact=2)], with_curves=False)
    assert result.verdict == "nothing_missing"


def test_an_effect_that_is_added_is_no_longer_missing() -> None:
    name = "cable_stretch"
    result = diagnose([session(name)], [name], with_curves=False)
    assert result.model == (name,)
    assert result.score < 1.2
    assert result.score < 0.4 * diagnosed(name).score
    assert result.verdict == "nothing_missing"
    assert name not in {c.effect for c in result.candidates}


@pytest.mark.parametrize(("name", "seed", "contact"), [("viscous_friction", 2, 2)])
def test_no_decoy_explains_what_an_absent_effect_would(name: str, seed: int, contact: int) -> None:
    """The true mechanism taken out of the catalogue: what is left does not bring the error down."""
    given = made.session(made.Bench(missing=CASES[name][0]), seed, contact)
    result = diagnose([given], with_curves=False, options=DiagnosisOptions(left_out=[name]))
    assert name not in {c.effect for c in result.candidates}
    assert result.score > 5
    assert min(c.score for c in result.candidates) > 2.5
    assert min(s.score for s in result.path) > 1.5


def test_a_torque_of_no_known_mechanism_is_not_in_the_catalogue() -> None:
    result = diagnose([made.session(made.Bench(missing=Missing(strange=4e-3)))], with_curves=False)
    assert result.verdict == "not_in_catalogue"
    assert result.set == ()
    assert odds_of(result).unknown > 0.9
    assert min(c.score for c in result.candidates) > 2


def test_verdict_does_not_depend_on_the_order_of_runs_the_clock_or_the_file() -> None:
    """Runs turned round, dealt to two files, and time counted from ten minutes."""
    given = session("viscous_friction")
    turned = tuple(late(run, 600.0) for run in reversed(given.runs))
    halves = [replace(given, runs=turned[:6]), replace(given, runs=turned[6:])]
    before, after = diagnosed("viscous_friction"), diagnose(halves, with_curves=False)
    assert len(after.sessions) == 2
    assert after.verdict == before.verdict
    assert after.set == before.set
    assert [s.added for s in after.path] == [s.added for s in before.path]
    assert after.score == pytest.approx(before.score, rel=0.01)
    first, second = before.candidates[0].parameters, after.candidates[0].parameters
    for key, found in first.items():
        assert second[key].value == pytest.approx(found.value, rel=0.01)


def late(run: Run, seconds: float) -> Run:
    channels = run.load()
    channels["time"] = channels["time"] + seconds
    return Run.from_arrays(
        channels, name=run.name, phase=run.phase, cable=run.cable, sample_rate_hz=run.sample_rate_hz,
        trajectory=run.trajectory,
    )  # fmt: skip


def test_answer_is_whole() -> None:
    """The JSON of the command line contract, field by field."""
    data = json.loads(json.dumps(diagnosed("viscous_friction").to_json(), allow_nan=False))
    assert data["schema"] == 1
    assert data["sessions"] == ["closed-form.h5"]
    assert data["model"] == []
    units = {"joint_torque": "N m", "cable_kinematics": "m", "motor_torque": "N m", "endpoint_force": "N"}
    assert {name: e["unit"] for name, e in data["errors"].items()} == units
    for error in data["errors"].values():
        assert set(error) == {"unit", "rmse", "r2", "floor"}
        assert error["rmse"] >= 0.9 * error["floor"] > 0
        assert error["r2"] <= 1
    total = sum(c["probability"] for c in data["candidates"])
    total += data["probability_nothing_missing"] + data["probability_not_in_catalogue"]
    assert total == pytest.approx(1.0)
    assert {c["effect"] for c in data["candidates"]} == set(CATALOGUE)
    for c in data["candidates"]:
        assert {"effect", "score", "probability", "in_set", "parameters", "equations", "explanation",
                "detectable"} <= set(c)  # fmt: skip
        assert c["in_set"] == (c["effect"] in data["set"])
        assert c["explanation"].count(".") >= 1
        for p in c["parameters"].values():
            assert set(p) == {"value", "unit", "low", "high"}
            assert p["low"] <= p["value"] <= p["high"]
            assert p["unit"]
    probabilities = [c["probability"] for c in data["candidates"]]
    assert probabilities == sorted(probabilities, reverse=True)
    assert data["path"][0]["added"] is None
    assert data["final_model"] == [s["added"] for s in data["path"][1:]]
    assert data["seconds"] > 0
    assert "next_experiment" in data


def test_a_proposed_experiment_is_one_the_rig_can_run() -> None:
    from fingerlab.acquisition.control.trajectories import read_trajectory

    proposals = [r.next_experiment for r in map(diagnosed, CASES) if r.next_experiment is not None]
    for proposal in proposals:
        assert read_trajectory({**proposal["trajectory"], "duration_s": 5.0}).duration == 5.0
        assert proposal["phase"] in ("on_air", "contact", "motor_bench")
        assert len(proposal["separates"]) == 2
        assert proposal["expected_separation"] > 0


def test_progress_never_goes_back() -> None:
    diagnosed("viscous_friction")
    assert sorted(HEARD) == HEARD


def test_progress_goes_from_none_to_nearly_all() -> None:
    diagnosed("viscous_friction")
    assert HEARD[0] < 0.1
    assert 0.7 < max(HEARD) <= 1.0
    assert len(HEARD) > 30


@pytest.mark.parametrize("calls", [0, 3, 14])
def test_stop_is_heard(calls: int) -> None:
    """Before the first run, among the runs, and among the effects."""
    asked = iter(range(10**6))
    with pytest.raises(Cancelled):
        diagnose([session(None)], cancelled=lambda: next(asked) >= calls, with_curves=False)


def test_what_cannot_be_diagnosed_is_told() -> None:
    with pytest.raises(UserError, match="No session"):
        diagnose([])
    with pytest.raises(UserError, match="no effect 'glue'"):
        diagnose([session(None)], ["glue"])
    with pytest.raises(UserError, match="nothing to compare"):
        diagnose([replace(session(None), runs=())])


def test_time_course_of_the_answer_is_shown_where_it_is_wanted() -> None:
    """Curves and fingerprint of the true effect: its slope over joint speed is the viscous coefficient."""
    result = diagnosed("viscous_friction")
    best = result.candidates[0]
    assert best.fingerprint is not None
    assert best.fingerprint.coordinate == "joint speed"
    slope = np.polyfit(best.fingerprint.centre, best.fingerprint.curve, 1)[0]
    assert abs(slope) == pytest.approx(2e-3, rel=0.35)  # of the PIP joint; nuisances take some of it
    prints = {c.effect: c.fingerprint for c in result.candidates}
    assert None not in prints.values()  # whichever effect a person chooses, it is seen in the data
    rival = prints["coulomb_friction"]
    assert rival is not None
    np.testing.assert_allclose(rival.mean, best.fingerprint.mean)  # the same residual, another curve
    assert np.ptp(rival.curve - best.fingerprint.curve) > 0.2 * np.ptp(rival.curve)
    equations = {c.equation for c in result.comparisons}
    assert {"mcp_torque", "pip_torque", "cable_kinematics", "endpoint_force_pip"} <= equations
    for c in result.comparisons:
        assert c.time.shape == c.measured.shape == c.modelled.shape
        assert c.floor > 0
    assert result.failure is not None
    assert result.failure.stop > result.failure.start
