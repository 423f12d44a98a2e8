"""What holds for every page of every tab: nothing cut off or over one another, every control with a name,
every field and plot with its meaning.

A page is looked at as 1280 x 800 and 1920 x 1080 screens show it, less a title bar, and as one of 1920 x 1080
at 200 % does; only there may it scroll.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QAccessible
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractScrollArea,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QHeaderView,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QScrollArea,
    QScrollBar,
    QSplitterHandle,
    QTableView,
    QToolButton,
    QWidget,
)

from fingerlab.ui.acquire.live_canvas import Canvas
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.widgets.plots import QuietPlot
from fingerlab.ui.widgets.tables import ElidedLabel

SIZES = ((1280, 760), (1920, 1040), (960, 540))
SCROLLING = SIZES[-1]
CONTROLS = (
    QAbstractButton,
    QComboBox,
    QAbstractSpinBox,
    QLineEdit,
    QPlainTextEdit,
    QAbstractItemView,
    pg.GraphicsView,
    Canvas,
)
"""What a person works or reads values from: each needs a name, and the keyboard."""
OTHER_KEYS = ("calibrationSteps", "stop")
"""Not by Tab: what is read only, and STOP, which is Escape."""
SPARE = 1
"""Pixels by which text may be narrower than the style asks for: rounding."""


def look(window: MainWindow) -> None:
    """Every check in every size."""
    for size in SIZES:
        window.resize(*size)
        for _ in range(3):  # words that wrap ask for their height when they know their width
            QApplication.processEvents()
        assert (window.width(), window.height()) == size
        found = [*cut_off(window), *overlapping(window), *nameless(window), *unexplained(window)]
        if size != SCROLLING:
            found += scrolling(window)
        assert not found, f"{size}: {'; '.join(found)}"


def shown(window: QWidget) -> Iterator[QWidget]:
    """All that is seen, without the parts that Qt makes inside its own widgets."""
    for widget in window.findChildren(QWidget):
        if widget.isVisible() and not inside_another(widget):
            yield widget


def inside_another(widget: QWidget) -> bool:
    """Whether it is a part of a control, such as the field within a spin box or the header of a table."""
    parent = widget.parentWidget()
    while parent is not None:
        if isinstance(parent, (QComboBox, QAbstractSpinBox, QAbstractItemView, pg.GraphicsView, QLineEdit)):
            return True
        parent = parent.parentWidget()
    return isinstance(widget, (QScrollBar, QSplitterHandle)) and not widget.accessibleName()


def nameless(window: QWidget) -> list[str]:
    """Controls without a name for a screen reader, or out of the keyboard's reach."""
    found = []
    for widget in shown(window):
        if not isinstance(widget, CONTROLS):
            continue
        interface = QAccessible.queryAccessibleInterface(widget)
        name = widget.accessibleName() or interface.text(QAccessible.Text.Name)
        if not name.strip("&"):
            found.append(f"no name: {told(widget)}")
        # Of buttons of which one is pressed, Tab goes to that one and the arrows to the others.
        group = widget.group() if isinstance(widget, QAbstractButton) else None
        beside = group.buttons() if group is not None and group.exclusive() else [widget]
        keys = any(one.focusPolicy() & Qt.FocusPolicy.TabFocus for one in beside)
        if not keys and widget.objectName() not in OTHER_KEYS and not isinstance(widget, pg.GraphicsView):
            found.append(f"not by the keyboard: {told(widget)}")
    return found


def unexplained(window: QWidget) -> list[str]:
    """Fields and plots that do not say which quantity they are about.

    Live plots have a reading above that does; the curves of the Model lab have their equation's button.
    """
    asked = (QComboBox, QAbstractSpinBox, QuietPlot)
    return [f"no help: {told(w)}" for w in shown(window) if isinstance(w, asked) and not w.toolTip()]


def cut_off(window: QWidget) -> list[str]:
    """Words that have less room than they need."""
    found = []
    for widget in shown(window):
        if isinstance(widget, QLabel) and widget.text() and not isinstance(widget, ElidedLabel):
            if widget.wordWrap():
                enough = widget.height() >= widget.heightForWidth(widget.width()) - SPARE
            else:
                enough = widget.width() >= widget.minimumSizeHint().width() - SPARE
        elif isinstance(widget, (QAbstractButton, QToolButton)):
            enough = widget.width() >= widget.minimumSizeHint().width() - SPARE
            enough = enough and widget.height() >= widget.fontMetrics().height()
        elif isinstance(widget, (QAbstractSpinBox, QLineEdit, QComboBox)):
            enough = widget.height() >= widget.fontMetrics().height() + 4
            enough = enough and widget.width() >= widget.minimumSizeHint().width() - SPARE
        elif isinstance(widget, QTableView):
            enough = headings_whole(widget.horizontalHeader())
        else:
            continue
        if not enough:
            found.append(f"cut off: {told(widget)}")
    return found


def headings_whole(header: QHeaderView) -> bool:
    """Whether every heading has room for its longest line."""
    model, metrics = header.model(), header.fontMetrics()
    for column in range(header.count()):
        text = str(model.headerData(column, Qt.Orientation.Horizontal) or "")
        longest = max((metrics.horizontalAdvance(line) for line in text.split("\n")), default=0)
        if not header.isSectionHidden(column) and header.sectionSize(column) < longest:
            return False
    return True


def overlapping(window: QWidget) -> list[str]:
    """Widgets of one parent that lie over one another."""
    found = []
    for parent in (window, *shown(window)):
        if isinstance(parent, QAbstractScrollArea) and not isinstance(parent, QScrollArea):
            continue
        if inside_another(parent) or isinstance(parent, CONTROLS):
            continue
        children = [
            child
            for child in parent.children()
            if isinstance(child, QWidget) and child.isVisible() and not child.isWindow()
        ]
        for one, other in combinations(children, 2):
            both = one.geometry().intersected(other.geometry())
            if both.width() > SPARE and both.height() > SPARE:
                found.append(f"{told(one)} over {told(other)}")
    return found


def scrolling(window: MainWindow) -> list[str]:
    """Areas around the pages that have to scroll."""
    found = []
    for area in window.findChildren(QScrollArea):
        for bar in (area.horizontalScrollBar(), area.verticalScrollBar()):
            if area.isVisible() and bar.maximum() > 0:
                found.append(f"{told(area)} scrolls by {bar.maximum()}")
    return found


def told(widget: QWidget) -> str:
    """Which one it is."""
    text = getattr(widget, "text", lambda: "")
    return f"{type(widget).__name__} {widget.objectName() or text() or widget.accessibleName()!r}"
