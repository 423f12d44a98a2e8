"""Tables, lists and grids of the window are copied by their context menu and by Ctrl+C."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt, QTimer
from PySide6.QtGui import QAction, QContextMenuEvent, QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractItemView, QApplication, QMenu, QWidget

from fingerlab.ui.app.window import MainWindow

from ..hands import LEFT, lab_of

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


def by_menu(widget: QWidget) -> list[str]:
    """Open the context menu and click its entry; the copied lines."""
    QGuiApplication.clipboard().clear()
    target = widget.viewport() if isinstance(widget, QAbstractItemView) else widget
    place = QPoint(4, 4)
    event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, place, target.mapToGlobal(place))

    def click() -> None:
        menu = QApplication.activePopupWidget()
        assert isinstance(menu, QMenu)
        (action,) = (one for one in menu.actions() if one.text() == "&Copy as a table")
        QTest.mouseClick(menu, LEFT, pos=menu.actionGeometry(action).center())

    QTimer.singleShot(50, click)
    QApplication.sendEvent(target, event)
    return QGuiApplication.clipboard().text().splitlines()


def test_candidates_and_errors_of_the_model_lab_are_copied(opened: MainWindow) -> None:
    view = lab_of(opened).view
    lines = by_menu(view.candidates.view)
    assert lines[0].split("\t") == ["candidate", "probability", "error with it (floors)"]
    assert [line.split("\t")[0] for line in lines[1:]] == [row.title for row in view.candidates.list.rows]
    errors = by_menu(view.path.table)
    assert errors[0].split("\t")[1:4] == ["nominal", "now", "floor"]
    assert errors[1].startswith("Joint torque\t")
    QGuiApplication.clipboard().clear()
    QTest.mouseClick(view.candidates.view.viewport(), LEFT, pos=QPoint(20, 8))
    QTest.keyClick(view.candidates.view, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    assert QGuiApplication.clipboard().text().splitlines() == lines


def test_every_table_has_the_entry(opened: MainWindow) -> None:
    for key in ("sessions", "fit", "predict", "model_lab", "calibrate"):
        opened.show_tab(key)
    tables = [w for w in opened.findChildren(QAbstractItemView) if w.inherits("QTableView")]
    named = [t for t in tables if t.objectName() not in ("", "qt_spinbox_lineedit")]
    assert len(named) >= 4
    for table in named:
        assert any(isinstance(a, QAction) and a.text() == "&Copy as a table" for a in table.actions()), table
