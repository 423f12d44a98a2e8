"""check-rig: what is right is confirmed, what is wrong is found, and the protocol tells of it."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.check_rig.look import CheckProtocol, Outcome, check_settings, write_protocol
from fingerlab.acquisition.check_rig.walk import STEPS, KeptCheck, Step, check_rig, keep, last_check
from fingerlab.cli.bench import check_rig as command
from fingerlab.core.errors import UserError
from fingerlab.devices.faults import ChargePump, Faults, SensorFault
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.simulated import SimulatedBench, SimulatedRig, Simulation
from fingerlab.rig.file import Rig, default_rig, parse_rig

from .card_bench import BUFFERED, SINGLE
from .safety_wiring import DEAD_MAN, READY, STOP, WIRED, wired
from .virtual_card import Card, InProcessChannel, Servicer

BRIEF = tuple(step for step in STEPS if step.name not in ("moved", "scale"))
"""Without the sensors that somebody moves by hand, for most of a check's time."""
LINES = ("lines/emergency_stop", "lines/amplifier_ready", "drive/dead_man")
OWN = Path(__file__).resolve().parents[2] / "docs" / "own_device_example.py"


class Willing:
    """Says yes to everything but what the test says otherwise; remembers what was asked."""

    def __init__(self, **answers: str) -> None:
        self.answers = {key.replace("__", "/"): value for key, value in answers.items()}
        self.asked: dict[str, str] = {}
        self.told: list[str] = []

    def tell(self, text: str) -> None:
        self.told.append(text)

    def found(self, outcome: Outcome) -> None:
        self.tell(f"{outcome.state}: {outcome.title.rstrip('.')}. {outcome.sentence}")

    def ask(self, step: str, question: str) -> str:
        self.asked[step] = question
        return self.answers.get(step, "yes")


def check(device: Any, rig: Rig, operator: Willing, **more: Any) -> CheckProtocol:
    """The whole check of a device, on its own clock."""
    clock = more.pop("clock", None)
    bench = InlineBench(device, check_settings(rig), Path("not used"), clock)
    try:
        return check_rig(bench, rig, operator, "test", **more)
    finally:
        bench.close()


def outcomes(protocol: CheckProtocol) -> dict[str, Outcome]:
    return {outcome.id: outcome for outcome in protocol.outcomes}


def check_simulated(wired: str = "", operator: Willing | None = None, **more: Any) -> dict[str, Outcome]:
    rig = default_rig()
    device = SimulatedRig(rig, wired=parse_rig(wired, "wired").daq if wired else None, **more)
    return outcomes(check(device, rig, operator or Willing()))


def card_with_bench(text: str = '[daq]\ntiming = "single-point"\n') -> tuple[Card, NiCard]:
    rig = parse_rig(text, "x")
    plant = SimulatedBench(Simulation(seed=2), rig.daq)
    card = Card(plant)
    device = NiCard(rig, card.clock, InProcessChannel(Servicer(card)))
    device.move_by_hand = plant.move_by_hand  # type: ignore[attr-defined] - somebody stands at the bench
    return card, device


def test_a_bench_wired_like_its_rig_file_is_confirmed() -> None:
    operator = Willing()
    found = check_simulated(operator=operator)
    assert {o.state for o in found.values()} == {"confirmed", "not applicable"}
    assert {k for k, o in found.items() if o.state == "not applicable"} == {
        "assumption/paced-by-the-card",
        "assumption/late-write-is-lost",
        "assumption/fresh-task-reaches-the-output",
        *LINES,
    }
    assert found["rest/load_cell"].measured["quantity"] == pytest.approx(0.0, abs=0.01)
    assert found["moved/mcp"].measured["peak"] == pytest.approx(0.52, abs=0.02)
    for name, known in (("load_cell", 1.962), ("mcp", 0.5236), ("pip", 0.5236)):
        assert found[f"scale/{name}"].measured["shown"] == pytest.approx(known, rel=0.02)
    assert found["encoder"].measured["counts"] == pytest.approx(8600, abs=5)
    assert found["drive/monitor"].measured["current"] == pytest.approx(0.3, abs=0.02)
    assert math.degrees(found["drive/direction"].measured["travel"]) == pytest.approx(50, abs=6)
    assert len([k for k in found if k.startswith("limits/")]) == 11
    assert "10 N (thesis, section 2.2" in operator.asked["limits/force"]
    assert " 1146 °/s " in operator.asked["limits/speed"]
    assert "MCP angle low is -60° (" in operator.asked["limits/mcp_low"]
    assert "0.475 V at ai0" in operator.asked["rest/load_cell"]


@pytest.mark.parametrize(
    ("wired", "step", "words"),
    [
        ("[daq.mcp]\nsign = -1\n", "moved/mcp", "turn its sign"),
        ("[daq.encoder]\nsign = -1\n", "encoder", "turn the sign of .daq.encoder. around"),
        ("[daq.encoder]\ncounts_per_turn = 2000\n", "encoder", "correct counts_per_turn"),
        ("[daq.command]\nsign = -1\n", "drive/direction", "turn the command's sign"),
        ("[daq.current_monitor]\nsign = 1\n", "drive/monitor", "turn the monitor's sign"),
        ("[daq.current_monitor]\ngain = 2.5\n", "drive/monitor", "correct the gain"),
        ("[daq.load_cell]\nterminal = ''\n", "rest/load_cell", "gives no number"),
        ("[daq.load_cell]\ngain = 9.0\n", "scale/load_cell", "shows 2.44 N of 1.96 N; calibrate it"),
        ("[daq.pip]\ngain = 0.35\n", "scale/pip", "of 30.00°; calibrate it"),
        ("[daq.pip]\noffset = 9.0\nlow = -5\nhigh = 5\n", "rest/pip", "the end of its range"),
    ],
)
def test_what_is_wired_otherwise_is_found(wired: str, step: str, words: str) -> None:
    import re

    outcome = check_simulated(wired)[step]
    assert outcome.state == "failed"
    assert re.search(words, outcome.sentence)


def test_swapped_joint_sensors_are_found() -> None:
    class Swapped(SimulatedRig):
        def move_by_hand(self, channel: str, amount: float) -> None:
            super().move_by_hand({"mcp": "pip", "pip": "mcp"}.get(channel, channel), amount)

    rig = default_rig()
    found = outcomes(check(Swapped(rig), rig, Willing()))
    assert found["moved/mcp"].state == "failed"
    assert "the PIP sensor moved instead" in found["moved/mcp"].sentence


def test_nothing_moves_without_consent() -> None:
    class Watched(SimulatedRig):
        moved: tuple[bool, ...] = ()

        def set_enable(self, on: bool) -> None:
            self.moved += (on,)
            super().set_enable(on)

    rig = default_rig()
    device = Watched(rig)
    found = outcomes(check(device, rig, Willing(drive="no", encoder="skip")))
    assert not any(device.moved)
    assert {found[k].state for k in ("drive/disabled", "drive/direction", "drive/monitor", "encoder")} == {
        "skipped"
    }


def test_an_enable_line_that_does_nothing_is_found() -> None:
    class AlwaysOn(SimulatedRig):
        def set_enable(self, on: bool) -> None:
            super().set_enable(True)

    rig = default_rig()
    found = outcomes(check(AlwaysOn(rig), rig, Willing(), steps=BRIEF))
    assert found["drive/disabled"].state == "failed"
    assert "With the enable line low 0.30 A flowed" in found["drive/disabled"].sentence


def test_a_no_of_the_operator_and_a_dead_sensor() -> None:
    faults = Faults(sensors=(SensorFault("pip_volts", 0),))
    found = check_simulated(operator=Willing(limits__force="no", stop="skip"), faults=faults)
    assert found["limits/force"].state == "failed"
    assert found["stop"].state == "skipped"
    assert (found["rest/pip"].state, found["moved/pip"].state) == ("failed", "skipped")
    assert found["moved/mcp"].state == "confirmed"


def test_a_device_that_is_lost_ends_the_check_and_is_told() -> None:
    found = check_simulated(faults=Faults(unplug_at=300))
    assert list(found) == ["device-lost"]
    assert "no longer answers" in found["device-lost"].sentence


def test_the_three_assumptions_are_measured_on_a_card() -> None:
    card, device = card_with_bench()
    found = outcomes(check_card(card, device))
    assert {o.state for o in found.values() if o.id not in LINES} == {"confirmed"}
    pace = found["assumption/paced-by-the-card"].measured
    assert (pace["cycles"], pace["lost"], pace["samples_a_block"]) == (1999, 0, 1)
    assert pace["seconds"] == pytest.approx(1.999)
    left = found["assumption/late-write-is-lost"].measured
    assert left["after_stop"] == pytest.approx(0.2, abs=1e-3)
    assert left["after_fresh_task"] == pytest.approx(0.0, abs=1e-3)
    assert (card.volts, card.line, card.tasks) == (0.0, False, {})


class Holding(Willing):
    """Holds the pulley until it stands before the dead-man is tried: the simulated gears coast for long."""

    def __init__(self, plant: Any) -> None:
        super().__init__()
        self.plant = plant

    def ask(self, step: str, question: str) -> str:
        if step == "drive/dead_man":
            self.plant.set_up("motor_bench", "none")
        return super().ask(step, question)


def check_card(card: Card, device: NiCard, steps: Sequence[Step] = STEPS) -> CheckProtocol:
    return check(device, device.rig, Holding(card.plant), clock=card.clock.now, card=True, steps=steps)


def only_assumptions(card: Card, device: NiCard) -> dict[str, Outcome]:
    return outcomes(check_card(card, device, [step for step in STEPS if step.card]))


def test_cards_that_break_an_assumption_are_told_apart() -> None:
    card, device = card_with_bench()
    card.holds = False
    found = only_assumptions(card, device)
    assert found["assumption/late-write-is-lost"].state == "noted"  # harmless: the stop does not rely on it
    card, device = card_with_bench()
    slow = card.tick
    card.tick = lambda: (slow(), card.clock.sleep(0.0001))[0]  # type: ignore[method-assign]
    found = only_assumptions(card, device)
    assert found["assumption/paced-by-the-card"].state == "failed"
    assert "1.100 ms instead of 1 ms" in found["assumption/paced-by-the-card"].sentence
    card, device = card_with_bench()
    write = card.write_volts
    card.write_volts = lambda name, value, start: write(name, value, start) if "stop" not in name else None  # type: ignore[method-assign]
    found = only_assumptions(card, device)
    fresh = found["assumption/fresh-task-reaches-the-output"]
    assert fresh.state == "failed"
    assert "Do not drive the motor from this card" in fresh.sentence
    card, device = card_with_bench('[daq]\ntiming = "buffered"\n')
    found = only_assumptions(card, device)
    assert found["assumption/paced-by-the-card"].state == "noted"
    assert found["assumption/fresh-task-reaches-the-output"].state == "confirmed"


def test_a_device_that_cannot_be_opened_is_a_sentence() -> None:
    _, device = card_with_bench('[daq]\ndevice = "Dev9"\n')
    with pytest.raises(UserError, match="knows no card of that name"):
        check(device, device.rig, Willing())


def test_the_protocol_file_is_dated_whole_and_never_overwritten(tmp_path: Path) -> None:
    out = tmp_path / "protocol.json"
    arguments = ["--device", "simulated", "--out", str(out)]
    result = CliRunner().invoke(command, [*arguments, "--yes"])
    assert result.exit_code == 0, result.output
    told = json.loads(out.read_text(encoding="utf-8"))
    assert (told["kind"], told["all_confirmed"], told["device"]) == ("check-rig", True, "simulated rig")
    assert told["date"][:2] == "20"
    assert told["date"][-6] in "+-"
    assert told["daq"]["load_cell"]["gain"] == 11.194
    assert told["limits"]["force"] == 10.0
    assert {"id", "title", "state", "sentence", "question", "answer", "measured"} == set(told["steps"][0])
    before = out.read_bytes()
    again = CliRunner().invoke(command, [*arguments, "--yes"])
    assert isinstance(again.exception, UserError)
    protocol = check(SimulatedRig(), default_rig(), Willing(), steps=())
    with pytest.raises(UserError, match="exists already"):
        write_protocol(protocol, out)
    assert out.read_bytes() == before


def test_a_failed_step_shows_in_the_exit_code(tmp_path: Path) -> None:
    out = tmp_path / "protocol.json"
    arguments = ["--device", "simulated", "--out", str(out), "--yes", "--answer", "limits/force=no"]
    result = CliRunner().invoke(command, [*arguments, "--json", "-"])
    assert isinstance(result.exception, UserError)  # exit code 2, as for any bad input
    assert "limits/force failed" in str(result.exception)
    assert json.loads(result.stdout)["all_confirmed"] is False
    assert "failed: Limit force" in result.stderr
    assert json.loads(out.read_text(encoding="utf-8"))["all_confirmed"] is False


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ([], "Nobody is there to answer"),
        (["--device", "127.0.0.1:1/Dev1", "--yes"], "--yes is for the simulated rig"),
        (["--device", "bench-pc:31763/Dev1", "--yes"], "--yes is for the simulated rig"),
        (
            ["--device", "127.0.0.1:1/Dev1", "--answer", "drive=yes"],
            "--answer drive=yes is for the simulated rig",
        ),
        (["--device", f"own:{OWN}", "--yes"], "--yes is for the simulated rig"),
        (["--yes", "--answer", "limits/force"], "should look like"),
        (["--yes", "--device", "replay:x.h5"], "no bench to check"),
        (["--yes", "--rig", "none.toml"], "cannot be read"),
    ],
)
def test_bad_requests_are_one_sentence_and_write_nothing(tmp_path: Path, more: list[str], words: str) -> None:
    out = tmp_path / "p.json"
    result = CliRunner().invoke(command, ["--device", "simulated", "--out", str(out), *more])
    assert isinstance(result.exception, UserError)
    assert words in str(result.exception)
    assert not out.exists()


def test_without_a_device_nobody_is_asked_and_nothing_is_taken(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, ["--out", str(tmp_path / "p.json")])
    assert isinstance(result.exception, UserError)
    assert "--device is missing; name the bench to check: simulated" in str(result.exception)


@pytest.mark.parametrize(
    ("answer", "words"), [("no", "limits/force failed"), ("skip", "limits/force was left out")]
)
def test_what_failed_or_was_left_out_blocks_what_drives_later(answer: str, words: str) -> None:
    operator = Willing(limits__force=answer)
    card, device = card_with_bench()
    clock = card.clock.now
    found = outcomes(check(device, device.rig, operator, clock=clock, card=True, steps=BRIEF))
    for step in ("assumption/fresh-task-reaches-the-output", "drive/disabled", "drive/direction"):
        assert found[step].state == "skipped"
        assert found[step].sentence == f"Left out, for {words}; mend that and run check-rig again."
    assert found["drive/dead_man"].state == "not applicable"  # the rig file wires none
    assert not {"assumptions", "drive"} & set(operator.asked)
    assert not any(volts or line for volts, line in card.history)
    assert found["stop"].state == "confirmed"


def test_an_encoder_that_failed_blocks_the_drive() -> None:
    found = check_simulated("[daq.encoder]\nsign = -1\n")
    assert "Left out, for encoder failed" in found["drive/direction"].sentence


def test_a_rig_without_a_finger_s_sensor_can_be_driven_and_one_without_a_monitor_cannot() -> None:
    rig = parse_rig("[daq.pip]\nterminal = ''\n", "x")
    found = outcomes(check(SimulatedRig(rig), rig, Willing()))
    assert {found[k].state for k in ("rest/pip", "moved/pip", "scale/pip")} == {"not applicable"}
    assert found["drive/direction"].state == "confirmed"
    rig = parse_rig("[daq.current_monitor]\nterminal = ''\n", "x")
    found = outcomes(check(SimulatedRig(rig), rig, Willing()))
    assert found["drive/direction"].state == "skipped"
    assert "no current monitor" in found["drive/direction"].sentence


def test_no_more_than_the_test_current_ever_flows_and_the_motor_goes_no_farther_than_it_may() -> None:
    for otherwise in ("", "[daq.command]\nsign = -1\n", "[daq.current_monitor]\ngain = 2.5\n"):
        card, device = card_with_bench()
        card.plant = SimulatedBench(Simulation(seed=2), parse_rig(otherwise, "wired").daq)
        device.move_by_hand = card.plant.move_by_hand  # type: ignore[attr-defined]
        outcomes(check(device, device.rig, Willing(), clock=card.clock.now, card=True, steps=BRIEF))
        assert 0.2 < max(abs(volts) for volts, line in card.history if line) <= 0.3 + 1e-9


def test_a_stop_ends_the_check() -> None:
    rig = default_rig()
    bench = InlineBench(SimulatedRig(rig), check_settings(rig), Path("not used"))

    class Pressing(Willing):
        def ask(self, step: str, question: str) -> str:
            if step == "drive":
                bench.stop()
            return super().ask(step, question)

    found = outcomes(check_rig(bench, rig, Pressing(), "test"))
    bench.close()
    assert list(found)[-1] == "stopped"
    assert "stop is latched" in found["stopped"].sentence


class Amplifier(SimulatedBench):
    """The simulated bench behind the charge pump of a dead-man, at a card that does not know of it."""

    card: Card
    sticks = False

    def advance(self, volts: float, enabled: bool) -> None:
        if not hasattr(self, "pump"):
            self.pump, self.beats = ChargePump(HOLD), 0
        edges = len(self.card.edges.get(DEAD_MAN, []))
        for _ in range(edges - self.beats):
            self.pump.invert()
        self.beats = edges
        self.pump.wait(1e-3)
        super().advance(volts, enabled and (self.pump.on or self.sticks))


HOLD = 0.05  # s; the rig file's


def wired_card(text: str) -> tuple[Card, NiCard, Amplifier]:
    """A card with all three lines, its amplifier, and somebody who presses, releases and switches."""
    rig = parse_rig(text + WIRED, "x")
    plant = Amplifier(Simulation(seed=2), rig.daq)
    card = Card(plant)
    plant.card, card.inputs = card, {STOP: True, READY: True}
    device = NiCard(rig, card.clock, InProcessChannel(Servicer(card)))

    def move_by_hand(channel: str, amount: float) -> None:
        if channel == "emergency_stop":
            card.inputs[STOP] = not amount
        elif channel == "amplifier_ready":
            card.inputs[READY] = bool(amount)
        else:
            plant.move_by_hand(channel, amount)

    device.move_by_hand = move_by_hand  # type: ignore[attr-defined]
    return card, device, plant


def test_lines_that_the_rig_file_does_not_wire_are_not_applicable() -> None:
    rig = default_rig()
    found = outcomes(check(SimulatedRig(rig), rig, Willing(), steps=BRIEF))
    assert [found[line].state for line in LINES] == ["not applicable"] * 3


def test_the_lines_of_the_simulated_rig_are_seen() -> None:
    rig = wired(default_rig())
    found = outcomes(check(SimulatedRig(rig), rig, Willing(), steps=BRIEF))
    assert [found[line].state for line in LINES] == ["confirmed"] * 3, [found[k].sentence for k in LINES]
    assert found["lines/emergency_stop"].measured["bench_stopped"] is True
    # 47 nF and 820 kOhm hold from the last rising edge on, at most one sample before the beat ended.
    assert found["drive/dead_man"].measured["hold_time"] == pytest.approx(HOLD, abs=3e-3)
    assert found["stop"].state == "confirmed"


@pytest.mark.parametrize("text", [SINGLE, BUFFERED], ids=["single-point", "buffered"])
def test_the_lines_of_a_card_are_seen(text: str) -> None:
    card, device, _ = wired_card(text)
    found = outcomes(check_card(card, device, BRIEF))
    assert [found[line].state for line in LINES] == ["confirmed"] * 3, [found[k].sentence for k in LINES]
    since_charged = 2e-3 if text == SINGLE else 20e-3  # every second edge feeds the pump
    assert HOLD - since_charged - 1e-3 <= found["drive/dead_man"].measured["hold_time"] <= HOLD
    assert not card.line


def test_a_comparator_that_is_stuck_high_is_found() -> None:
    card, device, plant = wired_card(SINGLE)
    plant.sticks = True
    rig = wired(default_rig())
    simulated = SimulatedRig(rig, faults=Faults(pump_sticks=True))
    for found in (
        outcomes(check_card(card, device, BRIEF)),
        outcomes(check(simulated, rig, Willing(), steps=BRIEF)),
    ):
        assert found["drive/direction"].state == "confirmed"
        assert found["drive/dead_man"].state == "failed"
        assert "stuck high" in found["drive/dead_man"].sentence


def test_a_pump_that_holds_for_longer_than_its_rig_file_says_is_found() -> None:
    rig = wired(default_rig())
    longer = replace(rig.daq, dead_man=replace(rig.daq.dead_man, hold_time=0.08))
    device = SimulatedRig(rig, wired=longer)
    found = outcomes(check(device, rig, Willing(), steps=BRIEF))["drive/dead_man"]
    assert found.state == "failed"
    assert "not 50 ms" in found.sentence


def test_lines_with_the_wrong_sense_or_no_wire_are_found() -> None:
    card, device, _ = wired_card(SINGLE)
    card.inputs[STOP] = False  # the wire is off
    found = outcomes(check_card(card, device, BRIEF))
    assert (found["lines/emergency_stop"].state, found["drive/dead_man"].state) == ("failed", "skipped")
    assert "reads pressed before anybody" in found["lines/emergency_stop"].sentence

    class Deaf(SimulatedRig):
        def set_line(self, line: str, on: bool) -> None:
            """Nothing arrives."""

    rig = wired(default_rig())
    found = outcomes(check(Deaf(rig), rig, Willing(), steps=BRIEF))
    assert "still read released" in found["lines/emergency_stop"].sentence
    assert "read ready without its supply" in found["lines/amplifier_ready"].sentence
    assert found["drive/dead_man"].state == "skipped"


def test_a_check_holds_for_the_wiring_and_limits_it_was_made_of(tmp_path: Path) -> None:
    text = '[daq]\ndevice = "Dev2"\n[limits]\ncurrent = 2.0\n'
    rig = parse_rig(text, "x")
    good = CheckProtocol("Dev2", "2026-11-23T10:00:00+01:00", rig, "x", (), "card")
    assert last_check(rig, "card", tmp_path / "none") == KeptCheck()
    keep(good, tmp_path)
    keep(good, tmp_path)  # never over another
    damaged = tmp_path / "2027-01-01T000000.json"
    damaged.write_text('{"kind": "check-rig", "bench": "card"', encoding="utf-8")
    known = last_check(rig, "card", tmp_path)
    assert known.confirmed
    assert known.current_share() == 1.0
    assert known.words == "checked on 2026-11-23 at 10:00, all confirmed"
    calibrated = parse_rig(text + "[daq.load_cell]\ngain = 11.3\noffset = -5.2\n", "x")
    assert last_check(calibrated, "card", tmp_path).confirmed
    for changed in (
        text.replace("2.0", "2.1"),
        text.replace("Dev2", "Dev1"),
        text + "[daq.encoder]\nsign = -1\n",
        text + '[daq.mcp]\nterminal = "ai7"\n',
        text + "[daq.current_monitor]\ngain = 1.3\n",
    ):
        other = last_check(parse_rig(changed, "x"), "card", tmp_path)
        assert not other.confirmed
        assert "were changed since" in other.words
        assert other.current_share() == 0.1
    assert not last_check(rig, "own:abc", tmp_path).date  # another bench
    missing = Outcome("scale/mcp", "MCP sensor, scaling", "skipped", "The operator left it out.")
    keep(CheckProtocol("Dev2", "2026-11-24T09:00:00+01:00", rig, "x", (missing,), "card"), tmp_path)
    newest = last_check(rig, "card", tmp_path)
    assert (newest.confirmed, newest.open) == (False, ("scale/mcp",))
    assert newest.sentence(rig).endswith(
        "scale/mcp: the current stays below 0.2 A, a tenth of its limit, until a check confirms it."
    )


def test_only_a_real_bench_has_its_check_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command writes its protocol either way; a rehearsal lets no motor have its whole current."""
    monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path))
    plant = SimulatedBench(Simulation(seed=2), default_rig().daq)
    card = Card(plant)
    device = NiCard(default_rig(), card.clock, InProcessChannel(Servicer(card)))
    device.move_by_hand = plant.move_by_hand  # type: ignore[attr-defined]

    def inline(choice: Any, settings: Any, rescue: Path, rate_hz: float) -> InlineBench:
        return InlineBench(device, settings, rescue)

    monkeypatch.setattr("fingerlab.acquisition.bench.process_bench.ProcessBench", inline)
    monkeypatch.setattr("fingerlab.devices.choosing.refuse_unknown", lambda choice: None)  # the card is here
    monkeypatch.setattr("fingerlab.cli.bench.somebody_there", lambda: True)
    out = tmp_path / "check.json"
    arguments = ["--device", "Dev1", "--out", str(out)]
    result = CliRunner().invoke(command, arguments, input="yes\n" * 60)
    assert result.exit_code == 0, result.output
    checks = tmp_path / "rigs" / "default" / "checks"
    (kept,) = checks.glob("*.json")
    assert json.loads(kept.read_text(encoding="utf-8")) == json.loads(out.read_text(encoding="utf-8"))
    assert last_check(default_rig(), "card", checks).confirmed
    rehearsed = ["--device", "simulated", "--yes", "--out", str(tmp_path / "again.json")]
    assert CliRunner().invoke(command, rehearsed).exit_code == 0
    assert len(list(checks.iterdir())) == 1
