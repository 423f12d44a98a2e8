"""What holds in every tab: the rail's two marks, time left, the smallest window."""

from __future__ import annotations

from collections import Counter

import pytest
from PySide6.QtCore import QObject, QRect, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QApplication,
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QMenu,
    QPlainTextEdit,
    QPushButton,
    QRadioButton,
    QScrollArea,
    QSpinBox,
    QWidget,
)
from pytestqt.qtbot import QtBot

from fingerlab.ui.app.bars import TaskBar, time_left
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.widgets.tables import FramedTicks
from fingerlab.ui.widgets.theme import Appearance, apply_appearance

from ..bench_hands import Rig
from ..hands import child, invented_diagnosis, sideways
from ..looking import cut_off, scrolling

SMALLEST = QSize(960, 540)
"""A screen of 1920 x 1080 at 200 %."""


def picture(button: QPushButton) -> QImage:
    return button.grab().toImage()


def test_the_tab_in_front_and_the_one_with_the_keyboard_look_different(make_window) -> None:  # type: ignore[no-untyped-def]
    window: MainWindow = make_window(diagnose=invented_diagnosis)
    front, other = child(window, QPushButton, "tab_model_lab"), child(window, QPushButton, "tab_fit")
    bar = [picture(front).pixelColor(1, front.height() // 2), picture(other).pixelColor(1, 5)]
    other.setFocus()
    focused, shown = picture(other), picture(front)
    # The bar at the left belongs to the tab in front, whatever has the keyboard; focus is a frame all round.
    assert shown.pixelColor(1, front.height() // 2) == bar[0]
    assert focused.pixelColor(1, other.height() // 2) != bar[0]
    top = {focused.pixelColor(x, 0).name() for x in range(8, other.width() - 8)}
    assert len(top) > 1, "no frame"
    assert {shown.pixelColor(x, 0).name() for x in range(8, front.width() - 8)} != top
    QTest.keyClick(other, Qt.Key.Key_Space)
    assert window.current == "fit"
    both = picture(other)
    assert both.pixelColor(1, other.height() // 2) == bar[0]


@pytest.mark.parametrize(
    ("share", "seconds", "words"),
    [
        (0.5, 10.0, "about 10 s left"),
        (0.25, 60.0, "about 3 min left"),
        (0.99, 10.0, "about 1 s left"),
        (0.04, 60.0, ""),
        (0.5, 1.0, ""),
        (1.0, 10.0, ""),
    ],
)
def test_time_left(share: float, seconds: float, words: str) -> None:
    assert time_left(share, seconds) == words


class Runner(QObject):
    """The signals of a task runner."""

    started = Signal(str)
    progressed = Signal(float, str)
    ended = Signal(str)


def test_the_bar_tells_the_time_left(qtbot: QtBot) -> None:
    now = [100.0]
    tasks = Runner()
    bar = TaskBar(tasks, clock=lambda: now[0])  # type: ignore[arg-type]
    qtbot.addWidget(bar)
    tasks.started.emit("Comparing")
    now[0] = 112.0
    tasks.progressed.emit(0.75, "run 3 of 4")
    assert bar.text.text() == "Comparing: run 3 of 4, about 4 s left"


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_the_bar_gives_its_words_the_room_of_work_that_does_not_run(qtbot: QtBot) -> None:
    """A sentence had been cut off while a third of the line beside it was empty; the height stays."""
    tasks = Runner()
    bar = TaskBar(tasks)  # type: ignore[arg-type]
    qtbot.addWidget(bar)
    bar.resize(600, bar.sizeHint().height())
    bar.show()
    QApplication.processEvents()
    idle, height = bar.text.width(), bar.height()
    assert idle >= 600 - 8
    tasks.started.emit("Comparing")
    QApplication.processEvents()
    assert bar.text.width() < idle
    assert bar.height() == height >= bar.cancel.height()


@pytest.mark.parametrize(
    ("key", "names"),
    [("fit", ("analyse",)), ("predict", ("addModels",)), ("sessions", ("openInLab", "keepNotes"))],
)
def test_buttons_at_the_side_are_whole_with_larger_letters(
    larger_letters, make_window, key: str, names: tuple[str, ...]
) -> None:  # type: ignore[no-untyped-def]
    window: MainWindow = make_window(diagnose=invented_diagnosis)
    window.show_tab(key)
    QApplication.processEvents()
    for name in names:
        button = child(window, QPushButton, name)
        assert button.width() >= button.sizeHint().width(), name


@pytest.mark.parametrize("key", ["acquire", "calibrate", "sessions", "fit", "predict"])
def test_no_tab_scrolls_sideways_with_larger_letters(larger_letters, make_window, key: str) -> None:  # type: ignore[no-untyped-def]
    window: MainWindow = make_window(tab=key)
    assert sideways(window) == 0
    assert cut_off(window.tab(key).widget) == []


def test_nor_does_the_model_lab_with_a_result(larger_letters, opened: MainWindow) -> None:  # type: ignore[no-untyped-def]
    assert sideways(opened) == 0
    bar = opened.tab("model_lab").view.bar
    assert bar.row.rows == 2  # the error stands below the equations, all of it
    assert ", floor " in bar.error.text()


@pytest.mark.parametrize("step", ["compare", "where", "missing", "add", "true"])
def test_a_low_model_lab_folds_its_error_path(larger_letters, opened: MainWindow, step: str) -> None:  # type: ignore[no-untyped-def]
    """It had scrolled down by 61 to 82 px; what was below all is a page of its own there."""
    lab = opened.tab("model_lab").view
    QTest.mouseClick(lab.steps.button(step), Qt.MouseButton.LeftButton)
    assert sideways(opened) == 0
    assert [*scrolling(opened), *cut_off(lab)] == []
    assert not lab.path.isVisible()
    link = child(opened, QPushButton, "showErrorPath")
    assert link.text() == "Error path"
    QTest.mouseClick(link, Qt.MouseButton.LeftButton)
    QApplication.processEvents()
    assert lab.path.undo.isVisible()
    assert [*scrolling(opened), *cut_off(lab)] == []
    assert lab.path.path.width() > 400  # with the titles of its bars
    QTest.mouseClick(link, Qt.MouseButton.LeftButton)
    assert lab.candidates.isVisible()
    QTest.mouseClick(link, Qt.MouseButton.LeftButton)
    opened.resize(1280, 800)
    for _ in range(3):
        QApplication.processEvents()
    assert [lab.candidates.isVisible(), lab.path.isVisible(), link.isVisible()] == [True, True, False]
    assert [*scrolling(opened), *cut_off(lab)] == []


def test_parameters_have_whole_headings_with_larger_letters(larger_letters, opened: MainWindow) -> None:  # type: ignore[no-untyped-def]
    opened.tab("model_lab").view.show_parameters()
    assert sideways(opened) == 0
    assert [*scrolling(opened), *cut_off(opened.tab("model_lab").widget)] == []


def test_nor_does_a_rig_that_runs_and_what_can_be_spared_comes_back(larger_letters, rig: Rig) -> None:  # type: ignore[no-untyped-def]
    rig.start()
    assert sideways(rig.window) == 0
    torque = rig.tab.plots.panes["torque"]
    shown = [name for name, reading in torque.readings.items() if reading.isVisible()]
    assert shown == ["motor_torque"]
    rig.window.resize(1280, 760)
    QApplication.processEvents()
    assert torque.scale_button.text() == "Scale: auto"


@pytest.mark.parametrize("key", ["acquire", "calibrate", "sessions", "fit", "predict", "model_lab"])
def test_in_the_smallest_window_nothing_is_squeezed(make_window, key: str) -> None:  # type: ignore[no-untyped-def]
    """A tab has the room that it needs: its own, or with scroll bars that lead to the rest."""
    window: MainWindow = make_window(diagnose=invented_diagnosis)
    window.resize(SMALLEST)
    window.show_tab(key)
    QApplication.processEvents()
    widget = window.tab(key).widget
    needed = widget.minimumSizeHint().expandedTo(widget.minimumSize())
    assert widget.width() >= needed.width()
    assert widget.height() >= needed.height()
    room = window.work.currentWidget()
    assert isinstance(room, QScrollArea)
    spare = widget.size() - room.viewport().size()
    assert room.horizontalScrollBar().maximum() == spare.width()
    assert room.verticalScrollBar().maximum() == spare.height()


@pytest.mark.parametrize("key", ["acquire", "calibrate", "sessions", "fit", "predict", "model_lab"])
def test_at_1280_by_800_nothing_scrolls(make_window, key: str) -> None:  # type: ignore[no-untyped-def]
    window: MainWindow = make_window(diagnose=invented_diagnosis)
    window.resize(1280, 800)
    window.show_tab(key)
    QApplication.processEvents()
    room = window.work.currentWidget()
    assert isinstance(room, QScrollArea)
    assert room.horizontalScrollBar().maximum() == room.verticalScrollBar().maximum() == 0


@pytest.mark.parametrize("look", ["light", "dark"])
def test_a_field_or_box_has_an_edge_that_is_seen(qtbot: QtBot, qapp: QApplication, look: Appearance) -> None:
    """Not ticked, without the keyboard, on the window's own colour: the style alone leaves none on black."""
    page = QWidget()
    qtbot.addWidget(page)
    fields = [
        kind(page) for kind in (QCheckBox, QRadioButton, QLineEdit, QPlainTextEdit, QDoubleSpinBox, QSpinBox)
    ]
    for number, field in enumerate(fields):
        field.setGeometry(8, 8 + 32 * number, 80, 24)
    apply_appearance(qapp, look)
    image = page.grab(QRect(0, 0, 96, 40 * len(fields))).toImage()
    apply_appearance(qapp, "light")
    for field in fields:
        row = [image.pixelColor(x, field.geometry().center().y()) for x in range(4, 40)]
        edge = max(contrast(colour, row[0]) for colour in row)
        assert edge > (1.4 if look == "light" else 2.0), type(field).__name__


@pytest.mark.parametrize("look", ["light", "dark"])
def test_boxes_in_a_list_have_an_edge_ticked_or_not_selected_or_not(
    qtbot: QtBot, qapp: QApplication, look: Appearance
) -> None:
    listed = QListWidget()
    qtbot.addWidget(listed)
    listed.setItemDelegate(FramedTicks(listed))
    listed.setStyleSheet("QListView::item:selected { background: palette(midlight); }")
    for state in (Qt.CheckState.Checked, Qt.CheckState.Unchecked, Qt.CheckState.Unchecked):
        item = QListWidgetItem()
        item.setCheckState(state)
        listed.addItem(item)
    listed.setCurrentRow(2)
    apply_appearance(qapp, look)
    image = listed.viewport().grab().toImage()
    apply_appearance(qapp, "light")
    for row in range(listed.count()):
        place = listed.visualItemRect(listed.item(row))
        y = place.center().y() - 5  # above the tick, between the frame's upper corners
        edge = max(contrast(image.pixelColor(x, y), image.pixelColor(40, y)) for x in range(20))
        assert edge > (2.0 if row == 2 else 3.0), row


@pytest.mark.parametrize("look", ["light", "dark"])
def test_a_menus_boxes_and_lines_are_seen(qtbot: QtBot, qapp: QApplication, look: Appearance) -> None:
    apply_appearance(qapp, look)
    menu = QMenu()
    qtbot.addWidget(menu)
    ticked = menu.addAction("Cursors")
    menu.addSeparator()
    below = menu.addAction("")
    ticked.setCheckable(True)
    menu.resize(menu.sizeHint())
    image = menu.grab().toImage()
    apply_appearance(qapp, "light")
    row = menu.actionGeometry(ticked).center().y()
    across = [image.pixelColor(x, row) for x in range(4, 20)]
    ends = menu.actionGeometry(ticked).bottom() - 1, menu.actionGeometry(below).top() + 2
    down = [image.pixelColor(menu.width() // 2, y) for y in range(*ends)]
    for seen in (across, down):
        assert max(contrast(one, other) for one in seen for other in seen) > 1.3


@pytest.mark.parametrize("look", ["light", "dark"])
@pytest.mark.parametrize("kind", [QMenu, QComboBox])
def test_the_entry_under_the_mouse_can_be_read(
    qtbot: QtBot, qapp: QApplication, kind: type[QMenu | QComboBox], look: Appearance
) -> None:
    apply_appearance(qapp, look)
    choice = kind()
    qtbot.addWidget(choice)
    if isinstance(choice, QMenu):
        choice.setActiveAction(choice.addAction("MMMM"))
        shown: QWidget = choice
    else:
        choice.addItem("MMMM")
        view = choice.view()
        view.window().resize(120, 60)
        view.setCurrentIndex(choice.model().index(0, 0))
        shown = view.viewport()
    image = shown.grab(QRect(0, 0, 90, 20)).toImage()
    apply_appearance(qapp, "light")
    colours = [image.pixelColor(x, y) for x in range(4, 80) for y in range(4, 16)]
    ground = Counter(colour.name() for colour in colours).most_common(1)[0][0]
    assert max(contrast(colour, QColor(ground)) for colour in colours) > 4.5


def contrast(one: QColor, other: QColor) -> float:
    """Contrast ratio as the guidelines for accessible web content define it: 1 for none, 21 at most."""
    lighter, darker = sorted((luminance(one), luminance(other)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


def luminance(colour: QColor) -> float:
    """Relative luminance, 0 to 1."""
    parts = (colour.redF(), colour.greenF(), colour.blueF())
    linear = [part / 12.92 if part <= 0.03928 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_what_is_greyed_looks_so(qtbot: QtBot, qapp: QApplication) -> None:
    box = QCheckBox("Trigger")
    qtbot.addWidget(box)
    usable = box.grab().toImage()
    box.setEnabled(False)
    greyed = box.grab().toImage()
    darkest = [
        min(
            luminance(image.pixelColor(x, y)) for x in range(20, image.width()) for y in range(image.height())
        )
        for image in (usable, greyed)
    ]
    assert darkest[1] > darkest[0] + 0.05
