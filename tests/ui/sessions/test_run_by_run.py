"""Two days compared run by run, by clicks: what differs is found, named and drawn in phase."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton, QTableWidget
from pytestqt.qtbot import QtBot

from fingerlab.ui.sessions.result_dialogs import PairsDialog
from fingerlab.ui.sessions.sessions_tab import SessionsTab

from ..hands import LEFT, PATIENCE, child, click

SAMPLES = 12_000
MORE = 0.004  # N m, of torque whenever the finger extends
NOISE = 2e-4  # N m
pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


def day(created: str, late: float, more: float, seed: int):  # type: ignore[no-untyped-def]
    def change(file: h5py.File) -> None:
        file.attrs["created"] = created
        run, rng = file["runs/001"], np.random.default_rng(seed)
        turn = 2 * np.pi * (np.arange(SAMPLES) / 1000.0 - late)
        run["motor_position"][...] = np.radians(22 + 14.9 * np.sin(turn))
        for joint in ("mcp_angle", "pip_angle"):
            run[joint][...] = -0.2 * np.sin(turn) + 1e-3 * rng.standard_normal(SAMPLES)
        torque = 0.02 + 0.01 * np.sin(turn) + more * (np.cos(turn) < 0)
        run["motor_torque"][...] = torque + NOISE * rng.standard_normal(SAMPLES)

    return change


def test_what_differs_between_two_days_is_named_and_drawn(
    qtbot: QtBot, make_window, make_session, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    one = (("on_air", "extension"),)
    make_session("b-monday.h5", day("2026-05-04T10:00:00+02:00", 0.0, 0.0, 1), one, SAMPLES)
    make_session("a-tuesday.h5", day("2026-05-05T10:00:00+02:00", 0.4, MORE, 2), one, SAMPLES)
    window = make_window(tab="sessions")
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    tab.browse(tmp_path)
    qtbot.waitUntil(lambda: tab.page.model.total == 2, timeout=PATIENCE)
    assert not child(window, QPushButton, "compareRuns").isEnabled()
    tab.page.table.setFocus()
    QTest.keyClick(tab.page.table, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
    click(window, "compareRuns")
    qtbot.waitUntil(lambda: any(d.isVisible() for d in window.findChildren(PairsDialog)), timeout=PATIENCE)
    dialog = window.findChild(PairsDialog)
    said = child(dialog, QLabel, "pairWords").text()
    assert said.startswith("1 run of the same motion in b-monday.h5 and a-tuesday.h5. Motor torque")
    table = child(dialog, QTableWidget, "pairTable")
    headers = [table.horizontalHeaderItem(column).text() for column in range(table.columnCount())]
    column = headers.index("Motor torque (mN m)")
    text = table.item(0, column).text()
    # Half the cycle 4 mN m more: 2 mN m all along, 2 mN m about it, together sqrt 8.
    assert float(text.split()[0]) == pytest.approx(2.83, abs=0.05)
    assert float(text.partition("(")[2].split()[0]) == pytest.approx(np.sqrt(8e-6) / NOISE, rel=0.2)
    assert "2.0" in table.item(0, column).toolTip()
    QTest.mouseClick(table.viewport(), LEFT, pos=table.visualItemRect(table.item(0, column)).center())
    (series,) = dialog.difference.shown_series()
    rising = (series.x < 0.23) | (series.x > 0.77)
    assert np.abs(series.y[rising]).max() < 0.3
    assert np.mean(series.y[(series.x > 0.27) & (series.x < 0.73)]) == pytest.approx(4.0, abs=0.1)
    assert "shifted by 400 ms" in child(dialog, QLabel, "pairTitle").text()
    position = headers.index("Motor position (°)")
    QTest.mouseClick(table.viewport(), LEFT, pos=table.visualItemRect(table.item(0, position)).center())
    assert [one.name for one in dialog.curves.shown_series()] == ["b-monday.h5", "a-tuesday.h5"]
    assert child(dialog, QLabel, "pairTitle").text().startswith("Motor position")
