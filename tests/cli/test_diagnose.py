"""``fingerlab diagnose`` as a user calls it: JSON as the contract says, a table that fits, and refusals."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from .calling import call

CONTRACT_EFFECTS = [
    "viscous_friction",
    "coulomb_friction",
    "stribeck_friction",
    "presliding_hysteresis",
    "spring_hardening",
    "stiffness_error",
    "joint_coupling",
    "viscoelastic_creep",
    "joint_stop",
    "gravity_tilt",
    "added_mass",
    "distal_rotation",
    "varying_moment_arm",
    "capstan_friction",
    "cable_slack",
    "cable_stretch",
    "backlash",
    "motor_coulomb_friction",
    "motor_viscous_friction",
    "motor_inertia",
    "motor_stribeck_friction",
    "motor_presliding",
    "asymmetric_friction",
    "load_dependent_friction",
    "motor_spring",
    "torque_ripple",
    "transport_delay",
    "angle_sensor_nonlinearity",
    "sensor_drift",
    "load_cell_gain",
    "contact_angle",
    "contact_compliance",
    "routing_change",
]
"""The ids of the catalogue, copied from the contract."""

FIRST_EFFECTS = {
    "viscous_friction",
    "coulomb_friction",
    "motor_coulomb_friction",
    "cable_slack",
    "cable_stretch",
    "spring_hardening",
    "transport_delay",
    "contact_angle",
}
CANDIDATE_KEYS = (
    "effect",
    "score",
    "probability",
    "in_set",
    "parameters",
    "equations",
    "explanation",
    "detectable",
)
FAMILY_UNITS = {"joint_torque": "N m", "cable_kinematics": "m", "motor_torque": "N m", "endpoint_force": "N"}


def is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def test_every_key_of_the_contract_is_there(answer: dict[str, Any], session_file: Path) -> None:
    assert answer["schema"] == 1
    assert answer["sessions"] == [str(session_file)]
    assert answer["model"] == []
    assert is_number(answer["score"])
    assert is_number(answer["seconds"])
    assert answer["verdict"] in ("nothing_missing", "missing_effect", "not_in_catalogue")
    assert set(answer) >= {
        "errors", "candidates", "set", "path", "final_model", "next_experiment",
    }  # fmt: skip


def test_errors_have_unit_error_fit_and_floor(answer: dict[str, Any]) -> None:
    assert {name: error["unit"] for name, error in answer["errors"].items()} == FAMILY_UNITS
    for error in answer["errors"].values():
        assert set(error) == {"unit", "rmse", "r2", "floor"}
        assert all(is_number(error[key]) for key in ("rmse", "r2", "floor"))
        assert error["rmse"] > 0
        assert error["floor"] > 0
        assert error["r2"] <= 1


def test_candidates_are_complete_and_the_best_comes_first(answer: dict[str, Any]) -> None:
    effects = [c["effect"] for c in answer["candidates"]]
    assert len(set(effects)) == len(effects)
    assert set(CONTRACT_EFFECTS) >= set(effects) >= FIRST_EFFECTS
    for candidate in answer["candidates"]:
        assert set(candidate) == set(CANDIDATE_KEYS)
        assert is_number(candidate["score"])
        assert 0 <= candidate["probability"] <= 1
        assert isinstance(candidate["in_set"], bool)
        assert isinstance(candidate["detectable"], bool)
        assert len(candidate["explanation"]) > 20
        assert candidate["equations"]
        assert set(candidate["equations"]) <= set(FAMILY_UNITS)
        for parameter in candidate["parameters"].values():
            assert set(parameter) == {"value", "unit", "low", "high"}
            assert all(is_number(parameter[key]) for key in ("value", "low", "high"))
            assert parameter["low"] <= parameter["value"] <= parameter["high"]
    shares = [c["probability"] for c in answer["candidates"]]
    assert shares == sorted(shares, reverse=True)


def test_what_each_effect_leaves_is_told_of_a_fit_to_the_end(
    answer: dict[str, Any], session_file: Path
) -> None:
    """A model with one effect more can do as well as that without, and about as ``--add`` says.

    Judged by the first step of a fit alone, friction of the joints was told to leave ten times as much.
    """
    scores = {c["effect"]: c["score"] for c in answer["candidates"]}
    assert max(scores.values()) < 1.05 * answer["score"]
    code, out, err = call("diagnose", session_file, "--add", "viscous_friction", "--json", "-")
    assert code == 0, err
    # The floors are those of two last models; what a first step leaves is far beyond that.
    assert scores["viscous_friction"] == pytest.approx(json.loads(out)["score"], rel=0.2)


def test_probabilities_sum_to_one_with_the_two_other_verdicts(answer: dict[str, Any]) -> None:
    others = answer["probability_nothing_missing"] + answer["probability_not_in_catalogue"]
    assert sum(c["probability"] for c in answer["candidates"]) + others == pytest.approx(1.0, abs=1e-9)


def test_set_and_path_belong_to_the_candidates(answer: dict[str, Any]) -> None:
    marked = {c["effect"]: c for c in answer["candidates"] if c["in_set"]}
    assert set(answer["set"]) == set(marked)
    assert answer["path"][0] == {"added": None, "score": pytest.approx(answer["score"], rel=1e-3)}
    assert [step["added"] for step in answer["path"][1:]] == answer["final_model"]
    scores = [step["score"] for step in answer["path"]]
    assert scores == sorted(scores, reverse=True)


def test_the_effect_that_the_rig_has_is_found(answer: dict[str, Any]) -> None:
    assert answer["verdict"] == "missing_effect"
    assert answer["candidates"][0]["effect"] == "coulomb_friction"
    assert "coulomb_friction" in answer["set"]
    assert answer["candidates"][0]["score"] < 0.5 * answer["score"]


def test_added_effects_leave_the_candidates_and_the_table_fits_a_terminal(
    session_file: Path, answer: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fingerlab.cli.common.TABLE_WIDTH", 80)
    target = tmp_path / "out.json"
    code, out, _ = call("diagnose", session_file, "--add", "coulomb_friction", "--json", target)
    assert code == 0
    told = json.loads(target.read_text(encoding="utf-8"))
    assert told["model"] == ["coulomb_friction"]
    assert "coulomb_friction" not in [c["effect"] for c in told["candidates"]]
    assert told["score"] < 0.5 * answer["score"]
    assert told["score"] == pytest.approx(answer["candidates"][0]["score"], rel=0.1)
    assert max(len(line) for line in out.splitlines()) <= 80
    for row in ("Joint torque", "Cable length", "Motor torque", "Endpoint force", "Nothing missing"):
        assert sum(line.count(row) for line in out.splitlines()) == 1, row
    assert "the nominal model with Coulomb joint friction" in " ".join(out.split())
    assert told["candidates"][0]["effect"] in out


def refused(*arguments: object) -> str:
    """The sentence with which a command is refused: exit 2, nothing on standard output."""
    code, out, err = call(*arguments)
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    return err


def test_an_unknown_effect_is_refused_with_the_catalogue(session_file: Path) -> None:
    sentence = refused("diagnose", session_file, "--add", "gremlins")
    assert "no effect 'gremlins'" in sentence
    assert "coulomb_friction" in sentence


def test_a_missing_file_and_no_file_are_refused(tmp_path: Path) -> None:
    assert "nowhere.h5" in refused("diagnose", tmp_path / "nowhere.h5")
    assert "S.h5" in refused("diagnose")


def test_a_json_file_that_is_there_stays(session_file: Path, tmp_path: Path) -> None:
    target = tmp_path / "mine.json"
    target.write_text("mine", encoding="utf-8")
    assert "not overwritten" in refused("diagnose", session_file, "--json", target)
    assert target.read_text(encoding="utf-8") == "mine"
