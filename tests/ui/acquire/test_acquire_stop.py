"""STOP in every state of the bench, by its button and its key; faults."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

import pytest
from PySide6.QtCore import QCoreApplication, QPoint, Qt
from PySide6.QtGui import QAction, QWindow
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QLineEdit
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.control.machine import Mode, Tare
from fingerlab.core.errors import UserError
from fingerlab.devices.faults import Faults, LineFault
from fingerlab.sessions import open_session
from fingerlab.ui.acquire.recording_control import DetailsDialog
from fingerlab.ui.app import window
from fingerlab.ui.app.tab_registry import TABS

from ..bench_hands import PATIENCE, Rig
from ..hands import LEFT, child, chosen_in_menu, click

CONTROL = Qt.KeyboardModifier.ControlModifier
NONE = Qt.KeyboardModifier.NoModifier
STOPPED_WORDS = "STOP: motor current to zero, amplifier off"


@pytest.mark.parametrize("state", ["idle", "initialised", "enabled", "running", "stopping", "recording"])
def test_stop_in_every_state(rig: Rig, state: str, qtbot: QtBot) -> None:
    if state == "initialised":
        rig.click("initialise")
    elif state == "enabled":
        rig.enable()
    elif state != "idle":
        rig.start()
        rig.run(0.5)
    if state == "stopping":
        rig.click("finish")
    if state == "recording":
        rig.click("record")
        rig.run(0.5)
    rig.click("stop")
    status = rig.bench.status()
    assert status.latched
    assert not status.enabled
    assert rig.bench.device.driven_current == 0.0  # type: ignore[attr-defined]
    rig.run(0.1)
    kept = "idle" if state == "idle" else "initialised"  # the encoder counts on
    assert rig.label("rigState") == f"Stopped, {kept}"
    assert rig.window.header.lamp.light == "fault"
    if state == "recording":
        qtbot.waitUntil(lambda: rig.bench.status().recording == 0, timeout=PATIENCE)
        rig.run(0.1)
        rig.click("write")
        qtbot.waitUntil(lambda: bool(rig.files()) and not rig.controller.worker.busy, timeout=PATIENCE)
        assert open_session(rig.files()[0]).runs[0].length > 400
    rig.settle()
    rig.click("initialise")
    rig.run(0.1)
    assert not rig.button("enable").isEnabled()
    assert rig.button("enable").toolTip() == "The stop is latched; release it first, then enable."
    rig.click("release")
    rig.run(0.1)
    rig.click("enable")
    rig.run(0.1)
    assert rig.mode is Mode.ENABLED


def test_stop_in_fault_and_when_stopped_already(connect_rig) -> None:  # type: ignore[no-untyped-def]
    rig = connect_rig(Faults(late={2500: 0.05}))
    rig.start()
    rig.run(2.5)
    assert rig.mode is Mode.FAULT
    for _ in range(2):
        rig.click("stop")
        rig.run(0.1)
        status = rig.bench.status()
        assert (status.mode, status.latched, status.enabled) == (Mode.FAULT, True, False)
        assert rig.bench.device.driven_current == 0.0
    rig.click("release")
    rig.run(0.1)
    assert rig.window.task_bar.text.text() == "Stop released"
    rig.click("resetFault")
    rig.run(0.1)
    assert rig.mode is Mode.INITIALISED
    rig.click("stop")
    rig.run(0.1)
    assert rig.label("rigState") == "Stopped, initialised"
    assert not rig.button("enable").isEnabled()


def test_stop_stands_in_every_tab(rig: Rig) -> None:
    for tab in TABS:
        rig.window.show_tab("acquire")
        rig.settle()
        rig.start()
        assert rig.bench.status().enabled
        rig.window.show_tab(tab.key)
        assert rig.window.current == tab.key
        rig.click("stop")
        assert not rig.bench.status().enabled
        assert rig.bench.device.driven_current == 0.0  # type: ignore[attr-defined]
        rig.window.show_tab("acquire")
        rig.run(0.1)
        rig.click("release")
        rig.run(0.1)


def test_stop_while_a_protocol_records(rig: Rig, qtbot: QtBot) -> None:
    rig.click("byProtocol")
    rig.choose("protocol", "own_on_air")
    rig.tab.panel.protocol.seconds.setValue(3600.0)
    rig.click("runProtocol")
    qtbot.waitUntil(rig.tab.prompt.isVisible, timeout=PATIENCE)
    QTest.mouseClick(rig.tab.prompt.button, LEFT)
    qtbot.waitUntil(lambda: rig.bench.status().recorded > 1000, timeout=PATIENCE)
    rig.click("stop")
    qtbot.waitUntil(lambda: not rig.recording.in_protocol, timeout=PATIENCE)
    status = rig.bench.status()
    assert (status.latched, status.enabled) == (True, False)
    assert "what was recorded is in" in rig.label("message")
    assert open_session(rig.files()[0]).runs[0].length > 1000


def test_escape_stops_from_another_tab_and_from_a_field(rig: Rig) -> None:
    rig.start()
    rig.window.show_tab("model_lab")
    rig.key(Qt.Key.Key_Escape)
    assert not rig.bench.status().enabled
    rig.window.show_tab("acquire")
    rig.run(0.1)
    rig.click("release")
    rig.settle()
    rig.start()
    field = rig.tab.panel.motion.numbers["amplitude_deg"]
    field.setFocus()
    QTest.keyClick(field, Qt.Key.Key_Escape)
    assert not rig.bench.status().enabled


@pytest.mark.qt_log_ignore("This plugin does not support")  # of Qt's off-screen platform
def test_escape_stops_from_within_a_dialog(rig: Rig) -> None:
    """Which it closes, too; the system's own file dialogs would not let it through and are not used."""
    own = Qt.ApplicationAttribute.AA_DontUseNativeDialogs
    assert QCoreApplication.testAttribute(own)
    rig.start()
    rig.click("details")
    (dialog,) = rig.window.findChildren(DetailsDialog)
    assert dialog.isVisible()
    assert dialog.isModal()
    QTest.keyClick(dialog.findChildren(QLineEdit)[0], Qt.Key.Key_Escape)
    status = rig.bench.status()
    assert (status.latched, status.enabled) == (True, False)
    assert not dialog.isVisible()
    rig.run(0.1)
    rig.tab.disconnect_rig()
    rig.wait_idle()
    assert not QCoreApplication.testAttribute(own)


@pytest.mark.parametrize("button", [LEFT, Qt.MouseButton.RightButton])
def test_the_press_stops_and_not_the_release(rig: Rig, button: Qt.MouseButton) -> None:
    rig.start()
    handle, place = stop_of(rig)
    QTest.mousePress(handle, button, NONE, place)
    assert_stopped(rig)
    rig.run(0.7)
    log = list(rig.window.context.log)
    QTest.mouseRelease(handle, button, NONE, place)
    QTest.mousePress(handle, button, NONE, place)  # again: it is stopped, and stays so
    QTest.mouseRelease(handle, button, NONE, place)
    assert_stopped(rig)
    assert [line[10:] for line in rig.window.context.log[len(log) :]] == [STOPPED_WORDS]


def test_a_finger_stops(rig: Rig) -> None:
    rig.start()
    handle, place = stop_of(rig)
    finger = QTest.touchEvent(handle, QTest.createTouchDevice(), autoCommit=False)
    finger.press(0, place, handle)
    finger.commit()
    assert_stopped(rig)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it is the whole process")
def test_the_window_comes_first_while_a_rig_is_connected_and_its_workers_do_not(
    connect_rig: Callable[[], Rig],
) -> None:
    before = os.getpriority(os.PRIO_PROCESS, 0)
    rig = connect_rig()
    ahead = os.getpriority(os.PRIO_PROCESS, 0)
    assert ahead in (before - 5, before)  # who is not granted it goes on as before
    seen: list[int] = []
    rig.controller.worker.start("looking", lambda *_: seen.append(os.getpriority(os.PRIO_PROCESS, 0)))
    rig.wait_idle()
    assert seen == [before]
    rig.click("disconnect")
    rig.wait_idle()
    assert os.getpriority(os.PRIO_PROCESS, 0) == before


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_stop_without_a_rig_does_nothing(make_window, qtbot: QtBot) -> None:  # type: ignore[no-untyped-def]
    window = make_window(tab="model_lab")
    menu = window.menuBar().actions()[0].menu()
    window.menuBar().setActiveAction(window.menuBar().actions()[0])
    qtbot.waitUntil(menu.isVisible)
    said = list(window.context.log)
    for key in (Qt.Key.Key_Pause, Qt.Key.Key_Escape):
        QTest.keyClick(window.windowHandle(), key)
    menu.close()
    click(window, "stop")
    assert window.context.log == said
    assert window.stop_guard.stand_in is None
    assert not QCoreApplication.testAttribute(Qt.ApplicationAttribute.AA_DontUseNativeDialogs)


def test_another_key_for_the_foot_switch(rig: Rig) -> None:
    """Which is kept; where the display has no key for the whole system, the log and STOP say so."""
    assert any("Pause is heard only while FingerLab is in front" in line for line in rig.window.context.log)
    (chosen,) = (action for action in rig.window.findChildren(QAction) if action.text() == "F14")
    chosen.trigger()
    assert rig.window.settings.stop_key() == "F14"
    assert "F14 while FingerLab is in front" in rig.button("stop").toolTip()
    rig.start()
    rig.key(Qt.Key.Key_Pause)
    assert rig.bench.status().enabled
    rig.key(Qt.Key.Key_F14)
    assert_stopped(rig)


def stop_of(rig: Rig) -> tuple[QWindow, QPoint]:
    """The window as the system sees it, and STOP's place in it."""
    handle, button = rig.window.windowHandle(), rig.button("stop")
    assert handle is not None
    return handle, button.mapTo(rig.window, button.rect().center())


def assert_stopped(rig: Rig) -> None:
    status = rig.bench.status()
    assert (status.latched, status.enabled) == (True, False)
    assert rig.bench.device.driven_current == 0.0  # type: ignore[attr-defined]


def test_recording_shows_in_the_header_of_another_tab(rig: Rig) -> None:
    rig.click("record")
    rig.window.show_tab("model_lab")
    rig.run(1.0)
    text = child(rig.window, QLabel, "sampleCount")
    assert text.isVisible()
    assert int(text.text().removesuffix(" samples").replace("\u202f", "")) > 500


def test_a_fault_is_one_sentence_and_only_a_reset_leads_on(connect_rig) -> None:  # type: ignore[no-untyped-def]
    rig = connect_rig(Faults(late={2500: 0.05}))
    rig.start()
    rig.run(2.5)
    assert rig.mode is Mode.FAULT
    assert rig.window.message.isVisible()
    assert rig.label("message") == rig.bench.status().fault
    assert rig.label("rigState") == "In fault"
    rig.tab.panel.refresh()
    assert not rig.button("initialise").isEnabled()
    with pytest.raises(UserError, match="in fault; reset that first, then the load cell"):
        rig.bench.ask(Tare())
    assert not rig.button("tare").isEnabled()
    assert rig.button("tare").toolTip().startswith("The bench is in fault; reset that first")
    rig.click("resetFault")
    rig.run(0.1)
    assert rig.mode is Mode.INITIALISED
    assert rig.button("tare").isEnabled()


def test_the_emergency_stop_is_shown_in_words_and_holds_its_buttons_back(
    connect_rig: Callable[[Faults], Rig],
) -> None:
    rig = connect_rig(Faults(lines=(LineFault("emergency_stop", 1500, True, 2000),)))
    assert rig.label("safetyLines") == "Emergency stop released · Amplifier ready · Dead-man not wired"
    rig.start()
    rig.run(2.0)
    assert rig.mode is Mode.FAULT
    assert rig.bench.device.driven_current == 0.0  # type: ignore[attr-defined]
    assert rig.label("safetyLines").startswith("Emergency stop pressed · ")
    assert not rig.button("resetFault").isEnabled()
    assert "emergency stop is pressed" in rig.button("resetFault").toolTip()
    rig.run(2.5)
    assert rig.label("safetyLines").startswith("Emergency stop released · ")
    rig.click("resetFault")
    rig.run(0.1)
    rig.settle()
    rig.enable()


def test_the_appearance_stays_while_the_motor_is_on(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """New colours keep the window from answering for so long that the motor would be stopped."""
    looks = [chosen_in_menu(rig.window, text) for text in ("As the system", "Light", "Dark")]
    given: list[str] = []
    monkeypatch.setattr(window, "apply_appearance", lambda _app, look: given.append(look))
    assert all(look.isEnabled() for look in looks)
    rig.start()
    for look in looks:
        assert not look.isEnabled()
        assert look.toolTip() == "The appearance can be changed when the motor is off."
        look.trigger()
    rig.window.follow_desktop()  # as the desktop goes dark in the evening
    assert given == []
    rig.click("stop")
    rig.run(0.1)
    assert given == ["system"]
    for look in looks:
        assert look.isEnabled()
        assert look.toolTip() == look.text()
    looks[2].trigger()
    assert given == ["system", "dark"]
    rig.settle()
