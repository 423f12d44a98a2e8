"""The import of a log of one axis: its own words and units, nothing of a finger, whole in larger letters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import QComboBox, QLabel, QWidget
from pytestqt.qtbot import QtBot

from fingerlab.ui.sessions.import_dialog import ImportDialog

from ..hands import child
from ..looking import cut_off

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


def log(folder: Path, header: str, name: str = "stage.csv") -> Path:
    """Two seconds of a stage that goes 40 mm to and fro: time, position, force or current."""
    time = np.arange(1000) / 500.0
    table = np.stack((time, 40.0 * np.sin(2 * np.pi * time), np.cos(2 * np.pi * time)), axis=1)
    np.savetxt(folder / name, table, "%.5f", ",", header=header, comments="")
    return folder / name


def dialog_of(qtbot: QtBot, *files: Path) -> ImportDialog:
    dialog = ImportDialog(files)
    qtbot.addWidget(dialog)
    dialog.show()
    qtbot.waitExposed(dialog)
    return dialog


def test_it_speaks_of_an_axis_and_draws_millimetres(qtbot: QtBot, tmp_path: Path) -> None:
    dialog = dialog_of(qtbot, log(tmp_path, "t (s),x (mm),F (N)"))
    assert dialog.axis.isChecked()
    assert [dialog.columns.title(row) for row in range(3)] == ["time", "position", "torque or force"]
    listed = child(dialog, QComboBox, "importIs1")
    assert not {"MCP angle", "motor position"} & {listed.itemText(k) for k in range(listed.count())}
    dialog.columns.selectRow(1)
    axis = dialog.preview.getPlotItem().getAxis("left")
    assert axis.labelText == "Position (mm)"
    (curve,) = [one for one in dialog.preview.getPlotItem().listDataItems() if one.name() == "position"]
    assert np.nanmax(curve.getData()[1]) == pytest.approx(40.0, abs=0.1)
    # Of a finger: unseen, and not told.
    for name in ("importPhase0", "importCable0"):
        assert not child(dialog, QComboBox, name).isVisible()
    seen = [one.text() for one in dialog.findChildren(QLabel) if one.isVisible()]
    assert not {"Phase", "Cable"} & set(seen)
    assert "cable" not in dialog.seen.toPlainText()
    assert dialog.write.isEnabled()
    # There is a force: nobody asks what an ampere gives.
    assert not dialog.constant.isVisible()
    dialog.axis.click()
    assert child(dialog, QComboBox, "importCable0").isVisible()
    assert not dialog.lever.isVisible()


def test_what_an_ampere_gives_is_asked_of_a_log_with_a_current(qtbot: QtBot, tmp_path: Path) -> None:
    dialog = dialog_of(qtbot, log(tmp_path, "t (s),x (mm),current (A)"))
    assert dialog.constant.isVisible()
    assert not dialog.write.isEnabled()
    assert "Torque of an ampere" in dialog.seen.toPlainText()
    dialog.constant.setValue(38.0)
    assert dialog.write.isEnabled()


def test_nothing_is_cut_with_larger_letters(larger_letters: None, qtbot: QtBot, tmp_path: Path) -> None:
    files = [log(tmp_path, "t_s,pos_mm,current_A", f"run0{k}.csv") for k in range(3)]
    dialog = dialog_of(qtbot, *files)
    dialog.resize(960, 700)
    qtbot.wait(50)
    assert cut_off(dialog) == []
    header = dialog.columns.horizontalHeader()
    first = dialog.columns.horizontalHeaderItem(0)
    assert first is not None
    assert header.fontMetrics().horizontalAdvance(first.text()) < header.sectionSize(0)
    assert not dialog.columns.horizontalScrollBar().isVisible()
    # A label stands in the row of its field.
    for name in ("importConstant", "importLever"):
        field = child(dialog, QWidget, name)
        (label,) = [one for one in dialog.findChildren(QLabel) if one.buddy() is field]
        assert abs(label.geometry().center().y() - field.geometry().center().y()) < 5
        assert label.parentWidget() is field.parentWidget()
    # All three files are seen.
    assert not dialog._list.verticalScrollBar().isVisible()
