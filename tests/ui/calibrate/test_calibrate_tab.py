"""Calibrate, as a person works it: the real window, a simulated operator at a sensor that gives volts."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QFileDialog,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QTableWidget,
)
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.bench.process_bench import InlineBench
from fingerlab.acquisition.ring import COLUMN, COLUMNS, Ring
from fingerlab.calibration import StepTiming
from fingerlab.calibration.wizard import Phase
from fingerlab.rig.daq import plain_section
from fingerlab.rig.file import default_rig
from fingerlab.sessions import open_session, text_table
from fingerlab.ui.acquire import acquire_tab
from fingerlab.ui.acquire.bench_setup import BenchRequest, OpenBench, open_bench
from fingerlab.ui.app.context import RigLine, Settings
from fingerlab.ui.app.tab_registry import TABS
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.calibrate import calibrate_tab
from fingerlab.ui.calibrate.calibrate_tab import CalibrateTab
from fingerlab.ui.calibrate.measure_page import AMPLIFIER_ON

from ..bench_hands import Rig, opener, tabs_with
from ..hands import LEFT, child
from ..looking import look
from ..saving import save_each_plot

RATE = 20.0
CONTROL = Qt.KeyboardModifier.ControlModifier

SIMULATED = Path("rigs", "simulated", "calibrations")
"""Where the simulated rig's calibrations are kept, among the user's data."""


class Bench:
    """A bench of which only the ring is looked at: volts of a load cell, as its operator places weights."""

    def __init__(self, window: MainWindow, folder: Path, wrong: Mapping[int, float] | None = None) -> None:
        self.window = window
        tab = window.tab("calibrate")
        assert isinstance(tab, CalibrateTab)
        self.tab = tab
        self.wrong = dict(wrong or {})
        self.ring = Ring.make(4096, len(COLUMNS), shared=False)
        self.index = 0
        self._mark = 0.0
        self._random = np.random.default_rng(3)
        bench: Any = SimpleNamespace(ring=self.ring, rate_hz=RATE)
        window.context.show_bench(OpenBench(bench, default_rig(), {}, folder))

    def run(self, seconds: float) -> None:
        """Time passes; the operator places what is asked for, half a second after it is asked."""
        wizard = self.tab.wizard
        asked, since = -1, 0
        for _ in range(round(seconds * RATE)):
            if wizard is not None and wizard.move is not None:
                since = since + 1 if asked == wizard.number else 0
                asked = wizard.number
                if since > 10:
                    self._mark = self.wrong.get(asked, wizard.move.mark)
            row = [0.0] * len(COLUMNS)
            row[COLUMN["index"]] = self.index
            volts = (9.81 * self._mark + 5.317) / 11.194  # thesis (2.1) the other way round
            row[COLUMN["raw/force_volts"]] = volts + self._random.normal(0, 0.0005)
            self.ring.write(tuple(row))
            self.index += 1
            if self.index % 10 == 0:
                self.tab.source.tick()
        self.tab.source.tick()

    def work(self, steps: int = 21) -> None:
        """The operator goes on until so many steps are captured."""
        wizard = self.tab.wizard
        assert wizard is not None
        for _ in range(400):
            if wizard.number >= steps or wizard.phase is Phase.DONE:
                return
            self.run(1.0)
        raise AssertionError(f"stuck at step {wizard.number + 1}: {wizard.phase}")

    def click(self, name: str) -> None:
        button = child(self.window, QPushButton, name)
        assert button.isVisible(), name
        assert button.isEnabled(), f"{name}: {button.toolTip()}"
        QTest.mouseClick(button, LEFT)

    def label(self, name: str) -> str:
        text: str = child(self.tab.widget, QLabel, name).text()
        return text.replace("\u00a0", " ")

    def files(self) -> list[Path]:
        return sorted(self.tab.store().folder.glob("*.json"))


@pytest.fixture(autouse=True)
def agree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibrate_tab, "ask_to_leave", lambda *_: True)


@pytest.fixture
def window(make_window: Callable[..., MainWindow], tmp_path: Path) -> MainWindow:
    def make(context: Any) -> CalibrateTab:
        return CalibrateTab(context, StepTiming(3.0, 1.0), tmp_path / "default-rig")

    tabs = tuple(replace(entry, make=make) if entry.key == "calibrate" else entry for entry in TABS)
    return make_window(tab="calibrate", tabs=tabs)


@pytest.fixture
def bench(window: MainWindow, tmp_path: Path) -> Iterator[Bench]:
    made = Bench(window, tmp_path / SIMULATED)
    yield made
    window.context.show_bench(None)


def told(window: MainWindow) -> str:
    return window.context.log[-1]


def test_without_a_rig_the_way_to_one_is_offered(window: MainWindow) -> None:
    tab = window.tab("calibrate")
    assert "No rig is connected" in child(tab.widget, QLabel, "calibrateRig").text()
    start = child(window, QPushButton, "start-load-cell")
    assert not start.isEnabled()
    assert "No rig" in start.toolTip()
    assert child(window, QPushButton, "file-load-cell").isEnabled()
    assert not child(window, QPushButton, "applyAgain").isEnabled()  # there is no calibration yet
    QTest.mouseClick(child(window, QPushButton, "calibrateConnect"), LEFT)
    assert window.current == "acquire"


def test_the_load_cell_from_start_to_stored(bench: Bench) -> None:
    bench.click("start-load-cell")
    assert "Take every weight off" in bench.label("calibrationWords")
    assert bench.label("calibrationStep") == "Step 1 of 21 – loading"
    bench.run(3.5)
    assert bench.label("stability") == "stable"
    assert "central 1 s are captured" in bench.label("calibrationState")
    assert bench.label("calibrationVolts") == f"{bench.tab.wizard.reading:.4f} V"  # type: ignore[union-attr]
    bench.work(1)
    assert "Add a 100 g weight" in bench.label("calibrationWords")
    table = child(bench.window, QTableWidget, "calibrationSteps")
    assert float(table.item(0, 2).text()) == pytest.approx(0.475, abs=0.001)  # 5.317 / 11.194
    bench.work()
    assert "nothing speaks against it" in bench.label("calibrationVerdict")
    assert bench.label("number-Gain").startswith("11.19")
    assert bench.label("number-Before") == "no earlier one"
    assert "inside" in bench.label("number-Data sheet")
    bench.click("acceptCalibration")
    (path,) = bench.files()
    data = json.loads(path.read_text(encoding="utf-8"))
    assert data["verdict"] == "accepted"
    assert data["gain"]["value"] == pytest.approx(11.194, rel=1e-3)
    assert "version 1" in bench.label("current-load-cell")


def test_a_wrong_weight_is_said_and_undone_by_key(bench: Bench) -> None:
    bench.wrong = {4: 0.5}
    bench.click("start-load-cell")
    bench.work(5)
    doubt = bench.label("calibrationDoubt")
    assert "Step 5 (loading, 400 g)" in doubt
    assert "like 500 g" in doubt
    bench.wrong = {}
    QTest.keyClick(bench.window, Qt.Key.Key_Z, CONTROL)
    assert bench.label("calibrationStep") == "Step 5 of 21 – loading"
    assert not child(bench.window, QLabel, "calibrationDoubt").isVisible()
    bench.work(6)
    assert not child(bench.window, QLabel, "calibrationDoubt").isVisible()


def test_a_wrong_weight_needs_a_reason_to_be_accepted(bench: Bench) -> None:
    bench.wrong = {16: 0.2}  # 400 g wanted
    bench.click("start-load-cell")
    bench.work()
    assert "like 200 g" in bench.label("calibrationObjections")
    accept = child(bench.window, QPushButton, "acceptCalibration")
    assert not accept.isEnabled()
    assert not child(bench.window, QPushButton, "acceptWithReason").isEnabled()
    field = child(bench.window, QLineEdit, "calibrationReason")
    QTest.keyClicks(field, "two weights fell")
    bench.click("acceptWithReason")
    (path,) = bench.files()
    data = json.loads(path.read_text(encoding="utf-8"))
    assert data["verdict"] == "accepted with a reason"
    assert data["reason"] == "two weights fell"
    assert any("like 200 g" in text for text in data["objections"])


def test_a_step_that_was_forgotten_is_waited_for(bench: Bench) -> None:
    bench.wrong = {1: 0.0}
    bench.click("start-load-cell")
    bench.work(1)
    bench.run(12.0)
    assert bench.label("calibrationStep") == "Step 2 of 21 – loading"
    assert "still that of the last step" in bench.label("calibrationState")
    bench.click("takeStep")  # the operator insists
    bench.work(2)


def test_the_first_mark_of_a_joint_waits_for_a_hand_as_the_others_do(bench: Bench) -> None:
    bench.run(1.0)
    bench.click("start-mcp")
    bench.run(12.0)
    assert bench.label("calibrationStep") == "Step 1 of 14 – first pass"
    assert bench.label("calibrationState") == (
        "Waiting: the reading is still where it stood; if it is as asked, say so."
    )
    bench.click("takeStep")  # it stands at the mark already
    bench.work(1)


def test_rejecting_and_going_back(bench: Bench) -> None:
    bench.click("start-load-cell")
    bench.work()
    bench.click("backToSteps")
    assert bench.label("calibrationStep") == "Step 21 of 21 – unloading"
    bench.click("redoStep")
    bench.click("rejectCalibration")
    assert "not calibrated on this rig yet" in bench.label("current-load-cell")
    assert len(bench.files()) == 1  # kept, as rejected


def test_the_amplifier_must_be_off_and_the_rig_there(bench: Bench) -> None:
    context = bench.window.context
    context.show_rig(RigLine(light="live", device="rig", live=True))
    assert child(bench.window, QPushButton, "start-load-cell").toolTip() == AMPLIFIER_ON
    context.show_rig(RigLine(light="ready", device="rig"))
    bench.click("start-load-cell")
    bench.run(3.5)
    context.show_rig(RigLine(light="live", device="rig", live=True))
    bench.run(6.0)
    assert bench.tab.wizard is not None
    assert bench.tab.wizard.number == 0  # no hand is at the rig now
    assert bench.label("calibrationState") == AMPLIFIER_ON
    context.show_bench(None)
    bench.tab.source.tick()
    assert bench.label("calibrationState") == "No rig is connected."
    bench.click("leaveCalibration")
    assert child(bench.window, QPushButton, "calibrateConnect").isVisible()


def test_from_a_recording_without_a_rig(
    window: MainWindow, make_session: Any, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    time = np.arange(11 * 60) / RATE  # 3 s a step
    volts = (9.81 * np.minimum(np.floor(time / 3.0), 10) / 10 + 5.317) / 11.194
    path = tmp_path / "load cell.txt"
    np.savetxt(path, np.c_[5 * time, volts], header="time (s)\tload cell (V)", comments="", delimiter="\t")
    monkeypatch.setattr(QFileDialog, "getOpenFileNames", staticmethod(lambda *_: ([str(path)], "")))
    QTest.mouseClick(child(window, QPushButton, "file-load-cell"), LEFT)
    tab = window.tab("calibrate")
    assert isinstance(tab, CalibrateTab)
    qtbot.waitUntil(lambda: tab.outcome is not None)
    assert child(tab.widget, QLabel, "number-Repeatability").text() == "one pass only"
    QTest.mouseClick(child(window, QPushButton, "acceptCalibration"), LEFT)
    (stored,) = (tmp_path / "default-rig").glob("*.json")
    assert json.loads(stored.read_text(encoding="utf-8"))["source"] == str(path)
    calibrate_old_session(window, make_session, tmp_path, qtbot, monkeypatch)
    monkeypatch.setattr(QFileDialog, "getOpenFileNames", staticmethod(lambda *_: ([str(stored)], "")))
    QTest.mouseClick(child(window, QPushButton, "file-load-cell"), LEFT)
    qtbot.waitUntil(lambda: not window.tasks.busy)
    assert tab.outcome is None
    assert str(stored) in told(window)  # a file that is no recording is a sentence


def calibrate_old_session(
    window: MainWindow, make_session: Any, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the button, from the volts as read: what was recorded with another line gets the one accepted."""
    volts = np.linspace(0.5, 1.3, 4000)

    def add(file: h5py.File) -> None:
        run = file["runs/001"]
        run["raw/force_volts"] = volts
        run["raw/force_volts"].attrs["units"] = "V"
        run["endpoint_force"][...] = 10.0 * volts - 4.0
        rig = json.loads(file.attrs["rig"])
        rig["daq"] = plain_section(default_rig().daq)
        rig["daq"]["load_cell"] |= {"gain": 10.0, "offset": -4.0}
        file.attrs["rig"] = json.dumps(rig)

    source = make_session("old.h5", change=add, phases=(("contact", "flexion"),))
    before, target = source.read_bytes(), tmp_path / "anew.h5"
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(source), "")))
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_: (str(target), "")))
    QTest.mouseClick(child(window, QPushButton, "applyAgain"), LEFT)
    qtbot.waitUntil(lambda: target.exists() and not window.tasks.busy)
    assert "1 run by version 1" in told(window)
    forces = open_session(target).runs[0].channel("endpoint_force")
    np.testing.assert_allclose(forces, 11.194 * volts - 5.317, atol=0.01)
    assert source.read_bytes() == before


def test_reading_a_recording_tells_how_far_it_is_and_can_be_cancelled(
    window: MainWindow, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "load cell.txt"
    np.savetxt(path, np.arange(1000.0).reshape(500, 2), delimiter="\t")
    go_on, parse = Event(), np.loadtxt

    def slowly(*given: Any, **more: Any) -> Any:
        go_on.wait(30.0)
        return parse(*given, **more)

    monkeypatch.setattr(np, "loadtxt", slowly)
    monkeypatch.setattr(text_table.read_blocks, "__defaults__", (100,))
    tab = window.tab("calibrate")
    assert isinstance(tab, CalibrateTab)
    tab.read_files("load-cell", [path])
    status = child(window, QLabel, "status")
    qtbot.waitUntil(lambda: status.text() == "Reading the recording: reading load cell.txt")
    assert child(window, QProgressBar, "progress").value() > 0
    QTest.mouseClick(child(window, QPushButton, "cancel"), LEFT)
    go_on.set()
    qtbot.waitUntil(lambda: not window.tasks.busy)
    assert status.text() == "Reading the recording: stopped"
    assert tab.outcome is None


def test_live_volts_of_the_rig_that_acquire_connects(
    make_window: Callable[..., MainWindow], settings: Settings, tmp_path: Path, qtbot: QtBot
) -> None:
    """A hand puts 500 g on the simulated rig's cell: by thesis (2.1) 0.438 V more."""
    plain = opener(tmp_path / "rescue")

    def connect(wanted: BenchRequest) -> OpenBench:
        return replace(plain(wanted), calibrations=tmp_path / SIMULATED, simulated=True)

    settings.set_recordings(tmp_path / "recordings")
    window = make_window(tab="acquire", tabs=tabs_with(connect))
    rig = Rig(window, qtbot)
    window.show_tab("calibrate")
    tab = window.tab("calibrate")
    assert isinstance(tab, CalibrateTab)
    assert "a button does what you would do" in child(tab.widget, QLabel, "calibrateRig").text()
    rig.click("start-load-cell")
    assert tab.wizard is not None
    levels = []
    for mass in (0.0, 0.5):
        rig.bench.device.bench.move_by_hand("load_cell", 9.81 * mass)  # type: ignore[attr-defined]
        rig.run(3.0)
        tab.source.tick()
        assert tab.wizard.light == "stable"
        levels.append(tab.wizard.reading)
    assert levels[1] - levels[0] == pytest.approx(9.81 * 0.5 / 11.194, abs=0.005)
    rig.tab.disconnect_rig()
    qtbot.waitUntil(lambda: not rig.controller.worker.busy)
    assert rig.label("calibrationState") == "No rig is connected."
    tab.leave()


def test_what_was_accepted_counts_at_the_next_connection(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop gets the stored line; the rig and the attribute of sessions to come say which it was."""
    bench.click("start-load-cell")
    bench.work()
    bench.click("acceptCalibration")
    made: list[Any] = []
    monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path))
    monkeypatch.setattr(
        "fingerlab.acquisition.bench.process_bench.ProcessBench",
        lambda *given: made.append(given) or object(),
    )
    opened = open_bench(BenchRequest("simulated"))
    (record,) = (json.loads(path.read_text(encoding="utf-8")) for path in bench.files())
    settings = made[0][1]
    assert settings.units.force.gain == record["gain"]["value"]
    assert settings.units.force.offset == record["offset"]["value"]
    assert opened.rig.daq.load_cell.gain == record["gain"]["value"]
    assert json.loads(opened.attributes["calibration"])["load-cell"] == record
    assert opened.calibrations == tmp_path / SIMULATED


@pytest.mark.qt_log_ignore("This plugin does not support")  # dialogs, on a screen that is none
def test_every_page_of_the_wizard_is_whole_and_its_plots_are_saved(bench: Bench, tmp_path: Path) -> None:
    look(bench.window)
    bench.click("start-load-cell")
    bench.wrong = {4: 0.7}
    bench.run(3.5)
    look(bench.window)
    bench.work(5)
    look(bench.window)
    save_each_plot(bench.window, tmp_path / "live", 1)
    bench.work()
    assert "objection" in bench.label("calibrationVerdict")
    look(bench.window)
    save_each_plot(bench.window, tmp_path / "result", 2)


@pytest.mark.parametrize(("fault", "words"), [("", ""), ("load-cell-weak", "changes by 50 %")])
def test_a_calibration_is_rehearsed_on_the_simulated_rig_with_weights_of_one_s_own(
    make_window: Callable[..., MainWindow],
    settings: Settings,
    qtbot: QtBot,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    fault: str,
    words: str,
) -> None:
    """By its buttons; a sensor that shows half of its span is told at the second weight."""
    monkeypatch.setattr(acquire_tab, "ask_to_close", lambda *_: True)
    monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path))

    def inline(choice: Any, loop: Any, rate_hz: float) -> InlineBench:
        return InlineBench(replace(choice, real_time=False).build(), loop, tmp_path / "rescue")

    def make(context: Any) -> CalibrateTab:
        return CalibrateTab(context, StepTiming(2.0, 1.0), tmp_path / "default-rig")

    tabs = tabs_with(lambda wanted: open_bench(wanted, inline))
    tabs = tuple(replace(entry, make=make) if entry.key == "calibrate" else entry for entry in tabs)
    rig = Rig(make_window(tab="acquire", tabs=tabs), qtbot, connect=False)
    rig.choose("simulatedFault", fault)
    child(rig.window, QDoubleSpinBox, "faultAfter").setValue(1.0)
    rig.connect("connectSimulated")
    rig.run(1.5)
    rig.window.show_tab("calibrate")
    tab = rig.window.tab("calibrate")
    assert isinstance(tab, CalibrateTab)
    marks = child(rig.window, QLineEdit, "marks-load-cell")
    marks.setText("0 half 1000")
    rig.click("start-load-cell")
    assert "no list of known values" in rig.label("message")
    marks.setText("0 300 600 1000")
    rig.click("start-load-cell")
    wizard = tab.wizard
    assert wizard is not None
    assert not child(rig.window, QLabel, "message").isVisible()
    assert wizard.plan.marks == (0.0, 0.3, 0.6, 1.0, 0.6, 0.3, 0.0)
    seen = ""
    for _ in range(7):
        step = wizard.number
        rig.click("rehearseStep")
        for _ in range(20):
            if wizard.number > step:
                break
            rig.run(1.0)
            tab.source.tick()
        seen = seen or rig.label("calibrationDoubt").replace("\u00a0", " ") * (wizard.number == 2)
    assert words in seen
    assert bool(seen) == bool(words)
    assert tab.outcome is not None
    gain = tab.outcome.calibration.gain.value
    assert gain == pytest.approx(11.194 * (2.0 if fault else 1.0), rel=0.03)
