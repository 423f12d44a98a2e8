"""The Sessions tab as a person uses it: choose a folder, search, tag, open."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from PySide6.QtCore import QPoint, QSettings, Qt
from PySide6.QtGui import QAction, QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QApplication,
    QFileDialog,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
)
from pytestqt.qtbot import QtBot

from fingerlab.core.errors import Cancelled
from fingerlab.effects import CATALOGUE
from fingerlab.library.notes import FILE_NAME
from fingerlab.report.diagnosis_words import effect_title
from fingerlab.sessions import open_session
from fingerlab.ui.app.context import Settings
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.sessions import sessions_tab as browse_tab
from fingerlab.ui.sessions.session_table import NAME, QUALITY, RECORDED, TAGS, VERDICT, in_two_lines
from fingerlab.ui.sessions.sessions_tab import SessionsTab

from ..hands import LEFT, PATIENCE, child, click, drop, invented_diagnosis, lab_of
from ..looking import look
from ..saving import save_each_plot

Opened = tuple[MainWindow, SessionsTab]


def sessions_of(window: MainWindow) -> SessionsTab:
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    return tab


def texts(tab: SessionsTab, column: int) -> list[str]:
    model = tab.page.model
    return [model.index(row, column).data() for row in range(model.rowCount())]


@pytest.fixture
def folder(make_session: Callable[..., Path], tmp_path: Path) -> Path:
    """Two good sessions, of which one came late, and a file that is none."""
    (tmp_path / "library" / "may").mkdir(parents=True)

    def later(file: h5py.File) -> None:
        file.attrs["created"] = "2026-11-02T14:30:00+01:00"
        file.attrs["title"] = "Index finger"
        file["runs/001"].attrs["late_cycles"] = 12

    make_session("library/ring.h5", phases=(("on_air", "extension"),) * 3)
    make_session("library/may/index.h5", later)
    (tmp_path / "library" / "broken.h5").write_text("no session", encoding="utf-8")
    return tmp_path / "library"


@pytest.fixture
def browsing(qtbot: QtBot, make_window, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Opened:  # type: ignore[no-untyped-def]
    window = make_window(tab="sessions", diagnose=invented_diagnosis)
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", staticmethod(lambda *_: str(folder)))
    click(window, "chooseFolder")
    tab = sessions_of(window)
    qtbot.waitUntil(lambda: tab.page.count.text() == "3 sessions", timeout=PATIENCE)
    return window, tab


def row_of(tab: SessionsTab, name: str) -> int:
    return next(row for row, text in enumerate(texts(tab, NAME)) if text.startswith(name))


def choose(tab: SessionsTab, name: str) -> None:
    place = tab.page.table.visualRect(tab.page.model.index(row_of(tab, name), NAME)).center()
    QTest.mouseClick(tab.page.table.viewport(), LEFT, Qt.KeyboardModifier.NoModifier, place)


def test_the_table_tells_latest_first_and_by_the_benchs_clock(browsing: Opened, folder: Path) -> None:
    window, tab = browsing
    assert texts(tab, NAME) == ["may/index.h5\nIndex finger", "ring.h5\nRing finger, Łódź", "broken.h5"]
    assert texts(tab, RECORDED)[:2] == ["2026-11-02\n14:30:00", "2026-11-01\n09:00:00"]
    assert texts(tab, QUALITY) == ["! 12 late cycles", "✓ clean", "✗ unreadable"]
    assert window.settings.library() == folder


def test_ctrl_c_copies_the_table_as_it_is_seen(browsing: Opened) -> None:
    _, tab = browsing
    table = tab.page.table
    table.setFocus()
    QTest.keyClick(table, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    lines = [line.split("\t") for line in QGuiApplication.clipboard().text().splitlines()]
    assert len(lines) == 4  # the titles and three sessions
    shown = sum(not table.isColumnHidden(column) for column in range(table.model().columnCount()))
    assert {len(line) for line in lines} == {shown}
    assert "may/index.h5 Index finger" in lines[1]
    assert "! 12 late cycles" in lines[1]
    assert "ring.h5 Ring finger, Łódź" in lines[2]


def test_files_that_cannot_be_looked_at_end_no_list_and_no_start(
    qtbot: QtBot, make_window, make_session, folder: Path, settings: Settings, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    """A link to a name that no system takes stands for a folder that may not be entered: both raise."""
    unreachable = folder / "away.h5"
    try:
        unreachable.symlink_to("n" * 300)
    except OSError:
        pytest.skip("this system makes no such link")
    (folder / "round.h5").symlink_to("round.h5")
    (folder / "folder.h5").mkdir()
    strange = {"created": np.zeros(0), "title": "\x1b]0;x", "tags": 1e308, "operator": "[/b]{0}%s"}
    make_session("library/odd.h5", lambda file: [file.attrs.__setitem__(*one) for one in strange.items()])
    store = QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)
    store.setValue(
        "recent", [str(unreachable), str(folder), str(folder / "gone.h5"), str(folder / "ring.h5")]
    )
    store.sync()
    settings.set_library(folder)
    window = make_window(tab="sessions", diagnose=invented_diagnosis)
    assert settings.recent() == [folder / "ring.h5"]
    tab = sessions_of(window)
    qtbot.waitUntil(lambda: tab.page.count.text() == "6 sessions", timeout=PATIENCE)
    said = dict(zip(texts(tab, NAME), texts(tab, QUALITY), strict=True))
    assert [said[name] for name in ("away.h5", "round.h5", "odd.h5")] == ["✗ unreadable"] * 3
    window.open_paths([unreachable])
    qtbot.waitUntil(lambda: window.message.sentence.text().startswith(str(unreachable)), timeout=PATIENCE)


def test_thumbnails_are_read_when_rows_are_seen(browsing: Opened, qtbot: QtBot, folder: Path) -> None:
    _, tab = browsing
    page = tab.page

    def both() -> bool:
        found = [page._thumbnail(folder / name) for name in ("ring.h5", "may/index.h5")]
        return all(one is not None for one in found)

    qtbot.waitUntil(both, timeout=PATIENCE)
    assert page._thumbnail(folder / "broken.h5") is None


def test_the_search_box_filters_and_says_what_it_does_not_understand(browsing: Opened) -> None:
    window, tab = browsing
    search = child(window, QLineEdit, "search")
    QTest.keyClicks(search, "phase:contact")
    assert texts(tab, NAME) == ["may/index.h5\nIndex finger"]
    assert child(window, QLabel, "sessionCount").text() == "1 of 3 sessions"
    search.clear()
    QTest.keyClicks(search, "longer:much")
    assert "write seconds" in child(window, QLabel, "libraryEmpty").text()


def test_tags_are_kept_beside_the_recording_and_found_again(browsing: Opened, folder: Path) -> None:
    window, tab = browsing
    before = (folder / "ring.h5").read_bytes()
    choose(tab, "ring.h5")
    QTest.keyClicks(child(window, QLineEdit, "tags"), "good, new cable")
    click(window, "keepNotes")
    assert texts(tab, TAGS)[row_of(tab, "ring.h5")] == "good, new cable"
    QTest.keyClicks(child(window, QPlainTextEdit, "notes"), "run 2 slipped")
    choose(tab, "may/index.h5")  # what was typed is kept without being asked for
    assert "run 2 slipped" in (folder / FILE_NAME).read_text(encoding="utf-8")
    assert child(window, QPlainTextEdit, "notes").toPlainText() == ""
    QTest.keyClicks(child(window, QLineEdit, "search"), "tag:cable")
    assert texts(tab, NAME) == ["ring.h5\nRing finger, Łódź"]
    assert (folder / "ring.h5").read_bytes() == before


def test_a_wide_window_gives_the_verdict_room(browsing: Opened, qtbot: QtBot) -> None:
    window, tab = browsing
    narrow = tab.page.table.columnWidth(VERDICT)
    window.resize(1900, 760)
    qtbot.waitUntil(lambda: tab.page.table.columnWidth(VERDICT) > 1.3 * narrow)
    window.resize(1280, 760)
    qtbot.waitUntil(lambda: tab.page.table.columnWidth(VERDICT) == narrow)


def test_a_narrow_window_leaves_a_name_its_room(browsing: Opened, qtbot: QtBot) -> None:
    window, tab = browsing
    table = tab.page.table
    for width, hidden in ((1280, False), (960, True), (1280, False)):
        window.resize(width, 560)
        qtbot.waitUntil(lambda hidden=hidden: table.isColumnHidden(TAGS) is hidden)  # type: ignore[misc]
        assert table.columnWidth(NAME) >= 14 * tab.page.fontMetrics().averageCharWidth()
        assert not table.horizontalScrollBar().isVisible()


def test_no_verdict_is_cut_where_its_column_is_narrow() -> None:
    """Of every effect of the catalogue, with the letters that the table has at 1280 px: 27 fit a line."""
    titles = [effect_title(name) for name in CATALOGUE]
    assert max(map(len, titles)) > 40
    for title in titles:
        first, second = in_two_lines(f"{title}\n95 %", lambda words: len(words) <= 27).split("\n")
        assert max(len(first), len(second)) <= 27, title
        assert f"{first} {second}".replace(", 95 %", "").removesuffix(" 95 %") == title
    long = "Motor friction that differs by direction\n63 %, not ruled out: 2 more"
    assert in_two_lines(long, lambda words: len(words) <= 27) == (
        "Motor friction that differs\nby direction, 63 % …"
    )
    assert in_two_lines(long, lambda words: len(words) <= 50) == long


def test_columns_come_back_as_they_were_left(browsing: Opened, make_window, qtbot: QtBot) -> None:  # type: ignore[no-untyped-def]
    """Without the first window having been closed; and a wider window then leaves them alone."""
    _, tab = browsing
    header = tab.page.table.horizontalHeader()
    edge = header.sectionViewportPosition(RECORDED) + header.sectionSize(RECORDED) - 1
    place, wide = QPoint(edge, header.height() // 2), header.sectionSize(RECORDED)
    QTest.mousePress(header.viewport(), LEFT, pos=place)
    QTest.mouseMove(header.viewport(), place + QPoint(40, 0))
    QTest.mouseRelease(header.viewport(), LEFT, pos=place + QPoint(40, 0))
    assert header.sectionSize(RECORDED) == wide + 40
    title = QPoint(header.sectionViewportPosition(TAGS) + 20, header.height() // 2)
    QTest.mouseClick(header.viewport(), LEFT, pos=title)
    left = [header.sectionSize(column) for column in range(header.count()) if column != NAME]
    again = sessions_of(make_window(tab="sessions", diagnose=invented_diagnosis))
    later = again.page.table.horizontalHeader()
    assert [later.sectionSize(column) for column in range(later.count()) if column != NAME] == left
    assert (later.sortIndicatorSection(), later.sortIndicatorOrder()) == (TAGS, header.sortIndicatorOrder())
    again.page.window().resize(1900, 760)
    QApplication.processEvents()
    assert later.sectionSize(VERDICT) == left[VERDICT - 1]


def test_of_sessions_that_a_search_hides_nothing_is_said(browsing: Opened) -> None:
    window, tab = browsing
    tab.page.table.selectAll()
    assert tab.page.details.title.text() == "3 sessions chosen"
    assert entry(window, "Merge").isEnabled()
    QTest.keyClicks(child(window, QLineEdit, "search"), "phase:contact")
    assert tab.page.details.title.text() == ("Index finger" if tab.page.paths() else "No session chosen")
    assert not entry(window, "Merge").isEnabled()


def test_reading_a_large_folder_tells_how_far_it_is_and_can_be_stopped(
    browsing: Opened, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    window, tab = browsing
    later, stopped, now = threading.Event(), threading.Event(), [0.0]
    tab.clock = lambda: now[0]

    def slowly(_folder, known, coming, progress, cancelled):  # type: ignore[no-untyped-def]
        coming.extend(replace(known[0], path=Path(f"{k}.h5"), name=f"{k}.h5") for k in range(7))
        progress(0.4, "one.h5")
        later.wait(PATIENCE / 1000)
        progress(0.4, "one.h5")
        while not cancelled():
            stopped.wait(0.01)
        stopped.set()
        raise Cancelled

    monkeypatch.setattr(browse_tab, "look_through", slowly)
    again = child(window, QPushButton, "readAgain")
    QTest.mouseClick(again, LEFT)
    qtbot.waitUntil(lambda: tab.page.count.text() == "Reading, 40 %", timeout=PATIENCE)
    assert tab.page.model.rowCount() == 7  # they stand there before all are read
    now[0] = 12.0  # 40 % in 12 s
    later.set()
    left = "Reading, 40 %, about 18 s left"
    qtbot.waitUntil(lambda: tab.page.count.text() == left, timeout=PATIENCE)
    assert again.text() == "Stop readin&g"
    QTest.mouseClick(again, LEFT)
    assert stopped.wait(PATIENCE / 1000)
    assert tab.page.count.text() == "7 sessions"
    assert again.text() == "Read a&gain"


def test_a_double_click_opens_the_session_in_the_model_lab(browsing: Opened, qtbot: QtBot) -> None:
    window, tab = browsing
    choose(tab, "ring.h5")  # the first of the two clicks
    place = tab.page.table.visualRect(tab.page.model.index(row_of(tab, "ring.h5"), NAME)).center()
    QTest.mouseDClick(tab.page.table.viewport(), LEFT, Qt.KeyboardModifier.NoModifier, place)
    qtbot.waitUntil(lambda: window.current == "model_lab" and not window.tasks.busy, timeout=PATIENCE)
    assert [s.path.name for s in lab_of(window).controller.sessions] == ["ring.h5"]


def test_a_recorded_session_appears_and_a_dropped_folder_is_browsed(
    browsing: Opened,
    qtbot: QtBot,
    make_session: Callable[..., Path],
    folder: Path,
) -> None:
    window, tab = browsing
    window.context.recorded(make_session("library/new.h5"))
    qtbot.waitUntil(lambda: [p.name for p in tab.page.paths()] == ["new.h5"], timeout=PATIENCE)
    drop(window, folder / "may")
    qtbot.waitUntil(lambda: texts(tab, NAME) == ["index.h5\nIndex finger"], timeout=PATIENCE)


def entry(window: MainWindow, start: str) -> QAction:
    """An entry of the tab's menu by the beginning of its words."""
    found = [a for a in window.menus.tab_menu.actions() if a.text().replace("&", "").startswith(start)]
    assert len(found) == 1, start
    return found[0]


def test_merge_two_sessions_from_the_menu(
    browsing: Opened, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    window, tab = browsing
    choose(tab, "ring.h5")
    assert not entry(window, "Merge").isEnabled()
    place = tab.page.table.visualRect(tab.page.model.index(row_of(tab, "may/"), NAME)).center()
    QTest.mouseClick(tab.page.table.viewport(), LEFT, Qt.KeyboardModifier.ControlModifier, place)
    target = folder / "both"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    entry(window, "Merge").trigger()
    qtbot.waitUntil(lambda: [p.name for p in tab.page.paths()] == ["both.h5"], timeout=PATIENCE)
    assert len(open_session(folder / "both.h5").runs) == 5


def test_export_and_copy_with_tags_from_the_menu(
    browsing: Opened, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, folder: Path, tmp_path: Path
) -> None:
    window, tab = browsing
    choose(tab, "ring.h5")
    out = tmp_path / "out"
    out.mkdir()
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", staticmethod(lambda *_: str(out)))
    entry(window, "Export as CSV").trigger()
    qtbot.waitUntil(
        lambda: window.context.log[-1:] != [] and "Written" in window.context.log[-1], timeout=PATIENCE
    )
    assert sorted(p.name for p in out.iterdir()) == [
        "ring-001.csv", "ring-002.csv", "ring-003.csv", "ring.json",
    ]  # fmt: skip
    QTest.keyClicks(child(window, QLineEdit, "tags"), "good")  # not kept yet: it goes along all the same
    target = folder / "tagged.h5"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", staticmethod(lambda *_, **__: (str(target), "")))
    entry(window, "Copy with tags").trigger()
    qtbot.waitUntil(lambda: [p.name for p in tab.page.paths()] == ["tagged.h5"], timeout=PATIENCE)
    facts = tab.page.model.facts(target)
    assert facts is not None
    assert facts.tags == ("good",)


@pytest.mark.qt_log_ignore("This plugin does not support")  # dialogs, on a screen that is none
def test_the_browser_and_the_review_are_whole(browsing: Opened, qtbot: QtBot, tmp_path: Path) -> None:
    window, tab = browsing
    for name in ("broken.h5", "ring.h5"):
        choose(tab, name)
        look(window)
    click(window, "review")
    qtbot.waitUntil(lambda: tab.review_page.session is not None and not tab.data.busy, timeout=PATIENCE)
    tab.review_page.cursors.click()
    qtbot.waitUntil(lambda: bool(tab.review_page.values.text()), timeout=PATIENCE)
    look(window)
    save_each_plot(window, tmp_path / "plots", 1)
