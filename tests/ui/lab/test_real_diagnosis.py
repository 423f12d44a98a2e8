"""From a recording to the missing effect, in the window and with the instrument's own diagnosis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.results import Diagnosis
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import load_preset
from fingerlab.twin.session import write_session
from fingerlab.ui.lab.validation import HeldOutTable
from tests.diagnosis.test_no_alarm import shortened

from ..hands import child, click, drop, lab_of

PATIENCE = 120_000


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Short runs of the simulated rig with joint friction; the twin shares no formula with the diagnosis."""
    path = tmp_path_factory.mktemp("twin") / "friction.h5"
    preset = load_preset()
    write_session(path, preset, "rich", shortened(), parse_effects(("coulomb_friction",)), seed=3)
    return path


def work_through(qtbot: QtBot, window, path: Path, effect: str) -> None:  # type: ignore[no-untyped-def]
    """Open, look, add, undo: what a person does."""
    drop(window, path)
    qtbot.waitUntil(lambda: lab_of(window).controller.history is not None, timeout=PATIENCE)
    lab = lab_of(window).view
    assert lab.candidates.chosen_row().key == effect
    time, measured = lab.plot.measured.series
    _, modelled = lab.plot.modelled.series
    both = np.isfinite(measured) & np.isfinite(modelled)
    assert both.sum() > 0.5 * len(time)
    assert lab.evidence.plot.fingerprint is not None
    assert child(window, QLabel, "explanation").text()
    assert "mN m" in lab.evidence.title.toolTip()
    before = lab.controller.history.now.diagnosis
    for candidate in before.candidates:
        lab.candidates.choose(candidate.effect)
        assert lab.evidence.plot.fingerprint is candidate.fingerprint is not None
        assert lab.evidence.plot.points.isVisible()
    lab.candidates.choose(effect)
    looks = []
    lab.controller.first_look_changed.connect(lambda: looks.append(lab.path.path.bars[-1]))
    click(window, "addToModel")
    qtbot.waitUntil(lambda: len(looks) > 0, timeout=PATIENCE)
    first, said = lab.path.path.bars[-1].score, lab.path.path.accessibleDescription()
    assert f"friction {first:.2f} (still being worked out)" in said
    assert "(still being worked out)" in lab.path.table.accessibleDescription()
    qtbot.waitUntil(lambda: lab.controller.history.can_undo, timeout=PATIENCE)
    after = lab.controller.history.now.diagnosis
    assert [bar.under_way for bar in looks] == [True, True, False]  # on the grid, between its points, over
    assert looks[1].score == pytest.approx(after.score, rel=0.1)
    assert "worked out" not in lab.path.path.text() + lab.path.table.accessibleDescription()
    assert after.score < 0.6 * before.score
    assert after.errors["joint_torque"].rmse < before.errors["joint_torque"].rmse
    assert [bar.score for bar in lab.path.path.bars[:2]] == [before.score, after.score]
    told_by_motion(child(window, HeldOutTable, "heldOutRuns"), before, after)
    click(window, "undo")
    assert lab.controller.diagnosis is before


def told_by_motion(table: HeldOutTable, before: Diagnosis, after: Diagnosis) -> None:
    """A row for each motion that was recorded, where the error has fallen in every one."""
    runs = sum(len(one.runs) for one in after.held_out)
    assert runs == len({(c.session, c.run) for c in after.comparisons})
    assert table.rowCount() == len(after.held_out) > 5
    for row, (first, now) in enumerate(zip(before.held_out, after.held_out, strict=True)):
        what, nominal, error = (table.item(row, column).text() for column in range(3))
        assert now.runs[0] in what
        assert f"{'contact' if now.phase == 'contact' else 'on air'}, {now.cable}, " in what
        assert float(nominal) == pytest.approx(first.score, rel=0.02)
        assert float(error) == pytest.approx(now.score, rel=0.02)
        assert now.score < first.score


def test_simulated_friction_is_found_and_added(qtbot: QtBot, make_window, simulated: Path) -> None:  # type: ignore[no-untyped-def]
    work_through(qtbot, make_window(), simulated, "coulomb_friction")


def test_cancelling_the_real_diagnosis_stops_it(qtbot: QtBot, make_window, simulated: Path) -> None:  # type: ignore[no-untyped-def]
    window = make_window()
    drop(window, simulated)
    progress = window.task_bar.progress
    qtbot.waitUntil(lambda: lab_of(window).waiting.isVisible() and progress.value() > 0, timeout=PATIENCE)
    click(window, "cancel")
    qtbot.waitUntil(lambda: not window.tasks.busy, timeout=PATIENCE)
    assert lab_of(window).controller.history is None
    assert child(window, QLabel, "status").text().endswith("stopped")
