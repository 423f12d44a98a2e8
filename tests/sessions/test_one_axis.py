"""Logs of one axis of any machine, as text and as MAT files, become motor-bench runs in SI."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from fingerlab.sessions import check_session, open_session
from fingerlab.sessions.exporting import export_session
from fingerlab.sessions.importing import unwrapped
from tests.cli.calling import run_main

RATE = 500.0
TIME = np.arange(4000) / RATE
TURN = 0.6 * np.sin(2 * np.pi * 0.5 * TIME)
"""Position of the axis, rad."""
TORQUE = 3.0 * TURN + 1.5 * np.sign(np.cos(2 * np.pi * 0.5 * TIME))
"""A spring of 3 N m/rad and friction of 1.5 N m."""


def written(path: Path, header: str, *columns: np.ndarray, delimiter: str = ",") -> Path:
    np.savetxt(path, np.stack(columns, axis=1), "%.9f", delimiter=delimiter, header=header, comments="")
    return path


def imported(capsys, path: Path, *options: object):
    target = path.with_suffix(".h5")
    code, _, err = run_main(["import", path, "--axis", *options, "--out", target], capsys)
    assert code == 0, err
    session = open_session(target)
    assert check_session(session).errors == ()
    return session


def refused(capsys, path: Path, *options: object) -> str:
    code, out, err = run_main(["import", path, "--axis", *options, "--out", path.with_suffix(".h5")], capsys)
    assert (code, out) == (2, "")
    assert not path.with_suffix(".h5").exists()
    return err.strip().splitlines()[-1]


def test_a_csv_with_units_in_its_header_needs_no_mapping(tmp_path, capsys):
    header = "t (ms),q [deg],tau_measured (mNm),external load (N cm),temperature (degC)"
    path = written(tmp_path / "log.csv", header, 1000 * TIME + 5e5, np.degrees(TURN), 1000 * TORQUE,
                   100 * TORQUE, 20 + TIME)  # fmt: skip
    session = imported(capsys, path)
    (run,) = session.runs
    assert (run.phase, run.cable, run.sample_rate_hz) == ("motor_bench", "none", RATE)
    assert session.rig.finger is None
    np.testing.assert_allclose(run.channel("time"), TIME, atol=1e-9)  # counted from the first sample
    np.testing.assert_allclose(run.channel("motor_position"), TURN, atol=1e-9)
    np.testing.assert_allclose(run.channel("motor_torque"), TORQUE, atol=1e-9)
    np.testing.assert_allclose(run.channel("load_torque"), TORQUE, atol=1e-9)
    assert run.units["temperature"] == "degC"
    assert not run.has("motor_current")  # what a current would give is not known


def test_units_behind_the_names_need_no_mapping_either(tmp_path, capsys):
    """``m`` is no unit there: a motor's angle would be a length. Files that are alike are told in a word."""
    header = "t_ms,theta_m_deg,tau_Ncm"
    files = [
        written(tmp_path / f"{k}.csv", header, 1000 * TIME, np.degrees(TURN), 100 * TORQUE) for k in (1, 2, 3)
    ]
    code, _, err = run_main(["import", "--axis", *files, "--out", tmp_path / "a.h5"], capsys)
    assert code == 0
    assert [line.endswith("csv: as the one before it") for line in err.splitlines()].count(True) == 2
    assert err.count("motor_torque") == 1
    run = open_session(tmp_path / "a.h5").runs[2]
    np.testing.assert_allclose(run.channel("motor_position"), TURN, atol=1e-9)
    np.testing.assert_allclose(run.channel("motor_torque"), TORQUE, atol=1e-9)
    bare = written(tmp_path / "b.csv", "t_ms,theta_m,tau_Ncm", TIME, TURN, TORQUE)
    assert "names no unit of 'motor_position' (column 2)" in refused(capsys, bare)


def test_two_commands_to_a_verdict(tmp_path, capsys):
    """Friction of 0.04 N m on a rotor of 2e-4 kg m^2: four runs of 3 s, told by name after two commands."""
    rng = np.random.default_rng(4)
    files = []
    for number, frequency in enumerate((0.8, 1.0, 1.3, 1.7)):
        time = np.arange(1800) / 300.0
        angle = 0.5 * np.sin(2 * np.pi * frequency * time)
        speed = np.gradient(angle, time)
        torque = 2e-4 * np.gradient(speed, time) + 0.04 * np.tanh(speed / 0.02)
        noisy = torque + rng.normal(0.0, 5e-4, len(time))
        name = tmp_path / f"{number}.csv"
        files.append(written(name, "time (s),position (rad),torque (Nm)", time, angle, noisy))
    assert run_main(["import", *files, "--axis", "--out", tmp_path / "axis.h5"], capsys)[0] == 0
    code, out, _ = run_main(["diagnose", tmp_path / "axis.h5", "--json", "-"], capsys)
    found = json.loads(out)
    assert (code, found["verdict"]) == (0, "missing_effect")
    (friction,) = [c for c in found["candidates"] if c["effect"] == "motor_coulomb_friction"]
    assert friction["in_set"]
    assert friction["parameters"]["coulomb"]["value"] == pytest.approx(0.04, rel=0.03)


@pytest.mark.parametrize("known", ["torque", "current", "both"])
def test_a_zero_that_moves_is_told_in_mA_where_the_torque_came_from_a_current(tmp_path, capsys, known):
    """Offsets of 0.9 N m and less on an axis of 7 N m; at 2.5 N m/A they are up to 360 mA."""
    rng = np.random.default_rng(8)
    files = []
    for number, offset in enumerate((0.9, -0.8, 0.3, -0.4)):
        time = np.arange(2400) / 300.0
        angle = 0.5 * np.sin(2 * np.pi * time)
        speed = np.pi * np.cos(2 * np.pi * time)
        torque = 0.2 * np.gradient(speed, time) + 2.0 * np.tanh(speed / 0.02) + offset
        noisy = torque + rng.normal(0.0, 0.02, len(time))
        other = time if known == "torque" else noisy / 2.5
        files.append(written(tmp_path / f"{number}.csv", "t,q,tau,i", time, angle, noisy, other))
    channels = {"torque": "torque=3:Nm", "current": "current=4:A", "both": "torque=3:Nm,current=4:A"}
    mapping = f"time=1:s,position=2:rad,{channels[known]}"
    constant = ("--torque-constant", 2.5) if known == "current" else ()
    target = tmp_path / "axis.h5"
    assert (
        run_main(["import", *files, "--axis", "--map", mapping, *constant, "--out", target], capsys)[0] == 0
    )
    code, out, _ = run_main(["diagnose", target], capsys)
    assert code == 0
    said = " ".join(out.split())
    told = re.search(
        r"zero of the motor's torque moves from run to run by ([\d.]+) mN m( \(([\d.]+) mA)?", said
    )
    assert told is not None, said
    spread = float(np.std([0.9, -0.8, 0.3, -0.4], ddof=1))
    assert float(told[1]) == pytest.approx(1e3 * spread, rel=0.1)
    assert (told[3] is not None) == (known == "current")
    if told[3]:
        assert float(told[3]) == pytest.approx(1e3 * spread / 2.5, rel=0.1)


def test_an_axis_that_does_not_move_is_told_so(tmp_path, capsys):
    path = written(tmp_path / "log.csv", "t (s),q (deg),tau (Nm)", TIME, np.full(4000, 1.25), TORQUE)
    imported(capsys, path)
    code, out, err = run_main(["diagnose", path.with_suffix(".h5")], capsys)
    assert (code, out) == (2, "")
    assert (
        "'motor_position' does not move in any run (run 001, for one); the axis does not move, or its" in err
    )


def test_a_linear_axis_is_told_as_an_arc(tmp_path, capsys):
    """20 mm on an arc of 10 mm are 2 rad, 100 N at this lever 1 N m; on one of 5 mm 4 rad and 0.5 N m."""
    path = written(tmp_path / "slide.txt", "zeit;hub;kraft", TIME, 20 * TURN, 100 * TORQUE, delimiter=";")
    mapping = "time=zeit:s,position=hub:mm,torque=kraft:N"
    (run,) = imported(capsys, path, "--map", mapping).runs
    np.testing.assert_allclose(run.channel("motor_position"), 2.0 * TURN, atol=1e-9)
    np.testing.assert_allclose(run.channel("motor_torque"), 1.0 * TORQUE, atol=1e-9)
    path.with_suffix(".h5").unlink()
    (run,) = imported(capsys, path, "--map", mapping, "--radius", 0.005).runs
    np.testing.assert_allclose(run.channel("motor_position"), 4.0 * TURN, atol=1e-9)
    np.testing.assert_allclose(run.channel("motor_torque"), 0.5 * TORQUE, atol=1e-9)


def test_a_linear_axis_is_told_in_newtons_and_millimetres(tmp_path, capsys):
    """Friction of 4 N, which at 20 mm radius is kept as 80 mN m; 1 N m is 50 N there."""
    rng = np.random.default_rng(7)
    files = []
    for number, frequency in enumerate((0.8, 1.3, 1.7)):
        time = np.arange(1800) / 300.0
        way = 10.0 * np.sin(2 * np.pi * frequency * time)
        held, ways = 0.0, np.diff(way, prepend=way[0])
        state = np.array([held := min(max(held + step / 0.1, -1.0), 1.0) for step in ways])
        force = 4.0 * state + rng.normal(0.0, 0.05, len(time))
        files.append(written(tmp_path / f"{number}.csv", "t (s),x (mm),F (N)", time, way, force))
    run_main(["import", "--axis", *files, "--radius", 0.02, "--out", tmp_path / "a.h5"], capsys)
    code, out, _ = run_main(["diagnose", tmp_path / "a.h5"], capsys)
    assert code == 0
    said = " ".join(out.split())
    assert "an arc of 20 mm: 1 N m is 50 N, 1 deg is 0.349 mm and 1 N m s/rad is 2500 N s/m." in said
    force, travel = re.findall(r"friction force ([\d.]+)[^;)]* N; travel about ([\d.]+) µm\)", said)[0]
    assert float(force) == pytest.approx(4.0, rel=0.03)
    assert float(travel) == pytest.approx(100.0, rel=0.2)  # it turns round over 0.1 mm


def test_a_current_needs_its_torque_constant(tmp_path, capsys):
    path = written(tmp_path / "log.csv", "time (s),encoder (rad),iq (mA)", TIME, TURN, 1000 * TORQUE)
    mapping = ("--map", "time=1,position=2,current=iq")
    assert "what an ampere gives at the axis" in refused(capsys, path, *mapping)
    session = imported(capsys, path, *mapping, "--torque-constant", 0.25)
    np.testing.assert_allclose(session.runs[0].channel("motor_torque"), 0.25 * TORQUE, atol=1e-9)
    assert "motor_torque" in json.loads(session.runs[0].attributes["derived"])


def a_stage(
    folder: Path,
    frequencies: tuple[float, ...],
    friction: float = 4.0,
    damping: float = 40.0,
    noise: float = 0.05,
) -> list[Path]:
    """A stage of 12 kg under ``friction`` (N) and ``damping`` (N s/m) on 10 mm; its motor gives 38 N/A."""
    rng, files = np.random.default_rng(7), []
    for number, frequency in enumerate(frequencies):
        time, pace = np.arange(1800) / 300.0, 2 * np.pi * frequency
        way = 0.01 * np.sin(pace * time)
        speed = 0.01 * pace * np.cos(pace * time)
        force = -12.0 * pace**2 * way + damping * speed + friction * np.tanh(speed / 1e-3)
        noisy = (force + rng.normal(0.0, noise, len(time))) / 38.0
        name = folder / f"{number}.csv"
        files.append(written(name, "t (s),x (mm),i (A)", time, 1e3 * way, noisy))
    return files


def told_of_the_machine(words: str) -> dict[str, float]:
    """Numbers by title and unit of the line of the fitted machine."""
    (line,) = re.findall(r"The fitted machine: (.*?) \(90 %\)", words)
    parts = [re.fullmatch(r"(.*?) ([\d.]+) ± [\d.]+ (.*)", part) for part in line.split("; ")]
    return {f"{part[1]}, {part[3]}": float(part[2]) for part in parts if part}


@pytest.mark.parametrize("radius", [0.01, 0.03])
def test_the_machine_of_a_linear_axis_is_told_in_kilograms_and_newtons(tmp_path, capsys, radius):
    files = a_stage(tmp_path, (0.8, 1.3, 1.7))
    options = ("--torque-constant", 38, "--radius", radius, "--out", tmp_path / "a.h5")
    assert run_main(["import", "--axis", *files, *options], capsys)[0] == 0
    said = " ".join(run_main(["diagnose", tmp_path / "a.h5"], capsys)[1].split())
    assert told_of_the_machine(said) == {
        "mass, kg": pytest.approx(12.0, rel=0.01),
        "friction force, N": pytest.approx(4.0, rel=0.03),
        "viscous coefficient, N s/m": pytest.approx(40.0, rel=0.03),
    }
    assert re.search(r"Motor force +[\d.]+ [\d.]+ N ", said)


def test_what_to_record_next_of_a_linear_axis_is_told_in_millimetres(tmp_path, capsys):
    """The JSON says it for the arc, SI; the sentence along the line."""
    files = a_stage(tmp_path, (0.3, 0.3, 0.3), friction=2.0, damping=30.0, noise=1.0)
    out = tmp_path / "a.h5"
    run_main(["import", "--axis", *files, "--torque-constant", 38, "--radius", 0.02, "--out", out], capsys)
    code, said, err = run_main(["diagnose", out, "--json", tmp_path / "a.json"], capsys)
    assert code == 0, err
    proposal = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["next_experiment"]["trajectory"]
    (next_,) = re.findall(r"Record next: .*?\. ", " ".join(said.split()))
    millimetres = 20 * np.radians(proposal["amplitude_deg"])
    assert f"{proposal['kind'].replace('_', ' ')}, {millimetres:.3g} mm, " in next_
    assert "°" not in next_
    assert "N m" not in next_


@pytest.mark.parametrize(
    ("motions", "noise"),
    [(((0.3, 4.0), (0.3, 3.0)), 0.05), (((0.02, 4.0), (0.02, 3.0), (0.015, 5.0)), 0.01)],
    ids=["wide", "narrow"],
)
def test_what_to_record_next_asks_little_more_than_was_recorded(tmp_path, capsys, motions, noise):
    """Sines (rad, Hz) of an inertia of 2e-3 kg m^2; 20 degrees at 8 Hz would be 4.6 times their torque."""
    rng, files, time = np.random.default_rng(3), [], np.arange(6000) / 500.0
    for number, (amplitude, frequency) in enumerate(motions):
        angle = amplitude * np.sin(2 * np.pi * frequency * time)
        torque = -2e-3 * (2 * np.pi * frequency) ** 2 * angle + rng.normal(0.0, noise, len(time))
        files.append(written(tmp_path / f"{number}.csv", "t (s),q (rad),tau (Nm)", time, angle, torque))
    run_main(["import", "--axis", *files, "--out", tmp_path / "a.h5"], capsys)
    code, out, _ = run_main(["diagnose", tmp_path / "a.h5", "--json", "-"], capsys)
    assert code == 0
    told = json.loads(out)["next_experiment"]["trajectory"]
    pace, reach = 2 * np.pi * told["frequency_hz"], np.radians(told["amplitude_deg"])
    assert told["kind"] == "sine"
    quickest = [a * 2 * np.pi * f for a, f in motions]
    sharpest = [a * (2 * np.pi * f) ** 2 for a, f in motions]
    assert reach * pace <= 1.5 * max(quickest)
    assert reach * pace**2 <= 1.5 * max(sharpest)
    load = told.get("load_torque", 0.0)
    assert 2e-3 * reach * pace**2 + load <= 1.5 * 2e-3 * max(sharpest)


def test_uneven_sampling_is_told_once(tmp_path, capsys):
    """Times that scatter by a third of a sample, of a motor under friction."""
    rng, files = np.random.default_rng(0), []
    for number, frequency in enumerate((0.8, 1.3, 1.7)):
        time = (np.arange(3000) + rng.uniform(-0.35, 0.35, 3000)) / 500.0
        angle = 0.5 * np.sin(2 * np.pi * frequency * time)
        speed = np.pi * frequency * np.cos(2 * np.pi * frequency * time)
        torque = -2e-4 * (2 * np.pi * frequency) ** 2 * angle + 0.04 * np.tanh(speed / 0.02)
        noisy = torque + rng.normal(0.0, 5e-4, 3000)
        name = tmp_path / f"{number}.csv"
        files.append(written(name, "t (s),q (rad),tau (Nm)", time - time[0], angle, noisy))
    run_main(["import", "--axis", *files, "--out", tmp_path / "a.h5"], capsys)
    code, said, _ = run_main(["diagnose", tmp_path / "a.h5", "--json", tmp_path / "a.json"], capsys)
    assert code == 0
    (found,) = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["bench"]
    assert (found["finding"], found["channel"], found["runs"]) == ("gaps", "time", ["001", "002", "003"])
    assert found["sentence"].startswith("Uneven sampling: ")
    assert "lost" not in said


@pytest.mark.parametrize("radius", [0.01, 0.005])
def test_the_force_of_an_ampere_is_told_in_newtons_on_a_linear_axis(tmp_path, capsys, radius):
    """38 N/A and 3 A are 114 N whatever the arc; told back by its radius, the torque is that force."""
    path = written(tmp_path / "log.csv", "time (s),pos (mm),i_q (A)", TIME, 20 * TURN, 3 * TORQUE)
    assert "what an ampere gives at the axis, N/A with the gear included." in refused(capsys, path)
    session = imported(capsys, path, "--torque-constant", 38, "--radius", radius)
    (run,) = session.runs
    np.testing.assert_allclose(run.channel("motor_torque") / radius, 114 * TORQUE, atol=1e-6)
    np.testing.assert_allclose(run.channel("motor_position") * radius, 0.02 * TURN, atol=1e-9)
    assert session.rig.motor.torque_constant / radius == pytest.approx(38)
    told = run_main(
        ["import", path, "--axis", "--torque-constant", 38, "--radius", radius, "--dry-run"], capsys
    )
    assert f"an ampere gives 38 N at the axis, {38 * radius:g} N m on the arc of" in told[2]


def test_a_rig_file_that_does_not_say_what_an_ampere_gives_is_no_thesis_bench(tmp_path, capsys):
    path = written(tmp_path / "log.csv", "time (s),q (rad),i_q (A)", TIME, TURN, TORQUE)
    slides = written(tmp_path / "slide.csv", "time (s),x (mm),i_q (A)", TIME, 20 * TURN, TORQUE)
    rig = tmp_path / "rig.toml"
    rig.write_text("[motor]\ninertia = 0.001\n", encoding="utf-8")
    assert "say with --torque-constant what an ampere gives" in refused(capsys, path, "--rig", rig)
    session = imported(capsys, path, "--rig", rig, "--torque-constant", 0.25)
    np.testing.assert_allclose(session.runs[0].channel("motor_torque"), 0.25 * TORQUE, atol=1e-9)
    path.with_suffix(".h5").unlink()
    rig.write_text("[motor]\ntorque_constant = 0.05\n", encoding="utf-8")
    assert "rig.toml holds no gear_ratio; give" in refused(capsys, path, "--rig", rig)
    rig.write_text("[motor]\ntorque_constant = 0.05\ngear_ratio = 2\n", encoding="utf-8")
    session = imported(capsys, path, "--rig", rig)
    np.testing.assert_allclose(session.runs[0].channel("motor_torque"), 0.1 * TORQUE, atol=1e-9)
    said = refused(capsys, slides, "--rig", rig)
    assert "tells the position in a length, and" in said
    assert "what it gives in N/A, or --radius should give the lever between the two in m." in said
    (run,) = imported(capsys, slides, "--rig", rig, "--radius", 0.004).runs  # N m at a screw's lever
    np.testing.assert_allclose(run.channel("motor_torque") / 0.004, 25 * TORQUE, atol=1e-6)


def test_what_nobody_said_of_a_machine_is_not_shown(tmp_path, capsys):
    path = written(tmp_path / "log.csv", "t (s),q (deg),tau (Nm)", TIME, np.degrees(TURN), TORQUE)
    imported(capsys, path)
    said = run_main(["info", path.with_suffix(".h5")], capsys)[1]
    assert "0.0302" not in said
    assert "gear ratio" not in said
    assert "no constant of the machine was told" in said
    path.with_suffix(".h5").unlink()
    rig = tmp_path / "rig.toml"
    rig.write_text("[motor]\ninertia = 0.0017\n", encoding="utf-8")
    imported(capsys, path, "--rig", rig)
    said = run_main(["info", path.with_suffix(".h5")], capsys)[1]
    assert "0.0017" in said
    assert "4.3" not in said
    assert "0.0302" not in said


def test_inches_pounds_and_kilograms_of_force_are_units(tmp_path, capsys):
    """An inch is 25.4 mm, a pound 4.448222 N, a kilogram of force at a centimetre 98.0665 mN m."""
    path = written(tmp_path / "log.csv", "t [s],x [inch],F [lbf]", TIME, TURN, TORQUE)
    (run,) = imported(capsys, path).runs
    np.testing.assert_allclose(run.channel("motor_position"), 2.54 * TURN, atol=1e-9)
    np.testing.assert_allclose(run.channel("motor_torque"), 0.04448222 * TORQUE, atol=1e-6)
    for header in ("t_us;theta_deg;torque_kgcm", "t_us;theta_deg;torque_kgf_cm", "t (us);q (deg);M (kgf cm)"):
        columns = 1e6 * TIME, np.degrees(TURN), TORQUE
        path = written(tmp_path / f"{len(header)}.csv", header, *columns, delimiter=";")
        (run,) = imported(capsys, path).runs
        np.testing.assert_allclose(run.channel("motor_torque"), 0.0980665 * TORQUE, atol=1e-7)


def test_a_name_whose_unit_is_of_another_kind_is_no_guess(tmp_path, capsys):
    """An angle is no load, a voltage no command, and a commanded torque no position."""
    header = "t [s],q [rad],q_load [rad],tau_cmd [Nm],tau_meas [Nm]"
    path = written(tmp_path / "log.csv", header, TIME, TURN, 0.5 * TURN, 0.9 * TORQUE, TORQUE)
    code, _, err = run_main(["import", path, "--axis", "--dry-run"], capsys)
    assert code == 0
    assert "q_load <- column 3 [rad] (header 'q_load [rad]'; no load, for that is not told in rad)" in err
    assert "tau_cmd <- column 4 [Nm] (header 'tau_cmd [Nm]'; no command, for that is not told in Nm)" in err
    (run,) = imported(capsys, path).runs
    np.testing.assert_allclose(run.channel("motor_torque"), TORQUE, atol=1e-9)
    assert not run.has("load_torque")
    two = header.replace("q [", "q_motor [")
    asked = written(tmp_path / "two.csv", two, TIME, TURN, TURN, TORQUE, TORQUE)
    assert "columns 2 'q_motor [rad]' and 3 'q_load [rad]' may each be the position" in refused(capsys, asked)
    volts = written(tmp_path / "volts.csv", "t [s],q [deg],U_cmd [V]", TIME, TURN, TORQUE)
    said = refused(capsys, volts)
    assert "gives no torque and no current" in said
    assert said.endswith("takes a factor behind a known one, such as Nm:0.00153.")


@pytest.mark.parametrize(
    ("header", "options", "sentence"),
    [
        ("t (s),q (counts),tau (Nm)", (), "column 2 is taken as 'motor_position' in 'counts'; it should"),
        ("t (s),q (counts),tau (Nm)", (), "as position=2:rad:0.00153 where one 'counts' is 0.00153 rad."),
        ("t (s),q (rad),Torque (%)", (), "other takes a factor to one of them, such as torque=3:Nm:0.0015"),
        ("t_ms,q_deg,torque_ozin", (), "'motor_torque' (column 3, 'ozin' is no unit that is known); say"),
        ("t,q,tau", ("--map", "zeit=1:s,position=2:rad,torque=3:Nm"), "gives no time; 'zeit' in the mapping "
         "is none of time, position, torque, current, load, command; map its column"),
        ("t,q,tau", ("--map", "time=1:s,posn=2:rad,torqe=3:Nm"), "gives no position, which the log of an "
         "axis needs; 'posn' and 'torqe' in the mapping are none of time, position"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_unit_or_a_name_is_named(tmp_path, capsys, header, options, sentence):
    path = written(tmp_path / "log.csv", header, TIME, TURN, TORQUE)
    assert sentence in refused(capsys, path, *options)


def test_a_unit_of_ones_own_takes_a_factor(tmp_path, capsys):
    path = written(tmp_path / "log.csv", "t,counts,tau", TIME, TURN / 0.00153, TORQUE)
    mapping = "time=1:s,position=counts:rad:0.00153,torque=3:Nm"
    (run,) = imported(capsys, path, "--map", mapping).runs
    np.testing.assert_allclose(run.channel("motor_position"), TURN, atol=1e-9)


def test_commas_between_columns_and_in_numbers_are_named(tmp_path, capsys):
    rows = [f"{t:.3f},{q:.6f},{f:.6f}" for t, q, f in zip(TIME, TURN, TORQUE, strict=True)]
    path = tmp_path / "log.csv"
    text = "\n".join(["t [s],q [rad],tau [Nm]", *(row.replace(".", ",") for row in rows)])
    path.write_text(text, encoding="utf-8")
    said = refused(capsys, path)
    assert "3 names above rows of 6 numbers, for commas stand between the columns and in the numbers" in said
    assert "part the columns by semicolons or tabs." in said


def test_a_time_that_jitters_is_told_as_uneven_sampling_and_lost_samples_as_lost(tmp_path, capsys):
    rng = np.random.default_rng(2)
    shaken = TIME + rng.uniform(-0.4, 0.4, len(TIME)) / RATE
    path = written(tmp_path / "log.csv", "t (s),q (rad),tau (Nm)", shaken, TURN, TORQUE)
    imported(capsys, path)
    said = " ".join(run_main(["info", path.with_suffix(".h5")], capsys)[1].split())
    assert "warning: run 001: uneven sampling, " in said
    assert "lost." not in said
    path = damaged(tmp_path / "other", {100: "0.196,12.0,", 300: "0.596,12.0,"})
    imported(capsys, path)
    assert "2 gaps in time, 2 samples lost." in run_main(["info", path.with_suffix(".h5")], capsys)[1]


@pytest.mark.parametrize(
    ("header", "options", "sentence"),
    [
        ("t,q,tau", (), "names no unit of 'time' (column 1), 'motor_position' (column 2) and "
         "'motor_torque' (column 3); say them, such as --map time=1:s,position=2:deg,torque=3:Nm."),
        ("t (s),q (rad),tau", (), "names no unit of 'motor_torque' (column 3); say them, such as "
         "--map time=1:s,position=2:rad,torque=3:Nm."),
        ("t (s),q (furlong),tau (Nm)", (), "in 'furlong'; it should be in one of rad, mrad, deg"),
        ("t (s),q (rad),speed (rad/s)", (), "gives no torque"),
        ("t (s),q (rad),tau (Nm)", ("--phase", "contact"), "--axis makes runs of phase motor_bench"),
    ],
)  # fmt: skip
def test_nothing_is_assumed_of_a_strange_machine(tmp_path, capsys, header, options, sentence):
    path = written(tmp_path / "log.csv", header, TIME, TURN, TORQUE)
    assert sentence in refused(capsys, path, *options)


def test_without_a_header_the_mapping_has_to_speak(tmp_path, capsys):
    path = tmp_path / "log.csv"
    np.savetxt(path, np.stack((TIME, TURN, TORQUE), axis=1), "%.9f", delimiter=",")
    assert "time=1:s,position=2:deg,torque=3:Nm" in refused(capsys, path)
    (run,) = imported(capsys, path, "--map", "time=1:s,position=2:rad,torque=3:Nm:-1").runs
    np.testing.assert_allclose(run.channel("motor_torque"), -TORQUE, atol=1e-9)


def test_an_encoder_that_counts_one_turn_only_is_unwrapped(tmp_path, capsys):
    """A motor at 50 rad/s in 4 s: 200 rad, of which the encoder shows 0 to 360 degrees."""
    turned = 50.0 * np.arange(2000) / RATE
    wrapped = np.degrees(turned) % 360.0
    path = written(tmp_path / "log.csv", "t (s),angle (deg),torque (Nm)", TIME[:2000], wrapped, TORQUE[:2000])
    (run,) = imported(capsys, path).runs
    np.testing.assert_allclose(run.channel("motor_position"), turned, atol=1e-8)
    halves = [unwrapped(np.radians(wrapped[:700]))]  # as a long file is read, block after block
    halves.append(unwrapped(np.radians(wrapped[700:]), halves[0]))
    np.testing.assert_allclose(np.concatenate(halves), turned, atol=1e-8)


def as_version_73(path: Path, content: dict) -> Path:
    """Laid out as MATLAB's ``save -v7.3`` does: HDF5 behind a header of 512 bytes, columns first."""

    def put(group, name, value):
        if isinstance(value, dict):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, one in value.items():
                put(inner, key, one)
        elif isinstance(value, str):
            group[name] = np.array([[ord(c)] for c in value], dtype=np.uint16)
            group[name].attrs["MATLAB_class"] = np.bytes_("char")
        else:
            group[name] = (
                np.atleast_2d(np.asarray(value, dtype=np.float64)).T if np.ndim(value) < 2 else value.T
            )
            group[name].attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for name, value in content.items():
            put(file, name, value)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    return path


def as_version_5(path: Path, content: dict) -> Path:
    savemat(path, content, oned_as="column")
    return path


def damaged(tmp_path: Path, damage: dict[int, str], end: str = "\n") -> Path:
    """A log of 4,000 rows in which some lines of the file, from 1, are others."""
    tmp_path.mkdir(exist_ok=True)
    path = written(tmp_path / "log.csv", "t (s),angle (deg),torque (Nm)", TIME, np.degrees(TURN), TORQUE)
    lines = path.read_text(encoding="utf-8").splitlines()
    for number, text in damage.items():
        lines[number - 1] = text
    path.write_text("\n".join(lines) + end, encoding="utf-8")
    return path


def test_a_few_bad_rows_are_gaps_and_told(tmp_path, capsys):
    """An empty cell in row 98 (at 0.196 s), NaN, a row twice, a line of a word, a last line cut off."""
    damage = {100: "0.196,12.0,", 200: "nan,1.0,2.0", 302: "0.598,1.0,1.0", 400: "stopped", 4001: "7.998,3."}
    path = damaged(tmp_path, damage, "")
    code, _, err = run_main(["import", path, "--axis", "--out", tmp_path / "a.h5"], capsys)
    assert code == 0
    words = (
        "5 of 4,000 rows are left out: 2 without a number in a column that is used (first: line 100), "
        "1 with the time of the row before (line 302), 1 with too few cells or too many (line 400), "
        "1 cut off at the end of the file (line 4001)"
    )
    assert f"  {words}" in err.splitlines()
    session = open_session(tmp_path / "a.h5")
    (run,) = session.runs
    assert run.attributes["left_out"] == words
    kept = np.setdiff1d(np.arange(4000), [98, 198, 300, 398, 3999])
    np.testing.assert_allclose(run.channel("time"), TIME[kept], atol=1e-9)
    np.testing.assert_allclose(run.channel("motor_torque"), TORQUE[kept], atol=1e-9)
    report = check_session(session)
    assert (report.errors, report.runs[0].lost_samples) == ((), 4)
    assert words in " ".join(run_main(["info", tmp_path / "a.h5"], capsys)[1].split())


def test_a_gap_counts_where_the_time_is_counted(tmp_path, capsys):
    path = damaged(tmp_path, {100: "0.196,12.0,"})
    (run,) = imported(capsys, path, "--map", "position=2:deg,torque=3:Nm", "--rate", RATE).runs
    np.testing.assert_array_equal(run.channel("time")[96:100], np.array([96, 97, 99, 100]) / RATE)


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("{t},1.0,", "line 100, column 3 holds ''; it should be a number with a decimal point (90 of 4,000"),
        ("{t},1.0,NaN", "line 100, column 3 holds nan; it should be a number (90 of 4,000 rows cannot be"),
        ("{t},1.0", "line 100 has 2 columns where the first row has 3; every row should have the same"),
        ("0.194,1.0,2.0", "line 100, column 1 holds the time of the row before; it should increase"),
    ],
)
def test_many_bad_rows_are_a_fault_of_the_file(tmp_path, capsys, line, sentence):
    """90 rows are more than 2 %."""
    damage = {100 + k: line.format(t=f"{(98 + k) / RATE:.3f}") for k in range(90)}
    assert sentence in refused(capsys, damaged(tmp_path, damage))


def test_a_column_of_words_is_left_out_and_named_where_it_is_asked_for(tmp_path, capsys):
    rows = [f"{t:.3f};AUTO;{np.degrees(q):.6f};{f:.6f};" for t, q, f in zip(TIME, TURN, TORQUE, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t (s);mode;q (deg);tau (Nm);", *rows]).replace(".", ","), encoding="utf-8")
    code, _, err = run_main(["import", path, "--axis", "--dry-run"], capsys)
    assert code == 0
    assert "  not used: column 2 (of words, such as 'AUTO')" in err.splitlines()
    (run,) = imported(capsys, path).runs
    assert set(run.units) == {"time", "motor_position", "motor_torque"}
    np.testing.assert_allclose(run.channel("motor_torque"), TORQUE, atol=1e-6)
    path.with_suffix(".h5").unlink()
    asked = refused(capsys, path, "--map", "time=1:s,position=3:deg,torque=mode:Nm")
    assert "from column 2, but in " in asked
    assert "that holds 'AUTO' where numbers should be" in asked


@pytest.mark.parametrize(
    ("header", "channels"),
    [
        ("Zeit (s),θ [°],τ [N·m]", ("motor_position", "motor_torque")),
        ("Zeit (s),Winkel (Grad),Drehmoment (Nm)", ("motor_position", "motor_torque")),
        ("Zeit [s],Winkel [deg],Moment [Nm]", ("motor_position", "motor_torque")),
        ("Zeit [s],Winkel [deg],Strom (A)", ("motor_position", "motor_current")),
        ("Zeit [s],Weg [mm],Kraft [N]", ("motor_position", "motor_torque")),
        ("t_s,x_um,F_N", ("motor_position", "motor_torque")),
    ],
)
def test_headers_of_other_alphabets_and_languages(tmp_path, capsys, header, channels):
    path = written(tmp_path / "log.csv", header, TIME, TURN, TORQUE)
    constant = ("--torque-constant", 2.0) if "motor_current" in channels else ()
    (run,) = imported(capsys, path, *constant).runs
    assert set(channels) <= set(run.units)
    size = 0.1 if "Weg" in header else 1e-4 if "um" in header else math.pi / 180.0
    np.testing.assert_allclose(run.channel("motor_position"), size * TURN, atol=1e-9)


@pytest.mark.parametrize(
    ("header", "position", "torque"),
    [
        ("t [s],phi [deg],T [Nm]", math.pi / 180.0, 1.0),
        ("time (s),theta (rad),T (N cm)", 1.0, 0.01),
        ("T (s),alpha_deg,M (Nm)", math.pi / 180.0, 1.0),
        ("t (s),s (mm),F (N)", 0.1, 0.01),
        ("t (s),y [m],T [N]", 100.0, 0.01),
        ("Kanal1 (s),Kanal2 (mrad),Kanal3 (mNm)", 1e-3, 1e-3),
    ],
)
def test_a_letter_is_what_its_unit_allows(tmp_path, capsys, header, position, torque):
    """``T`` beside a time is a torque, ``s`` in mm a way: what nothing else is, told by unit and letter."""
    (run,) = imported(capsys, written(tmp_path / "log.csv", header, TIME, TURN, TORQUE)).runs
    np.testing.assert_allclose(run.channel("time"), TIME, atol=1e-9)
    np.testing.assert_allclose(run.channel("motor_position"), position * TURN, atol=1e-8 * position)
    np.testing.assert_allclose(run.channel("motor_torque"), torque * TORQUE, atol=1e-8 * torque)


def test_a_letter_in_the_unit_of_something_else_is_something_else(tmp_path, capsys):
    """A temperature is no time and no torque, an angular acceleration no angle; neither takes a place."""
    header = "t (s),alpha (rad/s^2),q (rad),T (degC),tau (Nm)"
    path = written(tmp_path / "log.csv", header, TIME, -TURN, TURN, 20.0 + TIME, TORQUE)
    (run,) = imported(capsys, path).runs
    np.testing.assert_allclose(run.channel("motor_position"), TURN, atol=1e-9)
    np.testing.assert_allclose(run.channel("motor_torque"), TORQUE, atol=1e-9)


@pytest.mark.parametrize(
    ("header", "sentence"),
    [
        (
            "time,theta,T",
            "names no unit of 'time' (column 1), 'motor_position' (column 2) and 'motor_torque' (column 3); "
            "say them, such as --map time=1:s,position=2:deg,torque=3:Nm.",
        ),
        (
            "t (s),phi (deg),alpha (deg),tau (Nm)",
            ": columns 2 'phi (deg)' and 3 'alpha (deg)' may each be the position; say which is which, such "
            "as --map time=1:s,position=2:deg,torque=4:Nm.",
        ),
        (
            "t (s),q1 (rad),q2 (rad),tau (Nm)",
            ": columns 2 and 3 both look like 'motor_position'; say which is which, such as --map "
            "time=1:s,position=2:rad,torque=4:Nm.",
        ),
    ],
)
def test_what_two_columns_may_be_is_asked_for_with_a_mapping_that_goes(tmp_path, capsys, header, sentence):
    columns = (TIME, TURN, TORQUE, TORQUE)[: header.count(",") + 1]
    path = written(tmp_path / "log.csv", header, *columns)
    said = refused(capsys, path)
    assert said.endswith(sentence)
    (run,) = imported(capsys, path, "--map", said.rpartition("--map ")[2].removesuffix(".")).runs
    assert run.has("motor_position")


@pytest.mark.parametrize(
    ("header", "options", "proposed"),
    [
        ("t,pos,strom,kraft", (), "time=1:s,position=2:mm,current=3:A,torque=4:N"),
        ("t,pos,strom,temp", (), "time=1:s,position=2:deg,current=3:A"),
        ("t,alpha,strom,temp", (), "time=1:s,position=2:deg,current=3:A"),
        ("a,b,strom,temp", ("--map", "time=1:s,strom=3:A"), "time=1:s,position=2:deg,current=3:A"),
    ],
)
def test_the_proposed_mapping_goes_as_it_stands(tmp_path, capsys, header, options, proposed):
    path = written(tmp_path / "log.csv", header, TIME, TURN, TORQUE, TORQUE)
    said = refused(capsys, path, *options)
    assert f"such as --map {proposed}." in said
    run = imported(capsys, path, "--map", proposed, "--torque-constant", 1.0).runs[0]
    assert {"motor_position", "motor_torque"} <= set(run.units)


@pytest.mark.parametrize(
    ("header", "proposed"),
    [
        ("t_ms,enc_counts,current_mA", "time=1:ms,position=2:rad:0.00153,current=3:mA"),
        ("t_ms,encoder ticks,tau (Nm)", "time=1:ms,position=2:rad:0.00153,torque=3:Nm"),
        ("t_ms,position_counts,force (N)", "time=1:ms,position=2:mm:0.00153,torque=3:N"),
    ],
)
def test_counts_of_an_encoder_are_hinted_with_a_factor(tmp_path, capsys, header, proposed):
    """4,096 to a turn: a count that is taken as a degree would make eleven turns of one."""
    counts = np.round(TURN / 0.00153)
    path = written(tmp_path / "log.csv", header, 1e3 * TIME, counts, TORQUE)
    said = refused(capsys, path, "--map", "auto")
    assert f"such as --map {proposed}, 0.00153 being what one count of the encoder is" in said
    (run,) = imported(capsys, path, "--map", proposed, "--torque-constant", 1.0).runs
    # On an arc of 10 mm, 1 mm is 0.1 rad.
    place = 0.1 if ":mm:" in proposed else 1.0
    np.testing.assert_allclose(run.channel("motor_position"), 0.00153 * place * counts, atol=1e-9)


def test_what_is_missing_is_said_beside_what_there_is(tmp_path, capsys):
    path = written(tmp_path / "log.csv", "t (s),velocity (deg/s),torque (Nm)", TIME, TURN, TORQUE)
    assert refused(capsys, path).endswith(
        "gives no position, which the log of an axis needs; it has the columns 1 't (s)', 2 'velocity "
        "(deg/s)', 3 'torque (Nm)': say which is which, such as --map time=1:s,torque=3:Nm,position=N:deg, "
        "N being its column."
    )


@pytest.mark.parametrize(
    ("mapping", "sentence"),
    [
        ("position=2:deg,torque=3:N", "the position in deg and 'motor_torque' (column 3) in N; of an axis "
         "that turns it should be in a unit such as Nm, or --radius should give the lever"),
        ("position=2:mm,torque=3:Nm", "the position in mm and 'motor_torque' (column 3) in Nm; of an axis "
         "that slides it should be in a unit such as N, or"),
        ("position=2:deg,torque=3:Nm,load=4:N", "'load_torque' (column 4) in N; of an axis that turns"),
        ("position=2:deg,torque=3:Nm,command=4:mm", "'motor_command' (column 4) in mm; of an axis that"),
    ],
)  # fmt: skip
def test_a_force_turns_nothing_without_a_lever(tmp_path, capsys, mapping, sentence):
    path = written(tmp_path / "log.csv", "t,a,b,c", TIME, TURN, TORQUE, TORQUE)
    assert sentence in refused(capsys, path, "--map", f"time=1:s,{mapping}")


def test_a_force_at_a_lever_is_a_torque(tmp_path, capsys):
    """10 N at 50 mm are 0.5 N m."""
    path = written(tmp_path / "log.csv", "t (s),q (rad),F (N)", TIME, TURN, 10.0 * TORQUE)
    (run,) = imported(capsys, path, "--radius", 0.05).runs
    np.testing.assert_allclose(run.channel("motor_torque"), 0.5 * TORQUE, atol=1e-9)
    np.testing.assert_allclose(run.channel("motor_position"), TURN, atol=1e-9)


@pytest.mark.parametrize("save", [as_version_5, as_version_73])
def test_vectors_of_a_mat_file(tmp_path, capsys, save):
    content = {"t": TIME, "q": TURN, "tau": TORQUE, "Fs": np.array([RATE]), "comment": "a log"}
    path = save(tmp_path / "log.mat", content)
    sentence = refused(capsys, path)
    assert all(f"'{name}'" in sentence for name in ("time", "motor_position", "motor_torque"))
    (run,) = imported(capsys, path, "--map", "time=t:s,position=q:rad,torque=tau:Nm").runs
    np.testing.assert_array_equal(run.channel("motor_position"), TURN)
    np.testing.assert_array_equal(run.channel("motor_torque"), TORQUE)
    assert run.sample_rate_hz == RATE


@pytest.mark.parametrize("save", [as_version_5, as_version_73])
def test_each_struct_of_a_mat_file_is_a_run_with_its_units(tmp_path, capsys, save):
    def log(share):
        units = {"time": "s", "position": "deg", "torque": "mNm"}
        return {
            "time": TIME,
            "position": np.degrees(TURN),
            "torque": share * TORQUE,
            "units": units,
            "id": "a",
        }

    path = save(tmp_path / "log.mat", {"slow": log(1.0), "fast": log(2.0)})
    runs = imported(capsys, path).runs
    sizes = sorted(float(np.ptp(run.channel("motor_torque"))) for run in runs)
    assert sizes == pytest.approx([1e-3 * np.ptp(TORQUE), 2e-3 * np.ptp(TORQUE)])
    np.testing.assert_allclose(runs[0].channel("motor_position"), TURN, atol=1e-12)


@pytest.mark.parametrize("save", [as_version_5, as_version_73])
def test_a_matrix_gives_its_columns_by_number(tmp_path, capsys, save):
    path = save(tmp_path / "log.mat", {"data": np.stack((TIME, np.degrees(TURN), TORQUE), axis=1)})
    (run,) = imported(capsys, path, "--map", "time=data_1:s,position=2:deg,torque=3:Nm").runs
    np.testing.assert_allclose(run.channel("motor_position"), TURN, atol=1e-12)


def test_what_is_exported_to_matlab_comes_back(tmp_path, capsys):
    path = written(tmp_path / "log.csv", "t (s),q (rad),tau (Nm)", TIME, TURN, TORQUE)
    session = imported(capsys, path)
    export_session(session, "mat", tmp_path / "out")
    (run,) = imported(capsys, tmp_path / "out" / "log.mat").runs
    for name in ("time", "motor_position", "motor_torque"):
        np.testing.assert_array_equal(run.channel(name), session.runs[0].channel(name))


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        (
            "a.mat",
            b"not matlab at all, but long enough to be looked at " * 9,
            "is not a MAT file of version 5",
        ),
        ("a.mat", b"", "is not a MAT file of version 5 or 7.3"),
    ],
)
def test_what_is_no_mat_file_is_refused_in_one_sentence(tmp_path, capsys, name, content, sentence):
    path = tmp_path / name
    path.write_bytes(content)
    assert sentence in refused(capsys, path)


def test_a_mat_file_cut_at_any_place_is_refused_in_one_sentence(tmp_path, capsys):
    whole = as_version_5(tmp_path / "whole.mat", {"t": TIME[:50], "q": TURN[:50]}).read_bytes()
    for length in range(0, len(whole), 97):
        path = tmp_path / "cut.mat"
        path.write_bytes(whole[:length])
        assert refused(capsys, path).startswith("fingerlab: ")


def test_a_mat_file_takes_nothing_from_other_files(tmp_path, capsys):
    """External links of an HDF5 file are not followed: they are refused by name."""
    secret = as_version_73(tmp_path / "other.mat", {"tau": TORQUE})
    path = as_version_73(tmp_path / "log.mat", {"t": TIME, "q": TURN})
    with h5py.File(path, "r+") as file:
        file["tau"] = h5py.ExternalLink(str(secret), "tau")
    mapping = "time=t:s,position=q:rad,torque=tau:Nm"
    assert "leads to another file at /tau; it should hold all of itself" in refused(
        capsys, path, "--map", mapping
    )


def test_a_motor_that_spins_past_half_a_turn_a_sample_is_not_guessed_at():
    assert math.isclose(float(unwrapped(np.array([0.0, 6.2]))[1]), 6.2 - 2 * np.pi)


def test_a_log_that_holds_the_same_as_another_one_is_told(tmp_path, capsys):
    """Two runs that are one would pass for a motion that comes again."""
    header = "t_ms,theta_m_deg,tau_Ncm"
    a, b = (
        written(tmp_path / f"{name}.csv", header, 1000 * TIME, np.degrees(TURN), 100 * TORQUE)
        for name in "ab"
    )
    c = written(tmp_path / "c.csv", header, 1000 * TIME, np.degrees(TURN), 101 * TORQUE)
    code, _, err = run_main(["import", "--axis", a, b, c, "--out", tmp_path / "x.h5"], capsys)
    assert code == 0
    told = [line for line in err.splitlines() if "leave it out" in line]
    assert len(told) == 1
    assert "b.csv holds the same as" in told[0]
