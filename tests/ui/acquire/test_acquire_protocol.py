"""Protocols in Acquire: the cable is asked for, STOP ends them, other tabs hand them over."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QInputDialog, QLabel, QLineEdit
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.control.machine import Mode
from fingerlab.acquisition.protocols.steps import Change, Record
from fingerlab.sessions import open_session
from fingerlab.ui.app.context import Settings

from ..bench_hands import PATIENCE, Rig, opener, tabs_with
from ..hands import LEFT, child, drop

CONTROL = Qt.KeyboardModifier.ControlModifier


def run_protocol(rig: Rig, qtbot: QtBot, which: str, **numbers: float) -> None:
    """Choose a protocol, type its numbers, run it; until it asks for the cable."""
    rig.click("byProtocol")
    rig.choose("protocol", which)
    for name, value in numbers.items():
        getattr(rig.tab.panel.protocol, name).setValue(value)
    rig.click("runProtocol")
    qtbot.waitUntil(rig.tab.prompt.isVisible, timeout=PATIENCE)


def test_protocol_asks_for_the_cable_and_writes_the_file(rig: Rig, qtbot: QtBot) -> None:
    form = rig.tab.panel.protocol
    rig.click("byProtocol")
    form.which.setCurrentIndex(2)
    form.runs.setValue(1)
    form.seconds.setValue(2.0)
    form.rest.setValue(0.5)
    assert "2 runs" in rig.label("protocolTotal")
    rig.click("runProtocol")
    prompt = rig.tab.prompt
    asked = []
    for _ in range(2):
        qtbot.waitUntil(prompt.isVisible, timeout=PATIENCE)
        asked.append(rig.label("prompt"))
        rig.tab.panel.refresh()
        assert "protocol is under way" in rig.button("start").toolTip()
        QTest.keyClick(prompt.button, Qt.Key.Key_Space)
        qtbot.waitUntil(lambda: not prompt.isVisible(), timeout=PATIENCE)
    assert asked[0].startswith("Fix the extension cable to the pulley")
    assert asked[1].startswith("Fix the flexion cable to the pulley")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.recording.in_protocol, timeout=PATIENCE)
    runs = open_session(rig.files()[0]).runs
    assert [(run.phase, run.cable) for run in runs] == [("on_air", "extension"), ("contact", "flexion")]
    assert [run.length for run in runs] == [2000, 2000]
    assert rig.tab.panel.progress.isVisible()
    assert rig.tab.panel.progress.value() == 1000


def test_stop_in_the_moment_of_a_prompt_ends_the_protocol(rig: Rig, qtbot: QtBot) -> None:
    """STOP comes as the prompt does, before the protocol has begun to wait for its answer."""

    def at_once(sentence: str) -> None:
        assert rig.controller.bench is not None
        Bench.stop(rig.controller.bench)

    rig.tab.protocol.running.asked.connect(at_once, Qt.ConnectionType.DirectConnection)  # in its own thread
    rig.click("byProtocol")
    rig.choose("protocol", "own_on_air")
    rig.click("runProtocol")
    qtbot.waitUntil(lambda: not rig.recording.in_protocol, timeout=PATIENCE)
    assert "stopped" in rig.label("message")


def test_a_marker_while_a_protocol_records_and_a_countdown(rig: Rig, qtbot: QtBot) -> None:
    run_protocol(rig, qtbot, "own_on_air", runs=1, seconds=20.0)
    rig.tab.panel.refresh()
    assert not rig.button("mark").isEnabled()
    assert "between two runs" in rig.button("mark").toolTip()
    QTest.mouseClick(rig.tab.prompt.button, LEFT)
    said: list[str] = []

    def recording() -> bool:
        rig.controller.tick()
        said.append(rig.label("protocolLeft"))
        return rig.bench.status().recorded > 1000

    qtbot.waitUntil(recording, timeout=PATIENCE)
    rig.tab.panel.refresh()
    child(rig.window, QLineEdit, "note").setText("a knock")
    rig.click("mark")
    moment = rig.tab.plots._marks[-1][0]
    qtbot.waitUntil(lambda: recording() and not rig.recording.in_protocol, timeout=PATIENCE)
    (run,) = open_session(rig.files()[0]).runs
    (marker,) = json.loads(markers) if isinstance(markers := run.attributes["markers"], str) else markers
    assert marker["note"] == "a knock"
    assert 0.0 < marker["time"] < 20.0
    assert marker["time"] < moment  # seconds of the run, not of the bench
    steps = [text.split(" · ")[0] for text in said if text.startswith("Run 1 of 1: ")]
    left = [float(text.removeprefix("Run 1 of 1: 0:")) for text in steps]
    assert left == sorted(left, reverse=True)
    assert left[0] <= 20.0


def test_stop_ends_a_protocol_that_waits_for_the_operator(rig: Rig, qtbot: QtBot) -> None:
    rig.click("byProtocol")
    rig.click("runProtocol")
    qtbot.waitUntil(rig.tab.prompt.isVisible, timeout=PATIENCE)
    rig.key(Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not rig.recording.in_protocol, timeout=PATIENCE)
    assert not rig.tab.prompt.isVisible()
    assert "given up before a run was recorded" in rig.label("message")
    assert not rig.bench.status().enabled
    assert rig.files() == []


def test_a_protocol_handed_over_is_chosen(rig: Rig) -> None:
    from fingerlab.acquisition.control.machine import SetUp

    rig.window.show_tab("model_lab")
    sine = {"kind": "sine", "amplitude_deg": 5.0, "frequency_hz": 1.0, "duration_s": 3.0}
    steps = (Change(SetUp(), "Fix it."), Record(1, 1, "on_air", "extension", sine))
    rig.window.context.hand_protocol(steps, "Tell friction from hysteresis")
    assert rig.window.current == "acquire"
    assert rig.tab.panel.protocol.which.currentText() == "Tell friction from hysteresis"
    assert rig.tab.panel.protocol.steps({}) == steps
    assert rig.button("runProtocol").isVisible()
    assert rig.label("protocolTotal").startswith("1 run, about 6 s, and the changes of cable.")
    assert rig.label("protocolTotal").endswith("On air, extension cable: sine, 5°, 1 Hz.")
    load = {"intervention": json.dumps({"load_torque": 0.02})}
    loaded = (steps[0], replace(steps[1], attributes=load))
    rig.window.context.hand_protocol(loaded, "With a load")
    assert "with a known load of 20 mN m on the pulley beside the cable." in rig.label("protocolTotal")


def test_what_comes_before_a_rig_is_there_waits_for_it(
    make_window,  # type: ignore[no-untyped-def]
    qtbot: QtBot,
    settings: Settings,
    tmp_path: Path,
) -> None:
    settings.set_recordings(tmp_path / "recordings")
    table = tmp_path / "profile.csv"
    table.write_text("time_s,angle_deg\n0,0\n1,20\n2,0\n", encoding="utf-8")
    rig = Rig(make_window(tab="acquire", tabs=tabs_with(opener(tmp_path / "rescue"))), qtbot, connect=False)
    waits = child(rig.window, QLabel, "waitsForRig")
    assert not waits.isVisible()
    drop(rig.window, table)
    assert waits.isVisible()
    assert waits.text().startswith("profile.csv waits for a rig")
    assert rig.tab.panel.by_hand.isChecked()
    sine = {"kind": "sine", "amplitude_deg": 5.0, "frequency_hz": 1.0, "duration_s": 3.0}
    rig.window.context.hand_protocol((Record(1, 1, "on_air", "extension", sine),), "Wanted force, 1 N")
    assert waits.text().startswith("Wanted force, 1 N waits for a rig")
    rig.connect("connectSimulated")
    assert waits.isHidden()
    assert rig.tab.panel.protocol.which.currentText() == "Wanted force, 1 N"
    assert rig.tab.panel.motion.settings()["file"] == str(table)


def test_a_dropped_table_is_the_trajectory(rig: Rig, tmp_path: Path) -> None:
    table = tmp_path / "profile.csv"
    table.write_text("time_s,angle_deg\n0,0\n1,20\n2,0\n", encoding="utf-8")
    drop(rig.window, table)
    assert rig.tab.panel.motion.settings()["file"] == str(table)
    rig.enable()
    rig.click("start")
    rig.run(1.2)
    assert rig.mode is Mode.RUNNING


def test_a_stopped_protocol_goes_on_with_the_run_in_which_it_was_stopped(rig: Rig, qtbot: QtBot) -> None:
    form = rig.tab.panel.protocol
    rig.click("byProtocol")
    rig.choose("protocol", "own_scan")
    fields = [
        child(form, QLineEdit, f"scan_{name}") for name in ("frequency_hz", "amplitude_deg", "offset_deg")
    ]
    assert rig.label("protocolTotal").startswith("6 runs")
    for typed, said in (("0.5 to 1", "Frequency is '0.5 to 1'; it should be a number"), ("", "Nothing is")):
        fields[0].selectAll()
        QTest.keyClicks(fields[0], typed) if typed else QTest.keyClick(fields[0], Qt.Key.Key_Delete)
        assert rig.label("protocolTotal").startswith(said)
    for field, typed in zip(fields, ("0.5 1.0", "5 to 10 in 2", "20 25 30"), strict=True):
        QTest.keyClicks(field, typed)
    assert rig.label("protocolTotal").startswith("12 runs")
    for field, typed in zip(fields, ("0.5 1", "5 10", ""), strict=True):
        field.selectAll()
        QTest.keyClicks(field, typed) if typed else QTest.keyClick(field, Qt.Key.Key_Delete)
    run_protocol(rig, qtbot, "own_scan", seconds=2.0, rest=0.5)
    QTest.mouseClick(rig.tab.prompt.button, LEFT)
    said = rig.tab.panel.left
    qtbot.waitUntil(lambda: said.text().startswith("Run 2 of 4"), timeout=PATIENCE)
    rig.key(Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not rig.recording.in_protocol, timeout=PATIENCE)
    rig.wait_idle()
    assert said.text() == "Given up in run 2"
    assert rig.tab.panel.protocol.first.value() == 2
    (first,) = rig.files()
    rig.run(0.2)
    rig.click("release")
    rig.settle()
    rig.click("runProtocol")
    qtbot.waitUntil(rig.tab.prompt.isVisible, timeout=PATIENCE)  # the cable is asked for anew
    QTest.mouseClick(rig.tab.prompt.button, LEFT)
    qtbot.waitUntil(lambda: len(rig.files()) == 2 and not rig.recording.in_protocol, timeout=PATIENCE)
    (second,) = set(rig.files()) - {first}
    runs = open_session(second).runs
    asked = [(run.trajectory["frequency_hz"], run.trajectory["amplitude_deg"]) for run in runs]
    assert asked == [(0.5, 10.0), (1.0, 5.0), (1.0, 10.0)]
    assert [run.length for run in runs] == [2000, 2000, 2000]
    assert rig.tab.panel.protocol.first.value() == 1  # all are taken
    assert said.text() == "All runs taken"
    rig.choose("protocol", "force_trial")
    assert not said.text()  # that was said of another protocol


def test_a_table_of_runs_is_chosen_and_a_wrong_one_says_why(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "runs.csv"
    path.write_text("kind,amplitude_deg,duration_s,runs\nsine,5 10,4,3\n", encoding="utf-8")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(path), "")))
    rig.click("byProtocol")
    rig.choose("protocol", "table")
    rig.click("runTable")
    assert rig.label("protocolTotal").startswith("6 runs, about 42 s")  # 6 of 4 + 1 s, 5 rests of 2, 1.5 s
    path.write_text("kind,amplitude_deg\nwobble,5\n", encoding="utf-8")
    rig.click("runProtocol")
    assert "wobble" in rig.label("message")
    assert not rig.recording.in_protocol
    path.write_text("kind,amplitude_deg,offset_deg,duration_s\nsine,5 170,20,4\n", encoding="utf-8")
    rig.click("runProtocol")  # not after the first run, which could have taken hours
    assert rig.label("message").startswith("Run 2 of 2: The trajectory goes from -150° to 190°")
    assert not rig.recording.in_protocol
    assert not rig.files()


def test_a_protocol_stopped_between_two_runs_goes_on_with_the_second(
    rig: Rig, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At a change of the cable the run before is whole."""
    path = tmp_path / "runs.csv"
    path.write_text(
        "phase,kind,amplitude_deg,offset_deg,duration_s\non_air,sine,5,20,1\ncontact,sine,2,,1\n",
        encoding="utf-8",
    )
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(path), "")))
    rig.click("byProtocol")
    rig.choose("protocol", "table")
    rig.click("runTable")
    run_protocol(rig, qtbot, "table")
    prompt, asked = rig.tab.prompt, rig.label("prompt")
    QTest.mouseClick(prompt.button, LEFT)
    qtbot.waitUntil(lambda: prompt.isVisible() and rig.label("prompt") != asked, timeout=PATIENCE)
    rig.key(Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not rig.recording.in_protocol, timeout=PATIENCE)
    rig.wait_idle()
    assert rig.tab.panel.protocol.first.value() == 2
    assert rig.tab.panel.left.text() == "Given up in run 2"
    (run,) = open_session(rig.files()[0]).runs
    assert run.attributes["ended"] == "clean"


def test_gains_are_changed_while_it_runs_and_marked(rig: Rig) -> None:
    rig.start()
    rig.click("record")
    rig.run(0.5)
    rig.tab.panel.gains.numbers["proportional"].setValue(17.0)
    rig.run(0.5)
    assert rig.tab.panel.gains.text() == "Gains: 17, 25, 0.25"
    rig.click("record")
    rig.run(0.2)
    (run,) = open_session(rig.write()).runs
    told = run.attributes["gains"]
    assert (json.loads(told) if isinstance(told, str) else told)["proportional"] == 14.0  # as it began
    markers = run.attributes["markers"]
    (marker,) = json.loads(markers) if isinstance(markers, str) else markers
    assert marker["note"] == "gains: 17, 25, 0.25"
    assert 0.4 < marker["time"] < 0.7


def test_a_motion_is_kept_by_name_set_again_and_forgotten(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FINGERLAB_DATA_DIR", str(tmp_path))
    names = iter(["slow & wide", "slow wide", "slow wide"])
    monkeypatch.setattr(QInputDialog, "getText", staticmethod(lambda *_: (next(names), True)))
    panel, menu = rig.tab.panel, rig.tab.panel.motions

    def pick(words: str) -> None:
        menu.fill()
        actions = [
            *menu.menu().actions(),
            *(a for top in menu.menu().actions() if top.menu() for a in top.menu().actions()),
        ]
        next(action for action in actions if action.text().replace("&", "") == words).trigger()

    panel.motion.numbers["amplitude_deg"].setValue(31.0)
    panel.motion.duration.setValue(0.0)
    pick("Keep this motion…")
    assert "is no name for a motion" in rig.label("message")
    pick("Keep this motion…")
    kept = tmp_path / "motions" / "slow wide.json"
    assert json.loads(kept.read_text(encoding="utf-8"))["until_stopped"] is True
    pick("Keep this motion…")
    assert "kept already" in rig.label("message")
    panel.motion.numbers["amplitude_deg"].setValue(5.0)
    panel.motion.duration.setValue(8.0)
    pick("slow wide")
    assert panel.motion.numbers["amplitude_deg"].value() == 31.0
    assert panel.motion.endless
    menu.fill()
    forget = next(action.menu() for action in menu.menu().actions() if action.menu() is not None)
    forget.actions()[0].trigger()
    assert not kept.exists()
