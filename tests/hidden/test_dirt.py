"""Spoiled recordings: what the committed table promises, and that spoiling is what it says."""

from __future__ import annotations

import numpy as np
import pytest

from tests.hidden import dirt
from tests.hidden.axis.plant import Axis, session


def test_the_table_keeps_what_it_promises() -> None:
    """Nine in ten spoiled recordings have the answer of the clean one."""
    lines = [line.split("|")[1:-1] for line in dirt.PAGE.read_text(encoding="utf-8").splitlines()]
    rows = [[cell.strip() for cell in line] for line in lines if len(line) == 7][2:]
    clean = {row[0]: row[2] for row in rows if row[1] == "clean"}
    spoiled = [row for row in rows if row[1] != "clean"]
    assert {row[1] for row in spoiled} == set(dirt.WAYS) - {"clean"}
    same = [row[2] == clean[row[0]] for row in spoiled]
    assert np.mean(same) >= 0.9


@pytest.mark.parametrize(
    ("way", "factor", "every"), [("clean", 1.0, 1), ("gain", 1.015, 1), ("rate", 1.0, 4)]
)
def test_spoiling_is_what_it_says(way: str, factor: float, every: int) -> None:
    machine = session(Axis(seconds=4.0, seed=5))
    for before, after in zip(machine.runs, dirt.WAYS[way](machine).runs, strict=True):
        old, new = before.channel("motor_torque"), after.channel("motor_torque")
        assert after.sample_rate_hz == before.sample_rate_hz / every
        assert len(new) == pytest.approx(len(old) / every, abs=1)
        if every == 1:
            np.testing.assert_allclose(new, factor * old)
