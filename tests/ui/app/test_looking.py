"""The checks of ``looking.py`` on a page with one fault each: a check that cannot fail shows nothing."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QTableWidget,
    QWidget,
)
from pytestqt.qtbot import QtBot

from ..looking import cut_off, nameless, overlapping, unexplained

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


@pytest.fixture
def page(qtbot: QtBot) -> QWidget:
    made = QWidget()
    qtbot.addWidget(made)
    made.resize(400, 200)
    made.show()
    return made


def put(page: QWidget, widget: QWidget, x: int, y: int, width: int, height: int) -> None:
    widget.setParent(page)
    widget.setGeometry(x, y, width, height)
    widget.show()
    QApplication.processEvents()


def test_a_good_page(page: QWidget) -> None:
    layout = QHBoxLayout(page)
    field, label = QLineEdit(), QLabel("&Folder")
    label.setBuddy(field)
    for widget in (label, field, QPushButton("Open")):
        layout.addWidget(widget)
    QApplication.processEvents()
    assert [*cut_off(page), *overlapping(page), *nameless(page)] == []


def test_a_label_that_is_too_narrow_or_too_low(page: QWidget) -> None:
    put(page, QLabel("quite a few words"), 0, 0, 30, 20)
    wrapped = QLabel("quite a few words that need three lines")
    wrapped.setWordWrap(True)
    put(page, wrapped, 0, 40, 90, 16)
    assert len(cut_off(page)) == 2


def test_a_table_whose_heading_is_squeezed(page: QWidget) -> None:
    table = QTableWidget(1, 1)
    table.setHorizontalHeaderLabels(["nominal loss\n(mN m)"])
    put(page, table, 0, 0, 300, 100)
    assert cut_off(page) == []
    table.setColumnWidth(0, 40)
    assert len(cut_off(page)) == 1


def test_a_choice_that_does_not_say_what_it_is(page: QWidget) -> None:
    box = QComboBox()
    put(page, box, 0, 0, 80, 30)
    assert len(unexplained(page)) == 1
    box.setToolTip("Run shown (Alt+Up, Alt+Down).")
    assert unexplained(page) == []


def test_two_buttons_over_one_another(page: QWidget) -> None:
    put(page, QPushButton("one"), 0, 0, 80, 30)
    put(page, QPushButton("two"), 70, 10, 80, 30)
    assert len(overlapping(page)) == 1


def test_a_field_that_says_nothing_and_one_out_of_reach(page: QWidget) -> None:
    put(page, QLineEdit(), 0, 0, 80, 30)
    assert [words.split(":")[0] for words in nameless(page)] == ["no name"]
    reached = QPushButton("Start")
    reached.setFocusPolicy(reached.focusPolicy().NoFocus)
    put(page, reached, 100, 0, 80, 30)
    assert [words.split(":")[0] for words in nameless(page)] == ["no name", "not by the keyboard"]
