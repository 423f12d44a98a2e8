"""What tells a finished window: what cannot be used looks so, news are marked, words on bars can be read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import QObject, Qt, QUrl, Slot
from PySide6.QtGui import QColor, QDesktopServices, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QFrame,
    QLabel,
    QProgressBar,
    QPushButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from fingerlab.ui.app.bars import MessageBar
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.widgets.tables import LinesLabel
from fingerlab.ui.widgets.theme import Appearance, apply_appearance

from ..hands import child, click
from .test_throughout import contrast


@pytest.fixture(params=("light", "dark"))
def appearance(request: pytest.FixtureRequest, qapp: QApplication) -> Any:
    look: Appearance = request.param
    apply_appearance(qapp, look)
    yield look
    apply_appearance(qapp, "light")


def inks(image: QImage, ground: QColor) -> float:
    """The strongest contrast of any pixel against the ground."""
    pixels = {image.pixelColor(x, y).rgb() for x in range(image.width()) for y in range(image.height())}
    return max(contrast(QColor(one), ground) for one in pixels)


@pytest.mark.qt_log_ignore("This plugin does not support")
def test_a_menu_entry_that_cannot_be_used_looks_so(make_window: Any, appearance: Appearance) -> None:
    window: MainWindow = make_window()
    menu = window.menus.tab_menu
    menu.popup(window.pos())
    picture = menu.grab().toImage()
    usable, idle = [], []
    for action in menu.actions():
        if action.isSeparator():
            continue
        # Twice the words' own height beside the edges of the entry, where nothing else is drawn.
        room = menu.actionGeometry(action).adjusted(24, 2, -8, -2)
        part = picture.copy(room)
        (usable if action.isEnabled() else idle).append(inks(part, part.pixelColor(0, 0)))
    menu.hide()
    assert usable
    assert idle
    assert max(idle) < 0.5 * min(usable)


def test_a_link_that_cannot_be_used_looks_so(make_window: Any, appearance: Appearance) -> None:
    window: MainWindow = make_window()
    window.show_tab("model_lab")
    link = child(window, QPushButton, "example_joint-friction")

    def colourful() -> float:
        picture = link.grab().toImage()
        every = [picture.pixelColor(x, y) for x in range(picture.width()) for y in range(picture.height())]
        return max(
            max(one.red(), one.green(), one.blue()) - min(one.red(), one.green(), one.blue()) for one in every
        )

    assert colourful() > 100
    link.setEnabled(False)
    assert colourful() < 30


def test_each_tabs_menu_has_a_letter_of_its_own(make_window: Any) -> None:
    window: MainWindow = make_window()
    for key in ("acquire", "calibrate", "sessions", "fit", "predict", "model_lab"):
        window.show_tab(key)
        titles = [action.text() for action in window.menuBar().actions() if action.isVisible()]
        letters = [title[title.index("&") + 1].upper() for title in titles]
        assert len(set(letters)) == len(titles), titles
        if key == "sessions":
            window.tab(key).review_page  # noqa: B018 -- made at its first use
            window.tab(key).page.show_reading(True)  # its button has other words as long as a folder is read
        for widget in window.tab(key).widget.findChildren(QWidget):
            # The letter of a menu opens it, on every page: no button or field has it, too.
            written = isinstance(widget, QAbstractButton) or (isinstance(widget, QLabel) and widget.buddy())
            text = widget.text().replace("&&", "") if written and widget.window() is window else ""
            taken = text[text.index("&") + 1].upper() if "&" in text else ""
            assert taken not in letters, (key, text)


def test_the_percentage_is_legible_on_and_beside_its_bar(make_window: Any, appearance: Appearance) -> None:
    window: MainWindow = make_window()
    bar = child(window, QProgressBar, "progress")
    text = bar.palette().color(bar.foregroundRole())
    bar.setValue(500)
    bar.show()
    picture = bar.grab().toImage()
    middle = picture.height() // 2
    for x in (picture.width() // 8, picture.width() * 7 // 8):
        assert contrast(text, picture.pixelColor(x, middle)) > 4.5


class Opened(QObject):
    """What the computer was asked to open."""

    def __init__(self) -> None:
        super().__init__()
        self.urls: list[QUrl] = []

    @Slot(QUrl)
    def take(self, url: QUrl) -> None:
        self.urls.append(url)


def test_that_something_was_written_goes_by_itself_and_trouble_stays(
    qtbot: QtBot, make_window: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(MessageBar, "GOES_AFTER_MS", 60)
    window: MainWindow = make_window(tab="fit")
    bar, opens = child(window, QFrame, "messageBar"), child(window, QPushButton, "openWritten")
    window.context.announce("Report page saved", tmp_path / "page.html")
    opens.setFocus()
    qtbot.wait(150)
    assert bar.isVisible()  # not from under the hand that is about to open it
    opens.clearFocus()
    qtbot.waitUntil(lambda: not bar.isVisible())
    window.context.announce("Report page saved", tmp_path / "page.html")
    window.context.tell("It cannot be written.")
    qtbot.wait(150)
    assert bar.isVisible()
    window.context.announce("Hidden was Coulomb joint friction.")  # an answer, not a file
    qtbot.wait(150)
    assert bar.isVisible()


def test_what_was_done_is_marked_otherwise_than_trouble_and_can_be_opened(
    qtbot: QtBot, make_window: Any, tmp_path: Path, session_file: Path
) -> None:
    window: MainWindow = make_window(tab="fit")
    bar, mark = child(window, QFrame, "messageBar"), child(window, QLabel, "messageKind")
    asked = Opened()
    QDesktopServices.setUrlHandler("file", asked, "take")
    try:
        window.context.announce("Report page saved", tmp_path / "page.html")
        done = bar.grab().toImage().pixelColor(2, 2), mark.text(), mark.accessibleName()
        click(window, "openWritten")
        window.context.announce("Model saved", tmp_path / "model.json")
        click(window, "openWritten")
    finally:
        QDesktopServices.unsetUrlHandler("file")
    # A page in its own program; of a file that no program shows, the folder.
    assert [Path(url.toLocalFile()) for url in asked.urls] == [tmp_path / "page.html", tmp_path]
    words = "Nothing was hidden in what the simulated bench has recorded; practise on another one. " * 3
    window.context.announce(words)
    lines = child(window, LinesLabel, "message").lines
    assert len(lines) == 2
    assert [word for line in lines for word in line.split()] == words.split()  # none is broken in two
    window.context.tell("It cannot be written.", "why")
    trouble = bar.grab().toImage().pixelColor(2, 2), mark.text(), mark.accessibleName()
    assert not child(window, QPushButton, "openWritten").isVisible()
    assert all(one != other for one, other in zip(done, trouble, strict=True))
    window.context.announce("Written", session_file)
    QTest.mouseClick(child(window, QPushButton, "openWritten"), Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: bool(window.context.sessions), timeout=10_000)
    assert window.context.sessions[0].path == session_file
