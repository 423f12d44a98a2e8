"""Recording in Acquire: before the key, markers, pauses, several runs."""

from __future__ import annotations

import itertools
import json
import threading

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QLineEdit, QProgressBar, QPushButton
from pytestqt.qtbot import QtBot

from fingerlab.core.progress import Progress
from fingerlab.devices.faults import Faults
from fingerlab.sessions import open_session
from fingerlab.sessions.recording_files import recording_folder
from fingerlab.ui.sessions.session_table import quality_text
from fingerlab.ui.sessions.sessions_tab import SessionsTab

from ..bench_hands import PATIENCE, Rig
from ..hands import child

CONTROL = Qt.KeyboardModifier.ControlModifier


def test_pre_trigger_records_what_was_before_the_key(rig: Rig, qtbot: QtBot) -> None:
    rig.run(3.0)
    rig.tab.panel.before.setValue(2.0)
    at = rig.bench.status().index
    rig.click("record")
    rig.run(0.5)
    rig.click("record")
    rig.run(0.2)
    rig.click("write")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.controller.worker.busy, timeout=PATIENCE)
    (run,) = open_session(rig.files()[0]).runs
    stop = rig.bench.status().index
    assert 2400 < run.length <= stop - (at - 2000) + 1
    ring = rig.bench.ring.copy(0, rig.bench.ring.written)[1]
    from fingerlab.acquisition.ring import COLUMN

    first = run.load(["motor_current"])["motor_current"][:100]
    start = at + 1 - 2000
    there = ring[:, COLUMN["index"]]
    known = ring[(there >= start) & (there < start + 100), COLUMN["motor_current"]]
    assert first == pytest.approx(known, abs=1e-6)


def test_marker_takes_the_moment_of_the_key_and_its_note(rig: Rig, qtbot: QtBot) -> None:
    began = rig.bench.status().index
    rig.click("record")
    rig.run(1.0)
    rig.key(Qt.Key.Key_M, CONTROL)
    moment = rig.bench.status().index
    note = child(rig.window, QLineEdit, "note")
    assert note.hasFocus()
    rig.run(0.5)  # the note takes its time
    QTest.keyClicks(note, "a light touch")
    QTest.keyClick(note, Qt.Key.Key_Return)
    rig.run(0.5)
    rig.click("record")
    rig.run(0.2)
    rig.click("write")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.controller.worker.busy, timeout=PATIENCE)
    (run,) = open_session(rig.files()[0]).runs
    (marker,) = json.loads(markers) if isinstance(markers := run.attributes["markers"], str) else markers
    assert marker["note"] == "a light touch"
    assert marker["time"] == pytest.approx((moment - began) * 1e-3, abs=0.005)
    assert rig.tab.plots._marks == [(moment / 1000, "a light touch")]


def test_a_pause_is_a_gap(rig: Rig, qtbot: QtBot) -> None:
    rig.click("record")
    rig.run(0.5)
    rig.click("pauseRecording")
    rig.run(0.5)
    assert rig.button("pauseRecording").text() == "&Go on"
    assert rig.label("sampleCount").endswith("paused")
    rig.click("pauseRecording")
    rig.run(0.5)
    rig.click("record")
    rig.run(0.2)
    rig.click("write")
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.controller.worker.busy, timeout=PATIENCE)
    (run,) = open_session(rig.files()[0]).runs
    steps = np.diff(run.load(["time"])["time"])
    assert steps.max() == pytest.approx(0.5, abs=0.1)
    assert np.median(steps) == pytest.approx(1e-3)


def test_a_run_that_cannot_be_used_is_told_across_the_window(connect_rig) -> None:  # type: ignore[no-untyped-def]
    """Cycles lost each second leave no piece that can be used; a run that lost none is told at the bottom."""
    rig = connect_rig(Faults(lost={1000 * second: 3 for second in range(5, 10)}))
    rig.click("record")
    rig.run(3.2)
    rig.click("record")
    rig.run(0.2)
    assert not rig.window.message.isVisible()
    assert rig.window.task_bar.text.text().endswith("nothing missing; usable.")
    rig.run(1.0)
    rig.click("record")
    rig.run(5.5)
    rig.click("record")
    rig.run(0.2)
    assert rig.window.message.isVisible()
    assert rig.label("message").startswith("Run 2: ")
    assert "not usable: no piece between them lasts 4 s" in rig.label("message")


def test_several_runs_in_one_file(rig: Rig, qtbot: QtBot) -> None:
    for _ in range(2):
        rig.click("record")
        rig.run(0.3)
        rig.click("record")
        rig.run(0.2)
    assert rig.label("recordedText") == "2 runs, not yet written"
    rig.key(Qt.Key.Key_S, CONTROL)
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.controller.worker.busy, timeout=PATIENCE)
    assert len(open_session(rig.files()[0]).runs) == 2


def record_a_second(rig: Rig) -> None:
    """One run of a second, ended by hand."""
    rig.click("record")
    rig.run(1.0)
    rig.click("record")
    rig.run(0.2)


def test_while_a_file_is_written_and_verified_it_says_so(
    rig: Rig, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten hours take their time, and nothing may cut it short: what was recorded is at stake."""
    record_a_second(rig)
    go_on, recorder = threading.Event(), rig.bench.recorder
    close = recorder.close

    def slowly(progress: Progress) -> object:
        go_on.wait(PATIENCE / 1000)
        return close(progress)

    monkeypatch.setattr(recorder, "close", slowly)
    rig.click("write")
    qtbot.waitUntil(lambda: rig.label("recordedText") == "Writing and verifying …", timeout=PATIENCE)
    assert "under way" in rig.button("record").toolTip()
    go_on.set()
    qtbot.waitUntil(lambda: bool(rig.files()) and not rig.controller.worker.busy, timeout=PATIENCE)
    assert rig.label("recordedText") == "Nothing recorded"


def test_the_keyboard_stays_where_it_was_while_the_bench_is_busy(rig: Rig, qtbot: QtBot) -> None:
    """Ending a run greys its button for a moment; the next key must not change the pre-trigger."""
    record, before = rig.button("record"), rig.tab.panel.before
    record.setFocus()
    go_on = threading.Event()
    rig.controller.call("Ending the run", lambda: go_on.wait(PATIENCE / 1000))
    assert not record.isEnabled()
    assert not before.hasFocus()
    QTest.keyClick(rig.window, Qt.Key.Key_Up)
    assert before.value() == 0.0
    go_on.set()
    rig.wait_idle()
    assert record.hasFocus()
    rig.controller.call("Ending the run", lambda: None)
    before.setFocus()  # who goes elsewhere meanwhile stays there
    rig.wait_idle()
    assert before.hasFocus()


def test_writing_shows_how_far_it_is_and_can_be_put_off_without_losing_a_sample(
    rig: Rig, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    record_a_second(rig)
    recorded, session = rig.bench.status().recorded, rig.recording.session
    assert session is not None
    go_on, recorder = threading.Event(), rig.bench.recorder
    close = recorder.close

    def slowly(progress: Progress) -> object:
        def tell(share: float, what: str) -> None:
            progress(share, what)
            if what == "verifying":
                go_on.wait(PATIENCE / 1000)
                progress(share, what)

        return close(tell)

    monkeypatch.setattr(recorder, "close", slowly)
    rig.click("write")
    bar = child(rig.window, QProgressBar, "writingProgress")
    qtbot.waitUntil(lambda: rig.label("recordedText") == "Verifying …", timeout=PATIENCE)
    assert bar.isVisible()
    assert bar.value() == bar.maximum()
    assert not rig.button("write").isVisible()
    rig.window.show_tab("sessions")
    rig.run(0.1)
    assert "Verifying …" in [label.text() for label in rig.window.header.findChildren(QLabel)]
    rig.window.show_tab("acquire")
    rig.click("writeLater")
    assert not rig.button("writeLater").isEnabled()
    go_on.set()
    qtbot.waitUntil(lambda: not rig.controller.worker.busy, timeout=PATIENCE)
    assert not rig.files()
    kept = recording_folder(session.path)
    assert sorted(part.name for part in kept.glob("*.h5part")) == ["001.h5part", "written.h5part"]
    assert kept.name in child(rig.window, QLabel, "message").text()
    assert rig.label("recordedText") == "Nothing recorded"
    assert rig.button("write").isVisible()
    (run,) = open_session(session.path).runs
    assert run.length == recorded
    assert not kept.exists()


def test_who_disconnects_does_not_wait_for_a_long_recording(rig: Rig, qtbot: QtBot) -> None:
    """It is kept as it is, and says so; an hour a look at the clock stands for ten hours of samples."""
    rig.click("record")
    rig.run(1.0)
    session = rig.recording.session
    assert session is not None
    hours = itertools.count()
    rig.recording.writing._clock = lambda: 3600.0 * next(hours)
    rig.tab.disconnect_rig()
    rig.wait_idle()
    assert not rig.files()
    assert "not written yet" in child(rig.window, QLabel, "message").text()
    # Who reviews it in Sessions has it written first.
    rig.window.show_tab("sessions")
    tab = rig.window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    tab.browse(session.path.parent)
    qtbot.waitUntil(lambda: tab.page.model.total == 1, timeout=PATIENCE)
    facts = tab.page.model.facts(session.path)
    assert facts is not None
    assert quality_text(facts) == "not yet written"
    tab.page.choose_path(session.path)
    rig.click("review")
    qtbot.waitUntil(lambda: tab.review_page.session is not None and not tab.data.busy, timeout=PATIENCE)
    assert tab.review_page.session is not None
    assert tab.review_page.session.runs[0].length >= 900
    assert rig.files() == [session.path]


@pytest.mark.qt_log_ignore("This plugin does not support")  # of two windows, off screen
@pytest.mark.parametrize("ended", ["whole", "cut"])
def test_the_next_start_says_what_became_of_a_recording_that_ended_with_its_window(
    rig: Rig,
    make_window,
    qtbot: QtBot,
    ended: str,  # type: ignore[no-untyped-def]
) -> None:
    """Killed, the recorder's process writes the session; with the machine off nobody does."""
    rig.start()
    rig.click("record")
    rig.run(1.0)
    session = rig.recording.session
    assert session is not None
    rig.bench.recorder.cut("The window was lost.")
    kept = recording_folder(session.path)
    parts = [(part.name, part.read_bytes()) for part in kept.glob("*.h5part")]
    rig.bench.recorder.close()
    if ended == "cut":  # as after a power cut: the runs are there and nobody holds them
        session.path.unlink()
        kept.mkdir()
        for name, content in parts:
            (kept / name).write_bytes(content)
    again = make_window(tab="sessions")  # nobody tells the first window: to it the recording goes on
    message = child(again, QLabel, "message").text()
    assert "ended while" in message
    assert str(session.path if ended == "whole" else kept) in message
    assert again.current == "acquire"
    button = child(again, QPushButton, "openRecording")
    assert button.text() == ("Look at the recording" if ended == "whole" else "Finish the recording")
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: again.context.sessions != (), timeout=PATIENCE)
    (run,) = again.context.sessions[0].runs
    assert run.length >= 950
    assert run.trajectory["until_stopped"] is True  # and no length that nobody gave it
    assert "duration_s" not in run.trajectory
    assert again.settings.under_way() is None
    rig.recording.session = None  # the first window's fate, as a killed process has it
