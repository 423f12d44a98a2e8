"""Every device through the window: chosen by clicks, driven, recorded, stopped, lost.

The window's own way of opening is used (``open_bench``); only the processes are left out, so that time is
the bench's own. The last test has the processes, too.
"""

from __future__ import annotations

import math
import os
import signal
import threading
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QLabel
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.control.machine import Mode
from fingerlab.core.errors import UserError
from fingerlab.core.text import ParameterEstimate
from fingerlab.core.trust import OwnSource
from fingerlab.devices.choosing import detect
from fingerlab.devices.faults import FAULT_KINDS
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.protocol import VirtualClock
from fingerlab.devices.simulated import SimulatedBench, SimulatedRig, Simulation
from fingerlab.models.file import DIAGNOSIS_METHOD, SavedModel, save_model
from fingerlab.rig.file import default_rig, load_rig
from fingerlab.sessions import open_session
from fingerlab.ui.acquire import acquire_tab
from fingerlab.ui.acquire.bench_setup import BenchRequest, open_bench, own_device_file

from ..bench_hands import PATIENCE, Rig, tabs_with
from ..hands import child
from ..virtual_card import Card, DaqFailure, InProcessChannel, Servicer, TcpServer

ROOT = Path(__file__).resolve().parents[3]
WindowMaker = Callable[..., Any]
Build = Callable[[Any], Any]
"""A device choice -> its device on a virtual clock."""


def on_virtual_clock(choice: Any) -> Any:
    return choice.build(VirtualClock())


def drive_and_record(rig: Rig) -> Path:
    """Initialise, enable, start, record for a second, to rest; the file."""
    rig.start()
    rig.run(1.8)  # the soft start
    rig.click("record")
    rig.run(1.05)
    rig.click("record")
    rig.run(0.1)
    rig.click("finish")
    for _ in range(20):  # with much friction it takes long to come to rest
        if rig.mode is not Mode.ENABLED:
            rig.run(0.25)
    assert rig.mode is Mode.ENABLED
    return rig.write()


def swing(path: Path) -> float:
    """Range of the recorded position, degrees."""
    (run,) = open_session(path).runs
    return math.degrees(float(np.ptp(run.load(["motor_position"])["motor_position"])))


def assert_lost(rig: Rig, words: str, state: str = "In fault") -> None:
    """One sentence across the window, the light, and a way back to the choice of devices."""
    sentence = rig.label("message")
    assert words in sentence
    assert "\n" not in sentence
    assert "Error" not in sentence
    assert rig.label("rigState") == state
    assert rig.window.header.lamp.light == "fault"
    assert not rig.bench.status().enabled
    rig.tab.panel.refresh()
    assert not rig.button("enable").isEnabled()
    rig.click("disconnect")
    rig.wait_idle()
    assert rig.tab.connect_page.isVisible()


def test_simulated_rig_with_a_hidden_effect_and_a_fault(unconnected) -> None:  # type: ignore[no-untyped-def]
    rig = unconnected(on_virtual_clock)
    rig.choose("simulatedEffect", "hidden")
    rig.choose("simulatedFault", "unplugged")
    page = rig.tab.connect_page
    page.seed.setValue(7)
    page.fault_after.setValue(10.0)
    rig.connect("connectSimulated")
    assert rig.controller.opened.simulated
    path = drive_and_record(rig)
    assert swing(path) == pytest.approx(
        30.0, abs=4.0
    )  # 15 degrees to either side, less what the effect holds
    attributes = open_session(path).attributes
    assert "sealed" in " ".join(attributes)
    assert "coulomb" not in str(attributes)
    rig.click("record")
    while rig.mode is not Mode.FAULT:
        rig.run(0.5)
    assert rig.bench.status().index >= 9999
    assert_lost(rig, "no longer answers, as if its cable had been pulled")


def test_the_bench_of_a_saved_model_is_simulated(  # type: ignore[no-untyped-def]
    unconnected, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is asked for when it is connected; one that is no model is refused in one sentence."""
    file = tmp_path / "found.json"
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(file), "")))
    file.write_text("{}", encoding="utf-8")
    rig = unconnected(on_virtual_clock)
    rig.choose("simulatedEffect", "model")
    rig.click("connectSimulated")
    rig.wait_idle()
    assert "found.json is not a FingerLab model file" in rig.label("message")
    friction = {"motor_coulomb_friction.coulomb": ParameterEstimate(6e-3, "N m", 5.9e-3, 6.1e-3)}
    shapes = {"motor_coulomb_friction": {"travel_deg": 0.4, "sharpness": 1.0}}
    file.unlink()
    save_model(
        SavedModel(DIAGNOSIS_METHOD, friction, (), ("motor_coulomb_friction",), {"shapes": shapes}), file
    )
    rig.connect("connectSimulated")
    assert rig.controller.opened.simulated
    assert '"preset": "found.json"' in str(rig.controller.opened.attributes)


def test_every_effect_and_every_fault_is_offered(unconnected) -> None:  # type: ignore[no-untyped-def]
    from fingerlab.twin.effects import EFFECTS

    page = unconnected(on_virtual_clock).tab.connect_page
    assert {page.effect.itemData(row) for row in range(page.effect.count())} == {
        "", "hidden", "model", *EFFECTS,
    }  # fmt: skip
    assert [page.fault.itemData(row) for row in range(page.fault.count())] == ["", *FAULT_KINDS]
    assert not page.fault_after.isEnabled()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("dead-mcp", "MCP"),
        ("stuck-encoder", "encoder"),
        ("late", "50 ms"),
    ],
)
def test_a_fault_that_was_asked_for_stops_the_motor_with_one_sentence(  # type: ignore[no-untyped-def]
    unconnected, fault: str, words: str
) -> None:
    rig = unconnected(on_virtual_clock)
    rig.choose("simulatedFault", fault)
    rig.tab.connect_page.fault_after.setValue(3.2)
    rig.connect("connectSimulated")
    rig.start()
    rig.run(4.5)
    assert rig.mode is Mode.FAULT
    assert words in rig.label("message")
    assert not rig.bench.status().enabled


def test_a_run_of_a_recording_is_replayed(  # type: ignore[no-untyped-def]
    unconnected, make_session, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = make_session("old.h5", samples=6000)
    rig = unconnected(on_virtual_clock)
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(source), "")))
    rig.click("connectReplay")
    rig.wait_idle()
    assert not rig.tab.connect_page.replay_text.isVisible()
    rig.choose("replayRun", "002")
    rig.connect("replayThis")
    assert rig.label("deviceName").endswith("run 002")
    rig.click("record")
    rig.run(1.2)
    rig.click("record")
    rig.run(0.2)
    rig.click("stop")
    rig.run(0.1)
    assert rig.label("rigState") == "Stopped, idle"
    path = rig.write()
    # What was measured then, in its units: 22 degrees and a sine of 14.9 to either side (conftest).
    assert swing(path) == pytest.approx(29.8, abs=0.2)
    rig.click("release")
    rig.run(7.0)
    assert_lost(rig, "has come to its end")


def test_a_file_that_is_no_recording_is_refused_in_one_sentence(  # type: ignore[no-untyped-def]
    unconnected, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def find(rig_file: Path | None) -> Any:
        return detect(load_rig(rig_file) if rig_file else None)

    rig = unconnected(on_virtual_clock, find)
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(wrong), "")))
    wrong = tmp_path / "notes.h5"
    wrong.write_text("nothing", encoding="utf-8")
    rig.click("connectReplay")
    rig.wait_idle()
    assert "notes.h5" in rig.label("message")
    assert rig.button("connectSimulated").isEnabled()
    wrong = tmp_path / "wires.toml"
    wrong.write_text("[daq", encoding="utf-8")
    rig.window.context.hush()
    rig.click("rigFile")
    rig.wait_idle()
    assert "wires.toml" in rig.label("message")
    assert rig.tab.connect_page.rig_file is None
    assert not rig.button("connectCard").isEnabled()
    wrong = tmp_path / "empty.toml"
    wrong.touch()
    rig.window.context.hush()
    rig.click("rigFile")
    rig.wait_idle()
    assert "empty.toml says nothing of a rig" in rig.label("message")
    assert rig.tab.connect_page.rig_file is None


def test_closed_while_it_connects_it_lets_the_bench_go(unconnected) -> None:  # type: ignore[no-untyped-def]
    """What is opened for a check once the window is closed has nobody else to end its processes."""
    asked, go_on, closed = threading.Event(), threading.Event(), list[SimulatedRig]()

    class Watched(SimulatedRig):
        def close(self) -> None:
            closed.append(self)
            super().close()

    def build(_choice: Any) -> Watched:
        asked.set()
        assert go_on.wait(30.0)
        return Watched()

    rig = unconnected(build)
    rig.click("checkRig")
    assert asked.wait(30.0)
    threading.Timer(0.3, go_on.set).start()  # the window is closed by then
    rig.window.close()
    assert not rig.window.isVisible()
    assert len(closed) == 1


def test_a_device_of_one_s_own_is_asked_about_once_and_driven(  # type: ignore[no-untyped-def]
    unconnected, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "docs" / "own_device_example.py").read_text(encoding="utf-8")
    waits = next(line for line in text.splitlines() if "time.sleep(" in line)
    file = tmp_path / "my_device.py"
    file.write_text(text.replace(waits, "        pass"), encoding="utf-8")  # time is the test's
    asked: list[str] = []
    answers = [False, True, True]

    def ask(parent: object, file: OwnSource) -> bool:
        asked.append(file.state)
        return answers.pop(0)

    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    monkeypatch.setattr("fingerlab.ui.acquire.connect_page.ask_to_run", ask)
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(file), "")))
    rig = unconnected(lambda choice: choice.build())
    rig.click("connectOwn")
    assert asked == ["waiting"]
    assert not rig.controller.worker.busy  # nothing of the file was run
    rig.connect("connectOwn")
    assert "rotor" in rig.label("deviceName")
    assert not rig.controller.opened.simulated
    rig.choose("phase", "motor_bench")
    rig.run(0.1)
    rig.start()
    rig.run(2.0)
    assert rig.mode is Mode.RUNNING
    rig.click("stop")
    rig.run(0.1)
    rig.click("disconnect")
    rig.wait_idle()
    page = rig.tab.connect_page
    assert [page.own_file.itemText(row) for row in range(page.own_file.count())][:1] == ["my_device.py"]
    rig.connect("connectOwn")  # this content is known
    rig.click("disconnect")
    rig.wait_idle()
    assert asked == ["waiting", "waiting"]
    file.write_text("raise RuntimeError('no hardware here')\n", encoding="utf-8")
    rig.click("connectOwn")
    rig.wait_idle()
    assert asked == ["waiting", "waiting", "changed"]
    assert "RuntimeError: no hardware here" in rig.label("message")
    rig.click("forgetOwn")
    assert [page.own_file.itemText(row) for row in range(page.own_file.count())] == ["a Python file …"]
    assert not rig.button("forgetOwn").isVisible()
    assert own_device_file(file).state == "waiting"


def test_an_own_device_that_was_not_asked_about_is_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    file = tmp_path / "my_device.py"
    file.write_text("raise AssertionError\n", encoding="utf-8")
    before = own_device_file(file)
    file.write_text("raise AssertionError  # since then\n", encoding="utf-8")
    for asked in (None, before):
        with pytest.raises(UserError, match="changed meanwhile"):
            open_bench(BenchRequest(f"own:{file}", own=asked))


def test_a_card_is_connected_driven_recorded_and_lost(unconnected, qtbot: QtBot) -> None:  # type: ignore[no-untyped-def]
    card = Card(SimulatedBench(Simulation(seed=5), default_rig().daq))
    channel = InProcessChannel(Servicer(card))
    rig = unconnected(
        lambda choice: NiCard(choice.rig, card.clock, channel), lambda rig_file: detect(None, channel)
    )
    assert "PCIe-6343" in rig.label("foundSentence")
    rig.connect("connectCard")
    assert "Dev1" in rig.label("deviceName")
    # Behind a channel the card is read in blocks, where the position loop is softer: as in tests/devices.
    assert swing(drive_and_record(rig)) == pytest.approx(30.0, abs=1.5)
    rig.click("start")
    rig.run(1.0)
    assert card.line
    rig.click("stop")
    assert (card.volts, card.line) == (0.0, False)
    rig.run(0.1)
    rig.click("release")

    def gone() -> None:
        raise DaqFailure(-88710)  # the driver's own number for a device that was removed

    for call in ("ReadAnalogF64", "ReadCounterScalarF64", "ReadCounterF64Ex", "WriteAnalogScalarF64"):
        card.hooks[call] = gone
    rig.run(0.2)
    assert rig.window.message.isVisible()
    assert "\n" not in rig.label("message")
    assert not rig.bench.status().enabled
    rig.run(1.0)  # no sample has come: no reading is one of now, and no run can begin
    readings = [one for pane in rig.tab.plots.panes.values() for one in pane.readings.values()]
    assert {one.value.text()[:1] for one in readings} == {"–"}
    assert "no samples" in rig.button("record").toolTip()
    assert not rig.button("record").isEnabled()


def test_a_card_behind_the_server_of_a_rig_file(  # type: ignore[no-untyped-def]
    unconnected, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = Card(SimulatedBench(Simulation(seed=5), default_rig().daq))
    monkeypatch.setattr("fingerlab.devices.ni.connection.RPC_DEADLINE", 30.0)  # other tests share the machine
    server = TcpServer(Servicer(card))
    rig_file = tmp_path / "far.toml"
    default = resources.files("fingerlab.resources").joinpath("rigs/default.toml").read_text(encoding="utf-8")
    far = default.replace('server = ""', f'server = "{server.address}"', 1)
    rig_file.write_text(far, encoding="utf-8")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(rig_file), "")))
    try:
        rig = unconnected(
            lambda choice: choice.build(card.clock), lambda file: detect(load_rig(file) if file else None)
        )
        assert not rig.button("connectCard").isEnabled()
        rig.click("rigFile")
        rig.wait_idle()
        assert server.address in rig.label("foundSentence")
        rig.connect("connectCard")
        assert swing(drive_and_record(rig)) == pytest.approx(30.0, abs=2.5)  # the loop runs in blocks
    finally:
        server.stop()
    rig.run(0.1)
    assert_lost(rig, "the device server does not answer")
    rig.wait_idle()
    rig.click("lookAgain")
    rig.wait_idle()
    assert "does not answer: using the simulated rig" in rig.label("foundSentence")


def test_a_rig_file_without_a_finger_does_not_record_what_could_not_be_opened(  # type: ignore[no-untyped-def]
    unconnected, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = Card(SimulatedBench(Simulation(seed=5), default_rig().daq))
    channel = InProcessChannel(Servicer(card))
    rig_file = tmp_path / "wires.toml"
    rig_file.write_text('[daq]\ndevice = "Dev1"\n', encoding="utf-8")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(rig_file), "")))
    rig = unconnected(
        lambda choice: NiCard(choice.rig, card.clock, channel), lambda file: detect(None, channel)
    )
    rig.click("rigFile")
    rig.wait_idle()
    rig.connect("connectCard")
    rig.click("record")
    assert "names no finger" in rig.label("message")
    assert not rig.recording.recording
    rig.choose("phase", "motor_bench")
    rig.run(0.1)
    rig.click("record")
    rig.run(0.5)
    rig.click("record")
    rig.run(0.2)
    assert open_session(rig.write()).runs[0].phase == "motor_bench"


def test_with_processes_of_their_own_and_the_loop_lost(  # type: ignore[no-untyped-def]
    monkeypatch: pytest.MonkeyPatch, make_window: WindowMaker, settings, qtbot: QtBot, tmp_path: Path
) -> None:
    monkeypatch.setattr(acquire_tab, "ask_to_close", lambda *_: True)
    monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path))
    settings.set_recordings(tmp_path / "recordings")
    rig = Rig(make_window(tab="acquire", tabs=tabs_with(open_bench)), qtbot, connect=False)
    rig.click("connectSimulated")
    qtbot.waitUntil(lambda: rig.controller.bench is not None, timeout=PATIENCE)
    rig.click("record")
    qtbot.waitUntil(lambda: (rig.controller.status.recorded or 0) > 500, timeout=PATIENCE)
    os.kill(rig.controller.bench.loop_process.pid, signal.SIGKILL if hasattr(signal, "SIGKILL") else 9)
    message = child(rig.window, QLabel, "message")
    qtbot.waitUntil(lambda: message.isVisible() and "loop" in message.text(), timeout=PATIENCE)
    qtbot.waitUntil(lambda: not rig.controller.worker.busy and not rig.recording.recording, timeout=PATIENCE)
    (run,) = open_session(rig.write()).runs
    assert run.length > 250
    rig.window.setFocus(Qt.FocusReason.OtherFocusReason)
    rig.click("disconnect")
    rig.wait_idle()
    assert rig.tab.connect_page.isVisible()
