"""The guided calibration with a simulated operator: what is captured, what is pointed out, what is stored."""

from __future__ import annotations

import json
import math
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
import pytest

from fingerlab.calibration import SENSORS, StepTiming
from fingerlab.calibration.offline import outcome_from_files
from fingerlab.calibration.outcome import CalibrationOutcome, compare
from fingerlab.calibration.sensors import own_plan, read_marks, standard_plan
from fingerlab.calibration.store import CalibrationStore, apply_again, calibrated_rig, rig_and_attributes
from fingerlab.calibration.wizard import Averager, Phase, Wizard, judge
from fingerlab.core.errors import Cancelled, UserError
from fingerlab.rig.daq import plain_section
from fingerlab.rig.file import default_rig
from fingerlab.sessions import open_session

from .operator_hands import Operator, angle_sensor, thesis_load_cell

LOAD_CELL, MCP = SENSORS["load-cell"], SENSORS["mcp"]


def load_cell_outcome(**operator: object) -> CalibrationOutcome:
    wizard = Wizard(standard_plan(LOAD_CELL), StepTiming(3.0, 1.0))
    Operator(wizard, thesis_load_cell, **operator).work()  # type: ignore[arg-type]
    return wizard.outcome()


def test_an_obedient_operator_gets_the_thesis_line_back() -> None:
    wizard = Wizard(standard_plan(LOAD_CELL))
    operator = Operator(wizard, thesis_load_cell)
    operator.work()
    assert wizard.number == 21
    # 15 s a step and a few for placing and for being sure that it stands still.
    assert 21 * 17 < operator.samples / 20 < 21 * 22
    for capture in wizard.captures:
        assert capture.end - capture.start == pytest.approx(5.0)
        assert capture.step.samples == 100  # the central 5 s at 20 Hz
    outcome = wizard.outcome()
    line = outcome.calibration
    assert line.gain.value == pytest.approx(11.194, rel=1e-3)
    assert line.offset.value == pytest.approx(-5.317, abs=0.005)
    assert line.r2 > 0.99999
    assert outcome.objections == ()
    assert outcome.repeat is not None
    assert len(outcome.repeat.known) == 10  # 0 to 900 g in both passes; 1 kg is the turning point
    assert outcome.repeat.deviation < 0.005
    assert [sweep.name for sweep in outcome.sweeps] == ["loading", "unloading"]


def test_a_wrong_weight_is_pointed_out_in_words_and_can_be_undone() -> None:
    wizard = Wizard(standard_plan(LOAD_CELL), StepTiming(3.0, 1.0))
    operator = Operator(wizard, thesis_load_cell, wrong={5: 0.7})
    operator.work(lambda: wizard.number == 6)
    (doubt,) = wizard.doubts()  # at once, not only at the end
    assert doubt.number == 5
    assert doubt.reads_like == pytest.approx(0.7)
    assert "Step 6 (loading, 500 g)" in doubt.words
    assert doubt.off == pytest.approx(0.2, abs=0.003)  # kg
    assert "g more than the other steps say" in doubt.words
    assert "like 700 g" in doubt.words
    assert "wrong weight" in doubt.words
    operator.wrong.clear()
    wizard.undo()
    assert wizard.number == 5
    assert wizard.phase is Phase.CHANGE
    operator.work(lambda: wizard.number == 6)
    assert wizard.doubts() == ()
    operator.work()
    assert wizard.outcome().objections == ()


def test_a_wrong_weight_that_stays_is_an_objection() -> None:
    outcome = load_cell_outcome(wrong={3: 0.4})
    (doubt,) = outcome.misplaced
    assert doubt.off == pytest.approx(0.1, abs=0.002)  # kg
    (objection,) = [text for text in outcome.objections if "Step 4 " in text]
    assert "300 g" in objection
    assert "like 400 g" in objection
    # Its residual by the common line: 0.981 N less what the line of 21 steps leans towards it, which is the
    # leverage 1/21 + (0.3 - mean)^2 / sum of squares; of known less line, so negative.
    marks = np.array(outcome.plan.marks)
    leverage = 1 / 21 + (0.3 - marks.mean()) ** 2 / ((marks - marks.mean()) ** 2).sum()
    assert outcome.calibration.residuals[3] == pytest.approx(-0.981 * (1 - leverage), abs=0.03)


def test_hysteresis_is_the_difference_of_the_passes() -> None:
    outcome = load_cell_outcome(second=0.05)  # V, about 0.56 N
    assert outcome.repeat is not None
    shift = 0.05 * outcome.calibration.gain.value
    assert outcome.repeat.differences[3] == pytest.approx(shift, rel=0.05)
    assert outcome.repeat.deviation == pytest.approx(shift / math.sqrt(2), rel=0.1)
    assert any("two passes differ" in text or "reads" in text for text in outcome.objections)


def test_angle_marks_twice() -> None:
    wizard = Wizard(standard_plan(MCP), StepTiming(3.0, 1.0))
    Operator(wizard, angle_sensor).work()
    outcome = wizard.outcome()
    assert len(outcome.plan.moves) == 14
    assert math.degrees(outcome.calibration.gain.value) == pytest.approx(40.0, rel=1e-3)
    assert math.degrees(outcome.calibration.offset.value) == pytest.approx(-44.0, abs=0.1)
    assert outcome.objections == ()
    assert outcome.repeat is not None
    assert len(outcome.repeat.known) == 7


def test_a_joint_at_the_wrong_mark() -> None:
    wizard = Wizard(standard_plan(MCP), StepTiming(3.0, 1.0))
    Operator(wizard, angle_sensor, wrong={9: 45.0}).work()
    (doubt,) = wizard.outcome().misplaced
    assert "Step 10 (second pass, 30°)" in doubt.words
    assert "like 45°" in doubt.words


def test_nothing_is_captured_before_the_operator_has_done_something() -> None:
    wizard = Wizard(standard_plan(LOAD_CELL), StepTiming(3.0, 1.0))
    time = np.arange(0, 60, 0.05)
    wizard.feed(time, np.full(len(time), 0.5))
    assert wizard.number == 1
    assert wizard.phase is Phase.CHANGE
    assert wizard.light == "stable"
    wizard.take_as_it_is()
    time = time + 60
    wizard.feed(time, np.full(len(time), 0.5))
    assert wizard.number == 2
    wizard.undo()
    wizard.undo()
    assert not wizard.can_undo
    wizard.redo()
    assert wizard.number == 1
    assert wizard.can_redo
    with pytest.raises(UserError, match="20 steps of 21"):
        wizard.outcome()


def test_the_first_mark_of_a_joint_waits_for_a_hand_or_for_a_word() -> None:
    """It had been captured as the joint stood when the calibration began."""
    time, still = np.arange(0, 10, 0.05), np.full(200, angle_sensor(20.0))
    wizard = Wizard(standard_plan(MCP), StepTiming(3.0, 1.0))
    wizard.feed(time, still)
    assert (wizard.number, wizard.phase, wizard.light) == (0, Phase.CHANGE, "stable")
    wizard.feed(time + 10, np.full(200, angle_sensor(0.0)))
    assert wizard.captures[0].step.volts == pytest.approx(angle_sensor(0.0))
    said = Wizard(standard_plan(MCP), StepTiming(3.0, 1.0))
    said.feed(time, still)
    said.take_as_it_is()
    said.feed(time + 10, still)
    assert (said.number, said.phase) == (1, Phase.CHANGE)
    loaded = Wizard(own_plan(LOAD_CELL, (0.1, 0.2, 0.3, 0.4)), StepTiming(3.0, 1.0))
    loaded.feed(time, np.full(200, thesis_load_cell(0.0)))
    assert loaded.number == 0  # nothing has been laid on


def test_a_stir_in_the_hold_begins_it_anew() -> None:
    wizard = Wizard(standard_plan(LOAD_CELL))
    time = np.arange(0, 12, 0.05)
    wizard.feed(time, np.full(len(time), 0.5))
    assert wizard.phase is Phase.HOLD
    assert 0.5 < wizard.held < 0.8
    wizard.feed(np.arange(12, 12.5, 0.05), np.full(10, 0.6))
    assert wizard.phase is Phase.SETTLE
    assert wizard.held == 0.0
    late = np.arange(12.5, 26.0, 0.05)
    wizard.feed(late, np.full(len(late), 0.5))
    assert wizard.number == 0  # the 15 s count from the stir on
    late = np.arange(26.0, 31.0, 0.05)
    wizard.feed(late, np.full(len(late), 0.5))
    assert wizard.number == 1


def test_a_gap_and_a_sensor_that_is_not_there() -> None:
    wizard = Wizard(standard_plan(LOAD_CELL))
    time = np.arange(0, 12, 0.05)
    wizard.feed(time, np.full(len(time), 0.5))
    wizard.feed(time + 30, np.full(len(time), 0.5))
    assert wizard.number == 0
    assert wizard.time[0] >= 30
    wizard.feed(np.array([50.0, 50.05, 50.1]), np.full(3, np.nan))
    assert wizard.light == "none"
    assert wizard.phase is not Phase.HOLD


def test_readings_are_averaged_to_20_a_second() -> None:
    averager = Averager()
    time = np.arange(2000) / 1000
    volts = np.arange(2000.0)
    pieces = [averager.feed(time[a : a + 37], volts[a : a + 37]) for a in range(0, 2000, 37)]
    times = np.concatenate([piece[0] for piece in pieces])
    means = np.concatenate([piece[1] for piece in pieces])
    np.testing.assert_allclose(times, np.arange(39) / 20)  # the last slot is not complete
    np.testing.assert_allclose(means, 24.5 + 50 * np.arange(39))


def test_creep_is_not_stillness() -> None:
    time = np.arange(0, 3, 0.05)
    assert judge(time, np.full(60, 0.7), 0.004).light == "stable"
    assert judge(time, 0.7 + 0.01 * time, 0.004).light == "moving"
    assert judge(time[:20], np.full(20, 0.7), 0.004).light == "moving"  # one second is too short to tell


# what is kept


def test_versions_are_kept_and_never_overwritten(tmp_path: Path) -> None:
    store = CalibrationStore(tmp_path / "rig")
    assert store.latest("load-cell") is None
    good, bad = load_cell_outcome(), load_cell_outcome(wrong={3: 0.4})
    moment = datetime(2026, 11, 21, 10, 0, tzinfo=UTC)
    first = store.save(good, "accepted", source="bench", now=moment)
    with pytest.raises(UserError, match="give a reason"):
        store.save(bad, "accepted")
    with pytest.raises(UserError, match="Say why"):
        store.save(bad, "accepted with a reason", "  ")
    second = store.save(bad, "accepted with a reason", "weights are marked wrong", now=moment)
    third = store.save(bad, "rejected", now=moment)
    assert [one.version for one in store.history("load-cell")] == [3, 2, 1]
    assert len({first.path, second.path, third.path}) == 3
    latest = store.latest("load-cell")
    assert latest is not None
    assert latest.version == 2  # a rejected one is kept and never used
    assert latest.reason == "weights are marked wrong"
    assert first.title == f"version 1 of {moment.astimezone():%Y-%m-%d}"
    change = compare(good.calibration, first.data["gain"], first.data["offset"])
    assert change.gain == pytest.approx(0.0, abs=1e-12)
    assert change.within
    assert second.path is not None
    second.path.write_text("{}", encoding="utf-8")
    with pytest.raises(UserError, match="no stored calibration"):
        store.latest("load-cell")


def test_the_rig_takes_the_line_whatever_its_sign(tmp_path: Path) -> None:
    store = CalibrationStore(tmp_path)
    wizard = Wizard(standard_plan(MCP), StepTiming(3.0, 1.0))
    Operator(wizard, angle_sensor).work()
    store.save(wizard.outcome(), "accepted")
    rig = default_rig()
    daq = plain_section(rig.daq)
    daq["mcp"]["sign"] = -1
    rig.extra["daq"] = daq
    changed, attributes = rig_and_attributes(rig, tmp_path)
    assert math.degrees(changed.daq.mcp.quantity(1.1 + 30 / 40)) == pytest.approx(30.0, abs=0.05)
    assert changed.daq.pip == rig.daq.pip
    assert "calibration version 1" in changed.daq.sources["mcp.gain"]
    assert json.loads(attributes["calibration"])["mcp"]["version"] == 1
    assert rig_and_attributes(rig, tmp_path / "empty") == (rig, {})


@pytest.mark.parametrize("tared_at", [None, 0.52])
def test_an_old_session_is_calibrated_anew(make_session, tmp_path: Path, tared_at) -> None:  # type: ignore[no-untyped-def]
    """Taught by the definition: force = new gain * (volts - volts at the tare), or the new line."""
    old_gain, old_offset = 11.194, -5.317  # the default rig's line
    volts = np.linspace(0.5, 1.3, 4000)

    def add(file: h5py.File) -> None:
        rig = json.loads(file.attrs["rig"])
        rig["daq"] = plain_section(default_rig().daq)
        file.attrs["rig"] = json.dumps(rig)
        run = file["runs/001"]
        run["raw/force_volts"] = volts
        run["raw/force_volts"].attrs["units"] = "V"
        zero = 0.0 if tared_at is None else -(old_gain * tared_at + old_offset)
        run["endpoint_force"][...] = old_gain * volts + old_offset + zero

    source = make_session(change=add, phases=(("contact", "flexion"),))
    before = source.read_bytes()
    store = CalibrationStore(tmp_path / "rig")
    wizard = Wizard(standard_plan(LOAD_CELL), StepTiming(3.0, 1.0))
    Operator(wizard, lambda mark: 0.48 + 9.81 * mark / 11.0).work()
    store.save(wizard.outcome(), "accepted")
    heard: list[float] = []
    target, told = apply_again(source, tmp_path / "anew.h5", store.current(), lambda s, _: heard.append(s))
    assert heard == sorted(heard)
    assert len(heard) > 2
    files = sorted(tmp_path.rglob("*"))
    for call in range(len(heard)):  # cancelled at any of them, nothing is left behind

        def cancelled(_share: float, _what: str, left: list[int] = [call]) -> None:  # noqa: B006
            left[0] -= 1
            if left[0] < 0:
                raise Cancelled

        with pytest.raises(Cancelled):
            apply_again(source, tmp_path / "cancelled.h5", store.current(), cancelled)
        assert sorted(tmp_path.rglob("*")) == files
    assert source.read_bytes() == before
    assert told == [f"load-cell: 1 run by {store.current()['load-cell'].title}"]
    session = open_session(target)
    forces = session.runs[0].load(["endpoint_force"])["endpoint_force"]
    zero_volts = 0.48 if tared_at is None else tared_at
    np.testing.assert_allclose(forces, 11.0 * (volts - zero_volts), atol=0.01)
    assert session.rig.daq.load_cell.gain == pytest.approx(11.0, rel=1e-3)
    assert "load-cell" in json.loads(str(session.attributes["calibration"]))
    with pytest.raises(UserError, match="not overwritten"):
        apply_again(source, target, store.current())
    with pytest.raises(UserError, match="holds no volts as read"):
        apply_again(source, tmp_path / "other.h5", calibrations_of_mcp(tmp_path))


def calibrations_of_mcp(folder: Path):  # type: ignore[no-untyped-def]
    store = CalibrationStore(folder / "mcp")
    wizard = Wizard(standard_plan(MCP), StepTiming(3.0, 1.0))
    Operator(wizard, angle_sensor).work()
    store.save(wizard.outcome(), "accepted")
    assert calibrated_rig(default_rig(), store.current()).daq.mcp.gain > 0
    return store.current()


def test_recordings_made_before(tmp_path: Path) -> None:
    marks = standard_plan(LOAD_CELL).marks
    time = np.arange(21 * 300) / 20
    volts = np.array([thesis_load_cell(marks[min(int(t / 15), 20)]) for t in time])
    whole, half = tmp_path / "whole.txt", tmp_path / "half.txt"
    np.savetxt(whole, np.c_[time, volts], header="time (s)\tload cell (V)", comments="", delimiter="\t")
    np.savetxt(half, np.c_[time, volts][: 11 * 300], delimiter="\t")
    both, notes = outcome_from_files([whole], LOAD_CELL)
    assert [sweep.name for sweep in both.sweeps] == ["loading", "unloading"]
    assert both.calibration.gain.value == pytest.approx(11.194, rel=1e-4)
    assert "21 steps of 15 s" in notes[0]
    loading, _ = outcome_from_files([half], LOAD_CELL)
    assert loading.repeat is None
    twice, _ = outcome_from_files([half, half], LOAD_CELL)
    assert twice.repeat is not None
    assert twice.repeat.largest == pytest.approx(0.0, abs=1e-9)
    shares: list[float] = []
    outcome_from_files([whole, half], LOAD_CELL, progress=lambda share, _: shares.append(share))
    assert shares == sorted(shares)
    assert 0.0 < shares[0] <= 0.5 < shares[-1] <= 1.0
    with pytest.raises(UserError, match="3 files were chosen"):
        outcome_from_files([half] * 3, LOAD_CELL)


@pytest.mark.parametrize(
    ("volts_at", "steps", "words"),
    [
        (lambda m: thesis_load_cell(m) - 0.45, 1, "gives 0.025 V, and its data sheet allows 0.45 to 0.55 V"),
        (lambda m: 0.975 - thesis_load_cell(m), 3, "The reading falls as the known value grows"),
        (lambda m: 0.475 + 0.5 * (thesis_load_cell(m) - 0.475), 3, "changes by 50 % of what the data sheet"),
        (thesis_load_cell, 12, ""),
    ],
)
def test_zero_sense_and_span_are_judged_from_the_first_steps(volts_at, steps: int, words: str) -> None:  # type: ignore[no-untyped-def]
    wizard = Wizard(standard_plan(LOAD_CELL), StepTiming(3.0, 1.0), rises=True)
    Operator(wizard, volts_at, noise=1e-4).work(lambda: wizard.number == steps)
    assert words in wizard.early()
    assert bool(wizard.early()) == bool(words)


def test_a_turned_angle_sensor_is_told_at_the_second_mark() -> None:
    for rises, told in ((True, True), (False, False), (None, False)):
        wizard = Wizard(standard_plan(MCP), StepTiming(3.0, 1.0), rises=rises)
        operator = Operator(wizard, lambda mark: 3.9 - mark / 40.0)
        operator.work(lambda w=wizard: w.number == 2)
        assert ("falls as the known value grows" in wizard.early()) is told
        operator.work()  # whoever goes on all the same hears it again before accepting
        assert any("falls as the known" in one for one in wizard.outcome().objections) is told


def test_an_angle_sensor_without_supply_or_beyond_its_range_is_told_at_the_first_mark() -> None:
    for volts, told in ((0.0, True), (4.9, True), (2.5, False)):
        wizard = Wizard(standard_plan(MCP), StepTiming(3.0, 1.0))
        Operator(wizard, lambda _, at=volts: at, noise=1e-4).work(lambda w=wizard: w.number == 1)
        assert ("its data sheet allows 0.25 to 4.75 V" in wizard.early()) is told
        assert bool(wizard.early()) is told


def test_weights_and_marks_are_the_operator_s_own() -> None:
    marks = read_marks(LOAD_CELL, "0, 50 200;500")
    assert marks == (0.0, 0.05, 0.2, 0.5)
    assert read_marks(MCP, "0;10,5;30") == (0.0, 10.5, 30.0) == read_marks(MCP, "0 10,5 30")
    assert read_marks(MCP, "0,10.5,30") == (0.0, 10.5, 30.0)
    plan = own_plan(LOAD_CELL, (0.5, 0.0, 0.2, 0.05))
    assert plan.marks == (0.0, 0.05, 0.2, 0.5, 0.2, 0.05, 0.0)
    assert plan.moves[2].words == "Lay weights of 200 g in all on the load cell."
    wizard = Wizard(plan, StepTiming(3.0, 1.0))
    Operator(wizard, thesis_load_cell).work()
    assert wizard.outcome().calibration.gain.value == pytest.approx(11.194, rel=2e-3)
    assert own_plan(MCP, (0.0, 20.0, 75.0)).marks == (0.0, 20.0, 75.0) * 2
    for text, words in (
        ("0 10 20", "needs 4 different"),
        ("0 1 1 2 3", "each once"),
        ("0 -5 8 9", "0 g to 20000 g"),
    ):
        with pytest.raises(UserError, match=words):
            own_plan(LOAD_CELL, read_marks(LOAD_CELL, text))
    with pytest.raises(UserError, match="no list of known values"):
        read_marks(MCP, "0 10 many")
