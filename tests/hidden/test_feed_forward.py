"""The committed table of feed-forward trials: each effect asked for has a row, and the figures count them."""

from __future__ import annotations

import statistics
from itertools import groupby
from pathlib import Path

import pytest

from tests.hidden import feed_forward

PAGE = Path(__file__).resolve().parents[2] / feed_forward.PAGE


def tables() -> list[list[list[str]]]:
    """Cells of every table of the page, with its heading and without the line below it."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    blocks = [
        list(block) for is_table, block in groupby(lines, lambda line: line.startswith("|")) if is_table
    ]
    rows = [[[cell.strip() for cell in line.split("|")[1:-1]] for line in block] for block in blocks]
    return [[head, *body] for head, _, *body in rows]


def test_each_effect_is_tried_on_each_bench() -> None:
    head, *_ = tables()[0]
    for title, table in zip(head[1:], tables()[1:], strict=True):
        wanted = feed_forward.ENGINE if "engine" in title else feed_forward.tried()
        assert [row[0] for row in table[1:]] == list(wanted), title
        assert {row[1] for row in table[1:]} == {title.split()[-1]}


def test_the_figures_count_the_rows() -> None:
    counted, *trials = tables()
    for place, table in enumerate(trials, start=1):
        printed = {row[0]: row[place] for row in counted}
        sent = [row for row in table[1:] if row[5] != "-"]
        ratios = [float(row[5]) for row in sent]
        assert printed["benches"] == str(len(table) - 1)
        assert printed["trials"] == str(len(ratios))
        assert float(printed["found / nominal, median of all"]) == pytest.approx(
            statistics.median(ratios), abs=0.01
        )
        both = float(next(value for what, value in printed.items() if what.startswith("what both miss")))
        assert both == pytest.approx(statistics.median(float(row[4]) for row in sent), abs=0.1)
        small = int(printed[f"at most {feed_forward.MEDIAN:g}"].split()[0])
        assert abs(small - sum(ratio <= feed_forward.MEDIAN for ratio in ratios)) <= 1  # rounded in its row
        assert sum(ratio > 1.005 for ratio in ratios) <= int(printed["above 1"].split()[0])


def test_a_trial_that_ended_counts_neither_as_shown_nor_as_worse() -> None:
    entry = {
        "source": "twin",
        "effect": "backlash",
        "seed": 1,
        "effects": ["backlash"],
        "failed": "It ended.",
    }
    counted = dict(feed_forward.figures([entry]))
    assert counted["trials"] == "0"
    assert counted["ended on a doubt, or failed"] == "1"
    assert "It ended." in feed_forward.markdown([entry], "command")
