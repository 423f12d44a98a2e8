"""What is entered for a run by hand, and what the bench then does."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractSpinBox, QDoubleSpinBox, QWidget

from fingerlab.acquisition.machine import Mode
from fingerlab.sessions import open_session

from .bench_hands import Rig
from .hands import LEFT, child


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


def test_a_load_goes_with_the_motor_bench_alone(rig: Rig) -> None:
    rig.choose("phase", "motor_bench")
    enter(rig, "knownLoad", "-0.02")
    assert rig.station.set_up.load_torque == -0.02
    rig.choose("phase", "on_air")
    assert (rig.station.set_up.cable, rig.station.set_up.load_torque) == ("extension", 0.0)
    assert not child(rig.window, QWidget, "knownLoad").isVisible()
    rig.choose("phase", "motor_bench")
    load = child(rig.window, QDoubleSpinBox, "knownLoad")
    assert rig.station.opened is not None
    limit = rig.station.opened.rig.limits.torque
    assert (load.minimum(), load.maximum()) == (-limit, limit)  # no more than the motor may hold
