"""A click on the headline: parts that sum to it, curves of each; what is left aside is shaded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QGuiApplication, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QTableWidget
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.error_parts import ExcludedByMotion, ExcludedInterval, ScorePart
from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.sessions.model import Session
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.widgets.theme import Appearance, apply_appearance

from .. import invented
from ..hands import LEFT, child, click, invented_diagnosis, lab_of, wait_for_result

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")

# 12.4 squared is 153.76: 1 for the floor, the rest shared out in thirds that no decimal holds.
# Of one part a run leaves less than its floor.
SHARES = {
    ("001", "mcp_torque"): 1 / 3 + 0.002, ("002", "mcp_torque"): 1 / 3, ("003", "cable_kinematics"): 1 / 3,
    ("002", "cable_kinematics"): -0.002,
}  # fmt: skip
RUNS = ("001", "002", "003")
LOOSE = (4.0, 6.0)  # s, of the cable in run 003


def with_parts(found: Diagnosis) -> Diagnosis:
    """The same, its score taken apart; in run 003 the cable hangs loose for a while."""
    parts = tuple(
        ScorePart((run,), "on_air", "extension", equation, 1 / 3, 0.0,
                  (found.score**2 - 1.0) * SHARES.get((run, equation), 0.0))
        for run in RUNS
        for equation in ("mcp_torque", "cable_kinematics")
    )  # fmt: skip
    aside = tuple(ExcludedByMotion((run,), "on_air", "extension", "", "ramp", 0.125, 1.5) for run in RUNS)
    slack = ExcludedByMotion(("003",), "on_air", "extension", "cable_kinematics", "slack", 1 / 6, 2.0)
    ramp, loose = ExcludedInterval("ramp", 0.0, invented.START_UP), ExcludedInterval("slack", *LOOSE)
    comparisons = tuple(
        replace(c, aside=(ramp, loose) if (c.run, c.equation) == ("003", "cable_kinematics") else (ramp,))
        for c in found.comparisons
    )
    return replace(found, score_parts=parts, excluded_by_motion=(*aside, slack), comparisons=comparisons)


@pytest.fixture
def taken_apart(qtbot: QtBot, make_window: Callable[..., MainWindow], session_file: Path) -> MainWindow:
    def diagnose(sessions: Sequence[Session], added: tuple[str, ...], *rest: object) -> Diagnosis:
        return with_parts(invented_diagnosis(sessions, added, *rest))  # type: ignore[arg-type]

    window = make_window(diagnose=diagnose)
    window.context.open_paths([session_file])
    wait_for_result(qtbot, window)
    return window


def number(text: str) -> float:
    """Of a cell; what is below zero has the minus sign of the typesetters."""
    return float(text.replace("\N{MINUS SIGN}", "-"))


def cells(table: QTableWidget) -> list[list[str]]:
    return [
        [table.item(row, column).text() for column in range(table.columnCount())]
        for row in range(table.rowCount())
    ]


def test_the_parts_sum_to_the_headline_and_lead_to_their_curves(taken_apart: MainWindow) -> None:
    click(taken_apart, "headline")
    table = child(taken_apart, QTableWidget, "scoreTable")
    assert table.isVisible()
    told = cells(table)
    # Runs, samples, MCP torque, cable length, together, left aside.
    parts = [[number(cell) for cell in row[2:4]] for row in told[:3]]
    assert parts[1][1] == pytest.approx(-0.002 * (12.4**2 - 1.0), abs=0.1)
    assert [row[1] for row in told[:3]] == ["33 %"] * 3
    np.testing.assert_allclose([float(row[4]) for row in told[:3]], np.sum(parts, axis=1), atol=1e-9)
    np.testing.assert_allclose([float(cell) for cell in told[3][2:4]], np.sum(parts, axis=0), atol=1e-9)
    assert np.sum(parts) + float(told[4][4]) == pytest.approx(float(told[5][4]), abs=1e-9)
    assert float(told[5][4]) == pytest.approx(12.4**2, abs=0.05)
    assert told[2][5] == "start and edges 12 %, cable slack 17 %"
    where = table.visualItemRect(table.item(2, 3)).center()
    QTest.mouseClick(table.viewport(), LEFT, pos=where)
    shown = lab_of(taken_apart).view.bar.comparison()
    assert shown is not None
    assert (shown.equation, shown.run) == ("cable_kinematics", "003")
    QTest.keyClick(table, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    lines = QGuiApplication.clipboard().text().splitlines()
    assert lines[0].split("\t") == ["Runs", "Samples", "MCP torque", "Cable length", "Together", "Left aside"]
    assert [line.split("\t") for line in lines[1:]] == told


def darker(image: QImage, x: int, y: int) -> float:
    """Mean lightness of a patch of 12 x 12 px, 0 to 255."""
    patch = [image.pixelColor(x + i, y + j).lightness() for i in range(12) for j in range(12)]
    return float(np.mean(patch))


def test_what_is_left_aside_is_shaded_and_told_with_its_share(taken_apart: MainWindow) -> None:
    view = lab_of(taken_apart).view
    view.bar.go_to("cable_kinematics", "003")
    key = view.legend.aside
    assert key.isVisible()
    # Of 12 s the first 1.5 and two more.
    assert key.toolTip() == "Left aside of this run: start and edges 13 %, cable slack 17 %."
    image = view.plot.grab().toImage()
    box = view.plot.top.getViewBox()
    low = box.viewRange()[1][0]

    def at(time: float) -> float:
        place = view.plot.mapFromScene(box.mapViewToScene(box.viewRect().center().__class__(time, low)))
        corner = place + QPoint(-6, -14)
        ratio = image.devicePixelRatio()
        return darker(image, round(corner.x() * ratio), round(corner.y() * ratio))

    hatched = [at(0.75), at(4.75)]  # the swing is at its top there, the patch is free of it
    judged = [at(2.25), at(8.25)]
    assert max(hatched) < min(judged) - 3
    view.bar.go_to("mcp_torque", "001")
    assert key.toolTip() == "Left aside of this run: start and edges 13 %."


@pytest.fixture(params=["light", "dark"])
def themed(request: pytest.FixtureRequest, qapp: QApplication) -> Iterator[Appearance]:
    apply_appearance(qapp, request.param)
    yield request.param
    apply_appearance(qapp, "light")


@pytest.mark.usefixtures("themed")
def test_what_is_weighed_less_is_not_taken_for_left_aside(
    qtbot: QtBot,
    make_window: Callable[..., MainWindow],
    session_file: Path,
) -> None:
    def diagnose(sessions: Sequence[Session], added: tuple[str, ...], *rest: object) -> Diagnosis:
        found = invented_diagnosis(sessions, added, *rest)  # type: ignore[arg-type]
        still, ramp = ExcludedInterval("standstill", 4.0, 10.0), ExcludedInterval("ramp", 0.0, 1.5)
        return replace(found, comparisons=tuple(replace(c, aside=(ramp, still)) for c in found.comparisons))

    window = make_window(diagnose=diagnose)
    window.context.open_paths([session_file])
    wait_for_result(qtbot, window)
    view = lab_of(window).view
    assert view.legend.aside.toolTip() == "Left aside of this run: start and edges 13 %."
    assert view.legend.weighed.isVisible()
    assert view.legend.weighed.toolTip() == "Weighed less in this run: standstill 50 %."
    assert [tints.stretches for tints in (view.plot.aside[0], view.plot.weighed[0])] == [
        ((0.0, 1.5),),
        ((4.0, 10.0),),
    ]
    image = view.plot.grab().toImage()
    box = view.plot.bottom.getViewBox()
    (left, right), (_, high) = box.viewRange()

    def patch(time: float) -> float:
        corner = view.plot.mapFromScene(box.mapViewToScene(QPointF(time, high))) + QPoint(-6, 4)
        places = [corner + QPoint(i, j) for i in range(12) for j in range(12)]
        return float(np.median([image.pixelColor(place).lightness() for place in places]))  # not of the curve

    assert left <= 4.0 < 11.0 <= right
    assert [tints.hatched for tints in (view.plot.aside[0], view.plot.weighed[0])] == [True, False]
    assert abs(patch(8.3) - patch(11.0)) >= 8
    apply_appearance(QApplication.instance(), "light")  # type: ignore[arg-type]
