"""The ring: what is read is what was written, whole, in order, and what was lost is counted."""

from __future__ import annotations

import multiprocessing
import struct

import numpy as np
import pytest

from fingerlab.acquisition.ring import Ring
from fingerlab.acquisition.status import SharedStatus, Slot, Text
from tests.acquisition.children import row, write_fast


def test_everything_is_read_once_and_in_order() -> None:
    ring = Ring.make(64, 3, shared=False)
    reader = ring.reader()
    seen: list[float] = []
    for number in range(1000):
        ring.write(row(number))
        if number % 7 == 0:
            piece = reader.read()
            assert piece.lost == 0
            seen += piece.rows[:, 0].tolist()
    seen += reader.read().rows[:, 0].tolist()
    assert seen == [float(k) for k in range(1000)]


def test_a_slow_reader_is_told_how_much_it_lost() -> None:
    ring = Ring.make(64, 3, shared=False)
    reader = ring.reader()
    for number in range(200):
        ring.write(row(number))
    piece = reader.read()
    assert piece.lost == piece.first == 200 - 64 + 4  # a sixteenth is left to the writer
    np.testing.assert_array_equal(piece.rows[:, 0], np.arange(piece.first, 200))
    assert piece.lost + len(piece.rows) == 200


def test_a_row_that_is_being_overwritten_is_not_handed_out() -> None:
    ring = Ring.make(64, 3, shared=False)
    for number in range(64):
        ring.write(row(number))
    # The writer has begun row 64 (its frame and first value are there) and has not published it.
    struct.pack_into("2d", ring._body, 0, 64.0, 64.0)
    first, rows = ring.copy(0, 64)
    assert first == 1
    np.testing.assert_array_equal(rows[:, 0], np.arange(1, 64))


def test_a_row_with_both_frames_right_is_not_handed_out_if_the_writer_passed_meanwhile() -> None:
    """A copy may take a row's end, then its beginning, and be overtaken in the middle."""
    ring = Ring.make(64, 3, shared=False)
    for number in range(64):
        ring.write(row(number))

    class Overtaken:
        def __getitem__(self, index: np.ndarray) -> np.ndarray:
            rows = table[index]
            ring.write(row(64))
            rows[0, 1] = 0.0  # what the writer clears before it fills the row
            return rows

    table, ring._table = ring._table, Overtaken()  # type: ignore[assignment]
    first, rows = ring.copy(0, 64)
    assert first == 2  # row 1 may be under way by now
    np.testing.assert_array_equal(rows[:, 0], np.arange(2, 64))


def test_a_row_that_is_not_wholly_there_yet_is_left_for_later() -> None:
    ring = Ring.make(64, 3, shared=False)
    reader = ring.reader()
    for number in range(10):
        ring.write(row(number))
    struct.pack_into("d", ring._body, 9 * ring._stride + 32, 3.0)  # the last frame has not arrived
    assert reader.read().rows[:, 0].tolist() == list(range(9))
    struct.pack_into("d", ring._body, 9 * ring._stride + 32, 9.0)
    assert reader.read().rows[:, 0].tolist() == [9.0]


def test_two_processes_no_torn_row_and_every_lost_one_counted() -> None:
    ring = Ring.make(512, 3)
    reader, other = ring.reader(), ring.reader()
    count = 60_000
    process = multiprocessing.get_context("spawn").Process(target=write_fast, args=(ring.name, count))
    process.start()
    got = lost = 0
    while True:
        alive = process.is_alive()
        piece = reader.read(300)
        other.read(10)
        got, lost = got + len(piece.rows), lost + piece.lost
        numbers = piece.rows[:, 0]
        np.testing.assert_array_equal(numbers, np.arange(piece.first, piece.first + len(numbers)))
        np.testing.assert_array_equal(piece.rows[:, 1], 2 * numbers)
        np.testing.assert_array_equal(piece.rows[:, 2], -numbers)
        if not alive and not len(numbers):
            break
    assert process.exitcode == 0
    assert got + lost == count
    ring.close()


def test_the_newest_rows_for_a_window() -> None:
    ring = Ring.make(64, 3, shared=False)
    assert ring.last(10).shape == (0, 3)
    for number in range(100):
        ring.write(row(number))
    np.testing.assert_array_equal(ring.last(10)[:, 0], np.arange(90, 100))
    assert len(ring.last(1000)) == 63


def test_foreign_memory_is_refused() -> None:
    board = SharedStatus.make()
    with pytest.raises(ValueError, match="no ring"):
        Ring.attach(str(board.name))
    board.close()


def test_board_keeps_counters_and_sentences_apart() -> None:
    board = SharedStatus.make()
    other = SharedStatus.attach(str(board.name))
    other[Slot.LATE] = 7
    other.set_text(Text.FAULT, "Größe überschritten; " * 100)
    other.set_text(Text.ANSWER, "ja")
    assert board[Slot.LATE] == 7
    assert board.text(Text.FAULT).startswith("Größe überschritten; Größe")
    assert len(board.text(Text.FAULT).encode()) <= 512
    assert board.text(Text.ANSWER) == "ja"
    assert board.text(Text.RECORDER) == ""
    other.close()
    board.close()
