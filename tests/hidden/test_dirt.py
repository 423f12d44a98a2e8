"""Spoiled recordings: what the committed table promises, and that spoiling is what it says."""

from __future__ import annotations

import numpy as np

from tests.hidden import dirt


def test_the_table_keeps_what_it_promises() -> None:
    """Nine in ten spoiled recordings have the answer of the clean one."""
    lines = [line.split("|")[1:-1] for line in dirt.PAGE.read_text(encoding="utf-8").splitlines()]
    rows = [[cell.strip() for cell in line] for line in lines if len(line) == 7][2:]
    clean = {row[0]: row[2] for row in rows if row[1] == "clean"}
    spoiled = [row for row in rows if row[1] != "clean"]
    assert {row[1] for row in spoiled} == set(dirt.WAYS) - {"clean"}
    same = [row[2] == clean[row[0]] for row in spoiled]
    assert np.mean(same) >= 0.9
