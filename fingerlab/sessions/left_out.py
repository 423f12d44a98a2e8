"""Rows of a table that a run is made without: a few are gaps, and told; many are a fault of the file.

A logger now and then writes a cell empty, a row twice or a last line in part. The row is left out, so that
the run has a gap there, which the diagnosis bridges (``diagnosis/signals/filters.py``). A channel that may be
NaN (``endpoint_force``) is NaN instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fingerlab.core.errors import UserError
from fingerlab.sessions.mapping import Column
from fingerlab.sessions.model import CHANNEL_UNITS, MAY_BE_NAN, Array
from fingerlab.sessions.text_table import TableRows

MOST_SHARE = 0.02
"""Of the rows of a table that may be left out, a last line that is cut off not counted; assumed."""

CUT_OFF = "cut off at the end of the file"
NO_NUMBER = "without a number in a column that is used"
OTHER_WIDTH = "with too few cells or too many"
TWICE = "with the time of the row before"


@dataclass
class RowsLeftOut:
    """How many rows of a table are left out, and why.

    Attributes:
        path: the table's file. counted: what a row is called in it: a line, or a row.
        rows: how many were looked at. whole: whether these are all.
        found: by reason how many, and the line of the first.
        first: line of the first that is no cut-off last line, and what is wrong there.
    """

    path: Path
    counted: str = "line"
    rows: int = 0
    whole: bool = False
    found: dict[str, tuple[int, int]] = field(default_factory=dict)
    first: tuple[int, str] | None = None

    def add(self, reason: str, line: int, words: str) -> None:
        """Count a row, and remember what is wrong in the first of them."""
        count, first = self.found.get(reason, (0, line))
        self.found[reason] = (count + 1, first)
        if self.first is None and reason != CUT_OFF:
            self.first = (line, words)

    def words(self) -> str:
        """Such as ``3 of 7,000 rows are left out: 3 with the time of the row before (first: line 52)``.

        Empty where all are used.
        """
        if not self.found:
            return ""
        said = ", ".join(
            f"{count:,} {reason} ({'first: ' if count > 1 else ''}{self.counted} {line})"
            for reason, (count, line) in self.found.items()
        )
        count = sum(count for count, _ in self.found.values())
        rows = f"{'' if self.whole else 'the first '}{self.rows:,} rows"
        return f"{count:,} of {rows} {'is' if count == 1 else 'are'} left out: {said}"

    def refuse_many(self) -> None:
        """Where more rows are lost than a few.

        Raises:
            UserError: with the first of them.
        """
        count = sum(count for reason, (count, _) in self.found.items() if reason != CUT_OFF)
        if self.first is not None and count > MOST_SHARE * self.rows:
            line, words = self.first
            raise UserError(
                f"{self.path}, {self.counted} {line}{words} ({count:,} of {self.rows:,} rows cannot be used; "
                f"up to {100 * MOST_SHARE:g} % would be left out)."
            )


def kept_rows(
    blocks: Iterable[TableRows], columns: Sequence[Column], left_out: RowsLeftOut
) -> Iterator[tuple[Array, NDArray[np.int64]]]:
    """The rows that a run can be made of, block by block, with their numbers among all rows, from 0.

    Args:
        blocks: of the table. columns: its channels. left_out: filled while the blocks are read.
    """
    needed = [c.index for c in columns if c.channel in CHANNEL_UNITS and c.channel not in MAY_BE_NAN]
    time = next((c.index for c in columns if c.channel == "time"), None)
    before = np.nan
    for rows in blocks:
        wrong = _wrong_rows(rows, needed)
        good = np.setdiff1d(np.arange(len(rows.values)), list(wrong))
        if time is not None and len(good):
            times = rows.values[good, time]
            twice = times == np.concatenate(([before], times[:-1]))
            for row in good[twice].tolist():
                words = f", column {time + 1} holds the time of the row before; it should increase strictly"
                wrong[row] = (TWICE, words)
            before, good = float(times[-1]), good[~twice]
        for row in sorted(wrong):
            left_out.add(wrong[row][0], int(rows.lines[row]), wrong[row][1])
        first = left_out.rows
        left_out.rows += len(rows.values)
        left_out.whole = rows.last
        yield rows.values[good], first + good


def _wrong_rows(rows: TableRows, needed: Sequence[int]) -> dict[int, tuple[str, str]]:
    """Rows in which something needed is no number, by index, with reason and words."""
    wrong: dict[int, tuple[str, str]] = {}
    cells = np.argwhere(~np.isfinite(rows.values[:, needed]))
    for row, place in cells[::-1].tolist():  # of each row the first cell counts
        words = f", column {needed[place] + 1} holds {rows.values[row, needed[place]]}; it should be a number"
        wrong[row] = (NO_NUMBER, words)
    last = len(rows.values) - 1 if rows.last else None
    for fault in reversed(rows.faults):
        if fault.column is None or fault.column in needed:
            reason = NO_NUMBER if fault.column is not None else OTHER_WIDTH
            ends_early = fault.column in (None, rows.values.shape[1] - 1)
            wrong[fault.row] = (CUT_OFF if fault.row == last and ends_early else reason, fault.words)
    return wrong
