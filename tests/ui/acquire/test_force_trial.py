"""A force trial in Acquire, from the protocol's entry to its result, and the result of a session on disk."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QFileDialog, QLabel
from pytestqt.qtbot import QtBot

from fingerlab.devices.simulated import Simulation
from fingerlab.sessions import open_session
from fingerlab.twin.effects import parse_effects
from fingerlab.ui.app.context import Settings
from fingerlab.ui.sessions.result_dialogs import TrialDialog
from fingerlab.ui.sessions.sessions_tab import SessionsTab
from tests.prediction.trial_model import EFFECT, SEED, model_with_effect

from ..bench_hands import PATIENCE, Rig, opener, tabs_with
from ..conftest import WindowMaker
from ..hands import LEFT


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return model_with_effect(tmp_path_factory.mktemp("model"))


@pytest.fixture
def bench(
    make_window: WindowMaker,
    qtbot: QtBot,
    settings: Settings,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Rig:
    """The simulated bench that has the model's effect, connected, with the trial's entry chosen."""
    monkeypatch.setattr("fingerlab.acquisition.protocols.force_trial.POSE_S", 4.0)
    monkeypatch.setattr("fingerlab.acquisition.protocols.force_trial.PRACTICES", 2)
    settings.set_recordings(tmp_path / "recordings")
    make = opener(tmp_path / "rescue", simulation=Simulation(seed=SEED, effects=parse_effects((EFFECT,))))
    rig = Rig(make_window(tab="acquire", tabs=tabs_with(make)), qtbot)
    rig.click("byProtocol")
    rig.choose("protocol", "force_trial")
    return rig


def set_up(rig: Rig, model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The model chosen in the dialog of the button, and a short wanted force."""
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_, **__: (str(model), ""))
    rig.click("trialModel")
    fields = rig.tab.panel.protocol.trial
    fields.wanted.numbers["duration_s"].setValue(2.0)
    fields.wanted.numbers["amplitude_n"].setValue(0.4)
    fields.pairs.setValue(1)
    rig.tab.panel.protocol.rest.setValue(0.0)


def answer(rig: Rig, qtbot: QtBot) -> str:
    """Wait for a prompt and say that it is done; what was asked."""
    prompt = rig.tab.prompt
    qtbot.waitUntil(prompt.isVisible, timeout=PATIENCE)
    asked = rig.label("prompt")
    QTest.mouseClick(prompt.button, LEFT)
    return asked


def test_each_of_its_rows_has_a_letter_that_nothing_else_on_the_page_has(bench: Rig) -> None:
    window = bench.window
    fields = bench.tab.panel.protocol.trial
    labels = [one for one in window.findChildren(QLabel) if one.buddy() and one.isVisible()]
    seen: list[QLabel | QAbstractButton] = [*labels]
    seen += [one for one in window.findChildren(QAbstractButton) if one.isVisible()]
    taken = [one.text().replace("&&", "") for one in seen]
    taken += [action.text() for action in window.menuBar().actions() if action.isVisible()]
    letters = [text[text.index("&") + 1].upper() for text in taken if "&" in text]
    for field in (fields.model, fields.wanted.kind, fields.pairs):
        (label,) = [one.text() for one in labels if one.buddy() is field]
        assert letters.count(label[label.index("&") + 1].upper()) == 1, (label, taken)


@pytest.mark.qt_log_ignore("This plugin does not support")  # a dialog, on a screen that is none
def test_from_the_entry_to_the_result(
    bench: Rig, qtbot: QtBot, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert rig_words(bench).startswith("Choose a saved model")
    bench.run(0.5)
    run = bench.button("runProtocol")
    assert not run.isEnabled()  # what is missing stands where the mouse rests, too
    assert "Choose a saved model: the Model lab saves one" in run.toolTip()
    set_up(bench, model, monkeypatch)
    assert rig_words(bench).startswith("8 runs")
    bench.click("runProtocol")
    assert answer(bench, qtbot).startswith("Fix the flexion cable")
    torques, prompt = bench.tab.torques, bench.tab.prompt
    qtbot.waitUntil(lambda: torques.isVisible() and prompt.isVisible(), timeout=PATIENCE)
    asked = bench.label("prompt")
    assert asked.startswith("Look at the torque to come: nominal ")
    assert "the rig allows 370 mN m" in asked  # 0.95 of 3 A at 0.13 N m/A: the default limits
    assert not bench.bench.status().enabled
    assert set(torques.torque.plans) == {"nominal", "found"}
    assert not bench.tab.plots.isVisible()
    QTest.mouseClick(prompt.button, LEFT)
    assert bench.tab.plots.isVisible()
    qtbot.waitUntil(lambda: bool(shown(bench)), timeout=PATIENCE)
    dialog = shown(bench)[0]
    session = open_session(bench.files()[0])
    assert json.loads(session.attributes["force_trial"])["effects"] == ["spring_hardening"]
    assert dialog.headline.text().startswith("The force error fell from ")
    assert "The found model had foretold" in dialog.words.text()
    assert "Of what the found model leaves" in dialog.words.text()
    assert [dialog.table.item(row, 0).text() for row in range(2)] == ["nominal", "found"]
    assert float(dialog.table.item(1, 2).text()) < 0.5 * float(dialog.table.item(0, 2).text())
    assert {one.name for one in dialog.force.shown_series()} == {"nominal model", "found model", "wanted"}


def test_stop_while_the_torque_is_shown_and_what_a_session_without_a_trial_says(
    bench: Rig, qtbot: QtBot, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """STOP answers the question, too; the pose that was recorded is kept, and is no trial."""
    set_up(bench, model, monkeypatch)
    bench.click("runProtocol")
    answer(bench, qtbot)
    torques, prompt = bench.tab.torques, bench.tab.prompt
    qtbot.waitUntil(lambda: torques.isVisible() and prompt.isVisible(), timeout=PATIENCE)
    bench.key(Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not bench.recording.in_protocol, timeout=PATIENCE)
    bench.wait_idle()
    assert not bench.bench.status().enabled
    assert bench.tab.plots.isVisible()
    assert [run.attributes["force_model"] for run in open_session(bench.files()[0]).runs] == ["pose"]
    assert not shown(bench)
    bench.run(0.2)
    bench.click("release")
    bench.settle()
    assert rig_words(bench).startswith("8 runs")  # from its first: what it sends it learns from those before
    bench.click("runProtocol")
    answer(bench, qtbot)
    qtbot.waitUntil(lambda: torques.isVisible() and prompt.isVisible(), timeout=PATIENCE)
    bench.key(Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not bench.recording.in_protocol, timeout=PATIENCE)
    bench.wait_idle()
    tab = bench.window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    bench.window.show_tab("sessions")
    tab.browse(bench.files()[0].parent)
    qtbot.waitUntil(lambda: bool(tab.page.model.all_facts()), timeout=PATIENCE)
    tab.page.choose_path(bench.files()[0])
    command = next(one for one in tab.commands if getattr(one, "text", "") == "&Force trial…")
    command.call()
    qtbot.waitUntil(lambda: "broke off while it practised" in bench.label("message"), timeout=PATIENCE)


def rig_words(rig: Rig) -> str:
    return rig.label("protocolTotal")


def shown(rig: Rig) -> list[TrialDialog]:
    return [one for one in rig.window.findChildren(TrialDialog) if one.isVisible()]
