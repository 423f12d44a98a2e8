"""Text files of the bench in Sessions: dropped or chosen, looked at, and written as one session."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from click.testing import CliRunner
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFileDialog,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
)
from pytestqt.qtbot import QtBot

from fingerlab.cli.sessions import import_text
from fingerlab.sessions import open_session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.sessions.import_dialog import ImportDialog
from fingerlab.ui.sessions.sessions_tab import SessionsTab

from ..hands import LEFT, PATIENCE, child, click, drop
from ..looking import look

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")  # of dialogs, off screen
HEADER = "time (s);command (deg);position (deg);torque (mNm);MCP (deg);PIP (deg);force (N)"


@pytest.fixture
def texts(tmp_path: Path) -> list[Path]:
    """Two runs of three seconds as a bench writes them in a country of decimal commas."""
    time = np.arange(3000) / 1000
    rows = np.stack([time, 10 * time, 9 * time, 40 + time, -5 * time, -7 * time, 0.1 * time], axis=1)
    lines = [";".join(f"{value:.5f}".replace(".", ",") for value in row) for row in rows]
    files = [tmp_path / "first.txt", tmp_path / "second.txt"]
    for path in files:
        path.write_text("\n".join([HEADER, *lines]), encoding="utf-8")
    return files


@pytest.fixture
def browsing(make_window: Callable[..., MainWindow], tmp_path: Path) -> MainWindow:
    (tmp_path / "library").mkdir()
    window = make_window(tab="sessions")
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    tab.browse(tmp_path / "library")
    return window


def dialog_of(window: MainWindow) -> ImportDialog:
    found: ImportDialog = child(window, ImportDialog, "")
    assert found.isVisible()
    return found


def choose(dialog: ImportDialog, name: str, words: str) -> None:
    """Choose an entry of a list, as by a click on it."""
    field = child(dialog, QComboBox, name)
    assert field.findText(words) >= 0, words
    field.setCurrentIndex(field.findText(words))
    field.activated.emit(field.currentIndex())


def test_columns_are_chosen_by_list_and_looked_at_before_they_are_imported(
    browsing: MainWindow, texts: list[Path], tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    bare = tmp_path / "odd.csv"
    body = texts[0].read_text(encoding="utf-8").splitlines()[1:]  # no header; torque and position swapped
    cells = [line.split(";") for line in body]
    rows = [[c[0], c[1], c[3], c[2], *c[4:], "7,0"] for c in cells]
    bare.write_text("\n".join(";".join(row) for row in rows), encoding="utf-8")
    browsing.show_tab("predict")
    drop(browsing, bare)  # wherever it falls
    assert browsing.current == "sessions"
    dialog = dialog_of(browsing)
    write = child(dialog, QPushButton, "importWrite")
    assert not write.isEnabled()  # eight columns without a header: nobody can know
    names = "time,motor command,motor torque,motor position,MCP angle,PIP angle,endpoint force"
    for row, name in enumerate(names.split(",")):
        choose(dialog, f"importIs{row}", name)
    choose(dialog, "importUnit2", "mNm")
    turned = child(dialog, QCheckBox, "importTurned4")
    QTest.mouseClick(turned, LEFT, pos=QPoint(8, turned.height() // 2))
    assert write.isEnabled()
    dialog.columns.selectRow(3)
    preview = dialog.preview.shown
    assert set(preview) == {"motor command", "motor position", "MCP angle", "PIP angle"}
    assert preview["motor position"][-1] == pytest.approx(np.radians(9 * 2.999), rel=1e-4)
    assert preview["MCP angle"][-1] == pytest.approx(np.radians(5 * 2.999), rel=1e-4)  # sign reversed
    choose(dialog, "importIs7", "motor torque")  # which another column was until now
    assert dialog.columns.kind(2) == ""
    choose(dialog, "importIs2", "motor torque")
    choose(dialog, "importUnit2", "mNm")
    target = tmp_path / "library" / "odd.h5"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    QTest.mouseClick(write, LEFT)
    qtbot.waitUntil(target.exists, timeout=PATIENCE)
    qtbot.waitUntil(lambda: not browsing.tasks.busy, timeout=PATIENCE)
    (run,) = open_session(target).runs
    assert run.channel("motor_torque")[0] == pytest.approx(0.040, rel=1e-4)
    assert run.channel("mcp_angle")[-1] == pytest.approx(np.radians(5 * 2.999), rel=1e-4)


def test_a_log_of_one_axis_from_matlab_becomes_a_session_without_a_finger(
    browsing: MainWindow, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    time = np.arange(2000) / 1000
    log = tmp_path / "drive.mat"
    scipy.io.savemat(log, {"t": time, "q": 30 * np.sin(time), "current": 0.5 * np.cos(time)})
    drop(browsing, log)
    dialog = dialog_of(browsing)
    assert child(dialog, QCheckBox, "importAxis").isChecked()  # by the titles of its columns
    seen = child(dialog, QPlainTextEdit, "importSeen")
    assert "choose them in the table." in seen.toPlainText()
    units = {"time": "s", "position": "deg", "current": "A"}
    for row in range(3):
        choose(dialog, f"importUnit{row}", units[dialog.columns.title(row)])
    assert "say in 'Torque of an ampere'" in seen.toPlainText()
    dialog.constant.setValue(0.25)
    target = tmp_path / "library" / "drive.h5"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    QTest.mouseClick(child(dialog, QPushButton, "importWrite"), LEFT)
    qtbot.waitUntil(target.exists, timeout=PATIENCE)
    qtbot.waitUntil(lambda: not browsing.tasks.busy, timeout=PATIENCE)
    session = open_session(target)
    (run,) = session.runs
    assert run.phase == "motor_bench"
    assert session.rig.finger is None
    assert run.channel("motor_torque")[0] == pytest.approx(0.125)


def test_bad_rows_and_words_are_told_where_a_table_is_looked_at(
    browsing: MainWindow, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [f"{k / 500:.3f},AUTO,{k % 50},{k % 7}" for k in range(1000)]
    rows[99], rows[-1] = rows[99].rpartition(",")[0] + ",", "1.99"
    log = tmp_path / "drive.csv"
    log.write_text("\n".join(["Zeit (s),mode,Winkel (deg),Moment (Nm)", *rows]), encoding="utf-8")
    drop(browsing, log)
    dialog = dialog_of(browsing)
    assert child(dialog, QCheckBox, "importAxis").isChecked()  # by the titles of its columns
    assert [dialog.columns.kind(row) for row in range(4)] == ["time", "", "motor_position", "motor_torque"]
    assert dialog.columns.item(1, 5).text() == "AUTO  (words)"
    assert not child(dialog, QComboBox, "importIs1").isEnabled()
    words = (
        "2 of 1,000 rows are left out: 1 without a number in a column that is used (line 101), 1 cut off at "
        "the end of the file (line 1001)"
    )
    assert words in child(dialog, QPlainTextEdit, "importSeen").toPlainText()
    choose(dialog, "importUnit3", "N")
    seen = child(dialog, QPlainTextEdit, "importSeen").toPlainText()
    assert "in a unit such as Nm, or 'Lever' should say at which radius it turns" in seen
    choose(dialog, "importUnit3", "Nm")
    target = tmp_path / "library" / "drive.h5"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    QTest.mouseClick(child(dialog, QPushButton, "importWrite"), LEFT)
    qtbot.waitUntil(target.exists, timeout=PATIENCE)
    qtbot.waitUntil(lambda: not browsing.tasks.busy, timeout=PATIENCE)
    (run,) = open_session(target).runs
    assert (run.length, run.attributes["left_out"]) == (998, words)


def test_a_force_at_a_lever_and_an_encoder_in_counts_are_what_the_command_makes_of_them(
    browsing: MainWindow, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "drive.csv"
    rows = "\n".join(f"{k / 500:.3f},{k % 50},{k % 7 - 3}" for k in range(1000))
    log.write_text(f"t (s),steps,F (N)\n{rows}", encoding="utf-8")
    drop(browsing, log)
    dialog = dialog_of(browsing)
    QTest.mouseClick(child(dialog, QCheckBox, "importAxis"), LEFT)
    choose(dialog, "importIs1", "position")
    choose(dialog, "importUnit1", "rad")
    choose(dialog, "importIs2", "torque or force")
    choose(dialog, "importUnit2", "N")
    seen = child(dialog, QPlainTextEdit, "importSeen")
    times = child(dialog, QLineEdit, "importTimes1")
    for wrong in ("", "-1", "many"):
        times.selectAll()
        QTest.keyClick(times, Qt.Key.Key_Delete)
        QTest.keyClicks(times, wrong)
        assert "it should be a number above 0" in seen.toPlainText()
    times.clear()
    QTest.keyClicks(times, "0,00153")
    write = child(dialog, QPushButton, "importWrite")
    assert not write.isEnabled()
    assert "'Lever' should say at which radius it turns" in seen.toPlainText()
    lever = child(dialog, QDoubleSpinBox, "importLever")
    lever.setFocus()
    lever.selectAll()
    QTest.keyClicks(lever, "50")
    QTest.keyClick(lever, Qt.Key.Key_Return)
    assert lever.value() == 50.0
    assert write.isEnabled(), seen.toPlainText()
    dialog.columns.selectRow(1)
    assert dialog.preview.shown["position"][49] == pytest.approx(49 * 0.00153)
    target = tmp_path / "library" / "drive.h5"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    QTest.mouseClick(write, LEFT)
    qtbot.waitUntil(target.exists, timeout=PATIENCE)
    qtbot.waitUntil(lambda: not browsing.tasks.busy, timeout=PATIENCE)
    (run,) = open_session(target).runs
    assert run.channel("motor_position")[49] == pytest.approx(49 * 0.00153)
    assert run.channel("motor_torque")[:4] == pytest.approx([-0.15, -0.1, -0.05, 0.0])  # 50 mm times N
    same = tmp_path / "same.h5"
    mapping = "time=t:s,position=steps:rad:0.00153,torque=F:N"
    arguments = [log, "--axis", "--map", mapping, "--radius", "0.05", "--out", same, "--yes"]
    assert CliRunner().invoke(import_text, [str(a) for a in arguments]).exit_code == 0
    (told,) = open_session(same).runs
    for channel in ("time", "motor_position", "motor_torque"):
        assert np.array_equal(told.channel(channel)[:], run.channel(channel)[:]), channel


def test_the_rig_file_of_one_axis_says_what_an_ampere_gives(
    browsing: MainWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, rig = tmp_path / "drive.csv", tmp_path / "drive.toml"
    rows = "\n".join(f"{k / 500:.3f},{k % 50},{k % 7}" for k in range(100))
    log.write_text(f"t (s),q (deg),I (A)\n{rows}", encoding="utf-8")
    rig.write_text("[motor]\ngear_ratio = 1.0\ntorque_constant = 0.5\n", encoding="utf-8")
    drop(browsing, log)
    dialog = dialog_of(browsing)
    assert child(dialog, QCheckBox, "importAxis").isChecked()  # by the titles of its columns
    assert not child(dialog, QPushButton, "importWrite").isEnabled()
    monkeypatch.setattr(QFileDialog, "getOpenFileName", staticmethod(lambda *_, **__: (str(rig), "")))
    QTest.mouseClick(child(dialog, QPushButton, "importRig"), LEFT)
    assert child(dialog, QPushButton, "importWrite").isEnabled()
    assert not dialog.constant.isEnabled()
    assert dialog.axis_rig is not None
    assert dialog.axis_rig.motor.torque_constant == 0.5
    assert dialog.axis_rig.finger is None
    dialog.reject()


@pytest.mark.parametrize("name", ["text-header.txt", "text-decimal-comma.txt"])
def test_files_of_the_bench_open_with_their_columns_named(
    browsing: MainWindow, shared_data: Path, name: str
) -> None:
    drop(browsing, shared_data / name)
    dialog = dialog_of(browsing)
    assert child(dialog, QPushButton, "importWrite").isEnabled()
    assert [dialog.columns.unit(row) for row in (0, 2, 4, 6)] == ["s", "deg", "deg", "N"]
    dialog.reject()


def test_dropped_text_files_become_a_session(
    browsing: MainWindow, texts: list[Path], tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    drop(browsing, *texts)
    dialog = dialog_of(browsing)
    look(browsing)
    assert [dialog.columns.kind(row) for row in range(7)][3:5] == ["motor_torque", "mcp_angle"]
    assert dialog.columns.unit(3) == "mNm"
    seen = child(dialog, QPlainTextEdit, "importSeen").toPlainText()
    assert "7 columns, separated by semicolon, decimal comma, a header; 1000 samples a second" in seen
    phase, cable = (child(dialog, QComboBox, name) for name in ("importPhase1", "importCable1"))
    phase.setCurrentIndex(phase.findData("contact"))
    cable.setCurrentIndex(cable.findData("flexion"))
    target = tmp_path / "library" / "old.h5"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    QTest.mouseClick(child(dialog, QPushButton, "importWrite"), LEFT)
    tab = browsing.tab("sessions")
    assert isinstance(tab, SessionsTab)
    qtbot.waitUntil(lambda: tab.page.paths() == [target], timeout=PATIENCE)
    first, second = open_session(target).runs
    assert (first.phase, first.cable, second.phase, second.cable) == (
        "on_air", "extension", "contact", "flexion",
    )  # fmt: skip
    assert second.channel("motor_position")[-1] == pytest.approx(np.radians(9 * 2.999), rel=1e-4)
    assert second.channel("motor_torque")[0] == pytest.approx(0.040, rel=1e-4)
    assert tab.can_undo  # like every new file, into the trash


def test_what_cannot_be_imported_says_so_in_the_words_of_the_window(
    browsing: MainWindow, texts: list[Path], qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = ([str(texts[0])], "")
    monkeypatch.setattr(QFileDialog, "getOpenFileNames", staticmethod(lambda *_, **__: chosen))
    click(browsing, "importText")
    dialog = dialog_of(browsing)
    write = child(dialog, QPushButton, "importWrite")
    assert write.isEnabled()
    choose(dialog, "importIs2", "not used")
    assert not write.isEnabled()
    seen = child(dialog, QPlainTextEdit, "importSeen").toPlainText()
    assert "gives no 'motor position', which a run of phase 'on air' needs" in seen
    assert "choose its column in the table" in seen
    assert "--" not in seen
    dialog.reject()


@pytest.mark.parametrize(
    ("header", "ready", "words"),
    [
        ("time (s);position (deg);torque (Nm)", True, "decimal comma"),
        (
            "time (s);position (furlong);torque (Nm)",
            False,
            "'motor position' in 'furlong'; it should be in one",
        ),
        ("time;position;torque", False, "names no unit of 'time'"),
        ("time (s);torque (Nm)", False, "gives no"),
        ("position (deg);torque (Nm)", False, "or give the sampling rate with 'Samples a second'"),
    ],
)
def test_a_strangers_log_is_taken_for_one_axis_and_what_it_lacks_is_one_sentence(
    browsing: MainWindow, tmp_path: Path, header: str, ready: bool, words: str
) -> None:
    log = tmp_path / "drive.csv"
    many = header.count(";") + 1
    rows = (
        ";".join([f"{k / 500:.3f}", f"{k % 50},5", f"{k % 7},25"][-many:]).replace(".", ",")
        for k in range(1000)
    )
    log.write_text("\n".join([header, *rows]), encoding="utf-8")
    drop(browsing, log)
    dialog = dialog_of(browsing)
    taken = ("time (s);position (deg);torque (Nm)", "time;position;torque", "position (deg);torque (Nm)")
    assert child(dialog, QCheckBox, "importAxis").isChecked() == (header in taken)
    seen = child(dialog, QPlainTextEdit, "importSeen").toPlainText()
    assert words in seen
    assert seen.startswith("drive.csv")
    assert "--" not in seen
    assert child(dialog, QPushButton, "importWrite").isEnabled() == ready
    dialog.reject()


def test_a_text_that_is_no_table_cannot_be_written(browsing: MainWindow, tmp_path: Path) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("the cable was new\n", encoding="utf-8")
    drop(browsing, notes)
    dialog = dialog_of(browsing)
    assert "notes.txt" in child(dialog, QPlainTextEdit, "importSeen").toPlainText()
    assert not child(dialog, QPushButton, "importWrite").isEnabled()
    dialog.reject()
