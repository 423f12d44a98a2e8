"""What other programs rely on, written down from the contract and not from the program."""

from __future__ import annotations

import json
import math
import shutil
from collections import defaultdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fingerlab.diagnosis.answer.results import BenchFinding

from .calling import assert_one_sentence, call

OPTIONS = {
    "simulate": ("--protocol", "--effect", "--hidden", "--seed", "--out"),
    "reveal": (),
    "info": (),
    "import": ("--map", "--axis", "--out"),
    "export": ("--to", "--out"),
    "calibrate": ("--sensor",),
    "fit": ("--method", "--delay"),
    "predict": ("--model",),
    "diagnose": ("--add",),
    "replicate": (),
    "report": ("--out",),
    "batch": ("--out", "--dask"),
    "record": ("--protocol", "--device", "--out"),
}
VALUES = {
    ("simulate", "--protocol"): ("on-air", "contact", "motor-bench", "thesis", "rich"),
    ("export", "--to"): ("csv", "mat", "parquet", "txt"),
    ("calibrate", "--sensor"): ("load-cell", "mcp", "pip"),
    ("fit", "--method"): ("regions", "flexion-extension", "whole"),
    ("fit", "--delay"): ("none", "xcorr", "findsignal"),
}
FAMILIES = {"joint_torque": "N m", "cable_kinematics": "m", "motor_torque": "N m", "endpoint_force": "N"}
WHY = {"slack", "standstill", "ramp", "outliers", "gap"}
FINDINGS = (
    "sensor_zero", "amplifier_offset", "outliers", "gaps", "skew", "unit", "sense", "dead_channel",
)  # fmt: skip
SECONDS, RATE, SPIKES, SHORT_GAP, LONG_GAP = 10.0, 1000, 12, 5, 400


@pytest.mark.parametrize("command", OPTIONS)
def test_every_command_has_its_options_help_and_json_and_refuses_in_one_sentence(command: str) -> None:
    code, out, err = call(command, "--help")
    assert (code, err) == (0, "")
    words = out.replace("|", " ").replace("[", " ").replace("]", " ").split()
    assert {*OPTIONS[command], "--json"} <= set(words)
    for (name, _), values in VALUES.items():
        if name == command:
            assert set(values) <= set(words)
    assert_one_sentence(*call(command, "--gremlins"), "gremlins")
    assert_one_sentence(*call(command, *_nowhere(command)), "nowhere")


def _nowhere(command: str) -> tuple[str, ...]:
    """Arguments of which one is at fault, and holds the word."""
    return {
        "simulate": ("--protocol", "nowhere", "--out", "s.h5"),
        "import": ("nowhere.txt", "--out", "s.h5"),
        "export": ("nowhere.h5", "--to", "csv", "--out", "out"),
        "calibrate": ("nowhere.txt", "--sensor", "mcp"),
        "predict": ("nowhere.h5", "--model", "nowhere.json"),
        "replicate": ("--preset", "nowhere.toml"),
        "report": ("nowhere.h5", "--out", "r.html"),
        "batch": ("nowhere", "--out", "t.parquet"),
        "record": ("--protocol", "nowhere", "--out", "s.h5"),
    }.get(command, ("nowhere.h5",))


def is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def check_answer(told: dict[str, Any]) -> None:
    """All that holds of every answer of ``diagnose --json``."""
    assert told["schema"] == 1
    for name, error in told["errors"].items():
        assert error["unit"] == FAMILIES[name]
        assert all(is_number(error[key]) for key in ("rmse", "r2", "floor"))
    for name, budget in told.get("budget", {}).items():
        left, floor = budget["mean_square"], told["errors"][name]["floor"]
        left -= sum(part["mean_square"] for part in budget["parts"] if part["kind"] == "effect")
        (part,) = (one["mean_square"] for one in budget["parts"] if one["kind"] == "floor")
        assert part == pytest.approx(min(floor**2, left), rel=1e-9)  # the same floor in table and budget
    if told["smaller_model"] is not None:
        assert told["verdict"] == "nothing_missing"
        assert set(told["smaller_model"]["remove"]) <= set(told["model"])
        assert is_number(told["smaller_model"]["score"])
    assert told["floor_from"] in ("cycles", "runs", "state law")
    assert told["score_parts"]
    for part in told["score_parts"]:
        assert part["equation"] in FAMILIES
        assert isinstance(part["run"], str)
        assert part["share"] >= 0.0
        assert {"session", "phase", "cable", "samples", "left_aside", "squared"} <= set(part)
    assert sum(part["share"] for part in told["score_parts"]) == pytest.approx(told["score"] ** 2, rel=1e-9)
    for one in told["left_aside"]:
        assert isinstance(one["run"], str)
        assert one["why"] in WHY
        assert 0.0 < one["share"] <= 1.0
    for finding in told["bench"]:
        check_finding(finding)
    assert 0.0 <= told["typical"] <= 1.0
    assert isinstance(told["calibration"]["version"], str)
    assert 0.9 < told["calibration"]["coverage"] <= 1.0
    check_better(told["better_model"], told["path"])
    for candidate in told["candidates"]:
        assert candidate["in_set"] == (candidate["effect"] in told["set"])
        if "at_bound" in candidate:
            assert candidate["at_bound"] is True
            assert candidate["in_set"]
        for value in candidate["parameters"].values():
            assert isinstance(value["unit"], str)
            assert value["low"] <= value["value"] <= value["high"]
    whole = sum(one["probability"] for one in told["candidates"])
    others = told["probability_nothing_missing"] + told["probability_not_in_catalogue"]
    assert whole + others == pytest.approx(1.0)


def check_better(better: dict[str, Any] | None, path: list[dict[str, Any]]) -> None:
    assert path[0]["added"] is None
    assert all(isinstance(step["added"], str) and is_number(step["score"]) for step in path[1:])
    removed = [step["removed"] for step in path if "removed" in step]
    if better is None:
        assert not removed
    else:
        assert removed == better["remove"]
        assert better["add"][0] == path[1]["added"]
        assert is_number(better["score"])


def check_finding(finding: dict[str, Any]) -> None:
    assert finding["finding"] in FINDINGS
    assert isinstance(finding["channel"], str)
    assert is_number(finding["size"]["value"])
    assert isinstance(finding["size"]["unit"], str)
    for text in (finding["sentence"], finding["advice"]):
        assert not text[0].islower()
        assert text.endswith(".")


def test_an_answer_is_as_the_contract_says(answer: dict[str, Any]) -> None:
    check_answer(answer)
    assert answer["floor_from"] == "cycles"
    # Five runs, and each of them in every equation that it has.
    families = defaultdict(set)
    for part in answer["score_parts"]:
        families[part["run"]].add(part["equation"])
    free = {"joint_torque", "cable_kinematics"}
    assert sorted(families) == ["001", "002", "003", "004", "005"]
    assert all(families[run] == free for run in ("001", "002", "003", "004"))
    assert families["005"] == {*free, "endpoint_force"}
    assert len(answer["score_parts"]) == sum(map(len, families.values()))
    # Friction is seen where the joints are free, not in the cable's length.
    worst = max(answer["score_parts"], key=lambda part: part["share"])
    assert worst["equation"] == "joint_torque"


@pytest.fixture(scope="module")
def dirty(session_file: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The answer to two of its runs; the second with spikes, a short gap and a long one."""
    path = tmp_path_factory.mktemp("dirty") / "dirty.h5"
    shutil.copy(session_file, path)
    with h5py.File(path, "r+") as file:
        for name in ("003", "004", "005"):
            del file["runs"][name]
        run = file["runs/002"]
        whole = np.arange(len(run["time"]))
        assert len(whole) == SECONDS * RATE
        lost = [*range(3000, 3000 + SHORT_GAP), *range(9500, 9500 + LONG_GAP)]
        kept = np.delete(whole, lost)
        channels = {key: (data[:], dict(data.attrs)) for key, data in run.items() if data.ndim == 1}
        values = channels["pip_angle"][0]
        values[np.linspace(4000, 9000, SPIKES).astype(int)] += 0.5
        for key, (samples, attributes) in channels.items():
            del run[key]
            made = run.create_dataset(key, data=samples[kept])
            made.attrs["units"] = attributes["units"]
        run["time"].make_scale("time")
        for key in channels:
            if key != "time":
                run[key].dims[0].attach_scale(run["time"])
    code, out, err = call("diagnose", path, "--json", "-")
    assert code == 0, err
    told: dict[str, Any] = json.loads(out)
    return told


def test_what_a_run_lost_is_told_of_that_run(dirty: dict[str, Any]) -> None:
    check_answer(dirty)
    aside = {(one["run"], one["why"]): one["share"] for one in dirty["left_aside"]}
    assert aside["002", "gap"] == pytest.approx((SHORT_GAP + LONG_GAP) / (SECONDS * RATE))
    assert aside["002", "outliers"] == pytest.approx(SPIKES / (SECONDS * RATE))
    assert ("001", "gap") not in aside
    assert ("001", "outliers") not in aside
    # What is left behind the long gap is too short to be analysed.
    assert aside["002", "ramp"] + LONG_GAP / (SECONDS * RATE) > aside["001", "ramp"]
    found = {one["finding"]: one for one in dirty["bench"]}
    assert found["outliers"]["channel"] == "pip_angle"
    assert found["outliers"]["size"] == {"value": SPIKES, "unit": "samples"}
    gaps = [one["size"]["value"] for one in dirty["bench"] if one["finding"] == "gaps"]
    assert gaps == [SHORT_GAP, LONG_GAP]


@pytest.mark.parametrize(
    ("kind", "channel", "name"),
    [
        ("moving_zero", "pip_angle", "sensor_zero"),
        ("moving_zero", "motor_torque", "amplifier_offset"),
        ("spikes", "mcp_angle", "outliers"),
        ("lost_samples", "time", "gaps"),
        ("held", "motor_position", "gaps"),
        ("uneven_times", "time", "gaps"),
        ("skew", "mcp_angle", "skew"),
        ("turned", "motor_torque", "sense"),
        ("missing_channel", "pip_angle", "dead_channel"),
    ],
)
def test_findings_have_the_names_of_the_contract(kind: str, channel: str, name: str) -> None:
    told = BenchFinding(kind, channel, 0.25, "rad", ("001",), "It moves", "clamp it").to_json()
    check_finding(told)
    assert (told["finding"], told["channel"]) == (name, channel)
    assert told["size"] == {"value": 0.25, "unit": "rad"}
    assert (told["sentence"], told["advice"]) == ("It moves.", "Clamp it.")
