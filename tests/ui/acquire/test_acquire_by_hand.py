"""What is entered for a run by hand, and what the bench then does."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractSpinBox, QDoubleSpinBox, QWidget

from fingerlab.acquisition.control.machine import Mode
from fingerlab.acquisition.ring import COLUMN
from fingerlab.sessions import open_session
from fingerlab.sessions.model import Array

from ..bench_hands import Rig
from ..hands import LEFT, child


def enter(rig: Rig, name: str, text: str) -> None:
    """Type into a field and press Return, as a person does."""
    field = child(rig.window, QAbstractSpinBox, name)
    assert field.isVisible(), name
    assert field.isEnabled(), f"{name}: {field.toolTip()}"
    QTest.mouseClick(field, LEFT)
    field.selectAll()
    QTest.keyClicks(field, text)
    QTest.keyClick(field, Qt.Key.Key_Return)


# known load


def test_a_known_load_is_lifted_and_recorded(rig: Rig) -> None:
    load = child(rig.window, QWidget, "knownLoad")
    assert not load.isVisible()
    rig.choose("phase", "motor_bench")
    assert load.isVisible()
    enter(rig, "knownLoad", "0.05")
    assert "known load of 50 mN m" in rig.label("message")
    rig.run(0.3)
    rig.enable()
    assert not load.isEnabled()
    assert "rests on its support" in rig.button("record").toolTip()
    enter(rig, "offset", "10")
    rig.click("start")
    assert rig.mode is Mode.ENABLED
    assert "-5°, where the known load rests on its support" in rig.label("message")
    rig.choose("kind", "blocked")
    enter(rig, "offset", "25")
    enter(rig, "before", "20")  # further back than the load was lifted
    rig.click("start")
    rig.run(0.3)
    rig.click("record")
    rig.run(5.0)
    rig.click("record")
    rig.run(0.2)
    (run,) = open_session(rig.write()).runs
    held = run.load(["load_torque", "motor_torque", "motor_position"])
    assert np.ptp(held["load_torque"]) == 0.0
    assert held["load_torque"][0] == pytest.approx(0.05)
    assert math.degrees(held["motor_position"][0]) == pytest.approx(3.0, abs=1.0)  # and never below 2
    assert math.degrees(held["motor_position"].min()) > 2.0
    assert math.degrees(held["motor_position"][-1]) == pytest.approx(25.0, abs=0.5)
    assert held["motor_torque"][-500:].mean() == pytest.approx(0.05, abs=0.01)  # but for friction


def loaded(rig: Rig, *fields: tuple[str, str]) -> None:
    """A known load held at 25 degrees, recorded."""
    rig.choose("phase", "motor_bench")
    enter(rig, "knownLoad", "0.05")
    rig.run(0.3)
    rig.enable()
    rig.choose("kind", "blocked")
    enter(rig, "offset", "25")
    for name, text in fields:
        enter(rig, name, text)
    rig.click("start")
    rig.run(0.2)
    rig.click("record")


def test_a_run_against_a_load_ends_with_its_timed_motion(rig: Rig) -> None:
    """Afterwards the load rests on its support: what was recorded then would say that it is carried."""
    loaded(rig, ("duration", "3"))
    assert rig.button("record").text() == "End &run"
    rig.run(5.0)
    assert rig.mode is Mode.ENABLED
    assert rig.button("record").text() == "Re&cord"
    assert rig.label("recordedText") == "1 run, not yet written"
    assert "Run 1 ended with its motion: the load is set down" in rig.label("status")
    (run,) = open_session(rig.write()).runs
    # From the key to the last sample of the motion's three seconds, and not one of the way down.
    began = round(1000 * float(run.attributes["trajectory_start_s"]))
    assert began < 0
    assert run.length == 3000 + began
    held = run.load(["load_torque", "motor_torque", "motor_command"])
    assert np.ptp(held["load_torque"]) == 0.0
    assert math.degrees(held["motor_command"][-1]) == pytest.approx(25.0, abs=0.1)
    assert held["motor_torque"][-500:].mean() == pytest.approx(0.05, abs=0.01)
    assert run.attributes["ended"] == "clean"


@pytest.mark.parametrize(("button", "ended"), [("finish", "clean"), ("stop", "truncated")])
def test_a_run_against_a_load_ends_where_it_is_set_down_by_hand(rig: Rig, button: str, ended: str) -> None:
    loaded(rig)
    rig.run(3.0)
    if button == "stop":
        rig.key(Qt.Key.Key_Escape)
    else:
        rig.click(button)
    at = rig.bench.status().index
    rig.run(2.0)
    assert not rig.recording.recording
    assert rig.label("recordedText") == "1 run, not yet written"
    (run,) = open_session(rig.write()).runs
    assert run.attributes["ended"] == ended
    torque = run.load(["motor_torque"])["motor_torque"]
    assert torque[-200:].mean() == pytest.approx(0.05, abs=0.01)  # carried to the last sample
    assert abs(run.length - (at - rig.bench.status().run_start)) < 300


def test_a_run_without_a_load_goes_on_after_its_motion(rig: Rig) -> None:
    """The way back to rest is a measurement like any other."""
    enter(rig, "duration", "2")
    rig.start()
    rig.click("record")
    rig.run(5.0)
    assert rig.mode is Mode.ENABLED
    assert rig.recording.recording
    rig.click("record")
    rig.run(0.2)
    (run,) = open_session(rig.write()).runs
    assert run.length > 4000


def test_a_run_says_which_motion_it_began_with_and_where_it_changed(rig: Rig) -> None:
    rig.start()
    began = rig.bench.status().run_start
    enter(rig, "amplitude", "7")  # not yet gone over to
    rig.click("record")
    rig.run(1.0)
    rig.click("start")
    changed = rig.bench.status().run_start
    rig.run(1.0)
    rig.click("record")
    rig.run(0.2)
    (run,) = open_session(rig.write()).runs
    assert run.trajectory["amplitude_deg"] == 15.0
    told = run.attributes["markers"]
    (marker,) = json.loads(told) if isinstance(told, str) else told
    assert marker["note"].startswith("motion: ")
    assert "7" in marker["note"]
    moved = float(run.attributes["trajectory_start_s"])
    assert moved < 0.0  # it ran before the key
    first = began - round(1000 * moved)
    assert first + round(1000 * marker["time"]) == changed


def test_a_load_goes_with_the_motor_bench_alone(rig: Rig) -> None:
    rig.choose("phase", "motor_bench")
    enter(rig, "knownLoad", "-0.02")
    assert rig.controller.set_up.load_torque == -0.02
    rig.choose("phase", "on_air")
    assert (rig.controller.set_up.cable, rig.controller.set_up.load_torque) == ("extension", 0.0)
    assert not child(rig.window, QWidget, "knownLoad").isVisible()
    rig.choose("phase", "motor_bench")
    load = child(rig.window, QDoubleSpinBox, "knownLoad")
    assert rig.controller.opened is not None
    limit = rig.controller.opened.rig.limits.torque
    assert (load.minimum(), load.maximum()) == (-limit, limit)  # no more than the motor may hold


# lines, sequence, ramp


def commanded(rig: Rig) -> Array:
    """The command since the motion was started, degrees at the pulley."""
    start = rig.bench.status().run_start
    _, values = rig.controller.history.series("motor_command", start, rig.controller.history.stop)
    return np.degrees(values)


def test_a_multisine_of_one_line_is_a_sine(rig: Rig) -> None:
    rig.choose("kind", "multisine")
    enter(rig, "lines", "1")
    enter(rig, "frequency", "2")
    enter(rig, "ramp", "1")
    rig.start()
    rig.run(6.5)
    # The first line is 0.3 times the base: 0.6 Hz, here over three whole periods after the ramp.
    wave = commanded(rig)[1000:6000]
    spectrum = np.abs(np.fft.rfft(wave)) / len(wave)
    assert spectrum[0] == pytest.approx(22.0, abs=0.1)
    assert 2 * spectrum[3] == pytest.approx(15.0, abs=0.1)
    assert 2 * np.delete(spectrum, [0, 3]).max() < 0.1


def test_lines_are_the_first_of_the_table_and_those_handed_over_stay(rig: Rig) -> None:
    motion = rig.tab.panel.motion
    rig.choose("kind", "multisine")
    assert "frequencies_hz" not in motion.settings()  # all five
    enter(rig, "lines", "3")
    assert motion.settings()["frequencies_hz"] == [0.3, 0.7, 1.1]
    lines = [0.4, 0.9, 1.5, 2.3, 2.9, 3.1]
    given = {"kind": "multisine", "amplitude_deg": 4.0, "frequency_hz": 1.0, "frequencies_hz": lines}
    motion.show_settings(given)
    assert motion.settings()["frequencies_hz"] == lines
    assert motion.numbers["lines"].value() == 6
    rig.tab.panel.history.note()
    enter(rig, "lines", "2")
    assert motion.settings()["frequencies_hz"] == [0.3, 0.7]
    rig.tab.panel.history.note()
    rig.tab.undo()
    assert (motion.settings()["frequencies_hz"], motion.numbers["lines"].value()) == (lines, 6)


def test_the_sequence_of_steps_and_the_ramp(rig: Rig) -> None:
    rig.choose("kind", "blocked")
    enter(rig, "ramp", "4")
    rig.start()
    rig.run(5.0)
    # A raised cosine: half of the way after half of the time, all of it after all.
    way = commanded(rig)
    assert (way[2000], way[1000]) == (pytest.approx(11.0, abs=0.05), pytest.approx(3.22, abs=0.05))
    assert way[4200] == pytest.approx(22.0, abs=0.01)
    rig.choose("kind", "steps")
    taken = []
    for seed in ("7", "8", "7"):
        enter(rig, "seed", seed)
        assert rig.tab.panel.motion.settings()["seed"] == int(seed)
        rig.click("start")
        rig.run(7.5)
        taken.append(commanded(rig)[4000:7000])  # the change itself takes the ramp's four seconds
    assert np.abs(taken[0] - taken[2]).max() < 0.01
    assert np.abs(taken[0] - taken[1]).max() > 1.0


# countdown


def test_a_timed_motion_counts_down(rig: Rig) -> None:
    enter(rig, "duration", "70")
    rig.start()
    assert rig.tab.panel.hand_left.isVisible()
    said = []
    for _ in range(3):
        rig.run(10.0)
        said.append(rig.label("motionLeft"))
        left = 70.0 - (rig.bench.status().index - rig.bench.status().run_start) / 1000.0
        assert left == pytest.approx(60.0 - 10.0 * (len(said) - 1), abs=0.3)
    assert said == ["1:00 left", "0:50 left", "0:40 left"]
    enter(rig, "duration", "2")
    rig.click("start")  # the change begins its own time
    rig.run(0.5)
    assert rig.label("motionLeft") == "0:02 left"
    rig.run(3.5)
    assert rig.mode is Mode.ENABLED
    assert rig.label("motionLeft") == ""
    enter(rig, "duration", "0")
    rig.click("start")
    rig.run(0.5)
    assert rig.mode is Mode.RUNNING
    assert rig.label("motionLeft") == ""  # until it is stopped


# jog, slack and contact


def position(rig: Rig) -> float:
    """Degrees."""
    return math.degrees(rig.bench.ring.last(1)[0, COLUMN["motor_position"]])


def test_a_jog_turns_while_its_button_is_held_and_holds_the_place_afterwards(rig: Rig) -> None:
    assert "enabled" in rig.button("jogForth").toolTip()
    rig.enable()
    forth = rig.button("jogForth")
    QTest.mousePress(forth, LEFT)
    rig.run(1.5)
    QTest.mouseRelease(forth, LEFT)
    rig.run(1.0)
    held = position(rig)
    assert held == pytest.approx(15.0, abs=5.0)  # 10 degrees a second, with a soft start
    rig.run(0.5)
    assert position(rig) == pytest.approx(held, abs=0.2)
    assert rig.mode is Mode.RUNNING
    rig.click("finish")
    rig.run(2.5)
    assert position(rig) == pytest.approx(0.0, abs=5.0)  # without current the springs take it


def test_who_lets_go_of_a_jog_after_a_fault_still_reads_the_fault(rig: Rig) -> None:
    rig.enable()
    forth = rig.button("jogForth")
    QTest.mousePress(forth, LEFT)
    rig.run(12.0)  # until a joint is beyond its limit
    assert rig.mode is Mode.FAULT
    said = rig.label("message")
    assert "beyond its limit" in said
    QTest.mouseRelease(forth, LEFT)
    rig.run(0.2)
    assert rig.label("message") == said


@pytest.mark.qt_log_ignore("This plugin does not support")  # a menu, on a screen that is none
def test_slack_is_taken_up_and_the_contact_found_by_a_button(rig: Rig) -> None:
    assert "initialising" in rig.button("takeUp").toolTip()
    rig.choose("phase", "contact")
    rig.click("initialise")
    rig.run(1.0)
    menu, pulley = rig.tab.panel.initial.menu(), rig.tab.panel.initial.position
    menu.popup(rig.window.mapToGlobal(rig.window.rect().center()))
    pulley.selectAll()
    QTest.keyClicks(pulley, "1o")
    menu.close()
    rig.click("takeUp")  # nothing moves by a number that nobody typed
    assert "'1o' is no number" in rig.label("message")
    assert not rig.controller.worker.busy
    assert rig.mode is Mode.INITIALISED
    pulley.setValue(0.0)
    rig.click("takeUp")
    rig.wait_idle()
    rig.run(0.2)
    assert rig.mode is Mode.INITIALISED
    assert position(rig) == pytest.approx(-3.0, abs=3.0)  # let go by 2 degrees
    rig.click("tare")
    rig.run(1.0)
    rig.click("enable")
    rig.run(0.2)
    assert rig.button("takeUp").toolTip() == "The amplifier is enabled; disable it first."
    rig.click("byProtocol")
    enter(rig, "contactForce", "170")
    rig.click("byHand")
    rig.click("findContact")
    assert "Contact force: 170 is more than it takes" in rig.label("message")
    assert rig.mode is Mode.ENABLED
    rig.click("byProtocol")
    enter(rig, "contactForce", "12")
    rig.click("byHand")
    rig.click("findContact")
    rig.wait_idle()
    assert rig.label("message") == "The load cell is to be pressed with 12 N; the limit of the force is 10 N."
    assert rig.mode is Mode.ENABLED
    rig.click("byProtocol")
    enter(rig, "contactForce", "0.8")
    rig.click("byHand")
    rig.click("findContact")
    rig.wait_idle()
    offset = child(rig.window, QDoubleSpinBox, "offset").value()
    assert offset == pytest.approx(position(rig), abs=1.0)
    assert rig.bench.ring.last(1)[0, COLUMN["endpoint_force"]] == pytest.approx(0.8, abs=0.3)
