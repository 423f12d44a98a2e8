"""The check of a rig in the window: answered by clicks, kept for the rig, ended by STOP."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QFileDialog, QTableWidget
from pytestqt.qtbot import QtBot

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.ring import COLUMN
from fingerlab.devices.choosing import detect
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.simulated import SimulatedBench, Simulation
from fingerlab.rig.file import default_rig
from fingerlab.sessions import open_session

from ..bench_hands import PATIENCE, Rig
from ..hands import child
from ..looking import look
from ..virtual_card import Card, InProcessChannel, Servicer


@pytest.fixture
def benches(unconnected, tmp_path: Path) -> Callable[..., Rig]:  # type: ignore[no-untyped-def]
    """A window whose benches are on a virtual clock, with checks kept below ``tmp_path``."""
    return partial(unconnected, checked=False)


def unpaced(choice: Any) -> Any:
    return replace(choice, real_time=False).build()


def answer(rig: Rig, qtbot: QtBot, answers: dict[str, str], until: str = "") -> None:
    """Click yes, or what is said otherwise, until the check is over or asks for ``until``."""
    page = rig.tab.check_page
    qtbot.waitUntil(lambda: page.run.under_way, timeout=PATIENCE)
    while True:
        qtbot.waitUntil(lambda: page.answers[0].isEnabled() or not page.run.under_way, timeout=PATIENCE)
        step = page.step.text().removeprefix("Step ")
        if not page.run.under_way or (until and step == until):
            return
        rig.click(f"check_{answers.get(step, 'yes')}")


def findings(rig: Rig) -> dict[str, str]:
    """State of each step that stands in the table, by its title."""
    table = child(rig.window, QTableWidget, "checkFindings")
    rows = [[table.item(row, column).text() for column in (0, 1)] for row in range(table.rowCount())]
    return {title: state.split(" ", 1)[1] for state, title in rows}


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_a_rehearsal_by_clicks_ends_confirmed_and_leads_to_the_bench(
    benches: Callable[..., Rig], qtbot: QtBot, tmp_path: Path
) -> None:
    rig = benches(unpaced)
    rig.click("checkRig")
    answer(rig, qtbot, {}, until="drive")
    assert "at most 0.3 A" in rig.label("checkQuestion")
    assert not rig.button("checkDrive").isEnabled()
    look(rig.window)
    answer(rig, qtbot, {})
    assert "All confirmed" in rig.label("checkQuestion")
    assert set(findings(rig).values()) == {"confirmed", "not applicable"}
    said = child(rig.window, QTableWidget, "checkFindings").item(0, 2).text()
    assert re.fullmatch(r"The load cell reads [−\d.]+ N \(.+ V at ai0, noise .+ mV\)\. The operator .+", said)
    assert not (tmp_path / "rigs" / "default" / "checks").exists()  # of no real bench
    rig.click("checkDrive")
    qtbot.waitUntil(rig.tab.connected, timeout=PATIENCE)
    assert rig.button("initialise").isVisible()


WIRED = """
[daq.emergency_stop]
terminal = "port0/line2"
[daq.amplifier_ready]
terminal = "port0/line3"
needs_enable = true
"""


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_lines_that_a_hand_tries_are_no_trouble(
    benches: Callable[..., Rig], qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "wired.toml"
    text = resources.files("fingerlab.resources").joinpath("rigs/default.toml").read_text("utf-8")
    file.write_text(text + WIRED, encoding="utf-8")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_: (str(file), "")))
    rig = benches(unpaced)
    rig.click("rigFile")
    rig.wait_idle()
    troubles: list[str] = []
    rig.window.context.warned.connect(lambda sentence, _details: troubles.append(sentence))
    rig.click("checkRig")
    answer(rig, qtbot, {})
    assert "All confirmed" in rig.label("checkQuestion")
    # Which of the changes it sees, all of a second on the virtual clock, hangs on its looks.
    assert not any(troubles), troubles


def test_stop_before_anybody_waits_for_an_answer_ends_the_check(
    benches: Callable[..., Rig], qtbot: QtBot
) -> None:
    """The button is pressed as the question comes up, before the check has begun to wait for an answer."""
    rig = benches(unpaced)
    run, asked = rig.tab.check_page.run, list[str]()

    def at_once(step: str, question: str) -> None:
        assert rig.controller.bench is not None
        Bench.stop(rig.controller.bench)
        asked.append(step)

    run.asked.connect(at_once, Qt.ConnectionType.DirectConnection)  # in the check's own thread
    rig.click("checkRig")
    qtbot.waitUntil(lambda: bool(asked), timeout=PATIENCE)  # it may be over before anybody looks
    qtbot.waitUntil(lambda: not run.under_way, timeout=PATIENCE)
    assert findings(rig)["The bench was stopped"] == "failed"
    rig.click("checkLeave")
    rig.wait_idle()


def test_stop_ends_a_check_at_a_question_and_nothing_is_driven(
    benches: Callable[..., Rig], qtbot: QtBot
) -> None:
    rig = benches(unpaced)
    rig.click("checkRig")
    answer(rig, qtbot, {"limits/force": "no"}, until="drive/dead_man")
    assert findings(rig)["No current without enable"] == "skipped"  # for a limit was not right
    ring = rig.bench.ring
    assert not np.any(ring.copy(0, ring.written)[1][:, COLUMN["current_command"]])
    rig.wait_idle()
    rig.click("checkLeave")
    rig.wait_idle()
    rig.click("checkRig")
    answer(rig, qtbot, {}, until="scale/mcp")
    QTest.mousePress(rig.window.header.stop, Qt.MouseButton.LeftButton)
    QTest.mouseRelease(rig.window.header.stop, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not rig.tab.check_page.run.under_way, timeout=PATIENCE)
    assert findings(rig)["The bench was stopped"] == "failed"
    assert "Not confirmed: stopped" in rig.label("checkQuestion")
    rig.click("checkLeave")
    rig.wait_idle()
    assert rig.controller.bench is None


def test_a_card_has_a_tenth_of_its_current_until_its_check_is_kept(
    benches: Callable[..., Rig], qtbot: QtBot, tmp_path: Path
) -> None:
    plant = SimulatedBench(Simulation(seed=5), default_rig().daq)
    card = Card(plant)
    channel = InProcessChannel(Servicer(card))

    def build(choice: Any) -> NiCard:
        device = NiCard(choice.rig, card.clock, channel)
        device.move_by_hand = plant.move_by_hand  # type: ignore[attr-defined] - somebody stands there
        return device

    rig = benches(build, lambda rig_file: detect(None, channel))
    assert child(rig.window, QComboBox, "checkedBench").currentData() == "card"

    def driven() -> float:
        """Largest set value of a motion that needs 0.9 A, A."""
        plant.set_up("on_air", "extension", 0.0)  # a person hangs the cable anew
        rig.connect("connectCard")
        rig.choose("kind", "sine")
        child(rig.window, QDoubleSpinBox, "offset").setValue(40.0)
        rig.click("initialise")
        rig.run(2.0)  # it waits until everything stands still
        rig.click("enable")
        rig.run(0.1)
        rig.click("start")
        rig.run(2.5)
        ring = rig.bench.ring
        most = np.abs(ring.copy(0, ring.written)[1][:, COLUMN["current_command"]]).max()
        said.append(rig.label("message"))
        rig.click("record")
        rig.run(0.3)
        rig.click("record")
        rig.run(0.1)
        kept = open_session(rig.write()).attributes["check_rig"]
        rig.tab.disconnect_rig()
        rig.wait_idle()
        told.append(str(kept))
        return float(most)

    told: list[str] = []
    said: list[str] = []
    limit = default_rig().limits.current
    assert driven() <= 0.1 * limit
    assert told == ["never checked"]
    assert "the current stays below 0.3 A until a check confirms the bench" in said[0]
    allowed = f"the current stays below {0.1 * limit:.2g} A, a tenth of its limit"
    assert any(allowed in line for line in rig.window.context.log), rig.window.context.log
    rig.click("checkRig")
    answer(rig, qtbot, {})
    (kept,) = (tmp_path / "rigs" / "default" / "checks").glob("*.json")
    assert rig.label("checkQuestion") == f"All confirmed. Kept in {kept}."
    rig.click("checkLeave")
    rig.wait_idle()
    assert driven() > 0.1 * limit
    assert told[1].endswith("all confirmed")
