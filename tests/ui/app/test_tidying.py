"""Widgets that only the garbage collector can end are ended in the GUI thread."""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator

import pytest
from pytestqt.qtbot import QtBot

from fingerlab.ui.app.application import Tidier


class Circle:
    """Refers to itself, and notes in which thread it ends."""

    def __init__(self, ended: list[int]) -> None:
        self.me, self.ended = self, ended

    def __del__(self) -> None:
        self.ended.append(threading.get_ident())


@pytest.fixture
def tidier(qtbot: QtBot) -> Iterator[Tidier]:
    made = Tidier()
    yield made
    made.end()
    assert gc.isenabled()


def hunger() -> None:
    """Ask for so much that Python would collect by itself."""
    kept = [[number] for number in range(200_000)]
    assert len(kept) == 200_000


def test_a_worker_that_asks_for_memory_ends_no_widget(tidier: Tidier) -> None:
    ended: list[int] = []
    Circle(ended)
    worker = threading.Thread(target=hunger)
    worker.start()
    worker.join()
    assert ended == []
    kept = [[number] for number in range(2_000)]
    tidier.tidy()
    assert ended == [threading.get_ident()]
    assert len(kept) == 2_000


def test_the_end_leaves_nothing_and_gives_the_collector_back() -> None:
    ended: list[int] = []
    tidier = Tidier()
    assert not gc.isenabled()
    Circle(ended)
    tidier.end()
    assert ended == [threading.get_ident()]
    assert gc.isenabled()
