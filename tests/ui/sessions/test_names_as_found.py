"""What a diagnosis calls an effect, the batch and the list of sessions call it, too."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt

from fingerlab.library.index import read_facts
from fingerlab.library.notes import find_verdicts
from fingerlab.ui.sessions.session_table import VERDICT, SessionTable
from tests.cli.calling import run_main

RATE = 250.0
WEIGHT = 5.0
"""N m, with the sine of the angle."""


@pytest.mark.parametrize("kept", [True, False])
def test_the_weight_of_a_link_is_no_ripple(tmp_path: Path, capsys: Any, qapp: Any, kept: bool) -> None:
    """Its id is that of a ripple; a table of an earlier program holds nothing but that."""
    time, random, files = np.arange(int(16 * RATE)) / RATE, np.random.default_rng(4), []
    for run in range(3):
        angle = 0.3 + sum(
            size * np.sin(2 * np.pi * rate * time + phase * (run + 1))
            for rate, size, phase in ((0.21, 0.55, 0.0), (0.5, 0.35, 1.1), (0.83, 0.12, 2.3))
        )
        inertia = 0.3 * np.gradient(np.gradient(angle)) * RATE**2
        torque = inertia + WEIGHT * np.sin(angle) + 0.01 * random.standard_normal(len(time))
        files.append(tmp_path / f"{run}.csv")
        table = np.stack((time, angle, torque), axis=1)
        np.savetxt(files[-1], table, "%.7f", ",", header="time (s),position (rad),torque (N m)", comments="")
    session, table = tmp_path / "axis.h5", tmp_path / "t.parquet"
    assert run_main(["import", "--axis", *files, "--out", session], capsys)[0] == 0
    code, out, err = run_main(["batch", tmp_path, "--out", table, "--jobs", "1"], capsys)
    assert code == 0, err
    assert "Weight of a link out of balance" in " ".join(out.split())
    assert "ripple" not in out.lower()
    if not kept:
        _without_titles(table)
    model, facts = SessionTable(), read_facts(session, "axis.h5")
    model.show_all([facts], {}, find_verdicts(tmp_path, [facts]))
    cell = model.index(0, VERDICT)
    said = f"{model.data(cell)} {model.data(cell, Qt.ItemDataRole.ToolTipRole)}"
    assert ("Weight of a link out of balance" in said) is kept
    assert ("Torque ripple" in said) is not kept


def _without_titles(table: Path) -> None:
    import pyarrow.parquet as pq

    whole = pq.read_table(table)
    pq.write_table(whole.drop_columns(["set_titles"]), table)
