"""What is typed stays and is told to be wrong, messages move nothing, lists say what cannot be and why."""

from __future__ import annotations

from dataclasses import replace

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.control.machine import Mode
from fingerlab.ui.acquire.bench_setup import OpenBench
from fingerlab.ui.widgets.fields import NumberField, number

from ..bench_hands import Rig, opener, tabs_with
from ..hands import child

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")  # fields alone, off screen


def enter(field: QDoubleSpinBox, text: str, key: Qt.Key = Qt.Key.Key_Return) -> None:
    """Type over what stands in a field."""
    field.setFocus()
    field.selectAll()
    QTest.keyClick(field, Qt.Key.Key_Delete)
    QTest.keyClicks(field, text)
    QTest.keyClick(field, key)


@pytest.fixture
def field(qtbot: QtBot) -> NumberField:
    made = number("amplitude", 15.0, 0.0, 120.0, 1, 1.0, "Amplitude: half of the range.")
    qtbot.addWidget(made)
    made.show()
    return made


@pytest.mark.parametrize(
    ("typed", "value", "wrong"),
    [
        ("17,5", 17.5, ""),
        ("2e1", 20.0, ""),
        ("120", 120.0, ""),
        ("170", 15.0, "170 is more than it takes; give a number from 0 to 120."),
        ("-3", 15.0, "-3 is less than it takes"),
        ("12.55", 15.0, "12.55 is finer than it takes; give a number with at most 1 decimal."),
        ("1o", 15.0, "'1o' is no number"),
        ("nan", 15.0, "'nan' is no number"),
        ("", 15.0, "nothing stands there"),
    ],
)
def test_what_was_typed_stays_and_is_told_to_be_wrong(
    field: NumberField, typed: str, value: float, wrong: str
) -> None:
    enter(field, typed)
    assert field.value() == value
    assert wrong in field.complaint
    assert bool(field.complaint) == bool(wrong)
    assert field.toolTip() == (field.complaint or "Amplitude: half of the range.")
    if wrong:
        assert field.text() == typed
        QTest.keyClick(field, Qt.Key.Key_Up)  # a step goes on from the value that holds
        assert (field.value(), field.complaint) == (16.0, "")


def test_a_wrong_number_beside_words_of_its_own_stays_too(qtbot: QtBot) -> None:
    """The duration shows "until stopped" for its least value, which must not hide what was typed."""
    field = number("duration", 0.0, 0.0, 100.0, 1, 5.0, "Duration: of it.")
    field.setSpecialValueText("until stopped")
    qtbot.addWidget(field)
    field.show()
    enter(field, "500")
    assert (field.text(), field.value()) == ("500", 0.0)
    enter(field, "0")
    assert (field.text(), field.complaint) == ("until stopped", "")


def test_nothing_is_started_with_a_wrong_number_and_the_header_says_what_runs(rig: Rig) -> None:
    rig.start()
    amplitude = rig.tab.panel.motion.numbers["amplitude_deg"]
    enter(amplitude, "170", Qt.Key.Key_Shift)  # not even left: the key that starts finds it
    rig.key(Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    rig.run(0.2)
    assert amplitude.text() == "170"
    assert rig.label("message") == amplitude.complaint != ""
    assert rig.button("start").toolTip() == amplitude.complaint
    assert not rig.button("start").isEnabled()
    assert rig.label("doing") == "sine, 15°, 1 Hz"
    enter(amplitude, "25")
    rig.run(0.2)
    assert not rig.window.message.isVisible()
    assert rig.button("start").isEnabled()
    enter(rig.tab.panel.motion.numbers["frequency_hz"], "9")
    rig.click("start")  # 25 degrees at 9 Hz are beyond the limit of speed, which the loop refuses
    rig.run(0.2)
    assert "the limit is" in rig.label("message")
    assert rig.mode is Mode.RUNNING
    assert rig.label("doing") == "sine, 15°, 1 Hz"


def places(rig: Rig) -> dict[int, QRect]:
    """Where everything of the tab stands in the window."""
    shown = [one for one in rig.tab.plots.findChildren(QWidget) if one.isVisible()]
    shown += [rig.tab.plots, rig.tab.panel, rig.button("stop"), rig.button("start")]
    return {id(one): QRect(one.mapTo(rig.window, QPoint()), one.size()) for one in shown}


def test_a_message_and_a_prompt_move_nothing(rig: Rig, qtbot: QtBot) -> None:
    rig.run(0.2)
    before = places(rig)
    for come, go in (
        (lambda: rig.window.context.tell("The door is open; shut it. " * 20), rig.window.context.hush),
        (lambda: rig.tab.prompt.ask("Fix the flexion cable to the pulley."), rig.tab.prompt.over),
    ):
        come()
        qtbot.wait(1)
        assert places(rig) == before
        assert rig.window.message.sentence.seen.endswith("…")  # and all of it where the mouse rests
        assert rig.window.message.sentence.toolTip().count("door") == 20
        go()
        qtbot.wait(1)
        assert places(rig) == before


def entries(rig: Rig, name: str) -> dict[str, str]:
    """Keys of a list with the reasons why they cannot be chosen."""
    field = child(rig.window, QComboBox, name)
    items = [field.model().item(row) for row in range(field.count())]
    assert all(item.isEnabled() == (not item.toolTip()) for item in items)
    return {str(field.itemData(row)): item.toolTip() for row, item in enumerate(items)}


def test_lists_say_what_is_not_possible(rig: Rig) -> None:
    assert [key for key, why in entries(rig, "cable").items() if why] == ["none"]
    assert not any(entries(rig, "model").values())
    rig.choose("phase", "contact")
    rig.run(0.2)
    assert entries(rig, "cable")["extension"] == "The fingertip is pressed with the flexion cable."
    rig.choose("phase", "motor_bench")
    rig.run(0.2)
    assert [key for key, why in entries(rig, "cable").items() if not why] == ["none"]
    assert "choose the phase On air or Contact" in entries(rig, "model")["nominal"]


def test_without_a_finger_its_phases_and_protocols_say_so(make_window, tmp_path, qtbot: QtBot) -> None:  # type: ignore[no-untyped-def]
    simulated = opener(tmp_path)

    def without_finger(wanted) -> OpenBench:  # type: ignore[no-untyped-def]
        opened = simulated(wanted)
        return replace(opened, rig=replace(opened.rig, finger=None))

    rig = Rig(make_window(tab="acquire", tabs=tabs_with(without_finger)), qtbot)
    assert [key for key, why in entries(rig, "phase").items() if not why] == ["motor_bench", "free"]
    assert "names no finger" in entries(rig, "phase")["on_air"]
    assert [key for key, why in entries(rig, "protocol").items() if not why] == ["motor-bench", "table"]
