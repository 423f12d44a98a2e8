"""What the commands compare and replicate do, from the window: tables by clicks in the menus."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtWidgets import QLabel, QPushButton, QTableWidget
from pytestqt.qtbot import QtBot

from fingerlab.models.file import save_model
from fingerlab.prediction import fit_extended, model_of_extended
from fingerlab.report import comparison_words
from fingerlab.sessions import open_session
from fingerlab.thesis.analysis import PUBLISHED, PublishedQuantity
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.session import write_session
from fingerlab.ui.fit.fit_view import ReplicateDialog
from fingerlab.ui.predict.force_panel import ModelsDialog
from fingerlab.ui.predict.predict_tab import PredictTab

from ..hands import child, chosen_in_menu, click

PATIENCE = 120_000
pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")


def cells(table: QTableWidget) -> list[list[str]]:
    columns = range(table.columnCount())
    return [[table.item(row, column).text() for column in columns] for row in range(table.rowCount())]


def test_saved_models_are_compared_on_runs_left_out(qtbot: QtBot, make_window, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    preset = load_preset("practice")
    press = preset.numbers["protocol"]["contact_amplitude_deg"]
    wave = {"kind": "sine", "amplitude_deg": 9.0, "offset_deg": 15.0, "frequency_hz": 1.0, "duration_s": 10.0}
    plans = [RunPlan("on_air", "flexion", wave), RunPlan("on_air", "flexion", {**wave, "frequency_hz": 0.5})]
    pressed = {"kind": "sine", "amplitude_deg": press, "frequency_hz": 1.0, "duration_s": 10.0}
    plans += [RunPlan("contact", "flexion", pressed)] * 2
    path = tmp_path / "friction.h5"
    write_session(path, preset, "short", plans, parse_effects(["coulomb_friction"]), seed=3)
    model = model_of_extended(fit_extended([open_session(path)], ["coulomb_friction"]))
    save_model(model, tmp_path / "friction.json")
    window = make_window(tab="predict")
    tab = window.tab("predict")
    assert isinstance(tab, PredictTab)
    window.context.open_paths([path], tab="predict")
    qtbot.waitUntil(lambda: bool(tab.sessions) and not window.tasks.busy, timeout=PATIENCE)
    compare = chosen_in_menu(window, "Compare on runs left out…")
    assert not compare.isEnabled()
    tab.add_files([tmp_path / "friction.json"])
    qtbot.waitUntil(lambda: tab.found is not None and not window.tasks.busy, timeout=PATIENCE)
    window.context.commands_changed.emit()
    assert compare.isEnabled()
    compare.trigger()
    qtbot.waitUntil(lambda: any(d.isVisible() for d in window.findChildren(ModelsDialog)), timeout=PATIENCE)
    nominal, friction = cells(child(window, QTableWidget, "comparedTable"))
    assert nominal[:2] == ["nominal model", "–"]
    assert friction[:2] == ["friction.json", "Coulomb joint friction"]
    # The rig has the friction, so that the model with it leaves less, in the error and in the force.
    assert float(friction[2]) < 0.7 * float(nominal[2])
    assert float(friction[3]) < float(nominal[3])
    assert child(window, QLabel, "comparedWords").text().startswith("friction.h5: friction.json leaves least")


def test_the_thesis_experiment_is_repeated_from_the_menu(
    qtbot: QtBot, make_window, monkeypatch: pytest.MonkeyPatch
) -> None:  # type: ignore[no-untyped-def]
    """Numbers that are given: 0.962 lies within the thesis' 0.97 ± 0.01, 186 ms outside of 162 ± 23."""
    asked = []

    def quick(preset: str, seeds: list[int], watch: object) -> tuple[comparison_words.ComparedQuantity, ...]:
        asked.append((preset, list(seeds)))
        return comparison_words.compare(
            [[quantity("r2_normalised", 0.962), quantity("delay_finddelay", 186.0)]]
        )

    monkeypatch.setattr(comparison_words, "replicated", quick)
    window = make_window(tab="fit")
    chosen_in_menu(window, "The thesis' experiment again…").trigger()
    dialog = window.findChild(ReplicateDialog)
    dialog.seed.setValue(5)
    dialog.benches.setValue(2)
    click(window, "replicateRun")
    table = child(window, QTableWidget, "replicateTable")
    qtbot.waitUntil(lambda: table.rowCount() == len(PUBLISHED), timeout=PATIENCE)
    assert asked == [("as-built", [5, 6])]
    rows = {row[0]: row[1:] for row in cells(table)}
    titles = {one.key: one.title.replace("R2", "R²") for one in PUBLISHED}
    assert rows[titles["r2_normalised"]][:3] == ["0.970 ± 0.010", "0.962", ""]
    assert rows[titles["delay_finddelay"]] == ["162.2 ± 23.2", "186.0", "*", "ms"]
    said = child(window, QLabel, "replicateWords").text()
    assert "within the published spread; outside, marked *:" in said
    assert child(window, QPushButton, "replicateRun").text() == "&Run"


def quantity(key: str, value: float) -> PublishedQuantity:
    one = next(p for p in PUBLISHED if p.key == key)
    return PublishedQuantity(key, key, one.unit, value, 0.0, (value,), one.value, one.deviation)
