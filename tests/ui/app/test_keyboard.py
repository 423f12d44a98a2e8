"""Tab through every tab: all that can be worked is reached in the order in which it is seen, and shows it."""

from __future__ import annotations

from itertools import pairwise

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QWidget

from fingerlab.ui.app.window import MainWindow

from ..bench_hands import Rig
from ..hands import lab_of
from ..looking import CONTROLS, nameless, shown, told

MOST = 200
"""Controls of a page; a walk that is longer goes in circles."""


def walked(window: MainWindow) -> list[QWidget]:
    """What has the keyboard one after another, from the rail until it comes round; each shows that it has."""
    for _ in range(3):
        QApplication.processEvents()
    window.rail.take_focus()
    been: list[QWidget] = []
    unseen = []
    while (now := QApplication.focusWidget()) is not None and now not in been and len(been) < MOST:
        been.append(now)
        focused = now.grab().toImage()
        QTest.keyClick(now, Qt.Key.Key_Tab)
        QApplication.processEvents()
        if now.grab().toImage() == focused:
            unseen.append(told(now))
    assert unseen == []
    return been


def missed(window: MainWindow, been: list[QWidget]) -> list[str]:
    """Controls that Tab did not come to. Of buttons of which one is pressed it comes to that one."""
    found = []
    for widget in shown(window):
        group = widget.group() if isinstance(widget, QAbstractButton) else None
        beside = group.buttons() if group is not None and group.exclusive() else [widget]
        waits = widget.isEnabled() and widget.focusPolicy() & Qt.FocusPolicy.TabFocus
        if isinstance(widget, CONTROLS) and waits and not any(one in been for one in beside):
            found.append(told(widget))
    return found


def backwards(window: MainWindow, been: list[QWidget]) -> list[str]:
    """Steps of the walk that go up, or to the left in one row, among the widgets of one parent."""
    found = []
    for one, other in pairwise(been):
        first, second = (w.rect().translated(w.mapTo(window, QPoint())) for w in (one, other))
        level = first.top() < second.center().y() < first.bottom()
        back = second.left() < first.left() if level else second.bottom() < first.top()
        if one.parentWidget() is other.parentWidget() and back:
            found.append(f"{told(one)} before {told(other)}")
    return found


def check(window: MainWindow) -> list[QWidget]:
    """Walk the page in front."""
    been = walked(window)
    assert [*missed(window, been), *backwards(window, been), *nameless(window)] == []
    # The rail, then what stands in the header above the work, then the work.
    places = [0 if window.rail.isAncestorOf(w) else 1 if window.header.isAncestorOf(w) else 2 for w in been]
    assert places == sorted(places)
    return been


@pytest.mark.parametrize("key", ["calibrate", "sessions", "fit", "predict"])
def test_tab_goes_through_a_tab_as_it_is_read(opened: MainWindow, key: str) -> None:
    opened.show_tab(key)
    assert len(check(opened)) > 2


@pytest.mark.parametrize("page", ["compare", "where", "true", "parameters"])
def test_tab_goes_through_the_model_lab_as_it_is_read(opened: MainWindow, page: str) -> None:
    """The plots had shown nothing of the keyboard, and the header's buttons had come last."""
    lab = lab_of(opened).view
    if page == "parameters":
        lab.show_parameters()
    else:
        lab.go_to(page)
    been = check(opened)
    names = [w.objectName() for w in been]
    assert names[1:3] == ["report", "open"]
    assert lab.plot in been


def test_tab_goes_through_a_rig_that_runs(rig: Rig) -> None:
    rig.start()
    names = [w.objectName() for w in check(rig.window)]
    assert names.index("disconnect") < names.index("timeWindow") < names.index("record")
