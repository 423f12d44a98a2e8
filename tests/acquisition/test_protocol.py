"""Protocols: the plan is pure, and the driver takes it on a bench of our own."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Mode
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.protocols.driver import Beginning, ProtocolDriver, refuse_impossible
from fingerlab.acquisition.protocols.steps import (
    SETTLE_S,
    Change,
    Find,
    Lift,
    Record,
    Rest,
    WorkOut,
    plan_seconds,
    plan_steps,
    scan_runs,
    steps_from,
)
from fingerlab.acquisition.recording import SessionInfo
from fingerlab.core.errors import UserError
from fingerlab.devices.faults import Faults, SensorFault
from fingerlab.devices.simulated import SimulatedBench, SimulatedRig, Simulation
from fingerlab.rig.file import Intervention, default_rig
from fingerlab.rig.limits import Limits
from fingerlab.sessions import open_session
from fingerlab.twin.plant import OUTPUTS
from fingerlab.twin.protocols import PROTOCOLS, RunPlan, read_run_table
from tests.acquisition.fake_device import FakeDevice

AIR = RunPlan(
    "on_air",
    "extension",
    {"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0, "offset_deg": 22.0, "duration_s": 2.0},
)
PRESS = RunPlan(
    "contact", "flexion", {"kind": "sine", "amplitude_deg": 2.0, "frequency_hz": 1.0, "duration_s": 2.0}
)


def test_the_thesis_is_ten_runs_on_air_one_change_of_cable_and_ten_in_contact() -> None:
    steps = plan_steps(PROTOCOLS["thesis"](2.0), 0.8)
    records = [step for step in steps if isinstance(step, Record)]
    assert [r.phase for r in records] == ["on_air"] * 10 + ["contact"] * 10
    assert [s.set_up.cable for s in steps if isinstance(s, Change)] == ["extension", "flexion"]
    assert sum(isinstance(s, Find) for s in steps) == 1
    assert sum(isinstance(s, Rest) for s in steps) == 18
    # 20 runs of 30 s with a soft stop of 1 s, 18 rests of 2 s, two changes of 1.5 s
    assert plan_seconds(steps) == pytest.approx(20 * 31 + 18 * 2 + 2 * 1.5)


@pytest.mark.parametrize("name", list(PROTOCOLS))
def test_every_protocol_of_simulate_has_its_runs_in_its_order(name: str) -> None:
    plans = PROTOCOLS[name](2.0)
    records = [step for step in plan_steps(plans, 0.8) if isinstance(step, Record)]
    assert [(r.phase, r.cable, r.trajectory) for r in records] == [
        (p.phase, p.cable, p.trajectory) for p in plans
    ]
    rig = default_rig()
    refuse_impossible(plan_steps(plans, 0.8), LoopSettings(BenchUnits.from_rig(rig), rig.limits))


def test_a_known_load_is_lifted_before_each_run_and_never_set_down_in_one() -> None:
    wave = {"kind": "sine", "amplitude_deg": 20.0, "frequency_hz": 2.0, "offset_deg": 25.0}
    loads = (0.0, 0.05, 0.05, -0.05)
    plans = [
        RunPlan("motor_bench", "none", {**wave, "offset_deg": 25.0 if n >= 0 else -25.0}, n) for n in loads
    ]
    steps = plan_steps(plans, 0.8)
    kinds = [type(step) for step in steps]
    assert kinds == [Change, Record, Change, Lift, Record, Rest, Lift, Record, Change, Lift, Record]
    assert [s.degrees for s in steps if isinstance(s, Lift)] == [3.0, 3.0, -3.0]
    prompts = [s.prompt for s in steps if isinstance(s, Change)]
    assert "nothing on it" in prompts[0]
    assert "50 mN m" in prompts[1]
    assert "turns backwards" in prompts[2]
    with pytest.raises(UserError, match="comes to 2°, where the known load rests"):
        plan_steps([RunPlan("motor_bench", "none", {**wave, "offset_deg": 22.0}, 0.05)], 0.8)


def test_a_run_with_a_known_change_is_asked_for_and_tells_of_it() -> None:
    change = Intervention(added_mass=0.013, added_mass_at=0.048).attributes()
    steps = plan_steps([AIR, replace(AIR, attributes=change), AIR], 0.8)
    assert [type(step) for step in steps] == [Change, Record, Change, Record, Change, Record]
    prompts = [step.prompt for step in steps if isinstance(step, Change)]
    assert "with 13 g fixed to the finger 48 mm beyond the PIP axis" in prompts[1]
    assert "change the machine" not in prompts[2]
    assert [dict(step.attributes) for step in steps if isinstance(step, Record)] == [{}, change, {}]


def test_a_simulated_bench_is_changed_as_it_is_asked() -> None:
    """13 g at the tip bend the MCP joint of a free finger further, by about their torque over its spring."""
    angles = []
    for told in ("", json.dumps({"added_mass": 0.013, "added_mass_at": 0.048})):
        device = SimulatedBench(Simulation(seed=3), default_rig().daq)
        device.set_up("on_air", "extension", 0.0, told)
        angles.append(device.stream.now[OUTPUTS.index("q1")])
    f = default_rig().finger
    assert f is not None
    more = 9.81 * 0.013 * (2 * f.proximal_half_length + 0.048) / f.mcp_stiffness  # rad, stretched out
    assert abs(angles[1] - angles[0]) == pytest.approx(more, rel=0.35)


def inline(device: FakeDevice, tmp_path: Path) -> InlineBench:
    bench = InlineBench(device, LoopSettings(BenchUnits.from_rig(default_rig()), Limits()), tmp_path / "r")
    info = SessionInfo(tmp_path / "p.h5", default_rig().to_json(), "protocol", "2026-11-01T09:00:00+01:00")
    bench.recorder.open(info)
    return bench


def settled(device: FakeDevice) -> None:
    device.position = device.speed = 0.0


def test_on_air_then_contact_with_the_contact_found(tmp_path: Path) -> None:
    device = FakeDevice()
    bench = inline(device, tmp_path)
    asked: list[str] = []

    def operator(sentence: str) -> None:
        assert not device.enabled
        asked.append(sentence)
        settled(device)

    shares: list[float] = []
    driver = ProtocolDriver(bench, operator, lambda share, _: shares.append(share))
    driver.take(plan_steps([AIR, AIR, PRESS], 0.8, rest_s=0.5))
    session = open_session(bench.recorder.close())
    assert (device.volts, device.enabled) == (0.0, False)
    assert [len(asked), "extension" in asked[0], "flexion" in asked[1]] == [2, True, True]
    assert [run.length for run in session.runs] == [2000, 2000, 2000]
    assert session.attributes["ended"] == "clean"
    assert shares == sorted(shares)
    press = session.runs[2]
    # 4 N/rad from 0.5 rad on: 0.8 N stands at 0.7 rad, about which the motor presses.
    assert math.radians(float(press.trajectory["offset_deg"])) == pytest.approx(0.7, abs=0.02)
    assert np.mean(press.channel("endpoint_force")[-500:]) == pytest.approx(0.8, abs=0.15)
    bench.close()


def test_a_fault_ends_the_protocol_and_what_was_taken_is_kept(tmp_path: Path) -> None:
    device = FakeDevice(jump=(7000, 900.0))
    bench = inline(device, tmp_path)
    driver = ProtocolDriver(bench, lambda _: settled(device))
    with pytest.raises(UserError, match="encoder jumped"):
        driver.take(plan_steps([AIR, AIR, AIR], 0.8, rest_s=0.5))
    assert (device.volts, device.enabled) == (0.0, False)
    assert bench.status().mode is Mode.FAULT
    bench.recorder.cut("a fault")
    runs = open_session(bench.recorder.close()).runs
    assert runs[0].attributes["ended"] == "clean"
    assert runs[-1].attributes["ended"] == "truncated"
    bench.close()


def test_what_breaks_while_the_next_run_is_worked_out_is_what_the_operator_reads(tmp_path: Path) -> None:
    """Not that a trajectory cannot begin in a fault."""
    off = Faults(sensors=(SensorFault("mcp_volts", 7000, level=0.0),))
    device = SimulatedRig(simulation=Simulation(seed=1), faults=off)
    rig = device.rig
    bench = InlineBench(device, LoopSettings(BenchUnits.from_rig(rig), rig.limits), tmp_path / "rescue")
    bench.recorder.open(SessionInfo(tmp_path / "s.h5", rig.to_json(), "t", "2026-11-01T09:00:00+01:00"))
    wave = RunPlan(AIR.phase, AIR.cable, {**AIR.trajectory, "amplitude_deg": 3.0})
    change, first, second = (step for step in plan_steps([wave, wave], 0.8) if not isinstance(step, Rest))
    think = WorkOut("thinking", lambda _run: bench.step(7000))
    with pytest.raises(UserError, match=r"^The MCP sensor gives 0\.00. V, outside of"):
        ProtocolDriver(bench, lambda _: None).take([change, first, think, second])
    assert not bench.status().enabled
    bench.close()


def test_torques_are_not_found_for_a_bench_that_nobody_checked() -> None:
    rig = default_rig()
    settings = LoopSettings(BenchUnits.from_rig(rig), rig.limits, current_share=0.1)
    with pytest.raises(UserError, match=r"was not checked gets 10%; confirm it with check-rig first\."):
        refuse_impossible([WorkOut("thinking", lambda _run: None)], settings)


def test_an_end_before_the_motion_begins_none(tmp_path: Path) -> None:
    device = FakeDevice()
    bench = inline(device, tmp_path)

    def look() -> None:
        if driver.doing == "before the motion":
            driver.end()

    driver = ProtocolDriver(
        bench, lambda _: settled(device), None, None, look, Beginning(before_s=2.0 * SETTLE_S)
    )
    driver.take(plan_steps([AIR], 0.8))
    assert (device.volts, device.enabled, bench.status().run, driver.number) == (0.0, False, 0, 0)
    bench.close()


def test_without_a_load_cell_in_reach_the_approach_is_given_up(tmp_path: Path) -> None:
    device = FakeDevice()
    bench = inline(device, tmp_path)
    driver = ProtocolDriver(bench, lambda _: settled(device))
    with pytest.raises(UserError, match=r"move the load cell nearer|is beyond its limit"):
        driver.take(plan_steps([PRESS], 9.0))
    assert (device.volts, device.enabled) == (0.0, False)
    bench.close()


def table(tmp_path: Path, text: str) -> list[RunPlan]:
    path = tmp_path / "runs.csv"
    path.write_text(text, encoding="utf-8")
    return read_run_table(path)


def test_a_table_of_runs_with_scans_is_a_protocol(tmp_path: Path) -> None:
    plans = table(
        tmp_path,
        "\ufeffphase;cable;kind;amplitude_deg;frequency_hz;offset_deg;duration_s;runs;load_torque\n"
        "# two amplitudes at each of three frequencies\n"
        "on_air;;sine;5 10;0.5 to 1.5 in 3;20;4;;\n"
        "\n"
        "motor_bench;;chirp;10;0.5 to 8 in 3 log;60;5;2;0.05\n",
    )
    scan, bench = plans[:6], plans[6:]
    assert {(p.phase, p.cable) for p in scan} == {("on_air", "extension")}
    pairs = [(p.trajectory["amplitude_deg"], p.trajectory["frequency_hz"]) for p in scan]
    assert pairs == [(a, f) for a in (5.0, 10.0) for f in (0.5, 1.0, 1.5)]
    assert [p.trajectory["frequency_hz"] for p in bench] == [0.5, 0.5, 2.0, 2.0, 8.0, 8.0]
    assert {(p.phase, p.cable, p.load_torque) for p in bench} == {("motor_bench", "none", 0.05)}
    assert bench[0].trajectory["duration_s"] == 5.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("kind,amplitude_deg\n", "has no rows"),
        ("kind,amplitud\nsine,5\n", "has the column 'amplitud'; it may have"),
        ("amplitude_deg\n5\n", "and 'kind'"),
        ("kind,amplitude_deg\nsine,5 to\n", r"row 1, amplitude_deg is '5 to'; it should be a number"),
        ("kind,amplitude_deg\nsine,-5 to 5 in 3 log\n", "it should be a number"),
        ("kind,amplitude_deg\nwobble,5\n", "row 1: the trajectory has the kind 'wobble'"),
        ("phase,cable,kind,amplitude_deg\ncontact,extension,sine,5\n", "row 1: A contact run presses"),
        ("kind,amplitude_deg,runs\nsine,5,0\n", "'runs' = '0'; it should be a whole number"),
        ("kind,amplitude_deg,frequency_hz\nsine,1 to 2 in 100,1 to 2 in 100\n", "more than 1000 runs"),
    ],
)
def test_a_table_that_is_none_is_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(UserError, match=words):
        table(tmp_path, text)


def test_a_protocol_goes_on_from_any_run_with_its_set_up_and_its_contact() -> None:
    steps = plan_steps(PROTOCOLS["thesis"](2.0), 0.8)
    assert steps_from(steps, 1) == steps
    air = steps_from(steps, 7)
    assert [type(step) for step in air[:2]] == [Change, Record]
    assert [s.number for s in air if isinstance(s, Record)] == list(range(7, 21))
    contact = steps_from(steps, 15)
    assert [type(step) for step in contact[:3]] == [Change, Find, Record]
    assert contact[0].set_up.cable == "flexion"
    assert [s.number for s in contact if isinstance(s, Record)] == list(range(15, 21))
    assert {s.count for s in contact if isinstance(s, Record)} == {20}
    loaded = plan_steps(PROTOCOLS["motor-bench"](2.0), 0.8)
    assert [type(step) for step in steps_from(loaded, 5)[:3]] == [Change, Lift, Record]
    with pytest.raises(UserError, match="no run 21; the protocol has the runs 1 to 20"):
        steps_from(steps, 21)


def test_a_scan_is_a_grid_of_runs_of_one_motion() -> None:
    scans = {"frequency_hz": [0.5, 1.0], "amplitude_deg": [5.0, 10.0], "offset_deg": [10.0, 20.0, 30.0]}
    runs = scan_runs(AIR.trajectory, scans)
    seen = [tuple(run.trajectory[name] for name in scans) for run in runs]
    assert len(set(seen)) == len(seen) == 12
    assert seen[:4] == [(0.5, 5.0, 10.0), (0.5, 5.0, 20.0), (0.5, 5.0, 30.0), (0.5, 10.0, 10.0)]
    none = dict.fromkeys(scans, 0)
    assert all({**run.trajectory, **none} == {**AIR.trajectory, **none} for run in runs)
