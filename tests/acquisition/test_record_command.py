"""``fingerlab record`` as a person calls it."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.bench.steering import LoopSettings, ReadyStart, prepare
from fingerlab.acquisition.control.machine import Enable, Initialise, SetUp, Start
from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.protocols.steps import Record, plan_steps
from fingerlab.cli.common import Interrupts
from fingerlab.cli.record import record
from fingerlab.cli.simulate import single_plan
from fingerlab.core.errors import UserError
from fingerlab.devices.simulated import SimulatedRig
from fingerlab.diagnosis.experiment.predicted_runs import bench_menu
from fingerlab.diagnosis.settings import BENCH_LOADS_NM
from fingerlab.rig.file import default_rig, load_rig
from fingerlab.sessions import check_session, open_session

RUN = {"kind": "sine", "amplitude_deg": 10.0, "frequency_hz": 1.0, "offset_deg": 20.0, "duration_s": 3.0}
ENDLESS = {name: value for name, value in RUN.items() if name != "duration_s"}


def call(*arguments: str) -> Any:
    return CliRunner().invoke(record, list(arguments), catch_exceptions=True)


def test_one_run_on_the_simulated_rig(tmp_path: Path) -> None:
    out = tmp_path / "one.h5"
    result = call(
        "--trajectory", json.dumps(RUN), "--phase", "on_air", "--device", "simulated", "--json", "-",
        "--operator", "Ada", "--out", str(out),
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert (told["samples"], told["ended"], told["dropped_samples"]) == (3000, "clean", 0)
    session = open_session(out)
    assert not check_session(session).errors
    run = session.runs[0]
    command = read_trajectory(RUN).command(run.channel("time"))
    np.testing.assert_allclose(run.channel("motor_command"), command, atol=2e-3)
    error = run.channel("motor_position")[1500:] - command[1500:]
    assert np.sqrt(np.mean(error**2)) < np.radians(2.0)
    kt = session.rig.motor.torque_constant * session.rig.motor.gear_ratio
    np.testing.assert_allclose(run.channel("motor_torque"), kt * run.channel("motor_current"), atol=1e-6)
    assert session.attributes["operator"] == "Ada"


def test_where_no_device_is_named_it_is_asked_and_nothing_is_taken_unasked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody takes the simulated rig's runs for the bench's, or drives a card that happens to be there."""
    arguments = ["--trajectory", json.dumps({**RUN, "duration_s": 1.0}), "--phase", "on_air"]
    arguments += ["--out", str(tmp_path / "s.h5")]
    with pytest.raises(UserError, match="name the bench to record from: simulated"):
        CliRunner().invoke(record, arguments, catch_exceptions=False)
    monkeypatch.setattr("fingerlab.cli.common.somebody_there", lambda: True)
    result = CliRunner().invoke(record, arguments, input="simulated\n")
    assert result.exit_code == 0, result.output
    assert "no NI-DAQmx driver: using the simulated rig" in result.stderr
    assert open_session(tmp_path / "s.h5").attributes["device"] == "simulated rig"


def test_several_runs_from_predefined_values(tmp_path: Path) -> None:
    """The finger hangs still on air: where its joints stand is where they are said to stand."""
    hold = {"kind": "blocked", "offset_deg": 5.0, "duration_s": 1.0, "ramp_s": 0.5}
    out = tmp_path / "three.h5"
    result = call(
        "--trajectory", json.dumps(hold), "--phase", "on_air", "--device", "simulated", "--runs", "3",
        "--set-position", "5", "--set-mcp", "30", "--set-pip", "-12", "--rest", "0.2", "--out", str(out),
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    runs = open_session(out).runs
    assert [run.length for run in runs] == [1000, 1000, 1000]
    first = {name: np.degrees(runs[0].channel(name)[:20].mean()) for name in ("mcp_angle", "pip_angle")}
    assert first == pytest.approx({"mcp_angle": 30.0, "pip_angle": -12.0}, abs=0.1)
    assert np.degrees(runs[0].channel("motor_position")[0]) == pytest.approx(5.0, abs=0.1)


def test_what_diagnose_proposes_can_be_recorded(tmp_path: Path) -> None:
    proposal = {"next_experiment": {"trajectory": {**RUN, "offset_deg": 60.0}, "phase": "motor_bench"}}
    source = tmp_path / "diagnosis.json"
    source.write_text(json.dumps(proposal), encoding="utf-8")
    out = tmp_path / "next.h5"
    result = call("--trajectory", str(source), "--device", "simulated", "--out", str(out))
    assert result.exit_code == 0, result.output
    run = open_session(out).runs[0]
    assert run.phase == "motor_bench"
    assert run.trajectory["offset_deg"] == 60.0


def test_a_proposed_run_against_a_known_load_carries_it_from_its_first_sample(tmp_path: Path) -> None:
    run = {**RUN, "amplitude_deg": 20.0, "offset_deg": 25.0, "frequency_hz": 2.0, "load_torque": 0.1}
    proposal = {"next_experiment": {"trajectory": run, "phase": "motor_bench", "cable": "none"}}
    source, out = tmp_path / "diagnosis.json", tmp_path / "loaded.h5"
    source.write_text(json.dumps(proposal), encoding="utf-8")
    result = call("--trajectory", str(source), "--device", "simulated", "--out", str(out))
    assert result.exit_code == 0, result.output
    taken = open_session(out).runs[0]
    assert np.all(taken.channel("load_torque") == np.float32(0.1))
    torque = taken.channel("motor_torque")
    # Over whole periods inertia and friction do as much one way as the other: what is left is the load.
    assert np.mean(torque[1000:3000]) == pytest.approx(0.1, abs=0.005)
    # Held off its support before the run, under friction of at most 20 mN m.
    assert np.mean(torque[:50]) == pytest.approx(0.1, abs=0.02)


def test_every_run_that_is_proposed_for_the_motor_bench_is_within_its_limits() -> None:
    rig = default_rig()
    settings = LoopSettings(BenchUnits.from_rig(rig), rig.limits)
    proposals = list(bench_menu(rig, BENCH_LOADS_NM))
    assert len(proposals) >= 6
    for one in proposals:
        plan = single_plan(json.dumps({"trajectory": one.trajectory, "phase": one.phase}), None, None)
        assert plan.load_torque == one.trajectory.get("load_torque", 0.0)
        for step in plan_steps([plan], 0.8):
            if isinstance(step, Record):
                ready = prepare(Start(step.trajectory), settings, cable=False)
                assert isinstance(ready, ReadyStart), ready


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--protocol", "on-air", "--trajectory", "{}"], "not both"),
        ([], "not both or neither"),
        (["--trajectory", json.dumps(RUN)], "--phase"),
        (["--trajectory", "nowhere.json", "--phase", "free"], "JSON text or a file of it"),
        (["--trajectory", '{"next_experiment": null}'], "nothing left to separate"),
        (["--trajectory", json.dumps({**RUN, "offset_deg": 400}), "--phase", "free"], "limits are"),
        (["--trajectory", json.dumps({**ENDLESS, "until_stopped": True}), "--phase", "free"], "'duration_s'"),
        (["--protocol", "rich", "--force", "20"], "pressed with 20 N; the limit of the force is 10 N"),
        (["--trajectory", json.dumps({**RUN, "load_torque": 0.1}), "--phase", "free"], "motor_bench"),
        (["--trajectory", json.dumps({**RUN, "load_torque": "x"}), "--phase", "motor_bench"], "in N m"),
        (["--protocol", "on-air", "--runs", "3"], "--runs"),
        (["--protocol", "on-air", "--set-mcp", "nan"], "180 degrees"),
        (["--protocol", "on-air", "--device", "replay:x.h5"], "replay"),
        (["--protocol", "on-air", "--device", "127.0.0.1:1/Dev1", "--yes"], "--yes is for the simulated rig"),
        (["--protocol", "on-air", "--device", ""], "name the bench to record from: "),
    ],
)
def test_bad_requests_are_one_sentence(tmp_path: Path, arguments: list[str], words: str) -> None:
    device = [] if "--device" in arguments else ["--device", "simulated"]
    out = tmp_path / "no.h5"
    result = call(*arguments, *device, "--out", str(out))
    assert isinstance(result.exception, UserError)
    assert words in str(result.exception)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("section", "protocol", "words"),
    [
        ("load_cell", "rich", "[daq.load_cell], and what is on the bench needs one; connect the load cell"),
        ("mcp", "on-air", "[daq.mcp], and what is on the bench needs one; connect the MCP sensor"),
        ("current_monitor", "on-air", "[daq.current_monitor], and without one no motor is driven; connect"),
    ],
)
def test_a_bench_that_lacks_a_sensor_says_so_before_a_run(
    tmp_path: Path, section: str, protocol: str, words: str
) -> None:
    """By protocol before anything moves; by hand at Initialise, or at enable where it is the monitor."""
    text = (Path(__file__).parents[2] / "resources/rigs/default.toml").read_text(encoding="utf-8")
    before, after = text.split(f"[daq.{section}]\nterminal", 1)
    path = tmp_path / "rig.toml"
    path.write_text(f'{before}[daq.{section}]\nterminal = ""\n{after.split(chr(10), 1)[1]}', encoding="utf-8")
    out = tmp_path / "no.h5"
    result = call(
        "--protocol", protocol, "--device", "simulated", "--rig", str(path), "--yes", "--out", str(out)
    )
    assert isinstance(result.exception, UserError)
    assert words in str(result.exception)
    assert not out.exists()
    rig = load_rig(path)
    units, by_hand = BenchUnits.from_rig(rig), SetUp("contact", "flexion")
    bench = InlineBench(SimulatedRig(rig), LoopSettings(units, rig.limits), tmp_path / "rescue")
    bench.ask(by_hand)
    bench.wait(1.5)
    if section == "current_monitor":
        bench.ask(Initialise())
    with pytest.raises(UserError, match=re.escape(words)):
        bench.ask(Enable() if section == "current_monitor" else Initialise())
    assert not bench.status().enabled
    bench.close()


@pytest.mark.skipif(sys.platform == "win32", reason="a test cannot press Ctrl-C there")
def test_ctrl_c_stops_and_keeps_what_was_recorded(tmp_path: Path) -> None:
    out = tmp_path / "broken-off.h5"
    arguments = [sys.executable, "-m", "fingerlab", "record", "--device", "simulated", "--phase", "on_air"]
    arguments += ["--trajectory", json.dumps({**RUN, "duration_s": 3000.0}), "--out", str(out)]
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True) as process:
        part = tmp_path / "broken-off.h5.recording" / "001.h5part"
        end = time.monotonic() + 60.0
        while not (part.exists() and part.stat().st_size > 200_000) and time.monotonic() < end:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        try:
            _, told = process.communicate(timeout=60.0)
        finally:
            process.kill()  # one that does not listen must not hold up everything else
    assert process.returncode == 130
    assert "broke off" in told
    assert "Traceback" not in told
    session = open_session(out)
    assert session.attributes["ended"] == "truncated"
    assert session.runs[0].attributes["complete"] == 0
    assert not check_session(session).errors
    assert session.runs[0].length >= 100


def test_ctrl_c_while_python_clears_an_object_away_is_kept_and_told_by_no_traceback(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seen before, on a slow machine: the signal came in a callback of ``weakref``."""
    monkeypatch.setattr(sys, "unraisablehook", sys.__unraisablehook__)

    class Unlucky:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    with Interrupts(lambda: None) as interrupts:
        interrupts.check()
        Unlucky()
        assert interrupts.asked
        with pytest.raises(KeyboardInterrupt):
            interrupts.check()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_that_python_loses_stops_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, which: signal.Signals
) -> None:
    """What is raised while Python clears an object away is dropped: the motor must stop, the command end."""
    out = tmp_path / "lost.h5"
    count, idle = iter(range(1_000_000)), InlineBench.idle

    def unlucky(bench: InlineBench) -> None:
        idle(bench)
        if next(count) == 300:
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(which)

    monkeypatch.setattr(InlineBench, "idle", unlucky)
    long = json.dumps({**RUN, "duration_s": 3000.0})
    result = call("--trajectory", long, "--phase", "on_air", "--device", "simulated", "--out", str(out))
    assert isinstance(result.exception, KeyboardInterrupt) or result.exit_code != 0
    session = open_session(out)
    assert session.attributes["ended"] == "truncated"
    assert session.runs[0].attributes["complete"] == 0
    assert 100 <= session.runs[0].length < 60_000


def test_a_table_is_recorded_from_any_run_with_gains_of_one_s_own(tmp_path: Path) -> None:
    table, out = tmp_path / "scan.csv", tmp_path / "scan.h5"
    table.write_text(
        "kind,amplitude_deg,frequency_hz,offset_deg,duration_s\nsine,8,0.5 to 1.5 in 3,20,2.5\n",
        encoding="utf-8",
    )
    given = ["--protocol", str(table), "--device", "simulated", "--rest", "0.2", "--out", str(out)]
    result = call(*given, "--from-run", "2", "--gains", "10,20,0.2")
    assert result.exit_code == 0, result.output
    assert "2 runs, 5000 samples, written to" in result.output
    session = open_session(out)
    assert session.attributes["protocol"] == "scan"
    assert [run.trajectory["frequency_hz"] for run in session.runs] == [1.0, 1.5]
    told = session.runs[0].attributes["gains"]
    gains = json.loads(told) if isinstance(told, str) else told
    assert gains == {"proportional": 10.0, "integral": 20.0, "derivative": 0.2}
    for wrong, words in (("1,2", "three numbers"), ("99,1,0.2", "proportional gain is 99")):
        again = call(*given[:-1], str(tmp_path / "no.h5"), "--gains", wrong)
        assert words in str(again.exception)
