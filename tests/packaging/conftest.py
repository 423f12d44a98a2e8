"""The programs below packaging/ as modules: they stand beside the package and are not part of it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True, scope="session")
def packaging_programs() -> Iterator[None]:
    """``import distribution`` and the like, as the programs import each other."""
    folder = str(ROOT / "packaging")
    sys.path.insert(0, folder)
    yield
    sys.path.remove(folder)
