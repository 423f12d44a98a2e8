"""``fingerlab record`` as a script uses it: lines to obey, events to read, triggers, what was before."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.bench.steering import LoopSettings
from fingerlab.acquisition.control.machine import Initialise
from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.acquisition.control.units import BenchUnits
from fingerlab.acquisition.protocols.driver import Beginning
from fingerlab.acquisition.protocols.script import Order, read_order
from fingerlab.acquisition.protocols.steps import plan_steps
from fingerlab.acquisition.recording import Level, crossings, read_level
from fingerlab.cli.common import progress_bar
from fingerlab.cli.record import record
from fingerlab.cli.record_session import Events, SessionOptions, _Writing, take
from fingerlab.core.errors import UserError
from fingerlab.devices.faults import fault_after
from fingerlab.devices.simulated import SimulatedRig
from fingerlab.rig.file import default_rig
from fingerlab.rig.limits import Limits
from fingerlab.sessions import check_session, open_session
from fingerlab.twin.protocols import RunPlan
from tests.acquisition.fake_device import FakeDevice

RUN = {"kind": "sine", "amplitude_deg": 10.0, "frequency_hz": 1.0, "offset_deg": 20.0, "duration_s": 2.0}


def call(folder: Path, *arguments: str, orders: str = "", **run: Any) -> tuple[Result, list[dict[str, Any]]]:
    """Record on the simulated rig; the result, and the events."""
    told = folder / "events.jsonl"
    script = folder / "script.txt"
    script.write_text(orders, encoding="utf-8")
    given = [
        "--trajectory",
        json.dumps({**RUN, **run}),
        "--device",
        "simulated",
        "--out",
        str(folder / "s.h5"),
    ]
    given += ["--commands", str(script), "--events", str(told)]
    if "--phase" not in arguments:
        given += ["--phase", "on_air"]
    result = CliRunner().invoke(record, [*given, *arguments], catch_exceptions=True)
    lines = told.read_text(encoding="utf-8").splitlines() if told.exists() else []
    return result, [json.loads(line) for line in lines]


def of(events: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    return [event for event in events if event["event"] == kind]


def test_markers_and_a_pause_at_their_moments(tmp_path: Path) -> None:
    orders = "# a remark\n@1:0.5 pause\n@1:1 resume\n@2:0.753 mark light touch, Łódź\n@1.507 mark one\n"
    result, events = call(tmp_path, "--runs", "2", "--rest", "0.1", orders=orders)
    assert result.exit_code == 0, result.output
    session = open_session(tmp_path / "s.h5")
    assert not check_session(session).errors
    first, second = session.runs
    steps = np.diff(first.channel("time"))
    assert steps.max() == pytest.approx(0.5, abs=0.03)
    assert first.channel("time")[np.argmax(steps)] == pytest.approx(0.5, abs=0.03)
    assert np.sort(steps)[-2] == pytest.approx(1e-3)
    # A marker stands at its very sample; one for any run belongs to the first in which its moment comes.
    assert _markers(first) == [{"time": 1.507, "note": "one"}]
    assert _markers(second) == [{"time": 0.753, "note": "light touch, Łódź"}]
    assert [e["run"] for e in of(events, "marked")] == [1, 2]
    assert session.attributes["ended"] == "clean"


def _markers(run: Any) -> Any:
    told = run.attributes["markers"]
    return json.loads(told) if isinstance(told, str) else told


def test_what_was_before_a_run_is_in_it(tmp_path: Path) -> None:
    result, _ = call(tmp_path, "--pre-trigger", "0.8", "--runs", "2", "--rest", "0.1", "--set-position", "4")
    assert result.exit_code == 0, result.output
    for run in open_session(tmp_path / "s.h5").runs:
        assert run.length == 2800
        assert run.attributes["trajectory_start_s"] == pytest.approx(0.8)
        command = run.channel("motor_command")
        time = np.arange(2000) / 1000.0
        expected = read_trajectory(RUN).command(time)
        np.testing.assert_allclose(command[2300:], expected[1500:], atol=2e-3)  # after the soft start
    first = open_session(tmp_path / "s.h5").runs[0]
    # Nothing from before the references were set: the pulley would stand at another angle there.
    assert np.degrees(first.channel("motor_position")[:100]) == pytest.approx(4.0, abs=0.2)
    current = first.channel("current_command")
    assert not current[:799].any()  # the motor has not yet begun
    assert current[900:].any()


def test_a_run_begins_at_its_trigger(tmp_path: Path) -> None:
    result, _ = call(tmp_path, "--trigger", "motor_position>15deg", "--pre-trigger", "0.1", duration_s=3.0)
    assert result.exit_code == 0, result.output
    (run,) = open_session(tmp_path / "s.h5").runs
    position = np.degrees(run.channel("motor_position"))
    assert run.attributes["pre_trigger_s"] == pytest.approx(0.1)
    assert position[99] < 15.0 <= position[100]
    start = float(run.attributes["trajectory_start_s"])
    assert start < 0.0
    assert run.length == pytest.approx(3000 + 1000 * start, abs=1)


def test_how_far_the_file_is_is_told_and_shown(tmp_path: Path) -> None:
    """On a terminal by the bar, to a script as events; the JSON stays alone on standard output."""
    told, out = tmp_path / "events.jsonl", tmp_path / "s.h5"
    brief = json.dumps({**RUN, "duration_s": 1.0})
    given = ["--trajectory", brief, "--phase", "on_air", "--device", "simulated", "--out", str(out)]
    result = CliRunner().invoke(
        record, [*given, "--events", str(told), "--json", "-"], env={"FORCE_COLOR": "1"}
    )
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["samples"] == 1000
    assert "Recording: reading the file back" in result.stderr
    events = [json.loads(line) for line in told.read_text(encoding="utf-8").splitlines()]
    kinds = [event["event"] for event in events]
    writing = of(events, "writing")
    assert kinds.index("run_ended") < kinds.index("writing")
    assert kinds[-1 - len(writing) :] == ["writing"] * len(writing) + ["written"]
    assert list(dict.fromkeys(event["doing"] for event in writing)) == ["writing", "verifying"]
    shares = [event["share"] for event in writing]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)


def test_ctrl_c_puts_the_writing_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    went_on = _Writing.__call__

    def pressed(writing: _Writing, share: float, doing: str) -> None:
        signal.raise_signal(signal.SIGINT)
        went_on(writing, share, doing)

    monkeypatch.setattr(_Writing, "__call__", pressed)
    result, events = call(tmp_path, duration_s=1.0)
    assert isinstance(result.exception, KeyboardInterrupt) or result.exit_code == 1
    assert "s.h5.recording" in result.stderr
    assert [event["event"] for event in events][-2:] == ["writing", "put_off"]
    assert not (tmp_path / "s.h5").exists()
    session = open_session(tmp_path / "s.h5")
    assert session.attributes["ended"] == "clean"
    assert session.runs[0].length == 1000


def test_a_trigger_that_never_comes_is_told(tmp_path: Path) -> None:
    result, events = call(tmp_path, "--trigger", "motor_position>50deg")
    assert isinstance(result.exception, UserError)
    assert "motor position above 50 °" in str(result.exception)
    assert of(events, "broken_off")[0]["session"] is None
    assert not (tmp_path / "s.h5").exists()


def test_an_end_is_soft_and_a_stop_is_at_once(tmp_path: Path) -> None:
    for word, folder in (("end", tmp_path / "a"), ("stop", tmp_path / "b")):
        folder.mkdir()
        result, events = call(folder, "--runs", "3", orders=f"@2:1.2 {word}\n")
        first, second = open_session(folder / "s.h5").runs
        assert first.length == 2000
        assert second.length == pytest.approx(1200, abs=30)
        last = of(events, "readings")[-1]
        if word == "end":
            assert result.exit_code == 0, result.output
            assert second.attributes["ended"] == "clean"
            assert of(events, "written")[0]["runs"] == 2
            assert last["mode"] == "stopping"  # softly: the readings of a second go on until it rests
        else:
            assert isinstance(result.exception, KeyboardInterrupt) or result.exit_code == 1
            assert second.attributes["ended"] == "truncated"
            assert "stopped by the operator" in str(second.attributes["ended_note"])


def test_what_cannot_be_done_is_told_and_goes_on(tmp_path: Path) -> None:
    orders = "mark too early\nready\n@1:9 mark too late\n@1:1 pause\n"
    result, events = call(tmp_path, orders=orders)
    assert result.exit_code == 0, result.output
    told = [e["sentence"] for e in of(events, "refused")]
    assert told[0] == "Nothing is being recorded; a marker belongs to a run."
    assert told[1] == "Nothing was asked for."
    assert told[2] == "Run 1 is over."
    assert len(told) == 3


def test_on_air_then_contact_with_the_model_beside_it(tmp_path: Path) -> None:
    arguments = ("--then-contact", "3", "--rest", "0.1", "--compare", "nominal")
    result, events = call(tmp_path, *arguments, duration_s=4.0)
    assert result.exit_code == 0, result.output
    air, press = open_session(tmp_path / "s.h5").runs
    assert [air.phase, press.phase, press.cable] == ["on_air", "contact", "flexion"]
    assert press.trajectory["amplitude_deg"] == 3.0
    assert np.mean(press.channel("endpoint_force")[2000:]) == pytest.approx(0.8, abs=0.3)
    changes = [e["sentence"] for e in of(events, "change")]
    assert ["extension cable" in changes[0], "flexion cable" in changes[1]] == [True, True]
    readings = of(events, "readings")
    # What is shown is what is recorded: newton metres at the gearbox, newtons at the tip.
    pressed = max(e["endpoint_force"] for e in readings)
    assert 0.2 < pressed < 2.0  # read once a second, wherever a motion of 1 Hz is then
    errors = [e["torque_error"] for e in readings if e.get("torque_error")]
    assert 0.0 < min(errors) < 0.02
    forces = [e["force_error"] for e in readings if e.get("force_error")]
    assert forces
    left = [e["left_s"] for e in of(events, "progress")]
    assert left == sorted(left, reverse=True)


@pytest.mark.parametrize(
    ("typed", "lines", "ends"),
    [
        (False, "\n", "2 runs"),
        (True, "mark too early\nready\n", "2 runs"),
        (True, "end\n", "at least one"),
        (True, "stop\n", "KeyboardInterrupt"),
        (False, "", "Nobody is there"),
        (True, "mark\n", "Nobody is there"),
    ],
)
def test_who_is_asked_to_change_the_bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, typed: bool, lines: str, ends: str
) -> None:
    device = FakeDevice()
    settings = LoopSettings(BenchUnits.from_rig(default_rig()), Limits())
    bench = InlineBench(device, settings, tmp_path / "rescued")
    plan = RunPlan("on_air", "extension", {**RUN, "duration_s": 1.0})
    options = SessionOptions(
        out=tmp_path / "s.h5", name="own", title=None, attributes={}, initial=Initialise(),
        beginning=Beginning(), model=None, orders=[], typed=typed, asks=True,
    )  # fmt: skip
    monkeypatch.setattr(sys, "stdin", io.StringIO(lines))
    bar, report = progress_bar("test")
    with Events(str(tmp_path / "events.jsonl")) as events:
        try:
            path, samples, runs = take(
                bench, default_rig(), plan_steps([plan, plan], 0.8, 0.1), options, events, bar, report
            )
            seen = f"{runs} runs"
            assert samples == 2000
            assert open_session(path).attributes["ended"] == "clean"
        except (UserError, KeyboardInterrupt) as error:
            seen = str(error) or type(error).__name__
    assert ends in seen
    assert (device.volts, device.enabled) == (0.0, False)
    told_lines = (tmp_path / "events.jsonl").read_text(encoding="utf-8").splitlines()
    asked = of([json.loads(line) for line in told_lines], "ask")
    assert [e["sentence"].startswith("Fix the extension cable") for e in asked] == [True]
    bench.close()


def test_an_emergency_stop_ends_the_recording_and_is_in_events_and_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    rig = SimulatedRig(faults=fault_after("emergency-stop", 4.0, 1000.0))
    settings = LoopSettings(BenchUnits.from_rig(rig.rig), rig.rig.limits)
    bench = InlineBench(rig, settings, tmp_path / "rescued")
    plan = RunPlan("on_air", "extension", {**RUN, "duration_s": 8.0})
    options = SessionOptions(
        out=tmp_path / "s.h5", name="own", title=None, attributes={}, initial=Initialise(),
        beginning=Beginning(), model=None, orders=[], typed=True, asks=False,
    )  # fmt: skip
    bar, report = progress_bar("test")
    with Events(str(tmp_path / "events.jsonl")) as events, pytest.raises(UserError, match="emergency stop"):
        take(bench, rig.rig, plan_steps([plan], 0.8, 0.1), options, events, bar, report)
    text = (tmp_path / "events.jsonl").read_text(encoding="utf-8")
    lines = [json.loads(line) for line in text.splitlines()]
    readings = of(lines, "readings")
    assert (readings[0]["emergency_stop"], readings[0]["amplifier"]) == ("released", "ready")
    assert readings[-1]["emergency_stop"] == "pressed"
    warned = {one["about"]: one["sentence"] for one in of(lines, "warning")}
    assert warned["line"] == "The emergency stop was pressed at 4.000 s of the bench's time."
    assert warned["stopped"].startswith("The emergency stop was pressed; release it")
    assert {one["dead_man"] for one in readings} == {"not wired"}
    bench.close()
    run = open_session(tmp_path / "s.h5").runs[0]
    stop = run.channel("raw/emergency_stop")
    assert set(stop.tolist()) == {0.0, 1.0}
    first = int(np.argmax(stop))
    assert np.all(stop[first:] == 1.0)
    assert 1500 < first < 4000
    assert (rig.driven_current, rig.enabled) == (0.0, False)


def test_a_script_at_the_other_end_of_a_pipe(tmp_path: Path) -> None:
    arguments = [sys.executable, "-m", "fingerlab", "record", "--device", "simulated", "--phase", "on_air"]
    arguments += ["--trajectory", json.dumps({**RUN, "duration_s": 3000.0}), "--out", str(tmp_path / "s.h5")]
    arguments += ["--commands", "-", "--events", "-"]
    pipe = subprocess.PIPE
    with subprocess.Popen(arguments, stdin=pipe, stdout=pipe, text=True, encoding="utf-8") as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            for line in process.stdout:
                event = json.loads(line)
                if event["event"] == "readings" and event["recorded"] > 1000:
                    process.stdin.write("nonsense\nmark łódka\nend\n")
                    process.stdin.flush()
                    break
            rest = [json.loads(line) for line in process.stdout]
        finally:
            process.kill() if process.poll() is None else None
    assert process.returncode == 0
    assert [e["event"] for e in rest if e["event"] in ("refused", "marked", "ending", "written")] == [
        "refused", "marked", "ending", "written",
    ]  # fmt: skip
    (run,) = open_session(tmp_path / "s.h5").runs
    assert _markers(run)[0]["note"] == "łódka"
    assert 1000 < run.length < 3_000_000


@pytest.mark.parametrize(
    ("line", "order"),
    [
        ("mark", Order("mark")),
        ("  mark a  b ", Order("mark", "a  b")),
        ("@.5 pause", Order("pause", "", None, 0.5)),
        ("@12:3 mark x", Order("mark", "x", 12, 3.0)),
        ("# mark", None),
        ("", None),
    ],
)
def test_a_line(line: str, order: Order | None) -> None:
    assert read_order(line) == order


@pytest.mark.parametrize("line", ["go", "@x mark", "pause now", "@-1 mark", "@1 :2 mark", "Mark"])
def test_a_line_that_asks_for_nothing_known(line: str) -> None:
    with pytest.raises(UserError, match="script, line 3"):
        read_order(line, "script, line 3")


def test_levels() -> None:
    assert read_level("endpoint_force>0.5") == Level("endpoint_force", 0.5)
    low = read_level("motor_position < -90deg")
    assert (low.level, low.rising) == (pytest.approx(-np.pi / 2), False)
    for bad in (
        "force>1",
        "endpoint_force>x",
        "endpoint_force>1deg",
        "motor_speed>1deg",
        "motor_speed",
        "mode>1",
    ):
        with pytest.raises(UserError, match="trigger"):
            read_level(bad)
    values = np.array([0.0, 2.0, 1.0, 1.5, 0.0, np.nan, 3.0, 0.0, 1.5])
    assert crossings(values, 1.5, True).tolist() == [1, 3, 8]  # what follows no number has not crossed
    assert crossings(values, 0.5, False).tolist() == [4, 7]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--trigger", "force>1"], "motor_position"),
        (["--commands", "nowhere.txt"], "nowhere.txt"),
        (["--compare", "nowhere.json"], "nowhere.json"),
        (["--then-contact", "3", "--phase", "motor_bench"], "on_air"),
        (["--json", "-", "--events", "-"], "standard output"),
    ],
)
def test_bad_requests(tmp_path: Path, arguments: list[str], words: str) -> None:
    result, _ = call(tmp_path, *arguments)
    assert isinstance(result.exception, UserError), result.output
    assert words in str(result.exception)
    assert not (tmp_path / "s.h5").exists()


def test_predefined_values_of_the_rig_file(tmp_path: Path) -> None:
    """As in the window: what the rig file predefines holds where the command line says nothing else."""
    rig = tmp_path / "rig.toml"
    default_text = resources.files("fingerlab.resources").joinpath("rigs/default.toml").read_text("utf-8")
    own = "\n[initial]\nposition_deg = 6.0\nmcp_deg = 12.0\n"
    rig.write_text(default_text + own, encoding="utf-8")
    result, _ = call(tmp_path, "--rig", str(rig), "--set-mcp", "-3", kind="blocked", amplitude_deg=0.0)
    assert result.exit_code == 0, result.output
    (run,) = open_session(tmp_path / "s.h5").runs
    assert np.degrees(run.channel("motor_position")[:20]) == pytest.approx(6.0, abs=0.2)
    assert np.degrees(run.channel("mcp_angle")[:20].mean()) == pytest.approx(-3.0, abs=0.2)
