"""STOP with everything open that can stand open: by press, by Escape, by the foot switch's key."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from PySide6.QtWidgets import QComboBox
from pytestqt.qtbot import QtBot

from fingerlab.ui.acquire import acquire_tab
from fingerlab.ui.app.context import Settings
from fingerlab.ui.app.tab_registry import TABS

from ..bench_hands import PATIENCE, Rig, opener, tabs_with
from ..conftest import WindowMaker
from ..dialogs_open import DIALOGS
from ..everything_open import surfaces
from ..hands import click, invented_diagnosis, lab_with, wait_for_result
from ..standing_open import WAYS, Stage, places_in_source
from ..stop_hands import Driving, hand_here

LIMIT_MS = 50.0
OUTCOMES = "FINGERLAB_STOPS"
"""Names the file into which ``tests.faults.stops`` has outcomes written; the bench then runs in real time."""
KNOWN = "FINGERLAB_STOPS_KNOWN"
"""Names, as JSON, what has been taken already."""


@pytest.fixture
def stage(
    monkeypatch: pytest.MonkeyPatch,
    make_window: WindowMaker,
    settings: Settings,
    session_file: Path,
    qtbot: QtBot,
    tmp_path: Path,
) -> Stage:
    """A window with a rig and a session that was compared: what all that can be opened needs."""
    monkeypatch.setattr(acquire_tab, "ask_to_close", lambda *_: True)
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "own-settings"))
    settings.set_recordings(tmp_path / "recordings")
    real_time = OUTCOMES in os.environ
    rigs = {entry.key: entry for entry in (TABS if real_time else tabs_with(opener(tmp_path / "rescue")))}
    labs = {entry.key: entry for entry in lab_with(invented_diagnosis)}
    tabs = tuple(
        replace(entry, make=(labs if key == "model_lab" else rigs)[key].make) for key, entry in rigs.items()
    )
    window = make_window(tab="acquire", tabs=tabs)
    rig = Rig(window, qtbot, connect=not real_time)
    if real_time:
        click(window, "connectSimulated")
        qtbot.waitUntil(lambda: rig.controller.bench is not None, timeout=PATIENCE)
    window.open_paths([session_file])
    wait_for_result(qtbot, window)
    return Stage(window, session_file, tmp_path)


def test_every_dialog_of_the_source_is_opened_here() -> None:
    assert places_in_source() == {place for surface in DIALOGS for place in surface.places}


@pytest.mark.qt_log_ignore("This plugin does not support", "does not support grabbing")
@pytest.mark.parametrize("way", WAYS)
def test_stop_with_anything_open(stage: Stage, way: str) -> None:
    known = json.loads(os.environ.get(KNOWN, "[]"))
    found = [one for one in surfaces(stage) if way in one.ways and one.name not in known]
    if OUTCOMES not in os.environ and way != "press":  # keys reach lists and menus as they reach dialogs
        mine = DIALOGS[::2] if way == "key" else DIALOGS[1::2]  # all three ways: tests.faults.stops
        found = [*mine, *[surface for surface in found if surface not in DIALOGS][::8]]
    driving = Driving(stage, hand_here())
    outcomes = driving.stop_each(found, (way,))
    if OUTCOMES in os.environ:
        with Path(os.environ[OUTCOMES]).open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(asdict(outcome)) + "\n" for outcome in outcomes)
    assert len(outcomes) == len(found)
    wrong = [o for o in outcomes if o.plant_ms is None or not 0.0 < o.plant_ms <= LIMIT_MS or o.wrong]
    assert not wrong, "\n".join(map(str, wrong))


def test_every_list_of_the_window_is_among_them(stage: Stage) -> None:
    found = [surface for surface in surfaces(stage) if surface.name.startswith("List ")]
    here = [field for field in stage.window.findChildren(QComboBox) if field.window() is stage.window]
    assert len(found) == len(here) > 20
