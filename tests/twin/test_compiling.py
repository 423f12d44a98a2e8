"""The compiled plant also runs where nothing can be kept on disk."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numba
import pytest

from fingerlab.twin import integrate

SCRIPT = """
from fingerlab.twin.integrate import slide
print(slide(1.0, 5.0, -2.0, 2.0), type(slide._cache).__name__)
"""


def test_compiles_without_a_place_for_the_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    original = numba.njit

    def nowhere(*arguments: object, **options: object) -> object:
        if options.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return original(*arguments, **options)

    monkeypatch.setattr(integrate.numba, "njit", nowhere)
    assert integrate.compiled(lambda a: a + 1.0)(2.0) == 3.0


def test_keeps_its_code_elsewhere_where_the_package_folder_is_read_only(tmp_path: Path) -> None:
    """numba's own rule: NUMBA_CACHE_DIR, else beside the source, else the user's cache folder.

    A read-only folder cannot be made for an administrator, so the first place is taken by force here.
    """
    import os

    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert done.stdout.split() == ["2.0", "FunctionCache"]
    assert list(tmp_path.rglob("*.nbi"))
