"""All of a folder diagnosed by a click: verdicts as they come, a stop, and the trend with its change."""

from __future__ import annotations

import threading
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtCore import QPointF, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton, QStyleOptionViewItem, QTableWidget
from pytestqt.qtbot import QtBot

from fingerlab.batch.run import run_batch
from fingerlab.batch.table import SOFTWARE, Contents, Options, read_table, write_table
from fingerlab.core.errors import Cancelled
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.session import write_session
from fingerlab.ui.sessions.session_table import VERDICT
from fingerlab.ui.sessions.sessions_tab import SessionsTab
from fingerlab.ui.sessions.trend_dialog import TrendDialog
from fingerlab.ui.widgets.tables import LINE_BREAK

from ..hands import LEFT, child, click

PATIENCE = 120_000
pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


def browsing(qtbot: QtBot, make_window, folder: Path, count: int) -> SessionsTab:  # type: ignore[no-untyped-def]
    window = make_window(tab="sessions")
    tab = window.tab("sessions")
    assert isinstance(tab, SessionsTab)
    tab.browse(folder)
    qtbot.waitUntil(lambda: tab.page.model.total == count, timeout=PATIENCE)
    return tab


def verdicts(tab: SessionsTab) -> dict[str, str]:
    model = tab.page.model
    return {model.path(row).name: model.index(row, VERDICT).data() for row in range(model.rowCount())}


def test_all_of_a_folder_is_diagnosed_in_another_process(qtbot: QtBot, make_window, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    wave = {"kind": "sine", "amplitude_deg": 15.0, "offset_deg": 22.0, "duration_s": 10.0}
    plans = [RunPlan("on_air", "extension", {**wave, "frequency_hz": f}) for f in (1.0, 1.0, 0.5)]
    write_session(tmp_path / "good.h5", load_preset("practice"), "short", plans, {}, seed=3)
    (tmp_path / "broken.h5").write_text("no session", encoding="utf-8")
    tab = browsing(qtbot, make_window, tmp_path, 2)
    click(tab.widget, "diagnoseAll")
    assert child(tab.widget, QPushButton, "diagnoseAll").text() == "Stop &diagnosing"
    qtbot.waitUntil(lambda: not tab.batch.busy, timeout=PATIENCE)
    qtbot.waitUntil(lambda: "%" in verdicts(tab)["good.h5"], timeout=PATIENCE)
    assert verdicts(tab)["broken.h5"] == ""
    table = read_table(tmp_path / "verdicts.parquet")
    assert table is not None
    assert {row["session"]: bool(row["error"]) for row in table.rows} == {"good.h5": False, "broken.h5": True}
    assert "1 sessions diagnosed" not in tab.context.log[-1]
    assert any("2 sessions diagnosed" in line and "1 could not be" in line for line in tab.context.log)
    assert child(tab.widget, QPushButton, "diagnoseAll").text() == "&Diagnose all"


def test_verdicts_come_one_by_one_and_a_stop_keeps_them(
    qtbot: QtBot, make_window, make_session, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    """A batch whose second session never ends, but for the stop."""
    for name in ("a.h5", "b.h5"):
        make_session(name, phases=(("on_air", "extension"),))
    tab = browsing(qtbot, make_window, tmp_path, 2)
    heard = threading.Event()

    def call(folder, found, processes, progress, cancelled):  # type: ignore[no-untyped-def]
        def runner(tasks, options):  # type: ignore[no-untyped-def]
            yield quick(tasks[0].name, options)
            while not cancelled():
                heard.wait(0.01)
            heard.set()
            raise Cancelled

        table = folder / "verdicts.parquet"
        return run_batch(folder, table, Options(), runner, False, progress, cancelled, found), table

    tab.batch.call = call
    click(tab.widget, "diagnoseAll")
    qtbot.waitUntil(lambda: verdicts(tab)["a.h5"] == "Coulomb joint friction\n93 %", timeout=PATIENCE)
    assert verdicts(tab)["b.h5"] == ""
    assert "1 of 2" in tab.page.count.text()
    long = replace(tab.page.model.verdict(tmp_path / "a.h5"), effects=("asymmetric_friction",))
    tab.page.model.show_verdict(tmp_path / "a.h5", long)
    table = tab.page.table
    index = table.model().index(tab.page.model.row(tmp_path / "a.h5"), VERDICT)
    option = QStyleOptionViewItem()
    option.rect, option.widget, option.fontMetrics = table.visualRect(index), table, table.fontMetrics()
    table.itemDelegateForColumn(VERDICT).initStyleOption(option, index)
    lines = option.text.split(LINE_BREAK)  # as Qt's item views break a line
    assert " ".join(lines) == "Motor friction that differs by direction, 93 %"
    assert max(map(option.fontMetrics.horizontalAdvance, lines)) < option.rect.width()
    tab.page.model.show_verdict(tmp_path / "a.h5", replace(long, effects=("coulomb_friction",)))
    click(tab.widget, "diagnoseAll")
    qtbot.waitUntil(lambda: not tab.batch.busy, timeout=PATIENCE)
    assert heard.is_set()
    assert any("stopped; what is done is kept" in line for line in tab.context.log)
    assert not (tmp_path / "verdicts.parquet").exists()
    tab.read_again()  # what was kept beside the table is seen by the next reading, too
    qtbot.waitUntil(lambda: not tab._scanner.busy, timeout=PATIENCE)
    assert verdicts(tab)["a.h5"] == "Coulomb joint friction\n93 %"


def quick(name: str, options: Options):  # type: ignore[no-untyped-def]
    from fingerlab.batch.table import SessionRow

    row = {
        "session": name, "sha256": name, "software": SOFTWARE, "options": options.key, "error": None,
        "verdict": "missing_effect", "set": ["coulomb_friction"], "probability": 0.93, "seconds": 0.1,
        "score": 5.0, "final_score": 1.1, "final_model": ["coulomb_friction"], "created": "2026-05-01",
    }  # fmt: skip
    return SessionRow(row, {})


def day(number: int) -> dict[str, Any]:
    """Friction of 2 mN m from the fifth day on, and a delay that drifts."""
    friction, noise = 2e-3 * (number >= 5), np.random.default_rng(number).standard_normal(2)
    when = datetime(2026, 5, 1 + number, 10, tzinfo=UTC).isoformat()
    strength = friction + 1e-5 * float(noise[0])
    return {
        "session": f"day-{number}.h5", "sha256": f"{number}", "created": when, "score": 1.0,
        "final_score": 1.0, "final_model": ["coulomb_friction"] if number >= 5 else [],
        "alone.coulomb_friction.coulomb_mcp": strength,
        "alone.coulomb_friction.coulomb_mcp.low": strength - 2e-4,
        "alone.coulomb_friction.coulomb_mcp.high": strength + 2e-4,
        "alone.transport_delay.delay": 1e-4 * number + 1e-5 * float(noise[1]),
    }  # fmt: skip


def trend_of_ten_days(qtbot: QtBot, make_window, make_session, folder: Path):  # type: ignore[no-untyped-def]
    """The Sessions tab on a folder with the verdicts of ten days, one session of them; the trend is open."""
    make_session("day-5.h5", phases=(("on_air", "extension"),))
    units = {"alone.coulomb_friction.coulomb_mcp": "N m", "alone.transport_delay.delay": "s"}
    rows = tuple(day(number) for number in range(10))
    write_table(folder / "verdicts.parquet", Contents(str(folder.resolve()), (), rows, units))
    tab = browsing(qtbot, make_window, folder, 1)
    click(tab.widget, "showTrend")
    return tab


def test_the_trend_names_the_day_on_which_an_effect_came(
    qtbot: QtBot, make_window, make_session, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    tab = trend_of_ten_days(qtbot, make_window, make_session, tmp_path)
    said = child(tab.widget, QLabel, "trendWords").text()
    assert said.startswith("Between day-4.h5 and day-5.h5 (2026-05-06) a new effect appeared, Coulomb joint")
    assert "missing in 0 of 5 sessions before and in 5 of 5 after" in said
    assert "\n" not in said
    table = child(tab.widget, QTableWidget, "trendTable")
    cells = {table.item(r, 0).text(): [table.item(r, c).text() for c in range(7)] for r in range(4)}
    assert cells["MCP friction, Coulomb"][6] == "new effect > 99 %"
    assert (
        cells["Delay"][6] == "wear > 99 %, with another"
    )  # it drifts, by 0.1 ms a day: 3.04 ms a month of 30.44 days
    assert float(cells["Delay"][3]) == pytest.approx(3.04, abs=0.1)
    dialog = tab.widget.findChild(TrendDialog)
    assert dialog is not None
    assert dialog.plot.trend is not None
    assert dialog.plot.trend.column == "alone.coulomb_friction.coulomb_mcp"
    days, value = (getattr(dialog.plot.shown_series()[0], axis) for axis in "xy")
    assert days.tolist() == list(range(10))
    assert value[7] == pytest.approx(2.0, abs=0.05)
    # a click on a point marks its session in the table behind
    box = dialog.plot.getPlotItem().getViewBox()
    place = dialog.plot.mapFromScene(box.mapViewToScene(QPointF(5.0, float(value[5]))))
    QTest.mouseClick(dialog.plot.viewport(), LEFT, pos=place)
    assert [path.name for path in tab.page.paths()] == ["day-5.h5"]
    row = next(r for r in range(4) if table.item(r, 0).text() == "Delay")
    QTest.mouseClick(table.viewport(), LEFT, pos=table.visualItemRect(table.item(row, 0)).center())
    assert dialog.plot.trend.column == "alone.transport_delay.delay"
    QTest.keyClick(dialog, Qt.Key.Key_Escape)


def test_the_course_of_the_chosen_number_is_marked_and_said_below_the_plot(
    qtbot: QtBot, make_window, make_session, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    tab = trend_of_ten_days(qtbot, make_window, make_session, tmp_path)
    dialog = tab.widget.findChild(TrendDialog)
    said = child(tab.widget, QLabel, "courseWords")
    assert "came up from nothing to 2.0" in said.text()
    items = dialog.plot.getPlotItem().items
    (gap,) = [item for item in items if isinstance(item, pg.LinearRegionItem)]
    assert gap.getRegion() == (4.0, 5.0)  # between the fourth and the fifth day
    bands = [item for item in items if isinstance(item, pg.FillBetweenItem)]
    after = bands[1].curves[0].getData()[1]
    assert after == pytest.approx(2.0, abs=0.3)  # mN m
    table = child(tab.widget, QTableWidget, "trendTable")
    row = next(r for r in range(4) if table.item(r, 0).text() == "Delay")
    QTest.mouseClick(table.viewport(), LEFT, pos=table.visualItemRect(table.item(row, 0)).center())
    assert said.text().startswith("Delay grows steadily, from ")
    assert not [i for i in dialog.plot.getPlotItem().items if isinstance(i, pg.LinearRegionItem)]
    QTest.keyClick(dialog, Qt.Key.Key_Escape)


def test_two_benches_side_by_side(qtbot: QtBot, make_window, make_session, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    """Ten days of a bench in one folder, of which the last five have friction; the same again in another."""
    make_session("day-5.h5", phases=(("on_air", "extension"),))
    rows = []
    for bench in ("left", "right"):
        for number in range(5, 9) if bench == "left" else range(4):
            one = day(number)
            strength = "alone.coulomb_friction.coulomb_mcp"
            ends = {end: one[strength] + by for end, by in (("", 0.0), (".low", -2e-4), (".high", 2e-4))}
            one |= {f"{strength}{end}": value for end, value in ends.items()}
            if bench == "left":
                one |= {f"param.coulomb_friction.coulomb_mcp{end}": value for end, value in ends.items()}
            rows.append(one | {"session": f"{bench}/{one['session']}", "sha256": f"{bench}{number}"})
    units = {"param.coulomb_friction.coulomb_mcp": "N m"}
    write_table(tmp_path / "verdicts.parquet", Contents(str(tmp_path.resolve()), (), tuple(rows), units))
    tab = browsing(qtbot, make_window, tmp_path, 1)
    click(tab.widget, "showTrend")
    dialog = tab.widget.findChild(TrendDialog)
    bar = dialog.pages.tabBar()
    QTest.mouseClick(bar, LEFT, pos=bar.tabRect(1).center())
    assert dialog.benches.isVisible()
    assert (dialog.benches.first.currentText(), dialog.benches.second.currentText()) == ("left", "right")
    said = child(tab.widget, QLabel, "sharedWords")
    assert said.text().startswith("Coulomb joint friction is on left only: ")
    table = child(tab.widget, QTableWidget, "sharedTable")
    assert table.item(0, 1).text() == "first only"
    line = dialog.benches.second.lineEdit()
    line.selectAll()
    QTest.keyClicks(line, "middle")
    click(dialog, "compareBenches")
    assert said.text().startswith("No session with a verdict and a time is in 'middle'")
    assert not table.isVisible()
    line.selectAll()
    QTest.keyClicks(line, "right")
    QTest.keyClick(line, Qt.Key.Key_Return)
    assert table.isVisible()
    assert dialog.isVisible()  # Return compared, and closed nothing
    QTest.keyClick(dialog, Qt.Key.Key_Escape)


def test_a_folder_without_verdicts_says_what_makes_them(
    qtbot: QtBot, make_window, make_session, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    path = make_session("a.h5", phases=(("on_air", "extension"),))
    with h5py.File(path, "r+") as file:
        file.attrs["created"] = "2026-05-01T10:00:00+02:00"
    tab = browsing(qtbot, make_window, tmp_path, 1)
    click(tab.widget, "showTrend")
    assert "Diagnose all makes them" in child(tab.widget, QLabel, "trendWords").text()
    dialog = tab.widget.findChild(TrendDialog)
    assert not dialog.plot.isVisible()
    assert not dialog.table.isVisible()
    words = dialog.words
    assert words.mapTo(dialog, words.rect().bottomLeft()).y() < 0.2 * dialog.height()  # at the top
