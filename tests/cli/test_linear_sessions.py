"""A session of a linear axis on the terminal: told in mm, N and kg, while file and JSON stay the arc's."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from fingerlab.sessions import open_session
from tests.cli.calling import call
from tests.stage import FRICTION, LOAD, RATE, SECONDS, STROKE, stage_session

MASS, OFFSET = 12.0, 3.0
"""kg and N."""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return stage_session(tmp_path_factory.mktemp("stage"))


def test_info_tells_the_motion_in_mm_and_what_the_file_holds(stage: Path) -> None:
    code, out, err = call("info", stage)
    assert code == 0, err
    text = " ".join(out.split())
    assert "sine, 10 mm, 0.5 Hz" in text
    assert "°" not in text
    assert "motor_position (position), motor_torque (force), load_torque (load)" in text
    assert "an arc of 10 mm: 1 N m is 100 N and 1 deg is 0.175 mm. The file" in text
    code, out, _ = call("info", stage, "--json", "-")
    run = json.loads(out)["runs"][0]
    assert run["trajectory"]["amplitude_deg"] == pytest.approx(np.degrees(1.0), rel=1e-3)
    # The file is as it was: 10 mm on an arc of 10 mm are 1 rad, 5 N are 0.05 N m.
    one = open_session(stage).runs[0]
    assert np.abs(one.channel("motor_position")).max() == pytest.approx(STROKE / 10.0, abs=1e-4)
    assert one.channel("load_torque") == pytest.approx(LOAD / 100.0)


def test_info_gives_the_mass_and_what_an_ampere_pushes(tmp_path: Path) -> None:
    """An inertia of 1.2e-3 kg m2 about 10 mm is a mass of 12 kg."""
    time = np.arange(round(SECONDS * RATE)) / RATE
    table = np.stack((time, STROKE * np.sin(3.0 * time), np.cos(3.0 * time)), axis=1)
    log, rig, target = tmp_path / "i.csv", tmp_path / "rig.toml", tmp_path / "i.h5"
    np.savetxt(log, table, "%.6f", ",", header="time (s),position (mm),current (A)", comments="")
    rig.write_text("[motor]\ninertia = { value = 1.2e-3, unit = 'kg m^2' }\n")
    code, _, err = call("import", "--axis", log, "--rig", rig, "--torque-constant", 38, "--out", target)
    assert code == 0, err
    rows = [re.findall(r"[^│\s][^│]*[^│\s]|[^│\s]", line) for line in call("info", target)[1].splitlines()]
    told = {row[0]: row[1:3] for row in rows if len(row) == 5}
    assert told["mass"] == ["12", "kg"]
    assert told["force constant"] == ["38", "N/A"]
    assert not {"inertia", "torque constant", "gear ratio"} & set(told)
    assert json.loads(call("info", target, "--json", "-")[1])["rig"]["motor"]["inertia"] == 1.2e-3


def test_the_plan_of_an_import_names_the_sine_in_mm(stage: Path, tmp_path: Path) -> None:
    log = stage.with_name("stage0.csv")
    _, _, err = call("import", "--axis", log, "--dry-run")
    assert "trajectory <- sine, 10 mm, 0.5 Hz (read from motor_command)" in err


def test_the_fit_of_a_stage_is_a_mass_and_a_force(tmp_path: Path) -> None:
    time = np.arange(round(SECONDS * RATE)) / RATE
    files = []
    for run, (rate, load) in enumerate(((3.0, 0.0), (5.0, 20.0), (4.0, -10.0))):
        x = STROKE * np.sin(rate * time)
        force = MASS * -(rate**2) * x / 1e3 + load + OFFSET
        files.append(tmp_path / f"{run}.csv")
        table = np.stack((time, x, force, np.full(len(time), load)), axis=1)
        np.savetxt(files[-1], table, "%.8f", ",", header="time (s),position (mm),force (N),load (N)")
    mapping = "time=1:s,position=2:mm,torque=3:N,load=4:N"
    target = tmp_path / "m.h5"
    code, _, err = call("import", "--axis", *files, "--map", mapping, "--out", target)
    assert code == 0, err
    code, out, err = call("fit", target)
    assert code == 0, err
    for name, value, unit in (("mass", MASS, "kg"), ("offset", OFFSET, "N")):
        row = re.search(rf"{name}\s*│\s*([\d.]+)(?: ± [\d.]+)? ?(\S*)", out)
        assert row is not None, out
        assert float(row[1]) == pytest.approx(value, rel=0.01)
        assert row[2] == unit
    assert "force = m * acceleration + gain * load + offset" in out
    assert "N m" not in out
    inertia = json.loads(call("fit", target, "--json", "-")[1])["parameters"]["inertia"]
    assert inertia["value"] == pytest.approx(MASS * 0.01**2, rel=0.01)


def test_two_sessions_are_compared_in_newtons(stage: Path, tmp_path: Path) -> None:
    other = stage_session(tmp_path, "other", more=2.0)
    out = call("compare", stage, "--beside", other)[1]
    assert re.search(r"Position \(mm\)\s*[┃|]\s*Force \(N\)\s*[┃|]\s*Load \(N\)", out)
    force = re.search(r"001 – 001\s*│motor bench, sine, 10 mm, 0.5 Hz\s*│[^│]*│\s*([\d.]+)", out)
    assert force is not None, out
    assert float(force[1]) == pytest.approx(2.0, abs=0.05)


def test_models_of_a_stage_are_compared_in_newtons(stage: Path, tmp_path: Path) -> None:
    """The friction that the nominal model lacks is one of 15 N."""
    model = tmp_path / "m.json"
    code, _, err = call("diagnose", stage, "--add", "motor_coulomb_friction", "--save", model)
    assert code == 0, err
    code, out, err = call("compare", stage, "--model", model)
    assert code == 0, err
    text = " ".join(out.split())
    assert "Motor force (N)" in text
    assert "N m" not in text
    rows = re.findall(r"(nominal model|m\.json) *│ *([\d.]+) *│$", out, re.MULTILINE)
    errors = {name: float(error) for name, error in rows}
    assert errors["nominal model"] == pytest.approx(FRICTION, rel=0.2)
    assert errors["m.json"] < 0.1 * FRICTION
