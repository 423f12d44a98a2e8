"""The committed table of feed-forward trials: each effect asked for has a row, and the figures count them."""

from __future__ import annotations

import statistics
from pathlib import Path

import pytest

from tests.hidden import feed_forward

PAGE = Path(__file__).resolve().parents[2] / feed_forward.PAGE


def rows(columns: int) -> list[list[str]]:
    """Cells of the page's table with so many columns, without its heading."""
    lines = [line.split("|")[1:-1] for line in PAGE.read_text(encoding="utf-8").splitlines()]
    return [[cell.strip() for cell in line] for line in lines if len(line) == columns][2:]


def test_each_effect_of_drive_cable_and_joints_is_tried() -> None:
    tried: dict[str, list[str]] = {}
    for effect, seed, *_ in rows(8):
        tried.setdefault(seed, []).append(effect)
    assert tried
    assert all(effects == list(feed_forward.tried()) for effects in tried.values())


def test_the_figures_count_the_rows() -> None:
    printed = dict(rows(2))
    ratios = [float(cells[5]) for cells in rows(8) if cells[5] != "-"]
    assert printed["benches"] == str(len(rows(8)))
    assert printed["trials"] == str(len(ratios))
    median = next(value for what, value in printed.items() if "median" in what)
    assert float(median) == pytest.approx(statistics.median(ratios), abs=0.01)
    small = int(printed[f"at most {feed_forward.MEDIAN:g}"].split()[0])
    assert abs(small - sum(ratio <= feed_forward.MEDIAN for ratio in ratios)) <= 1  # rounded in its row
    assert sum(ratio > 1.005 for ratio in ratios) <= int(printed["above 1 (wanted: none)"].split()[0])


def test_a_trial_that_ended_counts_neither_as_shown_nor_as_worse() -> None:
    entry = {"effect": "backlash", "seed": 1, "effects": ["backlash"], "failed": "It ended."}
    counted = dict(feed_forward.figures([entry]))
    assert counted["trials"] == "0"
    assert counted["ended on a doubt, or failed"] == "1"
    assert "It ended." in feed_forward.markdown([entry], "command")
